/* Geodesic distance on a triangle mesh by fast marching with circular wavefronts (after Kimmel &
 * Sethian 1998; the circular front: Novotni & Klein 2002).
 *
 * The distances a, b at the ends of an edge determine where the source lies in the plane of the
 * triangle beyond it, unfolded:
 *   s = (L^2 + a^2 - b^2) / 2L,  h^2 = a^2 - s^2                                            (1)
 * for an edge from (0, 0) to (L, 0) and the source at (s, -h).  If the straight line from there
 * to the third corner (x, y), y > 0, crosses the edge,
 *   d = sqrt((x - s)^2 + (y + h)^2);                                                       (2)
 * otherwise the path follows an edge, d = min(a + |..|, b + |..|).  On a flat or developable
 * piece (2) is exact; elsewhere it treats the front between two vertices as a circle.
 *
 * (2) is monotone in a and b: the line's direction is a positive combination of those to the ends.
 * So vertices may be corrected after they were closed -- which obtuse triangles need, where a
 * corner is reached before an end of the edge it depends on -- and distances only ever fall
 * towards the same values whatever the order.  Corrections are counted and bounded.
 *
 * Behind a border vertex or a saddle (angles > 2 pi) paths bend and the front is a circle about
 * that vertex: `base` is its distance, and (1) works on a - base, b - base.
 *
 * Where the two ends of an edge were reached by different ways, (1) sees a source that is none and
 * (2) comes out too short.  The vertex beyond the edge gives it away, and the two edges beyond it
 * are asked instead (through_edge): without this the cube is wrong by 5 % and paths by 30 %.
 *
 * Accuracy (tests/unit/geometry/test_geodesic.c, benchmarks): flat pieces exact; on refined
 * spheres mean / max 0.3 / 1.2 % at 2562 vertices, 0.15 / 0.7 % at 10242, against the smooth
 * sphere.  About 0.25 microseconds per vertex reached. */
#include "geometry/geodesic.h"

#include <stdlib.h>
#include <string.h>

#include "geometry/geodesic_state.h"
#include "geometry/stored.h"
#include "geometry/vec3.h"

/* A distance must fall by more than rounding to count: relative. */
#define GEODESIC_FALL 1e-12
/* ... and by so much after many corrections. */
#define GEODESIC_WORTH 2e-3
/* Fronts agree if they differ by less at the vertex beyond an edge: in units of the edge. */
#define GEODESIC_AGREE 0.1

static const double *vertex(const apsm_geodesic *g, uint32_t v)
{
    return g->mesh->V + 3 * (size_t)v;
}

/* ---- preparation ---- */

static geodesic_hinge make_hinge(const apsm_geodesic *g, uint32_t k)
{
    const uint32_t *F = g->mesh->F;
    const double *a = vertex(g, F[k]);
    double e[3], f[3], n[3];
    vec3_sub(vertex(g, F[geodesic_next(k)]), a, e);
    vec3_sub(vertex(g, F[geodesic_previous(k)]), a, f);
    vec3_cross(e, f, n);
    const double length = vec3_norm(e);
    geodesic_hinge hinge = { length, 0.0, vec3_norm(f) };
    if (length > 0.0) {
        hinge.x = vec3_dot(e, f) / length;
        hinge.y = vec3_norm(n) / length;
    }
    if (g->topology->twin[k] == APSM_NONE) hinge.y = -hinge.y;
    return hinge;
}

/* Sum of the angles at v, or INFINITY at a border. */
static double angle_sum(const apsm_geodesic *g, uint32_t v)
{
    const apsm_topology *t = g->topology;
    double sum = 0.0;
    for (uint32_t i = t->corner_start[v]; i < t->corner_start[v + 1]; i++) {
        const uint32_t k = t->corner[i];
        if (t->twin[k] == APSM_NONE || t->twin[geodesic_previous(k)] == APSM_NONE) return INFINITY;
        sum += atan2(g->hinge[k].y, g->hinge[k].x);
    }
    return sum;
}

static void prepare(apsm_geodesic *g)
{
    const double full = 8.0 * atan(1.0);
    double longest = 0.0, sum = 0.0;
    for (uint32_t k = 0; k < 3 * g->mesh->nf; k++) {
        g->hinge[k] = make_hinge(g, k);
        longest = fmax(longest, g->hinge[k].length);
        sum += g->hinge[k].length;
    }
    for (uint32_t v = 0; v < g->mesh->nv; v++) g->bends[v] = angle_sum(g, v) > full + 1e-6;
    const double count = 3.0 * (double)g->mesh->nf;
    g->margin = count > 0.0 ? fmin(longest, 2.0 * sum / count) : 0.0;
}

