/* fidelity_warp.h -- the template's vertices as the particles near them carry them: what the
 * fidelity stage does with the warp some thirty times a shape, at a cost that does not grow with
 * the number of particles. */
#ifndef APSM_OPTIMIZE_FIDELITY_WARP_H
#define APSM_OPTIMIZE_FIDELITY_WARP_H

#include "model/warp.h"

/* Rows of W with few entries, by vertex: vertex v hangs on the particles
 * index[start[v] .. start[v + 1]), which rise.  Owns its arrays. */
typedef struct fidelity_warp {
    size_t nv, most; /* vertices; entries of the longest row */
    size_t *start;   /* nv + 1 */
    uint32_t *index; /* start[nv] */
    double *weight;  /* start[nv] */
} fidelity_warp;

/* From the whole warp, its vertices X (nv x 3), the template's particles T (J x 3) and h. */
apsm_status fidelity_warp_build(const apsm_warp *whole, const double *X, const double *T, double h,
                                fidelity_warp *warp) APSM_NODISCARD;
void fidelity_warp_free(fidelity_warp *warp);

/* Y (nv x 3, out) = X + W D for moves D (J x 4, the fourth column unused) of the particles. */
void fidelity_warp_displace(const fidelity_warp *warp, const double *X, const double *D, double *Y);

#endif
