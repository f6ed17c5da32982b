/* A run is opened, done as a whole, and closed. */
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "apsm/report.h"
#include "core/sized.h"
#include "run/features.h"
#include "run/groom_inputs.h"
#include "run/memory.h"
#include "run/results.h"
#include "run/shapes.h"
#include "session/guard.h"
#include "session/kept.h"
#include "session/manifest.h"
#include "session/outputs.h"
#include "session/session.h"
#include "session/settings.h"

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
    if (run_is_in_memory(run)) return apsm_project_init(run->ctx, ".", &run->project);
    if (fresh) return apsm_project_init(run->ctx, run->folder, &run->project);
    char *path = run_path(run, RUN_PROJECT);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_file_exists(path)
                                   ? apsm_project_read(run->ctx, path, &run->project)
                                   : apsm_project_init(run->ctx, run->folder, &run->project);
    free(path);
    return status;
}

static apsm_status open_in_memory(apsm_run *run, const apsm_run_settings *s)
{
    if (s->n_inputs > 0 || s->memory > 0 || s->resume || s->dry || s->shards > 0)
        return apsm_fail(run->ctx, APSM_ERR_ARG,
                         "a job without a folder has no inputs but apsm_run_add_mesh and "
                         "apsm_run_add_volume, and neither memory, resume, dry nor shards");
    APSM_TRY(settings_try(run, s));
    APSM_TRY(open_project(run, true));
    APSM_TRY(manifest_open(run));
    return settings_settle(run, s);
}

/* Of a share or rank another has the lock. */
static apsm_status make_folder(apsm_run *run)
{
    if (!run->helps)
        return apsm_make_locked_folder(run->ctx, run->folder, &run->made_folders, &run->lock);
    APSM_TRY(apsm_missing_folders(run->ctx, run->folder, &run->made_folders));
    return apsm_make_folder(run->ctx, run->folder);
}

static apsm_status open_all(apsm_run *run, const apsm_run_settings *s)
{
    if (!s->folder) return open_in_memory(run, s);
    APSM_TRY(apsm_refuse_root(run->ctx, s->folder));
    if (!apsm_is_folder(s->folder)) APSM_TRY(settings_try(run, s));
    APSM_TRY(apsm_text_set(&run->folder, s->folder));
    APSM_TRY(copy_inputs(run, s));
    if (!s->dry) APSM_TRY(make_folder(run));
    APSM_TRY(manifest_open(run));
    bool is_model = false;
    if (!run->dry) APSM_TRY(guard_is_model(run, &is_model));
    if (is_model && !run->helps) APSM_TRY(outputs_tidy(run));
    APSM_TRY(open_project(run, s->fresh));
    if (run->resume && !s->dry) APSM_TRY(kept_take_up(run));
    return settings_settle(run, s);
}

static bool is_complete(const apsm_run_settings *s)
{
    if (s->folder && !*s->folder) return false;
    if (s->shards > 0 && s->shard >= s->shards) return false;
    if ((s->n_inputs > 0 && !s->inputs) || (s->n_set > 0 && !s->set)) return false;
    for (size_t k = 0; k < s->n_inputs; k++)
        if (!s->inputs[k]) return false;
    for (size_t k = 0; k < s->n_set; k++)
        if (!s->set[k][0] || !s->set[k][1]) return false;
    return true;
}

/* Structs of callbacks grow at their ends, too: these are the sizes of the first version. */
enum {
    FIRST_COMPANY = offsetof(apsm_company, gather) + sizeof(void (*)(void)),
    FIRST_SURROUNDINGS = offsetof(apsm_surroundings, turn) + sizeof(void (*)(void))
};

static apsm_status take_callbacks(apsm_run *run, const apsm_run_settings *s)
{
    static const char door[] = "apsm_run_open";
    const size_t company = s->company_size ? s->company_size : FIRST_COMPANY,
                 around = s->surroundings_size ? s->surroundings_size : FIRST_SURROUNDINGS;
    if (s->company) {
        APSM_TRY(apsm_take_settings(run->ctx, door, s->company, company, &run->company_known,
                                    sizeof run->company_known));
        run->company = &run->company_known;
    }
    if (s->surroundings) {
        APSM_TRY(apsm_take_settings(run->ctx, door, s->surroundings, around,
                                    &run->surroundings_known, sizeof run->surroundings_known));
        run->surroundings = &run->surroundings_known;
    }
    return APSM_OK;
}

apsm_status apsm_run_open_sized(apsm_context *ctx, const apsm_run_settings *given, size_t size,
                                apsm_run **out)
{
    apsm_run_settings known = { 0 }, *const settings = &known;
    if (!out) return apsm_fail(ctx, APSM_ERR_ARG, "apsm_run_open: no place for the run");
    *out = NULL;
    if (!apsm_take_sized(given, size, &known, sizeof known))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "apsm_run_open: no settings, or some that this version does not know");
    if (!ctx || !is_complete(settings))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "apsm_run_open: needs a context, and no text may be empty or NULL");
    apsm_run *run = calloc(1, sizeof *run);
    if (!run) return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory");
    run->ctx = ctx;
    run->lock.fd = -1;
    run->dry = settings->dry;
    run->memory = settings->memory;
    run->resume = settings->resume;
    run->overwrite = settings->overwrite;
    run->shard = settings->shard;
    run->shards = settings->shards;
    run->helps = settings->shards > 0 && !(settings->company && settings->shard == 0);
    apsm_status status = take_callbacks(run, settings);
    if (status == APSM_OK) status = open_all(run, settings);
    if (status == APSM_OK)
        *out = run;
    else
        apsm_run_close(run);
    return status;
}

