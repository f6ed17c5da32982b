/* region.h -- a part of a surface, by planes, by painted points, or by boundaries drawn on it, as a
 * function of the vertices: positive inside, a length (docs/method.md, "Open surfaces and
 * regions"). */
#ifndef APSM_GEOMETRY_REGION_H
#define APSM_GEOMETRY_REGION_H

#include <stdbool.h>

#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What of a surface counts: all that every one of them leaves.  Owns its arrays; {0} is the whole
 * surface. */
typedef struct apsm_region {
    size_t planes;
    double (*plane)[4]; /* n, d with |n| = 1: n.x >= d stays */
    size_t spheres;
    double (*sphere)[4]; /* centre and radius: what lies outside stays */
    size_t painted;
    double *point; /* painted x 3: points of the surface ... */
    bool *in;      /* ... and whether they count; other places are as their nearest point */
    size_t loops;
    size_t *loop_start; /* loops + 1 */
    double *boundary;   /* corners (x 3) of closed loops on the surface ... */
    double query[3];    /* ... and a point on the side that counts */
} apsm_region;

void apsm_region_free(apsm_region *region);

/* field (nv, out): at each vertex the least, over the region's limits, of the signed distances
 *   plane     n.x - d;   sphere   |x - c| - r                                             (R1)
 *   paint     half of the distance to the nearest point that does not count, less that to the
 *             nearest that does                                                           (R2)
 *   loop      the distance to the loops, positive where the query point is reached across the
 *             surface without crossing one                                                (R3)
 * APSM_ERR_GEOMETRY: the loops do not part the surface.  O(nv log painted + nv corners). */
apsm_status apsm_region_field(const apsm_region *region, const apsm_mesh *mesh,
                              double *field) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
