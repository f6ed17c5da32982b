/* Polyharmonic interpolation; (1), (2) of docs/method.md.
 *
 *   X    n x 3 centres, here scaled to the unit box   A_kl = phi(|x_k - x_l|)
 *   Q    n x 4, rows [1 x y z]                        Q = H [R; 0], H = I - V T V^T orthogonal
 *   A'   H^T A H, of which the first 4 rows and columns belong to the range of Q, the others to
 *        the null space of Q^T, where s A' is positive definite, s = -1 for r, +1 for r^3
 *        (Micchelli 1986: phi is conditionally definite of order 1 and 2)
 *
 * With w = H [w1; u] the system [A Q; Q^T 0][w; c] = [v; d] falls apart into
 *   w1 = R^-T d
 *   u  = A'22^-1 ((H^T v)_2 - A'21 w1)          by Cholesky of s A'22
 *   c  = R^-1 ((H^T v)_1 - A'11 w1 - A'12 u)
 * Half the work of LU, and no pivoting.  A' = A - V W^T - W V^T with W = Z - V S/2, Z = A V T,
 * S = T^T V^T Z.  A is swept twice, for A V and for A', and each time made anew row by row: square
 * roots cost less than memory. */
#include "linalg/polyharmonic.h"

#include <math.h>
#include <string.h>

#include "core/kernel.h"
#include "linalg/linalg.h"

enum { LANES = 16, WIDTH = 4 };

static double sign_of(apsm_phi phi)
{
    return phi == APSM_PHI_R ? -1.0 : 1.0;
}

/* ---- sizes ---- */

static size_t padded(size_t n)
{
    return (n + WIDTH - 1) / WIDTH * WIDTH;
}

size_t apsm_polyharmonic_store_size(size_t n, bool single)
{
    const size_t m = n - 4;
    return 4 * n + 4 * m + (single ? (m * m + 1) / 2 : m * m); /* V, C, L */
}

size_t apsm_polyharmonic_factor_work_size(size_t n)
{
    return 7 * n + 8 * padded(n) +
           6 * padded(n); /* x, W, W^T, V^T; a row, or x, W^T, V^T in floats */
}

size_t apsm_polyharmonic_solve_work_size(size_t n, size_t m)
{
    return 2 * n * m + 16 * m + n * m / 2 + 1; /* right-hand sides of map, Y, four 4 x m, float Y */
}

size_t apsm_polyharmonic_resolve_work_size(size_t n)
{
    /* A, x, Q; V; v, u, r, z, p, A p and one more; scratch of the preconditioner */
    return n * n + 7 * n + 4 * n + 7 * n + apsm_polyharmonic_solve_work_size(n, 1);
}

/* ---- the unit box ---- */

/* scale is a power of two: the box's longest side becomes 0.5..1 and no digit is lost. */
static apsm_status unit_box(size_t n, const double *X, double centre[3], double *scale)
{
    double extent = 0.0;
    for (size_t c = 0; c < 3; c++) {
        double lo = X[c], hi = X[c];
        for (size_t k = 0; k < n; k++) {
            if (!isfinite(X[3 * k + c])) return APSM_ERR_NONFINITE;
            lo = fmin(lo, X[3 * k + c]);
            hi = fmax(hi, X[3 * k + c]);
        }
        centre[c] = lo + 0.5 * (hi - lo);
        extent = fmax(extent, hi - lo);
    }
    if (!(extent > 0.0)) return APSM_ERR_SINGULAR;
    int e;
    frexp(extent, &e);
    *scale = ldexp(1.0, -e);
    return APSM_OK;
}

/* x (3 x n) <- (X - centre) * scale, by columns for the loops over centres. */
static void scale_centres(const apsm_polyharmonic *f, const double *X, double *x)
{
    for (size_t c = 0; c < 3; c++)
        for (size_t k = 0; k < f->n; k++)
            x[c * f->n + k] = (X[3 * k + c] - f->centre[c]) * f->scale;
}

/* scale^p for phi = r^p: what weights are multiplied by to fit the input's units. */
static double weight_unit(const apsm_polyharmonic *f)
{
    return f->phi == APSM_PHI_R ? f->scale : f->scale * f->scale * f->scale;
}

/* ---- reflections ---- */

/* Column i of V: the Householder vector that clears column i of Q below its diagonal, and the
 * columns of R and T (Schreiber & Van Loan 1989, compact WY form). */
