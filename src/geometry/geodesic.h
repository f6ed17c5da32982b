/* geodesic.h -- distances and paths along a triangle mesh from one point, within a radius.
 *
 * Nothing of size V x V is ever made: a query costs O(m log m) for the m vertices within the
 * radius, and scratch is reset in O(m).  Distances come from fast marching with circular
 * wavefronts (method and accuracy: src/geometry/geodesic.c); paths go straight through the faces
 * they cross.  Any triangles will do: open, with handles, in several components. */
#ifndef APSM_GEODESIC_H
#define APSM_GEODESIC_H

#include "apsm/mesh.h"
#include "geometry/topology.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_geodesic apsm_geodesic;           /* the mesh prepared; shared, read-only */
typedef struct apsm_geodesic_work apsm_geodesic_work; /* scratch of one thread */

/* mesh and topology are borrowed and must outlive the result.  72 bytes per face. */
apsm_status apsm_geodesic_build(const apsm_mesh *mesh, const apsm_topology *topology,
                                apsm_geodesic **g) APSM_NODISCARD;
void apsm_geodesic_free(apsm_geodesic *g);
const apsm_mesh *apsm_geodesic_mesh(const apsm_geodesic *g);
const apsm_topology *apsm_geodesic_topology(const apsm_geodesic *g);
/* A length of about an edge: what a search looks beyond its radius. */
double apsm_geodesic_margin(const apsm_geodesic *g);

/* Scratch that fits g (and any other mesh with no more vertices). */
apsm_status apsm_geodesic_work_new(const apsm_geodesic *g, apsm_geodesic_work **w) APSM_NODISCARD;
void apsm_geodesic_work_free(apsm_geodesic_work *w);

/* Computes distances from source to everything within radius (INFINITY: the whole component).
 * The result stays in w until the next call. */
apsm_status apsm_geodesic_from(const apsm_geodesic *g, const apsm_surface_point *source,
                               double radius, apsm_geodesic_work *w) APSM_NODISCARD;

/* Widens the last search to a larger radius; costs only what is new.  false once the component
 * is exhausted: a yet larger radius finds no more. */
bool apsm_geodesic_extend(const apsm_geodesic *g, double radius, apsm_geodesic_work *w);

/* Distance of a vertex or of any surface point from the last source; INFINITY beyond the
 * radius.  Points close to the source (sharing a face or an edge-adjacent face) are exact. */
double apsm_geodesic_vertex_distance(const apsm_geodesic_work *w, uint32_t v);
double apsm_geodesic_distance(const apsm_geodesic *g, const apsm_geodesic_work *w,
                              const apsm_surface_point *to);

/* As above, but widens the search until `to` is reached; INFINITY only on another component. */
double apsm_geodesic_reach(const apsm_geodesic *g, apsm_geodesic_work *w,
                           const apsm_surface_point *to);

/* Length of a way from one point to another that follows the plane through both across the surface:
 * no less than their distance, and on smooth pieces hardly more.  INFINITY if that is longer than
 * limit or does not arrive.  O(faces passed), no scratch. */
double apsm_geodesic_section(const apsm_geodesic *g, const apsm_surface_point *from,
                             const apsm_surface_point *to, double limit);

/* nearest (nv) <- min(nearest, distance from source): the distance to a set of sources that grows
 * by one.  Explores only where the new source is nearer, so that n sources cost O(nv log n) in
 * all instead of O(n nv).  Start with INFINITY everywhere.  Other results in w are void. */
apsm_status apsm_geodesic_add_source(const apsm_geodesic *g, const apsm_surface_point *source,
                                     double *nearest, apsm_geodesic_work *w) APSM_NODISCARD;

/* The point at geodesic distance `keep` from the last source on the path that runs from `from`
 * to the source; `from` itself if it is nearer than that.  APSM_ERR_GEOMETRY if `from` was not
 * reached. */
apsm_status apsm_geodesic_walk(const apsm_geodesic *g, apsm_geodesic_work *w,
                               const apsm_surface_point *from, double keep,
                               apsm_surface_point *to) APSM_NODISCARD;

/* The path from `from` to the source as a polyline across faces: at most cap points X (cap x 3);
 * *n is the number needed. */
apsm_status apsm_geodesic_path(const apsm_geodesic *g, apsm_geodesic_work *w,
                               const apsm_surface_point *from, size_t cap, double *X,
                               size_t *n) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
