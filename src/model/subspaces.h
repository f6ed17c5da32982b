/* subspaces.h -- how alike are the variations of two models, both given at the same places. */
#ifndef APSM_MODEL_SUBSPACES_H
#define APSM_MODEL_SUBSPACES_H

#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Scratch in doubles for a and b modes of D coordinates. */
size_t apsm_subspaces_work_size(size_t a, size_t b, size_t D);

/* Principal angles between the spans of the rows of A (a x D) and B (b x D), which need be neither
 * orthogonal nor of unit length: cosine (min(a, b), out), descending (Björck & Golub 1973, by the
 * Gram matrices).  APSM_ERR_SINGULAR: the rows of one of them are not independent.
 * O((a + b)^2 D). */
apsm_status apsm_subspace_cosines(size_t a, size_t b, size_t D, const double *A, const double *B,
                                  double *cosine, double *work) APSM_NODISCARD;

/* share (a, out) of the squared length of each row of A that lies in the span of the rows of B.
 * Errors and cost as above. */
apsm_status apsm_subspace_shares(size_t a, size_t b, size_t D, const double *A, const double *B,
                                 double *share, double *work) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
