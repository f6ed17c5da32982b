/* rim.h -- the border of an open mesh: closed loops of edges that have one face. */
#ifndef APSM_GEOMETRY_RIM_H
#define APSM_GEOMETRY_RIM_H

#include <stdbool.h>

#include "geometry/topology.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Owns its arrays but mesh, which is borrowed.  A closed mesh has n = loops = 0. */
typedef struct apsm_rim {
    const apsm_mesh *mesh;
    size_t n, loops;
    uint32_t *half_edge;  /* n: loop after loop, in the order in which the faces run along them */
    uint32_t *loop_start; /* loops + 1 */
    unsigned char *on;    /* nv: whether a vertex is on the rim */
} apsm_rim;

/* topology is that of mesh.  O(nv + nf). */
apsm_status apsm_rim_build(const apsm_mesh *mesh, const apsm_topology *topology,
                           apsm_rim *rim) APSM_NODISCARD;
void apsm_rim_free(apsm_rim *rim);

/* A place on the rim. */
typedef struct apsm_rim_point {
    uint32_t edge; /* of half_edge */
    double t;      /* from its start, 0, to its end, 1 */
    double x[3], distance2;
    apsm_surface_point on;
} apsm_rim_point;

/* The point of the rim closest to x; the rim has edges.  Ties go to the first.  O(n). */
void apsm_rim_closest(const apsm_rim *rim, const double x[3], apsm_rim_point *out);
/* Length of a loop, and of all. */
double apsm_rim_loop_length(const apsm_rim *rim, size_t loop);
double apsm_rim_length(const apsm_rim *rim);
/* The point `way` from the start of a loop, along it; way is taken modulo the length. */
void apsm_rim_walk(const apsm_rim *rim, size_t loop, double way, apsm_rim_point *out);
/* The unit direction of an edge. */
void apsm_rim_direction(const apsm_rim *rim, uint32_t edge, double d[3]);

/* Whether a point of the surface is on the rim: on a border edge, or on its vertex. */
bool apsm_rim_has(const apsm_rim *rim, const apsm_topology *topology, const apsm_surface_point *p);

#ifdef __cplusplus
}
#endif
#endif
