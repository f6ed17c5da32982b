/* warp.h -- takes the template's mesh to any shape of the model: the interpolant (1)
 * of docs/method.md through the particles is linear in the target's particles, y = W P, with W (nv
 * x J) from the template alone. */
#ifndef APSM_MODEL_WARP_H
#define APSM_MODEL_WARP_H

#include "apsm/mesh.h"
#include "linalg/polyharmonic.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Owns W.  Zero-initialise with {0}; apsm_warp_free leaves it so. */
typedef struct apsm_warp {
    size_t nv, J;
    size_t merged;                 /* template particles that share their place with another */
    double *W;                     /* nv x J; rows sum to 1 */
    struct apsm_shared_warp *lent; /* whose W is; NULL: its own */
} apsm_warp;

/* The warp of n points X (n x 3; a mesh's vertices) that follows the template's particles
 * P (J x 3).  phi: APSM_PHI_R is that of docs/method.md.  Particles within 1e-9 of the set's
 * diagonal count as one that goes to the mean of their targets; a warning is logged.  J^3/3 + n J^2
 * flops, 8 n J bytes. APSM_ERR_GEOMETRY: fewer than 5 distinct particles, or all in a plane;
 * APSM_ERR_NONFINITE: a particle is not finite. */
apsm_status apsm_warp_build(apsm_context *ctx, apsm_phi phi, size_t n, const double *X, size_t J,
                            const double *P, apsm_warp *warp) APSM_NODISCARD;
/* The same, but lent by the context where it keeps the one that was asked for last and that is of
 * the same points and particles: optimize's last, evaluate's, calibration's and the report's are.
 * The context keeps it until another is asked for. */
apsm_status apsm_warp_share(apsm_context *ctx, apsm_phi phi, size_t n, const double *X, size_t J,
                            const double *P, apsm_warp *warp) APSM_NODISCARD;
void apsm_warp_free(apsm_warp *warp);

/* Y (nv x 3, out) = W P for a shape's particles P (J x 3). */
void apsm_warp_apply(const apsm_warp *warp, const double *P, double *Y);

/* Y (nv x 3, out) = X + W D for moves D (J x 3) of the particles, X (nv x 3) where they begin; W
 * (nv x J) in single precision, which errs by 1e-6 of the moves: in half the time. */
void apsm_warp_displace(size_t nv, size_t J, const float *W, const double *X, const double *D,
                        double *Y);

/* Y (I x n x 3, out): the points X as such a warp takes them to I shapes with particles Q (I x J x
 * 3), phi APSM_PHI_R, without W: for few shapes.  J^3/3 + I J^2 + I n J flops. */
apsm_status apsm_warp_to_shapes(apsm_context *ctx, size_t n, const double *X, size_t J,
                                const double *P, size_t I, const double *Q,
                                double *Y) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
