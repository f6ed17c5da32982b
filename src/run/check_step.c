/* What is wrong with inputs or a project, and what a run would take: nothing is written. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "evaluate/metrics.h"
#include "initialize/projection.h"
#include "optimize/optimizer.h"
#include "optimize/schedule.h"
#include "run/compare_inputs.h"
#include "run/features.h"
#include "run/groom_inputs.h"
#include "run/groomed.h"
#include "run/landmarks.h"
#include "run/shapes.h"
#include "run/source.h"
#include "run/state.h"
#include "session/guard.h"
#include "session/manifest.h"
#include "session/session.h"

/* ---- check ---- */

enum { LEAST_COMPARED = 4 };

typedef void (*problem_fn)(void *user, const char *line);

typedef struct problem_count {
    problem_fn report;
    void *user;
    size_t *problems;
} problem_count;

static void count_problem(void *user, const char *line)
{
    const problem_count *count = user;
    count->report(count->user, line);
    ++*count->problems;
}

/* Hands, poses and strangers, as groom will see them: the log has the lines.  Counted are mirror
 * images; a form unlike the others' may be the news, and is told only. */
static apsm_status check_cohort(apsm_run *run, const groom_inputs *in, size_t *problems)
{
    groomed_cohort cohort = { 0 };
    apsm_alignment a = { 0 };
    const apsm_status status = groomed_align(run, in, &cohort, &a);
    for (size_t i = 0; status == APSM_OK && i < in->list.n; i++) *problems += a.mirrored[i];
    apsm_alignment_free(&a);
    groomed_cohort_free(&cohort);
    return status;
}

