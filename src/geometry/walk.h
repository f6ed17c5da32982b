/* walk.h -- the closest point of a surface from one that is known to be near. */
#ifndef APSM_GEOMETRY_WALK_H
#define APSM_GEOMETRY_WALK_H

#include "geometry/bvh.h"
#include "geometry/topology.h"

#ifdef __cplusplus
extern "C" {
#endif

/* From `face` over edges and corners to ever nearer faces, until none of those adjacent to where
 * out lies is nearer to x; no nearer one may then be anywhere unless the surface comes near twice.
 * Across an edge that has no twin (three faces meet there, or two that are turned against each
 * other) no adjacent face is seen, and the walk may end before a nearer one.  Needs no tree.
 * distance2 is that of a point of the mesh: never less than that of the closest. */
void apsm_walk_closest(const apsm_mesh *mesh, const apsm_topology *topology, const double x[3],
                       uint32_t face, apsm_closest *out);

#ifdef __cplusplus
}
#endif
#endif
