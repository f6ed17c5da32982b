/* topology.h -- who is next to whom on a triangle mesh, and whether it is a proper surface. */
#ifndef APSM_GEOMETRY_TOPOLOGY_H
#define APSM_GEOMETRY_TOPOLOGY_H

#include <stdbool.h>

#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* "no such face or half-edge" */
#define APSM_NONE UINT32_MAX

/* Half-edge k of face f is number 3f+k and runs from F[3f+k] to F[3f+(k+1)%3].
 * Owns its arrays. */
typedef struct apsm_topology {
    size_t nv, nf;
    uint32_t *twin;         /* 3 nf: opposite half-edge; APSM_NONE on a border, where more than two
                               faces meet, where the other face is turned over, and all around a
                               face with a repeated corner (its neighbours are each other's) */
    uint32_t *corner_start; /* nv + 1: corners (= half-edges starting at v) of vertex v are
                               corner[corner_start[v] .. corner_start[v+1]), ascending */
    uint32_t *corner;       /* 3 nf */
} apsm_topology;

/* O(nv + nf).  APSM_ERR_GEOMETRY if a face names a vertex that is not there. */
apsm_status apsm_topology_build(const apsm_mesh *mesh, apsm_topology *topology) APSM_NODISCARD;
void apsm_topology_free(apsm_topology *topology);

/* The half-edges of faces without a repeated corner by (smaller end, larger end, number), so that
 * those of an edge lie side by side; *sorted is to be freed.  Indices must be sound.  O(nv + nf).
 */
apsm_status topology_sort(const apsm_mesh *mesh, uint32_t **sorted, size_t *count) APSM_NODISCARD;

/* What is wrong with a mesh as a surface.  Counts, and the first place of each. */
typedef struct apsm_mesh_defects {
    size_t components;           /* edge-connected components of faces */
    size_t border_edges;         /* edges with one face */
    size_t nonmanifold_edges;    /* edges with more than two faces */
    size_t nonmanifold_vertices; /* vertices whose faces form more than one fan */
    size_t flipped_edges;        /* edges whose two faces run the same way along them */
    size_t degenerate_faces;     /* repeated corner, or area < 1e-14 of the squared diagonal */
    size_t unused_vertices;
    double border_at[3], nonmanifold_at[3]; /* middle of the first such edge, or the vertex; 0 if
                                               there is none */
} apsm_mesh_defects;

/* O(nv + nf).  APSM_ERR_GEOMETRY as above, APSM_ERR_MEMORY. */
apsm_status apsm_mesh_inspect(const apsm_mesh *mesh, apsm_mesh_defects *defects) APSM_NODISCARD;

/* Whether it has border edges; fails as above. */
apsm_status apsm_mesh_find_open(const apsm_mesh *mesh, bool *open) APSM_NODISCARD;

/* Closed, consistently oriented 2-manifold without degenerate faces.  Invariant used by asserts
 * and tests alike. */
bool apsm_mesh_is_closed_manifold(const apsm_mesh_defects *defects);

/* Euler characteristic V - E + F of used vertices: 2 - 2 genus for a closed connected mesh. */
long apsm_mesh_euler(const apsm_mesh *mesh, const apsm_topology *topology);

#ifdef __cplusplus
}
#endif
#endif