static void close_store(apsm_run *run)
{
    if (!run->store) return;
    apsm_context_set_between(run->ctx, NULL, NULL);
    apsm_store_close(run->store);
    run->store = NULL;
}

/* A folder that was made for nothing; what holds a file stays. */
static void remove_empty_state(const apsm_run *run)
{
    char *state = run_path(run, "state");
    if (state) rmdir(state);
    free(state);
}

void apsm_run_close(apsm_run *run)
{
    if (!run) return;
    run_unload(run);
    run_forget_results(run);
    landmark_table_free(&run->landmarks);
    features_free(&run->features);
    memory_free(run);
    kept_close(run);
    close_store(run);
    manifest_close(run);
    apsm_project_free(&run->project);
    const bool for_nothing = run->made_folders > 0 && !run->has_manifest;
    if (for_nothing) remove_empty_state(run); /* while it is locked */
    apsm_unlock_folder(&run->lock);
    if (for_nothing) apsm_remove_empty_folders(run->folder, run->made_folders);
    for (size_t k = 0; k < run->n_inputs; k++) free(run->inputs[k]);
    free(run->inputs);
    free(run->folder);
    free(run);
}

/* ---- all steps ---- */

/* What the first process tells those that help it. */
enum { GROOMS = 1, INITIALIZES = 2, OPTIMIZES = 4, EVALUATES = 8 };

static size_t meet(const apsm_company *company, size_t value)
{
    return company ? company->meet(company->user, value) : 0;
}

static size_t plan_of(const apsm_run *run)
{
    size_t plan = 0;
    if (!run->resume || !stage_is_done(run, "groom")) plan |= GROOMS;
    if (!run->resume || !stage_is_done(run, "initialize")) plan |= INITIALIZES;
    if (!run_is_shared(run)) return plan;
    if (!run->resume || !stage_is_done(run, "optimize")) plan |= OPTIMIZES;
    if (!run->resume || !stage_is_done(run, "evaluate")) plan |= EVALUATES;
    return plan;
}

static apsm_status help(apsm_context *ctx, const apsm_run_settings *s,
                        apsm_status (*step)(apsm_run *))
{
    apsm_run *run;
    APSM_TRY(apsm_run_open(ctx, s, &run));
    const apsm_status status = step(run);
    apsm_run_close(run);
    return status;
}

apsm_status apsm_run_help_sized(apsm_context *ctx, const apsm_run_settings *given, size_t size)
{
    apsm_run_settings known = { 0 }, *const settings = &known;
    APSM_TRY(apsm_take_settings(ctx, "apsm_run_help", given, size, settings, sizeof known));
    if (!settings->company || settings->shard == 0) return APSM_ERR_ARG;
    static apsm_status (*const steps[])(apsm_run *) = { apsm_run_groom, apsm_run_initialize,
                                                        apsm_run_optimize, apsm_run_evaluate };
    const size_t plan = meet(settings->company, 0);
    for (size_t k = 0; k < sizeof steps / sizeof steps[0]; k++) {
        if (plan >> k & 1) APSM_TRY(help(ctx, settings, steps[k]));
        settings->overwrite = false; /* what has been made since is to be used */
        meet(settings->company, 0);
    }
    return APSM_OK;
}

apsm_status apsm_run_all(apsm_run *run)
{
    if (!run) return APSM_ERR_ARG;
    static const struct {
        const char *stage;
        apsm_status (*step)(apsm_run *);
    } steps[] = { { "groom", apsm_run_groom },
                  { "initialize", apsm_run_initialize },
                  { "optimize", apsm_run_optimize },
                  { "evaluate", apsm_run_evaluate } };
    run->last = "report";
    if (run->resume && stage_is_done(run, "groom")) {
        APSM_TRY(groom_inputs_compare(run));
        APSM_TRY(outputs_check(run));
    }
    APSM_TRY(manifest_check_seal(run));
    meet(run->company, plan_of(run));
    for (size_t k = 0; k < sizeof steps / sizeof steps[0]; k++) {
        if (!run->resume || !stage_is_done(run, steps[k].stage)) APSM_TRY(steps[k].step(run));
        meet(run->company, 0);
    }
    if (run_is_in_memory(run)) return APSM_OK;
    run_unload(run); /* the report reads what it needs */
    return apsm_run_report(run);
}

apsm_status apsm_run_report(apsm_run *run)
{
    if (!run) return APSM_ERR_ARG;
    if (run_is_in_memory(run))
        return apsm_fail(run->ctx, APSM_ERR_STATE, "a job without a folder has no report");
    bool is_model;
    APSM_TRY(apsm_folder_holds(run->folder, RUN_PROJECT, &is_model));
    if (!is_model) return run_no_project(run);
    APSM_TRY(manifest_refuse_contours(run));
    APSM_TRY(guard_files(run, "report", NULL));
    APSM_TRY(stage_start(run, "report"));
    APSM_TRY(apsm_report_write(run->ctx, run->folder));
    return stage_close(run, "report");
}