static void reflect_column(size_t n, size_t i, double *Q, double *V, double R[16], double T[16])
{
    double norm2 = 0.0;
    for (size_t k = i; k < n; k++) norm2 += Q[4 * k + i] * Q[4 * k + i];
    const double a = Q[4 * i + i], beta = a > 0.0 ? -sqrt(norm2) : sqrt(norm2);
    const double v0 = a - beta, tau = beta == 0.0 ? 0.0 : -v0 / beta;
    for (size_t k = 0; k < n; k++)
        V[4 * k + i] = k < i ? 0.0 : k == i ? 1.0 : v0 == 0.0 ? 0.0 : Q[4 * k + i] / v0;
    for (size_t j = i; j < 4; j++) {
        double dot = 0.0;
        for (size_t k = i; k < n; k++) dot += V[4 * k + i] * Q[4 * k + j];
        for (size_t k = i; k < n; k++) Q[4 * k + j] -= tau * dot * V[4 * k + i];
    }
    for (size_t j = 0; j < 4; j++) R[4 * j + i] = j <= i ? Q[4 * j + i] : 0.0;
    double g[4] = { 0 };
    for (size_t k = i; k < n; k++)
        for (size_t j = 0; j < i; j++) g[j] += V[4 * k + j] * V[4 * k + i];
    for (size_t j = 0; j < 4; j++) {
        double sum = 0.0;
        for (size_t l = j; l < i; l++) sum += T[4 * j + l] * g[l];
        T[4 * j + i] = j < i ? -tau * sum : j == i ? tau : 0.0;
    }
}

/* V, T, R of centres x (3 x n).  Q is scratch (n x 4). */
static apsm_status reflections(apsm_polyharmonic *f, const double *x, double *Q)
{
    const size_t n = f->n;
    for (size_t k = 0; k < n; k++) {
        Q[4 * k] = 1.0;
        for (size_t c = 0; c < 3; c++) Q[4 * k + 1 + c] = x[c * n + k];
    }
    for (size_t i = 0; i < 4; i++) reflect_column(n, i, Q, f->V, f->R, f->T);
    for (size_t i = 0; i < 4; i++)
        if (!(fabs(f->R[5 * i]) > 1e-10 * sqrt((double)n))) return APSM_ERR_SINGULAR;
    return APSM_OK;
}

/* p (4 x m) <- op(T) V^T Y for Y (n x m); then Y <- Y - V p.  transposed: H^T, else H. */
static void reflect(const apsm_polyharmonic *f, bool transposed, size_t m, double *Y, double *p,
                    double *q)
{
    const size_t n = f->n;
    memset(q, 0, 4 * m * sizeof *q);
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i < 4; i++) {
            const double v = f->V[4 * k + i];
            for (size_t j = 0; j < m; j++) q[i * m + j] += v * Y[k * m + j];
        }
    memset(p, 0, 4 * m * sizeof *p);
    for (size_t i = 0; i < 4; i++)
        for (size_t l = 0; l < 4; l++) {
            const double t = transposed ? f->T[4 * l + i] : f->T[4 * i + l];
            for (size_t j = 0; j < m; j++) p[i * m + j] += t * q[l * m + j];
        }
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i < 4; i++) {
            const double v = f->V[4 * k + i];
            for (size_t j = 0; j < m; j++) Y[k * m + j] -= v * p[i * m + j];
        }
}

/* ---- the matrix ---- */

/* The first m entries of row i of A. */
KERNEL_INLINE void kernel_row(apsm_phi phi, size_t n, const double *restrict x, size_t i, size_t m,
                              double *restrict row)
{
    const double *X = x, *Y = x + n, *Z = x + 2 * n, xi = X[i], yi = Y[i], zi = Z[i];
    if (phi == APSM_PHI_R) {
#pragma omp simd
        for (size_t j = 0; j < m; j++) {
            const double dx = X[j] - xi, dy = Y[j] - yi, dz = Z[j] - zi;
            row[j] = sqrt(dx * dx + dy * dy + dz * dz);
        }
        return;
    }
#pragma omp simd
    for (size_t j = 0; j < m; j++) {
        const double dx = X[j] - xi, dy = Y[j] - yi, dz = Z[j] - zi;
        const double d2 = dx * dx + dy * dy + dz * dz;
        row[j] = d2 * sqrt(d2);
    }
}

/* What row i of A's lower triangle, followed by zeros, adds to A V (4 x np, Z): its products with
 * V's columns (4 x np) to place i, and V's row i times it to the others.  Returns its least entry
 * off the diagonal. */
