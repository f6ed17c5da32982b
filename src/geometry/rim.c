#include "geometry/rim.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"

static uint32_t next_of(uint32_t h)
{
    return h % 3 == 2 ? h - 2 : h + 1;
}

/* Loop after loop.  from (nv): the border's half-edge that starts at a vertex, or APSM_NONE; it is
 * used up. */
static void walk_loops(apsm_rim *rim, uint32_t *from)
{
    const apsm_mesh *m = rim->mesh;
    size_t n = 0;
    for (size_t v = 0; v < m->nv; v++) {
        if (from[v] == APSM_NONE) continue;
        rim->loop_start[rim->loops++] = (uint32_t)n;
        for (size_t a = v; from[a] != APSM_NONE;) {
            const uint32_t h = from[a];
            from[a] = APSM_NONE;
            rim->half_edge[n++] = h;
            a = m->F[next_of(h)];
        }
    }
    rim->loop_start[rim->loops] = (uint32_t)n;
    rim->n = n;
}

apsm_status apsm_rim_build(const apsm_mesh *mesh, const apsm_topology *topology, apsm_rim *rim)
{
    size_t n = 0;
    for (size_t h = 0; h < 3 * mesh->nf; h++) n += topology->twin[h] == APSM_NONE;
    *rim = (apsm_rim){ .mesh = mesh };
    if (n == 0) return APSM_OK;
    uint32_t *from = malloc(mesh->nv * sizeof *from);
    rim->half_edge = malloc(n * sizeof *rim->half_edge);
    rim->loop_start = malloc((n + 1) * sizeof *rim->loop_start);
    rim->on = calloc(mesh->nv, 1);
    const bool ok = from && rim->half_edge && rim->loop_start && rim->on;
    if (ok) {
        memset(from, 0xff, mesh->nv * sizeof *from);
        for (uint32_t h = 0; h < 3 * mesh->nf; h++)
            if (topology->twin[h] == APSM_NONE) {
                from[mesh->F[h]] = h;
                rim->on[mesh->F[h]] = rim->on[mesh->F[next_of(h)]] = 1;
            }
        walk_loops(rim, from);
    }
    free(from);
    if (!ok) apsm_rim_free(rim);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

void apsm_rim_free(apsm_rim *rim)
{
    free(rim->half_edge);
    free(rim->loop_start);
    free(rim->on);
    *rim = (apsm_rim){ 0 };
}

static void ends(const apsm_rim *rim, uint32_t edge, const double **a, const double **b)
{
    const apsm_mesh *m = rim->mesh;
    const uint32_t h = rim->half_edge[edge];
    *a = m->V + 3 * (size_t)m->F[h];
    *b = m->V + 3 * (size_t)m->F[next_of(h)];
}

static double edge_length(const apsm_rim *rim, uint32_t edge)
{
    const double *a, *b;
    ends(rim, edge, &a, &b);
    return sqrt(vec3_distance2(a, b));
}

/* The place at t of an edge. */
static void place(const apsm_rim *rim, uint32_t edge, double t, apsm_rim_point *p)
{
    const double *a, *b;
    const uint32_t h = rim->half_edge[edge];
    ends(rim, edge, &a, &b);
    p->edge = edge;
    p->t = t;
    for (int c = 0; c < 3; c++) p->x[c] = (1.0 - t) * a[c] + t * b[c];
    p->on = (apsm_surface_point){ .face = h / 3 };
    p->on.weight[h % 3] = 1.0 - t;
    p->on.weight[next_of(h) % 3] = t;
}

void apsm_rim_closest(const apsm_rim *rim, const double x[3], apsm_rim_point *out)
{
    double best = INFINITY, best_t = 0.0;
    uint32_t at = 0;
    for (uint32_t e = 0; e < rim->n; e++) {
        const double *a, *b;
        double d[3], to[3];
        ends(rim, e, &a, &b);
        vec3_sub(b, a, d);
        vec3_sub(x, a, to);
        const double length2 = vec3_dot(d, d), along = vec3_dot(to, d);
        const double t = length2 > 0.0 ? fmin(fmax(along / length2, 0.0), 1.0) : 0.0;
        vec3_add_scaled(to, -t, d);
        const double d2 = vec3_dot(to, to);
        if (d2 < best) best = d2, best_t = t, at = e;
    }
    place(rim, at, best_t, out);
    out->distance2 = best;
}

double apsm_rim_loop_length(const apsm_rim *rim, size_t loop)
{
    double length = 0.0;
    for (uint32_t e = rim->loop_start[loop]; e < rim->loop_start[loop + 1]; e++)
        length += edge_length(rim, e);
    return length;
}

double apsm_rim_length(const apsm_rim *rim)
{
    double length = 0.0;
    for (size_t loop = 0; loop < rim->loops; loop++) length += apsm_rim_loop_length(rim, loop);
    return length;
}

void apsm_rim_walk(const apsm_rim *rim, size_t loop, double way, apsm_rim_point *out)
{
    const double length = apsm_rim_loop_length(rim, loop);
    const uint32_t last = rim->loop_start[loop + 1] - 1;
    double left = fmod(way, length);
    if (left < 0.0) left += length;
    uint32_t e = rim->loop_start[loop];
    for (; e < last && left > edge_length(rim, e); e++) left -= edge_length(rim, e);
    const double here = edge_length(rim, e);
    place(rim, e, here > 0.0 ? fmin(left / here, 1.0) : 0.0, out);
    out->distance2 = 0.0;
}

void apsm_rim_direction(const apsm_rim *rim, uint32_t edge, double d[3])
{
    const double *a, *b;
    ends(rim, edge, &a, &b);
    vec3_sub(b, a, d);
    vec3_normalise(d);
}

bool apsm_rim_has(const apsm_rim *rim, const apsm_topology *topology, const apsm_surface_point *p)
{
    const uint32_t *F = rim->mesh ? rim->mesh->F + 3 * (size_t)p->face : NULL;
    if (rim->n == 0) return false;
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t next = (k + 1) % 3, apex = (k + 2) % 3;
        if (p->weight[k] >= 1.0 && rim->on[F[k]]) return true;
        if (!(p->weight[apex] > 0.0) && p->weight[k] > 0.0 && p->weight[next] > 0.0 &&
            topology->twin[3 * p->face + k] == APSM_NONE)
            return true;
    }
    return false;
}
