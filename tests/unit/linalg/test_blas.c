#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <cblas.h>
#include <math.h>
#include <pthread.h>

#include "check.h"
#include "linalg/linalg.h"

/* A = M M^T + n I with M random: symmetric, definite. */
static void definite_matrix(size_t n, double *A)
{
    double *M = check_alloc(n * n);
    check_uniform(1, n * n, -1.0, 1.0, M);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) {
            double sum = i == j ? (double)n : 0.0;
            for (size_t k = 0; k < n; k++) sum += M[i * n + k] * M[j * n + k];
            A[i * n + j] = sum;
        }
    free(M);
}

/* The self-check of BLAS that a bad kernel choice would fail. */
static void cholesky_reproduces_the_matrix(void **state)
{
    (void)state;
    const size_t n = 150;
    double *A = check_alloc(n * n), *L = check_alloc(n * n);
    definite_matrix(n, A);
    memcpy(L, A, n * n * sizeof *L);
    assert_int_equal(apsm_cholesky(n, L), APSM_OK);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) {
            double sum = 0.0;
            for (size_t k = 0; k <= j; k++) sum += L[i * n + k] * L[j * n + k];
            if (fabs(sum - A[i * n + j]) > 1e-13 * A[i * n + i])
                fail_msg("L L^T [%zu][%zu] = %.17g, A = %.17g", i, j, sum, A[i * n + j]);
            if (i != j && L[j * n + i] != A[j * n + i]) fail_msg("upper triangle was touched");
        }
    free(A);
    free(L);
}

static void cholesky_refuses_indefinite(void **state)
{
    (void)state;
    double A[4] = { 1.0, 0.0, 2.0, 1.0 }, nan[1] = { NAN };
    float B[4] = { 1.0f, 0.0f, 2.0f, 1.0f };
    assert_int_equal(apsm_cholesky(2, A), APSM_ERR_SINGULAR);
    assert_int_equal(apsm_cholesky_f32(2, B), APSM_ERR_SINGULAR);
    assert_int_equal(apsm_cholesky(1, nan), APSM_ERR_SINGULAR);
    assert_int_equal(apsm_cholesky(0, A), APSM_OK);
}

static void solves_for_one_and_many(void **state)
{
    (void)state;
    enum { N = 40, M = 3 };
    double A[N * N], L[N * N], X[N * M], B[N * M], b[N];
    float L32[N * N], b32[N];
    definite_matrix(N, A);
    memcpy(L, A, sizeof L);
    assert_int_equal(apsm_cholesky(N, L), APSM_OK);
    check_uniform(2, N * M, -1.0, 1.0, X);
    apsm_gemm(0, 0, N, M, N, 1.0, A, N, X, M, 0.0, B, M);
    for (size_t i = 0; i < N; i++) b32[i] = (float)(b[i] = B[i * M]);
    apsm_cholesky_solve(N, L, M, B);
    apsm_cholesky_solve(N, L, 1, b);
    for (size_t i = 0; i < N * N; i++) L32[i] = (float)A[i];
    assert_int_equal(apsm_cholesky_f32(N, L32), APSM_OK);
    apsm_cholesky_solve_f32(N, L32, 1, b32);
    for (size_t i = 0; i < N * M; i++)
        if (fabs(B[i] - X[i]) > 1e-13) fail_msg("many: %g off", B[i] - X[i]);
    for (size_t i = 0; i < N; i++)
        if (fabs(b[i] - X[i * M]) > 1e-13 || fabs((double)b32[i] - X[i * M]) > 1e-5)
            fail_msg("one: %g, single %g off", b[i] - X[i * M], (double)b32[i] - X[i * M]);
}

static void logdet_is_the_log_of_the_product(void **state)
{
    (void)state;
    double A[4] = { 4.0, 0.0, 2.0, 10.0 }; /* det = 36 */
    assert_int_equal(apsm_cholesky(2, A), APSM_OK);
    assert_true(fabs(apsm_cholesky_logdet(2, A) - log(36.0)) < 1e-14);
}

