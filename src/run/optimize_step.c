/* The optimisation in a model folder: from state/initial.ckpt, or from the last checkpoint, to
 * particles/ and history.csv. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "folder/history_csv.h"
#include "optimize/particle_search.h"
#include "optimize/snap.h"
#include "psm/psm.h"
#include "run/particles.h"
#include "run/shapes.h"
#include "run/state.h"
#include "session/guard.h"
#include "session/manifest.h"
#include "session/session.h"

/* Of the time, at most so much goes into checkpoints, unless one is wanted after every epoch. */
static const double checkpoint_share = 0.01;

/* What on_epoch needs; records grows by doubling. */
typedef struct recorder {
    apsm_run *run;
    apsm_epoch_record *records;
    size_t n, capacity;
    double saved_at, save_took; /* seconds on clock; of the last checkpoint */
    stage_clock clock;
} recorder;

static apsm_status append_record(recorder *r, const apsm_epoch_record *record)
{
    if (r->n >= r->capacity) {
        const size_t capacity = 2 * r->n + 64;
        apsm_epoch_record *grown = realloc(r->records, capacity * sizeof *grown);
        if (!grown) return APSM_ERR_MEMORY;
        r->records = grown;
        r->capacity = capacity;
    }
    r->records[r->n++] = *record;
    return APSM_OK;
}

static apsm_status save_now(const recorder *r, const apsm_optimizer_state *state)
{
    if (r->run->helps) return APSM_OK;
    return run_save_state(r->run, RUN_CHECKPOINT, state, r->records, r->n);
}

static apsm_status on_epoch(void *user, const apsm_optimizer_state *state,
                            const apsm_epoch_record *record)
{
    recorder *r = user;
    APSM_TRY(append_record(r, record));
    const double wanted = r->run->options.writing.checkpoint_seconds, now = stage_wall(&r->clock);
    if (wanted > 0 && now - r->saved_at < fmax(wanted, r->save_took / checkpoint_share))
        return APSM_OK;
    APSM_TRY(save_now(r, state));
    r->saved_at = stage_wall(&r->clock);
    r->save_took = r->saved_at - now;
    return APSM_OK;
}

static apsm_status write_history(const recorder *r)
{
    if (run_is_in_memory(r->run)) return APSM_OK;
    char *path = run_path(r->run, FOLDER_HISTORY);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = history_csv_write(r->run->ctx, path, r->n, r->records);
    free(path);
    return status;
}

/* ---- the step ---- */

static apsm_status has_file(const apsm_run *run, const char *name, bool *has)
{
    *has = run_is_in_memory(run) && strcmp(name, RUN_INITIAL) == 0 && run->initial.I > 0;
    if (run_is_in_memory(run)) return APSM_OK;
    char *path = run_path(run, name);
    if (!path) return APSM_ERR_MEMORY;
    *has = apsm_file_exists(path);
    free(path);
    return APSM_OK;
}

static apsm_status load_start(apsm_run *run, apsm_optimizer_state *state, recorder *r)
{
    bool begun, initial;
    APSM_TRY(has_file(run, RUN_CHECKPOINT, &begun));
    APSM_TRY(has_file(run, RUN_INITIAL, &initial));
    if (run->resume && begun) {
        APSM_TRY(run_load_state(run, RUN_CHECKPOINT, state, &r->records, &r->n));
        r->capacity = r->n;
        apsm_log(run->ctx, APSM_LOG_INFO, "resuming stage %d at epoch %ld", state->stage,
                 state->epoch);
        return APSM_OK;
    }
    if (!initial)
        return apsm_fail(run->ctx, APSM_ERR_STATE,
                         "%s: no initial particles; run `apsm initialize -o %s` first",
                         run_place(run), run_place(run));
    return run_load_state(run, RUN_INITIAL, state, NULL, NULL);
}