KERNEL_INLINE double multiply_row(size_t np, size_t i, const double *restrict row,
                                  const double *restrict V, double *restrict Z)
{
    const double *V1 = V + np, *V2 = V + 2 * np, *V3 = V + 3 * np;
    double *Z1 = Z + np, *Z2 = Z + 2 * np, *Z3 = Z + 3 * np;
    const double v0 = V[i], v1 = V1[i], v2 = V2[i], v3 = V3[i];
    double s0[WIDTH] = { 0 }, s1[WIDTH] = { 0 }, s2[WIDTH] = { 0 }, s3[WIDTH] = { 0 };
    double least[WIDTH] = { INFINITY, INFINITY, INFINITY, INFINITY };
    for (size_t k = 0; k < i; k += WIDTH) {
#pragma omp simd
        for (size_t l = 0; l < WIDTH; l++) {
            const size_t j = k + l;
            const double a = row[j], off = j < i ? a : INFINITY;
            least[l] = off < least[l] ? off : least[l];
            s0[l] += a * V[j];
            s1[l] += a * V1[j];
            s2[l] += a * V2[j];
            s3[l] += a * V3[j];
            Z[j] += a * v0;
            Z1[j] += a * v1;
            Z2[j] += a * v2;
            Z3[j] += a * v3;
        }
    }
    Z[i] += (s0[0] + s0[2]) + (s0[1] + s0[3]);
    Z1[i] += (s1[0] + s1[2]) + (s1[1] + s1[3]);
    Z2[i] += (s2[0] + s2[2]) + (s2[1] + s2[3]);
    Z3[i] += (s3[0] + s3[2]) + (s3[1] + s3[3]);
    return fmin(fmin(least[0], least[2]), fmin(least[1], least[3]));
}

/* Z = A V (both 4 x np) for centres x (3 x n); returns A's least entry off the diagonal. */
APSM_KERNEL static double multiply_matrix(apsm_phi phi, size_t n, const double *x, const double *V,
                                          double *Z, double *row)
{
    const size_t np = padded(n);
    double least = INFINITY;
    memset(Z, 0, 4 * np * sizeof *Z);
    for (size_t i = 0; i < n; i++) {
        kernel_row(phi, n, x, i, i + 1, row);
        for (size_t j = i + 1; j % WIDTH > 0; j++) row[j] = 0.0;
        least = fmin(least, multiply_row(np, i, row, V, Z));
    }
    return least;
}

/* Whether two centres are so close that the matrix is singular in the factor's precision: its
 * least eigenvalue goes like their distance, or its cube.  Cholesky itself would not always
 * notice, for rounding may leave a pivot positive. */
static bool centres_coincide(const apsm_polyharmonic *f, double least)
{
    if (f->phi == APSM_PHI_R3) return !(least > 1e-15); /* 1e-5 of the box, cubed */
    return !(least > (f->L32 ? 1e-6 : 1e-12));
}

/* M (4 x np, zeros behind each row) = the transpose of X (n x 4), and back. */
static void to_rows(size_t n, const double *X, double *M)
{
    const size_t np = padded(n);
    for (size_t i = 0; i < 4; i++)
        for (size_t k = 0; k < np; k++) M[i * np + k] = k < n ? X[4 * k + i] : 0.0;
}

static void to_columns(size_t n, const double *M, double *X)
{
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i < 4; i++) X[4 * k + i] = M[i * padded(n) + k];
}

/* W (n x 4) from A V in W; Z (n x 4) is scratch. */
static void update_vectors(const apsm_polyharmonic *f, double *W, double *Z)
{
    const size_t n = f->n;
    double VZ[16], S[16];
    apsm_gemm(0, 0, n, 4, 4, 1.0, W, 4, f->T, 4, 0.0, Z, 4);
    apsm_gemm(1, 0, 4, 4, n, 1.0, f->V, 4, Z, 4, 0.0, VZ, 4);
    apsm_gemm(1, 0, 4, 4, 4, 1.0, f->T, 4, VZ, 4, 0.0, S, 4);
    memcpy(W, Z, 4 * n * sizeof *W);
    apsm_gemm(0, 0, n, 4, 4, -0.5, f->V, 4, S, 4, 1.0, W, 4);
}

/* Row i of A to row i of A', up to the diagonal; V and W are 4 x np. */
KERNEL_INLINE void project_row(size_t np, size_t i, const double *restrict W,
                               const double *restrict V, double *restrict row)
{
    const double *W1 = W + np, *W2 = W + 2 * np, *W3 = W + 3 * np;
    const double *V1 = V + np, *V2 = V + 2 * np, *V3 = V + 3 * np;
    const double w0 = W[i], w1 = W1[i], w2 = W2[i], w3 = W3[i];
    const double v0 = V[i], v1 = V1[i], v2 = V2[i], v3 = V3[i];
#pragma omp simd
    for (size_t j = 0; j <= i; j++)
        row[j] -= (v0 * W[j] + v1 * W1[j] + v2 * W2[j] + v3 * W3[j]) +
                  (w0 * V[j] + w1 * V1[j] + w2 * V2[j] + w3 * V3[j]);
}

