/* volume.h -- voxels of a segmentation, however they are held. */
#ifndef APSM_GEOMETRY_VOLUME_H
#define APSM_GEOMETRY_VOLUME_H

#include "apsm/volume.h"

/* The label of a voxel, of all layers in turn; of an image that has labels. */
static inline int32_t volume_label(const apsm_volume *v, size_t at)
{
    return v->small ? v->small[at] : v->label[at];
}

#endif
