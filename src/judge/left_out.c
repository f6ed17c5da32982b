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

#include "geometry/vec3.h"
#include "linalg/linalg.h"

enum { MOST = APSM_LEFT_OUT_SHAPES, MONOMIALS = 20, ROWS = MOST + 3 * MONOMIALS };
/* A row that is so nearly in the span of those before it is none. */
static const double dependent = 1e-10;

size_t apsm_left_out_work_size(size_t J)
{
    return (size_t)(ROWS + 2) * 3 * J + 2 * MOST * MOST + MOST;
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

/* Exponents of x, y, z, by degree: the first `monomials` of them make up degrees 0 to d. */
static const int power[MONOMIALS][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 },
                                         { 2, 0, 0 }, { 0, 2, 0 }, { 0, 0, 2 }, { 1, 1, 0 },
                                         { 1, 0, 1 }, { 0, 1, 1 }, { 3, 0, 0 }, { 0, 3, 0 },
                                         { 0, 0, 3 }, { 2, 1, 0 }, { 2, 0, 1 }, { 1, 2, 0 },
                                         { 0, 2, 1 }, { 1, 0, 2 }, { 0, 1, 2 }, { 1, 1, 1 } };
static const size_t monomials[APSM_LEFT_OUT_DEGREES + 1] = { 1, 4, 10, MONOMIALS };

/* y (J x 3) <- 0 but for coordinate a: monomial k of the points m, about their centre, in units of
 * their size. */
static void deform(size_t J, const double *m, size_t k, size_t a, double *y)
{
    double c[3] = { 0 }, size2 = 0.0;
    for (size_t d = 0; d < 3 * J; d++) c[d % 3] += m[d] / (double)J;
    for (size_t j = 0; j < J; j++) size2 += vec3_distance2(m + 3 * j, c) / (double)J;
    const double size = sqrt(size2);
    memset(y, 0, 3 * J * sizeof *y);
    for (size_t j = 0; j < J; j++) {
        double value = 1.0;
        for (size_t d = 0; d < 3; d++)
            for (int e = 0; e < power[k][d]; e++) value *= (m[3 * j + d] - c[d]) / size;
        y[3 * j + a] = value;
    }
}

/* y <- y less its projection on the n orthonormal rows of Y.  w: scratch, n. */
static void project_out(size_t n, size_t dim, const double *Y, double *w, double *y)
{
    if (n == 0) return;
    apsm_gemv(n, dim, Y, y, w);
    apsm_gemm(0, 0, 1, dim, n, -1.0, w, n, Y, dim, 1.0, y, dim);
}

/* Makes row n of Y orthonormal to those before it, and takes it out of r; returns the number of
 * rows that there are then.  Gram-Schmidt, twice. */
static size_t take_out(size_t n, size_t dim, double *Y, double *w, double *r)
{
    double *y = Y + n * dim, before = 0.0, norm2 = 0.0, along = 0.0;
    for (size_t c = 0; c < dim; c++) before += y[c] * y[c];
    project_out(n, dim, Y, w, y);
    project_out(n, dim, Y, w, y);
    for (size_t c = 0; c < dim; c++) norm2 += y[c] * y[c];
    if (!(norm2 > dependent * before)) return n;
    for (size_t c = 0; c < dim; c++) y[c] /= sqrt(norm2);
    for (size_t c = 0; c < dim; c++) along += y[c] * r[c];
    for (size_t c = 0; c < dim; c++) r[c] -= along * y[c];
    return n + 1;
}

/* Of the others, those whose deviations are taken out. */
static size_t shapes_out(size_t I, size_t J)
{
    const size_t most = J / 2 < MOST ? J / 2 : MOST;
    return I - 1 < most ? I - 1 : most;
}

size_t apsm_left_out_degrees(size_t I, size_t J)
{
    size_t d = 0;
    while (d < APSM_LEFT_OUT_DEGREES && 2 * (shapes_out(I, J) + 3 * monomials[d + 1]) <= 3 * J) d++;
    return d;
}

void apsm_left_out_rests(size_t I, size_t J, const double *P, size_t i, double *rests, double *work)
{
    const size_t dim = 3 * J, n = shapes_out(I, J), degrees = apsm_left_out_degrees(I, J);
    double *m = work, *r = m + dim, *Y = r + dim, *w = Y + ROWS * dim;
    size_t rows = 0, k = 0;
    gather(I, dim, P, i, n, m, Y);
    for (size_t c = 0; c < dim; c++) r[c] = P[i * dim + c] - m[c];
    for (size_t a = 0; a < n; a++) {
        memmove(Y + rows * dim, Y + a * dim, dim * sizeof *Y);
        rows = take_out(rows, dim, Y, w, r);
    }
    memset(rests, 0, APSM_LEFT_OUT_DEGREES * dim * sizeof *rests);
    for (size_t d = 0; d < degrees; d++) {
        for (; k < monomials[d + 1]; k++)
            for (size_t a = 0; a < 3; a++) {
                deform(J, m, k, a, Y + rows * dim);
                rows = take_out(rows, dim, Y, w, r);
            }
        memcpy(rests + d * dim, r, dim * sizeof *r);
    }
}
