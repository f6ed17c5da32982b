/* features.h -- what surfaces carry beside their form: scalar fields of their vertices, and their
 * normals, as further coordinates in which shapes must match. */
#ifndef APSM_INITIALIZE_FEATURES_H
#define APSM_INITIALIZE_FEATURES_H

#include "initialize/cohort.h"

/* Gives the cohort S scalar fields and, with normals > 0, the three coordinates of the normals.
 * scalar[i] (owned by the caller): S x nv of shape i.  A scalar loses the cohort's mean and is
 * divided by its standard deviation: the weights (S) and normals are without unit.
 * APSM_ERR_GEOMETRY: a scalar is the same everywhere; *flat (out) is which. */
apsm_status apsm_cohort_features(apsm_cohort *cohort, size_t S, const double *const *scalar,
                                 const double *weight, double normals, size_t *flat) APSM_NODISCARD;

/* f (F, out): the features at a point of shape i; slope (F x 3; NULL: not wanted): how they change
 * along the surface there. */
void apsm_features_at(const apsm_cohort *cohort, size_t i, const apsm_surface_point *on, double *f,
                      double *slope);

/* Draws registered particles P (J x 3, in/out, on shape i) along the surface to where the features
 * are those of the template's particles T (J x 3), as far as about 3 h and smoothly. */
apsm_status apsm_features_pull(const apsm_cohort *cohort, size_t i, size_t J, const double *T,
                               double h, double *P) APSM_NODISCARD;

#endif
