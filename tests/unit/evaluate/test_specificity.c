#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "cohorts.h"
#include "context_fixture.h"
#include "golden.h"

enum { MOST = 64 };
static void measure(size_t I, size_t J, const double *P, apsm_definition definition, size_t samples,
                    double *spec, double *error)
{
    apsm_shape_model model = fit_model(I, J, P);
    assert_int_equal(apsm_specificity(ctx, &model, definition, samples, I - 1, spec, error),
                     APSM_OK);
    apsm_shape_model_free(&model);
}

/* The golden's scores are multiples of the standard deviations, along modes of its own sign. */
static void agrees_with_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("metrics");
    double *P = golden_member(root, "P", 6 * 10 * 3), got[5];
    double *want = golden_member(root, "specificity", 5);
    double *mode = golden_member(root, "modes", 5 * 30);
    double *beta = golden_member(root, "specificity_betas", 20 * 5);
    apsm_shape_model model = fit_model(6, 10, P);
    for (size_t k = 0; k < 5; k++) {
        double dot = 0.0;
        for (size_t c = 0; c < 30; c++) dot += model.mode[30 * k + c] * mode[30 * k + c];
        for (size_t s = 0; s < 20; s++)
            beta[5 * s + k] *= (dot < 0 ? -1.0 : 1.0) * sqrt(model.variance[k]);
    }
    assert_int_equal(apsm_specificity_of(ctx, &model, 20, beta, got, NULL), APSM_OK);
    golden_close("specificity", 5, got, want, 1e-9);
    apsm_shape_model_free(&model);
    free(P);
    free(want);
    free(mode);
    free(beta);
    json_decref(root);
}

/* The bounds of the search exclude no nearest shape. */
static void agrees_with_full_search(void **state)
{
    (void)state;
    const size_t sizes[][3] = { { 2, 5, 3 }, { 12, 9, 4 }, { 40, 30, 50 }, { 40, 130, 2 } };
    for (size_t s = 0; s < 4; s++) {
        const size_t I = sizes[s][0], J = sizes[s][1], samples = 57;
        double *P = cohort(I, J, sizes[s][2], s), got[MOST], want[MOST];
        apsm_shape_model model = fit_model(I, J, P);
        double *scores = malloc(samples * model.modes * sizeof *scores);
        assert_non_null(scores);
        apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, s, 0);
        for (size_t k = 0; k < samples * model.modes; k++)
            scores[k] = sqrt(model.variance[k % model.modes]) * apsm_random_normal(&rng);
        assert_int_equal(apsm_specificity_of(ctx, &model, samples, scores, got, NULL), APSM_OK);
        specificity_by_search(I, J, P, &model, samples, scores, want);
        golden_close("specificity", model.modes, got, want, 1e-12);
        for (size_t m = model.modes; m + 1 < I; m++) assert_true(got[m] == got[model.modes - 1]);
        free(scores);
        apsm_shape_model_free(&model);
        free(P);
    }
}

/* Two shapes q +- d of one particle: a sample is q + b d/|d|, b ~ N(0, s^2) with s = sqrt(2) |d|,
 * and its distance to the nearest is | |b| - |d| |.  Its mean over b is found by summation. */
static void one_mode_has_its_known_mean(void **state)
{
    (void)state;
    const double d = 3.0, P[6] = { 1, 2, 3 + d, 1, 2, 3 - d }, s = sqrt(2.0) * d;
    double want = 0.0, uniform = 0.0, weight = 0.0, got, error;
    for (int k = -80000; k <= 80000; k++) {
        const double z = k * 1e-4, w = exp(-0.5 * z * z);
        want += w * fabs(fabs(z * s) - d);
        weight += w;
        if (abs(k) <= 30000) uniform += fabs(fabs(z * s) - d) / 60001;
    }
    want /= weight;
    measure(2, 1, P, APSM_DEFINITION_STANDARD, 0, &got, &error);
    if (!(fabs(got - want) < 4 * error && error < 0.1 * want))
        fail_msg("standard: %g +- %g, expected %g", got, error, want);
    measure(2, 1, P, APSM_DEFINITION_PAPER, 0, &got, &error);
    if (!(fabs(got - uniform) < 4 * error && error < 0.02 * want))
        fail_msg("paper: %g +- %g, expected %g", got, error, uniform);
}

/* `standard` and `paper` scale with the unit; `shapeworks-compat`, as documented, does not: its
 * scores have variance sigma, the singular value, so their spread grows with the root of the unit.
 */
