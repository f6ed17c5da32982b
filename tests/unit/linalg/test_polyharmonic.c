#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "check.h"
#include "golden.h"
#include "linalg/polyharmonic.h"

/* A factor with its memory. */
typedef struct fit {
    apsm_polyharmonic f;
    double *store, *work;
} fit;

static size_t work_size(size_t n)
{
    const size_t a = apsm_polyharmonic_factor_work_size(n),
                 b = apsm_polyharmonic_solve_work_size(n, APSM_POLYHARMONIC_BLOCK),
                 c = apsm_polyharmonic_resolve_work_size(n);
    return a > b ? (a > c ? a : c) : (b > c ? b : c);
}

static fit fit_new(apsm_phi phi, size_t n, const double *X, bool single)
{
    fit x = { .store = check_alloc(apsm_polyharmonic_store_size(n, single)),
              .work = check_alloc(work_size(n)) };
    assert_int_equal(apsm_polyharmonic_factor(phi, n, X, single, 0.0, x.store, x.work, &x.f),
                     APSM_OK);
    return x;
}

static void fit_free(fit *x)
{
    free(x->store);
    free(x->work);
}

/* tests/golden/metrics.json, "warp": displacements of 10 points carried to 12 others. */
static void warp_equals_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("metrics");
    const json_t *warp = golden_get(root, "warp");
    double *source = golden_member(warp, "source", 30), *target = golden_member(warp, "target", 30),
           *X = golden_member(warp, "X", 36);
    const char *names[] = { "biharmonic", "triharmonic" };
    const apsm_phi phis[] = { APSM_PHI_R, APSM_PHI_R3 };
    for (size_t k = 0; k < 2; k++) {
        double *want = golden_member(warp, names[k], 36), d[30], w[30], c[12], got[36];
        double W[12 * 10], mapped[36] = { 0 };
        fit x = fit_new(phis[k], 10, source, false);
        for (size_t i = 0; i < 30; i++) d[i] = target[i] - source[i];
        apsm_polyharmonic_solve(&x.f, 3, d, NULL, w, c, x.work);
        apsm_polyharmonic_eval(&(apsm_interpolants){ phis[k], 10, 3, source, w, c }, 12, X, got);
        for (size_t i = 0; i < 36; i++) got[i] += X[i];
        golden_close_max(names[k], 36, got, want, k ? 1e-7 : 1e-9);
        apsm_polyharmonic_map(&x.f, source, 12, X, W, x.work);
        for (size_t v = 0; v < 12; v++)
            for (size_t j = 0; j < 10; j++)
                for (size_t a = 0; a < 3; a++)
                    mapped[3 * v + a] += W[10 * v + j] * target[3 * j + a];
        golden_close_max("map", 36, mapped, want, k ? 1e-7 : 1e-9);
        free(want);
        fit_free(&x);
    }
    free(source);
    free(target);
    free(X);
    json_decref(root);
}

/* The interpolant takes its values, its weights are orthogonal to polynomials, and linear
 * functions come back with no kernel part at all. */
static void interpolates_and_reproduces_affine(void **state)
{
    (void)state;
    enum { N = 60, M = 4 };
    double X[3 * N], v[N * M], w[N * M], c[4 * M], back[N * M];
    check_uniform(1, 3 * N, -30.0, 50.0, X);
    check_uniform(2, N * M, -1.0, 1.0, v);
    for (size_t k = 0; k < N; k++) v[k * M] = 3.0 - X[3 * k] + 0.5 * X[3 * k + 2];
    for (apsm_phi phi = APSM_PHI_R; phi <= APSM_PHI_R3; phi += 2) {
        fit x = fit_new(phi, N, X, false);
        apsm_polyharmonic_solve(&x.f, M, v, NULL, w, c, x.work);
        apsm_polyharmonic_eval(&(apsm_interpolants){ phi, N, M, X, w, c }, N, X, back);
        golden_close("values", N * M, back, v, phi == APSM_PHI_R ? 1e-11 : 1e-9);
        const double want[4] = { 3.0, -1.0, 0.0, 0.5 };
        for (size_t i = 0; i < 4; i++)
            if (fabs(c[i * M] - want[i]) > 1e-10) fail_msg("c%zu = %.17g", i, c[i * M]);
        for (size_t j = 0; j < M; j++)
            for (size_t i = 0; i < 4; i++) {
                double sum = 0.0, size = 0.0;
                for (size_t k = 0; k < N; k++) {
                    sum += w[k * M + j] * (i ? X[3 * k + i - 1] : 1.0);
                    size += fabs(w[k * M + j]) * 50.0;
                }
                if (!(fabs(sum) <= 1e-11 * size + 1e-15)) fail_msg("sum w q = %g of %g", sum, size);
            }
        fit_free(&x);
    }
}

