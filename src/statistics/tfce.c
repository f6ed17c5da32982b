/* Nodes join from the highest down; a union-find keeps the clusters.  A root holds what its cluster
 * has gained since it began, up to the height `since`; when a cluster joins another, its root keeps
 * the difference to its new root, so that a node's gain is the sum up its path. */
#include "statistics/tfce.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void count_edges(tfce_graph *g, size_t width, const uint32_t *near)
{
    for (size_t v = 0; v < g->n; v++)
        for (size_t k = 0; k < width; k++) {
            g->start[v + 1]++;
            g->start[near[v * width + k] + 1]++;
        }
    for (size_t v = 0; v < g->n; v++) g->start[v + 1] += g->start[v];
}

tfce_graph tfce_graph_make(size_t n, size_t width, const uint32_t *near)
{
    tfce_graph g = { n, calloc(n + 1, sizeof *g.start),
                     malloc((2 * n * width + 1) * sizeof *g.to) };
    size_t *at = malloc((n + 1) * sizeof *at);
    if (!g.start || !g.to || !at) {
        tfce_graph_free(&g);
    } else {
        count_edges(&g, width, near);
        memcpy(at, g.start, (n + 1) * sizeof *at);
        for (size_t v = 0; v < n; v++)
            for (size_t k = 0; k < width; k++) {
                const uint32_t w = near[v * width + k];
                g.to[at[v]++] = w;
                g.to[at[w]++] = (uint32_t)v;
            }
    }
    free(at);
    return g;
}

void tfce_graph_free(tfce_graph *graph)
{
    free(graph->start);
    free(graph->to);
    *graph = (tfce_graph){ 0 };
}

tfce_work tfce_work_make(size_t n)
{
    tfce_work w = { malloc((n + 1) * sizeof *w.order), malloc((n + 1) * sizeof *w.parent),
                    malloc((n + 1) * sizeof *w.size), malloc((n + 1) * sizeof *w.gained),
                    malloc((n + 1) * sizeof *w.since) };
    if (!w.order || !w.parent || !w.size || !w.gained || !w.since) tfce_work_free(&w);
    return w;
}

void tfce_work_free(tfce_work *work)
{
    free(work->order);
    free(work->parent);
    free(work->size);
    free(work->gained);
    free(work->since);
    *work = (tfce_work){ 0 };
}

/* By falling x, equal ones by number: heap sort, which needs no memory of its own. */
static int comes_first(const double *x, uint32_t a, uint32_t b)
{
    return x[a] > x[b] || (x[a] == x[b] && a < b);
}

static void sift(const double *x, uint32_t *heap, size_t n, size_t at)
{
    for (size_t child; (child = 2 * at + 1) < n; at = child) {
        if (child + 1 < n && comes_first(x, heap[child], heap[child + 1])) child++;
        if (!comes_first(x, heap[at], heap[child])) return;
        const uint32_t node = heap[at];
        heap[at] = heap[child];
        heap[child] = node;
    }
}

static void sort_falling(const double *x, uint32_t *order, size_t n)
{
    for (size_t v = 0; v < n; v++) order[v] = (uint32_t)v;
    for (size_t v = n / 2; v-- > 0;) sift(x, order, n, v);
    for (size_t m = n; m-- > 1;) {
        const uint32_t last = order[0];
        order[0] = order[m];
        order[m] = last;
        sift(x, order, m, 0);
    }
}

/* Halves the path, keeping the sums along it. */
static uint32_t find(tfce_work *w, uint32_t v)
{
    while (w->parent[v] != v) {
        const uint32_t p = w->parent[v], up = w->parent[p];
        if (up != p) {
            w->gained[v] += w->gained[p];
            w->parent[v] = up;
        }
        v = up;
    }
    return v;
}

/* What the cluster of this root gains from its last height down to t. */
static void gain_to(tfce_work *w, uint32_t root, double t, double n)
{
    const double from = w->since[root];
    w->gained[root] += sqrt(w->size[root] / n) * (from * from * from - t * t * t) / 3;
    w->since[root] = t;
}

static void join(tfce_work *w, uint32_t a, uint32_t b, double t, double n)
{
    a = find(w, a);
    b = find(w, b);
    if (a == b) return;
    gain_to(w, a, t, n);
    gain_to(w, b, t, n);
    const uint32_t root = w->size[a] >= w->size[b] ? a : b, other = root == a ? b : a;
    w->parent[other] = root;
    w->gained[other] -= w->gained[root];
    w->size[root] += w->size[other];
}

void tfce_enhance(const tfce_graph *g, const double *x, tfce_work *w, double *out)
{
    const double n = (double)g->n;
    const uint32_t none = UINT32_MAX;
    for (size_t v = 0; v < g->n; v++) w->parent[v] = none;
    sort_falling(x, w->order, g->n);
    for (size_t k = 0; k < g->n; k++) {
        const uint32_t v = w->order[k];
        w->parent[v] = v;
        w->size[v] = 1;
        w->gained[v] = 0;
        w->since[v] = x[v];
        for (size_t e = g->start[v]; e < g->start[v + 1]; e++)
            if (w->parent[g->to[e]] != none) join(w, v, g->to[e], x[v], n);
    }
    for (uint32_t v = 0; v < g->n; v++)
        if (w->parent[v] == v) gain_to(w, v, 0, n);
    for (uint32_t v = 0; v < g->n; v++) {
        const uint32_t root = find(w, v);
        out[v] = v == root ? w->gained[v] : w->gained[v] + w->gained[root];
        for (uint32_t p = w->parent[v]; v != root && p != root; p = w->parent[p])
            out[v] += w->gained[p];
    }
}
