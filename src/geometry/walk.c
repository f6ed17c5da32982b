/* Each step goes to the nearest of the faces that share what the point lies on, an edge or a
 * corner, and only if that is nearer; inside a face there is none. */
#include "geometry/walk.h"

#include "geometry/triangle.h"

/* Whether the face is nearer than what is known; then it is known. */
static bool is_nearer(const apsm_mesh *mesh, const double x[3], uint32_t face, apsm_closest *best)
{
    const triangle t = get_triangle(mesh, face);
    double w[3] = { 0 };
    const double d2 = closest_on_triangle(&t, x, w);
    if (!(d2 < best->distance2)) return false;
    best->distance2 = d2;
    best->on.face = face;
    for (int c = 0; c < 3; c++) {
        best->on.weight[c] = w[c];
        best->x[c] = w[0] * t.p[0][c] + w[1] * t.p[1][c] + w[2] * t.p[2][c];
    }
    return true;
}

/* The faces next to where `at` lies. */
static bool step(const apsm_mesh *mesh, const apsm_topology *topology, const double x[3],
                 apsm_closest *at)
{
    const size_t first = 3 * (size_t)at->on.face;
    int last, other;
    const int corners = count_corners(at->on.weight, &last, &other);
    if (corners == 3) return false;
    if (corners == 2) {
        const uint32_t twin = topology->twin[first + (size_t)((other + 1) % 3)];
        return twin != APSM_NONE && is_nearer(mesh, x, twin / 3, at);
    }
    bool nearer = false;
    const uint32_t v = mesh->F[first + (size_t)last], *start = topology->corner_start;
    for (uint32_t i = start[v]; i < start[v + 1]; i++)
        nearer |= is_nearer(mesh, x, topology->corner[i] / 3, at);
    return nearer;
}

void apsm_walk_closest(const apsm_mesh *mesh, const apsm_topology *topology, const double x[3],
                       uint32_t face, apsm_closest *out)
{
    *out = (apsm_closest){ .distance2 = INFINITY };
    (void)is_nearer(mesh, x, face, out);
    while (step(mesh, topology, x, out)) {
    }
}
