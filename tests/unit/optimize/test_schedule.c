/* Which epochs do what, how shapes are divided into batches, and what an epoch's record says. */
#include <math.h>
#include <string.h>

#include "cmocka_all.h"
#include "optimize/optimizer.h"
#include "optimize/schedule.h"
#include "optimize/terms.h"
#include "synthetic.h"

static void batches_differ_by_one_shape_at_most(void **state)
{
    (void)state;
    for (size_t I = 1; I <= 300; I++)
        for (size_t K = 1; K <= I; K += 7) {
            const size_t n = (I + K - 1) / K;
            assert_int_equal(batch_begin(I, K, 0), 0);
            assert_int_equal(batch_begin(I, K, n), I);
            for (size_t b = 0; b < n; b++) {
                const size_t size = batch_begin(I, K, b + 1) - batch_begin(I, K, b);
                assert_true(size <= K && size >= I / n && size <= I / n + 1);
            }
        }
    assert_int_equal(batch_begin(257, 64, 1), 52); /* not 64, 64, 64, 64 and 1 */
    assert_int_equal(batch_begin(257, 64, 4), 206);
}

static void passes_are_counted_as_they_come(void **state)
{
    (void)state;
    apsm_optimize_options o = apsm_optimize_defaults();
    o.schedule.stage1_epochs = 100;
    o.schedule.decay2_at = 0.85;
    o.walk.geodesic_interval = 25;
    schedule s = schedule_of_stage(&o, APSM_STAGE_1);
    assert_int_equal(passes_of_stage(&s), 5); /* 0, 25, 50, 75 and the second decay */
    o.schedule.stage1_epochs = 6;
    o.walk.geodesic_interval = 25; /* at most half of the stage: 0, 3, and 5 */
    s = schedule_of_stage(&o, APSM_STAGE_1);
    assert_int_equal(passes_of_stage(&s), 3);
    o.walk.geodesic_correspondence = false;
    s = schedule_of_stage(&o, APSM_STAGE_1);
    assert_int_equal(passes_of_stage(&s), 0);
}

/* No stage follows that would bring it back: epochs to settle keep the template's spread. */
static void settling_is_adaptive_without_stages(void **state)
{
    (void)state;
    apsm_optimize_options o = apsm_optimize_defaults();
    schedule s = schedule_of_stage(&o, APSM_STAGE_1);
    assert_true(weights_of_epoch(&o, &s, APSM_STAGE_1, -5, 9).c == o.schedule.adaptivity);
    o.schedule.stage2_epochs = 1;
    s = schedule_of_stage(&o, APSM_STAGE_1);
    assert_true(weights_of_epoch(&o, &s, APSM_STAGE_1, -5, 9).c == 0);
}

/* ---- the record of an epoch with several batches ---- */

enum { I = 4, J = 20, LEVEL = 2 };

static void make_cohort(apsm_context *ctx, apsm_cohort *cohort, double *P)
{
    apsm_mesh mesh[I];
    double M[16 * I] = { 0 };
    const char *const names[I] = { "a", "b", "c", "d" };
    for (size_t i = 0; i < I; i++) {
        mesh[i] = synthetic_shape(SYNTHETIC_BUMP, i, I, LEVEL);
        for (size_t c = 0; c < 4; c++) M[16 * i + 5 * c] = 1;
        memcpy(P + i * J * 3, mesh[i].V, J * 3 * sizeof *P);
        for (size_t x = 0; x < J * 3; x++) P[i * J * 3 + x] += (double)((i * i * 7 + x) % 5);
    }
    const apsm_cohort_input in = { I, names, mesh, M, 0 };
    assert_int_equal(apsm_cohort_build(ctx, &in, 3, 8, cohort), APSM_OK);
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
}

static apsm_status take_figure(void *user, const apsm_optimizer_state *state,
                               const apsm_epoch_record *record)
{
    (void)state;
    *(double *)user = record->loss[APSM_TERM_EIGENSHAPE];
    return APSM_OK;
}

