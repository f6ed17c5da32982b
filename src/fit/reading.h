/* reading.h -- an input of `apsm fit` as a surface. */
#ifndef APSM_FIT_READING_H
#define APSM_FIT_READING_H

#include "apsm/fit.h"
#include "groom/groom.h"
#include "input/input.h"

/* How the cohort was read and groomed. */
typedef struct fit_reading {
    apsm_labels labels;
    apsm_groom_options groom;
} fit_reading;

/* mesh (out): the surface in the frame of the input.  *extent: in, what is known; out, WHOLE or
 * PART.  A part is taken as it is. */
apsm_status fit_read_surface(apsm_context *ctx, const fit_reading *r, const apsm_input_case *c,
                             apsm_mesh *mesh, int *extent) APSM_NODISCARD;

#endif
