/* mode_trust.h -- how far a mode of variation can be trusted: would other shapes of the same kind
 * have shown it, and is it more than chance leaves? */
#ifndef APSM_MODEL_MODE_TRUST_H
#define APSM_MODEL_MODE_TRUST_H

#include <stdbool.h>

#include "model/shape_model.h"

/* Bounds of trust: a mode is trusted if half of the cohorts drawn again have it to within this
 * cosine, its variance is above chance, and its direction (mode_sign.h) is no near tie. */
#define APSM_MODE_COSINE 0.8
#define APSM_MODE_CLEAR  0.1

typedef struct apsm_mode_trust {
    double cosine;    /* with the same mode of cohorts drawn again: the median; 0 for modes beyond
                         the first 32 */
    double direction; /* see mode_sign.h */
    double same_sign; /* share of these whose direction has the same sign */
    double share;     /* of the variance */
    double chance;    /* share that the mode of this rank has of a stick broken at random */
    bool trusted;
} apsm_mode_trust;

/* trust (modes, out).  Shapes are drawn again a hundred times, with replacement, from streams of
 * the context's seed. */
apsm_status apsm_mode_trust_of(apsm_context *ctx, const apsm_shape_model *model,
                               apsm_mode_trust *trust) APSM_NODISCARD;

/* "can be trusted", or why not: constant string. */
const char *apsm_mode_trust_text(const apsm_mode_trust *trust);

#endif
