/* Loops: every face that a loop passes is found by closest points along it, near enough to each
 * other that faces in a row share a corner.  The corners of those faces are a band that a walk from
 * vertex to vertex cannot cross.  What is reached from the query point is inside; a vertex of the
 * band is on the side of its loop on which most of its neighbours beyond the band say that inside
 * is: with t the loop's direction and n the normal, (n x t).(x - c), c the closest point of the
 * loop. */
#include "geometry/region.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/bvh.h"
#include "geometry/topology.h"
#include "geometry/vec3.h"

static const double step = 0.25; /* along a loop, in mean edges */
enum { DEEPEST = 12 };           /* halvings of a step */

void apsm_region_free(apsm_region *region)
{
    free(region->plane);
    free(region->sphere);
    free(region->point);
    free(region->in);
    free(region->loop_start);
    free(region->boundary);
    *region = (apsm_region){ 0 };
}

static void limit(double *field, double value)
{
    *field = fmin(*field, value);
}

static void limit_by_plane(const double plane[4], const apsm_mesh *mesh, double *field)
{
    for (size_t v = 0; v < mesh->nv; v++)
        limit(&field[v], vec3_dot(plane, mesh->V + 3 * v) - plane[3]); /* (R1) */
}

static void limit_by_sphere(const double sphere[4], const apsm_mesh *mesh, double *field)
{
    for (size_t v = 0; v < mesh->nv; v++)
        limit(&field[v], sqrt(vec3_distance2(mesh->V + 3 * v, sphere)) - sphere[3]); /* (R1) */
}

/* ---- paint ---------------------------------------------------------------------------------- */

/* distance (nv, out) of the vertices to the nearest point painted `in`; INFINITY without any.  A
 * point is a triangle whose corners coincide. */
static apsm_status distances_to_paint(const apsm_region *r, bool in, const apsm_mesh *mesh,
                                      double *distance)
{
    apsm_mesh points;
    apsm_bvh *tree = NULL;
    size_t n = 0;
    for (size_t v = 0; v < mesh->nv; v++) distance[v] = INFINITY;
    for (size_t k = 0; k < r->painted; k++) n += r->in[k] == in;
    if (n == 0) return APSM_OK;
    APSM_TRY(apsm_mesh_alloc(&points, n, n));
    n = 0;
    for (size_t k = 0; k < r->painted; k++) {
        if (r->in[k] != in) continue;
        memcpy(points.V + 3 * n, r->point + 3 * k, 3 * sizeof *points.V);
        for (size_t c = 0; c < 3; c++) points.F[3 * n + c] = (uint32_t)n;
        n++;
    }
    const apsm_status status = apsm_bvh_build_unsigned(&points, &tree);
    for (size_t v = 0; v < mesh->nv && status == APSM_OK; v++) {
        apsm_closest hit;
        apsm_bvh_closest(tree, mesh->V + 3 * v, INFINITY, &hit);
        distance[v] = sqrt(hit.distance2);
    }
    apsm_bvh_free(tree);
    apsm_mesh_free(&points);
    return status;
}

static apsm_status limit_by_paint(const apsm_region *r, const apsm_mesh *mesh, double *field)
{
    double *in = malloc(mesh->nv * sizeof *in + 1), *out = malloc(mesh->nv * sizeof *out + 1);
    apsm_status status = in && out ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = distances_to_paint(r, true, mesh, in);
    if (status == APSM_OK) status = distances_to_paint(r, false, mesh, out);
    for (size_t v = 0; v < mesh->nv && status == APSM_OK; v++)
        limit(&field[v], 0.5 * (out[v] - in[v])); /* (R2) */
    free(in);
    free(out);
    return status;
}

/* ---- loops ---------------------------------------------------------------------------------- */

typedef struct looping {
    const apsm_region *region;
    const apsm_mesh *mesh;
    apsm_bvh *tree;
    apsm_topology topology;
    double *VN;
    unsigned char *band;    /* nv: a corner of a face that a loop passes */
    unsigned char *reached; /* nv */
    uint32_t *queue;        /* nv */
    size_t *near_loop;      /* nv: the closest loop of a vertex ... */
    double *side;           /* nv: ... and on which side of it, times the distance */
    double *vote;           /* loops */
} looping;

