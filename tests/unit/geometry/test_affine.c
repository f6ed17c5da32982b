#include "cmocka_all.h"

#include <string.h>

#include "core/random.h"
#include "geometry/affine.h"

static void random_matrix(apsm_random *rng, double A[9])
{
    for (int k = 0; k < 9; k++) A[k] = apsm_random_normal(rng);
}

static double det3(const double A[9])
{
    return A[0] * (A[4] * A[8] - A[5] * A[7]) - A[1] * (A[3] * A[8] - A[5] * A[6]) +
           A[2] * (A[3] * A[7] - A[4] * A[6]);
}

static void check_orthogonal(const double Q[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double dot = 0.0;
            for (int k = 0; k < 3; k++) dot += Q[3 * k + i] * Q[3 * k + j];
            assert_near(dot, i == j ? 1.0 : 0.0, 1e-14);
        }
}

/* U and V orthogonal, s sorted and >= 0, U diag(s) V^T = A. */
static void check_svd(const double A[9])
{
    double U[9], s[3], V[9], size = 0.0;
    apsm_svd3(A, U, s, V);
    check_orthogonal(U);
    check_orthogonal(V);
    assert_true(s[0] >= s[1] && s[1] >= s[2] && s[2] >= 0.0);
    for (int k = 0; k < 9; k++) size = fmax(size, fabs(A[k]));
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double sum = 0.0;
            for (int k = 0; k < 3; k++) sum += U[3 * i + k] * s[k] * V[3 * j + k];
            assert_near(sum, A[3 * i + j], 4e-15 * size);
        }
}

static void svd_of_any_matrix(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    const double special[][9] = {
        { 0 },                           /* zero */
        { 1, 0, 0, 0, 1, 0, 0, 0, 1 },   /* equal values */
        { 1, 2, 3, 2, 4, 6, 3, 6, 9 },   /* rank 1 */
        { 1, 2, 3, 4, 5, 6, 7, 8, 9 },   /* rank 2 */
        { 0, 0, 0, 0, 0, 0, 0, 0, -5 },  /* one entry */
        { -1, 0, 0, 0, -1, 0, 0, 0, 1 }, /* a rotation */
        { 1, 1e-9, 0, 0, 1e-9, 0, 0, 0, 1e-18 },
    };
    for (size_t k = 0; k < sizeof special / sizeof *special; k++) check_svd(special[k]);
    for (int trial = 0; trial < 500; trial++) {
        double A[9];
        random_matrix(&rng, A);
        for (int k = 0; k < 9; k++) /* also badly scaled columns */
            A[k] *= trial % 2 ? 1.0 : pow(10.0, -4.0 * (k % 3));
        check_svd(A);
    }
}

static void svd_neither_overflows_nor_vanishes(void **state)
{
    (void)state;
    double A[9], B[9], U[9], V[9], s[3], U2[9], V2[9], s2[3];
    apsm_random rng = apsm_random_stream(2, APSM_STREAM_TEST, 0, 0);
    random_matrix(&rng, A);
    apsm_svd3(A, U, s, V);
    for (int k = 0; k < 9; k++) B[k] = ldexp(A[k], 900);
    apsm_svd3(B, U2, s2, V2);
    assert_memory_equal(U, U2, sizeof U);
    for (int k = 0; k < 3; k++) assert_true(s2[k] == ldexp(s[k], 900));
}

static void nearest_rotation_is_proper(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, 0, 0);
    const double mirror[9] = { -1, 0, 0, 0, 1, 0, 0, 0, 1 };
    double R[9], A[9];
    apsm_nearest_rotation(mirror, R);
    assert_near(det3(R), 1.0, 1e-14);
    for (int trial = 0; trial < 100; trial++) {
        random_matrix(&rng, A);
        apsm_nearest_rotation(A, R);
        check_orthogonal(R);
        assert_near(det3(R), 1.0, 1e-13);
        apsm_nearest_rotation(R, A); /* a rotation is its own nearest */
        for (int k = 0; k < 9; k++) assert_near(A[k], R[k], 1e-14);
    }
}

static void random_similarity(apsm_random *rng, double scale, double M[16])
{
    double A[9], R[9];
    random_matrix(rng, A);
    apsm_nearest_rotation(A, R);
    apsm_affine_identity(M);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) M[4 * r + c] = scale * R[3 * r + c];
        M[4 * r + 3] = 10.0 * apsm_random_normal(rng);
    }
}

enum { POINTS = 20 };

static void random_points(apsm_random *rng, int dimension, double x[3 * POINTS])
{
    for (int i = 0; i < POINTS; i++)
        for (int c = 0; c < 3; c++) x[3 * i + c] = c < dimension ? apsm_random_normal(rng) : 0.5;
}

static double residual(const double M[16], const double *x, const double *y, const double *w)
{
    double sum = 0.0, z[3];
    for (int i = 0; i < POINTS; i++) {
        apsm_affine_apply(M, 1, x + 3 * i, z);
        for (int c = 0; c < 3; c++) {
            const double d = z[c] - y[3 * i + c];
            sum += (w ? w[i] : 1.0) * d * d;
        }
    }
    return sum;
}

