/* mesh_io.h -- meshes from bytes in memory: what apsm_read_mesh does once it has them. */
#ifndef APSM_FORMATS_MESH_IO_H
#define APSM_FORMATS_MESH_IO_H

#include "apsm/mesh.h"

/* Whether the extension is that of a mesh. */
bool mesh_is_known(const char *path);
/* The format is that of path's extension; path is for messages too. */
apsm_status mesh_from_bytes(apsm_context *ctx, const char *path, const char *bytes, size_t size,
                            apsm_mesh *mesh) APSM_NODISCARD;

/* The one contour of a legacy VTK or VTP file, whatever order its lines are in.  *P (n x 3) is
 * malloc'ed, in the order along it; *closed: its last point is joined to its first.  Refused: no
 * lines, several contours, one that branches. */
apsm_status contour_read(apsm_context *ctx, const char *path, size_t *n, double **P,
                         bool *closed) APSM_NODISCARD;
/* Whether the file holds lines and no polygons; no failure is told. */
bool contour_is_one(const char *path);

#endif
