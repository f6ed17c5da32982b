/* effect.h -- how large an effect is and how sure: differences of adjusted means, slopes, and their
 * bootstrap bands. */
#ifndef APSM_STATISTICS_EFFECT_H
#define APSM_STATISTICS_EFFECT_H

#include "apsm/context.h"
#include "statistics/design.h"

/* A contrast c (s) of the tested coefficients B_T: the effect is c B_T, of V variables of w
 * numbers. */
typedef struct apsm_effect_input {
    const apsm_design *design;
    const double *Y; /* N x V x w */
    size_t V, w;
    const double *contrast;  /* s = q - r */
    const double *direction; /* V x w unit vectors along which bands are given, or NULL: w is 1 */
    const size_t *stratum;   /* N: subjects are drawn again within their stratum; NULL: among all */
    size_t bootstraps;       /* 0: no bands */
} apsm_effect_input;

/* Owns its arrays; zero-initialise with {0}, apsm_effect_free leaves it so. */
typedef struct apsm_effect {
    size_t V, w;
    double *effect;       /* V x w */
    double *standardised; /* V: Mahalanobis length of the effect by what is left of the variation
                             (covariance E / (N - q)): in standard deviations, >= 0 */
    double *along;        /* V: along the direction */
    double *low, *high;   /* V: 95 % of the bootstraps of that lie between; NULL without */
} apsm_effect;

/* Bootstraps redraw subjects (stream (seed, APSM_STREAM_BOOTSTRAP, k)); a draw whose design is
 * singular is drawn again.  Percentile intervals.  O(bootstraps N q V w). */
apsm_status apsm_effect_measure(apsm_context *ctx, const apsm_effect_input *input,
                                apsm_effect *effect) APSM_NODISCARD;
void apsm_effect_free(apsm_effect *effect);

/* Normal approximation: the shift, in standard deviations of one number, that two groups of these
 * sizes show with probability `power` at two-sided level alpha. */
double apsm_detectable_shift(size_t n1, size_t n2, double alpha, double power);

#endif
