/* landmarks.h -- a shape from a few points of it that the model knows. */
#ifndef APSM_FIT_LANDMARKS_H
#define APSM_FIT_LANDMARKS_H

#include "fit/parts.h"

/* Particles, pose and deviations from n points x (n x 3, input frame) that are at `at` (n x 3) on
 * the mean shape.  n >= 3. */
apsm_status fit_landmark_particles(apsm_context *ctx, fit_job *job, size_t n, const double *at,
                                   const double *x) APSM_NODISCARD;

#endif