static void only_shapeworks_depends_on_the_unit(void **state)
{
    (void)state;
    enum { I = 20, J = 16, N = I * 3 * J };
    double *P = cohort(I, J, 30, 20), *Q = malloc(N * sizeof *Q), mm[MOST], m[MOST];
    assert_non_null(Q);
    for (size_t k = 0; k < N; k++) Q[k] = P[k] / 1000;
    for (int d = 0; d < 2; d++) {
        measure(I, J, P, (apsm_definition)d, 200, mm, NULL);
        measure(I, J, Q, (apsm_definition)d, 200, m, NULL);
        for (size_t k = 0; k < I - 1; k++) m[k] *= 1000;
        golden_close("in metres", I - 1, m, mm, 1e-10);
        assert_null(apsm_definition_warning((apsm_definition)d));
    }
    measure(I, J, P, APSM_DEFINITION_SHAPEWORKS, 200, mm, NULL);
    measure(I, J, Q, APSM_DEFINITION_SHAPEWORKS, 200, m, NULL);
    assert_true(1000 * m[I - 2] > 3 * mm[I - 2]);
    assert_non_null(strstr(apsm_definition_warning(APSM_DEFINITION_SHAPEWORKS), "unit"));
    free(P);
    free(Q);
}

/* With one mode of singular value sigma = I - 1 ShapeWorks' variance is the right one. */
static void shapeworks_is_right_in_one_unit(void **state)
{
    (void)state;
    enum { I = 5, J = 2, N = 3 * J };
    double P[I * N] = { 0 }, standard[I], shapeworks[I];
    const double t[I] = { -2, -1, 0, 1, 2 }; /* sigma = sqrt(10) s = 4 */
    for (size_t i = 0; i < I; i++) P[i * N] = t[i] * 4 / sqrt(10);
    measure(I, J, P, APSM_DEFINITION_STANDARD, 300, standard, NULL);
    measure(I, J, P, APSM_DEFINITION_SHAPEWORKS, 300, shapeworks, NULL);
    golden_close("shapeworks", 1, shapeworks, standard, 1e-12);
}

static void does_not_depend_on_what_it_must_not(void **state)
{
    (void)state;
    enum { I = 15, J = 70, N = 3 * J, S = 37 };
    double *P = cohort(I, J, 20, 10), *Q = malloc(I * N * sizeof *Q);
    double a[MOST], ea[MOST], b[MOST], eb[MOST];
    assert_non_null(Q);
    measure(I, J, P, APSM_DEFINITION_STANDARD, S, a, ea);
    apsm_context_set_threads(ctx, 4); /* same bytes */
    measure(I, J, P, APSM_DEFINITION_STANDARD, S, b, eb);
    apsm_context_set_threads(ctx, 1);
    assert_memory_equal(a, b, (I - 1) * sizeof *a);
    assert_memory_equal(ea, eb, (I - 1) * sizeof *ea);
    for (size_t k = 0; k < I * N; k++) Q[k] = P[k] * 0x1p-20; /* exactly scaled */
    measure(I, J, Q, APSM_DEFINITION_STANDARD, S, b, eb);
    for (size_t m = 0; m < I - 1; m++) assert_true(b[m] == a[m] * 0x1p-20);
    for (size_t i = 0; i < I; i++) /* other order of the shapes */
        memcpy(Q + i * N, P + (i * 4 % I) * N, N * sizeof *Q);
    measure(I, J, Q, APSM_DEFINITION_STANDARD, S, b, eb);
    golden_close("shapes reordered", I - 1, b, a, 1e-10);
    apsm_context_set_seed(ctx, 1); /* and what it must */
    measure(I, J, P, APSM_DEFINITION_STANDARD, S, b, eb);
    apsm_context_set_seed(ctx, 0);
    assert_true(b[0] != a[0]);
    for (size_t m = 0; m < I - 1; m++)
        if (!(fabs(b[m] - a[m]) < 5 * (ea[m] + eb[m]))) fail_msg("seeds disagree at %zu", m);
    free(P);
    free(Q);
}

static void few_or_equal_shapes(void **state)
{
    (void)state;
    double P[12] = { 1, 2, 3, 4, 5, 6, 1, 2, 3, 4, 5, 6 }, spec[1] = { -1 };
    measure(1, 4, P, APSM_DEFINITION_STANDARD, 10, spec, NULL);
    assert_true(spec[0] == -1);
    measure(2, 2, P, APSM_DEFINITION_STANDARD, 10, spec, NULL);
    assert_true(spec[0] == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_golden),
        cmocka_unit_test(agrees_with_full_search),
        cmocka_unit_test(one_mode_has_its_known_mean),
        cmocka_unit_test(only_shapeworks_depends_on_the_unit),
        cmocka_unit_test(shapeworks_is_right_in_one_unit),
        cmocka_unit_test(does_not_depend_on_what_it_must_not),
        cmocka_unit_test(few_or_equal_shapes),
    };
    return cmocka_run_group_tests_name("specificity", tests, set_up, tear_down);
}
