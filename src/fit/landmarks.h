/* landmarks.h -- a shape from a few points of it that the model knows. */
#ifndef APSM_FIT_LANDMARKS_H
#define APSM_FIT_LANDMARKS_H

#include "fit/parts.h"

/* Particles, pose and deviations from n points x (n x 3, input frame) that are at `at` (n x 3) on
 * the mean shape.  n >= 3. */
apsm_status fit_landmark_particles(apsm_context *ctx, fit_job *job, size_t n, const double *at,
                                   const double *x) APSM_NODISCARD;

/* n landmarks, borrowed. */
typedef struct fit_landmark_set {
    size_t n;
    const double *at, *x;    /* n x 3: on the mean, on the shape */
    const char *const *name; /* n, or NULL */
} fit_landmark_set;

/* apsm_fit_landmarks for landmarks that may have names, by which the verdict then calls them. */
apsm_status fit_named_landmarks(apsm_context *ctx, const apsm_fit_model *model, const char *name,
                                const fit_landmark_set *given,
                                const apsm_fit_call *call) APSM_NODISCARD;

#endif
