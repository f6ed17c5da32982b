/* landmark_error.h -- the one truth from outside: how far a dense correspondence takes the
 * template's landmarks from where they are on the other shapes. */
#ifndef APSM_EVALUATE_LANDMARK_ERROR_H
#define APSM_EVALUATE_LANDMARK_ERROR_H

#include "landmarks/landmark_table.h"
#include "model/warp.h"

/* Owns its arrays; zero-initialise with {0}.  Means leave the template out, and NAN stands for what
 * is not there: a landmark that the template or the shape misses. */
typedef struct landmark_errors {
    size_t I, L;
    double *error;       /* I x L: distance in the world */
    double *of_shape;    /* I: mean over landmarks */
    double *of_landmark; /* L: mean over shapes */
    double mean;         /* of all */
    size_t judged;       /* how many */
} landmark_errors;

/* The landmarks are in the world, m is the template; P: I x J x 3.  Carried by the warp of
 * docs/method.md, "Metrics". */
apsm_status landmark_errors_of(apsm_context *ctx, const landmark_table *t, size_t m, size_t J,
                               const double *P, landmark_errors *errors) APSM_NODISCARD;
void landmark_errors_free(landmark_errors *errors);

#endif
