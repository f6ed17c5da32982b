/* Every allocation of a small run fails once: no crash, APSM_ERR_MEMORY, and the next try works.
 *
 * The program is linked with malloc, calloc, realloc and strdup of the library wrapped, and jansson
 * allocates through the same door.  What other libraries (BLAS, OpenMP) allocate does not
 * fail. One thread, so that the n-th allocation is always the same one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/fit.h"
#include "apsm/formats.h"
#include "apsm/run.h"
#include "apsm/statistics.h"
#include "folder.h"
#include "groom/groom.h"
#include "synthetic.h"

/* ---- the allocator that fails ---- */

static long countdown; /* allocations until one fails; 0: none will */
static long counted;
static bool all_of_them; /* not only some of the many */

static bool fails(void)
{
    counted++;
    return countdown > 0 && --countdown == 0;
}

void *__real_malloc(size_t size);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *p, size_t size);
char *__real_strdup(const char *text);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t n, size_t size);
void *__wrap_realloc(void *p, size_t size);
char *__wrap_strdup(const char *text);

void *__wrap_malloc(size_t size)
{
    return fails() ? NULL : __real_malloc(size);
}
void *__wrap_calloc(size_t n, size_t size)
{
    return fails() ? NULL : __real_calloc(n, size);
}
void *__wrap_realloc(void *p, size_t size)
{
    return fails() ? NULL : __real_realloc(p, size);
}
char *__wrap_strdup(const char *text)
{
    return fails() ? NULL : __real_strdup(text);
}

/* ---- the steps ---- */

enum { SHAPES = 3 };
static char folder[TEST_PATH], model[TEST_PATH + 8], input[SHAPES][TEST_PATH + 8];
static apsm_context *ctx;

static void ignore_line(void *user, const char *line)
{
    (void)user, (void)line;
}

/* Opens the model folder and does one step. */
static apsm_status step(apsm_status (*what)(apsm_run *), bool with_inputs)
{
    static const char *const set[][2] = {
        { "particles", "24" },     { "faces", "150" },           { "stage1_epochs", "3" },
        { "stage2_epochs", "2" },  { "fidelity_rounds", "1" },   { "original_frame", "true" },
        { "reflect_match", "s1" }, { "checkpoint_seconds", "0" }
    };
    const char *inputs[SHAPES];
    for (int i = 0; i < SHAPES; i++) inputs[i] = input[i];
    const apsm_run_settings settings = { .folder = model,
                                         .n_inputs = with_inputs ? SHAPES : 0,
                                         .inputs = inputs,
                                         .n_set = sizeof set / sizeof set[0],
                                         .set = set,
                                         .overwrite = true };
    apsm_run *run = NULL;
    apsm_status status = apsm_run_open(ctx, &settings, &run);
    if (status == APSM_OK) status = what(run);
    apsm_run_close(run);
    return status;
}

static apsm_status groom(void)
{
    return step(apsm_run_groom, true);
}
static apsm_status initialize(void)
{
    return step(apsm_run_initialize, false);
}
static apsm_status optimize(void)
{
    return step(apsm_run_optimize, false);
}
static apsm_status evaluate(void)
{
    return step(apsm_run_evaluate, false);
}
/* Of what a share keeps; it goes each time, so that all is kept again. */
static apsm_status forget_share(const char *of, apsm_status status)
{
    char path[TEST_PATH + 64];
    snprintf(path, sizeof path, "%s/state/shard-1-of-2.journal", of);
    remove(path);
    return status;
}
static apsm_status evaluate_share(void)
{
    const apsm_run_settings settings = { .folder = model, .shards = 2 };
    apsm_run *run = NULL;
    apsm_status status = apsm_run_open(ctx, &settings, &run);
    if (status == APSM_OK) status = apsm_run_evaluate(run);
    apsm_run_close(run);
    return forget_share(model, status);
}
static apsm_status fit_share(void)
{
    char fits[TEST_PATH + 8];
    const char *inputs[SHAPES];
    apsm_fit_totals totals;
    snprintf(fits, sizeof fits, "%s/fits", folder);
    for (int i = 0; i < SHAPES; i++) inputs[i] = input[i];
    const apsm_fit_settings settings = {
        .model = model, .n_inputs = SHAPES, .inputs = inputs, .folder = fits, .shards = 2
    };
    return forget_share(fits, apsm_fit_run(ctx, &settings, &totals));
}
static apsm_status report(void)
{
    return step(apsm_run_report, false);
}
static apsm_status verify(void)
{
    apsm_verification result;
    APSM_TRY(apsm_run_verify(ctx, model, ignore_line, ignore_line, NULL, &result));
    return result.problems == 0 ? APSM_OK : APSM_ERR_STATE;
}
/* What check cannot look at for want of memory is a problem that it tells. */
static apsm_status check(void)
{
    const apsm_run_settings settings = { .folder = model, .dry = true };
    apsm_run *run = NULL;
    size_t problems = 0;
    apsm_status status = apsm_run_open(ctx, &settings, &run);
    if (status == APSM_OK) status = apsm_run_check(run, ignore_line, NULL, &problems);
    apsm_run_close(run);
    return status == APSM_OK && problems ? APSM_ERR_STATE : status;
}

