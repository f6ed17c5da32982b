/* Checkpoints whose sums fit and whose numbers are no run's: what somebody has made to do harm. */
#include "cmocka_all.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/run.h"
#include "files/checkpoint_file.h"
#include "files/files.h"
#include "folder.h"
#include "run/state.h"
#include "session/session.h"

enum { J = 8 };

/* As in src/folder/state_file.c. */
typedef struct numbers {
    int64_t I, J, stage, epoch, epochs_run, passes_without_gain, stage1_stop, own_size;
    double h, best_mismatched, doubt;
} numbers;

static const numbers good = {
    1, J, APSM_STAGE_FIDELITY, 3, 3, 0, APSM_STOP_LIMIT, 3 * J, 0.5, 2, 0
};

/* A run that is as far as its groomed shapes. */
static apsm_run *groomed(void **state, apsm_context *ctx)
{
    static char path[TEST_PATH];
    static const char *const set[][2] = { { "particles", "8" } };
    const apsm_run_settings settings = { .folder = folder_path(state, "m", path),
                                         .n_set = 1,
                                         .set = set };
    apsm_run *run = NULL;
    assert_int_equal(apsm_run_open(ctx, &settings, &run), APSM_OK);
    assert_int_equal(apsm_project_add(&run->project, "a", "a.ply", NULL), APSM_OK);
    run->mesh = calloc(1, sizeof *run->mesh);
    run->mesh_count = 1;
    memset(run->identity, 'a', 64);
    return run;
}

static void save(void **state, apsm_context *ctx, const apsm_run *run, const numbers *n,
                 const double *x)
{
    char path[TEST_PATH];
    apsm_checkpoint_writer *w;
    char *folder = run_path(run, "state");
    assert_int_equal(apsm_make_folder(ctx, folder), APSM_OK);
    free(folder);
    assert_int_equal(
        apsm_checkpoint_open(ctx, folder_path(state, "m/state/optimize.ckpt", path), &w), APSM_OK);
    apsm_checkpoint_add(w, "identity", run->identity, sizeof run->identity);
    apsm_checkpoint_add(w, "numbers", n, sizeof *n);
    apsm_checkpoint_add(w, "P", x, 3 * J * sizeof *x);
    apsm_checkpoint_add(w, "mean", x, 3 * J * sizeof *x);
    apsm_checkpoint_add(w, "own", x, 3 * J * sizeof *x);
    apsm_checkpoint_add(w, "history", x, 0);
    assert_int_equal(apsm_checkpoint_commit(w), APSM_OK);
}

static void expect(void **state, const numbers *n, const double *x, apsm_status wanted)
{
    apsm_context *ctx = apsm_context_new();
    apsm_run *run = groomed(state, ctx);
    apsm_optimizer_state s;
    save(state, ctx, run, n, x);
    const apsm_status status = run_load_state(run, RUN_CHECKPOINT, &s, NULL, NULL);
    if (status != wanted) fail_msg("status %d, not %d: %s", status, wanted, apsm_error_text(ctx));
    if (wanted != APSM_OK) assert_non_null(strstr(apsm_error_text(ctx), "optimize.ckpt"));
    apsm_optimizer_state_free(&s);
    apsm_run_close(run);
    apsm_context_free(ctx);
}

static void numbers_that_no_run_writes_are_refused(void **state)
{
    const double x[3 * J] = { 0 };
    numbers bad[17];
    size_t n = 0;
    for (size_t k = 0; k < 17; k++) bad[k] = good;
    expect(state, &good, x, APSM_OK);
    bad[n++].stage = -1;
    bad[n++].stage = 0;
    bad[n++].stage = APSM_STAGE_DONE + 1;
    bad[n++].own_size = INT64_MAX;
    bad[n++].own_size = INT64_MAX / 8 + 1;
    bad[n++].own_size = -1;
    bad[n++].own_size = 0; /* the round would look at what is not there */
    bad[n++].own_size = 3 * J - 1;
    bad[n++].epoch = -1; /* of the fidelity stage */
    bad[n++].epoch = INT64_MIN;
    bad[n++].epochs_run = -1;
    bad[n++].stage1_stop = APSM_STOP_COUNT;
    bad[n++].h = NAN;
    bad[n++].h = -1;
    bad[n++].best_mismatched = INFINITY;
    bad[n++].passes_without_gain = INT64_MAX;
    bad[n++].doubt = NAN;
    for (size_t k = 0; k < n; k++) expect(state, &bad[k], x, APSM_ERR_FORMAT);
}

static void arrays_without_numbers_are_refused(void **state)
{
    double x[3 * J] = { 0 };
    x[3 * J - 1] = NAN;
    expect(state, &good, x, APSM_ERR_NONFINITE);
    x[3 * J - 1] = -INFINITY;
    expect(state, &good, x, APSM_ERR_NONFINITE);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, folder_set_up, folder_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(numbers_that_no_run_writes_are_refused),
        TEST(arrays_without_numbers_are_refused),
    };
    return cmocka_run_group_tests_name("state", tests, NULL, NULL);
}
