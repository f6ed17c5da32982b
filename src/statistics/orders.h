/* orders.h -- the orders in which the rows of a design are dealt out again: all that differ, or
 * random ones.  Rows move within their block only. */
#ifndef APSM_STATISTICS_ORDERS_H
#define APSM_STATISTICS_ORDERS_H

#include <stdbool.h>

#include "apsm/context.h"
#include "statistics/design.h"

/* Owns its arrays; zero-initialise with {0}, apsm_orders_free leaves it so. */
typedef struct apsm_orders {
    size_t N, blocks;
    size_t *row;      /* N: rows, block after block */
    size_t *first;    /* blocks + 1 */
    size_t *class_of; /* N: rows of a block that are the same row of the design share a class */
    double all;       /* how many orders differ; INFINITY if beyond 1e15 */
    bool exact;       /* all of them are gone through; else `count` random ones */
    size_t count;     /* orders, the given one (number 0) included if exact */
} apsm_orders;

/* At most `most` orders (>= 1).  block (N): which rows may change places; NULL: all.  Where the
 * reduced columns are alike within blocks, orders that give the same design count once. */
apsm_status apsm_orders_make(apsm_context *ctx, const apsm_design *design, const size_t *block,
                             size_t most, apsm_orders *orders) APSM_NODISCARD;
void apsm_orders_free(apsm_orders *orders);

/* sigma (N, out): row i of the design comes from row sigma[i] in order k < count.  Exact: number 0
 * is the given order; else a draw of the stream (seed, k).  work: 2 N sizes.  O(N), exact O(N^2).
 */
void apsm_orders_get(const apsm_orders *orders, uint64_t seed, size_t k, size_t *sigma,
                     size_t *work);

/* sign (N, out): 1 or -1, a draw of the stream (seed, k). */
void apsm_orders_signs(size_t N, uint64_t seed, size_t k, double *sign);

#endif
