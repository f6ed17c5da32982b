#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "check.h"
#include "golden.h"
#include "optimize/rbf_shape.h"

typedef struct fit {
    apsm_rbf_shape shape;
    apsm_polyharmonic factor;
    double *store, *factor_store, *work;
} fit;

static fit fit_new(apsm_phi phi, size_t J, const double *P, const double *N, double s, bool single)
{
    fit x = { .store = check_alloc(apsm_rbf_store_size(J)),
              .factor_store = check_alloc(apsm_polyharmonic_store_size(3 * J, single)),
              .work = check_alloc(apsm_rbf_work_size(J)) };
    const apsm_dipoles d = { P, N, s };
    apsm_rbf_bind(&x.shape, J, x.store);
    assert_int_equal(apsm_rbf_fit(phi, &d, single, x.factor_store, &x.factor, &x.shape, x.work),
                     APSM_OK);
    return x;
}

static void fit_free(fit *x)
{
    free(x->store);
    free(x->factor_store);
    free(x->work);
}

static void check_case(const json_t *c)
{
    const bool cubic = strcmp(json_string_value(golden_get(c, "kernel")), "triharmonic") == 0;
    const size_t J = json_array_size(golden_get(c, "P"));
    double *P = golden_member(c, "P", 3 * J), *N = golden_member(c, "N", 3 * J),
           *centres = golden_member(c, "centres", 9 * J), *w = golden_member(c, "weights", 3 * J),
           *poly = golden_member(c, "poly", 4), *X = golden_member(c, "X", 48),
           *f = golden_member(c, "f", 16), *grad_f = golden_member(c, "grad_f", 48);
    double got[16], grad[48];
    fit x = fit_new(cubic ? APSM_PHI_R3 : APSM_PHI_R, J, P, N, golden_number(c, "s"), false);
    golden_close("centres", 9 * J, x.shape.Q, centres, 1e-15);
    golden_close_max("weights", 3 * J, x.shape.w, w, cubic ? 1e-5 : 1e-9);
    golden_close_max("poly", 4, x.shape.c, poly, cubic ? 1e-5 : 1e-9);
    apsm_rbf_eval(&x.shape, 16, X, got, grad);
    golden_close_max("f", 16, got, f, cubic ? 1e-7 : 1e-9);
    golden_close_max("grad f", 48, grad, grad_f, cubic ? 1e-7 : 1e-9);
    assert_true(x.factor.ridge == 0.0);
    fit_free(&x);
    double *all[] = { P, N, centres, w, poly, X, f, grad_f };
    for (size_t i = 0; i < 8; i++) free(all[i]);
}

static void equals_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("rbf");
    const json_t *cases = golden_get(root, "cases");
    for (size_t i = 0; i < json_array_size(cases); i++) check_case(json_array_get(cases, i));
    json_decref(root);
}

/* The dipoles' values come back; on a sphere f is about the distance. */
static void is_a_signed_distance_near_a_sphere(void **state)
{
    (void)state;
    enum { J = 200 };
    double P[3 * J], N[3 * J], *f = check_alloc(3 * J);
    check_sphere(1, J, 10.0, N, P);
    fit x = fit_new(APSM_PHI_R, J, P, N, 0.6, false);
    apsm_rbf_eval(&x.shape, 3 * J, x.shape.Q, f, NULL);
    for (size_t j = 0; j < J; j++)
        if (fabs(f[j]) > 1e-10 || fabs(f[J + j] - 0.6) > 1e-10 || fabs(f[2 * J + j] + 0.6) > 1e-10)
            fail_msg("dipole %zu: %g %g %g", j, f[j], f[J + j], f[2 * J + j]);
    const double in[3] = { 0, 0, 0 }, out[3] = { 0, 14, 0 };
    apsm_rbf_eval(&x.shape, 1, in, f, NULL);
    apsm_rbf_eval(&x.shape, 1, out, f + 1, NULL);
    assert_true(f[0] < -2.0 && f[1] > 1.0);
    free(f);
    fit_free(&x);
}

