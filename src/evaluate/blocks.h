/* blocks.h -- particle vectors laid out for the machine: blocks of 64 particles, each all x, all y,
 * all z, the last one filled up with zeros.  A row of J particles has apsm_blocks_row(J) entries.
 */
#ifndef APSM_EVALUATE_BLOCKS_H
#define APSM_EVALUATE_BLOCKS_H

#include <stddef.h>

#define APSM_BLOCK 64

size_t apsm_blocks_row(size_t J);
/* row (apsm_blocks_row(J), out) from x (J x 3). */
void apsm_blocks_pack(size_t J, const double *x, double *row);

/* Sum over the particles of |a| (n blocks), and of |a - b|.  The order of summation is fixed by
 * the source: 8 running sums, the same on every machine. */
double apsm_blocks_norm(size_t n, const double *a);
double apsm_blocks_distance(size_t n, const double *a, const double *b);
/* a <- a + s b. */
void apsm_blocks_add(size_t n, double s, const double *b, double *a);

#endif
