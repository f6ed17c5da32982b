/* affine.h -- rigid, similarity and affine maps as row-major 4 x 4 matrices (last row 0 0 0 1),
 * the layout of ShapeWorks' project files. */
#ifndef APSM_GEOMETRY_AFFINE_H
#define APSM_GEOMETRY_AFFINE_H

#include <stddef.h>

#include "apsm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

void apsm_affine_identity(double M[16]);
void apsm_affine_multiply(const double A[16], const double B[16], double AB[16]); /* AB may alias */
apsm_status apsm_affine_invert(const double M[16], double inverse[16]) APSM_NODISCARD;
double apsm_affine_det(const double M[16]); /* of the 3 x 3 part */
/* y <- M x for n points (n x 3); y may be x. */
void apsm_affine_apply(const double M[16], size_t n, const double *x, double *y);
/* Directions: 3 x 3 part only, renormalised to unit length. */
void apsm_affine_apply_normals(const double M[16], size_t n, const double *x, double *y);

/* Makes a similarity rigid; the centre goes where it went. */
void apsm_affine_remove_scale(const double centre[3], double M[16]);

/* The rigid (scale = 0) or similarity (scale = 1) map M that minimises
 * sum_k w_k |M x_k - y_k|^2; w NULL: all 1.  det = +1 (Kabsch/Umeyama by the 3 x 3 SVD).  n >= 3.
 * Degenerate sets (collinear) give one of the minimisers. */
void apsm_affine_fit(size_t n, const double *x, const double *y, const double *w, int scale,
                     double M[16]);

/* Centre c of n points x (n x 3), and as columns of V the principal axes of their second moments
 * about it, by decreasing variance. */
void apsm_principal_axes(size_t n, const double *x, double c[3], double V[9]);

/* SVD of a 3 x 3 row-major A = U diag(s) V^T, s descending, U and V orthogonal (det may be -1).
 * One-sided Jacobi. */
void apsm_svd3(const double A[9], double U[9], double s[3], double V[9]);
/* Nearest rotation (det +1) to A in the Frobenius norm. */
void apsm_nearest_rotation(const double A[9], double R[9]);

/* R (row-major, out): rotation k of n on a super-Fibonacci spiral (Alexa, CVPR 2022), which spreads
 * them evenly over all there are. */
void apsm_rotation_of_spiral(size_t k, size_t n, double R[9]);

#ifdef __cplusplus
}
#endif
#endif