/* A11 and C. */
static void project_heads(apsm_polyharmonic *f, const double *x, const double *W, const double *V)
{
    const size_t n = f->n, np = padded(n);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i && j < 4; j++) {
            double d2 = 0.0, shift = 0.0;
            for (size_t c = 0; c < 3; c++)
                d2 += (x[c * n + j] - x[c * n + i]) * (x[c * n + j] - x[c * n + i]);
            for (size_t c = 0; c < 4 * np; c += np)
                shift += V[c + i] * W[c + j] + W[c + i] * V[c + j];
            const double a = (f->phi == APSM_PHI_R ? sqrt(d2) : d2 * sqrt(d2)) - shift;
            if (i < 4)
                f->A11[4 * i + j] = f->A11[4 * j + i] = a;
            else
                f->C[4 * (i - 4) + j] = a;
        }
}

/* The lower triangle of s A'22, in the factor's place. */
APSM_KERNEL static void project_matrix(const apsm_polyharmonic *f, const double *x, const double *W,
                                       const double *V, double *restrict row)
{
    const size_t n = f->n;
    const double s = sign_of(f->phi);
    for (size_t i = 4; i < n; i++) {
        double *restrict to = f->L + (i - 4) * (n - 4);
        kernel_row(f->phi, n, x, i, i + 1, row);
        project_row(padded(n), i, W, V, row);
#pragma omp simd
        for (size_t j = 4; j <= i; j++) to[j - 4] = s * row[j];
    }
}

/* The same in single precision, for phi = r, with x, W and V as floats: what is lost is of the size
 * of what the factor's precision loses. */
APSM_KERNEL static void project_matrix_single(const apsm_polyharmonic *f, const float *restrict x,
                                              const float *restrict W, const float *restrict V)
{
    const size_t n = f->n, np = padded(n);
    const float *X = x, *Y = x + n, *Z = x + 2 * n;
    const float *W1 = W + np, *W2 = W + 2 * np, *W3 = W + 3 * np;
    const float *V1 = V + np, *V2 = V + 2 * np, *V3 = V + 3 * np;
    for (size_t i = 4; i < n; i++) {
        const float xi = X[i], yi = Y[i], zi = Z[i];
        const float w0 = W[i], w1 = W1[i], w2 = W2[i], w3 = W3[i];
        const float v0 = V[i], v1 = V1[i], v2 = V2[i], v3 = V3[i];
        float *restrict to = f->L32 + (i - 4) * (n - 4);
#pragma omp simd
        for (size_t j = 4; j <= i; j++) {
            const float dx = X[j] - xi, dy = Y[j] - yi, dz = Z[j] - zi;
            const float shift = (v0 * W[j] + v1 * W1[j] + v2 * W2[j] + v3 * W3[j]) +
                                (w0 * V[j] + w1 * V1[j] + w2 * V2[j] + w3 * V3[j]);
            to[j - 4] = shift - sqrtf(dx * dx + dy * dy + dz * dz);
        }
    }
}

static void to_floats(size_t n, const double *from, float *to)
{
    for (size_t i = 0; i < n; i++) to[i] = (float)from[i];
}

/* ---- the matrix itself ---- */

/* A (n x n) for centres x (3 x n), all of it: rows are contiguous, so this is as fast as half. */
APSM_KERNEL static void kernel_matrix(apsm_phi phi, size_t n, const double *x, double *A)
{
    for (size_t i = 0; i < n; i++) kernel_row(phi, n, x, i, n, A + i * n);
}

/* Reflections and A for centres X, in the box of f.  work begins with A. */
static apsm_status assemble(apsm_polyharmonic *f, const double *X, double *work)
{
    const size_t n = f->n;
    double *x = work + n * n, *Q = x + 3 * n;
    scale_centres(f, X, x);
    APSM_TRY(reflections(f, x, Q));
    kernel_matrix(f->phi, n, x, work);
    return APSM_OK;
}

/* ---- the matrix in single precision ---- */

/* A's lower triangle for phi = r. */
APSM_KERNEL static void kernel_matrix_single(size_t n, const float *restrict x, float *restrict A)
{
    const float *X = x, *Y = x + n, *Z = x + 2 * n;
    for (size_t i = 0; i < n; i++) {
        const float xi = X[i], yi = Y[i], zi = Z[i];
        float *row = A + i * n;
#pragma omp simd
        for (size_t j = 0; j <= i; j++) {
            const float dx = X[j] - xi, dy = Y[j] - yi, dz = Z[j] - zi;
            row[j] = sqrtf(dx * dx + dy * dy + dz * dz);
        }
    }
}

/* As assemble, but A's lower triangle in floats. */
static apsm_status assemble_single(apsm_polyharmonic *f, const double *X, double *work)
{
    const size_t n = f->n;
    double *x = work + n * n, *Q = x + 3 * n;
    float *x32 = (float *)Q;
    scale_centres(f, X, x);
    APSM_TRY(reflections(f, x, Q));
    to_floats(3 * n, x, x32);
    kernel_matrix_single(n, x32, (float *)work);
    return APSM_OK;
}

