/* linalg.h -- the library's only door to BLAS and LAPACK.  Row-major, symmetric matrices by
 * their lower triangle unless said otherwise.  BLAS runs single-threaded inside, whatever the
 * program around has chosen (which it finds again): threads go over shapes, and results cannot
 * depend on their number. */
#ifndef APSM_LINALG_H
#define APSM_LINALG_H

#include <stddef.h>

#include "apsm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A (n x n, in: symmetric, lower triangle used; out: L with A = L L^T, upper triangle
 * untouched).  APSM_ERR_SINGULAR if A is not positive definite. */
apsm_status apsm_cholesky(size_t n, double *A) APSM_NODISCARD;
apsm_status apsm_cholesky_f32(size_t n, float *A) APSM_NODISCARD;
/* B (n x m) <- A^-1 B by the factor L. */
void apsm_cholesky_solve(size_t n, const double *L, size_t m, double *B);
void apsm_cholesky_solve_f32(size_t n, const float *L, size_t m, float *B);
/* The same of a band: A (n x (band + 1)), row k: A_kk, A_k+1,k, ... A_k+band,k (in), the same of L
 * (out); entries beyond the n-th row are not read.  x (n) <- A^-1 x. */
apsm_status apsm_band_cholesky_f32(size_t n, size_t band, float *A) APSM_NODISCARD;
void apsm_band_solve_f32(size_t n, size_t band, const float *L, float *x);
double apsm_cholesky_logdet(size_t n, const double *L); /* log det A */

/* Eigenvalues w (n, descending) and eigenvectors as the rows of Q (n x n) of symmetric A
 * (destroyed). */
apsm_status apsm_symmetric_eigen(size_t n, double *A, double *w, double *Q) APSM_NODISCARD;

/* C (m x n) <- alpha op(A) op(B) + beta C; transA/transB 0 or 1; k is the inner size.
 * Leading dimensions are the row lengths of the stored matrices. */
void apsm_gemm(int transA, int transB, size_t m, size_t n, size_t k, double alpha, const double *A,
               size_t lda, const double *B, size_t ldb, double beta, double *C, size_t ldc);
/* G (m x m, full symmetric, out) <- alpha Y Y^T for Y (m x n). */
void apsm_gram(size_t m, size_t n, double alpha, const double *Y, double *G);
/* C (n x n, lower triangle) <- A^T A + beta C for A (k x n). */
void apsm_syrk(size_t n, size_t k, const double *A, double beta, double *C);
void apsm_syrk_f32(size_t n, size_t k, const float *A, float beta, float *C);
/* y (n) <- A x for symmetric A (n x n, lower triangle). */
void apsm_symv_f32(size_t n, const float *A, const float *x, float *y);
/* y (m) <- A x for A (m x n). */
void apsm_gemv(size_t m, size_t n, const double *A, const double *x, double *y);

#ifdef __cplusplus
}
#endif
#endif
