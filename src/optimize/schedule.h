/* schedule.h -- how the weights fall during a stage.  docs/method.md, "Step, snapping, schedule".
 */
#ifndef APSM_OPTIMIZE_SCHEDULE_H
#define APSM_OPTIMIZE_SCHEDULE_H

#include "core/option.h"
#include "optimize/state.h"

#define APSM_SCHEDULE_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                     \
    REAL(S, adaptivity, 0.5, 0, 1,                                                                 \
         "c in (5): 0 spreads particles evenly, 1 follows the surface error")                      \
    REAL(S, alpha, 5, 0, 1e6, "weight of the sampling loss in stage 1")                            \
    REAL(S, stage2_alpha_factor, 1, 0, 1e6, "alpha of stage 2 relative to alpha")                  \
    REAL(S, beta, 0, 0, 1e6,                                                                       \
         "weight of the eigenshape loss; 0.05 without the fidelity stage, whose prior takes its "  \
         "place")                                                                                  \
    REAL(S, gamma, 0.5, 0, 1e6, "weight of the correspondence loss")                               \
    INT(S, stage1_epochs, 0, 0, 1000000, "most epochs of stage 1 (even spread, c = 0)")            \
    INT(S, stage2_epochs, 0, 0, 1000000, "epochs of stage 2 (adaptive)")                           \
    INT(S, settle_epochs, 50, 0, 1000000,                                                          \
        "most epochs before stage 1, with weights that move particles far, if the first "          \
        "particles "                                                                               \
        "are that badly matched")                                                                  \
    REAL(S, settle_mismatched, 0.1, 0, 1,                                                          \
         "share of them mismatched, on average, from which there are such epochs")                 \
    REAL(S, decay1_at, 0.6, 0, 1, "share of a stage after which alpha and gamma fall first")       \
    REAL(S, decay2_at, 0.85, 0, 1, "share of a stage after which they fall again")                 \
    REAL(S, alpha_decay, 0.5, 0, 1, "what alpha is multiplied with at each decay")                 \
    REAL(S, beta_decay, 0.5, 0, 1, "what beta is multiplied with at each decay")                   \
    REAL(S, gamma_decay1, 0.3, 0, 1, "what gamma is multiplied with at the first decay")           \
    REAL(S, gamma_decay2, 0.5, 0, 1, "what gamma is multiplied with at the second decay")          \
    INT(S, burn_in, 1, 0, 1000, "epochs of the run without correspondence and eigenshape losses")
typedef struct apsm_schedule_options {
    APSM_OPTION_FIELDS(APSM_SCHEDULE_OPTIONS)
} apsm_schedule_options;
typedef struct apsm_optimize_options apsm_optimize_options; /* optimize/options.h */

typedef struct schedule {
    long epochs;         /* of the stage */
    long decay1, decay2; /* epochs at which alpha and gamma fall */
    long pass_interval;  /* epochs between passes of Algorithm 1; 0: none */
    long settle;         /* epochs before the first, -settle to -1, if particles begin far off */
} schedule;

/* The weights of one epoch, as the losses of the paper are weighted. */
typedef struct weights {
    double alpha, beta, gamma, c;
} weights;

schedule schedule_of_stage(const apsm_optimize_options *options, int stage);
weights weights_of_epoch(const apsm_optimize_options *options, const schedule *s, int stage,
                         long epoch, long epochs_run);
bool pass_is_due(const schedule *s, long epoch);
/* Passes of Algorithm 1 in all epochs of the stage, without those of settling. */
size_t passes_of_stage(const schedule *s);

/* Where batch b of I shapes begins, if a batch may have K: as many batches as that needs, of sizes
 * that differ by one at most.  I for the first b beyond the last. */
size_t batch_begin(size_t I, size_t K, size_t b);

/* Whether epochs are to come that draw points near the surfaces: they need the cohort's distance
 * fields. */
bool apsm_draws_points(const apsm_optimize_options *options, const apsm_optimizer_state *state);

#endif
