/* walk.h -- the closest point of a surface from one that is known to be near. */
#ifndef APSM_GEOMETRY_WALK_H
#define APSM_GEOMETRY_WALK_H

#include "geometry/bvh.h"
#include "geometry/topology.h"

#ifdef __cplusplus
extern "C" {
#endif

/* From `face` over edges and corners to ever nearer faces: out is a point of the mesh from which no
 * adjacent face is nearer to x, and no nearer one may be anywhere unless the surface comes near
 * twice.  Needs no tree.  distance2 is exact: never less than that of the closest point. */
void apsm_walk_closest(const apsm_mesh *mesh, const apsm_topology *topology, const double x[3],
                       uint32_t face, apsm_closest *out);

#ifdef __cplusplus
}
#endif
#endif
