/* fit_model.h -- a finished model with all that a new shape is fitted by.  Read-only once made, so
 * many threads may use one. */
#ifndef APSM_FIT_FIT_MODEL_H
#define APSM_FIT_FIT_MODEL_H

#include "align/align.h"
#include "align/registration.h"
#include "apsm/fit.h"
#include "fit/posterior.h"
#include "initialize/cohort.h"
#include "model/shape_model.h"
#include "optimize/fidelity.h"
#include "options/options.h"

enum {
    FIT_BANDS = 4
}; /* shares of the particles that are missing (1: all, but there are landmarks): */
extern const double fit_band_missing[FIT_BANDS];
extern const double fit_band_slip; /* factor for what calibration in particles does not see: the
                                      pose slides along what is left, points take wrong partners */

/* What left-out shapes say about the model; plain numbers, stored with it.  Lengths in h. */
typedef struct fit_calibration {
    double modes;                 /* of the prior: as many as predict left-out shapes best */
    double noise;                 /* variance of a coordinate beside modes and smooth process */
    double smooth;                /* variance of a coordinate in the smooth process */
    double reach;                 /* exp(-d^2 / 2 reach^2) of it is shared at a distance d */
    double band[FIT_BANDS];       /* factors on standard deviations of missing particles */
    double mahalanobis;           /* left-out shapes' F of (45) over what it should be on average */
    double residual;              /* root mean square miss of a coordinate by the modes, typical */
    double residual_most;         /* and of the worst left-out shape */
    double size_least, size_most; /* of the shapes, relative to the mean's */
    double distance;              /* two-way, mean over the shapes; 0: not measured */
    double distance_most;         /* of the worst shape */
    double pose; /* residual of the poses of some shapes, over the radius: typical */
} fit_calibration;
enum { FIT_CALIBRATION = sizeof(fit_calibration) / sizeof(double) };

struct apsm_fit_model {
    char *path;   /* for messages */
    char *labels; /* of the cohort's segmentations; NULL: none were chosen */
    char *unit;   /* of lengths; NULL: not known */
    apsm_options options;
    apsm_shape_model model; /* world frame, with scores */
    double *T;              /* J x 3: the template's particles */
    apsm_cohort cohort;     /* the template alone */
    fit_calibration calibration;
    double cropped;   /* 1: the shapes were cropped to what all of them hold */
    double oriented;  /* 1: shapes come in one orientation, */
    double common[9]; /* which this rotation takes to the world's */
    /* made from the above */
    double h;
    double *TN;                /* J x 3: normals of T */
    apsm_surface_point *S;     /* J: where they are on its mesh */
    apsm_fidelity *fidelity;   /* template, warp, neighbours */
    apsm_fidelity_prior prior; /* one fold */
    apsm_registration *registration;
    apsm_cloud cloud, dense; /* of the template */
    posterior_model posterior;
    double *store; /* of the posterior's arrays */
    double mirror; /* residual of the template's mirror image, over the radius of its cloud */
    double radius; /* root mean square distance of the mean's particles from their centre */
};

/* From parts that are there (all up to common) to the rest. */
apsm_status fit_model_prepare(apsm_context *ctx, apsm_fit_model *m) APSM_NODISCARD;
/* The template's mesh (taken over, also in an error) becomes the model's cohort. */
apsm_status fit_model_take_mesh(apsm_context *ctx, apsm_mesh *mesh,
                                apsm_fit_model *m) APSM_NODISCARD;

/* Calibration from particles P (I x J x 3) of the model's shapes; m->h is known. */
apsm_status fit_calibrate(apsm_context *ctx, const double *P, apsm_fit_model *m) APSM_NODISCARD;

/* Modes, noise, residuals and the scale of Mahalanobis distances alone: m's shape model, options
 * and h are known, and nothing else of it. */
apsm_status fit_calibrate_scores(apsm_context *ctx, const double *P,
                                 apsm_fit_model *m) APSM_NODISCARD;

/* The model that the other shapes make (at least 3), with the same template. */
apsm_status fit_model_without(apsm_context *ctx, const apsm_fit_model *m, const bool *left_out,
                              apsm_fit_model **without) APSM_NODISCARD;

/* How new shapes are groomed: as the cohort was, and where its shapes are open, be it by what
 * constraints left of them, openings stay. */
apsm_groom_options fit_model_groom(const apsm_fit_model *m);

/* Particles of all shapes of a model: mean + scores; P (I x J x 3, out). */
void fit_model_particles(const apsm_shape_model *model, double *P);

/* Standard deviation, in h, with which landmarks are placed. */
extern const double fit_placing;
/* Variance, in h^2, with which a surface tells where a particle is along its normal. */
extern const double fit_part_error;

/* Modes of the smooth process of variance 1 at J points X: columns of a pivoted Cholesky factor of
 * exp(-|x - y|^2 / 2 reach^2), at most `most` of them; column (most x J, out).  Returns how many;
 * scratch of J. */
size_t fit_smooth_columns(size_t J, const double *X, double reach, size_t most, double *column,
                          double *work);
/* Mean and modes of J particles, borrowed. */
typedef struct fit_modes {
    size_t J, modes;
    const double *mean;     /* 3 J */
    const double *mode;     /* modes x 3 J */
    const double *variance; /* modes */
} fit_modes;

/* What is beside the modes: a smooth process of that variance and reach, and what no neighbour
 * shares. */
typedef struct fit_process {
    double smooth, reach, noise;
} fit_process;

/* A posterior model of D = 3 J of both.  store of fit_posterior_size(J, modes). */
enum { FIT_SMOOTH = 24 };
size_t fit_posterior_size(size_t J, size_t modes);
posterior_model fit_posterior_make(const fit_modes *m, const fit_process *p, double *store);

#endif