/* The whole inverse of (2): its product with [v; d] solves the system. */
static void solves_with_both_halves(void **state)
{
    (void)state;
    enum { N = 25, M = 2 };
    double X[3 * N], v[N * M], d[4 * M], w[N * M], c[4 * M], back[N * M];
    check_uniform(3, 3 * N, 10.0, 14.0, X);
    check_uniform(4, N * M, -1.0, 1.0, v);
    check_uniform(5, 4 * M, -1.0, 1.0, d);
    for (apsm_phi phi = APSM_PHI_R; phi <= APSM_PHI_R3; phi += 2) {
        fit x = fit_new(phi, N, X, false);
        apsm_polyharmonic_solve(&x.f, M, v, d, w, c, x.work);
        apsm_polyharmonic_eval(&(apsm_interpolants){ phi, N, M, X, w, c }, N, X, back);
        golden_close_max("A w + Q c", N * M, back, v, 1e-8);
        for (size_t j = 0; j < M; j++)
            for (size_t i = 0; i < 4; i++) {
                double sum = -d[i * M + j], size = 0.0;
                for (size_t k = 0; k < N; k++) {
                    sum += w[k * M + j] * (i ? X[3 * k + i - 1] : 1.0);
                    size = fmax(size, fabs(w[k * M + j]) * 14.0);
                }
                if (!(fabs(sum) <= 1e-12 * size)) fail_msg("Q^T w - d = %g of %g", sum, size);
            }
        fit_free(&x);
    }
}

/* Rows of the map sum to 1 and carry the centres to the points; more points than one block. */
static void map_is_affinely_exact(void **state)
{
    (void)state;
    enum { N = 20, NY = APSM_POLYHARMONIC_BLOCK + 7 };
    double X[3 * N], Y[3 * NY], W[NY * N];
    check_uniform(6, 3 * N, -5.0, 5.0, X);
    check_uniform(7, 3 * NY, -6.0, 6.0, Y);
    fit x = fit_new(APSM_PHI_R, N, X, false);
    apsm_polyharmonic_map(&x.f, X, NY, Y, W, x.work);
    for (size_t v = 0; v < NY; v++) {
        double sum = -1.0, y[3] = { -Y[3 * v], -Y[3 * v + 1], -Y[3 * v + 2] };
        for (size_t k = 0; k < N; k++) {
            sum += W[v * N + k];
            for (size_t a = 0; a < 3; a++) y[a] += W[v * N + k] * X[3 * k + a];
        }
        if (fabs(sum) > 1e-12 || fabs(y[0]) + fabs(y[1]) + fabs(y[2]) > 1e-11)
            fail_msg("row %zu: sum off by %g, point by %g %g %g", v, sum, y[0], y[1], y[2]);
    }
    fit_free(&x);
}

