/* mask.h -- the label of a segmentation as a cropped binary mask. */
#ifndef APSM_GROOM_MASK_H
#define APSM_GROOM_MASK_H

#include "groom/groom.h"

typedef struct mask {
    size_t n[3];          /* of the crop */
    ptrdiff_t origin[3];  /* of the crop in the image, in voxels; negative where padded */
    unsigned char *in;    /* n, x fastest: 1 inside; owned */
    unsigned char *given; /* the same of the part that is kept, before anything is filled; owned, or
                             NULL: `in` still is that */
} mask;

/* Largest part, cavities filled if asked, cropped with rim[c] voxels of background on each side.
 * Adds to the report.  APSM_ERR_GEOMETRY if there is nothing, or several large parts. */
apsm_status mask_make(apsm_context *ctx, const char *name, const apsm_volume *volume,
                      const apsm_groom_options *opt, const size_t rim[3], mask *m,
                      apsm_groom_report *report) APSM_NODISCARD;
void mask_free(mask *m);
/* given <- in, unless it is kept already: before in changes. */
apsm_status mask_keep_given(mask *m) APSM_NODISCARD;
static inline const unsigned char *mask_given(const mask *m)
{
    return m->given ? m->given : m->in;
}
/* Background that no path joins to the outside; *filled (out) voxels. */
apsm_status mask_fill_cavities(mask *m, size_t *filled) APSM_NODISCARD;
/* Cube root of the volume of so many voxels. */
double mask_size(const apsm_volume *volume, size_t voxels);

#endif
