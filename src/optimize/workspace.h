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
    double *eigen_work; /* K, and with features 3 row_particles + 4 F */
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
    size_t I, J, R, K; /* K: most shapes in a batch; J, R of this part, or of all */
    size_t d, first;   /* which part this is (part_of), and where its particles begin in a row */
    size_t all;        /* particles in a row: of all parts */
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
    double *rows;          /* K x 3 row_particles: Y and features, see term_eigenshape.c; NULL */
    size_t row_particles;  /* J, and as many more as hold the features */
    double *step;          /* K x 3J */
    double *N;             /* I x 3J: normals where fresh */
    bool *fresh;           /* parts x I: N belongs to P */
    double *template_pull; /* K x 3J if template_gradient, else NULL */
    apsm_warp *anchors; /* parts: of the template's landmarks, at the epoch's start; nv 0: none */
    uint32_t *guess;    /* I x J: where the surface was last; saves time, changes nothing else */
    double eigenshape;
    shape_record *record;     /* parts x I */
    kept_factor *kept;        /* parts x I if factors serve for several epochs, else NULL */
    apsm_fidelity **fidelity; /* parts: of the last stage; NULL before */
    int workers;
    worker *worker;
} optimizer;

/* Takes the memory for the cohort, state and terms; on failure nothing is left to be freed. */
apsm_status optimizer_alloc(apsm_context *ctx, const apsm_cohort *cohort,
                            const apsm_optimize_options *o, size_t n_terms,
                            const term *const *terms, apsm_optimizer_state *state, optimizer *op);
void optimizer_free(optimizer *op);
void optimizer_free_factors(optimizer *op);

/* R for J particles. */
size_t points_of(const apsm_optimize_options *o, size_t J);

/* malloc of n numbers, not of nothing. */
double *optimizer_doubles(size_t n);

/* Row i of what has three numbers for every particle. */
static inline double *row_of(const optimizer *op, double *rows, size_t i)
{
    return rows + (i * op->all + op->first) * 3;
}
/* P_i */
static inline double *particles(const optimizer *op, size_t i)
{
    return row_of(op, op->state->P, i);
}
static inline uint32_t *guess_of(const optimizer *op, size_t i)
{
    return op->guess + i * op->all + op->first;
}

/* ---- parts.c ---- */

/* One part as if it were all: the same rows, entered where its particles begin, with its own
 * surfaces and length unit.  Terms of surfaces see nothing else. */
typedef struct part_view {
    optimizer op;
    apsm_optimizer_state state;
} part_view;
/* op itself if there is only one part; else made in view.  Numbers that are set in it are lost. */
optimizer *part_of(optimizer *op, size_t d, part_view *view);

/* A figure of parts, by their particles: *sum becomes the mean of those up to part d. */
void add_part(const optimizer *op, size_t d, double x, double *sum);

/* Room for the particles of all shapes of any part alone (I x its particles x 3); NULL: of one
 * part, or out of memory. */
double *part_rows(const optimizer *op);

#endif
