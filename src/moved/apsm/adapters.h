/* adapters.h -- former names of apsm/formats.h. */
#ifndef APSM_ADAPTERS_H
#define APSM_ADAPTERS_H

#include "apsm/formats.h"

#define apsm_read_mesh         apsm_read_mesh
#define apsm_write_mesh        apsm_write_mesh
#define apsm_read_mesh_points  apsm_read_mesh_points
#define apsm_write_mesh_points apsm_write_mesh_points
#define apsm_read_volume       apsm_read_volume
#define apsm_write_volume      apsm_write_volume
#define apsm_read_dicom        apsm_read_dicom

#endif
