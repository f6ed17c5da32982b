/* workspace.h -- what the optimisation loop works on: one struct for its whole run. */
#ifndef APSM_OPTIMIZE_WORKSPACE_H
#define APSM_OPTIMIZE_WORKSPACE_H

#include "initialize/cohort.h"
#include "linalg/polyharmonic.h"
#include "model/warp.h"
#include "optimize/fidelity.h"
#include "optimize/options.h"
#include "optimize/schedule.h"
#include "optimize/state.h"

/* Scratch of one thread.  Point arrays have room for R points, particle arrays for J. */
typedef struct worker {
    double *B, *D, *f, *E, *g, *kbar, *dL_df; /* R x 3, then R each */
    double *gs, *gc, *ge;                     /* J x 3 each: scratch */
    double *grad;                             /* terms x J x 3 */
    double *rbf_store, *factor_store, *rbf_work, *sampling_work;
    double *eigen_work; /* K */
} worker;

/* What the losses of one shape came to in the current epoch. */
typedef struct shape_record {
    double loss[APSM_TERMS_MOST], error2, step;
} shape_record;

typedef struct term term; /* terms.h */

/* The factor of a shape's RBF system at state->own, for the epochs that follow. */
typedef struct kept_factor {
    apsm_polyharmonic f;
    double *store; /* its arrays; NULL until they are needed */
    bool ready;
} kept_factor;

typedef struct optimizer {
    apsm_context *ctx;
    const apsm_cohort *cohort;
    const apsm_optimize_options *o;
    apsm_optimizer_state *state;
    size_t I, J, R, K; /* K: most shapes in a batch */
    bool quiet;        /* no progress: a step of something larger */
    schedule schedule;
    size_t n_terms;
    const term *const *terms;       /* n_terms */
    double figure[APSM_TERMS_MOST]; /* of the epoch so far, where a term has one of the batch */
    weights w;
    long epoch_seed; /* names the epoch's random streams */
    /* the template at the epoch's start */
    double *tP, *tN, *h_j; /* J x 3, J x 3, J */
    uint32_t *N6;          /* J x 6 */
    bool *on_rim;          /* J: the template's particles that lie on its rim */
    /* the current batch */
    size_t batch_size;
    size_t *order; /* I: shapes of the epoch in the order of the batches */
    const size_t *batch;
    double *mean;          /* J x 3: of this batch, or the lagged one */
    double *Y, *L;         /* K x 3J, K x K */
    double *step;          /* K x 3J */
    double *N;             /* I x 3J: normals where fresh */
    bool *fresh;           /* I: N belongs to P */
    double *template_pull; /* K x 3J if template_gradient, else NULL */
    apsm_warp anchors;     /* of the template's landmarks, at the epoch's start; nv 0: none */
    uint32_t *guess;       /* I x J: where the surface was last; saves time, changes nothing else */
    double eigenshape;
    shape_record *record;    /* I */
    kept_factor *kept;       /* I if factors serve for several epochs, else NULL */
    apsm_fidelity *fidelity; /* of the last stage; NULL before */
    int workers;
    worker *worker;
} optimizer;

/* Takes the memory for the cohort, state and terms; on failure nothing is left to be freed. */
apsm_status optimizer_alloc(apsm_context *ctx, const apsm_cohort *cohort,
                            const apsm_optimize_options *o, size_t n_terms,
                            const term *const *terms, apsm_optimizer_state *state, optimizer *op);
void optimizer_free(optimizer *op);
void optimizer_free_factors(optimizer *op);

/* malloc of n numbers, not of nothing. */
double *optimizer_doubles(size_t n);

/* P_i */
static inline double *particles(const optimizer *op, size_t i)
{
    return op->state->P + i * op->J * 3;
}

#endif