/* Doubling lengths halves weights of r exactly, divides those of r^3 by 8; points of any unit. */
static void scales_exactly(void **state)
{
    (void)state;
    enum { N = 30 };
    double X[3 * N], Z[3 * N], v[N], w[N], u[N], c[4], b[4];
    check_uniform(8, 3 * N, -5.0, 5.0, X);
    check_uniform(9, N, -1.0, 1.0, v);
    for (apsm_phi phi = APSM_PHI_R; phi <= APSM_PHI_R3; phi += 2)
        for (int e = -40; e <= 40; e += 40) {
            for (size_t i = 0; i < 3 * N; i++) Z[i] = ldexp(X[i], e);
            fit x = fit_new(phi, N, X, false), z = fit_new(phi, N, Z, false);
            apsm_polyharmonic_solve(&x.f, 1, v, NULL, w, c, x.work);
            apsm_polyharmonic_solve(&z.f, 1, v, NULL, u, b, z.work);
            check_scaled("w", N, u, w, ldexp(1.0, -(int)phi * e));
            check_scaled("c0", 1, b, c, 1.0);
            check_scaled("c", 3, b + 1, c + 1, ldexp(1.0, -e));
            fit_free(&x);
            fit_free(&z);
        }
}

static void single_precision_is_close(void **state)
{
    (void)state;
    enum { N = 150, NY = 50 };
    double X[3 * N], Y[3 * NY], v[N], w[N], c[4], f[NY], f32[NY];
    check_uniform(10, 3 * N, 100.0, 140.0, X);
    check_uniform(11, 3 * NY, 100.0, 140.0, Y);
    check_uniform(12, N, -1.0, 1.0, v);
    fit x = fit_new(APSM_PHI_R, N, X, false), s = fit_new(APSM_PHI_R, N, X, true);
    apsm_polyharmonic_solve(&x.f, 1, v, NULL, w, c, x.work);
    apsm_polyharmonic_eval(&(apsm_interpolants){ APSM_PHI_R, N, 1, X, w, c }, NY, Y, f);
    apsm_polyharmonic_solve(&s.f, 1, v, NULL, w, c, s.work);
    apsm_polyharmonic_eval(&(apsm_interpolants){ APSM_PHI_R, N, 1, X, w, c }, NY, Y, f32);
    golden_close("single", NY, f32, f, 3e-5);
    fit_free(&x);
    fit_free(&s);
    assert_int_equal(apsm_polyharmonic_factor(APSM_PHI_R3, N, X, true, 0.0, NULL, NULL, &x.f),
                     APSM_ERR_ARG);
}

static void coinciding_centres_need_a_ridge(void **state)
{
    (void)state;
    enum { N = 40 };
    double X[3 * N];
    check_uniform(13, 3 * N, -1.0, 1.0, X);
    memcpy(X + 3 * 17, X + 3 * 5, 3 * sizeof *X);
    for (int single = 0; single < 2; single++) {
        double *store = check_alloc(apsm_polyharmonic_store_size(N, single)),
               *work = check_alloc(work_size(N));
        apsm_polyharmonic f;
        assert_int_equal(apsm_polyharmonic_factor(APSM_PHI_R, N, X, single, 0.0, store, work, &f),
                         APSM_ERR_SINGULAR);
        assert_int_equal(apsm_polyharmonic_factor_robust(APSM_PHI_R, N, X, single, store, work, &f),
                         APSM_OK);
        assert_true(f.ridge > 0.0 && f.ridge <= (single ? 1e-4 : 1e-8));
        double flat[3 * N];
        memcpy(flat, X, sizeof flat);
        for (size_t k = 0; k < N; k++) flat[3 * k + 2] = 0.5 * flat[3 * k];
        assert_int_equal(
            apsm_polyharmonic_factor_robust(APSM_PHI_R, N, flat, single, store, work, &f),
            APSM_ERR_SINGULAR);
        flat[4] = NAN;
        assert_int_equal(
            apsm_polyharmonic_factor_robust(APSM_PHI_R, N, flat, single, store, work, &f),
            APSM_ERR_NONFINITE);
        free(store);
        free(work);
    }
}

/* Conjugate gradients with the factor of other centres, or of single precision, end at the
 * weights of the direct solve. */
