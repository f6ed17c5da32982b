/* design.h -- the design of a linear model Y = X B + noise, split into what is tested and what is
 * only allowed for. */
#ifndef APSM_STATISTICS_DESIGN_H
#define APSM_STATISTICS_DESIGN_H

#include "apsm/context.h"

/* Owns its arrays; zero-initialise with {0}, apsm_design_free leaves it so. */
typedef struct apsm_design {
    size_t N, r, q; /* rows; columns of the reduced model, of the full one */
    double *X;      /* N x q: the reduced model's columns first */
    double *Q;      /* N x q: orthonormal, the first k columns span those of X */
} apsm_design;

/* Of reduced columns Z (N x r, r >= 1) and tested ones T (N x s, s >= 1), row-major.  APSM_ERR_ARG,
 * with a line: columns that are linear combinations of others (a group and its copy, a group with
 * one age each), or no more rows than columns.  Householder's QR, O(N q^2). */
apsm_status apsm_design_make(apsm_context *ctx, size_t N, size_t r, const double *Z, size_t s,
                             const double *T, apsm_design *design) APSM_NODISCARD;
void apsm_design_free(apsm_design *design);

/* B (q x V, out): coefficients of Y (N x V) by least squares. */
apsm_status apsm_design_fit(const apsm_design *design, size_t V, const double *Y,
                            double *B) APSM_NODISCARD;
/* e (N x V, out): residuals of Y by the first k columns of the design. */
void apsm_design_residuals(const apsm_design *design, size_t k, size_t V, const double *Y,
                           double *e);

#endif
