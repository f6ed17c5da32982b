/* mesh_io.h -- meshes from bytes in memory: what apsm_read_mesh does once it has them. */
#ifndef APSM_FORMATS_MESH_IO_H
#define APSM_FORMATS_MESH_IO_H

#include "apsm/mesh.h"

/* The format is that of path's extension; path is for messages too. */
apsm_status mesh_from_bytes(apsm_context *ctx, const char *path, const char *bytes, size_t size,
                            apsm_mesh *mesh) APSM_NODISCARD;

#endif
