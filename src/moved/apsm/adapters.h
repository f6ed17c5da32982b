/* adapters.h -- former names of apsm/formats.h. */
#ifndef APSM_ADAPTERS_H
#define APSM_ADAPTERS_H

#include "apsm/formats.h"

#define apsm_vtk_read_mesh     apsm_read_mesh
#define apsm_vtk_write_mesh    apsm_write_mesh
#define apsm_vtk_read_points   apsm_read_mesh_points
#define apsm_vtk_write_points  apsm_write_mesh_points
#define apsm_itk_read_volume   apsm_read_volume
#define apsm_itk_write_volume  apsm_write_volume
#define apsm_dicom_read_volume apsm_read_dicom

#endif