static apsm_status measure(void)
{
    char definition[TEST_PATH + 16];
    snprintf(definition, sizeof definition, "%s/define.json", folder);
    const apsm_measure_settings settings = { .folder = model, .definition = definition };
    return apsm_statistics_measure(ctx, &settings);
}

/* Two shapes with the particles of the model, and a third that is new, to first particles. */
static apsm_status fixed(void)
{
    char project[TEST_PATH + 16], made[TEST_PATH + 8];
    const char *const inputs[] = { project };
    static const char *const set[][2] = { { "faces", "150" }, { "cuts", "keep" } };
    snprintf(project, sizeof project, "%s/fixed.swproj", folder);
    snprintf(made, sizeof made, "%s/fixed", folder);
    const apsm_run_settings settings = { .folder = made,
                                         .n_inputs = 1,
                                         .inputs = inputs,
                                         .n_set = sizeof set / sizeof set[0],
                                         .set = set,
                                         .overwrite = true };
    apsm_run *run = NULL;
    apsm_status status = apsm_run_open(ctx, &settings, &run);
    if (status == APSM_OK) status = apsm_run_groom(run);
    if (status == APSM_OK) status = apsm_run_initialize(run);
    apsm_run_close(run);
    return status;
}

/* The whole of a job without a folder: two bars as meshes, one as voxels. */
static apsm_status add_shapes(apsm_run *run)
{
    enum { N = 8 };
    static int32_t label[N * N * N];
    for (int k = 0; k < N * N * N; k++) label[k] = k % N > 1 && k / N % N > 1 && k / N / N > 1;
    for (int k = 0; k < N * N * N; k++)
        if (k % N > 5 || k / N % N > 5 || k / N / N > 5) label[k] = 0;
    const double V[8][3] = { { 0, 0, 0 }, { 4, 0, 0 }, { 0, 4, 0 }, { 4, 4, 0 },
                             { 0, 0, 4 }, { 4, 0, 4 }, { 0, 4, 4 }, { 4, 4, 4 } };
    const uint32_t F[12][3] = { { 0, 2, 3 }, { 0, 3, 1 }, { 4, 5, 7 }, { 4, 7, 6 },
                                { 0, 1, 5 }, { 0, 5, 4 }, { 2, 6, 7 }, { 2, 7, 3 },
                                { 0, 4, 6 }, { 0, 6, 2 }, { 1, 3, 7 }, { 1, 7, 5 } };
    const apsm_volume volume = { .n = { N, N, N },
                                 .spacing = { 1, 1, 1 },
                                 .direction = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                                 .label = label };
    APSM_TRY(apsm_run_add_mesh(run, "b", false, 8, &V[0][0], 12, &F[0][0]));
    APSM_TRY(apsm_run_add_volume(run, "a", false, &volume));
    return apsm_run_add_mesh(run, "c", true, 8, &V[0][0], 12, &F[0][0]);
}

static apsm_status job_in_memory(void)
{
    static const char *const set[][2] = {
        { "particles", "12" },    { "faces", "100" },         { "stage1_epochs", "1" },
        { "stage2_epochs", "1" }, { "fidelity_rounds", "1" }, { "specificity_samples", "5" }
    };
    const apsm_run_settings settings = { .n_set = sizeof set / sizeof set[0], .set = set };
    apsm_run *run = NULL;
    apsm_status status = apsm_run_open(ctx, &settings, &run);
    if (status == APSM_OK) status = add_shapes(run);
    if (status == APSM_OK) status = apsm_run_all(run);
    apsm_run_close(run);
    return status;
}

/* A block with a tunnel of two by two voxels, which is filled. */
static apsm_status mend(void)
{
    enum { N = 26 };
    static int32_t label[N * N * N];
    for (int k = 0; k < N * N * N; k++) {
        const int x = k % N, y = k / N % N, z = k / N / N;
        label[k] =
            x > 2 && x < 21 && y > 2 && y < 21 && z > 2 && z < 21 && !(x / 2 == 5 && y / 2 == 6);
    }
    const apsm_volume volume = { .n = { N, N, N },
                                 .spacing = { 1, 1, 1 },
                                 .direction = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                                 .label = label };
    apsm_groom_options o = apsm_groom_defaults();
    apsm_groom_report r;
    apsm_mesh mesh;
    o.remesh = false;
    APSM_TRY(apsm_groom_segmentation(ctx, "block", &volume, &o, &mesh, &r));
    apsm_mesh_free(&mesh);
    return r.handles_before == 1 && r.genus == 0 ? APSM_OK : APSM_ERR_GEOMETRY;
}

/* Lets allocations of a step fail, one a try: the first forty, and some of the rest.  The last try
 * is left alone. */
