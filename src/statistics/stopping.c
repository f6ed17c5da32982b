#include "statistics/stopping.h"

#include <math.h>

#include "statistics/permutation_test.h"

/* Logarithm of the left side of (1); -INFINITY outside of what is possible. */
static double evidence(size_t k, size_t n, double p)
{
    const double a = (double)k, b = (double)(n - k), m = (double)n;
    return log(m + 1) + lgamma(m + 1) - lgamma(a + 1) - lgamma(b + 1) + (k > 0 ? a * log(p) : 0) +
           (k < n ? b * log1p(-p) : 0);
}

/* Where evidence falls to log_risk between `inside`, where it is above, and `outside`. */
static double edge(size_t k, size_t n, double log_risk, double inside, double outside)
{
    for (int halving = 0; halving < 60; halving++) {
        const double p = 0.5 * (inside + outside);
        *(evidence(k, n, p) > log_risk ? &inside : &outside) = p;
    }
    return outside;
}

void stopping_interval(size_t k, size_t n, double risk, double *low, double *high)
{
    const double top = n > 0 ? (double)k / (double)n : 0.5;
    *low = k == 0 || n == 0 ? 0 : edge(k, n, log(risk), top, 0);
    *high = k == n ? 1 : edge(k, n, log(risk), top, 1);
}

bool stopping_is_decided(size_t k, size_t n, double risk, double level)
{
    return evidence(k, n, level) <= log(risk);
}

apsm_status stopping_rates_decided(size_t V, const size_t *k, size_t n, double risk, double level,
                                   double *work, bool *decided)
{
    double *low = work, *high = work + V, *q_low = work + 2 * V, *q_high = work + 3 * V;
    for (size_t v = 0; v < V; v++) stopping_interval(k[v], n, risk, &low[v], &high[v]);
    APSM_TRY(apsm_false_discovery(V, low, q_low));
    APSM_TRY(apsm_false_discovery(V, high, q_high));
    *decided = true;
    for (size_t v = 0; v < V; v++)
        *decided = *decided && (q_low[v] <= level) == (q_high[v] <= level);
    return APSM_OK;
}
