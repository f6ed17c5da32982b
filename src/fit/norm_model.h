/* norm_model.h -- what is normal: the cohort's shapes given columns, by least squares, and how far
 * a new shape is from what they let expect. */
#ifndef APSM_FIT_NORM_MODEL_H
#define APSM_FIT_NORM_MODEL_H

#include "statistics/design.h"

/* N shapes of V / d particles, n new ones, by a design whose rows are known for all; d = 3
 * coordinates, or 1, the one along the normal.  Owns its arrays; zero-initialise with {0},
 * norm_model_free leaves it so. */
typedef struct norm_model {
    size_t N, n, q, d, V;
    double *h;  /* N: leverages */
    double *E;  /* N x V: residuals */
    double *h0; /* n: of the new ones, x (X'X)^-1 x' */
    double *E0; /* n x V: their distance from what is expected */
} norm_model;

/* What it is made of; borrowed. */
typedef struct norm_data {
    size_t N, n, q, d, V;
    const double *X;  /* N + n x q: the cohort's rows, then the new ones' */
    const double *Y;  /* N x V */
    const double *Y0; /* n x V */
} norm_data;

apsm_status norm_model_make(apsm_context *ctx, const norm_data *data,
                            norm_model *model) APSM_NODISCARD;
void norm_model_free(norm_model *model);

/* Root mean square distance over particles of new shape k, divided by sqrt(1 + h): what the
 * uncertainty of the expectation adds is taken out.  And of a shape of the cohort as if it had been
 * left out, |E| / sqrt(1 - h); NAN if it alone determines a coefficient. */
double norm_distance_new(const norm_model *model, size_t k);
double norm_distance_own(const norm_model *model, size_t i);

/* t of variable v of new shape k: Student's t with N - q degrees of freedom. */
double norm_t(const norm_model *model, size_t k, size_t v);

/* p (V / d, out) of every particle of new shape k by Hotelling's T^2 of its d coordinates (t^2 of
 * one), and T2 (V / d, out; NULL: not asked for).  As above for shape i of the cohort, left out.
 * N - q > 4. */
void norm_particles_new(const norm_model *model, size_t k, double *T2, double *p);
void norm_particles_own(const norm_model *model, size_t i, double *p);

#endif
