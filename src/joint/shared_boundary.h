/* shared_boundary.h -- where two parts touch: a surface of its own, and what is left of either. */
#ifndef APSM_JOINT_SHARED_BOUNDARY_H
#define APSM_JOINT_SHARED_BOUNDARY_H

#include "geometry/bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Open meshes, owned. */
typedef struct apsm_shared_boundary {
    apsm_mesh rest[2]; /* of a and b, what does not touch the other */
    apsm_mesh shared;  /* of a, what does */
} apsm_shared_boundary;

/* A place of one surface is shared if the other surface, facing it, is nearer than tolerance; the
 * surfaces are cut along the level where it is not.  a and b are closed and face outward.
 * APSM_ERR_GEOMETRY: they touch nowhere, or one lies all over the other.  O((nv_a + nv_b) log nf).
 */
apsm_status apsm_split_shared(const apsm_bvh *a, const apsm_bvh *b, double tolerance,
                              apsm_shared_boundary *split) APSM_NODISCARD;
void apsm_shared_boundary_free(apsm_shared_boundary *split);

#ifdef __cplusplus
}
#endif
#endif
