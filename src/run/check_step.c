/* What is wrong with inputs or a project, and what a run would take: nothing is written. */
#include <stdlib.h>
#include <string.h>

#include "run/groom_inputs.h"
#include "run/manifest.h"
#include "run/session.h"

/* ---- check ---- */

typedef void (*problem_fn)(void *user, const char *line);

static apsm_status check_inputs(apsm_run *run, problem_fn report, void *user, size_t *problems)
{
    groom_inputs in = { 0 };
    apsm_status status = groom_inputs_list(run, &in);
    if (status == APSM_OK) status = groom_inputs_read(run, &in);
    for (size_t i = 0; status == APSM_OK && i < in.list.n; i++) {
        if (in.status[i] == APSM_ERR_INTERRUPTED) status = APSM_ERR_INTERRUPTED;
        if (in.status[i] == APSM_OK) continue;
        report(user, in.problem[i]);
        ++*problems;
    }
    groom_inputs_free(&in);
    return status;
}

static void check_checkpoint(apsm_run *run, const char *name, problem_fn report, void *user,
                             size_t *problems)
{
    apsm_optimizer_state state;
    char *path = run_path(run, name);
    if (!path) {
        report(user, apsm_status_text(APSM_ERR_MEMORY));
        ++*problems;
    } else if (apsm_file_exists(path)) {
        if (run_load_state(run, name, &state, NULL, NULL) != APSM_OK) {
            report(user, apsm_error_text(run->ctx));
            ++*problems;
        } else {
            apsm_optimizer_state_free(&state);
        }
    }
    free(path);
}

static apsm_status check_project(apsm_run *run, problem_fn report, void *user, size_t *problems)
{
    *problems += apsm_project_check(run->ctx, &run->project, report, user);
    if (!stage_is_done(run, "groom")) return APSM_OK;
    if (run_load_meshes(run) != APSM_OK) {
        report(user, apsm_error_text(run->ctx));
        ++*problems;
        return APSM_OK;
    }
    check_checkpoint(run, RUN_INITIAL, report, user, problems);
    check_checkpoint(run, RUN_CHECKPOINT, report, user, problems);
    return APSM_OK;
}

apsm_status apsm_run_check(apsm_run *run, void (*report)(void *user, const char *line), void *user,
                           size_t *problems)
{
    *problems = 0;
    if (run->n_inputs > 0) return check_inputs(run, report, user, problems);
    return check_project(run, report, user, problems);
}

/* ---- dry run ---- */

/* Rates of one 2020s core (benchmarks/bench_cohort.c); they only serve a rough forecast. */
static const double groom_seconds = 0.6, align_seconds = 0.3, field_seconds = 0.2;
static const double pair_seconds = 6e-9, factor_rate = 1.5e10;

/* CPU seconds of an epoch of one shape: the pairs of points and particles within reach, and the
 * factorisation of the RBF-shape if it is needed. */
static double epoch_seconds(const apsm_options *o, bool adaptive)
{
    const double J = (double)o->particles, R = o->points * J, n = 3 * J;
    const double near = J < 50 ? J : 50;
    const double fit = n * n * n / 3 / factor_rate + R * n * 1.5e-9;
    return R * near * pair_seconds + (adaptive ? fit : 0);
}

static void forecast(const apsm_run *run, size_t I)
{
    const apsm_options *o = &run->options;
    const double threads = apsm_context_threads(run->ctx), n = (double)I;
    const double pairs = I <= 32 ? n * n / 2 * 0.01 : n * 0.3;
    const double groom = n * (groom_seconds + align_seconds) + pairs;
    const double optimize =
        n * (field_seconds + (double)o->stage1_epochs * epoch_seconds(o, false) +
             (double)o->stage2_epochs * epoch_seconds(o, o->adaptivity > 0));
    const double J = (double)o->particles, faces = (double)o->faces;
    const double memory = n * (faces * 250 + J * 12e3 + J * 24 * 6) + threads * 9 * J * J * 24;
    apsm_log(run->ctx, APSM_LOG_INFO, "about %.0f s on %.0f threads, %.0f MB of memory",
             (groom + optimize) / threads + 1, threads, memory / 1e6 + 60);
}

apsm_status apsm_run_dry(apsm_run *run)
{
    groom_inputs in = { 0 };
    apsm_context *ctx = run->ctx;
    const apsm_options *o = &run->options;
    const apsm_status status = groom_inputs_list(run, &in);
    if (status != APSM_OK) {
        groom_inputs_free(&in);
        return status;
    }
    for (size_t i = 0; i < in.list.n; i++)
        apsm_log(ctx, APSM_LOG_INFO, "%s: %s%s", in.list.cases[i].name, in.list.cases[i].path,
                 in.list.cases[i].reflect ? " (to be mirrored)" : "");
    apsm_log(ctx, APSM_LOG_INFO,
             "%zu shapes, %ld particles each, adaptivity %g; %ld + %ld epochs; into %s", in.list.n,
             o->particles, o->adaptivity, o->stage1_epochs, o->stage2_epochs, run->folder);
    forecast(run, in.list.n);
    groom_inputs_free(&in);
    return APSM_OK;
}
