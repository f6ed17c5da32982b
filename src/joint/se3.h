/* se3.h -- rigid motions as a manifold: logarithm, exponential, mean.  A motion is a row-major 4 x
 * 4 (apsm/affine.h); its logarithm xi is (omega, v): rotation vector, and translation of the
 * origin. */
#ifndef APSM_JOINT_SE3_H
#define APSM_JOINT_SE3_H

#include <stddef.h>

/* SO(3) x R^3: omega = log R in radians (|omega| <= pi), v the translation itself.  With the origin
 * put into a part's centroid, omega and v are how the part turned and where it went, and neither
 * depends on where the image's origin lies. */
void apsm_se3_log(const double M[16], double xi[6]);
void apsm_se3_exp(const double xi[6], double M[16]);

/* The intrinsic mean of n motions: rotation by Karcher's iteration from the first, which converges
 * where all rotations are within 90 degrees of it; translation the arithmetic mean. */
void apsm_se3_mean(size_t n, const double *M, double mean[16]);

#endif
