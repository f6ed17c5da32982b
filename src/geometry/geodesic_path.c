/* Shortest paths on a triangle mesh, from a point back to the source of the last search.
 *
 * Inside a face the path is the straight line towards the unfolded source (geodesic.c); it leaves
 * through the edge or corner that promises the shortest way, and at a vertex it goes on as the
 * vertex itself was reached.  Every piece must bring it nearer by the promised distance.  Where
 * the promises of neighbouring faces contradict each other too much (degenerate triangles, where
 * fronts meet), the path follows the tree in which vertices were first reached, which always ends
 * at the source. */
#include "geometry/geodesic.h"

#include <stdlib.h>
#include <string.h>

#include "geometry/geodesic_state.h"
#include "geometry/vec3.h"

/* Where the path has come to. */
typedef struct cursor {
    apsm_surface_point at;
    uint32_t entry;  /* half-edge of at.face just crossed, or APSM_NONE */
    uint32_t vertex; /* the path is at this vertex, or APSM_NONE */
    double level;    /* promised distance still to go */
} cursor;

static apsm_surface_point corner_point(uint32_t k)
{
    apsm_surface_point p = { .face = k / 3 };
    p.weight[k % 3] = 1.0;
    return p;
}

static double point_distance(const apsm_mesh *mesh, const apsm_surface_point *a,
                             const apsm_surface_point *b)
{
    double x[3], y[3];
    apsm_surface_position(mesh, a, x);
    apsm_surface_position(mesh, b, y);
    return sqrt(vec3_distance2(x, y));
}

/* Adds the piece from c->at to another point of the same face. */
static apsm_status add_step(const apsm_geodesic *g, apsm_geodesic_work *w, cursor *c,
                            const apsm_surface_point *to)
{
    if (w->steps == w->capacity) {
        const size_t capacity = 2 * w->capacity + 64;
        geodesic_step *step = realloc(w->step, capacity * sizeof *step);
        if (!step) return APSM_ERR_MEMORY;
        w->step = step;
        w->capacity = capacity;
    }
    geodesic_step *s = w->step + w->steps++;
    s->face = to->face;
    memcpy(s->from, c->at.weight, sizeof s->from);
    memcpy(s->to, to->weight, sizeof s->to);
    s->length = point_distance(g->mesh, &c->at, to);
    c->at = *to;
    return APSM_OK;
}

/* To a corner of the present face. */
static apsm_status to_corner(const apsm_geodesic *g, apsm_geodesic_work *w, cursor *c, uint32_t k)
{
    const apsm_surface_point to = corner_point(k);
    APSM_TRY(add_step(g, w, c, &to));
    c->vertex = g->mesh->F[k];
    c->level = w->node[c->vertex].d;
    return APSM_OK;
}

/* Through an edge into the face beyond; too near its end to tell, to the vertex there. */
static apsm_status cross_edge(const apsm_geodesic *g, apsm_geodesic_work *w, cursor *c,
                              const geodesic_exit *exit)
{
    const uint32_t k = exit->half_edge, twin = g->topology->twin[k];
    const double t = exit->t;
    if (!(t > 1e-9)) return to_corner(g, w, c, k);
    if (!(t < 1.0 - 1e-9)) return to_corner(g, w, c, geodesic_next(k));
    apsm_surface_point q = { .face = k / 3 };
    q.weight[k % 3] = 1.0 - t;
    q.weight[geodesic_next(k) % 3] = t;
    APSM_TRY(add_step(g, w, c, &q));
    c->at = (apsm_surface_point){ .face = twin / 3 };
    c->at.weight[twin % 3] = t;
    c->at.weight[geodesic_next(twin) % 3] = 1.0 - t;
    c->entry = twin;
    c->vertex = APSM_NONE;
    c->level = exit->distance - w->step[w->steps - 1].length;
    return APSM_OK;
}

/* The half-edge that starts at v in a face that also has vertex u, or APSM_NONE. */
static uint32_t shared_corner(const apsm_geodesic *g, uint32_t v, uint32_t u)
{
    const apsm_topology *t = g->topology;
    for (uint32_t i = t->corner_start[v]; i < t->corner_start[v + 1]; i++) {
        const uint32_t k = t->corner[i];
        if (g->mesh->F[geodesic_next(k)] == u || g->mesh->F[geodesic_previous(k)] == u) return k;
    }
    return APSM_NONE;
}

/* Along an edge from c->vertex to the neighbouring vertex u. */
static apsm_status along_edge(const apsm_geodesic *g, apsm_geodesic_work *w, cursor *c, uint32_t u)
{
    const uint32_t here = shared_corner(g, c->vertex, u);
    if (here == APSM_NONE) return APSM_ERR_GEOMETRY;
    const uint32_t next = geodesic_next(here);
    const apsm_surface_point to =
        corner_point(g->mesh->F[next] == u ? next : geodesic_previous(here));
    c->at = corner_point(here);
    APSM_TRY(add_step(g, w, c, &to));
    c->vertex = u;
    c->level = w->node[u].d;
    return APSM_OK;
}

