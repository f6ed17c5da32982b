/* parts.h -- a cohort of subjects with several parts: the particles of a subject stand part after
 * part in one array, so that one model can be made of all. */
#ifndef APSM_JOINT_PARTS_H
#define APSM_JOINT_PARTS_H

#include <stdbool.h>

#include "apsm/context.h"

/* Part d has the particles first[d] .. first[d + 1] - 1 of a subject's J = first[n].  Borrowed. */
typedef struct apsm_parts {
    size_t n;
    const size_t *first; /* n + 1, ascending from 0; at least 3 particles a part */
} apsm_parts;

typedef enum apsm_joint_alignment {
    APSM_JOINT_GLOBAL, /* all parts of a subject move together: relative pose stays */
    APSM_JOINT_BY,     /* the same, but the motion is that of one part */
    APSM_JOINT_APART   /* every part for itself: relative pose is removed */
} apsm_joint_alignment;

typedef struct apsm_joint_align_options {
    apsm_joint_alignment alignment;
    size_t by;        /* the part, for APSM_JOINT_BY */
    bool scale;       /* remove size too */
    size_t reference; /* subject whose frame is the world's; >= I: the mean of the subjects */
} apsm_joint_align_options;

/* Maps M (I x n x 16, out) from the frames of the subjects' particles P (I x J x 3) into one, and
 * the mapped particles Q (I x J x 3, out; not P).  Generalised Procrustes over the particles of all
 * parts, or of a part.  APSM_ERR_ARG: a part with fewer than 3 particles, no such part.  O(I J) an
 * iteration. */
apsm_status apsm_joint_align(apsm_context *ctx, size_t I, const apsm_parts *parts, const double *P,
                             const apsm_joint_align_options *options, double *M,
                             double *Q) APSM_NODISCARD;

/* The particles of part d of all subjects: X (I x J_d x 3, out). */
void apsm_parts_take(const apsm_parts *parts, size_t d, size_t I, const double *P, double *X);

#endif
