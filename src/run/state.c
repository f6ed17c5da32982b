/* Checkpoints of the optimiser, and whether they belong to this run. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "files/checkpoint_file.h"
#include "psm/psm.h"
#include "run/landmarks.h"
#include "run/session.h"
#include "run/settings.h"

apsm_status run_identity(apsm_run *run, char hex[65])
{
    APSM_TRY(run_load_meshes(run));
    if (*run->identity) {
        memcpy(hex, run->identity, sizeof run->identity);
        return APSM_OK;
    }
    apsm_sha256 sha;
    unsigned char digest[32];
    apsm_sha256_begin(&sha);
    settings_hash(run, &sha);
    const uint64_t t = run_template_index(run);
    apsm_sha256_add(&sha, &t, sizeof t);
    for (size_t i = 0; i < run->mesh_count; i++) {
        const apsm_mesh *m = &run->mesh[i];
        apsm_sha256_add(&sha, run->names[i], strlen(run->names[i]) + 1);
        apsm_sha256_add(&sha, m->V, 3 * m->nv * sizeof *m->V);
        apsm_sha256_add(&sha, m->F, 3 * m->nf * sizeof *m->F);
        apsm_sha256_add(&sha, run->transforms + 16 * i, 16 * sizeof(double));
        if (run->store) apsm_store_trim(run->store);
    }
    APSM_TRY(landmarks_load(run));
    if (landmarks_use(run) >= APSM_LANDMARKS_ANCHOR && run->landmarks.L > 0)
        apsm_sha256_add(&sha, run->landmarks.x,
                        3 * run->landmarks.I * run->landmarks.L * sizeof *run->landmarks.x);
    const char *features = apsm_run_text(run, "features");
    if (*features) apsm_sha256_add(&sha, features, strlen(features));
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, run->identity);
    memcpy(hex, run->identity, sizeof run->identity);
    return APSM_OK;
}

/* The numbers of a state, apart from its arrays. */
typedef struct state_numbers {
    int64_t I, J, stage, epoch, epochs_run, passes_without_gain, stage1_stop, own_size;
    double h, best_mismatched, doubt;
} state_numbers;

static double *copy_doubles(size_t n, const double *x)
{
    double *copy = malloc((n + 1) * sizeof *copy);
    if (copy && n > 0) memcpy(copy, x, n * sizeof *copy);
    return copy;
}

/* to is freed first. */
static apsm_status copy_state(const apsm_optimizer_state *from, apsm_optimizer_state *to)
{
    apsm_optimizer_state copy = *from;
    copy.P = copy_doubles(from->I * from->J * 3, from->P);
    copy.mean = copy_doubles(from->J * 3, from->mean);
    copy.own = from->own ? copy_doubles(from->own_size, from->own) : NULL;
    apsm_optimizer_state_free(to);
    *to = copy;
    if (copy.P && copy.mean && (copy.own || !from->own)) return APSM_OK;
    apsm_optimizer_state_free(to);
    return APSM_ERR_MEMORY;
}

/* In memory only the first particles are kept: nothing interrupts such a job for good. */
static apsm_status keep_state(apsm_run *run, const char *name, const apsm_optimizer_state *s)
{
    return strcmp(name, RUN_INITIAL) == 0 ? copy_state(s, &run->initial) : APSM_OK;
}

apsm_status run_save_state(apsm_run *run, const char *name, const apsm_optimizer_state *s,
                           const apsm_epoch_record *records, size_t n_records)
{
    char identity[65];
    if (run_is_in_memory(run)) return keep_state(run, name, s);
    APSM_TRY(run_identity(run, identity));
    char *folder = run_path(run, "state"), *path = run_path(run, name);
    apsm_checkpoint_writer *w = NULL;
    apsm_status status = folder && path ? apsm_make_folder(run->ctx, folder) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_checkpoint_open(run->ctx, path, &w);
    if (status == APSM_OK) {
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
        apsm_checkpoint_add(w, "identity", identity, sizeof identity);
        apsm_checkpoint_add(w, "numbers", &n, sizeof n);
        apsm_checkpoint_add(w, "P", s->P, s->I * s->J * 3 * sizeof *s->P);
        apsm_checkpoint_add(w, "mean", s->mean, s->J * 3 * sizeof *s->mean);
        if (s->own_size) apsm_checkpoint_add(w, "own", s->own, s->own_size * sizeof *s->own);
        apsm_checkpoint_add(w, "history", records, n_records * sizeof *records);
        status = apsm_checkpoint_commit(w);
    }
    free(folder);
    free(path);
    return status;
}

static apsm_status check_identity(apsm_run *run, const char *path, const apsm_checkpoint *c)
{
    char stored[65], now[65];
    APSM_TRY(apsm_checkpoint_get(run->ctx, c, "identity", stored, sizeof stored));
    APSM_TRY(run_identity(run, now));
    if (memcmp(stored, now, sizeof now) == 0) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s: belongs to other options, other groomed shapes or another version of "
                     "apsm; run `apsm initialize -o %s` and optimize anew",
                     path, run->folder);
}

