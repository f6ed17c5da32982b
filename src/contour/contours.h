/* contours.h -- a cohort of curves: brought into one pose and order, matched to their mean, with
 * corresponding particles. */
#ifndef APSM_CONTOUR_CONTOURS_H
#define APSM_CONTOUR_CONTOURS_H

#include "apsm/context.h"
#include "contour/elastic.h"

/* Points that stand for a curve. */
enum { CONTOUR_POINTS = 200 };

typedef struct contour_options {
    int align; /* APSM_ALIGN_RIGID, _SIMILARITY, _NONE */
    double adaptivity;
    size_t J, template_index;
} contour_options;

/* Owns its arrays; zero-initialise with {0}. */
typedef struct contour_cohort {
    size_t I, J;
    bool closed;
    double *M;     /* I x 16: to the world */
    double *Q;     /* I x CONTOUR_POINTS x 3: in the world, beginning where the template begins */
    double *gamma; /* I x CONTOUR_POINTS: where on them the mean's points are */
    double *mean;  /* CONTOUR_POINTS x 3 */
    double *t;     /* J: the particles' parameters on the mean */
    double *P;     /* I x J x 3: particles, in the world */
    double *rival; /* I: how much worse another start or direction lies on the mean, of those that
                      could be meant: the ratio of root mean square distances; INFINITY: none */
} contour_cohort;

/* Curve i has n[i] points P[i].  All closed or all open.  APSM_ERR_GEOMETRY: a curve without
 * length. */
apsm_status contour_cohort_make(size_t I, const size_t *n, const double *const *P, bool closed,
                                const contour_options *o, contour_cohort *c) APSM_NODISCARD;
void contour_cohort_free(contour_cohort *c);

/* X (CONTOUR_POINTS x 3, out): the curve that particles p (J x 3) stand for: the mean's, displaced
 * as they are, linearly in between. */
void contour_rebuild(const contour_cohort *c, const double *p, double *X);

#endif
