/* Vertices that coincide, by hashing cells of a grid, and faces that degenerate or occur twice. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "groom/repair.h"

static const double cell_per_reach = 8.0;

/* Representatives by cell: an open table of chains.  Cells are cell_per_reach times the reach, so
 * that few vertices have to look into a second cell. */
typedef struct grid {
    const double *V;
    double lo[3], cell, reach;
    size_t slots; /* a power of two */
    uint32_t *head, *next;
} grid;

static size_t slot_of(const grid *g, const int64_t c[3])
{
    uint64_t k = (uint64_t)c[0] * 0x9e3779b97f4a7c15u ^ (uint64_t)c[1] * 0xc2b2ae3d27d4eb4fu ^
                 (uint64_t)c[2] * 0x165667b19e3779f9u;
    k ^= k >> 29;
    return (size_t)(k * 0xbf58476d1ce4e5b9u >> 20) & (g->slots - 1);
}

static int64_t cell_of(const grid *g, double x, int c)
{
    return (int64_t)floor((x - g->lo[c]) / g->cell);
}

/* The smallest earlier representative within reach of x, or APSM_NONE. */
static uint32_t find_near(const grid *g, const double x[3])
{
    int64_t from[3], to[3], c[3];
    for (int k = 0; k < 3; k++) {
        from[k] = cell_of(g, x[k] - g->reach, k);
        to[k] = cell_of(g, x[k] + g->reach, k);
    }
    uint32_t best = APSM_NONE;
    for (c[2] = from[2]; c[2] <= to[2]; c[2]++)
        for (c[1] = from[1]; c[1] <= to[1]; c[1]++)
            for (c[0] = from[0]; c[0] <= to[0]; c[0]++)
                for (uint32_t v = g->head[slot_of(g, c)]; v != APSM_NONE; v = g->next[v])
                    if (v < best && vec3_distance2(x, g->V + 3 * v) <= g->reach * g->reach)
                        best = v;
    return best;
}

static void insert(grid *g, uint32_t v)
{
    int64_t c[3];
    for (int k = 0; k < 3; k++) c[k] = cell_of(g, g->V[3 * v + (uint32_t)k], k);
    const size_t slot = slot_of(g, c);
    g->next[v] = g->head[slot];
    g->head[slot] = v;
}

apsm_status repair_weld(repair *r)
{
    apsm_mesh *m = &r->mesh;
    double hi[3];
    grid g = { .V = m->V, .slots = 1 };
    apsm_mesh_bounds(m, g.lo, hi);
    const double diagonal = sqrt(vec3_distance2(g.lo, hi));
    g.reach = r->opt->merge * diagonal;
    g.cell = g.reach > 0.0 ? cell_per_reach * g.reach : diagonal * 0x1p-30;
    if (!(diagonal > 0.0)) return APSM_OK; /* all faces degenerate: said later */
    while (g.slots < 2 * m->nv) g.slots *= 2;
    g.head = malloc(g.slots * sizeof *g.head);
    g.next = malloc(m->nv * sizeof *g.next);
    uint32_t *same = malloc(m->nv * sizeof *same);
    const bool ok = g.head && g.next && same;
    if (ok) {
        memset(g.head, 0xff, g.slots * sizeof *g.head);
        for (uint32_t v = 0; v < m->nv; v++) {
            same[v] = find_near(&g, m->V + 3 * v);
            if (same[v] == APSM_NONE) {
                same[v] = v;
                insert(&g, v);
            } else {
                r->report->merged_vertices++;
            }
        }
        for (size_t h = 0; h < 3 * m->nf; h++) m->F[h] = same[m->F[h]];
    }
    free(g.head);
    free(g.next);
    free(same);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

/* A face by its corners in ascending order. */
typedef struct named_face {
    uint32_t corner[3], face;
    int even; /* 1 if the corners were an even permutation of the ascending order, else -1 */
} named_face;

static named_face name_face(const uint32_t *F, uint32_t f)
{
    named_face n = { { F[3 * f], F[3 * f + 1], F[3 * f + 2] }, f, 1 };
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < 2; k++)
            if (n.corner[k] > n.corner[k + 1]) {
                const uint32_t t = n.corner[k];
                n.corner[k] = n.corner[k + 1];
                n.corner[k + 1] = t;
                n.even = -n.even;
            }
    return n;
}

static int by_corners(const void *a, const void *b)
{
    const named_face *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p->corner[k] != q->corner[k]) return p->corner[k] < q->corner[k] ? -1 : 1;
    return p->face < q->face ? -1 : p->face > q->face;
}

/* Of equal faces that face the same way one stays; a pair back to back encloses nothing and goes
 * altogether. */
static size_t mark_duplicates(const named_face *list, size_t n, unsigned char *drop)
{
    size_t dropped = 0;
    for (size_t i = 0, end; i < n; i = end) {
        int balance = 0;
        for (end = i; end < n && !memcmp(list[end].corner, list[i].corner, sizeof list[i].corner);
             end++)
            balance += list[end].even;
        bool kept = balance == 0 && end - i > 1;
        for (size_t k = i; k < end; k++) {
            if (!kept && (balance >= 0) == (list[k].even > 0)) {
                kept = true;
                continue;
            }
            drop[list[k].face] = 1;
            dropped++;
        }
    }
    return dropped;
}

apsm_status repair_faces(repair *r)
{
    apsm_mesh *m = &r->mesh;
    const size_t nv = m->nv;
    unsigned char *drop = calloc(m->nf, 1);
    named_face *list = malloc(m->nf * sizeof *list);
    apsm_status status = drop && list ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        size_t n = 0, repeated = 0;
        for (uint32_t f = 0; f < m->nf; f++) {
            list[n] = name_face(m->F, f);
            const uint32_t *c = list[n].corner;
            if (c[0] == c[1] || c[1] == c[2]) {
                drop[f] = 1;
                repeated++;
            } else {
                n++;
            }
        }
        qsort(list, n, sizeof *list, by_corners);
        r->report->degenerate_faces += repeated;
        r->report->duplicate_faces += mark_duplicates(list, n, drop);
        status = repair_drop(m, drop);
        r->report->unused_vertices = nv - m->nv - r->report->merged_vertices;
    }
    free(drop);
    free(list);
    return status;
}
