/* Left-out prediction.  Of the shapes other than i with particles Y (deviations from their mean m),
 * Y Y^T = Q diag(s^2) Q^T, modes v_k = Q_k Y / s_k; then
 *
 *   r_i = (p_i - m) - sum_{k < M} v_k v_k . (p_i - m)                                (J3)
 *
 * A slip of one shape is not in the modes of the others, whatever moved the particles; the usual
 * variation is. */
#include "judge/left_out.h"

#include <math.h>
#include <string.h>

#include "linalg/linalg.h"

enum { MOST = APSM_LEFT_OUT_SHAPES };

size_t apsm_left_out_work_size(size_t J)
{
    return (size_t)(MOST + 2) * 3 * J + 2 * MOST * MOST + MOST;
}

/* The k-th of n other shapes than i, evenly among the I - 1. */
static size_t other(size_t I, size_t n, size_t i, size_t k)
{
    const size_t o = k * (I - 1) / n;
    return o < i ? o : o + 1;
}

/* m (dim) <- mean of the others, Y (n x dim) <- their deviations. */
static void gather(size_t I, size_t dim, const double *P, size_t i, size_t n, double *m, double *Y)
{
    memset(m, 0, dim * sizeof *m);
    for (size_t k = 0; k < n; k++) {
        const double *p = P + other(I, n, i, k) * dim;
        for (size_t c = 0; c < dim; c++) m[c] += p[c] / (double)n;
    }
    for (size_t k = 0; k < n; k++) {
        const double *p = P + other(I, n, i, k) * dim;
        for (size_t c = 0; c < dim; c++) Y[k * dim + c] = p[c] - m[c];
    }
}

/* r <- r - v v.r / |v|^2, v = q Y. */
static void remove_mode(size_t n, size_t dim, const double *q, const double *Y, double *v,
                        double *r)
{
    double along = 0.0, norm2 = 0.0;
    apsm_gemm(0, 0, 1, dim, n, 1.0, q, n, Y, dim, 0.0, v, dim);
    for (size_t c = 0; c < dim; c++) {
        along += v[c] * r[c];
        norm2 += v[c] * v[c];
    }
    for (size_t c = 0; c < dim && norm2 > 0.0; c++) r[c] -= along / norm2 * v[c];
}

apsm_status apsm_left_out_residual(size_t I, size_t J, const double *P, size_t i, double *r,
                                   double *work)
{
    const size_t dim = 3 * J, n = I - 1 < MOST ? I - 1 : MOST;
    const size_t most = I / 2 < APSM_LEFT_OUT_MODES ? I / 2 : APSM_LEFT_OUT_MODES;
    double *m = work, *v = m + dim, *Y = v + dim, *G = Y + n * dim, *Q = G + n * n, *w = Q + n * n;
    gather(I, dim, P, i, n, m, Y);
    for (size_t c = 0; c < dim; c++) r[c] = P[i * dim + c] - m[c];
    apsm_gram(n, dim, 1.0, Y, G);
    APSM_TRY(apsm_symmetric_eigen(n, G, w, Q));
    for (size_t k = 0; k < most && k + 1 < n && w[k] > 1e-12 * w[0]; k++)
        remove_mode(n, dim, Q + k * n, Y, v, r);
    return APSM_OK;
}
