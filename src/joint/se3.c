/* Rotations: R = exp [omega], |omega| = theta (Rodrigues):
 *   exp [omega] = cos theta I + sin theta / theta [omega] + (1 - cos theta) / theta^2 omega omega^T
 * The logarithm goes by the unit quaternion (w, u) of R, omega = 2 atan2(|u|, w) u / |u|, which is
 * exact for small and for large angles alike.  Mean (Karcher 1977; Moakher, SIAM J. Matrix Anal.
 * 24, 2002): R <- R exp(1/n sum_i log(R^T R_i))   until the step rests. */
#include "joint/se3.h"

#include <math.h>
#include <string.h>

#include "geometry/affine.h"
#include "geometry/vec3.h"

/* Largest of the four squares first: no cancellation. */
static void quaternion(const double M[16], double q[4])
{
    const double r[3] = { M[0], M[5], M[10] }, trace = r[0] + r[1] + r[2];
    int a = 0;
    for (int c = 1; c < 3; c++)
        if (r[c] > r[a]) a = c;
    if (trace >= r[a]) {
        q[0] = 1 + trace;
        q[1] = M[9] - M[6];
        q[2] = M[2] - M[8];
        q[3] = M[4] - M[1];
    } else {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        q[0] = M[4 * c + b] - M[4 * b + c];
        q[1 + a] = 1 + r[a] - r[b] - r[c];
        q[1 + b] = M[4 * b + a] + M[4 * a + b];
        q[1 + c] = M[4 * c + a] + M[4 * a + c];
    }
    if (q[0] < 0)
        for (int k = 0; k < 4; k++) q[k] = -q[k];
}

void apsm_se3_log(const double M[16], double xi[6])
{
    double q[4];
    quaternion(M, q);
    const double s = vec3_norm(q + 1);
    const double factor = s > 0 ? 2 * atan2(s, q[0]) / s : 0;
    for (int k = 0; k < 3; k++) {
        xi[k] = factor * q[1 + k];
        xi[3 + k] = M[4 * k + 3];
    }
}

void apsm_se3_exp(const double xi[6], double M[16])
{
    const double theta = vec3_norm(xi), half = sin(0.5 * theta);
    const double a = theta > 0 ? sin(theta) / theta : 1;
    const double b = theta > 0 ? 2 * half * half / (theta * theta) : 0.5;
    const double cross[3][3] = { { 0, -xi[2], xi[1] }, { xi[2], 0, -xi[0] }, { -xi[1], xi[0], 0 } };
    apsm_affine_identity(M);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            M[4 * r + c] = (r == c) * cos(theta) + a * cross[r][c] + b * xi[r] * xi[c];
        M[4 * r + 3] = xi[3 + r];
    }
}

/* step <- mean of log(R^T R_i); returns its length. */
static double mean_step(size_t n, const double *M, const double R[16], double step[6])
{
    memset(step, 0, 6 * sizeof *step);
    for (size_t i = 0; i < n; i++) {
        double D[16], xi[6];
        apsm_affine_identity(D);
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                D[4 * r + c] = R[r] * M[16 * i + (size_t)c] + R[4 + r] * M[16 * i + 4 + (size_t)c] +
                               R[8 + r] * M[16 * i + 8 + (size_t)c];
        apsm_se3_log(D, xi);
        vec3_add_scaled(step, 1.0 / (double)n, xi);
    }
    return vec3_norm(step);
}

void apsm_se3_mean(size_t n, const double *M, double mean[16])
{
    enum { MOST = 100 };
    double R[16], at[3] = { 0 };
    memcpy(R, M, sizeof R);
    for (int k = 0; k < 3; k++) {
        for (size_t i = 0; i < n; i++) at[k] += M[16 * i + 4 * (size_t)k + 3] / (double)n;
        R[4 * k + 3] = 0;
    }
    for (int it = 0; it < MOST; it++) {
        double step[6], E[16];
        const double length = mean_step(n, M, R, step);
        apsm_se3_exp(step, E);
        apsm_affine_multiply(R, E, R);
        if (!(length > 1e-14)) break;
    }
    memcpy(mean, R, sizeof R);
    for (int k = 0; k < 3; k++) mean[4 * k + 3] = at[k];
}