static apsm_status check_inputs(apsm_run *run, problem_fn report, void *user, size_t *problems)
{
    groom_inputs in = { 0 };
    apsm_status status = groom_inputs_list(run, &in);
    if (status == APSM_OK) status = landmarks_read(run, &in);
    if (status == APSM_OK) status = features_check(run, &in);
    if (status == APSM_OK) status = groom_inputs_read(run, &in);
    if (in.source.root) *problems += apsm_project_check_inputs(run->ctx, &in.source, report, user);
    for (size_t i = 0; status == APSM_OK && i < in.list.n; i++) {
        const char *path = in.list.cases[i].path;
        if (in.source.root && !apsm_file_exists(path) && !apsm_is_folder(path)) continue;
        if (in.status[i] == APSM_ERR_INTERRUPTED) status = APSM_ERR_INTERRUPTED;
        if (in.status[i] == APSM_OK) continue;
        report(user, in.problem[i]);
        ++*problems;
    }
    problem_count count = { report, user, problems };
    if (status == APSM_OK) status = compare_inputs(&in, count_problem, &count);
    /* Of shapes that can all be used, and enough of them to say which is the odd one. */
    if (status == APSM_OK && *problems == 0 && in.list.n >= LEAST_COMPARED)
        status = check_cohort(run, &in, problems);
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

/* Of a project that is to be groomed. */
static void check_requests(apsm_run *run, problem_fn report, void *user, size_t *problems)
{
    char *ignored = NULL;
    if (source_check(run, &run->project, &ignored) != APSM_OK) {
        report(user, apsm_error_text(run->ctx));
        ++*problems;
    }
    free(ignored);
}

static apsm_status check_project(apsm_run *run, problem_fn report, void *user, size_t *problems)
{
    *problems += apsm_project_check(run->ctx, &run->project, report, user);
    if (!stage_is_done(run, "groom")) {
        check_requests(run, report, user, problems);
        return APSM_OK;
    }
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
    if (!run || !report || !problems) return APSM_ERR_ARG;
    *problems = 0;
    if (run_is_in_memory(run))
        return apsm_fail(run->ctx, APSM_ERR_STATE, "job in memory: there are no files to check");
    if (run->n_inputs > 0) return check_inputs(run, report, user, problems);
    return check_project(run, report, user, problems);
}

/* ---- dry run ---- */

/* CPU seconds of one shape on a core of the 2020s, as functions of J particles fitted to what
 * benchmarks/rates, before and cohort measure; they only serve a forecast. */
static double groom_seconds(const apsm_options *o)
{
    const double faces = (double)o->groom.remesh_options.faces;
    return 0.07 + 7e-6 * faces; /* poses; remeshing and registration of all vertices */
}

/* The pairs that the template is chosen from (docs/method.md, Initialisation). */
static double template_seconds(double I)
{
    enum { ALL = 32, COMPARED = 64 }; /* beyond ALL it is a race that half of the pairs run */
    const double pairs = 0.5 * fmin(I, ALL) * fmin(I, COMPARED);
    return 0.002 * pairs;
}

/* fields: distance fields are made. */
static double initialize_seconds(double J, bool fields)
{
    return 0.031 + 4.9e-5 * J + (fields ? 0.012 + 1.06e-4 * J : 0);
}

/* Whether first particles are likely to settle: those that registration brought seldom do. */
static bool settles(const apsm_optimize_options *o)
{
    return o->method != APSM_METHOD_PSM && o->first.initialize != APSM_INIT_REGISTRATION &&
           schedule_of_stage(o, APSM_STAGE_1).settle > 0;
}

/* Bytes of the factor of a shape's RBF-shape that adaptive epochs keep; 0: there is none. */
static double kept_bytes(const apsm_options *o, double I)
{
    const apsm_schedule_options *s = &o->optimize.schedule;
    const bool adaptive =
        o->optimize.method != APSM_METHOD_PSM && s->adaptivity > 0 &&
        (s->stage2_epochs > 0 || (s->stage1_epochs == 0 && settles(&o->optimize)));
    return adaptive ? apsm_kept_factor_bytes(&o->optimize, (size_t)I, (size_t)o->optimize.particles)
                    : 0;
}

/* factors: made in an epoch, for a shape. */
static double epoch_seconds(double J, bool adaptive, double factors)
{
    const double n = 3 * J;
    return 4.5e-6 * J + 4e-9 * J * J + (adaptive ? n * n * (2.8e-9 + n * 4.5e-12 * factors) : 0);
}

static double pass_seconds(double J)
{
    return 2.5e-3 + 8e-6 * J;
}

/* Normal equations in 2J unknowns, where they are many by products with what is near; and the
 * surfaces that are looked up. */
static double round_seconds(const apsm_options *o, double J)
{
    const double unknowns = 2 * J;
    if (unknowns > (double)o->optimize.fidelity.dense) return 0.006 + 2.5e-9 * unknowns * unknowns;
    return 0.005 + (double)o->optimize.fidelity.fidelity_points * unknowns * unknowns * 4e-11;
}

/* All of them; of many particles some take the first half, unless shapes are thin. */
static double rounds_seconds(const apsm_options *o, double J)
{
    const double rounds = (double)o->optimize.fidelity.fidelity_rounds,
                 few = (double)o->optimize.fidelity.coarse;
    if (!(J >= 2 * few)) return rounds * round_seconds(o, J);
    return rounds / 2 * (round_seconds(o, few) + round_seconds(o, J));
}

static double evaluate_seconds(double J)
{
    return 0.055 + 1.95e-4 * J; /* with the report */
}

/* The side of the model that is decomposed. */
static double model_side(double I, double J)
{
    return fmin(I, 3 * J);
}

/* Of all shapes: covariance and scores; eigenvectors; specificity of 1,000 samples; generalization.
 */
static double model_seconds(double I, double J)
{
    const double n = 3 * J, side = model_side(I, J),
                 left_out = (double)apsm_generalization_shapes((size_t)I);
    return 1.7e-10 * I * n * side + 3.3e-10 * side * side * side + 3.1e-6 * I * side +
           5.8e-11 * left_out * side * side * n;
}

/* Of one shape: iterations are counted by the particles that there are after each split. */
static double psm_seconds(const apsm_options *o)
{
    const double J = (double)o->optimize.particles;
    double visits = J * (double)o->optimize.psm.psm_optimization_iterations;
    for (double n = 1; n < J; n *= 2)
        visits += fmin(2 * n, J) * (double)o->optimize.psm.psm_iterations_per_split;
    return 3e-6 * visits;
}

static double optimize_seconds(const apsm_options *o, double I)
{
    enum { RENEWAL = 25 };
    const double J = (double)o->optimize.particles,
                 epochs = (double)o->optimize.schedule.stage1_epochs;
    if (o->optimize.method == APSM_METHOD_PSM) return psm_seconds(o);
    const double adaptive = (double)o->optimize.schedule.stage2_epochs;
    const double factors =
        adaptive > 0 && kept_bytes(o, I) > 0 ? ceil(adaptive / RENEWAL) / adaptive : 1;
    double seconds = epochs * epoch_seconds(J, false, 0) +
                     adaptive * epoch_seconds(J, o->optimize.schedule.adaptivity > 0, factors);
    const schedule stage1 = schedule_of_stage(&o->optimize, APSM_STAGE_1);
    seconds += (double)passes_of_stage(&stage1) * pass_seconds(J);
    if (o->optimize.fidelity.fidelity > 0) seconds += rounds_seconds(o, J);
    return seconds;
}

/* Of a finished shape: mesh, trees, tables, and its distance field if there are epochs that draw
 * points. */
static double shape_bytes(const apsm_options *o, bool fields)
{
    const double field = fields ? 4.7e3 * (double)o->optimize.particles : 0;
    return 270 * (double)o->groom.remesh_options.faces + field;
}

static double other_bytes(const apsm_options *o, double I, double threads)
{
    const double J = (double)o->optimize.particles;
    const double side = model_side(I, J);
    return 40e6 + threads * (110 * J * J + 5e6) + 8 * J * (double)o->groom.remesh_options.faces +
           200 * I * J + 16 * side * side;
}

static void forecast(const apsm_run *run, size_t shapes)
{
    const apsm_options *o = &run->options;
    const double threads = apsm_context_threads(run->ctx), I = (double)shapes,
                 J = (double)o->optimize.particles;
    const bool fields = run_fields_wanted(run, RUN_NO_FIELDS) != RUN_NO_FIELDS;
    const double seconds = I * (groom_seconds(o) + initialize_seconds(J, fields) +
                                optimize_seconds(o, I) + evaluate_seconds(J)) +
                           template_seconds(I) + model_seconds(I, J);
    const double stored = I * shape_bytes(o, fields || settles(&o->optimize)),
                 limit = (double)run->memory;
    const bool stores = run->memory > 0; /* then no factor is kept */
    const double others = other_bytes(o, I, threads) + (stores ? 0 : I * kept_bytes(o, I));
    apsm_log(run->ctx, APSM_LOG_INFO, "about %.0f s on %.0f threads, %.0f MB of memory",
             seconds / threads + 1, threads,
             (stores ? fmax(others, fmin(limit, others + stored)) : others + stored) / 1e6);
    if (stores)
        apsm_log(run->ctx, APSM_LOG_INFO, "about %.0f MB of disk in %s/state while it runs",
                 stored / 1e6, run->folder);
}

static void describe_plan(const apsm_run *run, size_t shapes)
{
    const apsm_options *o = &run->options;
    if (o->optimize.method == APSM_METHOD_PSM)
        apsm_log(run->ctx, APSM_LOG_INFO,
                 "%zu shapes, %ld particles each, method psm; %ld iterations a split, %ld after; "
                 "into %s",
                 shapes, o->optimize.particles, o->optimize.psm.psm_iterations_per_split,
                 o->optimize.psm.psm_optimization_iterations, run->folder);
    else
        apsm_log(run->ctx, APSM_LOG_INFO,
                 "%zu shapes, %ld particles each, adaptivity %g; %ld + %ld epochs, %ld fidelity "
                 "rounds; into %s",
                 shapes, o->optimize.particles, o->optimize.schedule.adaptivity,
                 o->optimize.schedule.stage1_epochs, o->optimize.schedule.stage2_epochs,
                 o->optimize.fidelity.fidelity > 0 ? o->optimize.fidelity.fidelity_rounds : 0,
                 run->folder);
}

/* Fails where the run would before its long part, and where it would in reading. */
static apsm_status look_ahead(apsm_run *run, groom_inputs *in)
{
    size_t template_index;
    run->last = "report";
    APSM_TRY(guard_model(run));
    APSM_TRY(groom_inputs_list(run, in));
    if (!run->resume) APSM_TRY(guard_files(run, "groom", &in->list));
    APSM_TRY(groom_inputs_template(run, in, &template_index));
    APSM_TRY(landmarks_read(run, in));
    APSM_TRY(features_check(run, in));
    return groom_inputs_try(run, in);
}

static void list_cases(apsm_context *ctx, const apsm_input_list *list)
{
    for (size_t i = 0; i < list->n; i++)
        apsm_log(ctx, APSM_LOG_INFO, "%s: %s%s", list->cases[i].name, list->cases[i].path,
                 list->cases[i].reflect ? " (to be mirrored)" : "");
}

apsm_status apsm_run_dry(apsm_run *run)
{
    if (!run) return APSM_ERR_ARG;
    if (run_is_in_memory(run))
        return apsm_fail(run->ctx, APSM_ERR_STATE, "job in memory: there are no files to look at");
    groom_inputs in = { 0 };
    const apsm_status status = look_ahead(run, &in);
    if (status == APSM_OK) {
        list_cases(run->ctx, &in.list);
        describe_plan(run, in.list.n);
        forecast(run, in.list.n);
    }
    groom_inputs_free(&in);
    return status;
}
