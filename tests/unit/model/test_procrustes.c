#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "core/random.h"
#include "geometry/affine.h"
#include "model/procrustes.h"

enum { I = 6, J = 20, N = 3 * J };

static void random_rotation(apsm_random *rng, double R[9])
{
    double A[9];
    for (size_t k = 0; k < 9; k++) A[k] = apsm_random_normal(rng);
    apsm_nearest_rotation(A, R);
}

/* Copies of one random set, each moved by its own rotation, shift and size, plus noise. */
static void moved_copies(uint64_t index, int with_size, double noise, double *P)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, index, 0);
    double base[N], R[9];
    for (size_t k = 0; k < N; k++) base[k] = 20 * apsm_random_normal(&rng);
    for (size_t i = 0; i < I; i++) {
        double at[3];
        random_rotation(&rng, R);
        const double s = with_size ? 0.5 + apsm_random_uniform(&rng) : 1.0;
        for (size_t a = 0; a < 3; a++) at[a] = 100 * apsm_random_normal(&rng);
        for (size_t j = 0; j < J; j++)
            for (size_t a = 0; a < 3; a++) {
                double x = noise * apsm_random_normal(&rng);
                for (size_t b = 0; b < 3; b++) x += R[3 * a + b] * base[3 * j + b];
                P[i * N + 3 * j + a] = s * x + at[a];
            }
    }
}

static double largest_difference(size_t n, const double *a, const double *b)
{
    double d = 0;
    for (size_t k = 0; k < n; k++) d = fmax(d, fabs(a[k] - b[k]));
    return d;
}

static double centroid_size(const double *p)
{
    double c[3] = { 0 }, s2 = 0;
    for (size_t k = 0; k < N; k++) c[k % 3] += p[k] / J;
    for (size_t k = 0; k < N; k++) s2 += (p[k] - c[k % 3]) * (p[k] - c[k % 3]);
    return sqrt(s2);
}

/* Sum of squared distances to the mean. */
static double spread(const double *P)
{
    double sum = 0;
    for (size_t k = 0; k < N; k++) {
        double m = 0;
        for (size_t i = 0; i < I; i++) m += P[i * N + k] / I;
        for (size_t i = 0; i < I; i++) sum += (P[i * N + k] - m) * (P[i * N + k] - m);
    }
    return sum;
}

static void undoes_rigid_motions(void **state)
{
    (void)state;
    double P[I * N], Q[I * N], M[I * 16], q[N];
    moved_copies(1, 0, 0.0, P);
    apsm_procrustes_options opt = apsm_procrustes_defaults();
    opt.reference = 2;
    assert_int_equal(apsm_procrustes(NULL, I, J, P, &opt, M, Q), APSM_OK);
    for (size_t i = 0; i < I; i++) { /* all lie on the reference, which stays */
        if (!(largest_difference(N, Q + i * N, P + 2 * N) < 1e-9))
            fail_msg("shape %zu is off by %g", i, largest_difference(N, Q + i * N, P + 2 * N));
        apsm_affine_apply(M + 16 * i, J, P + i * N, q);
        assert_true(largest_difference(N, q, Q + i * N) == 0.0);
        if (!(fabs(apsm_affine_det(M + 16 * i) - 1) < 1e-12)) fail_msg("not rigid");
    }
}

static void undoes_similarities_without_shrinking(void **state)
{
    (void)state;
    double P[I * N], M[I * 16], s2 = 0;
    moved_copies(2, 1, 0.0, P);
    for (size_t i = 0; i < I; i++) s2 += pow(centroid_size(P + i * N), 2) / I;
    apsm_procrustes_options opt = apsm_procrustes_defaults();
    opt.scale = true;
    opt.reference = 0;
    assert_int_equal(apsm_procrustes(NULL, I, J, P, &opt, M, P), APSM_OK); /* in place */
    for (size_t i = 0; i < I; i++) {
        assert_true(fabs(centroid_size(P + i * N) - sqrt(s2)) < 1e-9 * sqrt(s2));
        assert_true(largest_difference(N, P + i * N, P) < 1e-9);
    }
}

static void size_alone_keeps_place_and_direction(void **state)
{
    (void)state;
    double P[I * N], Q[I * N], M[I * 16];
    moved_copies(3, 1, 0.0, P);
    apsm_procrustes_options opt = apsm_procrustes_defaults();
    opt.pose = false;
    opt.scale = true;
    assert_int_equal(apsm_procrustes(NULL, I, J, P, &opt, M, Q), APSM_OK);
    for (size_t i = 0; i < I; i++)
        for (size_t a = 0; a < 3; a++) {
            double p = 0, q = 0;
            for (size_t j = 0; j < J; j++) {
                p += P[i * N + 3 * j + a] / J;
                q += Q[i * N + 3 * j + a] / J;
            }
            assert_true(fabs(p - q) < 1e-9);
            for (size_t b = 0; b < 3; b++) assert_true(a == b || M[16 * i + 4 * a + b] == 0.0);
        }
}

