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
static void measure(size_t I, size_t J, const double *P, double *gen, double *error)
{
    apsm_shape_model model = fit_model(I, J, P);
    assert_int_equal(apsm_generalization(ctx, &model, gen, error), APSM_OK);
    apsm_shape_model_free(&model);
}

static void agrees_with_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("metrics");
    double *P = golden_member(root, "P", 6 * 10 * 3), got[4];
    double *want = golden_member(root, "generalization", 4);
    measure(6, 10, P, got, NULL);
    golden_close("generalization", 4, got, want, 1e-9);
    free(P);
    free(want);
    json_decref(root);
}

static void check_against_refitting(size_t I, size_t J, const double *P, double tol)
{
    double got[MOST], want[MOST];
    measure(I, J, P, got, NULL);
    generalization_by_refitting(I, J, P, want);
    golden_close_max("generalization", I - 2, got, want, tol);
}

/* 300 particles are more than one slab of blocks. */
static void agrees_with_refitting(void **state)
{
    (void)state;
    const size_t sizes[][3] = { { 3, 5, 9 }, { 10, 7, 20 }, { 30, 20, 40 }, { 25, 300, 30 } };
    for (size_t s = 0; s < 4; s++) {
        double *P = cohort(sizes[s][0], sizes[s][1], sizes[s][2], s);
        check_against_refitting(sizes[s][0], sizes[s][1], P, 1e-11);
        free(P);
    }
}

/* Fewer modes than shapes: the models of the others run out of modes. */
static void agrees_with_refitting_when_modes_run_out(void **state)
{
    (void)state;
    double *P = cohort(12, 9, 4, 7);
    check_against_refitting(12, 9, P, 1e-7);        /* rounding above 1e-12 of the variance */
    memcpy(P + 27 * 3, P + 27 * 8, 27 * sizeof *P); /* the same shape twice */
    check_against_refitting(12, 9, P, 1e-7);
    free(P);
    P = cohort(9, 2, 9, 8); /* 6 coordinates for 8 modes */
    check_against_refitting(9, 2, P, 1e-11);
    free(P);
}

/* Without C, three shapes A and two B have one mode, and C lies beside it. */
static void stays_when_the_others_have_no_more_modes(void **state)
{
    (void)state;
    enum { J = 8, N = 3 * J };
    double *P = cohort(6, J, 6, 12), gen[4];
    for (size_t i = 1; i < 3; i++) memcpy(P + i * N, P, N * sizeof *P);
    memcpy(P + 4 * N, P + 3 * N, N * sizeof *P);
    check_against_refitting(6, J, P, 1e-11);
    measure(6, J, P, gen, NULL);
    assert_true(gen[0] > 0.1 && gen[3] > 0.1);
    check_against_refitting(4, J, P, 1e-11); /* A A A B: the others of B are all alike */
    free(P);
}

/* Shapes at +-e_k: all variances are equal, and each model of the others has k equal ones, so
 * nothing but the whole set of modes is defined. */
static void survives_equal_variances(void **state)
{
    (void)state;
    enum { J = 4, I = 6 * J };
    double P[I * 3 * J] = { 0 }, gen[I], want[I];
    for (size_t i = 0; i < I; i++) P[i * 3 * J + i / 2] = i % 2 ? 1.0 : -1.0;
    measure(I, J, P, gen, NULL);
    generalization_by_refitting(I, J, P, want);
    for (size_t m = 0; m < I - 2; m++) assert_true(gen[m] >= -1e-12 && gen[m] <= 0.2865);
    for (size_t m = 3 * J - 1; m < I - 2; m++)
        if (!(fabs(gen[m] - want[m]) <= 1e-12)) fail_msg("%g, expected %g", gen[m], want[m]);
}

/* One mode: the others span it, so nothing remains. */
static void one_mode_generalizes_exactly(void **state)
{
    (void)state;
    double *P = cohort(7, 6, 1, 9), gen[5];
    measure(7, 6, P, gen, NULL);
    for (size_t m = 0; m < 5; m++)
        if (!(gen[m] < 1e-12)) fail_msg("generalization(%zu) = %g", m + 1, gen[m]);
    free(P);
}

static void does_not_depend_on_what_it_must_not(void **state)
{
    (void)state;
    enum { I = 15, J = 70, N = 3 * J };
    double *P = cohort(I, J, 20, 10), *Q = malloc(I * N * sizeof *Q);
    double a[MOST], ea[MOST], b[MOST], eb[MOST];
    assert_non_null(Q);
    measure(I, J, P, a, ea);
    apsm_context_set_threads(ctx, 4); /* same bytes */
    measure(I, J, P, b, eb);
    apsm_context_set_threads(ctx, 1);
    assert_memory_equal(a, b, (I - 2) * sizeof *a);
    assert_memory_equal(ea, eb, (I - 2) * sizeof *ea);
    for (size_t k = 0; k < I * N; k++) Q[k] = P[k] * 0x1p20; /* exactly scaled */
    measure(I, J, Q, b, eb);
    for (size_t m = 0; m < I - 2; m++) assert_true(b[m] == a[m] * 0x1p20);
    memcpy(Q, P, I * N * sizeof *Q);
    move_rigidly(I * J, Q);
    measure(I, J, Q, b, eb);
    golden_close("moved", I - 2, b, a, 1e-11);
    for (size_t i = 0; i < I; i++) /* other order of the shapes */
        memcpy(Q + i * N, P + (i * 4 % I) * N, N * sizeof *Q);
    measure(I, J, Q, b, eb);
    golden_close("shapes reordered", I - 2, b, a, 1e-11);
    golden_close("error, shapes reordered", I - 2, eb, ea, 1e-10);
    for (size_t i = 0; i < I; i++) /* other order of the particles */
        for (size_t j = 0; j < J; j++)
            memcpy(Q + i * N + 3 * j, P + i * N + 3 * (j * 3 % J), 3 * sizeof *Q);
    measure(I, J, Q, b, eb);
    golden_close("particles reordered", I - 2, b, a, 1e-11);
    free(P);
    free(Q);
}

static void few_shapes_have_none(void **state)
{
    (void)state;
    double *P = cohort(3, 6, 5, 11), gen[1] = { -1 };
    measure(1, 6, P, gen, NULL);
    measure(2, 6, P, gen, NULL);
    assert_true(gen[0] == -1);
    measure(3, 6, P, gen, NULL);
    assert_true(gen[0] > 0);
    free(P);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_golden),
        cmocka_unit_test(agrees_with_refitting),
        cmocka_unit_test(agrees_with_refitting_when_modes_run_out),
        cmocka_unit_test(stays_when_the_others_have_no_more_modes),
        cmocka_unit_test(survives_equal_variances),
        cmocka_unit_test(one_mode_generalizes_exactly),
        cmocka_unit_test(does_not_depend_on_what_it_must_not),
        cmocka_unit_test(few_shapes_have_none),
    };
    return cmocka_run_group_tests_name("generalization", tests, set_up, tear_down);
}