static void eigenvectors_are_rows_in_descending_order(void **state)
{
    (void)state;
    double A[9] = { 2, 1, 0, 1, 2, 0, 0, 0, 7 }, w[3], Q[9]; /* 7, 3, 1 */
    const double want[3] = { 7, 3, 1 }, r = sqrt(0.5);
    const double vectors[9] = { 0, 0, 1, r, r, 0, r, -r, 0 };
    assert_int_equal(apsm_symmetric_eigen(3, A, w, Q), APSM_OK);
    for (size_t i = 0; i < 3; i++) {
        double dot = 0.0;
        for (size_t c = 0; c < 3; c++) dot += Q[3 * i + c] * vectors[3 * i + c];
        if (fabs(w[i] - want[i]) > 1e-14 || fabs(fabs(dot) - 1.0) > 1e-14)
            fail_msg("eigenpair %zu: %.17g, %.17g", i, w[i], dot);
    }
    double bad[1] = { NAN };
    assert_int_equal(apsm_symmetric_eigen(1, bad, w, Q), APSM_ERR_NONFINITE);
}

static void products_follow_row_major_order(void **state)
{
    (void)state;
    const double A[6] = { 1, 2, 3, 4, 5, 6 }, B[6] = { 1, 0, 2, 1, 0, 3 }, x[3] = { 1, 1, 2 };
    double C[4] = { 1, 1, 1, 1 }, D[9], G[4], y[2];
    apsm_gemm(0, 0, 2, 2, 3, 2.0, A, 3, B, 2, 1.0, C, 2); /* A 2x3, B 3x2 */
    const double want_C[4] = { 11, 23, 29, 47 };
    apsm_gemm(1, 1, 3, 3, 2, 1.0, A, 3, B, 2, 0.0, D, 3); /* A^T B^T */
    const double want_D[9] = { 1, 6, 12, 2, 9, 15, 3, 12, 18 };
    apsm_gram(2, 3, 0.5, A, G);
    const double want_G[4] = { 7, 16, 16, 38.5 };
    apsm_gemv(2, 3, A, x, y);
    assert_memory_equal(C, want_C, sizeof C);
    assert_memory_equal(D, want_D, sizeof D);
    assert_memory_equal(G, want_G, sizeof G);
    assert_true(y[0] == 9 && y[1] == 21);
}

/* The library's calls of these come here first. */
static int threads_inside;
void cblas_ssymv(CBLAS_ORDER order, CBLAS_UPLO uplo, blasint n, float alpha, const float *a,
                 blasint lda, const float *x, blasint incx, float beta, float *y, blasint incy)
{
    (void)order, (void)uplo, (void)n, (void)alpha, (void)a, (void)lda, (void)x, (void)incx;
    (void)beta, (void)y, (void)incy;
    threads_inside += openblas_get_num_threads();
}

static void a_call_runs_alone_and_gives_the_threads_back(void **state)
{
    (void)state;
    const float A[1] = { 2 }, x[1] = { 3 };
    float y[1];
    openblas_set_num_threads(3);
    threads_inside = 0;
    apsm_symv_f32(1, A, x, y);
    assert_int_equal(threads_inside, 1);
    assert_int_equal(openblas_get_num_threads(), 3);
}

static void *many_calls(void *user)
{
    double A[64 * 64], *wrong = user;
    for (int round = 0; round < 500; round++) {
        for (size_t k = 0; k < 64 * 64; k++) A[k] = k % 65 == 0 ? 4 : 0;
        if (apsm_cholesky(64, A) != APSM_OK || A[0] != 2) *wrong += 1;
    }
    return NULL;
}

static void threads_of_the_program_get_theirs_back(void **state)
{
    (void)state;
    enum { N = 4 };
    pthread_t thread[N];
    double wrong[N] = { 0 };
    openblas_set_num_threads(3);
    for (int k = 0; k < N; k++)
        assert_int_equal(pthread_create(&thread[k], NULL, many_calls, &wrong[k]), 0);
    for (int k = 0; k < N; k++) pthread_join(thread[k], NULL);
    for (int k = 0; k < N; k++) assert_true(wrong[k] == 0);
    assert_int_equal(openblas_get_num_threads(), 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cholesky_reproduces_the_matrix),
        cmocka_unit_test(cholesky_refuses_indefinite),
        cmocka_unit_test(solves_for_one_and_many),
        cmocka_unit_test(logdet_is_the_log_of_the_product),
        cmocka_unit_test(eigenvectors_are_rows_in_descending_order),
        cmocka_unit_test(products_follow_row_major_order),
        cmocka_unit_test(a_call_runs_alone_and_gives_the_threads_back),
        cmocka_unit_test(threads_of_the_program_get_theirs_back),
    };
    return cmocka_run_group_tests_name("linalg", tests, NULL, NULL);
}
