#include "run/session.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/adapters.h"
#include "apsm/affine.h"
#include "apsm/checkpoint_file.h"
#include "apsm/linalg.h"
#include "apsm/particles_file.h"
#include "apsm/report.h"
#include "files/io.h"
#include "files/stored.h"
#include "geometry/stored.h"
#include "run/groom_inputs.h"
#include "run/kept.h"
#include "run/manifest.h"
#include "run/outputs.h"

/* ---- texts beside the option table ---- */

static const char *const texts[] = { "labels",   "reflect_match",  "exclude",
                                     "template", "original_frame", "seed" };
enum { TEXTS = sizeof texts / sizeof texts[0] };

/* Options that can change without making the particles different. */
static const char *const harmless[] = { "definition",        "specificity_samples",
                                        "specificity_modes", "surface_distance",
                                        "original_frame",    "checkpoint_seconds" };

static bool is_one_of(const char *const *words, size_t n, const char *word)
{
    for (size_t k = 0; k < n; k++)
        if (strcmp(words[k], word) == 0) return true;
    return false;
}

static bool is_text(const char *key)
{
    return is_one_of(texts, TEXTS, key);
}
static bool is_harmless(const char *key)
{
    return is_one_of(harmless, sizeof harmless / sizeof harmless[0], key);
}

const char *apsm_run_text(const apsm_run *run, const char *name)
{
    const char *text = apsm_project_get(&run->project, "apsm", name);
    return text ? text : "";
}

const apsm_options *apsm_run_options(const apsm_run *run)
{
    return &run->options;
}

/* ---- paths ---- */

char *run_path(const apsm_run *run, const char *name)
{
    return apsm_path_join(run->folder, name);
}

char *run_pathf(const apsm_run *run, const char *format, ...)
{
    va_list args, again;
    va_start(args, format);
    va_copy(again, args);
    const int length = vsnprintf(NULL, 0, format, args);
    va_end(args);
    char *name = length < 0 ? NULL : malloc((size_t)length + 1), *path = NULL;
    if (name) {
        vsnprintf(name, (size_t)length + 1, format, again);
        path = run_path(run, name);
    }
    va_end(again);
    free(name);
    return path;
}

/* ---- settling the options ---- */

static apsm_status take_seed(apsm_run *run, const char *text)
{
    char *end;
    const unsigned long long seed = strtoull(text, &end, 10);
    if (end == text || *end || *text == '-')
        return apsm_fail(run->ctx, APSM_ERR_ARG, "seed = %s: give a whole number >= 0", text);
    apsm_context_set_seed(run->ctx, seed);
    return APSM_OK;
}

static apsm_status take_pair(apsm_run *run, const char *key, const char *value)
{
    if (strcmp(key, "preset") == 0) return apsm_options_preset(run->ctx, &run->options, value);
    if (!is_text(key)) return apsm_options_set(run->ctx, &run->options, key, value);
    if (strcmp(key, "seed") == 0) APSM_TRY(take_seed(run, value));
    return apsm_project_set(&run->project, "apsm", key, value);
}

/* Options stored by a run with this folder; what we no longer know is an error, not a guess. */
static apsm_status take_stored(apsm_run *run)
{
    const size_t n = apsm_project_count(&run->project, "apsm");
    for (size_t k = 0; k < n; k++) {
        const char *key, *value;
        apsm_project_pair(&run->project, "apsm", k, &key, &value);
        if (strcmp(key, "version") == 0 || strcmp(key, "template_used") == 0) continue;
        if (strcmp(key, "seed") == 0) APSM_TRY(take_seed(run, value));
        if (!is_text(key)) APSM_TRY(apsm_options_set(run->ctx, &run->options, key, value));
    }
    return APSM_OK;
}

static apsm_status refuse_change(apsm_run *run, const char *key, const char *before,
                                 const char *after)
{
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s: the run that --resume continues has %s = %s, not %s; drop the option, or "
                     "start anew without --resume",
                     run->folder, key, *before ? before : "(none)", *after ? after : "(none)");
}

/* With resume: what was asked for must be what the run began with.  Harmless options may change,
 * and then what depends on them is made again: the checkpoint's particles only written again. */
