/* slip.h -- has a region of a shape slipped along the surface?  Looked for in what neither the
 * other shapes nor a smooth deformation explain (docs/method.md, "Judging"). */
#ifndef APSM_JUDGE_SLIP_H
#define APSM_JUDGE_SLIP_H

#include <stddef.h>
#include <stdint.h>

#include "apsm/status.h"

/* Wide patches and little smoothness taken out, or narrow ones and more. */
enum { APSM_SLIP_LOOKS = 3 };

/* Which particles lie around each; owns its arrays, zero-initialise with {0}. */
typedef struct apsm_patches {
    size_t J;
    size_t *start; /* J + 1 */
    uint32_t *at;
} apsm_patches;

/* The particles within the radius of look k, on particles P with normals N (J x 3 each) and spacing
 * h, that look the same way.  O(J^2). */
apsm_status apsm_patches_make(size_t k, size_t J, const double *P, const double *N, double h,
                              apsm_patches *patches) APSM_NODISCARD;
void apsm_patches_free(apsm_patches *patches);

/* mean (J) <- of x (J) over the patch of each. */
void apsm_patches_mean(const apsm_patches *patches, const double *x, double *mean);

/* Scratch in doubles. */
size_t apsm_slip_work_size(size_t J);

/* All shapes in one pose; borrowed. */
typedef struct apsm_slip_cohort {
    size_t I, J;                 /* I >= 3 */
    const double *P;             /* I x J x 3 */
    double h;                    /* spacing */
    const apsm_patches *patches; /* APSM_SLIP_LOOKS */
} apsm_slip_cohort;

/* How many of them are possible: the first so many. */
size_t apsm_slip_looks(size_t I, size_t J);

/* slipped (APSM_SLIP_LOOKS x J, out): how far, in h, the particles around each have gone along the
 * surface of shape i together, (J3b).  N (J x 3): the shape's normals.  work: scratch. */
void apsm_slip_look(const apsm_slip_cohort *c, size_t i, const double *N, double *slipped,
                    double *work);

/* times (J, out): of slipped over what is usual in the others, (J3c).  mean: scratch, J. */
void apsm_slip_times(const apsm_patches *patches, const double *slipped, const double *usual,
                     double *times, double *mean);

#endif
