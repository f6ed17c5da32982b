/* fidelity.h -- the stage after the two of the paper: particles move along the surface so that the
 * template, warped to them, fits the shape itself.  Equation (12) of docs/method.md. */
#ifndef APSM_FIDELITY_H
#define APSM_FIDELITY_H

#include "core/option.h"
#include "initialize/cohort.h"

#ifdef __cplusplus
extern "C" {
#endif

/* fidelity_points: all if a surface has fewer. */
#define APSM_FIDELITY_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                     \
    REAL(S, fidelity, 0.5, 0, 1,                                                                   \
         "F: after stage 2 particles fit the warped template to the surfaces (12); what was "      \
         "known before weighs (1 - F)/F times what is measured to suit; 0: no such stage")         \
    INT(S, fidelity_rounds, 12, 1, 1000, "rounds of the fidelity stage")                           \
    INT(S, fidelity_modes, -1, -1, 100000,                                                         \
        "modes of the prior in (12); -1: as many as predict left-out shapes best")                 \
    INT(S, fidelity_points, 1000, 100, 10000000,                                                   \
        "vertices of either surface, about, that (12) sums over")                                  \
    REAL(S, contact, 30, 0, 1000,                                                                  \
         "of a joint: weight of the penalty on rebuilt surfaces that go into the subject's other " \
         "parts, against what the surfaces have to say; grows to this over the rounds; 0: none")   \
    FIXED(S, double, prior, 190.0, "weight of the prior at F = 1/2 and a doubt of 1")              \
    FIXED(S, double, recall, 80.0, "of the pull to where the stage began, at the same")            \
    FIXED(S, double, stay, 0.005, "lambda in (12): that pull where nothing is left open")          \
    FIXED(S, double, smooth, 0.7, "mu in (12): displacements are smooth")                          \
    FIXED(S, double, common, 0.5, "from where: this share of the way from mean to template")       \
    FIXED(S, double, order, 16.0, "nu in (12): neighbours of the template stay neighbours")        \
    FIXED(S, long, iterations, 1, "most Gauss-Newton steps of a shape in a round")                 \
    FIXED(S, double, floor, 0.05, "distances below this count as squares, in h")                   \
    FIXED(S, double, ceiling, 0.1, "and so do those above this, in h")                             \
    FIXED(S, long, dense, 400, "unknowns of a shape up to which nothing is left out of H")         \
    FIXED(S, long, coarse, 256, "particles that take the first rounds of twice as many or more")   \
    FIXED(S, double, clip, 0.25, "longest move of a particle in a step, in h")
typedef struct apsm_fidelity_options {
    APSM_OPTION_FIELDS(APSM_FIDELITY_OPTIONS)
    const bool *left_out; /* cohort's I, borrowed: shapes that no prior is made from; NULL: none */
} apsm_fidelity_options;
apsm_fidelity_options apsm_fidelity_defaults(void);

/* What the other shapes suggest for one shape, lengths in h: mean and modes of probabilistic PCA
 * (Tipping and Bishop 1999).  Precision up to a factor: S = 1 - sum over modes of weight u u^T,
 * weight = 1 - sqrt(noise / variance).  Owns its arrays. */
typedef struct apsm_fidelity_prior {
    size_t I, J, modes, folds; /* shape i belongs to fold i % folds */
    double *noise;             /* folds: variance of a coordinate beside the modes, in h^2 */
    double *mean;              /* folds x 3J */
    double *mode;              /* folds x modes x 3J: orthonormal rows */
    double *weight;            /* folds x modes */
    double gain; /* log-likelihood of left-out shapes, a shape, over that without modes */
} apsm_fidelity_prior;

/* From particles P (I x J x 3), h and the wanted modes (-1: chosen).  Every fold's model is made
 * from the shapes outside it; up to 32 shapes are folds of their own, and at most 256 shapes,
 * evenly taken, make the models.  Those whose flag in left_out (I; NULL: none) is set make none;
 * two others are needed.  I >= 2.  O(folds I^3 + folds modes I J) with I <= 256. */
apsm_status apsm_fidelity_prior_fit(apsm_context *ctx, size_t I, size_t J, const double *P,
                                    double h, long modes, const bool *left_out,
                                    apsm_fidelity_prior *prior) APSM_NODISCARD;
void apsm_fidelity_prior_free(apsm_fidelity_prior *prior);

/* What stays the same during the stage: warp of the template, its neighbours and triangles. */
typedef struct apsm_fidelity apsm_fidelity;

/* The cohort is borrowed; T (J x 3): the template's particles, which do not move.
 * O(nv J^2) time, 8 nv J bytes. */
apsm_status apsm_fidelity_new(apsm_context *ctx, const apsm_cohort *cohort, size_t J,
                              const double *T, const apsm_fidelity_options *options,
                              apsm_fidelity **fidelity) APSM_NODISCARD;
void apsm_fidelity_free(apsm_fidelity *fidelity);
double apsm_fidelity_spacing(const apsm_fidelity *fidelity); /* h */
/* How much the surfaces leave to the prior, measured in the middle of the rounds (0 before):
 * whoever goes on with a stage after that sets it. */
double apsm_fidelity_doubt(const apsm_fidelity *fidelity);
void apsm_fidelity_set_doubt(apsm_fidelity *fidelity, double doubt);

/* What a round did, means over the shapes without the template. */
typedef struct apsm_fidelity_record {
    double before, after; /* two-way distance on the round's points, in h */
    double step;          /* move of a particle, in h */
    size_t moved, kept;   /* shapes that moved; that have particles the certificate sent back */
    size_t modes;         /* of the prior */
    double noise;         /* its standard deviation beside the modes, in h */
} apsm_fidelity_record;

/* Round 0, 1, ...: the prior is made from P, then every shape takes Gauss-Newton steps.  P0
 * (I x J x 3) are the particles when the stage began, P (in/out) those now.  The prior weighs from
 * the middle of the rounds on; before, a round makes no shape's two-way distance on the round's
 * points larger.  After the last one a shape's certificate is no worse than at P0. */
apsm_status apsm_fidelity_round(apsm_context *ctx, apsm_fidelity *fidelity, long round,
                                const double *P0, double *P,
                                apsm_fidelity_record *record) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
