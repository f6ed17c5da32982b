/* rigid.h -- the pose as six modes more of a posterior model: small moves about a place, so wide
 * that measurements alone decide. */
#ifndef APSM_FIT_RIGID_H
#define APSM_FIT_RIGID_H

#include "fit/posterior.h"

enum { FIT_RIGID = 6 };

/* Doubles that fit_rigid_add stores for a model of M modes, M being those of the result or more. */
size_t fit_rigid_size(const posterior_model *m);

/* m with six modes in front: shifts along the axes and turns about the centre of points at (D),
 * with standard deviations of one radius and one radian.  store of fit_rigid_size(the result). */
posterior_model fit_rigid_add(const posterior_model *m, const double *at, double radius,
                              double *store);

/* The rigid motion M (16, row-major) that the six scores b stand for, about that centre. */
void fit_rigid_motion(const double centre[3], double radius, const double b[FIT_RIGID],
                      double M[16]);
/* Centre of D / 3 points. */
void fit_centre(size_t D, const double *at, double centre[3]);

#endif
