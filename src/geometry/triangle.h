/* triangle.h -- the closest point of a triangle, in double precision. */
#ifndef APSM_GEOMETRY_TRIANGLE_H
#define APSM_GEOMETRY_TRIANGLE_H

#include <math.h>
#include <string.h>

#include "apsm/mesh.h"
#include "geometry/vec3.h"

typedef struct triangle {
    double p[3][3];    /* corners */
    double n[3];       /* (p1 - p0) x (p2 - p0) */
    double inverse_n2; /* 1 / |n|^2; 0: no area to speak of, its edges are all of it */
} triangle;

static inline void get_corners(const apsm_mesh *mesh, uint32_t face, double p[3][3])
{
    const uint32_t *F = mesh->F + 3 * (size_t)face;
    for (int k = 0; k < 3; k++) memcpy(p[k], mesh->V + 3 * (size_t)F[k], sizeof p[k]);
}

static inline triangle get_triangle(const apsm_mesh *mesh, uint32_t face)
{
    triangle t;
    double e[3][3], e2[3];
    get_corners(mesh, face, t.p);
    for (int k = 0; k < 3; k++) {
        vec3_sub(t.p[(k + 1) % 3], t.p[k], e[k]);
        e2[k] = vec3_dot(e[k], e[k]);
    }
    vec3_cross(e[2], e[0], t.n); /* (p0-p2) x (p1-p0) = (p1-p0) x (p2-p0) */
    const double n2 = vec3_dot(t.n, t.n);
    /* sin^2 of the corner's angle: below this n is rounding */
    t.inverse_n2 = n2 > 1e-24 * e2[0] * e2[2] ? 1.0 / n2 : 0.0;
    return t;
}

/* Closest point p_k + t (p_k+1 - p_k) of edge k; its squared distance. */
static inline double closest_on_edge(const triangle *t, int k, const double x[3], double *along)
{
    const double *p = t->p[k], *q = t->p[(k + 1) % 3];
    double e[3], px[3];
    vec3_sub(q, p, e);
    vec3_sub(x, p, px);
    const double e2 = vec3_dot(e, e), s = e2 > 0.0 ? vec3_dot(px, e) * (1.0 / e2) : 0.0;
    if (!(s > 0.0)) {
        *along = 0.0;
        return vec3_dot(px, px);
    }
    if (s >= 1.0) {
        *along = 1.0;
        return vec3_distance2(x, q);
    }
    *along = s;
    vec3_add_scaled(px, -s, e);
    return vec3_dot(px, px);
}

/* Squared distance of x to t; the weights w of the closest point are exactly 0 for the corners
 * it does not depend on, which tells vertex, edge and interior apart.
 *
 * h_k = n . (e_k x (x - p_k)) is |n| |e_k| times the way from edge k inward.  If all are positive
 * the foot on the plane is inside; otherwise the closest point lies on an edge with h_k <= 0,
 * also at obtuse corners.  Cross products instead of the usual Gram matrix: the error is
 * eps / sin(angle), not eps / sin^2, so slivers keep their digits. */
static inline double closest_on_triangle(const triangle *t, const double x[3], double w[3])
{
    double h[3], px[3], along = 0.0, best = INFINITY;
    for (int k = 0; k < 3; k++) {
        double e[3], m[3];
        vec3_sub(t->p[(k + 1) % 3], t->p[k], e);
        vec3_sub(x, t->p[k], px);
        vec3_cross(e, px, m);
        h[k] = vec3_dot(t->n, m);
    }
    if (t->inverse_n2 > 0.0 && h[0] > 0.0 && h[1] > 0.0 && h[2] > 0.0) {
        const double height = vec3_dot(t->n, px), sum = h[0] + h[1] + h[2];
        for (int k = 0; k < 3; k++) w[k] = h[(k + 1) % 3] / sum;
        return height * height * t->inverse_n2;
    }
    for (int k = 0; k < 3; k++) {
        double s;
        if (h[k] > 0.0 && t->inverse_n2 > 0.0) continue;
        const double d2 = closest_on_edge(t, k, x, &s);
        if (!(d2 < best)) continue;
        best = d2;
        along = s;
        w[k] = 1.0 - along;
        w[(k + 1) % 3] = along;
        w[(k + 2) % 3] = 0.0;
    }
    return best;
}

/* On how many corners a point of a triangle depends: 3 inside, 2 on an edge, 1 at a corner; the
 * last of these, and of the others. */
static inline int count_corners(const double w[3], int *last, int *other)
{
    int count = 0;
    *last = *other = 0;
    for (int k = 0; k < 3; k++) {
        count += w[k] > 0.0;
        *(w[k] > 0.0 ? last : other) = k;
    }
    return count;
}

#endif