static apsm_status refuse_changes(apsm_run *run, const apsm_options *before)
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    for (size_t k = 0; k < n; k++) {
        char a[64], b[64];
        APSM_TRY(apsm_options_get(before, table[k].name, a));
        APSM_TRY(apsm_options_get(&run->options, table[k].name, b));
        if (strcmp(a, b) == 0) continue;
        if (!is_harmless(table[k].name)) return refuse_change(run, table[k].name, a, b);
        if (strcmp(table[k].name, "checkpoint_seconds") != 0) stage_undo(run, "evaluate");
    }
    return APSM_OK;
}

static apsm_status refuse_other_text(apsm_run *run, const char *key, const char *value)
{
    if (!is_text(key) || strcmp(apsm_run_text(run, key), value) == 0) return APSM_OK;
    if (!is_harmless(key)) return refuse_change(run, key, apsm_run_text(run, key), value);
    stage_undo(run, "optimize"); /* original_frame: particles/ */
    return APSM_OK;
}

/* Of the project's texts, those that are not in the option table; owned by the caller. */
static apsm_status copy_texts(const apsm_run *run, char *copy[TEXTS + 1])
{
    for (size_t k = 0; k <= TEXTS; k++) {
        const char *key = k < TEXTS ? texts[k] : "template_used";
        APSM_TRY(apsm_text_set(&copy[k], apsm_project_get(&run->project, "apsm", key)));
    }
    return APSM_OK;
}

/* All options in the project, in one order, whichever were given and how. */
static apsm_status store_in_order(apsm_run *run, char *const copy[TEXTS + 1])
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    apsm_project_clear(&run->project, "apsm");
    APSM_TRY(apsm_project_set(&run->project, "apsm", "version", APSM_VERSION));
    for (size_t k = 0; k < n; k++) {
        char text[64];
        APSM_TRY(apsm_options_get(&run->options, table[k].name, text));
        APSM_TRY(apsm_project_set(&run->project, "apsm", table[k].name, text));
    }
    for (size_t k = 0; k < TEXTS; k++)
        if (copy[k]) APSM_TRY(apsm_project_set(&run->project, "apsm", texts[k], copy[k]));
    char seed[32];
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)apsm_context_seed(run->ctx));
    APSM_TRY(apsm_project_set(&run->project, "apsm", "seed", seed));
    return copy[TEXTS] ? apsm_project_set(&run->project, "apsm", "template_used", copy[TEXTS])
                       : APSM_OK;
}

static apsm_status store_options(apsm_run *run)
{
    char *copy[TEXTS + 1] = { NULL };
    apsm_status status = copy_texts(run, copy);
    if (status == APSM_OK) status = store_in_order(run, copy);
    for (size_t k = 0; k <= TEXTS; k++) free(copy[k]);
    return status;
}

static apsm_status settle_options(apsm_run *run, const apsm_run_settings *s)
{
    run->options = apsm_options_defaults();
    /* A model made anew from inputs owes nothing to the one that it replaces. */
    if (run->overwrite && run->n_inputs > 0) apsm_project_clear(&run->project, "apsm");
    APSM_TRY(take_stored(run));
    const apsm_options before = run->options;
    const bool goes_on = run->resume && apsm_project_get(&run->project, "apsm", "version");
    for (size_t k = 0; k < s->n_set; k++) {
        const char *key = s->set[k][0], *value = s->set[k][1];
        if (goes_on) APSM_TRY(refuse_other_text(run, key, value));
        APSM_TRY(take_pair(run, key, value));
    }
    if (goes_on) APSM_TRY(refuse_changes(run, &before));
    APSM_TRY(apsm_options_check(run->ctx, &run->options));
    return store_options(run);
}

/* ---- opening and closing ---- */

static apsm_status copy_inputs(apsm_run *run, const apsm_run_settings *s)
{
    run->inputs = calloc(s->n_inputs + 1, sizeof *run->inputs);
    if (!run->inputs) return APSM_ERR_MEMORY;
    for (; run->n_inputs < s->n_inputs; run->n_inputs++)
        APSM_TRY(apsm_text_set(&run->inputs[run->n_inputs], s->inputs[run->n_inputs]));
    return APSM_OK;
}

