/* correspondence_loss.h -- asks that the neighbourhood of every particle looks as it does on the
 * template.  docs/method.md, (8). */
#ifndef APSM_CORRESPONDENCE_LOSS_H
#define APSM_CORRESPONDENCE_LOSS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/option.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { APSM_NEIGHBOURS = 6 }; /* q of the paper */

/* N6 (J x 6, out): the 6 Euclidean nearest particles of each, nearest first, ties by index.
 * J >= 7 (APSM_ERR_ARG).  O(J^2), no scratch. */
apsm_status apsm_neighbours6(size_t J, const double *P, uint32_t *N6) APSM_NODISCARD;
/* h_j (J, out; NULL: not wanted): mean distance to the 6; returns h, the mean of all h_j. */
double apsm_spacing(size_t J, const double *P, const uint32_t *N6, double *h_j);

/* How R_ij turns a neighbourhood onto the template's. */
typedef enum apsm_rotation {
    APSM_ROTATION_TRANSPORT, /* the smallest rotation of n_ij to n_tj */
    APSM_ROTATION_AXIS,      /* paper: n_ij and n_tj both to (1,0,0) */
    APSM_ROTATION_NONE,
    APSM_ROTATION_PROCRUSTES /* best fit of the six vectors */
} apsm_rotation;

typedef enum apsm_distance {
    APSM_DISTANCE_NORM,         /* d */
    APSM_DISTANCE_PSEUDO_HUBER, /* sqrt(d^2 + delta^2) - delta */
    APSM_DISTANCE_SQUARED       /* d^2 / 2 */
} apsm_distance;

enum { APSM_SCALE_TEMPLATE, APSM_SCALE_NONE };
enum { APSM_CORRES_NEIGHBOURHOOD, APSM_CORRES_FROBENIUS, APSM_CORRES_FROBENIUS_SQUARED };
#define APSM_CORRESPONDENCE_OPTIONS(S, INT, REAL, BOOL, ENUM, FIXED)                               \
    ENUM(S, correspondence, "neighbourhood|frobenius|frobenius-squared",                           \
         "the correspondence loss: (8), or the earlier papers' distance to the mean")              \
    ENUM(S, rotation, "transport|axis|none|procrustes", "R_ij in (8); axis is the paper's")        \
    ENUM(S, neighbour_norm, "norm|huber|squared", "the distance in (8)")                           \
    ENUM(S, neighbour_scale, "template|none", "factor of (8): h_tj / 6, or 1 (paper)")             \
    BOOL(S, template_gradient, false,                                                              \
         "let the template follow the gradient of its own targets (paper)")                        \
    FIXED(S, double, delta, 0.1, "of the Huber distance, in neighbour distances")
typedef struct apsm_correspondence_options {
    APSM_OPTION_FIELDS(APSM_CORRESPONDENCE_OPTIONS)
} apsm_correspondence_options;
apsm_correspondence_options apsm_correspondence_defaults(void);

/* The template as a target; arrays are borrowed. */
typedef struct apsm_correspondence_target {
    size_t J;
    const double *P;    /* J x 3 */
    const double *N;    /* J x 3 unit normals */
    const uint32_t *N6; /* J x 6 */
    const double *h_j;  /* J: apsm_spacing at P */
} apsm_correspondence_target;

/* Loss (8) of one shape with particles P and unit normals N (J x 3); grad (J x 3, out,
 * overwritten; NULL: loss alone).  Rotations and h_tj are constants.  target_grad (J x 3; NULL:
 * the template is a constant) is overwritten with the gradient in the template's particles.  A term
 * at its minimum has gradient 0, so the template itself gets none.  O(J), no scratch.
 * APSM_ERR_NONFINITE if the loss is not finite. */
apsm_status apsm_correspondence_loss(const apsm_correspondence_target *target, const double *P,
                                     const double *N, const apsm_correspondence_options *opt,
                                     double *loss, double *grad,
                                     double *target_grad) APSM_NODISCARD;

/* The rotation of particle j as it is used above (row-major, y = R x), and the template's own
 * (identity but for the axis variant). */
void apsm_correspondence_rotation(const apsm_correspondence_target *target, const double *P,
                                  const double *N, size_t j, apsm_rotation rotation, double R[9],
                                  double S[9]);

#ifdef __cplusplus
}
#endif
#endif
