/* closing.h -- morphological closing of a mask: gaps, tunnels and sinuses narrower than twice the
 * radius are filled. */
#ifndef APSM_GROOM_CLOSING_H
#define APSM_GROOM_CLOSING_H

#include "groom/mask.h"

/* Fills what no ball of this radius, in the unit of spacing, outside the mask reaches; *added (out)
 * voxels.  O(voxels of the crop and a rim of the radius) time and memory (5 bytes a voxel). */
apsm_status mask_close(mask *m, const double spacing[3], double radius,
                       size_t *added) APSM_NODISCARD;

/* Takes away what no ball of this radius inside the mask reaches; *removed (out) voxels. */
apsm_status mask_open(mask *m, const double spacing[3], double radius,
                      size_t *removed) APSM_NODISCARD;

/* Euler's number of what touches the box [lo, hi] of voxels.  O(voxels of the box). */
long mask_euler(const mask *m, const size_t lo[3], const size_t hi[3]);
/* Tunnels through a mask.  O(voxels). */
apsm_status mask_tunnels(const mask *m, long *tunnels) APSM_NODISCARD;

#endif