static apsm_status open_project(apsm_run *run, bool fresh)
{
    if (fresh) return apsm_project_init(run->ctx, run->folder, &run->project);
    char *path = run_path(run, RUN_PROJECT);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_file_exists(path)
                                   ? apsm_project_read(run->ctx, path, &run->project)
                                   : apsm_project_init(run->ctx, run->folder, &run->project);
    free(path);
    return status;
}

/* Before a folder is made for them. */
static apsm_status try_settings(apsm_run *run, const apsm_run_settings *s)
{
    run->options = apsm_options_defaults();
    for (size_t k = 0; k < s->n_set; k++)
        if (!is_text(s->set[k][0])) APSM_TRY(take_pair(run, s->set[k][0], s->set[k][1]));
    return apsm_options_check(run->ctx, &run->options);
}

static apsm_status open_all(apsm_run *run, const apsm_run_settings *s)
{
    if (!apsm_is_folder(s->folder)) APSM_TRY(try_settings(run, s));
    APSM_TRY(apsm_text_set(&run->folder, s->folder));
    APSM_TRY(copy_inputs(run, s));
    if (!s->dry) {
        APSM_TRY(apsm_make_folder(run->ctx, run->folder));
        APSM_TRY(apsm_lock_folder(run->ctx, run->folder, &run->lock));
    }
    if (run->lock.fd >= 0) APSM_TRY(outputs_tidy(run));
    APSM_TRY(open_project(run, s->fresh));
    APSM_TRY(manifest_open(run));
    if (run->resume && !s->dry) APSM_TRY(kept_take_up(run));
    return settle_options(run, s);
}

apsm_status apsm_run_open(apsm_context *ctx, const apsm_run_settings *settings, apsm_run **out)
{
    *out = NULL;
    apsm_linalg_single_thread();
    apsm_run *run = calloc(1, sizeof *run);
    if (!run) return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory");
    run->ctx = ctx;
    run->lock.fd = -1;
    run->memory = settings->memory;
    run->resume = settings->resume;
    run->overwrite = settings->overwrite;
    const apsm_status status = open_all(run, settings);
    if (status == APSM_OK)
        *out = run;
    else
        apsm_run_close(run);
    return status;
}

static void keep_house(void *user)
{
    apsm_store_trim(user);
}

/* state/ may be there already; the store's file shows in no folder. */
apsm_status run_open_store(apsm_run *run, apsm_store **store)
{
    *store = run->store;
    if (run->store || run->memory == 0) return APSM_OK;
    char *folder = run_path(run, "state");
    apsm_status status = folder ? apsm_make_folder(run->ctx, folder) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_store_open(run->ctx, folder, run->memory, &run->store);
    if (status == APSM_OK) apsm_context_set_between(run->ctx, keep_house, run->store);
    free(folder);
    *store = run->store;
    return status;
}

static void close_store(apsm_run *run)
{
    if (!run->store) return;
    apsm_context_set_between(run->ctx, NULL, NULL);
    apsm_store_close(run->store);
    run->store = NULL;
}

void run_free_mesh(apsm_mesh *mesh, bool stored)
{
    array_list arrays = { 0 };
    mesh_arrays(mesh, &arrays);
    if (stored) arrays_forget(&arrays);
    apsm_mesh_free(mesh);
}

void run_unload(apsm_run *run)
{
    apsm_cohort_free(&run->cohort);
    for (size_t i = 0; run->mesh && i < run->mesh_count; i++)
        run_free_mesh(&run->mesh[i], run->meshes_stored);
    run->identity[0] = '\0';
    run->meshes_stored = false;
    free(run->mesh);
    free(run->names);
    free(run->transforms);
    run->mesh = NULL;
    run->mesh_count = 0;
    run->names = NULL;
    run->transforms = NULL;
}

