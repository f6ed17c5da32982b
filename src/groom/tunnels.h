/* tunnels.h -- handles of a mask are cut or filled one by one, whichever is cheaper. */
#ifndef APSM_GROOM_TUNNELS_H
#define APSM_GROOM_TUNNELS_H

#include "groom/mask.h"

typedef struct tunnels_report {
    long before, after;
    size_t filled, cut; /* voxels */
    double radius;      /* of the widest closing or opening that was needed, 0: none */
} tunnels_report;

/* Fills tunnels and cuts strands narrower than twice 0.12 of `size`, in place, until none is left
 * or nothing helps; anatomy that is wider stays, and so does all that is no handle: sinuses,
 * spikes, sheets.  spacing and size in one unit.  O(voxels) a step of a short ladder of radii and a
 * handle; 6 bytes a voxel. */
apsm_status mask_mend_tunnels(mask *m, const double spacing[3], double size,
                              tunnels_report *report) APSM_NODISCARD;

#endif
