/* labels_of.h -- from the values of an image to labels, or to the values of a function. */
#ifndef APSM_FORMATS_LABELS_OF_H
#define APSM_FORMATS_LABELS_OF_H

#include "formats/image.h"

/* volume->label, or volume->value if the image has a real type (or a slope) and values that are not
 * whole.  Values have been checked to be there. */
apsm_status labels_of(apsm_context *ctx, const char *path, const image *m,
                      apsm_volume *volume) APSM_NODISCARD;

#endif
