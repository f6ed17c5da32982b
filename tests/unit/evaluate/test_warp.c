#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "cohorts.h"
#include "core/random.h"
#include "golden.h"

static apsm_context *ctx;
static int warnings;

static void count_warnings(void *user, apsm_log_level level, const char *text)
{
    (void)user;
    (void)text;
    warnings += level == APSM_LOG_WARNING;
}

static int set_up(void **state)
{
    (void)state;
    ctx = apsm_context_new();
    if (ctx) apsm_context_set_log(ctx, count_warnings, NULL);
    return ctx ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    apsm_context_free(ctx);
    return 0;
}

static apsm_warp build(apsm_phi phi, size_t n, const double *X, size_t J, const double *P)
{
    apsm_warp warp;
    assert_int_equal(apsm_warp_build(ctx, phi, n, X, J, P, &warp), APSM_OK);
    return warp;
}

static void agrees_with_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("metrics"), *w = golden_get(root, "warp");
    double *source = golden_member(w, "source", 30), *target = golden_member(w, "target", 30);
    double *X = golden_member(w, "X", 36), Y[36];
    double *biharmonic = golden_member(w, "biharmonic", 36);
    double *triharmonic = golden_member(w, "triharmonic", 36);
    apsm_warp warp = build(APSM_PHI_R, 12, X, 10, source);
    apsm_warp_apply(&warp, target, Y);
    golden_close("biharmonic", 36, Y, biharmonic, 1e-9);
    apsm_warp_free(&warp);
    warp = build(APSM_PHI_R3, 12, X, 10, source);
    apsm_warp_apply(&warp, target, Y);
    golden_close("triharmonic", 36, Y, triharmonic, 1e-9);
    apsm_warp_free(&warp);
    free(source);
    free(target);
    free(X);
    free(biharmonic);
    free(triharmonic);
    json_decref(root);
}

/* In single precision and by moves: the same to a millionth of the moves, for any number of
 * particles (whole lanes, a rest, more than a chunk). */
static void displaces_as_it_applies(void **state)
{
    (void)state;
    const size_t counts[3] = { 10, 64, 83 };
    for (size_t k = 0; k < 3; k++) {
        const size_t J = counts[k], n = 20;
        double P[3 * 83], D[3 * 83], Q[3 * 83], X[60], Y[60], Z[60];
        float *W = malloc(n * J * sizeof *W);
        apsm_random rng = apsm_random_stream(7, 0, J, 0);
        for (size_t x = 0; x < 3 * J; x++) {
            P[x] = 10 * apsm_random_uniform(&rng);
            D[x] = apsm_random_uniform(&rng) - 0.5;
            Q[x] = P[x] + D[x];
        }
        for (size_t x = 0; x < 60; x++) X[x] = 10 * apsm_random_uniform(&rng);
        apsm_warp warp = build(APSM_PHI_R, n, X, J, P);
        assert_non_null(W);
        for (size_t x = 0; x < n * J; x++) W[x] = (float)warp.W[x];
        apsm_warp_apply(&warp, Q, Y);
        apsm_warp_displace(n, J, W, X, D, Z);
        for (size_t x = 0; x < 60; x++) assert_true(fabs(Z[x] - Y[x]) < 2e-6);
        apsm_warp_free(&warp);
        free(W);
    }
}

/* Without W: the same, also where particles coincide and for any number of threads. */
static void goes_to_few_shapes(void **state)
{
    (void)state;
    enum { J = 30, V = 300, I = 4 };
    double *P = cohort(1, J, 1, 1), *X = cohort(1, V, 1, 2), *Q = cohort(I, J, 2, 3), Y[3 * V];
    double *Z = malloc(I * sizeof Y), *again = malloc(I * sizeof Y);
    memcpy(P + 3 * 7, P, 3 * sizeof *P);
    apsm_warp warp = build(APSM_PHI_R, V, X, J, P);
    assert_int_equal(apsm_warp_to_shapes(ctx, V, X, J, P, I, Q, Z), APSM_OK);
    for (size_t i = 0; i < I; i++) {
        apsm_warp_apply(&warp, Q + 3 * i * J, Y);
        golden_close("shape", 3 * V, Z + 3 * i * V, Y, 1e-9);
    }
    apsm_context_set_threads(ctx, 2);
    assert_int_equal(apsm_warp_to_shapes(ctx, V, X, J, P, I, Q, again), APSM_OK);
    apsm_context_set_threads(ctx, 1);
    assert_memory_equal(again, Z, I * sizeof Y);
    apsm_warp_free(&warp);
    free(P);
    free(X);
    free(Q);
    free(Z);
    free(again);
}

/* One that was asked for last is lent, and outlives the context's interest in it; another, by as
 * little as a bit, is not taken for it. */
static void is_shared_by_those_who_ask_for_the_same(void **state)
{
    (void)state;
    enum { J = 12, V = 50 };
    double *P = cohort(1, J, 1, 1), *X = cohort(1, V, 1, 2), Y[3 * V], Z[3 * V];
    apsm_warp a, b, c;
    assert_int_equal(apsm_warp_share(ctx, APSM_PHI_R, V, X, J, P, &a), APSM_OK);
    assert_int_equal(apsm_warp_share(ctx, APSM_PHI_R, V, X, J, P, &b), APSM_OK);
    assert_ptr_equal(a.W, b.W);
    apsm_warp_apply(&a, P, Y);
    apsm_warp_free(&a);
    P[4] = nextafter(P[4], INFINITY);
    assert_int_equal(apsm_warp_share(ctx, APSM_PHI_R, V, X, J, P, &c), APSM_OK);
    assert_ptr_not_equal(b.W, c.W);
    P[4] = nextafter(P[4], -INFINITY);
    apsm_warp_apply(&b, P, Z);
    assert_memory_equal(Y, Z, sizeof Y);
    apsm_warp_free(&b);
    assert_int_equal(apsm_warp_share(ctx, APSM_PHI_R3, V, X, J, P, &a), APSM_OK);
    assert_ptr_not_equal(a.W, c.W);
    apsm_warp_free(&a);
    apsm_warp_free(&c);
    free(P);
    free(X);
}

