/* twins.h -- shapes that are nearly the same: one subject under two names? */
#ifndef APSM_JUDGE_TWINS_H
#define APSM_JUDGE_TWINS_H

#include <stdint.h>

#include "apsm/context.h"

/* twin[i] (I) <- the first shape before i that is nearly the same, or i: its particles Q (I x J x
 * 3, in one pose and size) are a quarter as far from that one's as shapes usually are from X (I x J
 * x 3), the logarithms of their sizes (I) nearly agree, and nobody else is near.  work: I.  Only
 * shapes of one size are compared, and only until they are seen to be too far apart. */
apsm_status apsm_twins_find(apsm_context *ctx, size_t I, size_t J, const double *Q, const double *X,
                            const double *size, uint32_t *twin, double *work) APSM_NODISCARD;

#endif
