/* Ridge regression: its dual form is the primal one, and what cannot be predicted is not. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "context_fixture.h"
#include "core/random.h"
#include "linalg/linalg.h"
#include "statistics/ridge.h"

enum { N = 40, V = 6, MANY = 90 };
static void draw(apsm_random *rng, size_t n, double *x)
{
    for (size_t k = 0; k < n; k++) x[k] = apsm_random_normal(rng);
}

/* (Xc' Xc + l I) b = Xc' yc, solved directly. */
static void dual_is_primal(void **state)
{
    (void)state;
    static double X[N * V], y[N], G[V * V], b[V];
    apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, 0, 0);
    ridge m = { 0 };
    double mean[V] = { 0 }, y_mean = 0, trace = 0;
    draw(&rng, N * V, X);
    draw(&rng, N, y);
    for (size_t i = 0; i < N; i++) y[i] += 2 * X[i * V] - X[i * V + 3] + 7;
    assert_int_equal(ridge_fit(ctx, N, V, X, y, &m), APSM_OK);
    for (size_t i = 0; i < N; i++) {
        y_mean += y[i] / N;
        for (size_t v = 0; v < V; v++) mean[v] += X[i * V + v] / N;
    }
    for (size_t i = 0; i < N; i++)
        for (size_t v = 0; v < V; v++) {
            const double x = X[i * V + v] - mean[v];
            trace += x * x / N;
            b[v] += x * (y[i] - y_mean);
            for (size_t u = 0; u < V; u++) G[v * V + u] += x * (X[i * V + u] - mean[u]);
        }
    for (size_t v = 0; v < V; v++) G[v * (V + 1)] += m.lambda * trace;
    assert_int_equal(apsm_cholesky(V, G), APSM_OK);
    apsm_cholesky_solve(V, G, 1, b);
    for (size_t v = 0; v < V; v++) assert_true(fabs(m.slope[v] - b[v]) < 1e-10);
    double at = y_mean;
    for (size_t v = 0; v < V; v++) at += b[v] * (X[v] - mean[v]);
    assert_true(fabs(ridge_predict(&m, X) - at) < 1e-10);
    ridge_free(&m);
}

static double share(const double *y, const double *p)
{
    double left = 0, all = 0, mean = 0;
    for (size_t i = 0; i < N; i++) mean += y[i] / N;
    for (size_t i = 0; i < N; i++) {
        left += (y[i] - p[i]) * (y[i] - p[i]);
        all += (y[i] - mean) * (y[i] - mean);
    }
    return 1 - left / all;
}

/* More variables than shapes: noise fits the shapes at hand perfectly, and others not at all. */
static void noise_is_not_predicted_and_signal_is(void **state)
{
    (void)state;
    static double X[N * MANY], y[N], p[N], noise = 0;
    for (uint64_t k = 0; k < 8; k++) {
        apsm_random rng = apsm_random_stream(k, APSM_STREAM_TEST, 1, 0);
        draw(&rng, N * MANY, X);
        draw(&rng, N, y);
        assert_int_equal(ridge_cross_validate(ctx, N, MANY, X, y, 10, p), APSM_OK);
        noise += share(y, p) / 8;
        for (size_t i = 0; i < N; i++) { /* a strong direction with the value on it */
            for (size_t v = 0; v < MANY; v++) X[i * MANY + v] += 2 * y[i] * (v % 3 == 0);
            y[i] += 10;
        }
        assert_int_equal(ridge_cross_validate(ctx, N, MANY, X, y, 10, p), APSM_OK);
        assert_true(share(y, p) > 0.9);
    }
    assert_true(noise < 0.05);
}

static void threads_change_nothing(void **state)
{
    (void)state;
    static double X[N * MANY], y[N], p[N], q[N];
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, 2, 0);
    draw(&rng, N * MANY, X);
    draw(&rng, N, y);
    apsm_context_set_threads(ctx, 1);
    assert_int_equal(ridge_cross_validate(ctx, N, MANY, X, y, 7, p), APSM_OK);
    apsm_context_set_threads(ctx, 3);
    assert_int_equal(ridge_cross_validate(ctx, N, MANY, X, y, 7, q), APSM_OK);
    assert_memory_equal(p, q, sizeof p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dual_is_primal),
        cmocka_unit_test(noise_is_not_predicted_and_signal_is),
        cmocka_unit_test(threads_change_nothing),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
