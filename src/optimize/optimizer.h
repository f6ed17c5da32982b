/* optimizer.h -- moves the particles of a cohort: docs/method.md, "Step, snapping, schedule", the
 * two stages of the paper, then the fidelity stage of apsm/fidelity.h (12), an epoch of which is a
 * round.
 *
 * One epoch, per shape: near-surface points are drawn, the RBF-shape tells where the particles
 * describe the surface badly (c > 0), the gradients of the sampling, correspondence and
 * eigenshape losses are added up at the epoch's entry positions, one step is made, and the
 * particles return to the surface. */
#ifndef APSM_OPTIMIZER_H
#define APSM_OPTIMIZER_H

#include "initialize/cohort.h"
#include "optimize/options.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { APSM_STAGE_1 = 1, APSM_STAGE_2, APSM_STAGE_FIDELITY, APSM_STAGE_DONE };

/* Why stage 1 left its plateau. */
#define APSM_STOP_LIST(X)                                                                          \
    X(APSM_STOP_NOT_YET, "has not ended")                                                          \
    X(APSM_STOP_MATCHED, "few enough mismatched particles")                                        \
    X(APSM_STOP_STALLED, "no improvement over two passes")                                         \
    X(APSM_STOP_LIMIT, "epoch limit")
#define APSM_STOP_ENUM(name, text) name,
typedef enum apsm_stop { APSM_STOP_LIST(APSM_STOP_ENUM) APSM_STOP_COUNT } apsm_stop;
#undef APSM_STOP_ENUM
const char *apsm_stop_text(apsm_stop stop);

/* Everything that decides what happens next: saving and restoring it changes no byte of the
 * result.  Owns P, mean and own. */
typedef struct apsm_optimizer_state {
    size_t I, J;
    int stage;              /* APSM_STAGE_*; DONE after the last epoch */
    long epoch;             /* epochs of the stage that are behind, jumps counted; below 0 so many
                               are to come before the first, in which particles settle */
    long epochs_run;        /* in both stages */
    double h;               /* length unit of the stage; 0: not yet fixed */
    double best_mismatched; /* least worst-shape share at any pass; 2: no pass yet */
    double doubt;           /* of the fidelity stage: apsm_fidelity_doubt */
    long passes_without_gain;
    apsm_stop stage1_stop;
    double *P;    /* I x J x 3, world frame */
    double *mean; /* J x 3: mean of the last epoch's end (minibatches) */
    size_t own_size;
    double *own; /* own_size: what method psm keeps beside P (apsm/psm.h); in stage 2 with c > 0 P
                    when the RBF factors were last made; P when the fidelity stage began; else
                    NULL */
} apsm_optimizer_state;

apsm_status apsm_optimizer_state_alloc(size_t I, size_t J,
                                       apsm_optimizer_state *state) APSM_NODISCARD;
void apsm_optimizer_state_free(apsm_optimizer_state *state);

/* The terms of the objective, in the order of their columns.  One list makes the enum and the table
 * (optimize/terms.h). */
#define APSM_TERM_LIST(X)                                                                          \
    X(SAMPLING, sampling)                                                                          \
    X(CORRESPONDENCE, correspondence)                                                              \
    X(EIGENSHAPE, eigenshape)                                                                      \
    X(LANDMARKS, landmarks)                                                                        \
    X(FEATURES, features)
#define APSM_TERM_ENUM(upper, lower) APSM_TERM_##upper,
enum { APSM_TERM_LIST(APSM_TERM_ENUM) APSM_TERMS, APSM_TERMS_MOST = 6 };
#undef APSM_TERM_ENUM
/* Of a column of history.csv: a constant text, NULL beyond the last. */
const char *apsm_loss_name(size_t t);

/* What an epoch did.  Means are over the shapes; mismatched is NaN in epochs without a pass of
 * Algorithm 1. */
typedef struct apsm_epoch_record {
    long stage; /* no int: checkpoints hold these bytes, and padding is not ours to decide */
    long epoch; /* in its stage, from 0; below 0: settling, before stage 1 */
    double alpha, gamma, beta, c;
    double loss[APSM_TERMS_MOST]; /* by term; NaN where switched off */
    double surface_error;         /* root mean square of E over h; NaN while c = 0; in
                                     the fidelity stage mean two-way distance */
    double step;                  /* mean move of a particle, in h */
    double mismatched;            /* mean share of particles, 1.5/2.0 */
    double worst_mismatched;      /* of the worst shape */
    long walked;                  /* particles that Algorithm 1 moved */
} apsm_epoch_record;

/* Called after every epoch from the calling thread; may save state.  A status other than
 * APSM_OK ends the run with it. */
typedef apsm_status (*apsm_epoch_fn)(void *user, const apsm_optimizer_state *state,
                                     const apsm_epoch_record *record);

/* Runs state to the end from wherever it is.  On APSM_ERR_INTERRUPTED state is that of the last
 * full epoch.  Results depend on cohort, options, state and the context's seed alone.
 * O(epochs * I * (R J + J^2 if c > 0) + I J^3 + I^2 J) time, O(I J^2 + threads * J^2) memory, or
 * O(I J + threads * J^2) and J^3 in every epoch where the factors of I shapes are more than 1 GB.
 */
apsm_status apsm_optimize(apsm_context *ctx, const apsm_cohort *cohort,
                          const apsm_optimize_options *options, apsm_optimizer_state *state,
                          apsm_epoch_fn on_epoch, void *user) APSM_NODISCARD;

/* Bytes of the factor that an adaptive stage keeps for each of I shapes with J particles; 0: new
 * ones are made in every epoch, as where all of them are more than anyone's memory.  No other limit
 * decides, for it decides the result. */
double apsm_kept_factor_bytes(const apsm_optimize_options *options, size_t I, size_t J);

/* Spreads the particles P (J x 3, in/out, on the surface) of shape i evenly, by the sampling
 * loss alone with falling steps. */
apsm_status apsm_spread(apsm_context *ctx, const apsm_cohort *cohort, size_t i,
                        const apsm_optimize_options *options, size_t J, long epochs,
                        double *P) APSM_NODISCARD;

/* First particles P (I x J x 3, out, world frame): a farthest-point sample of the template, spread,
 * then carried to every shape as options->initialize says.  docs/method.md, "Initialisation".
 * Rows of fixed shapes are in, and stay; if the template is one, its particles are carried.
 * APSM_ERR_GEOMETRY names a shape with fewer vertices than particles. */
apsm_status apsm_first_particles(apsm_context *ctx, const apsm_cohort *cohort,
                                 const apsm_optimize_options *options, size_t J,
                                 double *P) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
