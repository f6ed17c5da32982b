#include "fit/rigid.h"

#include <math.h>
#include <string.h>

#include "geometry/affine.h"

size_t fit_rigid_size(const posterior_model *m)
{
    return m->M * m->D + m->M;
}

void fit_centre(size_t D, const double *at, double centre[3])
{
    memset(centre, 0, 3 * sizeof *centre);
    for (size_t d = 0; d < D; d++) centre[d % 3] += 3 * at[d] / (double)D;
}

posterior_model fit_rigid_add(const posterior_model *m, const double *at, double radius,
                              double *store)
{
    const size_t D = m->D;
    double *U = store, *v = U + (m->M + FIT_RIGID) * D, c[3];
    fit_centre(D, at, c);
    memset(U, 0, FIT_RIGID * D * sizeof *U);
    for (size_t d = 0; d < D; d += 3)
        for (size_t a = 0; a < 3; a++) {
            const size_t b = (a + 1) % 3, e = (a + 2) % 3;
            U[a * D + d + a] = radius;
            U[(3 + a) * D + d + b] = -(at[d + e] - c[e]); /* axis a times x - c */
            U[(3 + a) * D + d + e] = at[d + b] - c[b];
        }
    memcpy(U + FIT_RIGID * D, m->mode, m->M * D * sizeof *U);
    for (size_t k = 0; k < FIT_RIGID; k++) v[k] = 1;
    memcpy(v + FIT_RIGID, m->variance, m->M * sizeof *v);
    return (posterior_model){ D, m->M + FIT_RIGID, m->mean, U, v, m->noise };
}

/* Rotation about the axis b[3..5] by its length (Rodrigues). */
void fit_rigid_motion(const double centre[3], double radius, const double b[FIT_RIGID],
                      double M[16])
{
    const double *w = b + 3, angle = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    const double s = angle > 1e-9 ? sin(angle) / angle : 1;
    const double t = angle > 1e-9 ? (1 - cos(angle)) / (angle * angle) : 0.5;
    const double W[9] = { 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0 };
    apsm_affine_identity(M);
    for (size_t r = 0; r < 3; r++) {
        for (size_t c = 0; c < 3; c++) {
            double W2 = 0;
            for (size_t k = 0; k < 3; k++) W2 += W[3 * r + k] * W[3 * k + c];
            M[4 * r + c] += s * W[3 * r + c] + t * W2;
        }
        M[4 * r + 3] = centre[r] + radius * b[r];
        for (size_t c = 0; c < 3; c++) M[4 * r + 3] -= M[4 * r + c] * centre[c];
    }
}
