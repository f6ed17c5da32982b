/* Openings: closed by the triangulation of least area.
 *
 * For a loop p_0..p_{n-1}, W(i,k) is the least area of triangles that fill the polygon
 * p_i..p_k:  W(i,k) = min over i < m < k of W(i,m) + W(m,k) + area(p_i, p_m, p_k)
 * (Barequet & Sharir, "Filling gaps in the boundary of a polyhedron", 1995): O(n^3) time, O(n^2)
 * memory.  Longer loops first lose corners, always the one whose ear has the shortest base.  A
 * new edge may not join vertices that are joined already: it would get a third face.  What
 * comes out gets vertices of its own (caps.c); a bone cut flat gets a flat end. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "groom/repair.h"

enum { MOST_CORNERS = 240 };

/* What is made: faces and, where no triangulation exists, a vertex in the middle. */
typedef struct cap {
    uint32_t *F;
    size_t nf, room;
    double area;
} cap;

static apsm_status add_face(const apsm_mesh *m, cap *c, uint32_t p, uint32_t q, uint32_t s)
{
    if (c->nf == c->room) {
        c->room = 2 * c->room + 64;
        uint32_t *F = realloc(c->F, 3 * c->room * sizeof *F);
        if (!F) return APSM_ERR_MEMORY;
        c->F = F;
    }
    uint32_t *F = c->F + 3 * c->nf++;
    F[0] = p;
    F[1] = q;
    F[2] = s;
    double u[3], v[3], n[3];
    vec3_sub(m->V + 3 * q, m->V + 3 * p, u);
    vec3_sub(m->V + 3 * s, m->V + 3 * p, v);
    vec3_cross(u, v, n);
    c->area += 0.5 * vec3_norm(n);
    return APSM_OK;
}

static double area_of(const apsm_mesh *m, uint32_t p, uint32_t q, uint32_t s)
{
    double n[3];
    vec3_triangle(m->V + 3 * p, m->V + 3 * q, m->V + 3 * s, n);
    return 0.5 * vec3_norm(n);
}

static bool joined(const apsm_mesh *m, const apsm_topology *t, uint32_t a, uint32_t b)
{
    for (uint32_t i = t->corner_start[a]; i < t->corner_start[a + 1]; i++) {
        const uint32_t f = t->corner[i] / 3;
        for (uint32_t k = 0; k < 3; k++)
            if (m->F[3 * f + k] == b) return true;
    }
    return false;
}

/* W and the best m of every (i, k); row-major n x n. */
typedef struct table {
    size_t n;
    double *W;
    uint16_t *split;
} table;

static void fill_table(const apsm_mesh *m, const apsm_topology *t, const uint32_t *loop, table *b)
{
    const size_t n = b->n;
    for (size_t i = 0; i + 1 < n; i++) b->W[i * n + i + 1] = 0.0;
    for (size_t gap = 2; gap < n; gap++)
        for (size_t i = 0; i + gap < n; i++) {
            const size_t k = i + gap;
            double best = INFINITY;
            uint16_t at = 0;
            /* The last edge, (0, n-1), is the loop's own. */
            if (gap == n - 1 || !joined(m, t, loop[i], loop[k]))
                for (size_t s = i + 1; s < k; s++) {
                    const double rest = b->W[i * n + s] + b->W[s * n + k];
                    if (!(rest < best)) continue;
                    const double w = rest + area_of(m, loop[i], loop[s], loop[k]);
                    if (w < best) {
                        best = w;
                        at = (uint16_t)s;
                    }
                }
            b->W[i * n + k] = best;
            b->split[i * n + k] = at;
        }
}

/* Faces of the polygon i..k. */
static apsm_status emit(const apsm_mesh *m, const uint32_t *loop, const table *b, size_t i,
                        size_t k, cap *c)
{
    if (k - i < 2) return APSM_OK;
    const size_t s = b->split[i * b->n + k];
    APSM_TRY(emit(m, loop, b, i, s, c));
    APSM_TRY(emit(m, loop, b, s, k, c));
    return add_face(m, c, loop[i], loop[s], loop[k]);
}

/* Least-area faces of a loop of at most MOST_CORNERS; *found false if every triangulation uses an
 * edge there already. */
