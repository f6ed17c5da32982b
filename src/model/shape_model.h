/* shape_model.h -- the statistical shape model: mean and modes of variation (PCA) of the
 * particles of a cohort.  Lengths are in the unit of the particles, variances in its square. */
#ifndef APSM_MODEL_SHAPE_MODEL_H
#define APSM_MODEL_SHAPE_MODEL_H

#include <stddef.h>

#include "apsm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A mode whose variance is not above this share of the first one's is rounding, and left out. */
#define APSM_ZERO_VARIANCE 1e-12

/* Owns its arrays.  Zero-initialise with {0}; apsm_shape_model_free leaves it so. */
struct apsm_shape_model {
    size_t I, J, modes; /* modes <= I - 1 and 3J: those of non-zero variance */
    double *mean;       /* J x 3 */
    double *mode;       /* modes x 3J: orthonormal rows, plus as mode_sign.h says */
    double *variance;   /* modes, descending; divisor I - 1 */
    double *score;      /* I x modes: p_i = mean + sum_k score_ik mode_k */
};

/* Which of the two symmetric matrices of a cohort is decomposed: both have the same modes. */
typedef enum apsm_model_side {
    APSM_SIDE_SMALLER,  /* the one of fewer rows */
    APSM_SIDE_SHAPES,   /* the Gram matrix, I x I: O(I^2 J + I^3) time, a second copy of P */
    APSM_SIDE_PARTICLES /* the covariance, 3J x 3J: O(I J^2 + J^3) time, a few shapes beside it */
} apsm_model_side;

/* The model of particles P (I x J x 3).  I = 1, or shapes that are all alike, give a mean without
 * modes.  Beside the model and P it holds two matrices of min(I, 3J)^2 and, where I < 3J, a copy of
 * P.  APSM_ERR_ARG: no shapes or no particles; APSM_ERR_NONFINITE: a coordinate is not finite. */
apsm_status apsm_shape_model_fit(apsm_context *ctx, size_t I, size_t J, const double *P,
                                 apsm_shape_model *model) APSM_NODISCARD;
/* The same from the side that is asked for; both agree to rounding. */
apsm_status apsm_shape_model_fit_side(apsm_context *ctx, apsm_model_side side, size_t I, size_t J,
                                      const double *P, apsm_shape_model *model) APSM_NODISCARD;
void apsm_shape_model_free(apsm_shape_model *model);

/* Scores b (modes, out; in length units, sd sqrt(variance)) of particles p (J x 3): projection
 * of p - mean on every mode.  O(modes J). */
void apsm_shape_model_scores(const apsm_shape_model *model, const double *p, double *b);

/* x (J x 3, out) = mean + sum of the first m modes times scores b (m).  m <= modes. */
void apsm_shape_model_synthesize(const apsm_shape_model *model, size_t m, const double *b,
                                 double *x);

#ifdef __cplusplus
}
#endif
#endif
