/* posterior.h -- probabilistic PCA given measurements: equations (40)-(44) of docs/method.md.
 *
 *   x = mean + U b + e,   b_k ~ N(0, variance_k),   e ~ N(0, noise I)                       (40)
 *   y = A x + r,          r ~ N(0, R)                                                       (41)
 *
 * Kernels: they allocate nothing and hold no state.  Modes need not be orthogonal, so a smooth
 * process beside the modes is a few modes more. */
#ifndef APSM_FIT_POSTERIOR_H
#define APSM_FIT_POSTERIOR_H

#include <stddef.h>

#include "apsm/status.h"

/* All borrowed. */
typedef struct posterior_model {
    size_t D, M;
    const double *mean;     /* D */
    const double *mode;     /* M x D: the rows of U' */
    const double *variance; /* M, > 0 */
    double noise;           /* variance of a coordinate beside the modes, > 0 */
} posterior_model;

/* What is known of b; the caller's arrays. */
typedef struct posterior_scores {
    double *b;                           /* M: mean */
    double *B;                           /* M x M, full: covariance */
    double log_likelihood, mahalanobis2; /* of y under the model */
} posterior_scores;

/* Any linear measurements.  A (n x D), R (n x n, lower triangle), y (n): borrowed. */
typedef struct posterior_seen {
    size_t n;
    const double *A, *R, *y;
} posterior_seen;

/* Scratch in doubles, for n measurements. */
size_t posterior_work_size(const posterior_model *m, size_t n);

/* Scores (out), and x (D, out): mean of all coordinates, C (D x D, out, full): their covariance;
 * either may be NULL.  O(n^2 (n + D) + D^2 (n + M)).  APSM_ERR_SINGULAR: R and noise leave a
 * measurement without error. */
apsm_status posterior_of(const posterior_model *m, const posterior_seen *seen,
                         posterior_scores *scores, double *x, double *C,
                         double *work) APSM_NODISCARD;

/* How far measurements are from what the others say, three coordinates at a time (n a multiple of
 * 3): miss (n, out), and z2 (n / 3, out): its squared Mahalanobis distance, of 3 degrees of freedom
 * where (40) and (41) hold.  work of posterior_left_out_size.  O(n^3). */
size_t posterior_left_out_size(const posterior_model *m, size_t n);
apsm_status posterior_left_out(const posterior_model *m, const posterior_seen *seen, double *miss,
                               double *z2, double *work) APSM_NODISCARD;

/* The same where particles themselves are measured, y (D), each coordinate with the error variance
 * error[j] of its particle j; INFINITY: not seen.  x (D, out), block (D/3 x 9, out): covariance of
 * each particle; either may be NULL.  O(D M^2). */
size_t posterior_particles_work_size(const posterior_model *m);
apsm_status posterior_of_particles(const posterior_model *m, const double *y, const double *error,
                                   posterior_scores *scores, double *x, double *block,
                                   double *work) APSM_NODISCARD;

/* As above where only the coordinate along a unit normal (D: one for each particle) is measured, as
 * a surface does that shows no marks: y (D) is any point with that coordinate. */
apsm_status posterior_along_normals(const posterior_model *m, const double *normal, const double *y,
                                    const double *error, posterior_scores *scores, double *x,
                                    double *block, double *work) APSM_NODISCARD;

#endif