static double figure_of_seed(apsm_context *ctx, const apsm_cohort *cohort, const double *P,
                             uint64_t seed)
{
    apsm_optimize_options o = apsm_optimize_defaults();
    apsm_optimizer_state s;
    double figure = NAN;
    o.schedule.stage1_epochs = o.schedule.burn_in = 0;
    o.schedule.stage2_epochs = 1;
    o.batch = 2;
    o.schedule.beta = 0.05;
    o.schedule.alpha = o.schedule.gamma = o.step.learning_rate = o.fidelity.fidelity =
        0; /* nothing moves */
    o.step.step = APSM_STEP_LITERAL;
    o.step.snap = APSM_SNAP_NONE;
    apsm_context_set_seed(ctx, seed);
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &s), APSM_OK);
    memcpy(s.P, P, I * J * 3 * sizeof *P);
    assert_int_equal(apsm_optimize(ctx, cohort, &o, &s, take_figure, &figure), APSM_OK);
    assert_memory_equal(s.P, P, I * J * 3 * sizeof *P);
    apsm_optimizer_state_free(&s);
    return figure;
}

/* Four shapes fall into two pairs in three ways: whichever pair comes last, the mean of both has
 * three values; the last pair's own figure would have six. */
static void an_epochs_figure_is_the_mean_over_its_batches(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_cohort cohort;
    double P[I * J * 3], seen[I * I];
    size_t n = 0;
    make_cohort(ctx, &cohort, P);
    for (uint64_t seed = 0; seed < 60; seed++) {
        const double x = figure_of_seed(ctx, &cohort, P, seed);
        size_t k = 0;
        assert_true(isfinite(x));
        while (k < n && fabs(seen[k] - x) > 1e-9 * fabs(x)) k++;
        if (k == n && n < I * I) seen[n++] = x;
    }
    assert_int_equal(n, 3);
    apsm_cohort_free(&cohort);
    apsm_context_free(ctx);
}

/* ---- a term of its own: one file's worth, one line in a table ---- */

static bool always(const optimizer *op)
{
    (void)op;
    return true;
}

static double tenth(const optimizer *op)
{
    (void)op;
    return 0.1;
}

/* 1/2 |P|^2: towards the origin. */
static apsm_status gradient_of_shrinking(const optimizer *op, size_t k, worker *w, double *loss,
                                         double *g)
{
    const double *P = particles(op, op->batch[k]);
    (void)w;
    *loss = 0;
    for (size_t x = 0; x < op->J * 3; x++) {
        g[x] = P[x];
        *loss += P[x] * P[x] / 2;
    }
    return APSM_OK;
}

static const term shrinking = {
    .name = "shrinking", .is_on = always, .weight = tenth, .gradient = gradient_of_shrinking
};

static apsm_status take_losses(void *user, const apsm_optimizer_state *state,
                               const apsm_epoch_record *record)
{
    (void)state;
    memcpy(user, record->loss, sizeof record->loss);
    return APSM_OK;
}

static void a_new_term_needs_no_more_than_its_entry(void **state)
{
    (void)state;
    const term *const terms[] = { &term_sampling, &shrinking };
    apsm_context *ctx = apsm_context_new();
    apsm_cohort cohort;
    apsm_optimizer_state s;
    double P[I * J * 3], loss[APSM_TERMS_MOST], sum = 0;
    apsm_optimize_options o = apsm_optimize_defaults();
    o.schedule.stage1_epochs = o.schedule.burn_in = 0;
    o.schedule.stage2_epochs = 1;
    o.batch = 3;
    o.schedule.alpha = o.schedule.beta = o.schedule.gamma = o.fidelity.fidelity = o.step.step_clip =
        0;
    o.step.snap = APSM_SNAP_NONE;
    make_cohort(ctx, &cohort, P);
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &s), APSM_OK);
    memcpy(s.P, P, sizeof P);
    assert_int_equal(optimize_terms(ctx, &cohort, &o, 2, terms, &s, take_losses, loss), APSM_OK);
    for (size_t x = 0; x < I * J * 3; x++) {
        assert_true(fabs(s.P[x] - 0.9 * P[x]) <= 1e-12 * (1 + fabs(P[x])));
        sum += P[x] * P[x] / 2;
    }
    assert_true(isfinite(loss[0]) && fabs(loss[1] - sum / I) <= 1e-9 * sum);
    assert_true(isnan(loss[2]));
    apsm_optimizer_state_free(&s);
    apsm_cohort_free(&cohort);
    apsm_context_free(ctx);
}

