#include "model/subspaces.h"

#include <math.h>
#include <string.h>

#include "linalg/linalg.h"

size_t apsm_subspaces_work_size(size_t a, size_t b, size_t D)
{
    const size_t least = a < b ? a : b;
    return (a + b) * D + a * a + b * b + a * b + 2 * least * least + least;
}

/* Q (n x D, out): orthonormal rows that span those of A, twice by Cholesky of the Gram matrix, so
 * that they are orthogonal to rounding.  G (n x n) is scratch. */
static apsm_status orthonormalise(size_t n, size_t D, const double *A, double *Q, double *G)
{
    memcpy(Q, A, n * D * sizeof *Q);
    for (size_t k = 0; k < n; k++) {
        double norm = 0;
        for (size_t c = 0; c < D; c++) norm += Q[k * D + c] * Q[k * D + c];
        if (!(norm > 0) || !isfinite(norm)) return APSM_ERR_SINGULAR;
        for (size_t c = 0; c < D; c++) Q[k * D + c] /= sqrt(norm);
    }
    for (int round = 0; round < 2; round++) {
        apsm_gram(n, D, 1, Q, G);
        APSM_TRY(apsm_cholesky(n, G));
        for (size_t k = 0; k < n; k++) { /* L Q' = Q by rows */
            double *q = Q + k * D;
            for (size_t l = 0; l < k; l++)
                for (size_t c = 0; c < D; c++) q[c] -= G[k * n + l] * Q[l * D + c];
            for (size_t c = 0; c < D; c++) q[c] /= G[k * n + k];
        }
    }
    return APSM_OK;
}

apsm_status apsm_subspace_cosines(size_t a, size_t b, size_t D, const double *A, const double *B,
                                  double *cosine, double *work)
{
    const size_t least = a < b ? a : b;
    double *QA = work, *QB = QA + a * D, *GA = QB + b * D, *GB = GA + a * a, *C = GB + b * b;
    double *S = C + a * b, *vectors = S + least * least;
    APSM_TRY(orthonormalise(a, D, A, QA, GA));
    APSM_TRY(orthonormalise(b, D, B, QB, GB));
    apsm_gemm(0, 1, a, b, D, 1, QA, D, QB, D, 0, C, b);
    if (a <= b)
        apsm_gemm(0, 1, a, a, b, 1, C, b, C, b, 0, S, a);
    else
        apsm_gemm(1, 0, b, b, a, 1, C, b, C, b, 0, S, b);
    APSM_TRY(apsm_symmetric_eigen(least, S, cosine, vectors));
    for (size_t k = 0; k < least; k++) cosine[k] = sqrt(fmin(fmax(cosine[k], 0), 1));
    return APSM_OK;
}

apsm_status apsm_subspace_shares(size_t a, size_t b, size_t D, const double *A, const double *B,
                                 double *share, double *work)
{
    double *QB = work, *GB = QB + b * D, *C = GB + b * b;
    APSM_TRY(orthonormalise(b, D, B, QB, GB));
    apsm_gemm(0, 1, a, b, D, 1, A, D, QB, D, 0, C, b);
    for (size_t k = 0; k < a; k++) {
        double all = 0, in = 0;
        for (size_t c = 0; c < D; c++) all += A[k * D + c] * A[k * D + c];
        for (size_t l = 0; l < b; l++) in += C[k * b + l] * C[k * b + l];
        share[k] = all > 0 ? fmin(in / all, 1) : 0;
    }
    return APSM_OK;
}
