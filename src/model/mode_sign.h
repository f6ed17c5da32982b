/* mode_sign.h -- which end of a mode is plus: a rule that does not hang on where particles are, so
 * that scores of two models of the same shapes have the same sign. */
#ifndef APSM_MODEL_MODE_SIGN_H
#define APSM_MODEL_MODE_SIGN_H

#include <stddef.h>

enum { APSM_MODE_CHANGES = 4 };
/* Modes whose direction is less than this are a near tie, and decided by the scores. */
#define APSM_MODE_TIE 0.03

/* change (out) <- what the mode (J x 3, unit length) does to the mean (J x 3): to its size, and to
 * its extent along each of its three principal axes; correlations in [-1, 1].  All 0 where the mean
 * is a point, beside `tiny`. */
void apsm_mode_changes(size_t J, const double *mean, const double *mode, double tiny,
                       double change[APSM_MODE_CHANGES]);

/* The largest increase less the largest decrease: positive where the mode is the right way round.
 */
double apsm_mode_direction(const double change[APSM_MODE_CHANGES]);

/* 1 or -1, with which a mode of these changes and scores (I, `stride` apart) is to be multiplied;
 * 0: neither changes nor scores tell. */
double apsm_mode_sign(const double change[APSM_MODE_CHANGES], size_t I, size_t stride,
                      const double *score);

#endif
