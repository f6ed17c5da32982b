/* Segmentations: labels on an oriented grid. */
#include "apsm/volume.h"

#include <stdlib.h>
#include <string.h>

void apsm_volume_free(apsm_volume *volume)
{
    free(volume->label);
    *volume = (apsm_volume){ 0 };
}

void apsm_volume_index_to_lps(const apsm_volume *volume, double M[16])
{
    memset(M, 0, 16 * sizeof *M);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            M[4 * r + c] = volume->direction[3 * r + c] * volume->spacing[c];
        M[4 * r + 3] = volume->origin[r];
    }
    M[15] = 1.0;
}
