/* fit.h -- a finished model meets a new shape: corresponding particles, what is missing, scores,
 * and whether the shape is one of the model's kind.  The model is loaded once and never changes;
 * fits may run in many threads, and one shape's result does not depend on the others.
 *
 * Experimental: may still change. */
#ifndef APSM_FIT_H
#define APSM_FIT_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/evaluate.h"
#include "apsm/mesh.h"
#include "apsm/options.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_fit_model apsm_fit_model;

/* From a model folder that has been evaluated, or a file of apsm_fit_model_write.  A model needs
 * three shapes.  *model is owned by the caller, NULL on failure. */
APSM_API apsm_status apsm_fit_model_load(apsm_context *ctx, const char *path,
                                         apsm_fit_model **model) APSM_NODISCARD;
/* One file that holds all that fits need (docs/formats.md), atomically. */
APSM_API apsm_status apsm_fit_model_write(apsm_context *ctx, const apsm_fit_model *model,
                                          const char *path) APSM_NODISCARD;
APSM_API void apsm_fit_model_free(apsm_fit_model *model); /* NULL is allowed */

APSM_API size_t apsm_fit_model_particles(const apsm_fit_model *model);
APSM_API size_t apsm_fit_model_shapes(const apsm_fit_model *model);
APSM_API const apsm_options *apsm_fit_model_options(const apsm_fit_model *model);
APSM_API const apsm_mesh *
apsm_fit_model_mesh(const apsm_fit_model *model); /* the template's; world frame */

/* Which hand a shape has: found out, that of the model, the other one. */
enum { APSM_HAND_AUTO, APSM_HAND_SAME, APSM_HAND_OTHER };
/* How much of the surface is there: told by openings, all, a part. */
enum { APSM_EXTENT_AUTO, APSM_EXTENT_WHOLE, APSM_EXTENT_PART };

/* Grows at its end, as all structs here do; 0 is the default. */
typedef struct apsm_fit_options {
    int hand;
    int extent;
    bool aligned;        /* the shape is in the model's world frame: no pose is searched for */
    bool force;          /* fit a stranger nevertheless */
    const double *start; /* 16, borrowed: about the map from the input's frame to the model's world,
                            from which alone a whole surface is registered; NULL: it is looked for.
                            Of apsm_fit_surface alone; APSM_ERR_ARG: not finite, singular, or of
                            another hand than `hand` says */
} apsm_fit_options;
static inline apsm_fit_options apsm_fit_defaults(void) /* auto, auto, false, false, NULL */
{
    const apsm_fit_options defaults = { APSM_HAND_AUTO, APSM_EXTENT_AUTO, false, false, NULL };
    return defaults;
}

typedef enum apsm_fit_verdict {
    APSM_FIT_GOOD,
    APSM_FIT_REVIEW, /* fitted; reason says what to look at */
    APSM_FIT_REFUSED /* not of the model's kind; there are no particles */
} apsm_fit_verdict;
APSM_API const char *
apsm_fit_verdict_text(apsm_fit_verdict verdict); /* "good", "needs review", "refused" */

enum { APSM_FIT_REASON = 256 };

/* Owns its arrays; zero-initialise with {0}. */
typedef struct apsm_fit {
    apsm_fit_verdict verdict;
    char reason[APSM_FIT_REASON]; /* "" if good */
    size_t J, modes;
    bool partial;          /* fitted as a part of a surface, or by landmarks */
    bool mirrored;         /* the mirror image was fitted */
    double M[16];          /* input frame to world; det < 0 if mirrored */
    double reflection[16]; /* input to local frame: the identity unless mirrored */
    apsm_mesh cropped;     /* what of the surface was fitted, in the input's frame, if the model's
                              shapes were cropped and this one is longer; else empty */
    double cropped_share;  /* of the surface that was taken away; 0: none */
    double pose_residual;  /* of the template's surface against the shape's, over the radius */
    double runner_up;    /* residual of the best clearly different pose over that; INFINITY: none */
    double mirror_ratio; /* residual of the other hand over that of the one taken; INFINITY: not
                            tried */
    double *local, *world, *original; /* J x 3; original: in the frame of the input */
    double *score;                    /* modes: lengths */
    double *variance;                 /* modes: of the model, to read the scores by */
    double *sd;            /* J: standard deviation of a particle, root mean of its coordinates' */
    double *sd_normal;     /* J: the same along the surface's normal */
    bool *observed;        /* J: the surface is there */
    apsm_mesh mesh;        /* the template's, warped to the particles; world frame */
    double *mesh_sd;       /* mesh.nv: along the normal */
    bool *mesh_observed;   /* mesh.nv */
    double observed_share; /* of the particles */
    double counted_share;  /* of the given surface, points or landmarks: what was believed */
    bool has_distance;
    apsm_surface_distance distance; /* of the shape's surface and the warped template's */
    double h;                       /* mean distance of neighbouring particles on the template */
    double mahalanobis, tail;       /* of the scores, and how probable a larger one is; NAN: of so
                                       few shapes no mode holds for others */
    size_t mahalanobis_modes;
    double residual, residual_usual; /* miss of a coordinate by the modes, and that of left-out
                                        shapes; lengths */
    bool has_certificate, certified;
    size_t lost, swaps, folds;
    double off_surface; /* most, in h */
} apsm_fit;
APSM_API void apsm_fit_free_sized(apsm_fit *fit, size_t size);
static inline void apsm_fit_free(apsm_fit *fit)
{
    apsm_fit_free_sized(fit, sizeof *fit);
}

