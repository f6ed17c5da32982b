/* vtk_image.h -- which .vtk files are images. */
#ifndef APSM_FORMATS_VTK_IMAGE_H
#define APSM_FORMATS_VTK_IMAGE_H

#include <stdbool.h>

/* Whether path is a legacy VTK file of structured points. */
bool vtk_is_image(const char *path);

#endif