apsm_status apsm_geodesic_build(const apsm_mesh *mesh, const apsm_topology *topology,
                                apsm_geodesic **out)
{
    *out = NULL;
    apsm_geodesic *g = calloc(1, sizeof *g);
    if (!g) return APSM_ERR_MEMORY;
    g->mesh = mesh;
    g->topology = topology;
    g->hinge = malloc((3 * mesh->nf + 1) * sizeof *g->hinge);
    g->bends = malloc((mesh->nv + 1) * sizeof *g->bends);
    if (!g->hinge || !g->bends) {
        apsm_geodesic_free(g);
        return APSM_ERR_MEMORY;
    }
    prepare(g);
    *out = g;
    return APSM_OK;
}

void geodesic_arrays(apsm_geodesic *g, array_list *list)
{
    arrays_add(list, &g->hinge, 3 * g->mesh->nf * sizeof *g->hinge);
    arrays_add(list, &g->bends, g->mesh->nv * sizeof *g->bends);
}

void apsm_geodesic_free(apsm_geodesic *g)
{
    if (!g) return;
    free(g->hinge);
    free(g->bends);
    free(g);
}

const apsm_mesh *apsm_geodesic_mesh(const apsm_geodesic *g)
{
    return g->mesh;
}

const apsm_topology *apsm_geodesic_topology(const apsm_geodesic *g)
{
    return g->topology;
}

double apsm_geodesic_margin(const apsm_geodesic *g)
{
    return g->margin;
}

apsm_status apsm_geodesic_work_new(const apsm_geodesic *g, apsm_geodesic_work **out)
{
    const size_t nv = g->mesh->nv;
    *out = NULL;
    apsm_geodesic_work *w = calloc(1, sizeof *w);
    if (!w) return APSM_ERR_MEMORY;
    w->nv = nv;
    w->node = malloc((nv + 1) * sizeof *w->node);
    w->heap = malloc((nv + 1) * sizeof *w->heap);
    w->touched = malloc((nv + 1) * sizeof *w->touched);
    if (!w->node || !w->heap || !w->touched) {
        apsm_geodesic_work_free(w);
        return APSM_ERR_MEMORY;
    }
    for (size_t v = 0; v < nv; v++)
        w->node[v] = (geodesic_node){ .d = INFINITY, .place = GEODESIC_FRESH };
    *out = w;
    return APSM_OK;
}

void apsm_geodesic_work_free(apsm_geodesic_work *w)
{
    if (!w) return;
    free(w->node);
    free(w->heap);
    free(w->touched);
    free(w->step);
    free(w);
}

/* ---- heap of open vertices: by distance, then by index ---- */

static bool before(geodesic_entry a, geodesic_entry b)
{
    return a.d < b.d || (a.d == b.d && a.v < b.v);
}

static void put(apsm_geodesic_work *w, size_t i, geodesic_entry e)
{
    w->heap[i] = e;
    w->node[e.v].place = (uint32_t)i;
}

static void sift_up(apsm_geodesic_work *w, size_t i, geodesic_entry e)
{
    for (; i > 0 && before(e, w->heap[(i - 1) / 2]); i = (i - 1) / 2)
        put(w, i, w->heap[(i - 1) / 2]);
    put(w, i, e);
}

static void sift_down(apsm_geodesic_work *w, size_t i, geodesic_entry e)
{
    for (size_t child; (child = 2 * i + 1) < w->heaped; i = child) {
        if (child + 1 < w->heaped && before(w->heap[child + 1], w->heap[child])) child++;
        if (!before(w->heap[child], e)) break;
        put(w, i, w->heap[child]);
    }
    put(w, i, e);
}

static uint32_t pop(apsm_geodesic_work *w)
{
    const uint32_t v = w->heap[0].v;
    const geodesic_entry last = w->heap[--w->heaped];
    if (w->heaped > 0) sift_down(w, 0, last);
    w->node[v].place = GEODESIC_CLOSED;
    return v;
}

/* ---- propagation ---- */

/* Corrections of closed vertices.  The first, about one per vertex, may be as small as they like,
 * which keeps flat pieces exact; where triangles are so bad that more are needed they must be
 * worth it, and their number is bounded. */
