/* The medoid: the shape of least mean residual to the others (METHOD section 7a).  Exact up to 32
 * shapes; beyond, the best of 32 drawn candidates judged on 64 drawn shapes, so that the number
 * of comparisons does not grow with the cohort. */
#include "groom/medoid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/random.h"

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

size_t apsm_medoid_pick(const apsm_medoid_plan *plan, const double *R)
{
    size_t best = 0;
    double least = INFINITY;
    for (size_t a = 0; a < plan->candidates; a++) {
        double sum = 0.0;
        size_t others = 0;
        for (size_t b = 0; b < plan->shapes; b++) {
            if (plan->shape[b] == plan->candidate[a]) continue;
            sum += R[a * plan->shapes + b];
            others++;
        }
        const double mean = others > 0 ? sum / (double)others : 0.0;
        if (mean < least) {
            least = mean;
            best = a;
        }
    }
    return plan->candidate[best];
}
