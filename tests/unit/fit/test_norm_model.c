/* Norms: left-out figures against norms made without the shape, and percentiles that are kept. */
#include "cmocka_all.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"
#include "fit/norm_job.h"

enum { N = 24, J = 7, V = 3 * J, Q = 3 };

/* Ones, an age, a group; N + n rows. */
static void data(uint64_t index, size_t rows, double *X, double *Y)
{
    apsm_random rng = apsm_random_stream(4, APSM_STREAM_TEST, index, 0);
    for (size_t i = 0; i < rows; i++) {
        const double age = apsm_random_normal(&rng), group = i % 2 ? 1 : -1;
        const double x[Q] = { 1, age, group };
        memcpy(X + i * Q, x, sizeof x);
        for (size_t v = 0; v < V; v++)
            Y[i * V + v] = 3 + age * (double)(v % 4) - group +
                           (1 + (double)(v % 3)) * apsm_random_normal(&rng);
    }
}

/* Shape i of the cohort, left out, is as new to a norm of the others. */
static void left_out_is_as_new(void **state)
{
    (void)state;
    double X[N * Q], Y[N * V], X1[N * Q], Y1[N * V], own[J], new[J];
    norm_model all, others;
    data(0, N, X, Y);
    assert_ok(norm_model_make(NULL, &(norm_data){ N, 0, Q, 3, V, X, Y, Y }, &all));
    for (size_t i = 0; i < N; i += 5) {
        size_t n = 0;
        for (size_t k = 0; k < N; k++) {
            if (k == i) continue;
            memcpy(X1 + n * Q, X + k * Q, Q * sizeof *X);
            memcpy(Y1 + n++ * V, Y + k * V, V * sizeof *Y);
        }
        memcpy(X1 + n * Q, X + i * Q, Q * sizeof *X);
        assert_ok(norm_model_make(NULL, &(norm_data){ n, 1, Q, 3, V, X1, Y1, Y + i * V }, &others));
        assert_true(fabs(norm_distance_own(&all, i) / norm_distance_new(&others, 0) - 1) < 1e-12);
        norm_particles_own(&all, i, own);
        norm_particles_new(&others, 0, NULL, new);
        for (size_t j = 0; j < J; j++) assert_true(fabs(own[j] - new[j]) < 1e-10);
        norm_model_free(&others);
    }
    norm_model_free(&all);
}

/* Of new shapes of the same kind 5 % have p below 0.05, whatever the columns. */
static void level_is_kept(void **state)
{
    (void)state;
    enum { TRIALS = 400 };
    size_t particles = 0, t = 0;
    double sum = 0;
    for (uint64_t k = 0; k < TRIALS; k++) {
        double X[(N + 1) * Q], Y[(N + 1) * V], p[J];
        norm_model m;
        data(10 + k, N + 1, X, Y);
        assert_ok(norm_model_make(NULL, &(norm_data){ N, 1, Q, 3, V, X, Y, Y + N * V }, &m));
        norm_particles_new(&m, 0, NULL, p);
        for (size_t j = 0; j < J; j++) particles += p[j] < 0.05;
        for (size_t v = 0; v < V; v++) t += fabs(norm_t(&m, 0, v)) > 2.0796138447; /* 21 degrees */
        for (size_t i = 0; i < N; i++) sum += norm_distance_own(&m, i) < norm_distance_new(&m, 0);
        norm_model_free(&m);
    }
    /* Particles are independent: the standard errors are 0.4 %, 0.24 %; of the percentile 1.4 %. */
    assert_true(fabs((double)particles / (TRIALS * J) - 0.05) < 0.016);
    assert_true(fabs((double)t / (TRIALS * V) - 0.05) < 0.01);
    assert_true(fabs(sum / (TRIALS * N) - 0.5) < 0.05);
}

static void planted_bump_is_found(void **state)
{
    (void)state;
    double X[(N + 1) * Q], Y[(N + 1) * V], p[J], T2[J];
    norm_model m;
    data(1000, N + 1, X, Y);
    Y[N * V + 3 * 4] += 30;
    assert_ok(norm_model_make(NULL, &(norm_data){ N, 1, Q, 3, V, X, Y, Y + N * V }, &m));
    norm_particles_new(&m, 0, T2, p);
    for (size_t j = 0; j < J; j++) assert_true(j == 4 ? p[j] < 1e-6 : p[j] > 1e-3);
    for (size_t j = 0; j < J; j++) assert_true(j == 4 || T2[j] < T2[4] / 5);
    norm_model_free(&m);
}

/* With one coordinate a particle p is that of its t, and shapes that were left out are as new. */
static void one_coordinate_is_students(void **state)
{
    (void)state;
    double X[(N + 1) * Q], Y[(N + 1) * V], X1[N * Q], Y1[N * V], own[V], new[V], T2[V];
    norm_model all, others;
    data(5, N + 1, X, Y);
    assert_ok(norm_model_make(NULL, &(norm_data){ N, 1, Q, 1, V, X, Y, Y + N * V }, &all));
    norm_particles_new(&all, 0, T2, new);
    for (size_t v = 0; v < V; v++) {
        const double t = norm_t(&all, 0, v), nu = N - Q;
        assert_true(fabs(T2[v] - t * t) < 1e-9 * (1 + t * t));
        assert_true(fabs(new[v] - 2 * norm_student(-fabs(t), nu)) < 1e-12);
    }
    for (size_t i = 0; i < N; i += 7) {
        memcpy(X1, X, sizeof X1);
        memcpy(Y1, Y, sizeof Y1);
        memcpy(X1 + i * Q, X1 + (N - 1) * Q, Q * sizeof *X);
        memcpy(Y1 + i * V, Y1 + (N - 1) * V, V * sizeof *Y);
        memcpy(X1 + (N - 1) * Q, X + i * Q, Q * sizeof *X);
        const norm_data data = { N - 1, 1, Q, 1, V, X1, Y1, Y + i * V };
        assert_ok(norm_model_make(NULL, &data, &others));
        norm_particles_own(&all, i, own);
        norm_particles_new(&others, 0, NULL, new);
        for (size_t v = 0; v < V; v++) assert_true(fabs(own[v] - new[v]) < 1e-10);
        norm_model_free(&others);
    }
    norm_model_free(&all);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(left_out_is_as_new),
                                        cmocka_unit_test(level_is_kept),
                                        cmocka_unit_test(planted_bump_is_found),
                                        cmocka_unit_test(one_coordinate_is_students) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
