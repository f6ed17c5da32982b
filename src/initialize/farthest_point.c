/* Farthest-point sampling (Gonzalez 1985; on surfaces by fast marching: Peyre & Cohen 2006).  The
 * distance to the set of samples is kept for every point and lowered by each new sample; on a mesh
 * a sample's front stops where an earlier sample is nearer, so that J samples cost little more
 * than one search over the surface. */
#include "initialize/farthest_point.h"

#include <math.h>

static size_t argmax(size_t n, const double *x)
{
    size_t best = 0;
    for (size_t i = 1; i < n; i++)
        if (x[i] > x[best]) best = i;
    return best;
}

apsm_status apsm_farthest_points(size_t n, const double *D, size_t first, size_t J, uint32_t *order,
                                 double *radius, double *nearest)
{
    if (J > n || first >= n) return APSM_ERR_ARG;
    for (size_t i = 0; i < n; i++) nearest[i] = INFINITY;
    for (size_t k = 0; k < J; k++) {
        const size_t v = k ? argmax(n, nearest) : first;
        order[k] = (uint32_t)v;
        if (radius) radius[k] = nearest[v];
        for (size_t i = 0; i < n; i++) nearest[i] = fmin(nearest[i], D[v * n + i]);
        nearest[v] = -1.0; /* taken, even if others coincide with it */
    }
    for (size_t k = 0; k < J; k++) nearest[order[k]] = 0.0;
    return APSM_OK;
}

apsm_status apsm_surface_vertex(const apsm_topology *topology, uint32_t v,
                                apsm_surface_point *point)
{
    if (v >= topology->nv || topology->corner_start[v] == topology->corner_start[v + 1])
        return APSM_ERR_GEOMETRY;
    const uint32_t k = topology->corner[topology->corner_start[v]];
    *point = (apsm_surface_point){ .face = k / 3 };
    point->weight[k % 3] = 1.0;
    return APSM_OK;
}

apsm_status apsm_farthest_vertices(const apsm_geodesic *g, apsm_geodesic_work *w, uint32_t first,
                                   size_t J, uint32_t *order, double *radius, double *nearest)
{
    const apsm_topology *t = apsm_geodesic_topology(g);
    size_t available = 0;
    for (size_t v = 0; v < t->nv; v++) {
        const bool used = t->corner_start[v] < t->corner_start[v + 1];
        nearest[v] = used ? INFINITY : -1.0;
        available += used;
    }
    if (J > available) return APSM_ERR_GEOMETRY;
    for (size_t k = 0; k < J; k++) {
        const uint32_t v = k ? (uint32_t)argmax(t->nv, nearest) : first;
        apsm_surface_point p;
        APSM_TRY(apsm_surface_vertex(t, v, &p));
        order[k] = v;
        if (radius) radius[k] = nearest[v];
        APSM_TRY(apsm_geodesic_add_source(g, &p, nearest, w));
        nearest[v] = -1.0;
    }
    for (size_t k = 0; k < J; k++) nearest[order[k]] = 0.0;
    return APSM_OK;
}
