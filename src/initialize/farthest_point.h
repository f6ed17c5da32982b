/* farthest_point.h -- well-spread samples of a surface: the next one is always the point farthest
 * from all before it.  The paper's initialisation (docs/method.md, "Initialisation"). */
#ifndef APSM_FARTHEST_POINT_H
#define APSM_FARTHEST_POINT_H

#include "geometry/geodesic.h"

#ifdef __cplusplus
extern "C" {
#endif

/* On a given distance matrix D (n x n, row-major): order (J, out) are the samples, from `first`
 * on; radius[k] (J, NULL if not wanted) is the distance of sample k from those before it when it
 * was chosen, INFINITY for the first.  Ties: lowest index.  nearest is scratch (n).
 * J <= n, first < n.  O(J n). */
apsm_status apsm_farthest_points(size_t n, const double *D, size_t first, size_t J, uint32_t *order,
                                 double *radius, double *nearest) APSM_NODISCARD;

/* The same among the vertices of a mesh by geodesic distance; vertices without a face do not
 * count.  Unreached components come first.  nearest (nv) is scratch and returns every vertex's
 * distance to the samples.  APSM_ERR_GEOMETRY if the mesh has fewer than J vertices with faces.
 * O(nv (J + log nv)). */
apsm_status apsm_farthest_vertices(const apsm_geodesic *g, apsm_geodesic_work *w, uint32_t first,
                                   size_t J, uint32_t *order, double *radius,
                                   double *nearest) APSM_NODISCARD;

/* Vertex v as a surface point: a corner of its first face.  APSM_ERR_GEOMETRY without a face. */
apsm_status apsm_surface_vertex(const apsm_topology *topology, uint32_t v,
                                apsm_surface_point *point) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
