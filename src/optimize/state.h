/* state.h -- where an optimisation is, and what its epochs came to. */
#ifndef APSM_OPTIMIZE_STATE_H
#define APSM_OPTIMIZE_STATE_H

#include <stddef.h>

#include "apsm/context.h"

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
 * result.  Owns P, mean, own and part. */
/* Of one of several parts: what its own surfaces decide. */
typedef struct apsm_part_state {
    double h, doubt;
} apsm_part_state;

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
    apsm_part_state *part; /* of several parts, each with its h and doubt, once the optimisation has
                              begun; h above is then their mean by particles.  NULL: one part */
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

#endif
