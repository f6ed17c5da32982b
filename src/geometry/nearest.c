#include "geometry/nearest.h"

#include <math.h>

#include "core/kernel.h"

enum { LANES = 8 };

/* d2 (J): squared distances of p from the points Q (3 x J, by coordinate). */
KERNEL_INLINE void square_distances(size_t J, const double *Q, const double *p, double *d2)
{
    const double *x = Q, *y = Q + J, *z = Q + 2 * J;
    for (size_t k = 0; k < J; k++) {
        const double a = p[0] - x[k], b = p[1] - y[k], c = p[2] - z[k];
        d2[k] = a * a + b * b + c * c;
    }
}

/* The place of the first least of n > 0 numbers. */
KERNEL_INLINE size_t first_least(size_t n, const double *x)
{
    const size_t whole = n - n % LANES;
    double lane[LANES], least = INFINITY;
    for (size_t l = 0; l < LANES; l++) lane[l] = INFINITY;
    for (size_t k = 0; k < whole; k += LANES)
        for (size_t l = 0; l < LANES; l++) lane[l] = x[k + l] < lane[l] ? x[k + l] : lane[l];
    for (size_t l = 0; l < LANES; l++) least = lane[l] < least ? lane[l] : least;
    for (size_t k = whole; k < n; k++) least = x[k] < least ? x[k] : least;
    size_t first = 0;
    while (first + 1 < n && x[first] > least) first++;
    return first;
}

APSM_KERNEL void apsm_nearest_points(size_t n, const double *X, size_t J, const double *P,
                                     bool itself, double *work, uint32_t *nearest, double *distance)
{
    double *d2 = work + 3 * J;
    for (size_t k = 0; k < 3 * J; k++) work[k % 3 * J + k / 3] = P[k];
    for (size_t v = 0; v < n; v++) {
        square_distances(J, work, X + 3 * v, d2);
        if (itself) d2[v] = INFINITY;
        nearest[v] = (uint32_t)first_least(J, d2);
        distance[v] = sqrt(d2[nearest[v]]);
    }
}
