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

#include "core/option.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { APSM_EIGEN_FULL, APSM_EIGEN_NONE };
#define APSM_EIGENSHAPE_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                   \
    REAL(S, eigen_reg, 0.02, 0, 1e6, "reg in (9), relative to trace(G)/K")                         \
    REAL(S, eigen_reg_absolute, 0, 0, 1e300,                                                       \
         "reg in (9) in squared input units; 0: use eigen_reg")                                    \
    REAL(S, eigen_share, 0.2, 0, 1e6,                                                              \
         "largest share of a deviation that the eigenshape loss removes in an epoch (bounds reg "  \
         "from below); 0: no bound")                                                               \
    ENUM(S, eigen_scale, "full|none", "factor of (10): 3JK, or 1 (paper)")
typedef struct apsm_eigenshape_options {
    APSM_OPTION_FIELDS(APSM_EIGENSHAPE_OPTIONS)
    double least; /* reg is at least this squared length; 0: no bound.  A step of size b along the
                     gradient takes at most b / least of a deviation away: without a bound the
                     directions of least variance are overshot when the shapes are many */
} apsm_eigenshape_options;

apsm_eigenshape_options apsm_eigenshape_defaults(void); /* no bound */

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