/* ---- factor ---- */

/* Factors s A'22 with a ridge.  work as prepare leaves it. */
static apsm_status factor_projected(apsm_polyharmonic *f, double ridge, double *work)
{
    const size_t n = f->n, m = n - 4, np = padded(n);
    double *x = work, *W = x + 7 * n, *V = W + 4 * np, *row = V + 4 * np, mean = 0.0;
    f->ridge = ridge;
    project_heads(f, x, W, V);
    if (f->L32) {
        float *x32 = (float *)row, *W32 = x32 + 3 * n, *V32 = W32 + 4 * np;
        to_floats(3 * n, x, x32);
        to_floats(4 * np, W, W32);
        to_floats(4 * np, V, V32);
        project_matrix_single(f, x32, W32, V32);
    } else {
        project_matrix(f, x, W, V, row);
    }
    for (size_t i = 0; i < m; i++)
        mean += (f->L32 ? (double)f->L32[i * m + i] : f->L[i * m + i]) / (double)m;
    for (size_t i = 0; i < m; i++) {
        if (f->L32)
            f->L32[i * m + i] = (float)((double)f->L32[i * m + i] + ridge * mean);
        else
            f->L[i * m + i] += ridge * mean;
    }
    return f->L32 ? apsm_cholesky_f32(m, f->L32) : apsm_cholesky(m, f->L);
}

/* All but A': reflections, and in work x, W and V. */
static apsm_status prepare(apsm_phi phi, size_t n, const double *X, bool single, double *store,
                           double *work, apsm_polyharmonic *f, bool *coincide)
{
    if (n < 5 || (phi != APSM_PHI_R && phi != APSM_PHI_R3)) return APSM_ERR_ARG;
    if (single && phi != APSM_PHI_R) return APSM_ERR_ARG;
    *f = (apsm_polyharmonic){ .n = n, .phi = phi, .V = store, .C = store + 4 * n };
    double *L = f->C + 4 * (n - 4);
    if (single)
        f->L32 = (float *)L;
    else
        f->L = L;
    double *x = work, *columns = x + 3 * n, *W = columns + 4 * n, *V = W + 4 * padded(n),
           *row = V + 4 * padded(n);
    APSM_TRY(unit_box(n, X, f->centre, &f->scale));
    scale_centres(f, X, x);
    APSM_TRY(reflections(f, x, columns));
    to_rows(n, f->V, V);
    *coincide = centres_coincide(f, multiply_matrix(phi, n, x, V, W, row));
    to_columns(n, W, columns);
    update_vectors(f, columns, W);
    to_rows(n, columns, W);
    return APSM_OK;
}

apsm_status apsm_polyharmonic_factor(apsm_phi phi, size_t n, const double *X, bool single,
                                     double ridge, double *store, double *work,
                                     apsm_polyharmonic *f)
{
    bool coincide;
    if (!(ridge >= 0.0)) return APSM_ERR_ARG;
    APSM_TRY(prepare(phi, n, X, single, store, work, f, &coincide));
    if (coincide && ridge == 0.0) return APSM_ERR_SINGULAR;
    return factor_projected(f, ridge, work);
}

apsm_status apsm_polyharmonic_factor_robust(apsm_phi phi, size_t n, const double *X, bool single,
                                            double *store, double *work, apsm_polyharmonic *f)
{
    static const double ridges[] = { 0.0, 1e-8, 1e-6, 1e-4 };
    bool coincide;
    APSM_TRY(prepare(phi, n, X, single, store, work, f, &coincide));
    apsm_status status = APSM_ERR_SINGULAR;
    for (size_t i = coincide ? 1 : 0; i < 4 && status != APSM_OK; i++)
        status = factor_projected(f, ridges[i], work);
    return status;
}

/* ---- solve ---- */

/* Y (m-row block n-4 x m) <- (s A'22)^-1 Y. */
static void solve_factor(const apsm_polyharmonic *f, size_t m, double *Y, float *y32)
{
    const size_t rows = f->n - 4;
    if (!f->L32) {
        apsm_cholesky_solve(rows, f->L, m, Y);
        return;
    }
    for (size_t k = 0; k < rows * m; k++) y32[k] = (float)Y[k];
    apsm_cholesky_solve_f32(rows, f->L32, m, y32);
    for (size_t k = 0; k < rows * m; k++) Y[k] = (double)y32[k];
}

