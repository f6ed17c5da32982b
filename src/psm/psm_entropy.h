/* psm_entropy.h -- the correspondence term of `psm` (docs/method.md, "Comparison methods"), in the
 * dual (I x I) form:
 *   Y rows q_i - mean (I x 3J),  M = (Y Y^T / (I - 1) + reg I)^-1
 *   H(Z) = (I - 1) / 2 log det M^-1,   dH / dY = M Y
 * The mean energy |Y|^2 / 2 is the same with M = I. */
#ifndef APSM_PSM_ENTROPY_H
#define APSM_PSM_ENTROPY_H

#include <stddef.h>

#include "apsm/status.h"

size_t psm_entropy_work_size(size_t I, size_t n); /* in doubles */

/* Q (I x n): in, the shapes' particles in the common frame; out, Y.  grad (I x n, out) = M Y;
 * blocks (n x 3, out): the 3 x 3 blocks on the diagonal of Y^T M^2 Y, one a particle (of the mean
 * energy: I); value (out): H.  reg > 0; reg = INFINITY: the mean energy.  O(I^2 n + I^3).
 * APSM_ERR_SINGULAR on overflow. */
apsm_status psm_entropy(size_t I, size_t n, double reg, double *Q, double *grad, double *blocks,
                        double *value, double *work) APSM_NODISCARD;

/* The largest eigenvalue of Y Y^T / (I - 1); Q as above. */
apsm_status psm_largest_variance(size_t I, size_t n, double *Q, double *largest,
                                 double *work) APSM_NODISCARD;

#endif