static apsm_status finish(apsm_run *run, const apsm_optimizer_state *state, const recorder *r)
{
    if (state->stage1_stop == APSM_STOP_MATCHED || state->stage1_stop == APSM_STOP_STALLED)
        apsm_log(run->ctx, APSM_LOG_INFO, "stage 1 ended before its last epoch: %s",
                 apsm_stop_text(state->stage1_stop));
    APSM_TRY(write_history(r));
    APSM_TRY(run_write_particles(run, state->J, state->P));
    APSM_TRY(save_now(r, state));
    return stage_end(run, "optimize", &r->clock);
}

static void tell_search(apsm_run *run, const apsm_particle_search *found)
{
    apsm_log(run->ctx, found->met ? APSM_LOG_INFO : APSM_LOG_WARNING,
             found->met ? "%zu particles meet the error: %.4g on %zu shapes left out (wanted: %.4g)"
                        : "no number of particles meets the error: %zu leave %.4g on %zu shapes "
                          "left out (wanted: %.4g); a larger fidelity or more faces may do",
             found->J, found->error, found->left_out, run->options.optimize.search.error);
}

/* Between stage 2 and the fidelity stage: the number of particles that meets the error, and state
 * with as many. */
static apsm_status search_particles(apsm_run *run, apsm_optimizer_state *state)
{
    apsm_particle_search found;
    APSM_TRY(apsm_search_particles(run->ctx, &run->cohort, &run->options.optimize, state->J,
                                   state->P, &found));
    tell_search(run, &found);
    apsm_optimizer_state grown;
    const apsm_status status = apsm_optimizer_state_alloc(state->I, found.J, &grown);
    if (status == APSM_OK) {
        memcpy(grown.P, found.P, state->I * found.J * 3 * sizeof *found.P);
        grown.stage = APSM_STAGE_FIDELITY;
        grown.epochs_run = state->epochs_run;
        grown.stage1_stop = state->stage1_stop;
        apsm_optimizer_state_free(state);
        *state = grown;
    }
    free(found.P);
    return status;
}

/* The two stages with the first number of particles.  A checkpoint within the fidelity stage, or
 * with another number, comes from after the search. */
static apsm_status optimize_and_search(apsm_run *run, apsm_optimizer_state *state, recorder *r)
{
    apsm_optimize_options first = run->options.optimize;
    const bool searched = state->J != (size_t)first.particles || state->stage == APSM_STAGE_DONE ||
                          (state->stage == APSM_STAGE_FIDELITY && state->epoch > 0);
    if (searched) return APSM_OK;
    first.fidelity.fidelity = 0;
    APSM_TRY(apsm_optimize(run->ctx, &run->cohort, &first, state, on_epoch, r));
    state->stage = APSM_STAGE_FIDELITY;
    state->epoch = 0;
    APSM_TRY(save_now(r, state)); /* the search takes long, and so did what comes before */
    APSM_TRY(search_particles(run, state));
    return save_now(r, state);
}

/* Of the own shapes; what lies around them stays. */
static apsm_status load_fields(apsm_run *run)
{
    apsm_obstacles around = run->cohort.obstacles;
    run->cohort.obstacles = (apsm_obstacles){ 0 };
    const apsm_status status = run_load_cohort(run, RUN_OWN_FIELDS);
    if (status == APSM_OK)
        run->cohort.obstacles = around;
    else
        apsm_obstacles_free(&around);
    return status;
}

/* Distance fields are made where epochs draw points: those of the two stages, or those in which
 * badly matched first particles settle. */
static apsm_status prepare(apsm_run *run, apsm_optimizer_state *state)
{
    const apsm_optimize_options *o = &run->options.optimize;
    APSM_TRY(apsm_first_pass(run->ctx, &run->cohort, o, state));
    return apsm_draws_points(o, state) ? load_fields(run) : APSM_OK;
}

