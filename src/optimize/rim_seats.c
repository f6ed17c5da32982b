#include "optimize/rim_seats.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"

enum { LEAST = 3, SIX = 6 };

/* Way along a loop to its vertex farthest from the centroid: the first place, whatever the order of
 * vertices. */
static double first_place(const apsm_rim *rim, size_t loop, const double centroid[3])
{
    const apsm_mesh *m = rim->mesh;
    double way = 0.0, best = -1.0, at = 0.0;
    for (uint32_t e = rim->loop_start[loop]; e < rim->loop_start[loop + 1]; e++) {
        const uint32_t h = rim->half_edge[e], g = h % 3 == 2 ? h - 2 : h + 1;
        const double *a = m->V + 3 * (size_t)m->F[h], *b = m->V + 3 * (size_t)m->F[g];
        const double d2 = vec3_distance2(a, centroid);
        if (d2 > best) best = d2, at = way;
        way += sqrt(vec3_distance2(a, b));
    }
    return at;
}

/* The particle nearest to x that has no seat yet; J if all have. */
static size_t nearest_free(size_t J, const double *T, const bool *seated, const double x[3])
{
    size_t best = J;
    double least = INFINITY;
    for (size_t j = 0; j < J; j++) {
        const double d2 = vec3_distance2(x, T + 3 * j);
        if (!seated[j] && d2 < least) least = d2, best = j;
    }
    return best;
}

static void seat_loop(const apsm_shape *shape, size_t loop, double h, size_t J, double *T,
                      bool *seated)
{
    const apsm_rim *rim = &shape->rim;
    const double length = apsm_rim_loop_length(rim, loop), places = floor(length / h + 0.5);
    double centroid[3];
    if (places < LEAST) return;
    apsm_mesh_centroid(&shape->mesh, centroid);
    const double first = first_place(rim, loop, centroid);
    for (double k = 0.0; k < places; k++) {
        apsm_rim_point p;
        apsm_rim_walk(rim, loop, first + length * k / places, &p);
        const size_t j = nearest_free(J, T, seated, p.x);
        if (j == J) return;
        memcpy(T + 3 * j, p.x, sizeof p.x);
        seated[j] = true;
    }
}

/* Half-way to the mean of the six nearest of those that are not on the rim. */
static void send_inwards(const apsm_shape *shape, size_t J, const bool *on, size_t j, double *T)
{
    double d2[SIX], mean[3] = { 0.0, 0.0, 0.0 };
    size_t near[SIX], n = 0;
    for (size_t k = 0; k < J; k++) {
        if (k == j || on[k]) continue;
        const double d = vec3_distance2(T + 3 * j, T + 3 * k);
        size_t at = n < SIX ? n++ : SIX;
        for (; at > 0 && d2[at - 1] > d; at--)
            if (at < SIX) d2[at] = d2[at - 1], near[at] = near[at - 1];
        if (at < SIX) d2[at] = d, near[at] = k;
    }
    if (n == 0) return;
    for (size_t k = 0; k < n; k++) vec3_add_scaled(mean, 0.5 / (double)n, T + 3 * near[k]);
    vec3_add_scaled(mean, 0.5, T + 3 * j);
    apsm_closest c;
    apsm_bvh_closest(shape->bvh, mean, INFINITY, &c);
    memcpy(T + 3 * j, c.x, sizeof c.x);
}

apsm_status apsm_seat_rim(const apsm_shape *shape, size_t J, double *T)
{
    const double h = apsm_expected_spacing(apsm_mesh_area(&shape->mesh), J);
    bool *seated = calloc(J, sizeof *seated), *on = calloc(J, sizeof *on);
    if (seated && on) {
        for (size_t loop = 0; loop < shape->rim.loops; loop++)
            seat_loop(shape, loop, h, J, T, seated);
        apsm_shape_find_on_rim(shape, J, T, on);
        for (size_t j = 0; j < J; j++)
            if (on[j] && !seated[j]) send_inwards(shape, J, on, j, T);
    }
    const apsm_status status = seated && on ? APSM_OK : APSM_ERR_MEMORY;
    free(seated);
    free(on);
    return status;
}