/* Planted maps come back, for points in space, in a plane and on a line. */
static void fit_recovers_a_planted_map(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(4, APSM_STREAM_TEST, 0, 0);
    double x[3 * POINTS], y[3 * POINTS], M[16], fit[16];
    for (int scale = 0; scale < 2; scale++)
        for (int dimension = 1; dimension <= 3; dimension++) {
            random_points(&rng, dimension, x);
            random_similarity(&rng, scale ? 1.7 : 1.0, M);
            apsm_affine_apply(M, POINTS, x, y);
            apsm_affine_fit(POINTS, x, y, NULL, scale, fit);
            assert_near(residual(fit, x, y, NULL), 0.0, 1e-25);
            if (dimension > 1)
                for (int k = 0; k < 16; k++) assert_near(fit[k], M[k], 1e-13);
            assert_near(apsm_affine_det(fit), scale ? 1.7 * 1.7 * 1.7 : 1.0, 1e-12);
        }
}

/* A mirrored set must not be met by a mirror; the fit still beats its neighbours. */
static void fit_of_a_reflection_is_a_rotation(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, 0, 0);
    double x[3 * POINTS], y[3 * POINTS], w[POINTS], fit[16];
    random_points(&rng, 3, x);
    for (int i = 0; i < 3 * POINTS; i++) y[i] = i % 3 ? x[i] : -x[i];
    for (int i = 0; i < POINTS; i++) w[i] = apsm_random_uniform(&rng);
    for (int scale = 0; scale < 2; scale++) {
        apsm_affine_fit(POINTS, x, y, w, scale, fit);
        assert_true(apsm_affine_det(fit) > 0.0);
        const double best = residual(fit, x, y, w);
        for (int trial = 0; trial < 200; trial++) {
            double turn[16], other[16], A[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, R[9];
            for (int k = 0; k < 9; k++) A[k] += 0.01 * apsm_random_normal(&rng);
            apsm_nearest_rotation(A, R);
            apsm_affine_identity(turn);
            for (int r = 0; r < 3; r++) {
                for (int c = 0; c < 3; c++)
                    turn[4 * r + c] = R[3 * r + c] * (scale ? 1.0 + 0.001 * (trial % 3 - 1) : 1.0);
                turn[4 * r + 3] = 0.001 * apsm_random_normal(&rng);
            }
            apsm_affine_multiply(turn, fit, other);
            assert_true(residual(other, x, y, w) >= best * (1.0 - 1e-12));
        }
    }
}

static void weight_zero_leaves_a_point_out(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(6, APSM_STREAM_TEST, 0, 0);
    double x[3 * POINTS], y[3 * POINTS], w[POINTS], M[16], fit[16];
    random_points(&rng, 3, x);
    random_similarity(&rng, 1.0, M);
    apsm_affine_apply(M, POINTS, x, y);
    for (int i = 0; i < POINTS; i++) w[i] = i < 5 ? 0.0 : 2.0;
    for (int i = 0; i < 15; i++) y[i] += 100.0;
    apsm_affine_fit(POINTS, x, y, w, 0, fit);
    for (int k = 0; k < 16; k++) assert_near(fit[k], M[k], 1e-12);
}

static void all_points_in_one_give_a_shift(void **state)
{
    (void)state;
    const double x[9] = { 1, 2, 3, 1, 2, 3, 1, 2, 3 }, y[9] = { 4, 4, 4, 4, 4, 4, 4, 4, 4 };
    double M[16], z[3];
    apsm_affine_fit(3, x, y, NULL, 1, M);
    assert_near(apsm_affine_det(M), 1.0, 1e-14);
    apsm_affine_apply(M, 1, x, z);
    for (int k = 0; k < 3; k++) assert_near(z[k], 4.0, 1e-14);
}

static void inverse_and_product(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_TEST, 0, 0);
    double M[16], inverse[16], I[16];
    apsm_affine_identity(M);
    for (int k = 0; k < 12; k++) M[k] += 0.5 * apsm_random_normal(&rng);
    assert_ok(apsm_affine_invert(M, inverse));
    apsm_affine_multiply(M, inverse, inverse); /* may alias */
    apsm_affine_identity(I);
    for (int k = 0; k < 16; k++) assert_near(inverse[k], I[k], 1e-14);

    for (int k = 0; k < 16; k++) I[k] = k < 12 ? 1e-60 * M[k] : M[k]; /* small is not singular */
    assert_ok(apsm_affine_invert(I, inverse));
    memcpy(M + 8, M + 4, 4 * sizeof *M); /* two equal rows are */
    assert_int_equal(apsm_affine_invert(M, inverse), APSM_ERR_SINGULAR);
}

static void directions_stay_unit_and_do_not_shift(void **state)
{
    (void)state;
    double M[16], n[3] = { 0, 0, 1 };
    apsm_affine_identity(M);
    M[10] = 5.0;
    M[3] = M[7] = M[11] = 100.0;
    apsm_affine_apply_normals(M, 1, n, n);
    assert_true(n[0] == 0.0 && n[1] == 0.0 && n[2] == 1.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(svd_of_any_matrix),
        cmocka_unit_test(svd_neither_overflows_nor_vanishes),
        cmocka_unit_test(nearest_rotation_is_proper),
        cmocka_unit_test(fit_recovers_a_planted_map),
        cmocka_unit_test(fit_of_a_reflection_is_a_rotation),
        cmocka_unit_test(weight_zero_leaves_a_point_out),
        cmocka_unit_test(all_points_in_one_give_a_shift),
        cmocka_unit_test(inverse_and_product),
        cmocka_unit_test(directions_stay_unit_and_do_not_shift),
    };
    return cmocka_run_group_tests_name("affine", tests, NULL, NULL);
}
