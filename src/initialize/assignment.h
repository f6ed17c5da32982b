/* assignment.h -- who becomes whom: the cheapest one-to-one assignment, and the paper's use of it
 * to give farthest-point samples the names of the reference's particles (docs/method.md,
 * "Initialisation"). */
#ifndef APSM_ASSIGNMENT_H
#define APSM_ASSIGNMENT_H

#include "geometry/geodesic.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Scratch of apsm_assign, in bytes. */
size_t apsm_assign_work_size(size_t n);

/* cost (n x n, row-major, finite): column[row] (n, out) with the least sum of
 * cost[row][column[row]].  row_price and column_price (n each, out) prove it:
 * cost >= row_price + column_price everywhere (to rounding), with equality on the assignment.
 * Shortest augmenting paths; O(n^3) at worst.  work: scratch, aligned for double.
 * APSM_ERR_NONFINITE if a cost is not finite. */
apsm_status apsm_assign(size_t n, const double *cost, uint32_t *column, double *row_price,
                        double *column_price, void *work) APSM_NODISCARD;

/* Scratch of apsm_match_samples, in bytes: dominated by a J x J matrix. */
size_t apsm_match_samples_work_size(size_t J);

/* Names J samples after J reference particles that were aligned and projected onto the same
 * surface: matched[j] (out) is the sample given to particle j; cost is geodesic distance, and
 * what is out of reach (another component) costs more than anything within.  J geodesic searches
 * over the whole surface.  work: scratch, aligned for double. */
apsm_status apsm_match_samples(const apsm_geodesic *g, apsm_geodesic_work *w, size_t J,
                               const apsm_surface_point *reference,
                               const apsm_surface_point *samples, apsm_surface_point *matched,
                               void *work) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