static bool may_reopen(apsm_geodesic_work *w, double d, double old)
{
    const bool many = w->reopened >= w->touches + 64;
    if (many && !(d < old * (1.0 - GEODESIC_WORTH))) return false;
    return w->reopened < 4 * w->touches + 64 && ++w->reopened;
}

/* v can be reached over a distance d; from: the vertex just closed. */
static void lower(apsm_geodesic_work *w, uint32_t v, geodesic_node to, uint32_t from)
{
    geodesic_node *node = w->node + v;
    if (!(to.d < node->d * (1.0 - GEODESIC_FALL))) return;
    if (node->place == GEODESIC_CLOSED && !may_reopen(w, to.d, node->d)) return;
    to.place = node->place;
    to.tree = node->tree;
    if (node->place == GEODESIC_FRESH) {
        w->touched[w->touches++] = v;
        to.tree = from;
    }
    *node = to;
    const size_t at = node->place < w->heaped ? node->place : w->heaped++;
    sift_up(w, at, (geodesic_entry){ to.d, v });
}

/* From u along an edge to v. */
static void along(const apsm_geodesic *g, apsm_geodesic_work *w, uint32_t u, uint32_t v,
                  double length)
{
    const geodesic_node *node = w->node + u;
    const double base = g->bends[u] ? node->d : node->base;
    lower(w, v,
          (geodesic_node){ .d = node->d + length, .base = base, .via = APSM_NONE, .parent = u }, u);
}

/* A way that comes through an edge. */
typedef struct crossing {
    double d2, t; /* squared length beyond base; where it crosses the edge */
    double base;
} crossing;

/* The source as edge UV of a two-face strip sees it: U, V, p in the plane of hinge AB (A at 0, B at
 * (L, 0), p above, the third of U, V below).  The line to p must cross UV and AB. */
static bool through_strip(double L, const double U[2], const double V[2], double du, double dv,
                          const double p[2], crossing *c)
{
    const double e[2] = { V[0] - U[0], V[1] - U[1] }, length = sqrt(e[0] * e[0] + e[1] * e[1]);
    const double r[2] = { p[0] - U[0], p[1] - U[1] };
    const double x = (r[0] * e[0] + r[1] * e[1]) / length, y = (e[0] * r[1] - e[1] * r[0]) / length;
    double d2, t;
    if (!(y >= 0.0) || !geodesic_unfold(length, du, dv, x, y, &d2, &t)) return false;
    const double q[2] = { U[0] + t * e[0], U[1] + t * e[1] }; /* crosses UV here, below AB */
    const double at = q[0] - (p[0] - q[0]) * q[1] / (p[1] - q[1]);
    if (!(at >= 0.0 && at <= L) || !(d2 < c->d2)) return false;
    c->d2 = d2;
    c->t = at / L;
    return true;
}

/* Where A and B were reached by different ways (around a corner of the shape, or from two sides),
 * (1) sees a source that is none.  The face ABD beyond the edge tells: the supposed source should
 * be at D's distance from D.  If not, ask its other edges AD and DB instead. */
static bool through_edge(const apsm_geodesic *g, const apsm_geodesic_work *w, uint32_t k, double x,
                         double y, crossing *c)
{
    const uint32_t *F = g->mesh->F, twin = g->topology->twin[k];
    const geodesic_hinge *e = g->hinge + k, *f = g->hinge + twin;
    const geodesic_node *A = w->node + F[k], *B = w->node + F[geodesic_next(k)],
                        *N = w->node + F[geodesic_previous(twin)];
    const double L = e->length, a = A->d - c->base, b = B->d - c->base;
    if (!geodesic_unfold(L, a, b, x, y, &c->d2, &c->t)) return false;
    if (N->place != GEODESIC_CLOSED) return true;
    const double D[2] = { L - f->x, -fabs(f->y) }, n = N->d - c->base;
    const double s = 0.5 * (L + (a - b) * (a + b) / L), h = sqrt(fmax(a * a - s * s, 0.0));
    const double expected = sqrt((D[0] - s) * (D[0] - s) + (D[1] + h) * (D[1] + h));
    if (fabs(n - expected) <= GEODESIC_AGREE * L) return true;
    const double base = fmin(c->base, N->base), p[2] = { x, y }, O[2] = { 0, 0 }, E[2] = { L, 0 };
    crossing strip = { INFINITY, 0, base };
    bool found = false;
    if (!signbit(g->hinge[geodesic_next(twin)].y))
        found |= through_strip(L, D, O, N->d - base, A->d - base, p, &strip);
    if (!signbit(g->hinge[geodesic_previous(twin)].y))
        found |= through_strip(L, E, D, B->d - base, N->d - base, p, &strip);
    if (found) *c = strip;
    return found;
}