static void columns_are_the_table(void **state)
{
    (void)state;
    static const char *const names[] = { "sampling", "correspondence", "eigenshape", "landmarks",
                                         "features" };
    assert_int_equal(APSM_TERMS, 5);
    for (size_t t = 0; t < APSM_TERMS; t++) assert_string_equal(apsm_loss_name(t), names[t]);
    assert_null(apsm_loss_name(APSM_TERMS));
}

/* ---- the pass before all where stage 1 has no epochs ---- */

static void a_first_pass_is_whole_or_undone(void **state)
{
    (void)state;
    volatile int flag = 1;
    apsm_context *ctx = apsm_context_new();
    apsm_cohort cohort;
    apsm_optimizer_state s;
    double P[I * J * 3];
    apsm_optimize_options o = apsm_optimize_defaults();
    make_cohort(ctx, &cohort, P);
    for (size_t j = 0; j < J; j++) /* of one shape they are all mixed up */
        memcpy(P + (J + j) * 3, cohort.shape[1].mesh.V + 3 * (7 * j % J), 3 * sizeof *P);
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &s), APSM_OK);
    memcpy(s.P, P, sizeof P);
    assert_false(apsm_draws_points(&o, &s));
    apsm_context_set_interrupt(ctx, &flag);
    assert_int_equal(apsm_first_pass(ctx, &cohort, &o, &s), APSM_ERR_INTERRUPTED);
    assert_memory_equal(s.P, P, sizeof P);
    assert_true(s.h == 0 && s.epoch == 0 && s.best_mismatched == 2);
    flag = 0;
    o.schedule.stage1_epochs = 1; /* which begins with a pass of its own */
    assert_int_equal(apsm_first_pass(ctx, &cohort, &o, &s), APSM_OK);
    assert_memory_equal(s.P, P, sizeof P);
    assert_true(apsm_draws_points(&o, &s));
    o.schedule.stage1_epochs = 0;
    assert_int_equal(apsm_first_pass(ctx, &cohort, &o, &s), APSM_OK);
    assert_int_equal(s.epoch, -o.schedule.settle_epochs);
    assert_memory_equal(s.P, P, sizeof P); /* the pass comes with the epochs to settle */
    assert_true(apsm_draws_points(&o, &s));
    s.epoch = 0;
    o.schedule.settle_epochs = 0; /* then the pass is all: what is left is stage 2 */
    assert_int_equal(apsm_first_pass(ctx, &cohort, &o, &s), APSM_OK);
    assert_true(s.stage == APSM_STAGE_2 && s.epoch == 0 && s.h == 0);
    assert_memory_not_equal(s.P, P, sizeof P);
    memcpy(P, s.P, sizeof P);
    assert_int_equal(apsm_first_pass(ctx, &cohort, &o, &s), APSM_OK); /* not twice */
    assert_memory_equal(s.P, P, sizeof P);
    apsm_optimizer_state_free(&s);
    apsm_cohort_free(&cohort);
    apsm_context_free(ctx);
}

static void points_are_drawn_in_epochs_to_come(void **state)
{
    (void)state;
    apsm_optimize_options o = apsm_optimize_defaults();
    o.schedule.stage2_epochs = 2;
    for (int stage = APSM_STAGE_1; stage <= APSM_STAGE_DONE; stage++)
        for (long epoch = 0; epoch < 3; epoch++) {
            const apsm_optimizer_state s = { .stage = stage, .epoch = epoch };
            const bool draws = stage == APSM_STAGE_1 || (stage == APSM_STAGE_2 && epoch < 2);
            assert_true(apsm_draws_points(&o, &s) == draws);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(batches_differ_by_one_shape_at_most),
        cmocka_unit_test(passes_are_counted_as_they_come),
        cmocka_unit_test(settling_is_adaptive_without_stages),
        cmocka_unit_test(an_epochs_figure_is_the_mean_over_its_batches),
        cmocka_unit_test(a_new_term_needs_no_more_than_its_entry),
        cmocka_unit_test(columns_are_the_table),
        cmocka_unit_test(a_first_pass_is_whole_or_undone),
        cmocka_unit_test(points_are_drawn_in_epochs_to_come),
    };
    return cmocka_run_group_tests_name("schedule", tests, NULL, NULL);
}
