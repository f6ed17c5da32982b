/* elastic.h -- curves as points at equal arc lengths, and the elastic matching of two of them. */
#ifndef APSM_CONTOUR_ELASTIC_H
#define APSM_CONTOUR_ELASTIC_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/status.h"

/* Q (m x 3, out) <- m points of the polyline P (n x 3) at equal arc lengths from its first on;
 * closed: without the first again, open: up to the last.  Returns the length; 0: all points are
 * one. */
double curve_resample(size_t n, const double *P, bool closed, size_t m, double *Q);

/* The point at parameter t of a curve of m equal steps (Q, m x 3; t in steps). */
void curve_at(size_t m, const double *Q, bool closed, double t, double x[3]);

/* gamma (m, out) <- at which parameter (in steps) curve B has what A has at its k-th point: the
 * monotone map of least elastic energy (Srivastava et al. 2011), by dynamic programming.  A and B
 * (m x 3) begin at the same place.  work: curve_match_size(m). */
size_t curve_match_size(size_t m);
double curve_match(size_t m, const double *A, const double *B, bool closed, double *gamma,
                   double *work);

/* t (J, out) <- parameters of J places on a curve Q, closer together where it bends: density 1 +
 * adaptivity times the bend over its mean. */
void curve_places(size_t m, const double *Q, bool closed, double adaptivity, size_t J, double *t);

/* Mean distance from points X (n x 3) to the polyline Q (m x 3); *most (out) the largest. */
double curve_distance(size_t n, const double *X, size_t m, const double *Q, bool closed,
                      double *most);

#endif
