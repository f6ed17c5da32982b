/* stopping.h -- when enough orders were drawn: a confidence sequence for p (Robbins, Ann. Math.
 * Stat. 41, 1970; Lai, Ann. Stat. 4, 1976). */
#ifndef APSM_STATISTICS_STOPPING_H
#define APSM_STATISTICS_STOPPING_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

/* [*low, *high] holds p at all n at once with probability 1 - risk, k of the first n random orders
 * having reached the given one:
 *   { p : (n + 1) C(n, k) p^k (1 - p)^(n - k) > risk }                                       (1) */
void stopping_interval(size_t k, size_t n, double risk, double *low, double *high);

/* Whether level lies outside of it. */
bool stopping_is_decided(size_t k, size_t n, double risk, double level);

/* Whether it is known which of V false discovery rates are at most level, whatever the p within
 * their intervals are: those of the lower ends and of the upper ends say the same, and rates rise
 * with each p.  work: 4 V.  O(V log V). */
apsm_status stopping_rates_decided(size_t V, const size_t *k, size_t n, double risk, double level,
                                   double *work, bool *decided) APSM_NODISCARD;

#endif
