#include "judge/twins.h"

#include <math.h>
#include <stdlib.h>

#include "core/robust.h"

/* Of the usual distance, of the logarithms of sizes, and how many times as far as the twin whoever
 * is none has to be: where shapes vary in one way only, many are near. */
static const double near = 0.25, alike = 0.01, apart = 3.0;

static double distance2(size_t n, const double *x, const double *y, double most)
{
    double sum = 0.0;
    for (size_t k = 0; k < n && sum <= most; k++) sum += (x[k] - y[k]) * (x[k] - y[k]);
    return sum;
}

/* The first shape that is near to shape i, whose squared distances from the others, or more than
 * enough, are d2; i if there is none. */
static size_t find_twin(size_t I, size_t i, const double *d2, const double *size, double most)
{
    size_t twin = i;
    double nearest = INFINITY;
    for (size_t k = 0; k < I; k++) {
        if (k == i || d2[k] > most || fabs(size[i] - size[k]) > alike) continue;
        nearest = fmin(nearest, d2[k]);
        if (twin == i) twin = k;
    }
    for (size_t k = 0; k < I; k++)
        if (k != i && d2[k] > most && d2[k] <= apart * apart * nearest && twin != i) return i;
    return twin;
}

void apsm_twins_find(size_t I, size_t J, const double *Q, const double *X, const double *size,
                     uint32_t *twin, double *work)
{
    const size_t n = 3 * J;
    for (size_t i = 0; i < I; i++) work[i] = distance2(n, Q + n * i, X + n * i, INFINITY);
    const double most = near * near * robust_median(I, work);
    for (size_t i = 0; i < I; i++) {
        for (size_t k = 0; k < I; k++)
            work[k] = distance2(n, Q + n * i, Q + n * k, apart * apart * most);
        const size_t first = find_twin(I, i, work, size, most);
        twin[i] = (uint32_t)(first < i ? first : i);
    }
}
