/* tfce.h -- threshold-free cluster enhancement on a graph (Smith & Nichols, NeuroImage 44, 2009): a
 * particle counts for more if its neighbours agree with it. */
#ifndef APSM_STATISTICS_TFCE_H
#define APSM_STATISTICS_TFCE_H

#include <stddef.h>
#include <stdint.h>

/* out_v = integral over heights t from 0 to x_v of e(t)^0.5 t^2 dt, where e(t) is the share of the
 * n nodes in the cluster of those with x >= t that v belongs to.  Exact: between two values of x
 * the clusters stay as they are.  x (n) >= 0; edges (m x 2).  start (n + 1) and to (2 m) are the
 * edges as neighbour lists (tfce_graph); work: 4 n numbers.  O(n log n + m). */
typedef struct tfce_graph {
    size_t n;
    size_t *start; /* n + 1 */
    uint32_t *to;  /* start[n] */
} tfce_graph;

/* Neighbour lists of the pairs (v, near_vk), k < width, both ways; NULL members if out of memory.
 */
tfce_graph tfce_graph_make(size_t n, size_t width, const uint32_t *near);
void tfce_graph_free(tfce_graph *graph);

typedef struct tfce_work {
    uint32_t *order, *parent;
    double *size, *gained, *since; /* of roots; gained of others: what to add to their root's */
} tfce_work;
tfce_work tfce_work_make(size_t n);
void tfce_work_free(tfce_work *work);

void tfce_enhance(const tfce_graph *graph, const double *x, tfce_work *work, double *out);

#endif
