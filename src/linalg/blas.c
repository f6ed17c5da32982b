/* The calls of BLAS and LAPACK.  A row-major lower triangle is LAPACK's column-major upper one,
 * so nothing is ever transposed or copied. */
#include "linalg/linalg.h"

#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>

/* OpenBLAS has one number of threads for the whole process.  While any call of ours is under way
 * it is 1, then again what the program around us had chosen: so this, too, is the process's. */
static struct {
    pthread_mutex_t lock;
    atomic_int inside; /* calls under way, in all threads */
    int threads;       /* what there was before them */
} blas = { .lock = PTHREAD_MUTEX_INITIALIZER };

static void borrow_blas(void)
{
    int inside = atomic_load(&blas.inside);
    while (inside > 0)
        if (atomic_compare_exchange_weak(&blas.inside, &inside, inside + 1)) return;
    pthread_mutex_lock(&blas.lock);
    if (atomic_load(&blas.inside) == 0) {
        blas.threads = openblas_get_num_threads();
        if (blas.threads != 1) openblas_set_num_threads(1);
    }
    atomic_fetch_add(&blas.inside, 1);
    pthread_mutex_unlock(&blas.lock);
}

static void return_blas(void)
{
    int inside = atomic_load(&blas.inside);
    while (inside > 1)
        if (atomic_compare_exchange_weak(&blas.inside, &inside, inside - 1)) return;
    pthread_mutex_lock(&blas.lock);
    if (atomic_fetch_sub(&blas.inside, 1) == 1 && blas.threads != 1)
        openblas_set_num_threads(blas.threads);
    pthread_mutex_unlock(&blas.lock);
}

apsm_status apsm_cholesky(size_t n, double *A)
{
    const lapack_int m = (lapack_int)n;
    if (n == 0) return APSM_OK;
    borrow_blas();
    const lapack_int info = LAPACKE_dpotrf_work(LAPACK_COL_MAJOR, 'U', m, A, m);
    return_blas();
    return info == 0 && isfinite(A[n * n - 1]) ? APSM_OK : APSM_ERR_SINGULAR;
}

apsm_status apsm_cholesky_f32(size_t n, float *A)
{
    const lapack_int m = (lapack_int)n;
    if (n == 0) return APSM_OK;
    borrow_blas();
    const lapack_int info = LAPACKE_spotrf_work(LAPACK_COL_MAJOR, 'U', m, A, m);
    return_blas();
    return info == 0 && isfinite(A[n * n - 1]) ? APSM_OK : APSM_ERR_SINGULAR;
}

void apsm_cholesky_solve(size_t n, const double *L, size_t m, double *B)
{
    const int N = (int)n, M = (int)m;
    if (n == 0 || m == 0) return;
    borrow_blas();
    if (m == 1) {
        cblas_dtrsv(CblasRowMajor, CblasLower, CblasNoTrans, CblasNonUnit, N, L, N, B, 1);
        cblas_dtrsv(CblasRowMajor, CblasLower, CblasTrans, CblasNonUnit, N, L, N, B, 1);
    } else {
        cblas_dtrsm(CblasRowMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, N, M, 1.0, L,
                    N, B, M);
        cblas_dtrsm(CblasRowMajor, CblasLeft, CblasLower, CblasTrans, CblasNonUnit, N, M, 1.0, L, N,
                    B, M);
    }
    return_blas();
}

void apsm_cholesky_solve_f32(size_t n, const float *L, size_t m, float *B)
{
    const int N = (int)n, M = (int)m;
    if (n == 0 || m == 0) return;
    borrow_blas();
    if (m == 1) {
        cblas_strsv(CblasRowMajor, CblasLower, CblasNoTrans, CblasNonUnit, N, L, N, B, 1);
        cblas_strsv(CblasRowMajor, CblasLower, CblasTrans, CblasNonUnit, N, L, N, B, 1);
    } else {
        cblas_strsm(CblasRowMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, N, M, 1.0f, L,
                    N, B, M);
        cblas_strsm(CblasRowMajor, CblasLeft, CblasLower, CblasTrans, CblasNonUnit, N, M, 1.0f, L,
                    N, B, M);
    }
    return_blas();
}

