/* closing.h -- morphological closing of a mask: gaps, tunnels and sinuses narrower than twice the
 * radius are filled. */
#ifndef APSM_GROOM_CLOSING_H
#define APSM_GROOM_CLOSING_H

#include "groom/mask.h"

/* Fills what no ball of this radius, in the unit of spacing, outside the mask reaches; *added (out)
 * voxels.  O(voxels of the crop and a rim of the radius) time and memory (5 bytes a voxel). */
apsm_status mask_close(mask *m, const double spacing[3], double radius,
                       size_t *added) APSM_NODISCARD;

/* Tunnels through a mask that is one part (26-connected) without cavities.  O(voxels). */
long mask_tunnels(const mask *m);

/* The least radius of a ladder up to 0.12 of `size` that leaves as few tunnels as any of them; 0 if
 * none leaves fewer than there are.  Anatomy that is wider stays. */
apsm_status mask_choose_closing(const mask *m, const double spacing[3], double size,
                                double *radius) APSM_NODISCARD;

#endif