static apsm_status load_history(apsm_run *run, const apsm_checkpoint *c,
                                apsm_epoch_record **records, size_t *n_records)
{
    size_t bytes;
    const void *history = apsm_checkpoint_find(c, "history", &bytes);
    if (!history || bytes % sizeof **records)
        return apsm_fail(run->ctx, APSM_ERR_FORMAT, "%s: checkpoint without history", run->folder);
    *n_records = bytes / sizeof **records;
    *records = malloc(bytes ? bytes : 1);
    if (!*records) return APSM_ERR_MEMORY;
    memcpy(*records, history, bytes);
    return APSM_OK;
}

/* Whether `own` has the size that the stage and the method give it. */
static bool own_fits(const apsm_run *run, const state_numbers *n)
{
    const size_t I = (size_t)n->I, J = (size_t)n->J, own = (size_t)n->own_size;
    if (run->options.optimize.method == APSM_METHOD_PSM)
        return own == 0 || own == apsm_psm_own_size(I, J);
    if (n->stage != APSM_STAGE_FIDELITY) return true;
    return n->epoch == 0 || (n->epoch > 0 && own == 3 * I * J);
}

/* The checksum says that nobody changed the file by accident; what stands in it must still be a
 * state. */
static apsm_status check_numbers(apsm_run *run, const char *path, const apsm_checkpoint *c,
                                 const state_numbers *n)
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
    if (known && counted && measured && held && own_fits(run, n)) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_FORMAT,
                     "%s: holds numbers that no run has written; remove it and start this step "
                     "anew",
                     path);
}

/* Takes n finite numbers. */
static apsm_status take_array(apsm_run *run, const char *path, const apsm_checkpoint *c,
                              const char *name, size_t n, double *x)
{
    APSM_TRY(apsm_checkpoint_get(run->ctx, c, name, x, n * sizeof *x));
    for (size_t k = 0; k < n; k++)
        if (!isfinite(x[k]))
            return apsm_fail(run->ctx, APSM_ERR_NONFINITE,
                             "%s: %s[%zu] is no finite number; remove it and start this step anew",
                             path, name, k);
    return APSM_OK;
}

static apsm_status unpack_state(apsm_run *run, const char *path, const apsm_checkpoint *c,
                                apsm_optimizer_state *s)
{
    state_numbers n;
    APSM_TRY(check_identity(run, path, c));
    APSM_TRY(apsm_checkpoint_get(run->ctx, c, "numbers", &n, sizeof n));
    if (n.I != (int64_t)run->project.n ||
        (n.J != run->options.optimize.particles && !run->options.optimize.search.particles_auto))
        return apsm_fail(run->ctx, APSM_ERR_STATE, "%s: holds %lld shapes of %lld particles", path,
                         (long long)n.I, (long long)n.J);
    APSM_TRY(check_numbers(run, path, c, &n));
    APSM_TRY(apsm_optimizer_state_alloc((size_t)n.I, (size_t)n.J, s));
    s->stage = (int)n.stage;
    s->epoch = (long)n.epoch;
    s->epochs_run = (long)n.epochs_run;
    s->passes_without_gain = (long)n.passes_without_gain;
    s->stage1_stop = (apsm_stop)n.stage1_stop;
    s->h = n.h;
    s->best_mismatched = n.best_mismatched;
    s->doubt = n.doubt;
    APSM_TRY(take_array(run, path, c, "P", s->I * s->J * 3, s->P));
    APSM_TRY(take_array(run, path, c, "mean", s->J * 3, s->mean));
    if (n.own_size == 0) return APSM_OK;
    s->own = malloc((size_t)n.own_size * sizeof *s->own);
    if (!s->own) return APSM_ERR_MEMORY;
    s->own_size = (size_t)n.own_size;
    return take_array(run, path, c, "own", s->own_size, s->own);
}

apsm_status run_load_state(apsm_run *run, const char *name, apsm_optimizer_state *state,
                           apsm_epoch_record **records, size_t *n_records)
{
    *state = (apsm_optimizer_state){ 0 };
    if (records) *records = NULL;
    if (run_is_in_memory(run)) return copy_state(&run->initial, state);
    char *path = run_path(run, name);
    apsm_checkpoint *c = NULL;
    apsm_status status = path ? apsm_checkpoint_read(run->ctx, path, &c) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = unpack_state(run, path, c, state);
    if (status == APSM_OK && records) status = load_history(run, c, records, n_records);
    if (status != APSM_OK) apsm_optimizer_state_free(state);
    apsm_checkpoint_free(c);
    free(path);
    return status;
}