static apsm_status optimize(apsm_run *run, apsm_optimizer_state *state, recorder *r)
{
    const apsm_optimize_options *o = &run->options.optimize;
    if (o->method == APSM_METHOD_PSM)
        return apsm_psm_optimize(run->ctx, &run->cohort, o, state, on_epoch, r);
    APSM_TRY(prepare(run, state));
    if (o->search.particles_auto) APSM_TRY(optimize_and_search(run, state, r));
    return apsm_optimize(run->ctx, &run->cohort, o, state, on_epoch, r);
}

/* What the company does together. */
typedef struct shared_part {
    apsm_optimizer_state *state;
    recorder *recorder;
} shared_part;

static apsm_status optimize_part(apsm_run *run, void *user)
{
    const shared_part *p = user;
    return optimize(run, p->state, p->recorder);
}

static apsm_status optimize_and_save(apsm_run *run, apsm_optimizer_state *state, recorder *r)
{
    shared_part part = { state, r };
    const apsm_status status = run_shared(run, optimize_part, &part);
    if (run->helps) return status;
    if (status == APSM_OK) return finish(run, state, r);
    if (status != APSM_ERR_INTERRUPTED) return status;
    /* The state of the last full epoch is worth keeping, even if that one was never recorded. */
    while (r->n > (size_t)state->epochs_run) r->n--;
    const apsm_status saved = save_now(r, state);
    return saved == APSM_OK ? status : saved;
}

/* ---- what lies around the shapes ---- */

static apsm_status load_around(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    apsm_run *run = user;
    size_t n = 0;
    apsm_mesh *meshes = NULL;
    char *path = apsm_project_path(&run->project, run->project.subjects[i].shape);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = run->surroundings->of(run->surroundings->user, ctx, path, &n, &meshes);
    for (size_t k = 0; k < n; k++) {
        apsm_mesh_transform(&meshes[k], run->transforms + 16 * i);
        if (status == APSM_OK) status = apsm_obstacles_add(&run->cohort.obstacles, i, &meshes[k]);
        apsm_mesh_free(&meshes[k]);
    }
    free(meshes);
    free(path);
    return status;
}

static apsm_status load_surroundings(apsm_run *run)
{
    const apsm_fidelity_options *o = &run->options.optimize.fidelity;
    if (!run->surroundings || !run->surroundings->of || !(o->contact > 0) || !(o->fidelity > 0) ||
        run->options.optimize.method == APSM_METHOD_PSM || run->cohort.obstacles.I > 0)
        return APSM_OK;
    APSM_TRY(apsm_obstacles_begin(run->cohort.I, &run->cohort.obstacles));
    return apsm_parallel_for(run->ctx, run->cohort.I, load_around, run, NULL);
}

/* The first pass asks the template's surface for its normals: its field, where particles are kept
 * on the surfaces by fields. */
static run_fields fields_to_begin(const apsm_run *run)
{
    const bool by_field = run->options.optimize.step.snap == APSM_SNAP_FIELD;
    return run_fields_wanted(run, by_field ? RUN_TEMPLATE_FIELD : RUN_NO_FIELDS);
}

apsm_status apsm_run_optimize(apsm_run *run)
{
    if (!run) return APSM_ERR_ARG;
    APSM_TRY(manifest_refuse_joint(run));
    recorder r = { .run = run, .clock = stage_begin() };
    apsm_optimizer_state state = { 0 };
    apsm_status status = run->helps ? APSM_OK : guard_files(run, "optimize", NULL);
    if (status == APSM_OK) status = run_load_cohort(run, fields_to_begin(run));
    if (status == APSM_OK) status = load_surroundings(run);
    if (status == APSM_OK) status = load_start(run, &state, &r);
    if (status == APSM_OK && !run->helps) status = stage_start(run, "optimize");
    if (status == APSM_OK) status = optimize_and_save(run, &state, &r);
    apsm_optimizer_state_free(&state);
    free(r.records);
    return status;
}
