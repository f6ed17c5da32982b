/* The medoid: the shape of least mean residual to the others (docs/method.md, "Pose").  Exact up to
 * 32 shapes; beyond, the best of 32 drawn candidates judged on 64 drawn shapes, so that the number
 * of comparisons does not grow with the cohort, in a race: part by part of the shapes, whoever is
 * clearly worse than the best so far drops out. */
#include "align/medoid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"

static int ascending(const void *a, const void *b)
{
    const size_t x = *(const size_t *)a, y = *(const size_t *)b;
    return (x > y) - (x < y);
}

/* m of the n indices without repetition, ascending (the beginning of a Fisher-Yates shuffle). */
static void draw(size_t n, size_t *index, size_t m, apsm_random *rng, size_t *out)
{
    for (size_t k = 0; k < m; k++) {
        const size_t j = k + (size_t)apsm_random_below(rng, n - k), t = index[j];
        index[j] = index[k];
        index[k] = out[k] = t;
    }
    qsort(out, m, sizeof *out, ascending);
}

void apsm_medoid_draw(size_t n, size_t *eligible, uint64_t seed, apsm_medoid_plan *plan)
{
    memset(plan->out, 0, sizeof plan->out);
    if (n <= APSM_MEDOID_CANDIDATES) {
        plan->candidates = plan->shapes = n;
        memcpy(plan->candidate, eligible, n * sizeof *eligible);
        memcpy(plan->shape, eligible, n * sizeof *eligible);
        return;
    }
    apsm_random rng = apsm_random_stream(seed, APSM_STREAM_MEDOID, 0, 0);
    plan->candidates = APSM_MEDOID_CANDIDATES;
    plan->shapes = n < APSM_MEDOID_SHAPES ? n : APSM_MEDOID_SHAPES;
    draw(n, eligible, plan->candidates, &rng, plan->candidate);
    draw(n, eligible, plan->shapes, &rng, plan->shape);
}

/* Of candidate a to the other shapes of parts 0 to `parts` - 1. */
static double mean_residual(const apsm_medoid_plan *plan, size_t parts, const double *R, size_t a)
{
    double sum = 0.0;
    size_t others = 0;
    for (size_t b = 0; b < plan->shapes; b++) {
        if (b % APSM_MEDOID_PARTS >= parts || plan->shape[b] == plan->candidate[a]) continue;
        sum += R[a * plan->shapes + b];
        others++;
    }
    return others > 0 ? sum / (double)others : 0.0;
}

/* Of those that are not out, by parts 0 to `parts` - 1. */
static size_t best_so_far(const apsm_medoid_plan *plan, size_t parts, const double *R)
{
    size_t best = 0;
    double least = INFINITY;
    for (size_t a = 0; a < plan->candidates; a++) {
        const double mean = plan->out[a] ? INFINITY : mean_residual(plan, parts, R, a);
        if (mean < least) {
            least = mean;
            best = a;
        }
    }
    return best;
}

/* How much worse candidate a is than c, by the shapes of the parts that both were compared with:
 * the mean difference of their residuals in its standard errors; 0 if they are too few to tell. */
static double behind(const apsm_medoid_plan *plan, size_t parts, const double *R, size_t a,
                     size_t c)
{
    enum { LEAST = 8 };
    double n = 0.0, sum = 0.0, squares = 0.0;
    for (size_t b = 0; b < plan->shapes; b++) {
        const size_t shape = plan->shape[b];
        if (b % APSM_MEDOID_PARTS >= parts) continue;
        if (shape == plan->candidate[a] || shape == plan->candidate[c]) continue;
        const double d = R[a * plan->shapes + b] - R[c * plan->shapes + b];
        n += 1.0;
        sum += d;
        squares += d * d;
    }
    if (n < LEAST || !(sum > 0.0)) return 0.0;
    const double mean = sum / n, variance = fmax(squares / n - mean * mean, 0.0) / (n - 1.0);
    return mean / sqrt(variance); /* INFINITY if all differ by the same */
}

/* Against the best alone: then a candidate that leads by chance drops none that is as good. */
void apsm_medoid_drop(apsm_medoid_plan *plan, size_t parts, const double *R)
{
    static const double chance = 2.5; /* standard errors */
    const size_t best = best_so_far(plan, parts, R);
    for (size_t a = 0; a < plan->candidates; a++)
        plan->out[a] |= a != best && behind(plan, parts, R, a, best) > chance;
}

size_t apsm_medoid_pick(const apsm_medoid_plan *plan, const double *R)
{
    return plan->candidate[best_so_far(plan, APSM_MEDOID_PARTS, R)];
}