/* w1 (4 x m) = R^-T d', d' (4 x m) being d in the unit box and in units of w. */
static void range_part(const apsm_polyharmonic *f, size_t m, const double *d, double *w1)
{
    const double unit = 1.0 / weight_unit(f);
    for (size_t j = 0; j < m; j++) {
        w1[j] = unit * d[j];
        for (size_t i = 1; i < 4; i++)
            w1[i * m + j] = unit * f->scale * (d[i * m + j] - f->centre[i - 1] * d[j]);
        for (size_t i = 0; i < 4; i++) {
            for (size_t l = 0; l < i; l++) w1[i * m + j] -= f->R[4 * l + i] * w1[l * m + j];
            w1[i * m + j] /= f->R[5 * i];
        }
    }
}

/* c (4 x m) <- R^-1 c, then from the unit box to the input's units. */
static void polynomial(const apsm_polyharmonic *f, size_t m, double *c)
{
    for (size_t j = 0; j < m; j++) {
        for (size_t i = 4; i-- > 0;) {
            for (size_t l = i + 1; l < 4; l++) c[i * m + j] -= f->R[4 * i + l] * c[l * m + j];
            c[i * m + j] /= f->R[5 * i];
        }
        for (size_t i = 1; i < 4; i++) {
            c[i * m + j] *= f->scale;
            c[j] -= c[i * m + j] * f->centre[i - 1];
        }
    }
}

void apsm_polyharmonic_solve(const apsm_polyharmonic *f, size_t m, const double *values,
                             const double *d, double *w, double *c, double *work)
{
    const size_t n = f->n;
    double *Y = work, *p = Y + n * m, *q = p + 4 * m, *w1 = q + 4 * m;
    float *y32 = (float *)(w1 + 8 * m);
    memcpy(Y, values, n * m * sizeof *Y);
    reflect(f, true, m, Y, p, q);
    memcpy(c, Y, 4 * m * sizeof *c);
    memset(w1, 0, 4 * m * sizeof *w1);
    double *Y2 = Y + 4 * m;
    if (d) {
        range_part(f, m, d, w1);
        apsm_gemm(0, 0, n - 4, m, 4, -1.0, f->C, 4, w1, m, 1.0, Y2, m);
        apsm_gemm(0, 0, 4, m, 4, -1.0, f->A11, 4, w1, m, 1.0, c, m);
    }
    for (size_t k = 0; k < (n - 4) * m; k++) Y2[k] *= sign_of(f->phi);
    solve_factor(f, m, Y2, y32);
    apsm_gemm(1, 0, 4, m, n - 4, -1.0, f->C, 4, Y2, m, 1.0, c, m);
    polynomial(f, m, c);
    memcpy(Y, w1, 4 * m * sizeof *Y);
    reflect(f, false, m, Y, p, q);
    const double unit = weight_unit(f);
    for (size_t k = 0; k < n * m; k++) w[k] = unit * Y[k];
}

/* ---- evaluate ---- */

/* LANES interpolants' sums run side by side; each is a plain sum over the centres in order, so
 * neither the width of the machine's vectors nor a point's place in its block can change it. */
#define EVAL_BLOCK(NAME, PHI)                                                                      \
    APSM_KERNEL static void NAME(size_t n, const double *restrict X, size_t m,                     \
                                 const double *restrict w, const double *restrict y,               \
                                 double sum[LANES])                                                \
    {                                                                                              \
        double acc[LANES] = { 0 };                                                                 \
        for (size_t k = 0; k < n; k++) {                                                           \
            const double a = X[3 * k], b = X[3 * k + 1], c = X[3 * k + 2], wk = w[k * m];          \
            for (size_t l = 0; l < LANES; l++) {                                                   \
                const double dx = y[l] - a, dy = y[LANES + l] - b, dz = y[2 * LANES + l] - c;      \
                const double d2 = dx * dx + dy * dy + dz * dz;                                     \
                acc[l] += wk * (PHI);                                                              \
            }                                                                                      \
        }                                                                                          \
        memcpy(sum, acc, sizeof acc);                                                              \
    }

EVAL_BLOCK(eval_block_r, sqrt(d2))
EVAL_BLOCK(eval_block_r3, d2 *sqrt(d2))

/* The points Y[0..count) by columns, the last one repeated to fill the lanes. */
static void load_block(size_t count, const double *Y, double *y)
{
    for (size_t l = 0; l < LANES; l++)
        for (size_t c = 0; c < 3; c++) y[c * LANES + l] = Y[3 * (l < count ? l : count - 1) + c];
}

