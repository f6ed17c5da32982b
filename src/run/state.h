/* state.h -- checkpoints of the optimiser, and whether they belong to this run. */
#ifndef APSM_RUN_STATE_H
#define APSM_RUN_STATE_H

#include "session/session.h"

/* SHA-256 (hex) over everything that decides the particles: options of the method, seed, and the
 * groomed shapes in their frame.  A checkpoint is good for one identity only. */
apsm_status run_identity(apsm_run *run, char hex[65]);

/* Reads or writes a checkpoint of the optimiser.  history may be NULL; records (out) is
 * malloc'ed. */
apsm_status run_save_state(apsm_run *run, const char *name, const apsm_optimizer_state *state,
                           const apsm_epoch_record *records, size_t n_records);
apsm_status run_load_state(apsm_run *run, const char *name, apsm_optimizer_state *state,
                           apsm_epoch_record **records, size_t *n_records);

#endif
