/* What displacements of particles cost because they are not smooth: the prior (14) of registration
 * on the template's particles, y in radii of theirs,
 *
 *   Q = a_3^2 (K + e^2 I)^-1,   K_jk = cov u(y_j) u(y_k)
 *
 * a_3 is the size of what registration takes for its shortest waves, which from particle to
 * particle are rough: of those a displacement costs its square, of smooth ones little, of affine
 * ones next to nothing.  e lets single particles go where they must. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/registration.h"
#include "core/kernel.h"
#include "geometry/vec3.h"
#include "linalg/linalg.h"
#include "optimize/fidelity_shape.h"

static const double rough = 0.02, own = 0.005; /* a_3 and e, in radii */

/* y (J x 3) in radii about the centre; false if all lie in one point. */
static bool normalise(size_t J, const double *T, double *y)
{
    double centre[3] = { 0 }, r2 = 0;
    for (size_t x = 0; x < 3 * J; x++) centre[x % 3] += T[x] / (double)J;
    for (size_t x = 0; x < 3 * J; x++) {
        y[x] = T[x] - centre[x % 3];
        r2 += y[x] * y[x] / (double)J;
    }
    for (size_t x = 0; x < 3 * J; x++) y[x] /= sqrt(r2);
    return r2 > 0;
}

apsm_status fidelity_smoothness(size_t J, const double *T, double *Q)
{
    double *y = malloc(3 * J * sizeof *y), *K = malloc(J * J * sizeof *K);
    apsm_status status = y && K ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK && !normalise(J, T, y)) status = APSM_ERR_GEOMETRY;
    if (status == APSM_OK) {
        apsm_registration_covariance(J, y, K);
        memset(Q, 0, J * J * sizeof *Q);
        for (size_t j = 0; j < J; j++) {
            K[j * J + j] += own * own;
            Q[j * J + j] = rough * rough;
        }
        status = apsm_cholesky(J, K);
    }
    if (status == APSM_OK) apsm_cholesky_solve(J, K, J, Q);
    free(y);
    free(K);
    return status;
}

/* S (3 x J) += c' q for four rows q of Q and their coefficients. */
KERNEL_INLINE void add_four(size_t J, const double *const q[4], const double c[4][3], double *S)
{
    double *x = S, *y = S + J, *z = S + 2 * J;
    for (size_t k = 0; k < J; k++) {
        const double a = q[0][k], b = q[1][k], d = q[2][k], e = q[3][k];
        x[k] += (c[0][0] * a + c[1][0] * b) + (c[2][0] * d + c[3][0] * e);
        y[k] += (c[0][1] * a + c[1][1] * b) + (c[2][1] * d + c[3][1] * e);
        z[k] += (c[0][2] * a + c[1][2] * b) + (c[2][2] * d + c[3][2] * e);
    }
}

APSM_KERNEL void fidelity_roughness(size_t J, const double *Q, const double *e, double *work,
                                    double *Qe)
{
    static const double zero[3] = { 0 };
    memset(work, 0, 3 * J * sizeof *work);
    for (size_t j = 0; j < J; j += 4) {
        const double *q[4];
        double c[4][3];
        for (size_t r = 0; r < 4; r++) {
            const bool in = j + r < J;
            q[r] = Q + (in ? j + r : j) * J;
            memcpy(c[r], in ? e + 3 * (j + r) : zero, sizeof c[r]);
        }
        add_four(J, q, (const double(*)[3])c, work);
    }
    for (size_t x = 0; x < 3 * J; x++) Qe[x] = work[x % 3 * J + x / 3];
}

/* H (n) += weight q t'u for the tangents u (3 x n, by coordinate); q (n). */
KERNEL_INLINE void add_row(size_t n, size_t stride, const double *q, const double t[3],
                           const double *u, double *H)
{
    const double *x = u, *y = u + stride, *z = u + 2 * stride;
    for (size_t k = 0; k < n; k++) H[k] += q[k] * (t[0] * x[k] + t[1] * y[k] + t[2] * z[k]);
}

APSM_KERNEL void fidelity_add_roughness(size_t J, double weight, const double *Q,
                                        const double *tangent, double *work, double *H)
{
    const size_t n = 2 * J;
    double *u = work, *q = work + 3 * n;
    for (size_t x = 0; x < 3 * n; x++) u[x % 3 * n + x / 3] = tangent[x];
    for (size_t j = 0; j < J; j++) {
        for (size_t k = 0; k <= j; k++) q[2 * k] = q[2 * k + 1] = weight * Q[j * J + k];
        for (size_t x = 2 * j; x < 2 * j + 2; x++)
            add_row(x + 1, n, q, tangent + 3 * x, u, H + x * n);
    }
}
