#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "context_fixture.h"
#include "core/random.h"
#include "golden.h"
#include "model/shape_model.h"

static double *random_particles(size_t count, uint64_t index)
{
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_TEST, index, 0);
    double *P = malloc(count * sizeof *P);
    if (!P) abort();
    for (size_t k = 0; k < count; k++) P[k] = 10.0 * apsm_random_normal(&rng);
    return P;
}

static apsm_shape_model fit(size_t I, size_t J, const double *P)
{
    apsm_shape_model model;
    assert_int_equal(apsm_shape_model_fit(ctx, I, J, P, &model), APSM_OK);
    return model;
}

static void agrees_with_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("metrics");
    double *P = golden_member(root, "P", 6 * 10 * 3);
    double *variance = golden_member(root, "eigenvalues", 5);
    double *mode = golden_member(root, "modes", 5 * 30);
    apsm_shape_model model = fit(6, 10, P);
    assert_int_equal(model.modes, 5);
    for (size_t k = 0; k < 5; k++)
        if (!(fabs(model.variance[k] - variance[k]) <= 1e-9 * variance[k]))
            fail_msg("variance[%zu] = %.17g, expected %.17g", k, model.variance[k], variance[k]);
    for (size_t k = 0; k < 5; k++) { /* the golden's sign is its own */
        double dot = 0.0;
        for (size_t c = 0; c < 30; c++) dot += model.mode[30 * k + c] * mode[30 * k + c];
        for (size_t c = 0; c < 30; c++) mode[30 * k + c] *= dot < 0 ? -1.0 : 1.0;
    }
    golden_close("mode", 150, model.mode, mode, 1e-9);
    apsm_shape_model_free(&model);
    free(P);
    free(variance);
    free(mode);
    json_decref(root);
}

/* Modes are orthonormal, training scores are projections with the stated variance, and mean plus
 * all modes gives the shape back. */
static void reproduces_its_shapes(void **state)
{
    (void)state;
    enum { I = 9, J = 14, N = 3 * J };
    double *P = random_particles(I * N, 1), b[I], x[N];
    apsm_shape_model model = fit(I, J, P);
    assert_int_equal(model.modes, I - 1);
    for (size_t k = 0; k < model.modes; k++)
        for (size_t l = 0; l < model.modes; l++) {
            double dot = 0.0;
            for (size_t c = 0; c < N; c++) dot += model.mode[k * N + c] * model.mode[l * N + c];
            if (!(fabs(dot - (k == l)) <= 1e-13)) fail_msg("mode %zu . mode %zu = %g", k, l, dot);
        }
    for (size_t k = 0; k < model.modes; k++) {
        double sum2 = 0.0;
        for (size_t i = 0; i < I; i++)
            sum2 += model.score[i * model.modes + k] * model.score[i * model.modes + k];
        golden_close("variance", 1, &model.variance[k], &(double){ sum2 / (I - 1) }, 1e-12);
    }
    for (size_t i = 0; i < I; i++) {
        apsm_shape_model_scores(&model, P + i * N, b);
        golden_close("score", model.modes, b, model.score + i * model.modes, 1e-12);
        apsm_shape_model_synthesize(&model, model.modes, b, x);
        golden_close("shape", N, x, P + i * N, 1e-12);
    }
    apsm_shape_model_free(&model);
    free(P);
}

/* p_i = q + t_i d has one mode, d / |d| with its largest entry positive, of the variance of
 * t_i |d|; the mean is q at t = 0. */
static void one_mode_is_found(void **state)
{
    (void)state;
    enum { I = 5, J = 4, N = 3 * J };
    const double t[I] = { -2, -1, 0, 1, 2 };
    double *q = random_particles(N, 2), d[N], P[I * N], norm2 = 0;
    for (size_t c = 0; c < N; c++) {
        d[c] = c == 7 ? -3.0 : 0.25 * (double)c;
        norm2 += d[c] * d[c];
    }
    for (size_t i = 0; i < I; i++)
        for (size_t c = 0; c < N; c++) P[i * N + c] = q[c] + t[i] * d[c];
    apsm_shape_model model = fit(I, J, P);
    assert_int_equal(model.modes, 1);
    golden_close("mean", N, model.mean, q, 1e-13);
    golden_close("variance", 1, model.variance, &(double){ 2.5 * norm2 }, 1e-12);
    for (size_t c = 0; c < N; c++) d[c] /= -sqrt(norm2);
    golden_close("mode", N, model.mode, d, 1e-12);
    apsm_shape_model_free(&model);
    free(q);
}

static void few_or_equal_shapes_have_few_modes(void **state)
{
    (void)state;
    enum { J = 6, N = 3 * J };
    double *P = random_particles(4 * N, 3);
    apsm_shape_model model = fit(1, J, P);
    assert_int_equal(model.modes, 0);
    golden_close("mean of one", N, model.mean, P, 0.0);
    apsm_shape_model_free(&model);
    model = fit(2, J, P);
    assert_int_equal(model.modes, 1);
    apsm_shape_model_free(&model);
    for (size_t i = 1; i < 3; i++) memcpy(P + i * N, P, N * sizeof *P);
    model = fit(3, J, P); /* three times the same, whose mean may round */
    assert_int_equal(model.modes, 0);
    apsm_shape_model_free(&model);
    model = fit(4, J, P);
    assert_int_equal(model.modes, 1);
    apsm_shape_model_free(&model);
    free(P);
}