static apsm_status fill_small(const apsm_mesh *m, const apsm_topology *t, const uint32_t *loop,
                              size_t n, cap *c, bool *found)
{
    table b = { n, malloc(n * n * sizeof *b.W), malloc(n * n * sizeof *b.split) };
    apsm_status status = b.W && b.split ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        fill_table(m, t, loop, &b);
        *found = b.W[n - 1] < INFINITY;
        if (*found) status = emit(m, loop, &b, 0, n - 1, c);
    }
    free(b.W);
    free(b.split);
    return status;
}

/* Newell's normal of the polygon: twice its area vector. */
static void loop_normal(const apsm_mesh *m, const uint32_t *loop, size_t n, double normal[3])
{
    normal[0] = normal[1] = normal[2] = 0.0;
    for (size_t i = 0; i < n; i++) {
        double u[3], v[3], w[3];
        vec3_sub(m->V + 3 * loop[i], m->V + 3 * loop[0], u);
        vec3_sub(m->V + 3 * loop[(i + 1) % n], m->V + 3 * loop[0], v);
        vec3_cross(u, v, w);
        vec3_add_scaled(normal, 1.0, w);
    }
}

/* The corner whose ear has the shortest base among those that bulge outward; any, if none. */
static size_t best_ear(const apsm_mesh *m, const apsm_topology *t, const uint32_t *loop, size_t n,
                       const double normal[3])
{
    size_t best = n;
    double best2 = INFINITY;
    for (int strict = 1; strict >= 0 && best == n; strict--)
        for (size_t i = 0; i < n; i++) {
            const uint32_t p = loop[(i + n - 1) % n], q = loop[i], s = loop[(i + 1) % n];
            const double base2 = vec3_distance2(m->V + 3 * p, m->V + 3 * s);
            if (!(base2 < best2) || joined(m, t, p, s)) continue;
            double u[3], v[3], w[3];
            vec3_sub(m->V + 3 * q, m->V + 3 * p, u);
            vec3_sub(m->V + 3 * s, m->V + 3 * q, v);
            vec3_cross(u, v, w);
            if (strict && !(vec3_dot(w, normal) > 0.0)) continue;
            best = i;
            best2 = base2;
        }
    return best;
}

/* Cuts ears off loop (in place) until it is short enough; *n may stay large if none is left. */
static apsm_status cut_ears(const apsm_mesh *m, const apsm_topology *t, uint32_t *loop, size_t *n,
                            cap *c)
{
    double normal[3];
    loop_normal(m, loop, *n, normal);
    while (*n > MOST_CORNERS) {
        const size_t i = best_ear(m, t, loop, *n, normal);
        if (i == *n) return APSM_OK;
        APSM_TRY(add_face(m, c, loop[(i + *n - 1) % *n], loop[i], loop[(i + 1) % *n]));
        memmove(loop + i, loop + i + 1, (*n - i - 1) * sizeof *loop);
        (*n)--;
    }
    return APSM_OK;
}

static void loop_middle(const apsm_mesh *m, const uint32_t *loop, size_t n, double x[3])
{
    x[0] = x[1] = x[2] = 0.0;
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++) x[c] += m->V[3 * loop[i] + c] / (double)n;
}

/* A fan around a new vertex in the middle: always possible. */
static apsm_status fill_fan(apsm_mesh *m, const uint32_t *loop, size_t n, cap *c)
{
    double *V = realloc(m->V, 3 * (m->nv + 1) * sizeof *V);
    if (!V) return APSM_ERR_MEMORY;
    m->V = V;
    loop_middle(m, loop, n, V + 3 * m->nv);
    const uint32_t middle = (uint32_t)m->nv++;
    for (size_t i = 0; i < n; i++) APSM_TRY(add_face(m, c, loop[i], loop[(i + 1) % n], middle));
    return APSM_OK;
}

static apsm_status fill_loop(apsm_mesh *m, const apsm_topology *t, uint32_t *loop, size_t n, cap *c)
{
    bool found = false;
    APSM_TRY(cut_ears(m, t, loop, &n, c));
    if (n <= MOST_CORNERS) APSM_TRY(fill_small(m, t, loop, n, c, &found));
    return found ? APSM_OK : fill_fan(m, loop, n, c);
}

/* Border vertices in the order in which a cap runs around them: against the faces there.  from[v]
 * is the border half-edge that ends at v. */
