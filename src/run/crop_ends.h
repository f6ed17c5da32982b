/* crop_ends.h -- of groom: shapes that were cut off at different places are cropped alike. */
#ifndef APSM_RUN_CROP_ENDS_H
#define APSM_RUN_CROP_ENDS_H

#include "align/align.h"
#include "run/groom_inputs.h"

/* Crops the groomed, aligned meshes to what all of them hold, if they were cut off at different
 * places (cropped, out).  Says so in the log and in the manifest.  Where that would leave too
 * little of a shape, or fails, all stay as they are, with a warning. */
apsm_status groom_crop_ends(apsm_run *run, groom_inputs *in, const apsm_alignment *alignment,
                            bool *cropped);

#endif