/* Across half-edge k to the third corner of its face; u: the end just closed. */
static void across(const apsm_geodesic *g, apsm_geodesic_work *w, uint32_t k, uint32_t u)
{
    const uint32_t *F = g->mesh->F, v = F[geodesic_previous(k)];
    const geodesic_node *A = w->node + F[k], *B = w->node + F[geodesic_next(k)];
    if (A->place != GEODESIC_CLOSED || B->place != GEODESIC_CLOSED) return;
    const geodesic_hinge e = g->hinge[k];
    if (signbit(e.y)) return;
    crossing c = { .base = fmin(A->base, B->base) };
    const double a = A->d - c.base, b = B->d - c.base, limit = w->node[v].d - c.base;
    /* (2) without its term 2 y h is a lower bound: most faces behind the front stop here. */
    const double s2 = e.length + (a - b) * (a + b) / e.length;
    if (!(e.x * e.x + e.y * e.y + a * a - e.x * s2 < limit * limit)) return;
    if (!through_edge(g, w, k, e.x, e.y, &c)) return;
    lower(
        w, v,
        (geodesic_node){ .d = c.base + sqrt(c.d2), .base = c.base, .via = k, .parent = APSM_NONE },
        u);
}

/* Everything that closing v makes reachable. */
static void expand(const apsm_geodesic *g, apsm_geodesic_work *w, uint32_t v)
{
    const apsm_topology *t = g->topology;
    const uint32_t *F = g->mesh->F;
    for (uint32_t i = t->corner_start[v]; i < t->corner_start[v + 1]; i++) {
        const uint32_t k = t->corner[i], p = geodesic_previous(k);
        along(g, w, v, F[geodesic_next(k)], g->hinge[k].length);
        if (t->twin[p] == APSM_NONE) along(g, w, v, F[p], g->hinge[p].length);
        across(g, w, k, v);
        across(g, w, p, v);
    }
}

static void reset(apsm_geodesic_work *w)
{
    for (size_t i = 0; i < w->touches; i++)
        w->node[w->touched[i]] = (geodesic_node){ .d = INFINITY, .place = GEODESIC_FRESH };
    w->touches = w->heaped = w->reopened = 0;
    w->radius = 0.0;
}

/* The corners of the source's face, over which everything else is reached. */
static apsm_status start(const apsm_geodesic *g, const apsm_surface_point *source,
                         apsm_geodesic_work *w)
{
    if (w->nv < g->mesh->nv || source->face >= g->mesh->nf) return APSM_ERR_ARG;
    reset(w);
    w->source = *source;
    apsm_surface_position(g->mesh, source, w->x);
    for (uint32_t k = 3 * source->face; k < 3 * source->face + 3; k++) {
        const uint32_t v = g->mesh->F[k];
        const double d = sqrt(vec3_distance2(w->x, vertex(g, v)));
        if (!isfinite(d)) return APSM_ERR_NONFINITE;
        lower(w, v, (geodesic_node){ .d = d, .via = APSM_NONE, .parent = APSM_NONE }, APSM_NONE);
    }
    return APSM_OK;
}

bool apsm_geodesic_extend(const apsm_geodesic *g, double radius, apsm_geodesic_work *w)
{
    while (w->heaped > 0 && w->heap[0].d <= radius + g->margin) expand(g, w, pop(w));
    w->radius = w->heaped > 0 ? fmax(w->radius, radius) : INFINITY;
    return w->heaped > 0;
}

apsm_status apsm_geodesic_from(const apsm_geodesic *g, const apsm_surface_point *source,
                               double radius, apsm_geodesic_work *w)
{
    APSM_TRY(start(g, source, w));
    apsm_geodesic_extend(g, radius, w);
    return APSM_OK;
}

