/* between.h -- the surface between slices far apart. */
#ifndef APSM_GROOM_BETWEEN_H
#define APSM_GROOM_BETWEEN_H

#include "groom/antialias.h"

/* The axis across the slices, if exactly one is refined; else -1. */
int between_axis(const antialias_input *in);

/* values (fine, out), above 1/2 inside: the slices' signed distances to their contours, linear from
 * slice to slice (between.c).  O(fine) time, 4 bytes a node of the mask. */
apsm_status between_slices(const antialias_input *in, int axis, float *values) APSM_NODISCARD;

/* By how much values change over the shortest spacing, away from a contour. */
float between_slope(const antialias_input *in, int axis);

#endif
