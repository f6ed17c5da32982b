/* A short way between two points of a mesh, without a search: along the plane through both that
 * stands on the surface.  On a smooth piece such a section is nearly a geodesic; everywhere it is
 * a way on the surface, so its length bounds the distance from above. */
#include "geometry/geodesic.h"

#include <string.h>

#include "geometry/face.h"
#include "geometry/geodesic_state.h"

typedef struct plane {
    const apsm_mesh *mesh;
    double x[3], m[3]; /* a point of it, its normal (any length) */
} plane;

static double height(const plane *p, uint32_t v)
{
    double d[3];
    vec3_sub(p->mesh->V + 3 * (size_t)v, p->x, d);
    return vec3_dot(p->m, d);
}

/* Where the plane cuts half-edge k, whose ends are at heights a and b of different sides. */
static void cut(const plane *p, uint32_t k, double a, double b, double q[3])
{
    const double *A = p->mesh->V + 3 * (size_t)p->mesh->F[k],
                 *B = p->mesh->V + 3 * (size_t)p->mesh->F[geodesic_next(k)], t = a / (a - b);
    for (int c = 0; c < 3; c++) q[c] = A[c] + t * (B[c] - A[c]);
}

/* The half-edge by which the section leaves face f towards y, and where (q); APSM_NONE if the plane
 * does not cut the face. */
static uint32_t first_edge(const plane *p, uint32_t f, const double y[3], double q[3])
{
    double best = -INFINITY, way[3], h[3];
    uint32_t out = APSM_NONE;
    vec3_sub(y, p->x, way);
    for (uint32_t k = 0; k < 3; k++) h[k] = height(p, p->mesh->F[3 * f + k]);
    for (uint32_t k = 0; k < 3; k++) {
        const double a = h[k], b = h[(k + 1) % 3];
        double at[3], d[3];
        if ((a >= 0.0) == (b >= 0.0)) continue;
        cut(p, 3 * f + k, a, b, at);
        vec3_sub(at, p->x, d);
        if (!(vec3_dot(d, way) > best)) continue;
        best = vec3_dot(d, way);
        out = 3 * f + k;
        memcpy(q, at, sizeof at);
    }
    return out;
}

/* The half-edge by which the section, come in through `in`, leaves the face, and where. */
static uint32_t next_edge(const plane *p, uint32_t in, double q[3])
{
    const uint32_t *F = p->mesh->F, next = geodesic_next(in), previous = geodesic_previous(in);
    const double a = height(p, F[in]), b = height(p, F[next]), c = height(p, F[previous]);
    const bool beside_start = (c >= 0.0) == (a >= 0.0);
    if (beside_start)
        cut(p, next, b, c, q);
    else
        cut(p, previous, c, a, q);
    return beside_start ? next : previous;
}

double apsm_geodesic_section(const apsm_geodesic *g, const apsm_surface_point *from,
                             const apsm_surface_point *to, double limit)
{
    plane p = { .mesh = g->mesh };
    double y[3], way[3], n[3], n2[3], q[3], before[3], length = 0.0;
    apsm_surface_position(g->mesh, from, p.x);
    apsm_surface_position(g->mesh, to, y);
    vec3_sub(y, p.x, way);
    if (from->face == to->face) return vec3_norm(way) <= limit ? vec3_norm(way) : INFINITY;
    face_normal(g->mesh, from->face, n);
    face_normal(g->mesh, to->face, n2);
    vec3_add_scaled(n, 1.0, n2);
    vec3_cross(way, n, p.m);
    memcpy(before, p.x, sizeof before);
    uint32_t k = first_edge(&p, from->face, y, q);
    for (size_t steps = 0; k != APSM_NONE && steps < g->mesh->nf; steps++) {
        const uint32_t in = g->topology->twin[k];
        length += sqrt(vec3_distance2(before, q));
        if (in == APSM_NONE || !(length <= limit)) return INFINITY;
        memcpy(before, q, sizeof before);
        if (in / 3 == to->face) {
            length += sqrt(vec3_distance2(q, y));
            return length <= limit ? length : INFINITY;
        }
        k = next_edge(&p, in, q);
    }
    return INFINITY;
}
