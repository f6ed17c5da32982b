/* fidelity.h -- the stage after the two of the paper: particles move along the surface so that the
 * template, warped to them, fits the shape itself.  Equation (12) of docs/method.md. */
#ifndef APSM_FIDELITY_H
#define APSM_FIDELITY_H

#include "apsm/options.h"
#include "initialize/cohort.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_fidelity_options {
    double fidelity;      /* F in (0, 1]: the prior weighs prior doubt (1 - F) / F; 1: no prior */
    double prior;         /* weight of the prior at F = 1/2, times the doubt: 85 */
    double stay;          /* lambda: pull to where the stage began: 0.02 */
    double smooth;        /* mu: displacements from the mean are smooth: 1 */
    double order;         /* nu: neighbours of the template stay neighbours: 16 */
    long modes;           /* of the prior; -1: as many as predict left-out shapes best */
    long rounds;          /* prior and shapes in turn: 12 */
    long iterations;      /* most Gauss-Newton steps of a shape in a round: 1 */
    size_t points;        /* of either surface, about; all if it has fewer: 1000 */
    double floor;         /* distances below this count as squares; in h: 0.05 */
    double ceiling;       /* and so do those above this; in h: 0.1 */
    double clip;          /* longest move of a particle in a step; in h: 0.25 */
    const bool *left_out; /* cohort's I, borrowed: shapes that no prior is made from; NULL: none */
} apsm_fidelity_options;
apsm_fidelity_options apsm_fidelity_defaults(void);
/* The defaults, and what the options of the method say of them. */
apsm_fidelity_options apsm_fidelity_of(const apsm_options *options);

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
