/* nearest.h -- which of a set of points is nearest, by trying all of them. */
#ifndef APSM_GEOMETRY_NEAREST_H
#define APSM_GEOMETRY_NEAREST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Of every point of X (n x 3) the nearest of P (J x 3; J > 0), the first of several, and its
 * distance.  itself: X is P, and no point is its own nearest (of one alone: 0, INFINITY).  work:
 * 4J.  O(n J), in lanes. */
void apsm_nearest_points(size_t n, const double *X, size_t J, const double *P, bool itself,
                         double *work, uint32_t *nearest, double *distance);

#endif
