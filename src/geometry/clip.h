/* clip.h -- the part of a mesh where a function of its vertices is positive. */
#ifndef APSM_GEOMETRY_CLIP_H
#define APSM_GEOMETRY_CLIP_H

#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* out (owned by the caller, overwritten) is the part of mesh where the linear interpolation of
 * field (nv) is positive: faces that the zero level crosses are cut along it.  The level passes
 * through a vertex if it comes nearer to it than a thousandth of an edge, so that no needle is
 * made. Faces keep their order and orientation, vertices theirs, cuts come behind.  Where the level
 * touches itself, or leaves islands, so does out: apsm_repair makes one proper surface of it. Empty
 * if nothing is positive.  APSM_ERR_MEMORY.  O(nv + nf log nf). */
apsm_status apsm_mesh_clip_field(const apsm_mesh *mesh, const double *field,
                                 apsm_mesh *out) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