void apsm_polyharmonic_eval(const apsm_interpolants *f, size_t ny, const double *Y, double *out)
{
    const size_t n = f->n, m = f->m;
    const double *c = f->c;
    double y[3 * LANES], sum[LANES];
    for (size_t r = 0; r < ny; r += LANES) {
        const size_t count = ny - r < LANES ? ny - r : LANES;
        load_block(count, Y + 3 * r, y);
        for (size_t j = 0; j < m; j++) {
            if (f->phi == APSM_PHI_R)
                eval_block_r(n, f->X, m, f->w + j, y, sum);
            else
                eval_block_r3(n, f->X, m, f->w + j, y, sum);
            for (size_t l = 0; l < count; l++)
                out[(r + l) * m + j] =
                    sum[l] + (c[j] + c[m + j] * y[l] + c[2 * m + j] * y[LANES + l] +
                              c[3 * m + j] * y[2 * LANES + l]);
        }
    }
}

/* phi (n, out) between y and the centres X. */
APSM_KERNEL static void phi_row(apsm_phi phi, size_t n, const double *restrict X, const double y[3],
                                double *restrict row)
{
    for (size_t k = 0; k < n; k++) {
        const double dx = y[0] - X[3 * k], dy = y[1] - X[3 * k + 1], dz = y[2] - X[3 * k + 2];
        row[k] = dx * dx + dy * dy + dz * dz;
    }
    for (size_t k = 0; k < n; k++)
        row[k] = phi == APSM_PHI_R ? sqrt(row[k]) : row[k] * sqrt(row[k]);
}

void apsm_polyharmonic_eval_many(const apsm_interpolants *f, size_t ny, const double *Y,
                                 double *work, double *out)
{
    const size_t n = f->n, m = f->m, B = APSM_POLYHARMONIC_BLOCK;
    for (size_t r = 0; r < ny; r += B) {
        const size_t rows = ny - r < B ? ny - r : B;
        for (size_t b = 0; b < rows; b++) {
            const double *y = Y + 3 * (r + b);
            phi_row(f->phi, n, f->X, y, work + b * n);
            for (size_t j = 0; j < m; j++)
                out[(r + b) * m + j] =
                    f->c[j] + f->c[m + j] * y[0] + f->c[2 * m + j] * y[1] + f->c[3 * m + j] * y[2];
        }
        apsm_gemm(0, 0, rows, m, n, 1.0, work, n, f->w, m, 1.0, out + r * m, m);
    }
}

/* Column b of values and of d: phi(|y_b - x_k|) and [1; y_b] (each with row length m). */
static void map_right_hand_sides(const apsm_polyharmonic *f, const double *X, size_t m,
                                 const double *Y, double *values, double *d)
{
    for (size_t k = 0; k < f->n; k++)
        for (size_t b = 0; b < m; b++) {
            const double dx = Y[3 * b] - X[3 * k], dy = Y[3 * b + 1] - X[3 * k + 1],
                         dz = Y[3 * b + 2] - X[3 * k + 2];
            const double r2 = dx * dx + dy * dy + dz * dz;
            values[k * m + b] = f->phi == APSM_PHI_R ? sqrt(r2) : r2 * sqrt(r2);
        }
    for (size_t b = 0; b < m; b++) {
        d[b] = 1.0;
        for (size_t c = 0; c < 3; c++) d[(1 + c) * m + b] = Y[3 * b + c];
    }
}

/* f(y) = [phi(y); q(y)]^T M^-1 [values; 0] with the symmetric M of (2), so a row of W is the
 * upper part of M^-1 [phi(y); q(y)]. */
void apsm_polyharmonic_map(const apsm_polyharmonic *f, const double *X, size_t ny, const double *Y,
                           double *W, double *work)
{
    const size_t n = f->n, B = APSM_POLYHARMONIC_BLOCK;
    double *values = work, *solve_work = work + n * B;
    double d[4 * APSM_POLYHARMONIC_BLOCK], c[4 * APSM_POLYHARMONIC_BLOCK];
    for (size_t r = 0; r < ny; r += B) {
        const size_t m = ny - r < B ? ny - r : B;
        map_right_hand_sides(f, X, m, Y + 3 * r, values, d);
        apsm_polyharmonic_solve(f, m, values, d, values, c, solve_work);
        for (size_t b = 0; b < m; b++)
            for (size_t k = 0; k < n; k++) W[(r + b) * n + k] = values[k * m + b];
    }
}

/* ---- solve with a stale factor ---- */

static double dot(size_t n, const double *a, const double *b)
{
    double sum = 0.0;
    for (size_t k = 0; k < n; k++) sum += a[k] * b[k];
    return sum;
}

/* What conjugate gradients need: vectors live in the coordinates of H, first 4 entries 0. */
typedef struct resolve_work {
    const apsm_polyharmonic *stale, *now;
    const double *A;
    const float *A32;     /* its lower triangle, instead of A; or NULL */
    double *full, *solve; /* n; solve work */
    double *z, *p, *q;    /* n each */
} resolve_work;

