/* Affine maps; least-squares rigid and similarity fits; the 3 x 3 SVD behind them.
 *
 * Fit (Kabsch 1976; Umeyama, IEEE PAMI 13, 1991), with weighted means mx, my:
 *   H = sum_k w_k (y_k - my)(x_k - mx)^T = U S V^T
 *   R = U E V^T,  E = diag(1, 1, det U det V)
 *   s = trace(S E) / sum_k w_k |x_k - mx|^2         (1 for a rigid map)
 *   M x = s R (x - mx) + my
 * SVD (Hestenes 1958): rotate pairs of columns of A until all are orthogonal; their lengths are
 * the singular values.  Small singular values keep their relative accuracy. */
#include "geometry/affine.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "geometry/vec3.h"

void apsm_affine_identity(double M[16])
{
    memset(M, 0, 16 * sizeof *M);
    for (int k = 0; k < 4; k++) M[5 * k] = 1.0;
}

void apsm_affine_multiply(const double A[16], const double B[16], double AB[16])
{
    double C[16];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            C[4 * i + j] = 0.0;
            for (int k = 0; k < 4; k++) C[4 * i + j] += A[4 * i + k] * B[4 * k + j];
        }
    memcpy(AB, C, sizeof C);
}

/* Rows of the 3 x 3 part. */
static void linear_rows(const double M[16], double r[3][3])
{
    for (int i = 0; i < 3; i++) memcpy(r[i], M + 4 * i, sizeof r[i]);
}

double apsm_affine_det(const double M[16])
{
    double r[3][3], c[3];
    linear_rows(M, r);
    vec3_cross(r[1], r[2], c);
    return vec3_dot(r[0], c);
}

/* Columns of the inverse are cross products of the rows over the determinant.  Singular means:
 * the determinant is rounding against Hadamard's bound |r0| |r1| |r2|. */
apsm_status apsm_affine_invert(const double M[16], double inverse[16])
{
    double r[3][3], column[3][3], out[16] = { [15] = 1.0 };
    linear_rows(M, r);
    const double bound = vec3_norm(r[0]) * vec3_norm(r[1]) * vec3_norm(r[2]);
    for (int j = 0; j < 3; j++) vec3_cross(r[(j + 1) % 3], r[(j + 2) % 3], column[j]);
    const double det = vec3_dot(r[0], column[0]);
    if (!(fabs(det) > 4.0 * DBL_EPSILON * bound) || !isfinite(det)) return APSM_ERR_SINGULAR;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) out[4 * i + j] = column[j][i] / det;
        out[4 * i + 3] = -(out[4 * i] * M[3] + out[4 * i + 1] * M[7] + out[4 * i + 2] * M[11]);
    }
    memcpy(inverse, out, sizeof out);
    return APSM_OK;
}

static void apply_linear(const double M[16], const double x[3], double y[3])
{
    const double x0 = x[0], x1 = x[1], x2 = x[2];
    for (int r = 0; r < 3; r++) y[r] = M[4 * r] * x0 + M[4 * r + 1] * x1 + M[4 * r + 2] * x2;
}

void apsm_affine_remove_scale(const double centre[3], double M[16])
{
    const double scale = vec3_norm(M);
    for (size_t r = 0; r < 3; r++)
        for (size_t c = 0; c < 3; c++) {
            const double rigid = M[4 * r + c] / scale;
            M[4 * r + 3] += (M[4 * r + c] - rigid) * centre[c];
            M[4 * r + c] = rigid;
        }
}

void apsm_affine_apply(const double M[16], size_t n, const double *x, double *y)
{
    for (size_t i = 0; i < n; i++) {
        apply_linear(M, x + 3 * i, y + 3 * i);
        for (int r = 0; r < 3; r++) y[3 * i + (size_t)r] += M[4 * r + 3];
    }
}

void apsm_affine_apply_normals(const double M[16], size_t n, const double *x, double *y)
{
    for (size_t i = 0; i < n; i++) {
        apply_linear(M, x + 3 * i, y + 3 * i);
        vec3_normalise(y + 3 * i);
    }
}

/* B's rows are the columns of A, V's rows the columns of V: both are turned alike.  Returns
 * whether the pair was already orthogonal. */
static int rotate_pair(double B[3][3], double V[3][3], int p, int q)
{
    const double a = vec3_dot(B[p], B[p]), b = vec3_dot(B[q], B[q]), d = vec3_dot(B[p], B[q]);
    if (fabs(d) <= DBL_EPSILON * sqrt(a) * sqrt(b)) return 1;
    const double zeta = (b - a) / (2.0 * d);
    const double t = copysign(1.0, zeta) / (fabs(zeta) + hypot(1.0, zeta));
    const double c = 1.0 / sqrt(1.0 + t * t), s = c * t;
    for (int k = 0; k < 3; k++) {
        const double bp = B[p][k], vp = V[p][k];
        B[p][k] = c * bp - s * B[q][k];
        B[q][k] = s * bp + c * B[q][k];
        V[p][k] = c * vp - s * V[q][k];
        V[q][k] = s * vp + c * V[q][k];
    }
    return 0;
}

static void swap_rows(double A[3][3], int p, int q)
{
    for (int k = 0; k < 3; k++) {
        const double x = A[p][k];
        A[p][k] = A[q][k];
        A[q][k] = x;
    }
}

/* A unit vector at right angles to unit u. */
static void perpendicular(const double u[3], double out[3])
{
    int k = 0;
    for (int c = 1; c < 3; c++)
        if (fabs(u[c]) < fabs(u[k])) k = c;
    double e[3] = { 0.0, 0.0, 0.0 };
    e[k] = 1.0;
    vec3_cross(u, e, out);
    vec3_normalise(out);
}