/* Multiplying all lengths by 2^k gives exactly the multiplied model. */
static void scales_exactly(void **state)
{
    (void)state;
    enum { I = 7, J = 20, N = 3 * J };
    const double scale = 0x1p-10;
    double *P = random_particles(I * N, 4);
    apsm_shape_model a = fit(I, J, P);
    for (size_t k = 0; k < I * N; k++) P[k] *= scale;
    apsm_shape_model b = fit(I, J, P);
    assert_int_equal(a.modes, b.modes);
    for (size_t k = 0; k < a.modes; k++)
        assert_true(b.variance[k] == scale * scale * a.variance[k]);
    assert_memory_equal(a.mode, b.mode, a.modes * N * sizeof *a.mode);
    for (size_t k = 0; k < I * a.modes; k++) assert_true(b.score[k] == scale * a.score[k]);
    apsm_shape_model_free(&a);
    apsm_shape_model_free(&b);
    free(P);
}

/* A cohort 1e6 times as far away as it varies keeps its variances. */
static void stands_a_far_origin(void **state)
{
    (void)state;
    enum { I = 6, J = 10, N = 3 * J };
    double *P = random_particles(I * N, 5);
    apsm_shape_model a = fit(I, J, P);
    for (size_t k = 0; k < I * N; k++) P[k] += 1e7;
    apsm_shape_model b = fit(I, J, P);
    golden_close("variance", a.modes, b.variance, a.variance, 1e-8);
    apsm_shape_model_free(&a);
    apsm_shape_model_free(&b);
    free(P);
}

static void refuses_bad_input(void **state)
{
    (void)state;
    apsm_shape_model model;
    double P[12] = { 0, 1, 2, 3, 4, 5, 6, 7, NAN, 9, 10, 11 };
    assert_int_equal(apsm_shape_model_fit(ctx, 2, 2, P, &model), APSM_ERR_NONFINITE);
    assert_non_null(strstr(apsm_error_text(ctx), "particle 0 of shape 1"));
    assert_int_equal(apsm_shape_model_fit(ctx, 0, 2, P, &model), APSM_ERR_ARG);
    apsm_shape_model_free(&model);
}

/* I shapes of J particles far from the origin with `modes` modes of clearly different size. */
static double *plain_cohort(size_t I, size_t J, size_t modes, uint64_t index)
{
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_TEST, index, 0);
    double *P = malloc(3 * I * J * sizeof *P), *mode = malloc(3 * J * sizeof *mode);
    assert_true(P && mode);
    for (size_t k = 0; k < 3 * I * J; k++) P[k] = 100.0;
    for (size_t m = 0; m < modes; m++) {
        for (size_t c = 0; c < 3 * J; c++) mode[c] = apsm_random_normal(&rng);
        for (size_t i = 0; i < I; i++) {
            const double b = pow(0.6, (double)m) * apsm_random_normal(&rng);
            for (size_t c = 0; c < 3 * J; c++) P[3 * i * J + c] += b * mode[c];
        }
    }
    free(mode);
    return P;
}

/* The Gram matrix of the shapes and the covariance of the particles have the same modes, whichever
 * is the smaller; more shapes than a block of them. */
static void both_sides_agree(void **state)
{
    (void)state;
    enum { MODES = 8 };
    const size_t sizes[][2] = { { 150, 12 }, { 12, 40 }, { 90, 30 } };
    for (size_t s = 0; s < 3; s++) {
        const size_t I = sizes[s][0], J = sizes[s][1];
        double *P = plain_cohort(I, J, MODES, 20 + s);
        apsm_shape_model a, b;
        assert_int_equal(apsm_shape_model_fit_side(ctx, APSM_SIDE_SHAPES, I, J, P, &a), APSM_OK);
        assert_int_equal(apsm_shape_model_fit_side(ctx, APSM_SIDE_PARTICLES, I, J, P, &b), APSM_OK);
        assert_int_equal(a.modes, MODES);
        assert_int_equal(b.modes, MODES);
        assert_memory_equal(a.mean, b.mean, 3 * J * sizeof *a.mean);
        for (size_t k = 0; k < MODES; k++)
            assert_true(fabs(a.variance[k] - b.variance[k]) <= 1e-10 * a.variance[k]);
        golden_close("mode", MODES * 3 * J, a.mode, b.mode, 1e-10);
        golden_close("score", MODES * I, a.score, b.score, 1e-10);
        apsm_shape_model_free(&a);
        apsm_shape_model_free(&b);
        free(P);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_golden),
        cmocka_unit_test(reproduces_its_shapes),
        cmocka_unit_test(both_sides_agree),
        cmocka_unit_test(one_mode_is_found),
        cmocka_unit_test(few_or_equal_shapes_have_few_modes),
        cmocka_unit_test(scales_exactly),
        cmocka_unit_test(stands_a_far_origin),
        cmocka_unit_test(refuses_bad_input),
    };
    return cmocka_run_group_tests_name("shape_model", tests, set_up, tear_down);
}
