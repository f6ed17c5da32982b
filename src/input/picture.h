/* picture.h -- pictures that lie beside shapes: .tif files of one page. */
#ifndef APSM_INPUT_PICTURE_H
#define APSM_INPUT_PICTURE_H

#include <stdbool.h>

/* Whether the file is a TIFF of one page that says of no further slices.  Reads some kilobytes. */
bool picture_is_one(const char *path);

#endif
