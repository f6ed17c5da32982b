/* procrustes.h -- generalised Procrustes alignment of corresponding particles: removes pose, and
 * size if wanted, from a cohort. */
#ifndef APSM_PROCRUSTES_H
#define APSM_PROCRUSTES_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_procrustes_options {
    bool pose;         /* remove translation and rotation; default true */
    bool scale;        /* remove size; default false */
    size_t reference;  /* shape whose pose and place the result takes, and with which the mean
                          starts; >= I (default): the mean of the shapes as they are */
    size_t iterations; /* at most; default 100 */
    double tolerance;  /* stop when the mean moves less, relative to its size; default 1e-10 */
} apsm_procrustes_options;
apsm_procrustes_options apsm_procrustes_defaults(void);

/* Maps M (I x 16, row-major 4 x 4, out) that bring the particles P (I x J x 3) into one frame:
 * rotations to the mean about the centroids, mean renewed, until it rests (Gower 1975).  With scale
 * every shape gets the root mean square centroid size of the cohort, about its centroid, so that
 * the cohort's size stays.  Q (I x J x 3, out, may be NULL or P): the mapped particles.
 * J >= 3 for pose.  APSM_ERR_GEOMETRY: a shape whose particles all coincide, if scale is asked.
 * O(I J) an iteration. */
apsm_status apsm_procrustes(apsm_context *ctx, size_t I, size_t J, const double *P,
                            const apsm_procrustes_options *options, double *M,
                            double *Q) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
