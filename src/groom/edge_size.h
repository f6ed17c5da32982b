/* edge_size.h -- how long edges should be, point by point. */
#ifndef APSM_GROOM_EDGE_SIZE_H
#define APSM_GROOM_EDGE_SIZE_H

#include "groom/remesh.h"

/* size (nv, out): edge length wanted at each vertex of mesh, such that about `faces` equilateral
 * triangles of these sizes cover it.  *common (out): the largest of them. */
apsm_status edge_size(const apsm_mesh *mesh, const apsm_remesh_options *opt, size_t faces,
                      double *size, double *common) APSM_NODISCARD;

#endif