/* A point's value must not depend on its place among the others. */
static void evaluation_is_independent_of_the_block(void **state)
{
    (void)state;
    enum { J = 20, R = 37 };
    double P[3 * J], N[3 * J], X[3 * R], f[R], g[3 * R], f1, g1[3];
    check_sphere(2, J, 10.0, N, P);
    check_uniform(3, 3 * R, -12.0, 12.0, X);
    fit x = fit_new(APSM_PHI_R, J, P, N, 1.0, false);
    apsm_rbf_eval(&x.shape, R, X, f, g);
    for (size_t r = 0; r < R; r++) {
        apsm_rbf_eval(&x.shape, 1, X + 3 * r, &f1, g1);
        check_scaled("f", 1, &f1, f + r, 1.0);
        check_scaled("grad f", 3, g1, g + 3 * r, 1.0);
    }
    fit_free(&x);
}

static double value_at(const double *X, void *user)
{
    double f;
    apsm_rbf_eval(user, 1, X, &f, NULL);
    return f;
}

static void gradient_matches_differences(void **state)
{
    (void)state;
    enum { J = 15 };
    double P[3 * J], N[3 * J], f, g[3];
    const double X[3] = { 3.0, -7.0, 6.0 };
    check_sphere(4, J, 10.0, N, P);
    for (apsm_phi phi = APSM_PHI_R; phi <= APSM_PHI_R3; phi += 2) {
        fit x = fit_new(phi, J, P, N, 1.0, false);
        apsm_rbf_eval(&x.shape, 1, X, &f, g);
        check_gradient("grad f", 3, X, 10.0, DBL_EPSILON, g, value_at, &x.shape);
        fit_free(&x);
    }
}

static void scales_exactly_and_moves_rigidly(void **state)
{
    (void)state;
    enum { J = 40, R = 20 };
    double P[3 * J], N[3 * J], X[3 * R], f[R], g[R];
    check_sphere(5, J, 10.0, N, P);
    check_uniform(6, 3 * R, -12.0, 12.0, X);
    fit x = fit_new(APSM_PHI_R, J, P, N, 1.0, false);
    apsm_rbf_eval(&x.shape, R, X, f, NULL);
    fit_free(&x);
    for (size_t i = 0; i < 3 * J; i++) P[i] *= 0x1p-20;
    for (size_t i = 0; i < 3 * R; i++) X[i] *= 0x1p-20;
    x = fit_new(APSM_PHI_R, J, P, N, 0x1p-20, false);
    apsm_rbf_eval(&x.shape, R, X, g, NULL);
    check_scaled("f", R, g, f, 0x1p-20);
    fit_free(&x);
    /* rotated about z by the 3-4-5 angle, and shifted by a metre */
    for (size_t i = 0; i < J + R; i++) {
        double *p = i < J ? P + 3 * i : X + 3 * (i - J), *n = i < J ? N + 3 * i : NULL;
        const double q[3] = { p[0] * 0x1p20, p[1] * 0x1p20, p[2] * 0x1p20 };
        p[0] = 0.6 * q[0] - 0.8 * q[1] + 1000.0;
        p[1] = 0.8 * q[0] + 0.6 * q[1];
        p[2] = q[2];
        if (!n) continue;
        const double a = n[0], b = n[1];
        n[0] = 0.6 * a - 0.8 * b;
        n[1] = 0.8 * a + 0.6 * b;
    }
    x = fit_new(APSM_PHI_R, J, P, N, 1.0, false);
    apsm_rbf_eval(&x.shape, R, X, g, NULL);
    golden_close("moved f", R, g, f, 1e-9);
    fit_free(&x);
}

/* Tolerances of single precision as the header states them. */
static void single_precision_is_close(void **state)
{
    (void)state;
    enum { J = 128, R = 100 };
    double P[3 * J], N[3 * J], X[3 * R], f[R], g[R], work[6 * J];
    check_sphere(7, J, 15.0, N, P);
    check_sphere(8, R, 15.3, X, X);
    for (size_t i = 0; i < J; i++) P[3 * i] += 200.0;
    for (size_t i = 0; i < R; i++) X[3 * i] = 15.3 * X[3 * i] + 200.0;
    for (size_t i = 0; i < R; i++)
        for (size_t a = 1; a < 3; a++) X[3 * i + a] *= 15.3;
    fit x = fit_new(APSM_PHI_R, J, P, N, 1.0, false), y = fit_new(APSM_PHI_R, J, P, N, 1.0, true);
    apsm_rbf_eval(&x.shape, R, X, f, NULL);
    assert_int_equal(apsm_rbf_eval_f32_work_size(J), 6 * J);
    apsm_rbf_eval_f32(&x.shape, R, X, g, work);
    for (size_t r = 0; r < R; r++)
        if (fabs(f[r] - g[r]) > 1e-3) fail_msg("eval_f32[%zu] off by %g", r, g[r] - f[r]);
    apsm_rbf_eval_f32(&y.shape, R, X, g, work);
    for (size_t r = 0; r < R; r++)
        if (fabs(f[r] - g[r]) > 1e-3) fail_msg("single fit[%zu] off by %g", r, g[r] - f[r]);
    fit_free(&x);
    fit_free(&y);
}

