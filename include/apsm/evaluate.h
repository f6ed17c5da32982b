/* evaluate.h -- how good corresponding particles are: compactness, generalization, specificity, and
 * how far the template's surface, warped, is from every shape's own.  docs/method.md, section 9,
 * has the definitions; lengths are in the unit of the particles. */
#ifndef APSM_EVALUATE_H
#define APSM_EVALUATE_H

#include <stddef.h>

#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Of a list of distances with weights.  A quantile q is the smallest distance that at least the
 * share q of the weight does not exceed. */
typedef struct apsm_distance_summary {
    double mean, median, p95, p99, max;
} apsm_distance_summary;

typedef struct apsm_surface_distance {
    apsm_distance_summary two_way; /* paper: both directions' vertices in one list, unweighted */
    apsm_distance_summary pull;    /* ShapeWorks: reconstruction to shape, unweighted */
    apsm_distance_summary push;    /* ShapeWorks: shape to reconstruction, by vertex area */
    apsm_distance_summary disagreement; /* ShapeWorks: at a shape's vertex the larger of push and
                                           the pulls that land on its triangles; by vertex area */
    double diagonal; /* of the shape's bounding box; ShapeWorks also reports distance / diagonal */
} apsm_surface_distance;

/* Over a cohort: `mean` is the mean of the shapes' means, `max` the largest distance of all,
 * `mean_max` the mean of the shapes' maxima. */
typedef struct apsm_surface_aggregate {
    double mean, max, mean_max;
} apsm_surface_aggregate;
typedef struct apsm_surface_summary {
    apsm_surface_aggregate two_way, pull, push, disagreement; /* without the template */
} apsm_surface_summary;

/* Figures of a cohort; read-only once made. */
typedef struct apsm_figures apsm_figures;

/* Of particles P (I x J x 3, I >= 3, all in one frame).  meshes: I surfaces in that frame, warped
 * from the one of template_index; NULL: no surface distances.  definition: "standard", "paper" or
 * "shapeworks-compat"; NULL: "standard".  *figures is the caller's, NULL on failure.  Parallel over
 * shapes. */
APSM_API apsm_status apsm_evaluate_particles(apsm_context *ctx, size_t I, size_t J, const double *P,
                                             const apsm_mesh *meshes, size_t template_index,
                                             const char *definition,
                                             apsm_figures **figures) APSM_NODISCARD;
APSM_API void apsm_figures_free(apsm_figures *figures); /* NULL is allowed */

/* *n numbers, borrowed, by the names of evaluation.json: for 1, 2, ... modes "compactness",
 * "generalization", "generalization_standard_error", "specificity", "specificity_standard_error";
 * of the modes "variances"; of the shapes "surface_mean", "surface_p95", "surface_max".  NULL and
 * 0: no such figure, or not measured. */
APSM_API const double *apsm_figures_get(const apsm_figures *figures, const char *name, size_t *n);

#ifdef __cplusplus
}
#endif
#endif
