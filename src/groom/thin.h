/* thin.h -- which voxels of a mask must keep their side when it is smoothed. */
#ifndef APSM_GROOM_THIN_H
#define APSM_GROOM_THIN_H

#include <stddef.h>

#include "apsm/status.h"

enum { THIN_LOOSE, THIN_FIRM, THIN_RAGGED };

/* firm (n, out): THIN_FIRM where the voxel must stay on its side of the surface: everywhere but at
 * voxels of thick parts that face the other side (THIN_LOOSE) and at small pieces that stick out of
 * them (THIN_RAGGED).  mask (n, x fastest): 1 inside, 0 outside, 0 on the border.  O(n) time,
 * O(n) bytes and O(rows of voxels) memory. */
apsm_status thin_mark(const size_t n[3], const unsigned char *mask,
                      unsigned char *firm) APSM_NODISCARD;

#endif
