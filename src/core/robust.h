/* robust.h -- medians, and what is usual when one value is left out: a fault must not make itself
 * usual. */
#ifndef APSM_CORE_ROBUST_H
#define APSM_CORE_ROBUST_H

#include <stddef.h>
#include <stdint.h>

/* The k-th smallest (from 0) of v (n > k, no NaN), which is reordered.  O(n) as a rule. */
double robust_select(size_t n, double *v, size_t k);

/* Median of x (n >= 1), which is sorted. */
double robust_median(size_t n, double *x);

/* out (I x n) <- median over the other rows of X (I x n, I >= 2), each column for itself.  O(n I
 * log I).  column: scratch, I. */
void robust_left_out_medians(size_t I, size_t n, const double *X, double *out, double *column);

/* out (I) <- the q-quantile, 0 <= q <= 1, of the other x (I >= 2, finite), between two of them in
 * proportion.  sorted: scratch, I.  O(I log I). */
void robust_left_out_quantiles(size_t I, const double *x, double q, double *out, double *sorted);

/* Of each x[i] (I >= 3, finite) the median of the others, and how many standard deviations it lies
 * above that.  The standard deviation is told from the others' median distance from their median
 * (1.4826 of it, for normal numbers), and is never taken for less than `least` (> 0).  scratch: I.
 * O(I log I). */
void robust_excesses(size_t I, const double *x, double least, double *excess, double *median,
                     double *scratch);

/* Correlation of x[stride * k] and y[stride * at[k]], k < n (at NULL: k); 0 where one is constant.
 */
double robust_correlation(size_t n, size_t stride, const double *x, const double *y,
                          const uint32_t *at);

#endif
