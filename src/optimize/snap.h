/* snap.h -- the step of an epoch and the way back to the surface.  docs/method.md, (11). */
#ifndef APSM_SNAP_H
#define APSM_SNAP_H

#include "core/option.h"
#include "geometry/bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { APSM_STEP_SCALED, APSM_STEP_LITERAL };
enum { APSM_SNAP_CLOSEST, APSM_SNAP_FIELD, APSM_SNAP_NONE };
#define APSM_STEP_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                         \
    ENUM(S, step, "scaled|literal",                                                                \
         "(11) in units of h, or plain descent with learning_rate (paper)")                        \
    REAL(S, learning_rate, 1, 0, 1e6, "of the literal step")                                       \
    REAL(S, step_clip, 0.25, 0, 1e6, "longest step of an epoch, in h; 0: no limit")                \
    ENUM(S, snap, "closest|field|none",                                                            \
         "return to the surface after a step: closest point, p - D n (paper), not at all")         \
    INT(S, snaps, 1, 1, 10, "how often p - D n is applied when snap is field")
typedef struct apsm_step_options {
    APSM_OPTION_FIELDS(APSM_STEP_OPTIONS)
} apsm_step_options;

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
