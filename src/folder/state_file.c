#include "folder/state_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "files/checkpoint_file.h"
#include "psm/psm.h"

/* The numbers of a state, apart from its arrays. */
typedef struct state_numbers {
    int64_t I, J, stage, epoch, epochs_run, passes_without_gain, stage1_stop, own_size;
    double h, best_mismatched, doubt;
} state_numbers;

apsm_status state_file_write(apsm_context *ctx, const char *path, const char identity[65],
                             const apsm_optimizer_state *s, const apsm_epoch_record *records,
                             size_t n_records)
{
    apsm_checkpoint_writer *w = NULL;
    const state_numbers n = { (int64_t)s->I,
                              (int64_t)s->J,
                              s->stage,
                              s->epoch,
                              s->epochs_run,
                              s->passes_without_gain,
                              (int64_t)s->stage1_stop,
                              (int64_t)s->own_size,
                              s->h,
                              s->best_mismatched,
                              s->doubt };
    APSM_TRY(apsm_checkpoint_open(ctx, path, &w));
    apsm_checkpoint_add(w, "identity", identity, 65);
    apsm_checkpoint_add(w, "numbers", &n, sizeof n);
    apsm_checkpoint_add(w, "P", s->P, s->I * s->J * 3 * sizeof *s->P);
    apsm_checkpoint_add(w, "mean", s->mean, s->J * 3 * sizeof *s->mean);
    if (s->own_size) apsm_checkpoint_add(w, "own", s->own, s->own_size * sizeof *s->own);
    apsm_checkpoint_add(w, "history", records, n_records * sizeof *records);
    return apsm_checkpoint_commit(w);
}

static apsm_status check_identity(apsm_context *ctx, const char *path, const apsm_checkpoint *c,
                                  const state_file_expected *expected)
{
    char stored[65];
    APSM_TRY(apsm_checkpoint_get(ctx, c, "identity", stored, sizeof stored));
    if (memcmp(stored, expected->identity, sizeof stored) == 0) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_STATE,
                     "%s: belongs to other options, other groomed shapes or another version of "
                     "apsm; run `apsm initialize -o %s` and optimize anew",
                     path, expected->folder);
}

static apsm_status load_history(apsm_context *ctx, const char *path, const apsm_checkpoint *c,
                                apsm_epoch_record **records, size_t *n_records)
{
    size_t bytes;
    const void *history = apsm_checkpoint_find(c, "history", &bytes);
    if (!history || bytes % sizeof **records)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: checkpoint without history", path);
    *n_records = bytes / sizeof **records;
    *records = malloc(bytes ? bytes : 1);
    if (!*records) return APSM_ERR_MEMORY;
    memcpy(*records, history, bytes);
    return APSM_OK;
}

/* Whether `own` has the size that the stage and the method give it. */
static bool own_fits(int method, const state_numbers *n)
{
    const size_t I = (size_t)n->I, J = (size_t)n->J, own = (size_t)n->own_size;
    if (method == APSM_METHOD_PSM) return own == 0 || own == apsm_psm_own_size(I, J);
    if (n->stage != APSM_STAGE_FIDELITY) return true;
    return n->epoch == 0 || (n->epoch > 0 && own == 3 * I * J);
}

/* The checksum says that nobody changed the file by accident; what stands in it must still be a
 * state. */
static apsm_status check_numbers(apsm_context *ctx, const char *path, const apsm_checkpoint *c,
                                 int method, const state_numbers *n)
{
    enum { MOST_EPOCHS = 1 << 30 };
    size_t P_bytes, own_bytes;
    apsm_checkpoint_find(c, "P", &P_bytes);
    apsm_checkpoint_find(c, "own", &own_bytes);
    const bool known = n->stage >= APSM_STAGE_1 && n->stage <= APSM_STAGE_DONE &&
                       n->stage1_stop >= 0 && n->stage1_stop < APSM_STOP_COUNT;
    const bool counted = n->epoch > -MOST_EPOCHS && n->epoch < MOST_EPOCHS && n->epochs_run >= 0 &&
                         n->epochs_run < MOST_EPOCHS && n->passes_without_gain >= 0 &&
                         n->passes_without_gain < MOST_EPOCHS;
    const bool measured = isfinite(n->h) && n->h >= 0 && isfinite(n->best_mismatched) &&
                          isfinite(n->doubt) && n->doubt >= 0;
    const bool held = n->J > 0 && (uint64_t)n->J <= P_bytes && n->own_size >= 0 &&
                      (uint64_t)n->own_size <= own_bytes / sizeof(double);
    if (known && counted && measured && held && own_fits(method, n)) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: holds numbers that no run has written; remove it and start this step "
                     "anew",
                     path);
}

/* Takes n finite numbers. */
static apsm_status take_array(apsm_context *ctx, const char *path, const apsm_checkpoint *c,
                              const char *name, size_t n, double *x)
{
    APSM_TRY(apsm_checkpoint_get(ctx, c, name, x, n * sizeof *x));
    for (size_t k = 0; k < n; k++)
        if (!isfinite(x[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE,
                             "%s: %s[%zu] is no finite number; remove it and start this step anew",
                             path, name, k);
    return APSM_OK;
}

static apsm_status unpack_state(apsm_context *ctx, const char *path, const apsm_checkpoint *c,
                                const state_file_expected *expected, apsm_optimizer_state *s)
{
    state_numbers n;
    APSM_TRY(check_identity(ctx, path, c, expected));
    APSM_TRY(apsm_checkpoint_get(ctx, c, "numbers", &n, sizeof n));
    if (n.I != (int64_t)expected->I || (expected->J > 0 && n.J != (int64_t)expected->J))
        return apsm_fail(ctx, APSM_ERR_STATE, "%s: holds %lld shapes of %lld particles", path,
                         (long long)n.I, (long long)n.J);
    APSM_TRY(check_numbers(ctx, path, c, expected->method, &n));
    APSM_TRY(apsm_optimizer_state_alloc((size_t)n.I, (size_t)n.J, s));
    s->stage = (int)n.stage;
    s->epoch = (long)n.epoch;
    s->epochs_run = (long)n.epochs_run;
    s->passes_without_gain = (long)n.passes_without_gain;
    s->stage1_stop = (apsm_stop)n.stage1_stop;
    s->h = n.h;
    s->best_mismatched = n.best_mismatched;
    s->doubt = n.doubt;
    APSM_TRY(take_array(ctx, path, c, "P", s->I * s->J * 3, s->P));
    APSM_TRY(take_array(ctx, path, c, "mean", s->J * 3, s->mean));
    if (n.own_size == 0) return APSM_OK;
    s->own = malloc((size_t)n.own_size * sizeof *s->own);
    if (!s->own) return APSM_ERR_MEMORY;
    s->own_size = (size_t)n.own_size;
    return take_array(ctx, path, c, "own", s->own_size, s->own);
}

apsm_status state_file_read(apsm_context *ctx, const char *path,
                            const state_file_expected *expected, apsm_optimizer_state *state,
                            apsm_epoch_record **records, size_t *n_records)
{
    *state = (apsm_optimizer_state){ 0 };
    apsm_checkpoint *c = NULL;
    apsm_status status = apsm_checkpoint_read(ctx, path, &c);
    if (status == APSM_OK) status = unpack_state(ctx, path, c, expected, state);
    if (status == APSM_OK && records) status = load_history(ctx, path, c, records, n_records);
    if (status != APSM_OK) apsm_optimizer_state_free(state);
    apsm_checkpoint_free(c);
    return status;
}
