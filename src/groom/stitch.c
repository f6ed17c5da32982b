/* Makes a set of triangles a surface: decides which faces are neighbours across each edge.
 *
 * Edges with two faces are plain.  They join the faces into patches, bounded by open edges (one
 * face) and by knots (edges with three or more).  At the knots:
 *   1. fins go: patches with an open edge hanging on the rest;
 *   2. of an odd number of sheets the smallest patch goes (walls inside a body, for instance);
 *   3. an even number is paired by turning round the edge, so that every pair bounds a wedge
 *      of the inside: bodies that only touch along the edge come apart.
 * Both 1 and 2 only remove patches up to max_drop_share of the area.  Then every vertex is split
 * into its fans (Gueziec, Taubin, Lazarus & Horn, "Cutting and stitching", 2001). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "groom/repair.h"

/* Half-edge h by its ends in ascending order. */
typedef struct side {
    uint32_t lo, hi, h;
} side;

typedef struct work {
    repair *r;
    side *sides;     /* 3 nf, equal edges next to each other */
    uint32_t *twin;  /* 3 nf: neighbour across, whichever way it runs; APSM_NONE: open */
    uint32_t *patch; /* nf: disjoint sets of faces */
    double *area;    /* nf: of the patch, at its root */
    unsigned char *open, *knotted; /* nf, at the root: the patch has an open edge, a knot */
    unsigned char *drop;           /* nf */
} work;

static void work_free(work *w)
{
    free(w->sides);
    free(w->twin);
    free(w->patch);
    free(w->area);
    free(w->open);
    free(w->knotted);
    free(w->drop);
}

static apsm_status work_new(work *w, repair *r)
{
    const size_t nf = r->mesh.nf;
    *w = (work){ .r = r,
                 .sides = malloc(3 * nf * sizeof *w->sides),
                 .twin = malloc(3 * nf * sizeof *w->twin),
                 .patch = malloc(nf * sizeof *w->patch),
                 .area = malloc(nf * sizeof *w->area),
                 .open = malloc(nf),
                 .knotted = malloc(nf),
                 .drop = malloc(nf) };
    if (w->sides && w->twin && w->patch && w->area && w->open && w->knotted && w->drop)
        return APSM_OK;
    work_free(w);
    return APSM_ERR_MEMORY;
}

/* End of the run of sides that lie on the same edge as sides[i]. */
static size_t run_end(const work *w, size_t i)
{
    const size_t n = 3 * w->r->mesh.nf;
    size_t end = i + 1;
    while (end < n && w->sides[end].lo == w->sides[i].lo && w->sides[end].hi == w->sides[i].hi)
        end++;
    return end;
}

/* No face has a repeated corner any more. */
static apsm_status sort_sides(work *w)
{
    const apsm_mesh *m = &w->r->mesh;
    uint32_t *sorted;
    size_t n;
    APSM_TRY(topology_sort(m, &sorted, &n));
    for (size_t i = 0; i < n; i++) {
        const uint32_t h = sorted[i], a = m->F[h], b = m->F[h % 3 == 2 ? h - 2 : h + 1];
        w->sides[i] = (side){ a < b ? a : b, a < b ? b : a, h };
    }
    free(sorted);
    return n == 3 * m->nf ? APSM_OK : APSM_ERR_GEOMETRY;
}

/* Neighbours across plain edges, patches and what bounds them; *knots (out): how many. */
static apsm_status find_patches(work *w, size_t *knots)
{
    const apsm_mesh *m = &w->r->mesh;
    *knots = 0;
    APSM_TRY(sort_sides(w));
    sets_init(w->patch, m->nf);
    memset(w->twin, 0xff, 3 * m->nf * sizeof *w->twin);
    memset(w->open, 0, m->nf);
    memset(w->knotted, 0, m->nf);
    memset(w->drop, 0, m->nf);
    for (size_t i = 0, end; i < 3 * m->nf; i = end) {
        end = run_end(w, i);
        if (end - i == 2) {
            w->twin[w->sides[i].h] = w->sides[i + 1].h;
            w->twin[w->sides[i + 1].h] = w->sides[i].h;
            sets_join(w->patch, w->sides[i].h / 3, w->sides[i + 1].h / 3);
        }
    }
    for (size_t i = 0, end; i < 3 * m->nf; i = end) {
        end = run_end(w, i);
        *knots += end - i > 2;
        for (size_t k = i; k < end; k++) {
            const uint32_t p = sets_root(w->patch, w->sides[k].h / 3);
            if (end - i == 1) w->open[p] = 1;
            if (end - i > 2) w->knotted[p] = 1;
        }
    }
    memset(w->area, 0, m->nf * sizeof *w->area);
    for (uint32_t f = 0; f < m->nf; f++) w->area[sets_root(w->patch, f)] += face_area(m, f);
    return APSM_OK;
}