static uint32_t face_at(const looping *l, const double x[3])
{
    apsm_closest hit;
    apsm_bvh_closest(l->tree, x, INFINITY, &hit);
    for (size_t k = 0; k < 3; k++) l->band[l->mesh->F[3 * (size_t)hit.on.face + k]] = 1;
    return hit.on.face;
}

static bool share_corner(const apsm_mesh *m, uint32_t f, uint32_t g)
{
    for (size_t k = 0; k < 9; k++)
        if (m->F[3 * (size_t)f + k / 3] == m->F[3 * (size_t)g + k % 3]) return true;
    return false;
}

/* Marks the faces between a and b, whose own are fa and fb. */
static void mark_between(const looping *l, const double a[3], uint32_t fa, const double b[3],
                         uint32_t fb, int depth)
{
    double middle[3];
    if (depth == 0 || share_corner(l->mesh, fa, fb)) return;
    for (size_t c = 0; c < 3; c++) middle[c] = 0.5 * (a[c] + b[c]);
    const uint32_t f = face_at(l, middle);
    mark_between(l, a, fa, middle, f, depth - 1);
    mark_between(l, middle, f, b, fb, depth - 1);
}

/* Ends of segment k of loop n, which is closed. */
static void segment(const apsm_region *r, size_t n, size_t k, const double **a, const double **b)
{
    const size_t first = r->loop_start[n], end = r->loop_start[n + 1];
    *a = r->boundary + 3 * k;
    *b = r->boundary + 3 * (k + 1 < end ? k + 1 : first);
}

static void mark_loop(const looping *l, size_t n, double length)
{
    const apsm_region *r = l->region;
    for (size_t k = r->loop_start[n]; k < r->loop_start[n + 1]; k++) {
        const double *a, *b;
        double x[3], y[3];
        segment(r, n, k, &a, &b);
        const size_t parts = 1 + (size_t)fmin(sqrt(vec3_distance2(a, b)) / length, 1e4);
        memcpy(x, a, sizeof x);
        uint32_t f = face_at(l, x);
        for (size_t i = 1; i <= parts; i++) {
            const double t = (double)i / (double)parts;
            for (int c = 0; c < 3; c++) y[c] = (1.0 - t) * a[c] + t * b[c];
            const uint32_t g = face_at(l, y);
            mark_between(l, x, f, y, g, DEEPEST);
            memcpy(x, y, sizeof x);
            f = g;
        }
    }
}

/* The closest loop of vertex v, and its side. */
static void find_side(const looping *l, size_t v)
{
    const apsm_region *r = l->region;
    const double *x = l->mesh->V + 3 * v;
    double best = INFINITY;
    for (size_t n = 0; n < r->loops; n++)
        for (size_t k = r->loop_start[n]; k < r->loop_start[n + 1]; k++) {
            const double *a, *b;
            double along[3], across[3], to[3];
            segment(r, n, k, &a, &b);
            const double d2 = vec3_segment_distance2(x, a, b);
            if (!(d2 < best)) continue;
            best = d2;
            vec3_sub(b, a, along);
            vec3_cross(l->VN + 3 * v, along, across);
            vec3_sub(x, a, to);
            l->near_loop[v] = n;
            l->side[v] = vec3_dot(across, to) < 0.0 ? -sqrt(d2) : sqrt(d2);
        }
}

/* The vertex outside the band nearest to the query point; nv if there is none. */
static size_t find_start(const looping *l)
{
    const double *query = l->region->query;
    size_t best = l->mesh->nv;
    double least = INFINITY;
    for (size_t v = 0; v < l->mesh->nv; v++) {
        const double d2 = vec3_distance2(query, l->mesh->V + 3 * v);
        if (!l->band[v] && d2 < least) least = d2, best = v;
    }
    return best;
}

