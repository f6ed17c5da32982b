/* snap.h -- the step of an epoch and the way back to the surface.  docs/method.md, (11). */
#ifndef APSM_SNAP_H
#define APSM_SNAP_H

#include "geometry/bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* step (J x 3, out) = -sum_m weight_m grad_m over `terms` gradients (J x 3 each; an entry may be
 * NULL: left out), every row shortened to `clip` where it is longer (INFINITY: never).  Returns the
 * mean length of the rows.  step may be one of the gradients. */
double apsm_step(size_t J, size_t terms, const double *weight, const double *const *grad,
                 double clip, double *step);

/* p <- p - D(p) n(p) for P (J x 3) with D (J) and unit N (J x 3) at P. */
void apsm_snap(size_t J, const double *D, const double *N, double *P);

/* P (J x 3) <- the closest points of the mesh; on (J, out; NULL: not wanted) says where they
 * are.  guess (J, in/out; NULL: none): what the last call found, or 0; it saves time and changes
 * nothing else.  Returns the largest move. */
double apsm_snap_closest(const apsm_bvh *bvh, size_t J, double *P, apsm_surface_point *on,
                         uint32_t *guess);

#ifdef __cplusplus
}
#endif
#endif
