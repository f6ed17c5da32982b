/* template_choice.h -- which shape of an aligned cohort is to be its template: the one whose mesh,
 * warped by corresponding points, comes closest to the other shapes. */
#ifndef APSM_TEMPLATE_CHOICE_H
#define APSM_TEMPLATE_CHOICE_H

#include "apsm/context.h"
#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Meshes (n, borrowed, each in its own frame) are brought to a common frame by M (n x 16, rigid or
 * with scale).  typical is a shape that all were aligned to, with the residuals given (n); skip (n;
 * NULL: none) names shapes that must not be it, the typical one only if all others are.  Up to 10
 * candidates, those of least residual, are warped to each other and to up to 6 shapes more, taken
 * evenly by residual, through 128 points that non-rigid registration of the typical shape finds on
 * all of them.  *chosen (out) is the one of least mean two-way distance, if that is 2 % below the
 * typical shape's; else, and with less than four shapes, the typical one.  The same for any number
 * of threads.  O(nf) memory for up to 16 shapes. */
apsm_status apsm_choose_template(apsm_context *ctx, size_t n, const apsm_mesh *const *meshes,
                                 const double *M, const double *residual, const bool *skip,
                                 size_t typical, size_t *chosen) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