/* What a fit is asked for, and the place of its result, as large as the program knows them: the
 * functions below fill this in. */
typedef struct apsm_fit_call {
    const apsm_fit_options *options;
    size_t options_size;
    apsm_fit *fit;
    size_t fit_size;
} apsm_fit_call;

/* mesh (borrowed): in any pose; closed and clean (as groomed) where it is whole.  name is for
 * messages.  A stranger is no failure: see verdict.  fit is overwritten, not freed. */
APSM_API apsm_status apsm_fit_surface_sized(apsm_context *ctx, const apsm_fit_model *model,
                                            const char *name, const apsm_mesh *mesh,
                                            const apsm_fit_call *call) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_fit_surface(apsm_context *ctx,
                                                          const apsm_fit_model *model,
                                                          const char *name, const apsm_mesh *mesh,
                                                          const apsm_fit_options *options,
                                                          apsm_fit *fit)
{
    const apsm_fit_call call = { options, sizeof *options, fit, sizeof *fit };
    return apsm_fit_surface_sized(ctx, model, name, mesh, &call);
}

/* The same from n points (n x 3) on the surface, without order: a cloud, of all of it or a part.
 * Ten at least. */
APSM_API apsm_status apsm_fit_points_sized(apsm_context *ctx, const apsm_fit_model *model,
                                           const char *name, size_t n, const double *x,
                                           const apsm_fit_call *call) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status
apsm_fit_points(apsm_context *ctx, const apsm_fit_model *model, const char *name, size_t n,
                const double *x, const apsm_fit_options *options, apsm_fit *fit)
{
    const apsm_fit_call call = { options, sizeof *options, fit, sizeof *fit };
    return apsm_fit_points_sized(ctx, model, name, n, x, &call);
}

/* From n landmarks alone: x (n x 3) on the shape, on_mean (n x 3) the same points on the model's
 * mean shape (in the world frame).  Three at least; four to tell a hand. */
APSM_API apsm_status apsm_fit_landmarks_sized(apsm_context *ctx, const apsm_fit_model *model,
                                              const char *name, size_t n, const double *on_mean,
                                              const double *x,
                                              const apsm_fit_call *call) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_fit_landmarks(
    apsm_context *ctx, const apsm_fit_model *model, const char *name, size_t n,
    const double *on_mean, const double *x, const apsm_fit_options *options, apsm_fit *fit)
{
    const apsm_fit_call call = { options, sizeof *options, fit, sizeof *fit };
    return apsm_fit_landmarks_sized(ctx, model, name, n, on_mean, x, &call);
}

/* ---- files ---- */

/* What `apsm fit` is asked for; borrowed. */
typedef struct apsm_fit_settings {
    const char *model; /* model folder or file */
    size_t n_inputs;
    const char *const *inputs; /* as of apsm_input_expand */
    const char *landmarks;     /* file of named points on the mean shape (meshes/mean.ply), or NULL:
                                  then inputs that are point files are clouds, else landmarks */
    const char *labels, *reflect_match, *exclude; /* "" or NULL: none */
    const char *folder;                           /* where results go */
    bool overwrite;                               /* results of an earlier fit in folder */
    const apsm_fit_options *options;              /* NULL: the defaults */
    size_t options_size;                          /* sizeof *options */
    /* Of several processes: the inputs shard, shard + shards, ... (from 0, by their names) are
     * fitted and kept in state/ of the folder, and nothing else is written; the same call without
     * finds them there.  shards 0: all inputs. */
    size_t shard, shards;
} apsm_fit_settings;

/* How many shapes ended how; failed: could not be read or groomed. */
typedef struct apsm_fit_totals {
    size_t good, review, refused, failed;
} apsm_fit_totals;

/* Fits every input and writes fit.json, fit.csv, and for each shape particles, mesh and figures
 * (docs/formats.md).  One shape after the other is in memory for each thread.  A shape that is
 * refused or cannot be read is in the tables with its reason and does not end the call.  Of a share
 * the totals are 0.
 * APSM_ERR_STATE: the folder holds something else. */
APSM_API apsm_status apsm_fit_run_sized(apsm_context *ctx, const apsm_fit_settings *settings,
                                        size_t size, apsm_fit_totals *totals,
                                        size_t totals_size) APSM_NODISCARD;
static inline APSM_NODISCARD apsm_status apsm_fit_run(apsm_context *ctx,
                                                      const apsm_fit_settings *settings,
                                                      apsm_fit_totals *totals)
{
    return apsm_fit_run_sized(ctx, settings, sizeof *settings, totals, sizeof *totals);
}

#ifdef __cplusplus
}
#endif
#endif
