/* metrics.h -- how good a shape model is: compactness, generalization, specificity, and the
 * surface distances of its particles, under named definitions (docs/method.md, "Metrics").
 *
 * The distance between two particle sets is the mean over particles of the Euclidean distance,
 * in the unit of the particles.  Arrays over modes have fixed lengths, compactness and specificity
 * I - 1, generalization I - 2, entry m - 1 for m modes; once a (sub)model has no further mode, its
 * values stay as they are. */
#ifndef APSM_EVALUATE_METRICS_H
#define APSM_EVALUATE_METRICS_H

#include "core/option.h"
#include "evaluate/surface_distance.h"
#include "model/mode_trust.h"
#include "model/shape_model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What differs is how specificity samples the model, and which surface distance is reported.
 * Same order as the option `definition`. */
typedef enum apsm_definition {
    APSM_DEFINITION_STANDARD,  /* score_k ~ N(0, variance_k), 1,000 samples; two-way distance */
    APSM_DEFINITION_PAPER,     /* score_k uniform in +-3 sd, 25,000 samples; two-way distance */
    APSM_DEFINITION_SHAPEWORKS /* score_k ~ N(0, sqrt((I-1) variance_k)), 1,000 samples: the
                                  singular value where a variance belongs, so that the result
                                  depends on the unit; distance by push, pull, disagreement */
} apsm_definition;

const char *apsm_definition_name(apsm_definition d);      /* "standard", ...; constant string */
const char *apsm_definition_text(apsm_definition d);      /* one line to print beside the numbers */
const char *apsm_definition_warning(apsm_definition d);   /* one line to warn with, or NULL */
size_t apsm_definition_samples(apsm_definition d);        /* 1,000 or 25,000 */
size_t apsm_definition_modes(apsm_definition definition); /* SIZE_MAX: all */

/* Share of the variance in the first m modes; compactness (I-1, out).  All 1 without variance. */
void apsm_compactness(const apsm_shape_model *model, double *compactness);

/* Leave-one-out: mean over shapes of the distance of p_i to its projection on the first m modes
 * of the model of the others.  generalization (I-2, out), error (I-2, out, or NULL): standard error
 * over the shapes.  No model is refitted: the spectrum of the others is a rank-one downdate
 * (O(r^2) a shape for r modes, src/evaluate/downdate.c).  Of a large cohort
 * apsm_generalization_shapes(I), evenly among all, are left out one by one; each is judged by the
 * model of all others.  O(shapes r^2 J) multiplications, O(shapes r + threads (r^2 + r 10^3))
 * scratch, parallel over shapes. */
apsm_status apsm_generalization(apsm_context *ctx, const apsm_shape_model *model,
                                double *generalization, double *error) APSM_NODISCARD;
/* All up to 1,000 shapes, 1,000 beyond: the error of the mean is then below a thirtieth of what one
 * shape differs from another. */
size_t apsm_generalization_shapes(size_t I);

/* Mean over samples of the distance to the nearest training shape.  Sample k of m modes is that of
 * m - 1 modes plus one mode's term, so all m are judged by the same draws.  Draws come from the
 * context's seed, stream APSM_STREAM_SPECIFICITY, index k.  samples 0: the definition's number.
 * modes: largest m (at most I-1 counts).  specificity (m, out), error (m, out, or NULL): standard
 * error over the samples.  The search is exact; parallel over samples. */
apsm_status apsm_specificity(apsm_context *ctx, const apsm_shape_model *model,
                             apsm_definition definition, size_t samples, size_t modes,
                             double *specificity, double *error) APSM_NODISCARD;
/* The same for given scores (samples x modes, length units). */
apsm_status apsm_specificity_of(apsm_context *ctx, const apsm_shape_model *model, size_t samples,
                                const double *scores, double *specificity,
                                double *error) APSM_NODISCARD;

#define APSM_EVALUATE_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                                     \
    ENUM(S, definition, "standard|paper|shapeworks-compat", "definition of specificity")           \
    INT(S, specificity_samples, 0, 0, 10000000, "samples; 0: the definition's own number")         \
    INT(S, specificity_modes, 0, 0, 1000000,                                                       \
        "most modes that specificity is measured for; 0: the definition's own number (paper: 20, " \
        "else all)")                                                                               \
    BOOL(S, surface_distance, true, "measure two-way surface distances (needs meshes)")            \
    INT(S, other_templates, 3, 0, 1000,                                                            \
        "shapes that take the template's place in turn for further surface distances, which no "   \
        "fit knew of; 0: none")
/* surface_distance: an evaluation without meshes measures none. */
typedef struct apsm_evaluate_options {
    APSM_OPTION_FIELDS(APSM_EVALUATE_OPTIONS)
} apsm_evaluate_options;

/* What to evaluate: particles, and what the surface distances need. */
typedef struct apsm_evaluate_input {
    size_t I, J;
    const double *P;               /* I x J x 3, world frame */
    const apsm_shape_model *model; /* of P, borrowed; NULL: made here */
    apsm_evaluate_options options;
    const apsm_mesh_source *shape;  /* the meshes of the shapes in the world frame; NULL: no
                                       surface distances */
    const apsm_mesh *template_mesh; /* warped to every shape; world frame */
    size_t template_index;
    const apsm_warp *warp; /* of template_mesh by the template's particles; NULL: made here */
} apsm_evaluate_input;

/* Owns its arrays. */
typedef struct apsm_evaluation {
    size_t shapes, particles, modes, samples;
    apsm_definition definition;
    double *variance;                              /* modes */
    apsm_mode_trust *trust;                        /* modes */
    double *compactness;                           /* shapes - 1 */
    double *generalization, *generalization_error; /* shapes - 2 */
    size_t left_out;                               /* shapes that generalization was measured on */
    double *specificity, *specificity_error;       /* shapes - 1 */
    /* Those lengths, 0 if negative; of specificity at most as many as were asked for. */
    size_t n_compactness, n_generalization, n_specificity;
    apsm_surface_distance *surface; /* shapes, or NULL */
    apsm_surface_summary surface_summary;
    size_t others; /* that took the template's place */
    apsm_surface_aggregate other_templates;
} apsm_evaluation;

/* Everything above in one call.  A definition with a warning logs it.  evaluation is overwritten,
 * not freed. */
apsm_status apsm_evaluate(apsm_context *ctx, const apsm_evaluate_input *input,
                          apsm_evaluation *evaluation) APSM_NODISCARD;
void apsm_evaluation_free(apsm_evaluation *evaluation);

#ifdef __cplusplus
}
#endif
#endif
