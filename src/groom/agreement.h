/* agreement.h -- how well a surface agrees with the mask that it was made of. */
#ifndef APSM_GROOM_AGREEMENT_H
#define APSM_GROOM_AGREEMENT_H

#include "groom/mask.h"

/* Sets dice and departure of the report: of the closed surface, in the frame of the volume, and of
 * m->given.  O(faces' rows + voxels of the crop + voxels on the other side log nf). */
apsm_status mask_agreement(const apsm_volume *volume, const mask *m, const apsm_mesh *surface,
                           apsm_groom_report *report) APSM_NODISCARD;

#endif