void apsm_run_close(apsm_run *run)
{
    if (!run) return;
    run_unload(run);
    kept_close(run);
    close_store(run);
    manifest_close(run);
    apsm_project_free(&run->project);
    apsm_unlock_folder(&run->lock);
    for (size_t k = 0; k < run->n_inputs; k++) free(run->inputs[k]);
    free(run->inputs);
    free(run->folder);
    free(run);
}

apsm_status run_remove(apsm_run *run, char *path)
{
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    if (apsm_file_exists(path) && remove(path) != 0)
        status = apsm_fail_errno(run->ctx, path, "cannot be removed", errno);
    free(path);
    return status;
}

apsm_status run_write_project(apsm_run *run)
{
    char *path = run_path(run, RUN_PROJECT);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_project_write(run->ctx, path, &run->project);
    free(path);
    return status;
}

/* ---- loading what groom left ---- */

static apsm_status load_mesh(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const apsm_run *run = user;
    char *path = apsm_project_path(&run->project, run->project.subjects[i].groomed);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_vtk_read_mesh(ctx, path, &run->mesh[i]);
    free(path);
    if (status == APSM_OK && run->store) {
        array_list arrays = { 0 };
        mesh_arrays(&run->mesh[i], &arrays);
        status = store_put(ctx, run->store, &arrays);
        if (status != APSM_OK) apsm_mesh_free(&run->mesh[i]);
    }
    return status;
}

static apsm_status load_groomed(apsm_run *run)
{
    const size_t n = run->project.n;
    run->names = calloc(n, sizeof *run->names);
    run->transforms = calloc(n * 16, sizeof *run->transforms);
    run->mesh = calloc(n, sizeof *run->mesh);
    if (!run->names || !run->transforms || !run->mesh) return APSM_ERR_MEMORY;
    run->mesh_count = n;
    apsm_store *store;
    APSM_TRY(run_open_store(run, &store));
    run->meshes_stored = store != NULL;
    for (size_t i = 0; i < n; i++) {
        run->names[i] = run->project.subjects[i].name;
        memcpy(run->transforms + 16 * i, run->project.subjects[i].alignment, 16 * sizeof(double));
    }
    return apsm_parallel_for(run->ctx, n, load_mesh, run, NULL);
}

apsm_status run_load_meshes(apsm_run *run)
{
    if (run->mesh) return APSM_OK;
    if (run->project.n == 0 && kept_is_there(run))
        return apsm_fail(run->ctx, APSM_ERR_STATE,
                         "%s: grooming has not ended; go on with `apsm run --resume -o %s`",
                         run->folder, run->folder);
    if (run->project.n == 0)
        return apsm_fail(run->ctx, APSM_ERR_STATE,
                         "%s: no project here; start with `apsm groom INPUT... -o %s`", run->folder,
                         run->folder);
    for (size_t i = 0; i < run->project.n; i++)
        if (!run->project.subjects[i].groomed)
            return apsm_fail(run->ctx, APSM_ERR_STATE,
                             "%s: %s has not been groomed; run `apsm groom -o %s`", run->folder,
                             run->project.subjects[i].name, run->folder);
    const apsm_status status = load_groomed(run);
    if (status != APSM_OK) run_unload(run);
    return status;
}

size_t run_template_index(const apsm_run *run)
{
    return apsm_project_find(&run->project, apsm_run_text(run, "template_used"));
}

/* Scale of a transform: cube root of its determinant. */
static double scale_of(const double M[16])
{
    const double det = M[0] * (M[5] * M[10] - M[6] * M[9]) - M[1] * (M[4] * M[10] - M[6] * M[8]) +
                       M[2] * (M[4] * M[9] - M[5] * M[8]);
    return cbrt(fabs(det));
}

apsm_status run_load_cohort(apsm_run *run, bool with_fields)
{
    if (run->cohort.I > 0 && (run->cohort.shape[0].field || !with_fields)) return APSM_OK;
    apsm_cohort_free(&run->cohort);
    APSM_TRY(run_load_meshes(run));
    const size_t t = run_template_index(run);
    if (t >= run->project.n)
        return apsm_fail(run->ctx, APSM_ERR_STATE, "%s: the project names no template; groom again",
                         run->folder);
    const apsm_options *o = &run->options;
    const double s = scale_of(run->transforms + 16 * t);
    const double h =
        apsm_expected_spacing(s * s * apsm_mesh_area(&run->mesh[t]), (size_t)o->particles);
    const double voxel = with_fields ? o->field_voxel * h : 0;
    const double band = 1.1 * o->band * o->dipole * h; /* h is seldom expected too small by more */
    apsm_store *store;
    APSM_TRY(run_open_store(run, &store));
    return apsm_cohort_build_in(run->ctx, store, run->project.n, run->names, run->mesh,
                                run->transforms, t, voxel, band, &run->cohort);
}