/* Straight to the source, whose face the path has reached. */
static apsm_status arrive(const apsm_geodesic *g, apsm_geodesic_work *w, cursor *c)
{
    for (uint32_t k = 3 * w->source.face; k < 3 * w->source.face + 3; k++)
        if (c->vertex != APSM_NONE && g->mesh->F[k] == c->vertex) c->at = corner_point(k);
    APSM_TRY(add_step(g, w, c, &w->source));
    c->level = 0.0;
    return APSM_OK;
}

static geodesic_exit exit_of_vertex(const apsm_geodesic *g, const apsm_geodesic_work *w, uint32_t v)
{
    const uint32_t k = w->node[v].via;
    if (k == APSM_NONE) return (geodesic_exit){ .kind = EXIT_SOURCE };
    const apsm_surface_point p = corner_point(geodesic_previous(k));
    return geodesic_edge_exit(g, w, &p, k);
}

/* One piece further.  *done at the source; *stuck if nothing brings the path nearer. */
static apsm_status advance(const apsm_geodesic *g, apsm_geodesic_work *w, cursor *c, bool *done,
                           bool *stuck)
{
    const double level = c->level * (1.0 + 1e-9);
    geodesic_exit exit;
    if (c->vertex != APSM_NONE) {
        const uint32_t u = w->node[c->vertex].parent;
        if (u != APSM_NONE) {
            APSM_TRY(along_edge(g, w, c, u));
            *stuck = c->level > level;
            return APSM_OK;
        }
        exit = exit_of_vertex(g, w, c->vertex);
        if (exit.kind == EXIT_EDGE) c->at = corner_point(geodesic_previous(exit.half_edge));
    } else {
        exit = geodesic_best_exit(g, w, &c->at, c->entry);
    }
    *done = exit.kind == EXIT_SOURCE;
    *stuck = exit.kind == EXIT_NONE;
    if (*stuck) return APSM_OK;
    if (*done) return arrive(g, w, c);
    APSM_TRY(exit.kind == EXIT_EDGE ? cross_edge(g, w, c, &exit)
                                    : to_corner(g, w, c, exit.half_edge));
    *stuck = c->level > level;
    return APSM_OK;
}

/* From wherever the path is, by the nearest corner and then up the tree of first contacts. */
static apsm_status follow_tree(const apsm_geodesic *g, apsm_geodesic_work *w, cursor *c)
{
    if (c->vertex == APSM_NONE) {
        uint32_t best = 3 * c->at.face;
        for (uint32_t k = best + 1; k < 3 * c->at.face + 3; k++)
            if (w->node[g->mesh->F[k]].d < w->node[g->mesh->F[best]].d) best = k;
        APSM_TRY(to_corner(g, w, c, best));
    }
    while (w->node[c->vertex].tree != APSM_NONE)
        APSM_TRY(along_edge(g, w, c, w->node[c->vertex].tree));
    return arrive(g, w, c);
}

/* Fills w->step with the path from `from` to the source. */
static apsm_status trace(const apsm_geodesic *g, apsm_geodesic_work *w,
                         const apsm_surface_point *from)
{
    if (from->face >= g->mesh->nf) return APSM_ERR_ARG;
    cursor c = { *from, APSM_NONE, APSM_NONE, INFINITY };
    w->steps = 0;
    if (!(geodesic_best_exit(g, w, from, APSM_NONE).distance < INFINITY)) return APSM_ERR_GEOMETRY;
    const size_t limit = 4 * w->touches + 64;
    bool done = false, stuck = false;
    while (!done && !stuck) {
        APSM_TRY(advance(g, w, &c, &done, &stuck));
        if (w->steps > limit) stuck = true;
    }
    return done ? APSM_OK : follow_tree(g, w, &c);
}

apsm_status apsm_geodesic_walk(const apsm_geodesic *g, apsm_geodesic_work *w,
                               const apsm_surface_point *from, double keep, apsm_surface_point *to)
{
    APSM_TRY(trace(g, w, from));
    *to = *from;
    double left = fmax(keep, 0.0);
    for (size_t i = w->steps; i-- > 0; left -= w->step[i].length) {
        const geodesic_step *s = w->step + i;
        if (left > s->length) continue;
        const double t = s->length > 0.0 ? left / s->length : 0.0;
        to->face = s->face;
        for (int c = 0; c < 3; c++) to->weight[c] = t * s->from[c] + (1.0 - t) * s->to[c];
        break;
    }
    return APSM_OK;
}

apsm_status apsm_geodesic_path(const apsm_geodesic *g, apsm_geodesic_work *w,
                               const apsm_surface_point *from, size_t cap, double *X, size_t *n)
{
    APSM_TRY(trace(g, w, from));
    *n = w->steps + 1;
    for (size_t i = 0; i < *n && i < cap; i++) {
        const geodesic_step *s = w->step + (i > 0 ? i - 1 : 0);
        apsm_surface_point p = { .face = s->face };
        memcpy(p.weight, i > 0 ? s->to : s->from, sizeof p.weight);
        apsm_surface_position(g->mesh, &p, X + 3 * i);
    }
    return APSM_OK;
}
