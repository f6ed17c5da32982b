/* schedule.h -- how the weights fall during a stage.  docs/method.md, "Step, snapping, schedule".
 */
#ifndef APSM_OPTIMIZE_SCHEDULE_H
#define APSM_OPTIMIZE_SCHEDULE_H

#include "apsm/options.h"

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

schedule schedule_of_stage(const apsm_options *options, int stage);
weights weights_of_epoch(const apsm_options *options, const schedule *s, int stage, long epoch,
                         long epochs_run);
bool pass_is_due(const schedule *s, long epoch);
/* Passes of Algorithm 1 in all epochs of the stage, without those of settling. */
size_t passes_of_stage(const schedule *s);

/* Where batch b of I shapes begins, if a batch may have K: as many batches as that needs, of sizes
 * that differ by one at most.  I for the first b beyond the last. */
size_t batch_begin(size_t I, size_t K, size_t b);

#endif
