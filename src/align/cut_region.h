/* cut_region.h -- the part of a groomed surface that counts, as an open mesh of its own. */
#ifndef APSM_ALIGN_CUT_REGION_H
#define APSM_ALIGN_CUT_REGION_H

#include "groom/groom.h"

#ifdef __cplusplus
extern "C" {
#endif

/* part (owned by the caller, overwritten) <- where field (nv of whole) is positive, cut along its
 * zero level, repaired and remeshed as opt says, with the sides of whole; whole itself, if nothing
 * is taken away.  *share <- of the area.  The report's openings are those of the part.
 * APSM_ERR_GEOMETRY: nothing is left, or several large pieces. */
apsm_status apsm_cut_region(apsm_context *ctx, const char *name, const apsm_mesh *whole,
                            const double *field, const apsm_groom_options *opt, apsm_mesh *part,
                            double *share, apsm_groom_report *report) APSM_NODISCARD;

/* How a field that was carried from another surface fits. */
typedef struct apsm_carried {
    double miss; /* root mean square distance of the region, moved, from the surface, in radii of
                    the surface it comes from */
} apsm_carried;

/* field (nv of to, out) <- at every vertex that of the place of `from` (whose field is from_field)
 * which non-rigid registration brings nearest to it, facing the same way.  Both in one frame,
 * roughly aligned.  O(points^3 + nv log nf). */
apsm_status apsm_carry_field(const apsm_mesh *from, const double *from_field, const apsm_mesh *to,
                             double *field, apsm_carried *carried) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