/* U's columns (rows of Ut) from the orthogonal, sorted B: orthonormal even where B is zero. */
static void complete_basis(double B[3][3], double Ut[3][3])
{
    memcpy(Ut, B, 9 * sizeof(double));
    if (!(vec3_normalise(Ut[0]) > 0.0)) Ut[0][0] = 1.0;
    vec3_add_scaled(Ut[1], -vec3_dot(Ut[1], Ut[0]), Ut[0]);
    if (!(vec3_normalise(Ut[1]) > 0.0)) perpendicular(Ut[0], Ut[1]);
    vec3_cross(Ut[0], Ut[1], Ut[2]);
    if (vec3_dot(Ut[2], B[2]) < 0.0)
        for (int k = 0; k < 3; k++) Ut[2][k] = -Ut[2][k];
}

void apsm_svd3(const double A[9], double U[9], double s[3], double V[9])
{
    double B[3][3], W[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, Ut[3][3], largest = 0.0;
    for (int k = 0; k < 9; k++) largest = fmax(largest, fabs(A[k]));
    int e = 0; /* squares must neither overflow nor vanish: work at size 1, by a power of two */
    if (largest > 0.0 && isfinite(largest)) frexp(largest, &e);
    for (int k = 0; k < 9; k++) B[k % 3][k / 3] = ldexp(A[k], -e);

    for (int sweep = 0; sweep < 40; sweep++) { /* 4-6 in practice */
        int done = rotate_pair(B, W, 0, 1);
        done &= rotate_pair(B, W, 0, 2);
        done &= rotate_pair(B, W, 1, 2);
        if (done) break;
    }
    for (int pass = 0; pass < 3; pass++) /* three compare-exchanges sort three columns */
        for (int p = pass % 2; p < 2; p += 2)
            if (vec3_dot(B[p], B[p]) < vec3_dot(B[p + 1], B[p + 1])) {
                swap_rows(B, p, p + 1);
                swap_rows(W, p, p + 1);
            }
    complete_basis(B, Ut);
    for (int k = 0; k < 3; k++) {
        s[k] = ldexp(vec3_norm(B[k]), e);
        for (int r = 0; r < 3; r++) {
            U[3 * r + k] = Ut[k][r];
            V[3 * r + k] = W[k][r];
        }
    }
}

static double det3(const double A[9])
{
    double c[3];
    vec3_cross(A + 3, A + 6, c);
    return vec3_dot(A, c);
}

/* R = U diag(1, 1, det U det V) V^T; returns trace(S E). */
static double polar_rotation(const double A[9], double R[9])
{
    double U[9], s[3], V[9];
    apsm_svd3(A, U, s, V);
    const double e = det3(U) * det3(V) < 0.0 ? -1.0 : 1.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R[3 * i + j] =
                U[3 * i] * V[3 * j] + U[3 * i + 1] * V[3 * j + 1] + e * U[3 * i + 2] * V[3 * j + 2];
    return s[0] + s[1] + e * s[2];
}

void apsm_nearest_rotation(const double A[9], double R[9])
{
    polar_rotation(A, R);
}

static void weighted_mean(size_t n, const double *x, const double *w, double mean[3])
{
    double sum[3] = { 0.0, 0.0, 0.0 }, total = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double wi = w ? w[i] : 1.0;
        double d[3]; /* from the first point, against cancellation far from the origin */
        vec3_sub(x + 3 * i, x, d);
        vec3_add_scaled(sum, wi, d);
        total += wi;
    }
    for (size_t c = 0; c < 3; c++) mean[c] = x[c] + (total > 0.0 ? sum[c] / total : 0.0);
}

void apsm_affine_fit(size_t n, const double *x, const double *y, const double *w, int scale,
                     double M[16])
{
    double mx[3], my[3], H[9] = { 0.0 }, R[9], spread = 0.0;
    weighted_mean(n, x, w, mx);
    weighted_mean(n, y, w, my);
    for (size_t i = 0; i < n; i++) {
        const double wi = w ? w[i] : 1.0;
        double dx[3], dy[3];
        vec3_sub(x + 3 * i, mx, dx);
        vec3_sub(y + 3 * i, my, dy);
        for (int r = 0; r < 3; r++) vec3_add_scaled(H + 3 * r, wi * dy[r], dx);
        spread += wi * vec3_dot(dx, dx);
    }
    const double trace = polar_rotation(H, R);
    const double s = scale && spread > 0.0 ? trace / spread : 1.0;
    apsm_affine_identity(M);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) M[4 * r + c] = s * R[3 * r + c];
        M[4 * r + 3] = my[r] - vec3_dot(M + 4 * r, mx);
    }
}

void apsm_principal_axes(size_t n, const double *x, double c[3], double V[9])
{
    double C[9] = { 0 }, U[9], s[3];
    c[0] = c[1] = c[2] = 0.0;
    for (size_t k = 0; k < 3 * n; k++) c[k % 3] += x[k] / (double)n;
    for (size_t k = 0; k < n; k++)
        for (size_t a = 0; a < 9; a++)
            C[a] += (x[3 * k + a / 3] - c[a / 3]) * (x[3 * k + a % 3] - c[a % 3]);
    apsm_svd3(C, U, s, V);
}

void apsm_rotation_of_spiral(size_t k, size_t n, double R[9])
{
    const double two_pi = 6.283185307179586, psi = 1.533751168755204288118041;
    const double s = (double)k + 0.5, t = s / (double)n, d = two_pi * s;
    const double r = sqrt(t), q = sqrt(1.0 - t), a = d / sqrt(2.0), b = d / psi;
    const double x = r * sin(a), y = r * cos(a), z = q * sin(b), w = q * cos(b);
    const double Q[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
        2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
        2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)
    };
    memcpy(R, Q, sizeof Q);
}