static bool droppable(const work *w, uint32_t p, double total)
{
    return w->area[p] <= w->r->opt->max_drop_share * total;
}

/* Rule 1: marks patches that hang on the rest and end in the open.  The largest patch never. */
static size_t mark_fins(work *w, double total)
{
    const size_t nf = w->r->mesh.nf;
    uint32_t largest = 0;
    size_t marked = 0;
    for (uint32_t f = 1; f < nf; f++)
        if (w->patch[f] == f && w->area[f] > w->area[sets_root(w->patch, largest)]) largest = f;
    largest = sets_root(w->patch, largest);
    for (uint32_t f = 0; f < nf; f++) {
        const uint32_t p = sets_root(w->patch, f);
        if (p != largest && w->open[p] && w->knotted[p] && droppable(w, p, total)) {
            w->drop[f] = 1;
            marked++;
        }
    }
    return marked;
}

static apsm_status refuse_knot(const work *w, size_t i)
{
    const double *a = w->r->mesh.V + 3 * w->sides[i].lo, *b = w->r->mesh.V + 3 * w->sides[i].hi;
    return apsm_fail(w->r->ctx, APSM_ERR_GEOMETRY,
                     "%s: %zu faces share one edge near %.6g %.6g %.6g and none of them is small "
                     "enough to drop; separate the surfaces there",
                     w->r->name, run_end(w, i) - i, 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]),
                     0.5 * (a[2] + b[2]));
}

/* Rule 2: marks the smallest patch at every edge with an odd number of faces (a patch that is
 * there twice counts as no candidate: its removal would not change the parity). */
static apsm_status mark_walls(work *w, double total, size_t *marked)
{
    const size_t nf = w->r->mesh.nf;
    unsigned char *chosen = calloc(nf, 1);
    if (!chosen) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    for (size_t i = 0, end; i < 3 * nf && status == APSM_OK; i = end) {
        end = run_end(w, i);
        if (end - i < 3 || (end - i) % 2 == 0) continue;
        uint32_t best = APSM_NONE;
        for (size_t k = i; k < end; k++) {
            const uint32_t p = sets_root(w->patch, w->sides[k].h / 3);
            if (best == APSM_NONE || w->area[p] < w->area[best] ||
                (w->area[p] <= w->area[best] && p < best))
                best = p;
        }
        if (droppable(w, best, total))
            chosen[best] = 1;
        else
            status = refuse_knot(w, i);
    }
    for (uint32_t f = 0; f < nf; f++)
        if (chosen[sets_root(w->patch, f)]) {
            w->drop[f] = 1;
            (*marked)++;
        }
    free(chosen);
    return status;
}

/* A face at a knot: where it points, looking along the edge from lo to hi. */
typedef struct spoke {
    double angle;
    uint32_t h;
    bool along; /* its half-edge runs lo -> hi, so its inside lies towards smaller angles */
} spoke;

static int by_angle(const void *a, const void *b)
{
    const spoke *p = a, *q = b;
    if (p->angle != q->angle) return p->angle < q->angle ? -1 : 1;
    return p->h < q->h ? -1 : p->h > q->h;
}

static spoke make_spoke(const work *w, const side *s, const double e[3], const double x[3],
                        const double y[3])
{
    const apsm_mesh *m = &w->r->mesh;
    double u[3];
    vec3_sub(m->V + 3 * m->F[s->h % 3 == 0 ? s->h + 2 : s->h - 1], m->V + 3 * s->lo, u);
    vec3_add_scaled(u, -vec3_dot(u, e), e);
    return (spoke){ atan2(vec3_dot(u, y), vec3_dot(u, x)), s->h, m->F[s->h] == s->lo };
}

/* Axes across the edge of *s; x points into its face. */
static void edge_frame(const apsm_mesh *m, const side *s, double e[3], double x[3], double y[3])
{
    vec3_sub(m->V + 3 * s->hi, m->V + 3 * s->lo, e);
    vec3_normalise(e);
    vec3_sub(m->V + 3 * m->F[s->h % 3 == 0 ? s->h + 2 : s->h - 1], m->V + 3 * s->lo, x);
    vec3_add_scaled(x, -vec3_dot(x, e), e);
    vec3_normalise(x);
    vec3_cross(e, x, y);
}

