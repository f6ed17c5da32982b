/* mesh.h -- triangle meshes.  Coordinates are LPS, in the unit of the input (mm for images). */
#ifndef APSM_MESH_H
#define APSM_MESH_H

#include <stddef.h>
#include <stdint.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Owns V and F (malloc).  Zero-initialise with {0}; apsm_mesh_free leaves it so. */
typedef struct apsm_mesh {
    size_t nv, nf;
    double *V;   /* nv x 3 */
    uint32_t *F; /* nf x 3, counter-clockwise seen from outside */
} apsm_mesh;

/* Uninitialised arrays of the given sizes.  mesh is overwritten, not freed. */
APSM_API apsm_status apsm_mesh_alloc(apsm_mesh *mesh, size_t nv, size_t nf) APSM_NODISCARD;
APSM_API apsm_status apsm_mesh_copy(const apsm_mesh *from, apsm_mesh *to) APSM_NODISCARD;
/* Adds the vertices and faces of another mesh behind its own.  APSM_ERR_GEOMETRY: more than 2^32
 * vertices; mesh then stays as it was, as it does for want of memory. */
APSM_API apsm_status apsm_mesh_append(apsm_mesh *mesh, const apsm_mesh *more) APSM_NODISCARD;
APSM_API void apsm_mesh_free(apsm_mesh *mesh);

/* A point on a mesh: its face and barycentric weights of the face's three corners
 * (>= 0, sum 1). */
typedef struct apsm_surface_point {
    uint32_t face;
    double weight[3];
} apsm_surface_point;

/* x[3] of a surface point; unit normal n[3] interpolated from vertex normals VN (nv x 3). */
APSM_API void apsm_surface_position(const apsm_mesh *mesh, const apsm_surface_point *p,
                                    double x[3]);
APSM_API void apsm_surface_normal(const apsm_mesh *mesh, const double *VN,
                                  const apsm_surface_point *p, double n[3]);

/* Measures; O(nf). */
APSM_API double apsm_mesh_area(const apsm_mesh *mesh);
APSM_API double
apsm_mesh_volume(const apsm_mesh *mesh); /* signed: > 0 when triangles face outward */
APSM_API void apsm_mesh_bounds(const apsm_mesh *mesh, double lo[3], double hi[3]);
APSM_API void apsm_mesh_centroid(const apsm_mesh *mesh,
                                 double c[3]);              /* area-weighted, of the surface */
APSM_API double apsm_mesh_mean_edge(const apsm_mesh *mesh); /* mean edge length over half-edges */

/* Angle-weighted unit normals of the vertices, VN (nv x 3, out).  A vertex without a proper
 * face gets (0,0,1). */
APSM_API void apsm_mesh_vertex_normals(const apsm_mesh *mesh, double *VN);

/* In place: x <- M x for the row-major affine 4 x 4 M; triangles are turned over if det < 0, so
 * that they face outward again. */
APSM_API void apsm_mesh_transform(apsm_mesh *mesh, const double M[16]);

#ifdef __cplusplus
}
#endif
#endif
