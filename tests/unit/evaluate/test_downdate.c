#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "core/random.h"
#include "evaluate/downdate.h"
#include "golden.h"
#include "linalg/linalg.h"

enum { R = 40 };
static const double ZERO = 1e-12;

/* The same by the dense eigenvectors Q of the matrix: row m - 1 of C, and the eigenvalues w. */
static void dense(size_t r, const double *d, const double *t, double rho, double *w, double *C)
{
    double S[R * R], Q[R * R], left[R];
    for (size_t k = 0; k < r; k++)
        for (size_t l = 0; l < r; l++) S[k * r + l] = (k == l ? d[k] : 0.0) - rho * t[k] * t[l];
    assert_int_equal(apsm_symmetric_eigen(r, S, w, Q), APSM_OK);
    memcpy(left, t, r * sizeof *t);
    for (size_t m = 0; m < r; m++) {
        double dot = 0.0;
        for (size_t k = 0; k < r; k++) dot += Q[m * r + k] * t[k];
        for (size_t k = 0; k < r; k++) left[k] -= dot * Q[m * r + k];
        memcpy(C + m * r, left, r * sizeof *left);
    }
}

/* Compares wherever the first m eigenvectors span a space of their own; returns the rows made. */
static size_t check(size_t r, const double *d, const double *t, double rho)
{
    double C[R * R], D[R * R], w[R], largest = 0.0;
    apsm_downdate *scratch;
    assert_int_equal(apsm_downdate_new(r, &scratch), APSM_OK);
    const size_t rows = apsm_downdate_residuals(scratch, d, t, rho, ZERO, r, C);
    apsm_downdate_free(scratch);
    dense(r, d, t, rho, w, D);
    for (size_t k = 0; k < r; k++) largest = fmax(largest, fabs(t[k]));
    for (size_t m = 0; m < rows; m++) {
        if (m + 1 < r && w[m] - w[m + 1] < 1e-4 * w[0]) continue;
        for (size_t k = 0; k < r; k++)
            if (!(fabs(C[m * r + k] - D[m * r + k]) <= 1e-10 * largest))
                fail_msg("r %zu, %zu modes, entry %zu: %.15g, expected %.15g", r, m + 1, k,
                         C[m * r + k], D[m * r + k]);
    }
    return rows;
}

/* t with sum t_k^2 / d_k = share / rho: the matrix is singular at share 1. */
static void make_t(size_t r, const double *d, double rho, double share, uint64_t index, double *t)
{
    apsm_random rng = apsm_random_stream(9, APSM_STREAM_TEST, index, 0);
    double sum2 = 0.0;
    for (size_t k = 0; k < r; k++) {
        t[k] = apsm_random_normal(&rng);
        sum2 += t[k] * t[k];
    }
    for (size_t k = 0; k < r; k++) t[k] *= sqrt(share * d[k] / (rho * sum2));
}

static void agrees_with_dense_eigenvectors(void **state)
{
    (void)state;
    for (size_t r = 1; r <= R; r += 3) {
        double d[R], t[R];
        for (size_t k = 0; k < r; k++) d[k] = pow((double)(k + 1), -1.0);
        make_t(r, d, 1.25, 0.7, r, t);
        assert_int_equal(check(r, d, t, 1.25), r);
        make_t(r, d, 1.25, 1.0, r, t);
        assert_int_equal(check(r, d, t, 1.25), r - 1); /* the last eigenvalue is 0 */
    }
}

static void agrees_with_equal_eigenvalues(void **state)
{
    (void)state;
    double d[9] = { 3, 2, 2, 2, 1, 1, 0.5, 0.25, 0.25 }, t[9];
    make_t(9, d, 1.1, 0.8, 1, t);
    assert_int_equal(check(9, d, t, 1.1), 9);
    d[2] -= 1e-16; /* equal to rounding */
    d[3] -= 4e-16;
    assert_int_equal(check(9, d, t, 1.1), 9);
    d[2] = 2 - 1e-9; /* close */
    d[3] = 2 - 2e-9;
    assert_int_equal(check(9, d, t, 1.1), 9);
}

static void agrees_when_scores_vanish(void **state)
{
    (void)state;
    double d[7] = { 7, 6, 5, 4, 4, 2, 1 }, t[7];
    make_t(7, d, 1.1, 0.8, 2, t);
    t[0] = t[5] = 0;
    t[2] = 1e-20;
    t[3] = t[4] = 0;
    assert_int_equal(check(7, d, t, 1.1), 7);
    memset(t, 0, sizeof t);
    assert_int_equal(check(7, d, t, 1.1), 7);
}

/* A shape so near the mean that it does not bend the modes: they take its scores away one by
 * one. */
static void small_scores_are_taken_away_one_by_one(void **state)
{
    (void)state;
    double d[5] = { 5, 4, 3, 2, 1 }, t[5], C[25];
    apsm_downdate *w;
    make_t(5, d, 1.1, 1e-24, 3, t);
    assert_int_equal(apsm_downdate_new(5, &w), APSM_OK);
    assert_int_equal(apsm_downdate_residuals(w, d, t, 1.1, ZERO, 5, C), 5);
    for (size_t m = 0; m < 5; m++)
        for (size_t k = 0; k < 5; k++) assert_true(C[5 * m + k] == (k <= m ? 0.0 : t[k]));
    apsm_downdate_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_dense_eigenvectors),
        cmocka_unit_test(agrees_with_equal_eigenvalues),
        cmocka_unit_test(agrees_when_scores_vanish),
        cmocka_unit_test(small_scores_are_taken_away_one_by_one),
    };
    return cmocka_run_group_tests_name("downdate", tests, NULL, NULL);
}
