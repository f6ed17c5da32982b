/* downdate.h -- the modes of all shapes but one, in the coordinates of the modes of all. */
#ifndef APSM_EVALUATE_DOWNDATE_H
#define APSM_EVALUATE_DOWNDATE_H

#include <stddef.h>

#include "apsm/status.h"

/* Scratch for r modes; made once for each thread. */
typedef struct apsm_downdate apsm_downdate;
apsm_status apsm_downdate_new(size_t r, apsm_downdate **w) APSM_NODISCARD;
void apsm_downdate_free(apsm_downdate *w);

/* For the matrix diag(d) - rho t t^T, positive semi-definite, with d (r, descending, > 0) and
 * t (r): row m - 1 of C (M x r, out) is t minus its projection on the m eigenvectors of largest
 * eigenvalue, m = 1..M.  Returns how many rows were made: fewer than M if fewer eigenvalues exceed
 * zero * d[0].  O(r^2) a root-finding step, O(r^2 + r M) in all. */
size_t apsm_downdate_residuals(apsm_downdate *w, const double *d, const double *t, double rho,
                               double zero, size_t M, double *C);

#endif
