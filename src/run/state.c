/* Checkpoints of the optimiser, and whether they belong to this run. */
#include "run/state.h"

#include <stdlib.h>
#include <string.h>

#include "folder/state_file.h"
#include "run/fixed.h"
#include "run/landmarks.h"
#include "run/shapes.h"
#include "session/session.h"
#include "session/settings.h"

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
        apsm_sha256_add_text(&sha, run->names[i]);
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
    APSM_TRY(fixed_hash(run, &sha));
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, run->identity);
    memcpy(hex, run->identity, sizeof run->identity);
    return APSM_OK;
}

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
    copy.part = NULL; /* a run is of one part */
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
    apsm_status status = folder && path ? apsm_make_folder(run->ctx, folder) : APSM_ERR_MEMORY;
    if (status == APSM_OK)
        status = state_file_write(run->ctx, path, identity, s, records, n_records);
    free(folder);
    free(path);
    return status;
}

apsm_status run_load_state(apsm_run *run, const char *name, apsm_optimizer_state *state,
                           apsm_epoch_record **records, size_t *n_records)
{
    const apsm_optimize_options *o = &run->options.optimize;
    const bool any = o->search.particles_auto;
    char identity[65];
    *state = (apsm_optimizer_state){ 0 };
    if (records) *records = NULL;
    if (run_is_in_memory(run)) return copy_state(&run->initial, state);
    APSM_TRY(run_identity(run, identity));
    const state_file_expected expected = { run->folder, identity, run->project.n,
                                           any ? 0 : (size_t)o->particles, o->method };
    char *path = run_path(run, name);
    const apsm_status status =
        path ? state_file_read(run->ctx, path, &expected, state, records, n_records)
             : APSM_ERR_MEMORY;
    free(path);
    return status;
}