/* ---- checkpoints ---- */

void run_hash_options(const apsm_run *run, apsm_sha256 *sha)
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    for (size_t k = 0; k < n; k++) {
        char text[64];
        if (is_harmless(table[k].name)) continue;
        if (apsm_options_get(&run->options, table[k].name, text) != APSM_OK) continue;
        apsm_sha256_add(sha, table[k].name, strlen(table[k].name) + 1);
        apsm_sha256_add(sha, text, strlen(text) + 1);
    }
    const uint64_t seed = apsm_context_seed(run->ctx), record = sizeof(apsm_epoch_record);
    apsm_sha256_add(sha, &seed, sizeof seed);
    /* Another version would go on differently, and may keep other records. */
    apsm_sha256_add(sha, APSM_VERSION, sizeof APSM_VERSION);
    apsm_sha256_add(sha, &record, sizeof record);
}

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
    run_hash_options(run, &sha);
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
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, run->identity);
    memcpy(hex, run->identity, sizeof run->identity);
    return APSM_OK;
}

/* The numbers of a state, apart from its arrays. */
typedef struct state_numbers {
    int64_t I, J, stage, epoch, epochs_run, passes_without_gain, stage1_stop, own_size;
    double h, best_mismatched;
} state_numbers;

apsm_status run_save_state(apsm_run *run, const char *name, const apsm_optimizer_state *s,
                           const apsm_epoch_record *records, size_t n_records)
{
    char identity[65];
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
                                  s->best_mismatched };
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

static apsm_status unpack_state(apsm_run *run, const char *path, const apsm_checkpoint *c,
                                apsm_optimizer_state *s)
{
    state_numbers n;
    APSM_TRY(check_identity(run, path, c));
    APSM_TRY(apsm_checkpoint_get(run->ctx, c, "numbers", &n, sizeof n));
    if (n.I != (int64_t)run->project.n ||
        (n.J != run->options.particles && !run->options.particles_auto))
        return apsm_fail(run->ctx, APSM_ERR_STATE, "%s: holds %lld shapes of %lld particles", path,
                         (long long)n.I, (long long)n.J);
    APSM_TRY(apsm_optimizer_state_alloc((size_t)n.I, (size_t)n.J, s));
    s->stage = (int)n.stage;
    s->epoch = (long)n.epoch;
    s->epochs_run = (long)n.epochs_run;
    s->passes_without_gain = (long)n.passes_without_gain;
    s->stage1_stop = (apsm_stop)n.stage1_stop;
    s->h = n.h;
    s->best_mismatched = n.best_mismatched;
    APSM_TRY(apsm_checkpoint_get(run->ctx, c, "P", s->P, s->I * s->J * 3 * sizeof *s->P));
    APSM_TRY(apsm_checkpoint_get(run->ctx, c, "mean", s->mean, s->J * 3 * sizeof *s->mean));
    if (n.own_size <= 0) return APSM_OK;
    s->own = malloc((size_t)n.own_size * sizeof *s->own);
    if (!s->own) return APSM_ERR_MEMORY;
    s->own_size = (size_t)n.own_size;
    return apsm_checkpoint_get(run->ctx, c, "own", s->own, s->own_size * sizeof *s->own);
}

