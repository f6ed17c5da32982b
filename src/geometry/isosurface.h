/* isosurface.h -- surfaces of functions on a grid. */
#ifndef APSM_GEOMETRY_ISOSURFACE_H
#define APSM_GEOMETRY_ISOSURFACE_H

#include "apsm/mesh.h"

/* Iso-surface of values (n[0] x n[1] x n[2], x fastest, negative inside) at `level`, in index
 * coordinates, triangles facing outward (towards larger values): a closed manifold but for the
 * grid's border.  The same triangles whatever values are multiplied by.  mesh is overwritten, and
 * {0} on failure. */
apsm_status apsm_isosurface(apsm_context *ctx, const size_t n[3], const float *values, double level,
                            apsm_mesh *mesh) APSM_NODISCARD;

#endif