/* At the seam between two sources' lands a face may have one end of an edge on either side. */
static void expand_seam(const apsm_geodesic *g, apsm_geodesic_work *w, uint32_t v,
                        const double *nearest)
{
    const apsm_topology *t = g->topology;
    for (uint32_t i = t->corner_start[v]; i < t->corner_start[v + 1]; i++) {
        const uint32_t k = t->corner[i], p = geodesic_previous(k);
        const uint32_t next = g->mesh->F[geodesic_next(k)], previous = g->mesh->F[p];
        if (w->node[next].d <= nearest[next]) across(g, w, k, v);
        if (w->node[previous].d <= nearest[previous]) across(g, w, p, v);
    }
}

apsm_status apsm_geodesic_add_source(const apsm_geodesic *g, const apsm_surface_point *source,
                                     double *nearest, apsm_geodesic_work *w)
{
    APSM_TRY(start(g, source, w));
    while (w->heaped > 0) {
        const uint32_t v = pop(w);
        const double d = w->node[v].d;
        if (d < nearest[v]) {
            nearest[v] = d;
            expand(g, w, v);
        } else {
            expand_seam(g, w, v, nearest);
        }
    }
    return APSM_OK;
}

/* ---- distances of points ---- */

static double square(double x)
{
    return x * x;
}

/* Distance of p from the start of half-edge k of its face. */
static double corner_distance(const apsm_geodesic *g, const apsm_surface_point *p, uint32_t k)
{
    const geodesic_hinge *e = g->hinge + k;
    const double wb = p->weight[geodesic_next(k) % 3], wc = p->weight[geodesic_previous(k) % 3];
    return sqrt(square(wb * e->length + wc * e->x) + square(wc * e->y));
}

geodesic_exit geodesic_edge_exit(const apsm_geodesic *g, const apsm_geodesic_work *w,
                                 const apsm_surface_point *p, uint32_t k)
{
    const geodesic_hinge *e = g->hinge + k;
    const geodesic_node *A = w->node + g->mesh->F[k], *B = w->node + g->mesh->F[geodesic_next(k)];
    const double wb = p->weight[geodesic_next(k) % 3], wc = p->weight[geodesic_previous(k) % 3];
    geodesic_exit out = { .kind = EXIT_NONE, .half_edge = k, .distance = INFINITY };
    if (signbit(e->y) || !(A->d < INFINITY) || !(B->d < INFINITY)) return out;
    crossing c = { .base = fmin(A->base, B->base) };
    if (!through_edge(g, w, k, wb * e->length + wc * e->x, wc * e->y, &c)) return out;
    out.kind = EXIT_EDGE;
    out.t = c.t;
    out.distance = c.base + sqrt(c.d2);
    return out;
}

geodesic_exit geodesic_best_exit(const apsm_geodesic *g, const apsm_geodesic_work *w,
                                 const apsm_surface_point *p, uint32_t barred)
{
    geodesic_exit best = { .kind = EXIT_NONE, .distance = INFINITY };
    if (p->face == w->source.face) {
        double x[3];
        apsm_surface_position(g->mesh, p, x);
        best.kind = EXIT_SOURCE;
        best.distance = sqrt(vec3_distance2(x, w->x));
        return best;
    }
    for (uint32_t k = 3 * p->face; k < 3 * p->face + 3; k++) {
        const double d = w->node[g->mesh->F[k]].d + corner_distance(g, p, k);
        if (d < best.distance)
            best = (geodesic_exit){ .kind = EXIT_CORNER, .half_edge = k, .distance = d };
        if (k == barred) continue;
        const geodesic_exit edge = geodesic_edge_exit(g, w, p, k);
        if (edge.kind == EXIT_EDGE && edge.distance <= best.distance) best = edge;
    }
    return best;
}

double apsm_geodesic_vertex_distance(const apsm_geodesic_work *w, uint32_t v)
{
    const double d = w->node[v].d;
    return d <= w->radius ? d : INFINITY;
}

double apsm_geodesic_distance(const apsm_geodesic *g, const apsm_geodesic_work *w,
                              const apsm_surface_point *to)
{
    const double d = geodesic_best_exit(g, w, to, APSM_NONE).distance;
    return d <= w->radius ? d : INFINITY;
}

double apsm_geodesic_reach(const apsm_geodesic *g, apsm_geodesic_work *w,
                           const apsm_surface_point *to)
{
    double x[3], d;
    apsm_surface_position(g->mesh, to, x);
    const double straight = sqrt(vec3_distance2(x, w->x)) + g->margin;
    while (!((d = apsm_geodesic_distance(g, w, to)) < INFINITY) && w->heaped > 0)
        apsm_geodesic_extend(g, fmax(straight, 1.5 * w->radius), w);
    return d;
}