/* At the minimum no small rotation of a single shape brings it closer to the mean of the others;
 * and the result does not depend on the poses the shapes came in, up to one common motion. */
static void noisy_shapes_reach_the_same_minimum(void **state)
{
    (void)state;
    double P[I * N], Q[I * N], R[9], M[I * 16];
    moved_copies(4, 0, 2.0, P);
    apsm_procrustes_options opt = apsm_procrustes_defaults();
    opt.reference = 1;
    assert_int_equal(apsm_procrustes(NULL, I, J, P, &opt, M, Q), APSM_OK);
    const double best = spread(Q);
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 44, 0);
    for (size_t i = 0; i < I; i++) {
        random_rotation(&rng, R);
        for (size_t j = 0; j < J; j++) {
            double *p = P + i * N + 3 * j;
            const double x[3] = { p[0], p[1], p[2] };
            for (size_t a = 0; a < 3; a++)
                p[a] = R[3 * a] * x[0] + R[3 * a + 1] * x[1] + R[3 * a + 2] * x[2] + 5;
        }
    }
    double Q2[I * N];
    assert_int_equal(apsm_procrustes(NULL, I, J, P, &opt, M, Q2), APSM_OK);
    if (!(fabs(spread(Q2) - best) < 1e-7 * best)) fail_msg("%.12g and %.12g", best, spread(Q2));
    for (size_t i = 0; i < I; i++)
        for (int axis = 0; axis < 3; axis++) {
            double T[I * N];
            for (size_t k = 0; k < I * N; k++) T[k] = Q[k];
            const size_t u = (size_t)(axis + 1) % 3, v = (size_t)(axis + 2) % 3;
            double c[3] = { 0 };
            for (size_t k = 0; k < N; k++) c[k % 3] += Q[i * N + k] / J;
            for (size_t j = 0; j < J; j++) {
                double *p = T + i * N + 3 * j;
                const double a = p[u] - c[u], b = p[v] - c[v];
                p[u] = c[u] + cos(0.01) * a - sin(0.01) * b;
                p[v] = c[v] + sin(0.01) * a + cos(0.01) * b;
            }
            assert_true(spread(T) > best);
        }
}

static void mean_of(const double *P, double *mean)
{
    for (size_t k = 0; k < N; k++) {
        mean[k] = 0;
        for (size_t i = 0; i < I; i++) mean[k] += P[i * N + k] / I;
    }
}

/* Largest entry by which the rigid map that brings a to b differs from the identity. */
static double turn_between(const double *a, const double *b)
{
    double M[16], one[16];
    apsm_affine_identity(one);
    apsm_affine_fit(J, a, b, NULL, 0, M);
    return largest_difference(16, M, one);
}

/* Every shape has its best pose to the mean, and the frame is the one asked for: that of the
 * reference, or that of the mean at the start. */
static void rests_in_the_frame_asked_for(void **state)
{
    (void)state;
    double P[I * N], Q[I * N], M[I * 16], before[N], after[N];
    moved_copies(5, 0, 12.0, P);
    apsm_procrustes_options opt = apsm_procrustes_defaults();
    opt.reference = 3;
    assert_int_equal(apsm_procrustes(NULL, I, J, P, &opt, M, Q), APSM_OK);
    assert_true(largest_difference(N, Q + 3 * N, P + 3 * N) < 1e-9);
    opt.reference = SIZE_MAX;
    for (size_t i = 0; i < I; i++) /* close to aligned, so that the mean means something */
        for (size_t k = 0; k < N; k++) P[i * N + k] = Q[i * N + k] + (double)(i * (k % 3));
    mean_of(P, before);
    assert_int_equal(apsm_procrustes(NULL, I, J, P, &opt, M, Q), APSM_OK);
    mean_of(Q, after);
    if (!(turn_between(after, before) < 1e-7)) fail_msg("%g", turn_between(after, before));
    for (size_t i = 0; i < I; i++)
        if (!(turn_between(Q + i * N, after) < 1e-6))
            fail_msg("shape %zu can still be turned by %g", i, turn_between(Q + i * N, after));
}

static void refuses_what_has_no_size(void **state)
{
    (void)state;
    double P[2 * 9] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 5, 5, 5, 5, 5, 5, 5, 5 }, M[32];
    apsm_procrustes_options opt = apsm_procrustes_defaults();
    opt.scale = true;
    assert_int_equal(apsm_procrustes(NULL, 2, 3, P, &opt, M, NULL), APSM_ERR_GEOMETRY);
    assert_int_equal(apsm_procrustes(NULL, 2, 2, P, &opt, M, NULL), APSM_ERR_ARG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(undoes_rigid_motions),
        cmocka_unit_test(undoes_similarities_without_shrinking),
        cmocka_unit_test(size_alone_keeps_place_and_direction),
        cmocka_unit_test(noisy_shapes_reach_the_same_minimum),
        cmocka_unit_test(rests_in_the_frame_asked_for),
        cmocka_unit_test(refuses_what_has_no_size),
    };
    return cmocka_run_group_tests_name("procrustes", tests, NULL, NULL);
}
