/* eigenshape_loss.h -- asks that the cohort varies in few ways.  docs/method.md, (9), (10), in the
 * dual (K x K) form:
 *   Y rows p_i - mean (K x 3J),  G = Y Y^T / (3JK),  L = 1/2 log det(G + reg I)
 *   dL/dp_i = row i of (G + reg I)^-1 Y / (3JK)
 * One call a cohort makes and factors G; then every shape's gradient is a call of its own, so
 * that shapes can be done in parallel. */
#ifndef APSM_EIGENSHAPE_LOSS_H
#define APSM_EIGENSHAPE_LOSS_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_eigenshape_options {
    double reg;      /* > 0 */
    bool relative;   /* reg is multiplied by trace(G) / K, else it is a squared length */
    double least;    /* reg is at least this squared length; 0: no bound.  A step of size b along
                        the gradient takes at most b / least of a deviation away: without a bound the
                        directions of least variance are overshot when the shapes are many */
    bool times_size; /* multiply loss and gradient by 3JK: independent of J and K */
} apsm_eigenshape_options;

apsm_eigenshape_options apsm_eigenshape_defaults(void); /* 0.02, relative, times_size */

/* mean (3J, out) of the K rows of P (K x 3J). */
void apsm_cohort_mean(size_t K, size_t J, const double *P, double *mean);
/* Y (K x 3J, out; may be P) = P - mean: the batch's own mean, or a lagged one. */
void apsm_cohort_centre(size_t K, size_t J, const double *P, const double *mean, double *Y);

/* Loss and L (K x K, out), the Cholesky factor of G + reg I.  reg_used (out, NULL allowed): in
 * squared length.  O(K^2 J + K^3).  APSM_ERR_SINGULAR if all shapes are equal and reg is
 * relative, or on overflow. */
apsm_status apsm_eigenshape_loss(size_t K, size_t J, const double *Y,
                                 const apsm_eigenshape_options *opt, double *loss, double *L,
                                 double *reg_used) APSM_NODISCARD;
/* grad (3J, out) of shape k; work: K doubles.  O(K^2 + K J).  Exact for the batch mean too, whose
 * own gradient cancels. */
void apsm_eigenshape_gradient(size_t K, size_t J, const double *Y, const double *L,
                              const apsm_eigenshape_options *opt, size_t k, double *grad,
                              double *work);

#ifdef __cplusplus
}
#endif
#endif
