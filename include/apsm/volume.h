/* volume.h -- a segmentation: labels on an oriented grid. */
#ifndef APSM_VOLUME_H
#define APSM_VOLUME_H

#include "apsm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Voxel (i,j,k) has label[i + n[0] * (j + n[1] * k)] and its centre at
 * origin + direction * (spacing[0] i, spacing[1] j, spacing[2] k) in LPS mm.  direction is
 * row-major; its columns are the grid's axes as unit vectors (det may be -1).  Owns label. */
typedef struct apsm_volume {
    size_t n[3];
    double origin[3], spacing[3], direction[9];
    int32_t *label;
} apsm_volume;

void apsm_volume_free(apsm_volume *volume);
/* Row-major 4 x 4 map from (i,j,k) to LPS. */
void apsm_volume_index_to_lps(const apsm_volume *volume, double M[16]);

#ifdef __cplusplus
}
#endif
#endif