static void refit_equals_fit(void **state)
{
    (void)state;
    enum { J = 60 };
    double P[3 * J], N[3 * J], move[3 * J];
    size_t iterations;
    check_sphere(9, J, 15.0, N, P);
    check_uniform(10, 3 * J, -0.2, 0.2, move);
    fit x = fit_new(APSM_PHI_R, J, P, N, 1.0, false);
    for (size_t i = 0; i < 3 * J; i++) P[i] += move[i];
    fit y = fit_new(APSM_PHI_R, J, P, N, 1.0, false);
    const apsm_resolve_options o = { false, 1e-4, 30 };
    const apsm_dipoles d = { P, N, 1.0 };
    assert_int_equal(apsm_rbf_refit(&x.factor, &d, &o, &x.shape, &iterations, x.work), APSM_OK);
    golden_close_max("w", 3 * J, x.shape.w, y.shape.w, 1e-3);
    golden_close_max("c", 4, x.shape.c, y.shape.c, 1e-3);
    assert_true(iterations > 0 && iterations <= 15);
    fit_free(&x);
    fit_free(&y);
}

/* L = sum_r a_r f(x_r) of the particles. */
typedef struct linear {
    apsm_phi phi;
    size_t J, R;
    const double *N, *X, *a;
} linear;

static double linear_at(const double *P, void *user)
{
    const linear *l = user;
    double *f = check_alloc(l->R), sum = 0.0;
    fit x = fit_new(l->phi, l->J, P, l->N, 1.0, false);
    apsm_rbf_eval(&x.shape, l->R, l->X, f, NULL);
    for (size_t r = 0; r < l->R; r++) sum += l->a[r] * f[r];
    fit_free(&x);
    free(f);
    return sum;
}

static void adjoint_matches_differences(void **state)
{
    (void)state;
    enum { J = 14, R = 19 };
    double P[3 * J], N[3 * J], X[3 * R], a[R], grad[3 * J];
    check_sphere(11, J, 10.0, N, P);
    check_uniform(12, 3 * R, -12.0, 12.0, X);
    check_uniform(13, R, -1.0, 1.0, a);
    for (apsm_phi phi = APSM_PHI_R; phi <= APSM_PHI_R3; phi += 2) {
        linear l = { phi, J, R, N, X, a };
        const double condition = phi == APSM_PHI_R ? 1e2 : 1e5; /* of the projected system */
        fit x = fit_new(phi, J, P, N, 1.0, false);
        for (size_t i = 0; i < 3 * J; i++) grad[i] = 5.0;
        apsm_rbf_adjoint(&x.shape, &x.factor, R, X, a, grad, x.work);
        for (size_t i = 0; i < 3 * J; i++) grad[i] -= 5.0; /* it adds */
        check_gradient("adjoint", 3 * J, P, 10.0, condition * DBL_EPSILON, grad, linear_at, &l);
        fit_free(&x);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equals_golden),
        cmocka_unit_test(is_a_signed_distance_near_a_sphere),
        cmocka_unit_test(evaluation_is_independent_of_the_block),
        cmocka_unit_test(gradient_matches_differences),
        cmocka_unit_test(scales_exactly_and_moves_rigidly),
        cmocka_unit_test(single_precision_is_close),
        cmocka_unit_test(refit_equals_fit),
        cmocka_unit_test(adjoint_matches_differences),
    };
    return cmocka_run_group_tests_name("rbf_shape", tests, NULL, NULL);
}