/* Everything that is reached from the start without entering the band. */
static void flood(const looping *l, size_t start)
{
    const apsm_topology *t = &l->topology;
    size_t n = 0;
    l->queue[n++] = (uint32_t)start;
    l->reached[start] = 1;
    for (size_t i = 0; i < n; i++) {
        const uint32_t v = l->queue[i];
        for (uint32_t c = t->corner_start[v]; c < t->corner_start[v + 1]; c++)
            for (size_t k = 0; k < 3; k++) {
                const uint32_t w = l->mesh->F[3 * (size_t)(t->corner[c] / 3) + k];
                if (l->band[w] || l->reached[w]) continue;
                l->reached[w] = 1;
                l->queue[n++] = w;
            }
    }
}

/* Neighbours just beyond the band say which side of a loop is inside. */
static void count_votes(const looping *l)
{
    const apsm_mesh *m = l->mesh;
    for (size_t h = 0; h < 3 * m->nf; h++) {
        const uint32_t a = m->F[h], b = m->F[h % 3 == 2 ? h - 2 : h + 1];
        if (l->band[a] == l->band[b]) continue;
        const uint32_t v = l->band[a] ? b : a;
        const double says = l->side[v] < 0.0 ? -1.0 : 1.0;
        l->vote[l->near_loop[v]] += l->reached[v] ? says : -says;
    }
}

static bool parts_surface(const looping *l)
{
    for (size_t v = 0; v < l->mesh->nv; v++)
        if (!l->band[v] && !l->reached[v]) return true;
    return false;
}

static apsm_status sign_vertices(const looping *l, double *field)
{
    const size_t nv = l->mesh->nv, start = find_start(l);
    if (start == nv) return APSM_ERR_GEOMETRY;
    flood(l, start);
    if (!parts_surface(l)) return APSM_ERR_GEOMETRY;
    for (size_t v = 0; v < nv; v++) find_side(l, v);
    count_votes(l);
    for (size_t v = 0; v < nv; v++) { /* (R3) */
        const double inside = l->vote[l->near_loop[v]] < 0.0 ? -l->side[v] : l->side[v];
        const double away = fabs(l->side[v]);
        limit(&field[v], l->band[v] ? inside : l->reached[v] ? away : -away);
    }
    return APSM_OK;
}

static apsm_status limit_by_loops(const apsm_region *r, const apsm_mesh *mesh, double *field)
{
    const size_t nv = mesh->nv;
    looping l = { .region = r,
                  .mesh = mesh,
                  .VN = malloc(3 * nv * sizeof(double) + 1),
                  .band = calloc(nv + 1, 1),
                  .reached = calloc(nv + 1, 1),
                  .queue = malloc(nv * sizeof(uint32_t) + 1),
                  .near_loop = calloc(nv + 1, sizeof(size_t)),
                  .side = malloc(nv * sizeof(double) + 1),
                  .vote = calloc(r->loops, sizeof(double)) };
    const bool ok = l.VN && l.band && l.reached && l.queue && l.near_loop && l.side && l.vote;
    apsm_status status = ok ? apsm_bvh_build_unsigned(mesh, &l.tree) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_topology_build(mesh, &l.topology);
    if (status == APSM_OK) {
        apsm_mesh_vertex_normals(mesh, l.VN);
        for (size_t n = 0; n < r->loops; n++) mark_loop(&l, n, step * apsm_mesh_mean_edge(mesh));
        status = sign_vertices(&l, field);
    }
    apsm_topology_free(&l.topology);
    apsm_bvh_free(l.tree);
    free(l.VN);
    free(l.band);
    free(l.reached);
    free(l.queue);
    free(l.near_loop);
    free(l.side);
    free(l.vote);
    return status;
}

apsm_status apsm_region_field(const apsm_region *region, const apsm_mesh *mesh, double *field)
{
    for (size_t v = 0; v < mesh->nv; v++) field[v] = INFINITY;
    for (size_t k = 0; k < region->planes; k++) limit_by_plane(region->plane[k], mesh, field);
    for (size_t k = 0; k < region->spheres; k++) limit_by_sphere(region->sphere[k], mesh, field);
    if (region->painted) APSM_TRY(limit_by_paint(region, mesh, field));
    if (region->loops) APSM_TRY(limit_by_loops(region, mesh, field));
    return APSM_OK;
}