static void resolves_after_moves(void **state)
{
    (void)state;
    enum { N = 120 };
    double X[3 * N], Z[3 * N], move[3 * N], v[N], w[N], u[N], c[4], b[4];
    size_t iterations;
    check_uniform(14, 3 * N, 20.0, 30.0, X);
    check_uniform(15, 3 * N, -0.1, 0.1, move);
    check_uniform(16, N, -1.0, 1.0, v);
    for (size_t i = 0; i < 3 * N; i++) Z[i] = X[i] + move[i];
    fit x = fit_new(APSM_PHI_R, N, X, false), z = fit_new(APSM_PHI_R, N, Z, false),
        s = fit_new(APSM_PHI_R, N, Z, true);
    apsm_polyharmonic_solve(&z.f, 1, v, NULL, w, c, z.work);
    assert_int_equal(apsm_polyharmonic_resolve(&x.f, Z, v,
                                               &(apsm_resolve_options){ false, 1e-13, 60 }, u, b,
                                               &iterations, x.work),
                     APSM_OK);
    golden_close_max("stale w", N, u, w, 1e-10);
    golden_close_max("stale c", 4, b, c, 1e-10);
    assert_true(iterations >= 2);
    assert_int_equal(apsm_polyharmonic_resolve(&s.f, Z, v,
                                               &(apsm_resolve_options){ false, 1e-13, 9 }, u, b,
                                               &iterations, s.work),
                     APSM_OK);
    golden_close_max("single w", N, u, w, 1e-10);
    assert_int_equal(apsm_polyharmonic_resolve(&s.f, Z, v, &(apsm_resolve_options){ true, 1e-5, 9 },
                                               u, b, &iterations, s.work),
                     APSM_OK);
    golden_close_max("w by floats", N, u, w, 1e-4);
    golden_close_max("c by floats", 4, b, c, 1e-3);
    assert_int_equal(apsm_polyharmonic_resolve(&x.f, Z, v,
                                               &(apsm_resolve_options){ true, 1e-5, 60 }, u, b,
                                               &iterations, x.work),
                     APSM_OK);
    golden_close_max("stale w by floats", N, u, w, 1e-4);
    assert_int_equal(apsm_polyharmonic_resolve(&z.f, Z, v,
                                               &(apsm_resolve_options){ false, 1e-9, 1 }, u, b,
                                               &iterations, x.work),
                     APSM_OK);
    assert_int_equal(iterations, 1); /* its own factor */
    assert_int_equal(apsm_polyharmonic_resolve(&x.f, Z, v,
                                               &(apsm_resolve_options){ false, 1e-13, 2 }, u, b,
                                               &iterations, x.work),
                     APSM_ERR_NONFINITE);
    fit_free(&x);
    fit_free(&z);
    fit_free(&s);
}

/* Rounding alone would let some of these through. */
static void coincidence_is_always_noticed(void **state)
{
    (void)state;
    enum { N = 40 };
    double X[3 * N], *store = check_alloc(apsm_polyharmonic_store_size(N, false)),
                     *work = check_alloc(work_size(N));
    apsm_polyharmonic f;
    for (uint64_t i = 0; i < 60; i++) {
        const size_t j = i % N, k = (7 * i + 3) % N;
        check_uniform(100 + i, 3 * N, -1.0, 1.0, X);
        if (j == k) continue;
        memcpy(X + 3 * j, X + 3 * k, 3 * sizeof *X);
        for (int single = 0; single < 2; single++)
            assert_int_equal(
                apsm_polyharmonic_factor(APSM_PHI_R, N, X, single, 0.0, store, work, &f),
                APSM_ERR_SINGULAR);
    }
    free(store);
    free(work);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(warp_equals_golden),
        cmocka_unit_test(interpolates_and_reproduces_affine),
        cmocka_unit_test(solves_with_both_halves),
        cmocka_unit_test(map_is_affinely_exact),
        cmocka_unit_test(scales_exactly),
        cmocka_unit_test(single_precision_is_close),
        cmocka_unit_test(coinciding_centres_need_a_ridge),
        cmocka_unit_test(coincidence_is_always_noticed),
        cmocka_unit_test(resolves_after_moves),
    };
    return cmocka_run_group_tests_name("polyharmonic", tests, NULL, NULL);
}
