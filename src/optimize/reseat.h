/* reseat.h -- chooses the template's particles anew by the surface error of the warp, and carries
 * those of all shapes along.  "Adaptivity by warp error" in docs/method.md. */
#ifndef APSM_RESEAT_H
#define APSM_RESEAT_H

#include "initialize/cohort.h"

#ifdef __cplusplus
extern "C" {
#endif

/* From particles P (I x J x 3) to Q (I x J2 x 3, out), J2 >= J: those of the template move, and J2
 * - J are added, so that their density is the square root of adaptivity (0..1) times the mean over
 * the shapes of the distance between warped template and surface times the present density, plus 1
 * - adaptivity.  Every shape's particles follow by the warp and land on its surface.  Shapes whose
 * flag in `judged` (I; NULL: none) is set do not take part in the error.  At most 64 shapes, evenly
 * taken, do.  O(shapes nv log nf + nv J2) time. */
apsm_status apsm_reseat(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                        const bool *judged, double adaptivity, size_t J2, double *Q) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
