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
