/* state_file.h -- state/initial.ckpt and state/optimize.ckpt: where the optimisation is. */
#ifndef APSM_FOLDER_STATE_FILE_H
#define APSM_FOLDER_STATE_FILE_H

#include "optimize/optimizer.h"

/* Writes atomically.  identity: hex and its end, of everything that decides the particles. */
apsm_status state_file_write(apsm_context *ctx, const char *path, const char identity[65],
                             const apsm_optimizer_state *state, const apsm_epoch_record *records,
                             size_t n_records) APSM_NODISCARD;

/* What a state must be of. */
typedef struct state_file_expected {
    const char *folder;   /* for messages */
    const char *identity; /* [65] */
    size_t I, J;          /* J 0: any number of particles */
    int method;           /* APSM_METHOD_* */
} state_file_expected;

/* state (out, {0} on failure) and *records (out, malloc'ed; NULL: not asked for). */
apsm_status state_file_read(apsm_context *ctx, const char *path,
                            const state_file_expected *expected, apsm_optimizer_state *state,
                            apsm_epoch_record **records, size_t *n_records) APSM_NODISCARD;

#endif