static void fail_each(const char *name, apsm_status (*what)(void))
{
    counted = 0;
    assert_int_equal(what(), APSM_OK);
    const long all = counted;
    long wrong = 0, tried = 0;
    for (long n = 1; n <= all; n += all_of_them ? 1 : 1 + n / 40) {
        countdown = n;
        const apsm_status status = what();
        countdown = 0;
        tried++;
        if (status == APSM_ERR_MEMORY || (what == check && status == APSM_ERR_STATE)) continue;
        printf("%s, allocation %ld: %s (%s)\n", name, n, apsm_status_text(status),
               apsm_error_text(ctx));
        wrong++;
    }
    assert_int_equal(what(), APSM_OK);
    printf("%s: %ld allocations, %ld of them failed\n", name, all, tried);
    if (wrong) fail_msg("%s: %ld failures of an allocation went wrong", name, wrong);
}

#define STEP(name)                                                                                 \
    static void name##_reports_want_of_memory(void **state)                                        \
    {                                                                                              \
        (void)state;                                                                               \
        fail_each(#name, name);                                                                    \
    }
STEP(groom)
STEP(initialize)
STEP(optimize)
STEP(evaluate)
STEP(evaluate_share)
STEP(report)
STEP(verify)
STEP(check)
STEP(job_in_memory)
STEP(mend)

/* The first time makes a folder, and so takes more. */
static void fixed_reports_want_of_memory(void **state)
{
    (void)state;
    char project[TEST_PATH + 16];
    snprintf(project, sizeof project, "%s/fixed.swproj", folder);
    FILE *f = fopen(project, "w");
    assert_non_null(f);
    fputs("{\"data\": [", f);
    for (int i = 0; i < SHAPES; i++)
        fprintf(f,
                "%s{\"name\": \"s%d\", \"shape_1\": \"s%d.ply\", \"fixed\": \"%s\","
                " \"local_particles_1\": \"model/particles/s%d_local.particles\"}",
                i ? ", " : "", i, i, i == 1 ? "no" : "yes", i);
    fputs("]}", f);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(fixed(), APSM_OK);
    fail_each("fixed", fixed);
}

/* The first time makes folders, and so takes more. */
static void fit_share_reports_want_of_memory(void **state)
{
    (void)state;
    assert_int_equal(fit_share(), APSM_OK);
    fail_each("fit_share", fit_share);
}

/* The first time makes a folder, and so takes more. */
static void measure_reports_want_of_memory(void **state)
{
    (void)state;
    assert_int_equal(measure(), APSM_OK);
    fail_each("measure", measure);
}

static int set_up(void **state)
{
    if (folder_set_up(state)) return -1;
    ctx = apsm_context_new();
    snprintf(folder, sizeof folder, "%s", (const char *)*state);
    snprintf(model, sizeof model, "%s/model", folder);
    char definition[TEST_PATH + 16];
    snprintf(definition, sizeof definition, "%s/define.json", folder);
    FILE *f = fopen(definition, "w");
    if (!f) return -1;
    fputs("{\"measurements\": [{\"name\": \"v\", \"kind\": \"volume\"},"
          " {\"name\": \"s\", \"kind\": \"section\", \"points\": [0, 1, 2]},"
          " {\"name\": \"t\", \"kind\": \"thickness\", \"points\": [3]}]}",
          f);
    if (fclose(f)) return -1;
    for (size_t i = 0; i < SHAPES; i++) {
        apsm_mesh mesh = synthetic_shape(SYNTHETIC_BUMP, i, SHAPES, 2);
        snprintf(input[i], sizeof input[i], "%s/s%zu.ply", folder, i);
        if (apsm_write_mesh(ctx, input[i], &mesh) != APSM_OK) return -1;
        apsm_mesh_free(&mesh);
    }
    return 0;
}

static int tear_down(void **state)
{
    apsm_context_free(ctx);
    return folder_tear_down(state);
}

/* With an argument: every single allocation, which takes minutes. */
int main(int argc, char **argv)
{
    (void)argv;
    all_of_them = argc > 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(groom_reports_want_of_memory),
        cmocka_unit_test(initialize_reports_want_of_memory),
        cmocka_unit_test(optimize_reports_want_of_memory),
        cmocka_unit_test(evaluate_reports_want_of_memory),
        cmocka_unit_test(evaluate_share_reports_want_of_memory),
        cmocka_unit_test(fit_share_reports_want_of_memory),
        cmocka_unit_test(report_reports_want_of_memory),
        cmocka_unit_test(verify_reports_want_of_memory),
        cmocka_unit_test(measure_reports_want_of_memory),
        cmocka_unit_test(check_reports_want_of_memory),
        cmocka_unit_test(fixed_reports_want_of_memory),
        cmocka_unit_test(job_in_memory_reports_want_of_memory),
        cmocka_unit_test(mend_reports_want_of_memory),
    };
    return cmocka_run_group_tests_name("memory", tests, set_up, tear_down);
}