/* Rule 3 for the sides [i, end). */
static apsm_status pair_spokes(work *w, size_t i, size_t end)
{
    const size_t n = end - i;
    spoke *s = malloc(n * sizeof *s);
    if (!s) return APSM_ERR_MEMORY;
    double e[3], x[3], y[3];
    edge_frame(&w->r->mesh, &w->sides[i], e, x, y);
    for (size_t k = 0; k < n; k++) s[k] = make_spoke(w, &w->sides[i + k], e, x, y);
    qsort(s, n, sizeof *s, by_angle);
    /* The inside lies between a face running hi -> lo and the next one running lo -> hi. */
    size_t shift = 0, best = 0;
    for (size_t start = 0; start < 2; start++) {
        size_t good = 0;
        for (size_t k = start; k < n + start; k += 2)
            good += !s[k % n].along && s[(k + 1) % n].along;
        if (good > best) {
            best = good;
            shift = start;
        }
    }
    for (size_t k = shift; k < n + shift; k += 2) {
        const uint32_t g = s[k % n].h, h = s[(k + 1) % n].h;
        w->twin[g] = h;
        w->twin[h] = g;
    }
    free(s);
    return APSM_OK;
}

static apsm_status pair_knots(work *w)
{
    for (size_t i = 0, end; i < 3 * w->r->mesh.nf; i = end) {
        end = run_end(w, i);
        if (end - i > 2) APSM_TRY(pair_spokes(w, i, end));
    }
    return APSM_OK;
}

/* The corner of face t at vertex v. */
static uint32_t corner_at(const apsm_mesh *m, uint32_t face, uint32_t v)
{
    uint32_t h = 3 * face;
    while (m->F[h] != v) h++;
    return h;
}

/* Every fan but the first of a vertex gets a copy of it. */
static apsm_status split_fans(work *w)
{
    apsm_mesh *m = &w->r->mesh;
    const size_t nh = 3 * m->nf;
    uint32_t *fan = malloc(nh * sizeof *fan), *owner = malloc(m->nv * sizeof *owner);
    double *V = NULL;
    bool ok = fan && owner;
    size_t copies = 0;
    if (ok) {
        sets_init(fan, nh);
        memset(owner, 0xff, m->nv * sizeof *owner);
        for (uint32_t h = 0; h < nh; h++) {
            if (w->twin[h] == APSM_NONE || w->twin[h] < h) continue;
            const uint32_t other = w->twin[h] / 3, next = h % 3 == 2 ? h - 2 : h + 1;
            sets_join(fan, h, corner_at(m, other, m->F[h]));
            sets_join(fan, next, corner_at(m, other, m->F[next]));
        }
        for (uint32_t h = 0; h < nh; h++) {
            if (sets_root(fan, h) != h) continue;
            if (owner[m->F[h]] == APSM_NONE)
                owner[m->F[h]] = h;
            else
                copies++;
        }
        V = copies ? realloc(m->V, 3 * (m->nv + copies) * sizeof *V) : m->V;
        ok = V != NULL;
    }
    if (ok && copies) {
        m->V = V;
        /* Roots come first in their sets: owner is looked up before F[root] changes. */
        for (uint32_t h = 0; h < nh; h++) {
            const uint32_t root = sets_root(fan, h), v = m->F[h];
            if (root != h) {
                m->F[h] = m->F[root];
            } else if (owner[v] != h) {
                memcpy(V + 3 * m->nv, V + 3 * v, 3 * sizeof *V);
                m->F[h] = (uint32_t)m->nv++;
            }
        }
        w->r->report->split_vertices += copies;
    }
    free(fan);
    free(owner);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

/* Drops fins and walls until none is left. */
static apsm_status drop_patches(work *w)
{
    apsm_mesh *m = &w->r->mesh;
    const double total = apsm_mesh_area(m);
    for (;;) {
        size_t knots = 0;
        if (m->nf > 0) APSM_TRY(find_patches(w, &knots));
        if (knots == 0) return APSM_OK;
        size_t marked = mark_fins(w, total);
        if (marked == 0) APSM_TRY(mark_walls(w, total, &marked));
        if (marked == 0) return APSM_OK;
        w->r->report->fin_faces += marked;
        APSM_TRY(repair_drop(m, w->drop));
    }
}

apsm_status repair_stitch(repair *r)
{
    work w;
    APSM_TRY(work_new(&w, r));
    apsm_status status = drop_patches(&w);
    if (status == APSM_OK && r->mesh.nf > 0) status = pair_knots(&w);
    if (status == APSM_OK && r->mesh.nf > 0) status = split_fans(&w);
    work_free(&w);
    return status;
}