/* Particles go exactly where their targets are; affine maps are reproduced everywhere; whatever
 * the number of threads and of tasks. */
static void interpolates_and_reproduces_affine_maps(void **state)
{
    (void)state;
    enum { J = 40, V = 700 };
    double *P = cohort(1, J, 1, 1), *X = cohort(1, V, 1, 2), *T = cohort(1, J, 1, 3), Y[3 * V];
    apsm_warp warp = build(APSM_PHI_R, J, P, J, P);
    apsm_warp_apply(&warp, T, Y);
    golden_close("target", 3 * J, Y, T, 1e-10);
    apsm_warp_free(&warp);
    apsm_context_set_threads(ctx, 3);
    warp = build(APSM_PHI_R, V, X, J, P);
    apsm_context_set_threads(ctx, 1);
    apsm_warp again = build(APSM_PHI_R, V, X, J, P);
    assert_memory_equal(warp.W, again.W, V * J * sizeof *warp.W);
    apsm_warp_free(&again);
    const double A[9] = { 1, 2, 0, -1, 1, 0.5, 0, 0.25, 3 };
    for (size_t j = 0; j < J; j++)
        for (size_t a = 0; a < 3; a++)
            T[3 * j + a] =
                5 + A[3 * a] * P[3 * j] + A[3 * a + 1] * P[3 * j + 1] + A[3 * a + 2] * P[3 * j + 2];
    apsm_warp_apply(&warp, T, Y);
    for (size_t v = 0; v < V; v++)
        for (size_t a = 0; a < 3; a++) {
            const double y =
                5 + A[3 * a] * X[3 * v] + A[3 * a + 1] * X[3 * v + 1] + A[3 * a + 2] * X[3 * v + 2];
            golden_close("affine", 1, &Y[3 * v + a], &y, 1e-10);
        }
    apsm_warp_free(&warp);
    free(P);
    free(X);
    free(T);
}

/* Three particles at one place act as one whose target is the mean of theirs. */
static void coinciding_particles_share_a_centre(void **state)
{
    (void)state;
    enum { J = 12, V = 300 };
    double *P = cohort(1, J, 1, 4), *T = cohort(1, J, 1, 5), *X = cohort(1, V, 1, 6);
    double one[3 * (J - 2)], target[3 * (J - 2)], Y[3 * V], Z[3 * V];
    memcpy(P + 3 * 5, P, 3 * sizeof *P);
    memcpy(P + 3 * 11, P, 3 * sizeof *P);
    P[3 * 11] *= 1 + 1e-15;
    for (size_t j = 0, k = 0; j < J; j++) {
        if (j == 5 || j == 11) continue;
        memcpy(one + 3 * k, P + 3 * j, 3 * sizeof *P);
        memcpy(target + 3 * k++, T + 3 * j, 3 * sizeof *P);
    }
    for (size_t a = 0; a < 3; a++) target[a] = (T[a] + T[15 + a] + T[33 + a]) / 3;
    warnings = 0;
    apsm_warp warp = build(APSM_PHI_R, V, X, J, P);
    assert_int_equal(warp.merged, 3);
    assert_int_equal(warnings, 1);
    apsm_warp_apply(&warp, T, Y);
    apsm_warp_free(&warp);
    warp = build(APSM_PHI_R, V, X, J - 2, one);
    assert_int_equal(warp.merged, 0);
    apsm_warp_apply(&warp, target, Z);
    apsm_warp_free(&warp);
    golden_close("warped", 3 * V, Y, Z, 1e-9);
    free(P);
    free(T);
    free(X);
}

static void refuses_what_has_no_warp(void **state)
{
    (void)state;
    double *P = cohort(1, 8, 1, 7);
    apsm_warp warp;
    assert_int_equal(apsm_warp_build(ctx, APSM_PHI_R, 1, P, 4, P, &warp), APSM_ERR_GEOMETRY);
    assert_non_null(strstr(apsm_error_text(ctx), "4 particles"));
    for (size_t j = 0; j < 8; j++) P[3 * j + 2] = 1.5;
    assert_int_equal(apsm_warp_build(ctx, APSM_PHI_R, 1, P, 8, P, &warp), APSM_ERR_GEOMETRY);
    assert_non_null(strstr(apsm_error_text(ctx), "plane"));
    P[7] = NAN;
    assert_int_equal(apsm_warp_build(ctx, APSM_PHI_R, 1, P, 8, P, &warp), APSM_ERR_NONFINITE);
    assert_int_equal(apsm_warp_build(ctx, APSM_PHI_R, 0, P, 8, P, &warp), APSM_ERR_ARG);
    assert_null(warp.W);
    free(P);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_golden),
        cmocka_unit_test(goes_to_few_shapes),
        cmocka_unit_test(is_shared_by_those_who_ask_for_the_same),
        cmocka_unit_test(displaces_as_it_applies),
        cmocka_unit_test(interpolates_and_reproduces_affine_maps),
        cmocka_unit_test(coinciding_particles_share_a_centre),
        cmocka_unit_test(refuses_what_has_no_warp),
    };
    return cmocka_run_group_tests_name("warp", tests, set_up, tear_down);
}
