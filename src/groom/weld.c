/* Vertices that coincide, by hashing cells of a grid. */
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