apsm_status apsm_band_cholesky_f32(size_t n, size_t band, float *A)
{
    const lapack_int m = (lapack_int)n, k = (lapack_int)band;
    if (n == 0) return APSM_OK;
    borrow_blas();
    const lapack_int info = LAPACKE_spbtrf_work(LAPACK_COL_MAJOR, 'L', m, k, A, k + 1);
    return_blas();
    return info == 0 && isfinite(A[(n - 1) * (band + 1)]) ? APSM_OK : APSM_ERR_SINGULAR;
}

void apsm_band_solve_f32(size_t n, size_t band, const float *L, float *x)
{
    const int N = (int)n, K = (int)band;
    if (n == 0) return;
    borrow_blas();
    cblas_stbsv(CblasColMajor, CblasLower, CblasNoTrans, CblasNonUnit, N, K, L, K + 1, x, 1);
    cblas_stbsv(CblasColMajor, CblasLower, CblasTrans, CblasNonUnit, N, K, L, K + 1, x, 1);
    return_blas();
}

double apsm_cholesky_logdet(size_t n, const double *L)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++) sum += log(L[i * n + i]);
    return 2.0 * sum;
}

/* LAPACK gives ascending eigenvalues and, seen row-major, eigenvectors as rows. */
apsm_status apsm_symmetric_eigen(size_t n, double *A, double *w, double *Q)
{
    const lapack_int m = (lapack_int)n;
    if (n == 0) return APSM_OK;
    borrow_blas();
    const lapack_int info = LAPACKE_dsyevd(LAPACK_COL_MAJOR, 'V', 'U', m, A, m, w);
    return_blas();
    if (info == LAPACK_WORK_MEMORY_ERROR) return APSM_ERR_MEMORY;
    if (info != 0) return APSM_ERR_NONFINITE;
    for (size_t i = 0; i < n / 2; i++) {
        const double t = w[i];
        w[i] = w[n - 1 - i];
        w[n - 1 - i] = t;
    }
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < n; k++) Q[i * n + k] = A[(n - 1 - i) * n + k];
    return APSM_OK;
}

void apsm_gemm(int transA, int transB, size_t m, size_t n, size_t k, double alpha, const double *A,
               size_t lda, const double *B, size_t ldb, double beta, double *C, size_t ldc)
{
    if (m == 0 || n == 0) return;
    borrow_blas();
    cblas_dgemm(CblasRowMajor, transA ? CblasTrans : CblasNoTrans,
                transB ? CblasTrans : CblasNoTrans, (int)m, (int)n, (int)k, alpha, A, (int)lda, B,
                (int)ldb, beta, C, (int)ldc);
    return_blas();
}

void apsm_gram(size_t m, size_t n, double alpha, const double *Y, double *G)
{
    if (m == 0) return;
    borrow_blas();
    cblas_dsyrk(CblasRowMajor, CblasLower, CblasNoTrans, (int)m, (int)n, alpha, Y, (int)n, 0.0, G,
                (int)m);
    return_blas();
    for (size_t i = 0; i < m; i++)
        for (size_t j = 0; j < i; j++) G[j * m + i] = G[i * m + j];
}

void apsm_syrk(size_t n, size_t k, const double *A, double beta, double *C)
{
    if (n == 0) return;
    borrow_blas();
    cblas_dsyrk(CblasRowMajor, CblasLower, CblasTrans, (int)n, (int)k, 1.0, A, (int)n, beta, C,
                (int)n);
    return_blas();
}

void apsm_syrk_f32(size_t n, size_t k, const float *A, float beta, float *C)
{
    if (n == 0) return;
    borrow_blas();
    cblas_ssyrk(CblasRowMajor, CblasLower, CblasTrans, (int)n, (int)k, 1.0f, A, (int)n, beta, C,
                (int)n);
    return_blas();
}

void apsm_symv_f32(size_t n, const float *A, const float *x, float *y)
{
    if (n == 0) return;
    borrow_blas();
    cblas_ssymv(CblasRowMajor, CblasLower, (int)n, 1.0f, A, (int)n, x, 1, 0.0f, y, 1);
    return_blas();
}

void apsm_gemv(size_t m, size_t n, const double *A, const double *x, double *y)
{
    if (m == 0) return;
    borrow_blas();
    cblas_dgemv(CblasRowMajor, CblasNoTrans, (int)m, (int)n, 1.0, A, (int)n, x, 1, 0.0, y, 1);
    return_blas();
}