apsm_status run_load_state(apsm_run *run, const char *name, apsm_optimizer_state *state,
                           apsm_epoch_record **records, size_t *n_records)
{
    *state = (apsm_optimizer_state){ 0 };
    if (records) *records = NULL;
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

/* ---- particles ---- */

typedef struct particle_files {
    apsm_run *run;
    size_t J;
    const double *P;
} particle_files;

/* Writes one file and stores its path, relative to the folder, in *slot. */
static apsm_status write_frame(apsm_context *ctx, const apsm_run *run, const char *name,
                               const char *frame, size_t J, const double *P, char **slot)
{
    char relative[1024];
    if (snprintf(relative, sizeof relative, "particles/%s_%s.particles", name, frame) >=
        (int)sizeof relative)
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: name too long", name);
    char *path = run_path(run, relative);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_particles_write(ctx, path, J, P);
    free(path);
    if (status == APSM_OK && slot) status = apsm_text_set(slot, relative);
    return status;
}

/* The 16 numbers of the project's column, separated by spaces. */
static apsm_status parse_reflection(apsm_context *ctx, const char *name, const char *text,
                                    double M[16])
{
    for (int k = 0; k < 16; k++) {
        text += strspn(text, " ");
        const size_t length = strcspn(text, " ");
        if (!apsm_parse_number(text, length, &M[k]))
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s: reflection in the project is not 16 numbers; groom again", name);
        text += length;
    }
    return APSM_OK;
}

static apsm_status write_original(apsm_context *ctx, const apsm_run *run, const apsm_subject *s,
                                  size_t J, double *P)
{
    double M[16], inverse[16];
    const char *text = apsm_subject_column(s, "reflection");
    if (text) {
        APSM_TRY(parse_reflection(ctx, s->name, text, M));
        APSM_TRY(apsm_affine_invert(M, inverse));
        apsm_affine_apply(inverse, J, P, P);
    }
    return write_frame(ctx, run, s->name, "original", J, P, NULL);
}

static apsm_status write_subject(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const particle_files *f = user;
    apsm_subject *s = &f->run->project.subjects[i];
    const double *world = f->P + i * f->J * 3;
    double inverse[16], *local = malloc(f->J * 3 * sizeof *local);
    if (!local) return APSM_ERR_MEMORY;
    apsm_status status = apsm_affine_invert(f->run->transforms + 16 * i, inverse);
    if (status == APSM_OK) {
        apsm_affine_apply(inverse, f->J, world, local);
        status = write_frame(ctx, f->run, s->name, "local", f->J, local, &s->local_particles);
    }
    if (status == APSM_OK)
        status = write_frame(ctx, f->run, s->name, "world", f->J, world, &s->world_particles);
    if (status == APSM_OK && strcmp(apsm_run_text(f->run, "original_frame"), "true") == 0)
        status = write_original(ctx, f->run, s, f->J, local);
    free(local);
    return status;
}

apsm_status run_write_particles(apsm_run *run, size_t J, const double *P)
{
    char *folder = run_path(run, "particles");
    if (!folder) return APSM_ERR_MEMORY;
    apsm_status status = apsm_make_folder(run->ctx, folder);
    free(folder);
    particle_files f = { run, J, P };
    if (status == APSM_OK)
        status = apsm_parallel_for(run->ctx, run->project.n, write_subject, &f, NULL);
    return status == APSM_OK ? run_write_project(run) : status;
}

/* ---- all steps ---- */

apsm_status apsm_run_all(apsm_run *run)
{
    static const struct {
        const char *stage;
        apsm_status (*step)(apsm_run *);
    } steps[] = { { "groom", apsm_run_groom },
                  { "initialize", apsm_run_initialize },
                  { "optimize", apsm_run_optimize },
                  { "evaluate", apsm_run_evaluate } };
    if (run->resume && stage_is_done(run, "groom")) {
        APSM_TRY(groom_inputs_compare(run));
        APSM_TRY(outputs_check(run));
    }
    for (size_t k = 0; k < sizeof steps / sizeof steps[0]; k++)
        if (!run->resume || !stage_is_done(run, steps[k].stage)) APSM_TRY(steps[k].step(run));
    run_unload(run); /* the report reads what it needs */
    return apsm_run_report(run);
}

apsm_status apsm_run_report(apsm_run *run)
{
    APSM_TRY(apsm_report_write(run->ctx, run->folder));
    APSM_TRY(outputs_record(run, "report"));
    return manifest_write(run);
}
