/* model.h -- the statistical shape model: mean and modes of variation (PCA) of the particles of a
 * cohort.  Lengths are in the unit of the particles, variances in its square. */
#ifndef APSM_MODEL_H
#define APSM_MODEL_H

#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Read-only once made, so that many threads may use one. */
typedef struct apsm_shape_model apsm_shape_model;

/* Of particles P (I x J x 3, in one frame).  *model is the caller's, NULL on failure.  One shape,
 * or shapes that are all alike, give a mean without modes.  APSM_ERR_ARG: no shapes or no
 * particles; APSM_ERR_NONFINITE: a coordinate is not finite. */
APSM_API apsm_status apsm_model_make(apsm_context *ctx, size_t I, size_t J, const double *P,
                                     apsm_shape_model **model) APSM_NODISCARD;
/* Of a model folder that has been evaluated. */
APSM_API apsm_status apsm_model_open(apsm_context *ctx, const char *folder,
                                     apsm_shape_model **model) APSM_NODISCARD;
APSM_API void apsm_model_free(apsm_shape_model *model); /* NULL is allowed */

APSM_API size_t apsm_model_shapes(const apsm_shape_model *model);    /* I */
APSM_API size_t apsm_model_particles(const apsm_shape_model *model); /* J */
APSM_API size_t apsm_model_modes(const apsm_shape_model *model);     /* those with variance; < I */

/* Borrowed: the mean J x 3; the modes, modes x J x 3, orthonormal; their variances, descending; the
 * scores of the shapes, I x modes, so that p_i = mean + sum_k score_ik mode_k. */
APSM_API const double *apsm_model_mean(const apsm_shape_model *model);
APSM_API const double *apsm_model_mode(const apsm_shape_model *model);
APSM_API const double *apsm_model_variance(const apsm_shape_model *model);
APSM_API const double *apsm_model_score(const apsm_shape_model *model);

/* b (modes, out): the scores of particles p (J x 3) in the frame of the mean. */
APSM_API void apsm_model_project(const apsm_shape_model *model, const double *p, double *b);
/* p (J x 3, out) = mean + sum of the first m <= modes modes times the scores b (m). */
APSM_API void apsm_model_synthesize(const apsm_shape_model *model, size_t m, const double *b,
                                    double *p);

#ifdef __cplusplus
}
#endif
#endif