/* y <- A x. */
static void apply(const resolve_work *s, const double *x, double *y)
{
    const size_t n = s->now->n;
    if (!s->A32) {
        apsm_gemv(n, n, s->A, x, y);
        return;
    }
    float *x32 = (float *)s->solve, *y32 = x32 + n;
    for (size_t k = 0; k < n; k++) x32[k] = (float)x[k];
    apsm_symv_f32(n, s->A32, x32, y32);
    for (size_t k = 0; k < n; k++) y[k] = (double)y32[k];
}

/* z <- s A'22 p. */
static void apply_projected(const resolve_work *s, const double *p, double *z)
{
    const size_t n = s->now->n;
    double t[8];
    memcpy(s->full, p, n * sizeof *p);
    reflect(s->now, false, 1, s->full, t, t + 4);
    apply(s, s->full, z);
    reflect(s->now, true, 1, z, t, t + 4);
    for (size_t k = 0; k < n; k++) z[k] = k < 4 ? 0.0 : sign_of(s->now->phi) * z[k];
}

/* z <- the stale inverse of r, carried over through the full space: the two null spaces are
 * close, their bases need not be. */
static void precondition(const resolve_work *s, const double *r, double *z)
{
    const size_t n = s->now->n;
    double t[8];
    memcpy(z, r, n * sizeof *r);
    reflect(s->now, false, 1, z, t, t + 4);
    reflect(s->stale, true, 1, z, t, t + 4);
    solve_factor(s->stale, 1, z + 4, (float *)s->solve);
    memset(z, 0, 4 * sizeof *z);
    reflect(s->stale, false, 1, z, t, t + 4);
    reflect(s->now, true, 1, z, t, t + 4);
    memset(z, 0, 4 * sizeof *z);
}

/* Preconditioned conjugate gradients from u = 0; r holds the right-hand side at entry. */
static apsm_status conjugate_gradients(const resolve_work *s, const apsm_resolve_options *o,
                                       double *u, double *r, size_t *iterations)
{
    const size_t n = s->now->n;
    const double goal = o->tolerance * o->tolerance * dot(n, r, r);
    double *z = s->z, *p = s->p, *q = s->q;
    double rho = 0.0;
    memset(u, 0, n * sizeof *u);
    for (*iterations = 0; !(dot(n, r, r) <= goal); ++*iterations) {
        if (*iterations == o->most) return APSM_ERR_NONFINITE;
        precondition(s, r, z);
        const double before = rho;
        rho = dot(n, r, z);
        for (size_t k = 0; k < n; k++) p[k] = *iterations ? z[k] + rho / before * p[k] : z[k];
        apply_projected(s, p, q);
        const double curvature = dot(n, p, q);
        if (!(curvature > 0.0) || !(rho > 0.0)) return APSM_ERR_NONFINITE;
        for (size_t k = 0; k < n; k++) {
            u[k] += rho / curvature * p[k];
            r[k] -= rho / curvature * q[k];
        }
    }
    return APSM_OK;
}

apsm_status apsm_polyharmonic_resolve(const apsm_polyharmonic *stale, const double *X,
                                      const double *values, const apsm_resolve_options *o,
                                      double *w, double c[4], size_t *iterations, double *work)
{
    if (o->single && stale->phi != APSM_PHI_R) return APSM_ERR_ARG;
    const size_t n = stale->n;
    double *A = work, *V = A + n * n + 7 * n, *full = V + 4 * n;
    double *u = full + n, *r = u + n, *z = r + n, *p = z + n, *q = p + n, *v = q + n;
    apsm_polyharmonic now = *stale;
    now.V = V;
    const resolve_work s = { stale, &now, A, o->single ? (const float *)A : NULL, full, v + n,
                             z,     p,    q };
    double t[8];
    for (size_t k = 0; k < 3 * n; k++)
        if (!isfinite(X[k])) return APSM_ERR_NONFINITE;
    APSM_TRY(o->single ? assemble_single(&now, X, work) : assemble(&now, X, work));
    memcpy(v, values, n * sizeof *v);
    reflect(&now, true, 1, v, t, t + 4);
    for (size_t k = 0; k < n; k++) r[k] = k < 4 ? 0.0 : sign_of(now.phi) * v[k];
    APSM_TRY(conjugate_gradients(&s, o, u, r, iterations));
    reflect(&now, false, 1, u, t, t + 4); /* u is w in the unit box now */
    apply(&s, u, q);
    reflect(&now, true, 1, q, t, t + 4);
    for (size_t i = 0; i < 4; i++) c[i] = v[i] - q[i]; /* (H^T (v - A w))_1 */
    polynomial(&now, 1, c);
    for (size_t k = 0; k < n; k++) w[k] = weight_unit(&now) * u[k];
    return APSM_OK;
}
