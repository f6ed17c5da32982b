/* bvh.h -- closest points on a triangle mesh, by a tree of bounding boxes. */
#ifndef APSM_GEOMETRY_BVH_H
#define APSM_GEOMETRY_BVH_H

#include <stdbool.h>

#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_bvh apsm_bvh;

typedef struct apsm_closest {
    apsm_surface_point on; /* where on the mesh */
    double x[3];           /* its position */
    double distance2;      /* squared distance; INFINITY if nothing is nearer than the bound */
} apsm_closest;

/* mesh is borrowed: it must outlive the tree, unchanged and in its place.  O(nf log nf) time, about
 * 140 bytes a face.  The tree depends on the mesh alone, so queries are reproducible, and exactly
 * 2^k as large on a mesh 2^k as large.  APSM_ERR_GEOMETRY: no faces, or an index out of range;
 * APSM_ERR_NONFINITE: a coordinate is; APSM_ERR_MEMORY. */
apsm_status apsm_bvh_build(const apsm_mesh *mesh, apsm_bvh **bvh) APSM_NODISCARD;
/* The same without what signs need, for half the time: not for apsm_bvh_signed_distance. */
apsm_status apsm_bvh_build_unsigned(const apsm_mesh *mesh, apsm_bvh **bvh) APSM_NODISCARD;
/* After the mesh's vertices have moved (they are finite, its faces are the same): answers are again
 * those of a new tree, for a tenth of its time, though slower to find if the shape is another. */
void apsm_bvh_refit(apsm_bvh *bvh);
void apsm_bvh_free(apsm_bvh *bvh);
const apsm_mesh *apsm_bvh_mesh(const apsm_bvh *bvh);

/* The closest point to x among those nearer than sqrt(max_distance2) (INFINITY: no bound).
 * Ties go to the smallest face index.  Weights are exactly 0 for corners the point does not depend
 * on: one positive weight is a vertex, two an edge.  Distances err by a few eps of the
 * coordinates' size, on slivers too.  Thread-safe, O(log nf) near the surface. */
void apsm_bvh_closest(const apsm_bvh *bvh, const double x[3], double max_distance2,
                      apsm_closest *out);

/* As above, but only faces whose unit normal m satisfies m . n >= min_cos count: keeps a query
 * on its own side of a thin sheet.  n must be unit. */
void apsm_bvh_closest_facing(const apsm_bvh *bvh, const double x[3], const double n[3],
                             double min_cos, double max_distance2, apsm_closest *out);

/* Signed distance by the angle-weighted pseudo-normal of the closest feature (Baerentzen &
 * Aanaes 2005): negative inside, +0 on the surface.  The mesh must be closed and face outward.
 * out (the closest point) may be NULL. */
double apsm_bvh_signed_distance(const apsm_bvh *bvh, const double x[3], apsm_closest *out);

/* First hit of the ray x + t d, t in (t_min, t_max); returns t or INFINITY.  d need not be unit.
 * Any face counts, from either side; no ray slips between two faces of an edge.  face (APSM_NONE
 * without a hit) may be NULL. */
double apsm_bvh_ray(const apsm_bvh *bvh, const double x[3], const double d[3], double t_min,
                    double t_max, uint32_t *face);

#ifdef __cplusplus
}
#endif
#endif
