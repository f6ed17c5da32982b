/* Signs and trust of modes, on cohorts that are known: an ellipsoid whose axes vary. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "context_fixture.h"
#include "core/random.h"
#include "model/mode_sign.h"
#include "model/mode_trust.h"

enum { I = 40, J = 90, PLANTED = 2 };

/* Ellipsoids of axes 5 (1 + a), 3 (1 + b), 2 with noise; `sample` moves the particles, shapes stay.
 */
static double *cohort(uint64_t sample, size_t shapes)
{
    double *P = malloc(shapes * 3 * J * sizeof *P), u[3 * J];
    apsm_random rng = apsm_random_stream(sample, APSM_STREAM_TEST, 0, 0);
    if (!P) abort();
    for (size_t j = 0; j < J; j++) {
        double norm = 0.0;
        for (size_t c = 0; c < 3; c++) u[3 * j + c] = apsm_random_normal(&rng);
        for (size_t c = 0; c < 3; c++) norm += u[3 * j + c] * u[3 * j + c];
        for (size_t c = 0; c < 3; c++) u[3 * j + c] /= sqrt(norm);
    }
    for (size_t i = 0; i < shapes; i++) {
        apsm_random own = apsm_random_stream(5, APSM_STREAM_TEST, i + 1, 0);
        const double a = 0.2 * apsm_random_normal(&own), b = 0.15 * apsm_random_normal(&own);
        const double axis[3] = { 5 * (1 + a), 3 * (1 + b), 2 };
        for (size_t k = 0; k < 3 * J; k++)
            P[3 * J * i + k] = axis[k % 3] * u[k] + 0.05 * apsm_random_normal(&own);
    }
    return P;
}

static apsm_shape_model model_of(double *P, size_t shapes)
{
    apsm_shape_model m;
    assert_int_equal(apsm_shape_model_fit(ctx, shapes, J, P, &m), APSM_OK);
    free(P);
    return m;
}

static double correlation(const apsm_shape_model *a, const apsm_shape_model *b, size_t k, size_t n)
{
    double xy = 0, xx = 0, yy = 0;
    for (size_t i = 0; i < n; i++) {
        const double x = a->score[i * a->modes + k], y = b->score[i * b->modes + k];
        xy += x * y, xx += x * x, yy += y * y;
    }
    return xy / sqrt(xx * yy);
}

static void signs_stay_when_particles_move(void **state)
{
    (void)state;
    apsm_shape_model first = model_of(cohort(1, I), I);
    for (uint64_t sample = 2; sample < 12; sample++) {
        apsm_shape_model other = model_of(cohort(sample, I), I);
        for (size_t k = 0; k < PLANTED; k++) assert_true(correlation(&first, &other, k, I) > 0.95);
        apsm_shape_model_free(&other);
    }
    apsm_shape_model_free(&first);
}

static void signs_stay_when_a_shape_is_left_out(void **state)
{
    (void)state;
    apsm_shape_model all = model_of(cohort(1, I), I), fewer = model_of(cohort(1, I - 1), I - 1);
    for (size_t k = 0; k < PLANTED; k++) assert_true(correlation(&all, &fewer, k, I - 1) > 0.95);
    apsm_shape_model_free(&all);
    apsm_shape_model_free(&fewer);
}

static void plus_is_longer(void **state)
{
    (void)state;
    apsm_shape_model m = model_of(cohort(3, I), I);
    double change[APSM_MODE_CHANGES];
    for (size_t k = 0; k < PLANTED; k++) {
        apsm_mode_changes(J, m.mean, m.mode + 3 * J * k, 0, change);
        assert_true(apsm_mode_direction(change) > 0.3);
        assert_true(change[k + 1] > 0.3);
    }
    apsm_shape_model_free(&m);
}

/* A mode that changes no extent goes by its scores; two shapes have none that are skewed. */
static void near_ties_go_by_the_scores(void **state)
{
    (void)state;
    const double tie[APSM_MODE_CHANGES] = { 0.3, 0.2, -0.31, 0 }, none[APSM_MODE_CHANGES] = { 0 };
    const double skewed[4] = { 0.8, -0.3, -0.3, -0.2 }, other[4] = { -0.8, 0.3, 0.3, 0.2 };
    assert_true(apsm_mode_sign(tie, 4, 1, skewed) == 1.0);
    assert_true(apsm_mode_sign(tie, 4, 1, other) == -1.0);
    assert_true(apsm_mode_sign(none, 2, 1, (double[]){ M_SQRT1_2, -M_SQRT1_2 }) == 0.0);
}

static void planted_modes_are_trusted_and_noise_is_not(void **state)
{
    (void)state;
    apsm_shape_model m = model_of(cohort(4, I), I);
    apsm_mode_trust *trust = calloc(m.modes, sizeof *trust);
    double share = 0, chance = 0;
    assert_non_null(trust);
    assert_int_equal(apsm_mode_trust_of(ctx, &m, trust), APSM_OK);
    for (size_t k = 0; k < m.modes; k++) {
        share += trust[k].share, chance += trust[k].chance;
        assert_int_equal(trust[k].trusted, k < PLANTED);
        assert_true(trust[k].cosine >= 0 && trust[k].cosine <= 1);
    }
    assert_true(fabs(share - 1) < 1e-12 && fabs(chance - 1) < 1e-12);
    assert_true(trust[0].cosine > 0.95 && trust[PLANTED].cosine < 0.8);
    assert_string_equal(apsm_mode_trust_text(&trust[PLANTED]), "not told apart from noise");
    free(trust);
    apsm_shape_model_free(&m);
}

static void without_modes_there_is_nothing_to_trust(void **state)
{
    (void)state;
    apsm_shape_model m = model_of(cohort(4, 1), 1);
    assert_int_equal(apsm_mode_trust_of(ctx, &m, NULL), APSM_OK);
    apsm_shape_model_free(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(signs_stay_when_particles_move),
        cmocka_unit_test(signs_stay_when_a_shape_is_left_out),
        cmocka_unit_test(plus_is_longer),
        cmocka_unit_test(near_ties_go_by_the_scores),
        cmocka_unit_test(planted_modes_are_trusted_and_noise_is_not),
        cmocka_unit_test(without_modes_there_is_nothing_to_trust),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