static size_t walk_loop(const apsm_mesh *m, uint32_t *from, uint32_t start, uint32_t *loop)
{
    size_t n = 0;
    uint32_t v = start;
    do {
        const uint32_t h = from[v];
        loop[n++] = v;
        from[v] = APSM_NONE;
        v = m->F[h];
    } while (v != start);
    return n;
}

static apsm_status refuse_hole(const repair *r, const double at[3], size_t n, double share)
{
    if (!r->opt->fill_holes)
        return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                         "%s: open near %.6g %.6g %.6g (%zu edges); allow holes to be filled",
                         r->name, at[0], at[1], at[2], n);
    return apsm_fail(
        r->ctx, APSM_ERR_GEOMETRY,
        "%s: the opening near %.6g %.6g %.6g (%zu edges) needs a cap of %.0f %% of the "
        "surface: say --open to leave openings as they are, or --fill to close this one too",
        r->name, at[0], at[1], at[2], n, 100.0 * share);
}

/* What was there before a cap that is not wanted. */
static void take_back(repair *r, const cap *before, size_t nv, cap *all)
{
    all->nf = before->nf;
    all->area = before->area;
    r->mesh.nv = nv;
    r->report->openings++;
}

/* Closes one loop and judges its cap. */
static apsm_status close_loop(repair *r, const apsm_topology *t, double area, uint32_t *loop,
                              size_t n, cap *all)
{
    double at[3];
    loop_middle(&r->mesh, loop, n, at);
    const cap before = *all;
    const size_t nv = r->mesh.nv;
    if (!r->opt->fill_holes && !r->opt->open) return refuse_hole(r, at, n, 0.0);
    APSM_TRY(fill_loop(&r->mesh, t, loop, n, all));
    const double share = (all->area - before.area) / area;
    const double stays = r->opt->fill_holes ? r->opt->open_share : 0.0;
    if (r->opt->open && share > stays) return take_back(r, &before, nv, all), APSM_OK;
    if (!r->opt->fill && !(share <= r->opt->max_cap_share)) return refuse_hole(r, at, n, share);
    r->report->holes++;
    if (share > r->report->largest_cap) {
        r->report->largest_cap = share;
        memcpy(r->report->largest_cap_at, at, sizeof at);
    }
    return APSM_OK;
}

static apsm_status close_loops(repair *r, const apsm_topology *t, uint32_t *from, uint32_t *loop,
                               cap *all)
{
    const double area = apsm_mesh_area(&r->mesh);
    const size_t nv = r->mesh.nv; /* fans add vertices behind */
    if (!(area > 0))
        return apsm_fail(r->ctx, APSM_ERR_GEOMETRY,
                         "%s: its faces have no area: they lie on a line or in a point; export the "
                         "surface again",
                         r->name);
    for (uint32_t v = 0; v < nv; v++) {
        if (from[v] == APSM_NONE) continue;
        const size_t n = walk_loop(&r->mesh, from, v, loop);
        APSM_TRY(close_loop(r, t, area, loop, n, all));
    }
    return APSM_OK;
}

static apsm_status append(apsm_mesh *m, const cap *c)
{
    if (c->nf == 0) return APSM_OK;
    uint32_t *F = realloc(m->F, 3 * (m->nf + c->nf) * sizeof *F);
    if (!F) return APSM_ERR_MEMORY;
    m->F = F;
    memcpy(F + 3 * m->nf, c->F, 3 * c->nf * sizeof *F);
    m->nf += c->nf;
    return APSM_OK;
}

apsm_status repair_holes(repair *r)
{
    apsm_mesh *m = &r->mesh;
    apsm_topology t;
    APSM_TRY(apsm_topology_build(m, &t));
    uint32_t *from = malloc(m->nv * sizeof *from), *loop = malloc(m->nv * sizeof *loop);
    cap all = { 0 };
    apsm_status status = from && loop ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        memset(from, 0xff, m->nv * sizeof *from);
        for (uint32_t h = 0; h < 3 * m->nf; h++)
            if (t.twin[h] == APSM_NONE) from[m->F[h % 3 == 2 ? h - 2 : h + 1]] = h;
        status = close_loops(r, &t, from, loop, &all);
    }
    const size_t first = m->nf;
    if (status == APSM_OK) status = append(m, &all);
    if (status == APSM_OK && all.nf) status = repair_caps(r, first);
    r->report->hole_faces += m->nf - first;
    apsm_topology_free(&t);
    free(from);
    free(loop);
    free(all.F);
    return status;
}
