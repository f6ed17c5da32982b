/* adapters.h -- the C faces of the field's C++ libraries.  Every exception is caught behind them
 * and comes back as a status with a line that names the file. */
#ifndef APSM_ADAPTERS_H
#define APSM_ADAPTERS_H

#include <stdbool.h>

#include "apsm/mesh.h"
#include "apsm/volume.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ITK: NRRD, NIfTI, MetaImage; LPS whatever the file says.  Values must be integers. */
apsm_status apsm_itk_read_volume(apsm_context *ctx, const char *path,
                                 apsm_volume *volume) APSM_NODISCARD;
/* As above from a folder holding one DICOM series.  Comes from a plug-in loaded on first use;
 * APSM_ERR_UNSUPPORTED if it is not installed. */
apsm_status apsm_dicom_read_volume(apsm_context *ctx, const char *folder,
                                   apsm_volume *volume) APSM_NODISCARD;
/* Writes .nrrd, .nii, .nii.gz, .mha (by extension), for tests and tools. */
apsm_status apsm_itk_write_volume(apsm_context *ctx, const char *path,
                                  const apsm_volume *volume) APSM_NODISCARD;

/* VTK: PLY, STL, OBJ, legacy VTK, VTP by extension.  Polygons are triangulated, coinciding
 * points (STL) merged; nothing else is changed. */
apsm_status apsm_vtk_read_mesh(apsm_context *ctx, const char *path, apsm_mesh *mesh) APSM_NODISCARD;
/* Writes binary PLY, binary STL, OBJ, legacy VTK or VTP by extension, atomically.  PLY and STL
 * hold float32 coordinates. */
apsm_status apsm_vtk_write_mesh(apsm_context *ctx, const char *path,
                                const apsm_mesh *mesh) APSM_NODISCARD;

/* VTK: the points of a legacy VTK or VTP file without polygons, in their order.  *P (n x 3) is
 * malloc'ed.  A mesh is refused. */
apsm_status apsm_vtk_read_points(apsm_context *ctx, const char *path, size_t *n,
                                 double **P) APSM_NODISCARD;
/* Writes P (n x 3) as points, each with a vertex cell so that viewers show it, atomically, by
 * extension .vtk or .vtp, to the last bit. */
apsm_status apsm_vtk_write_points(apsm_context *ctx, const char *path, size_t n,
                                  const double *P) APSM_NODISCARD;

/* Iso-surface of values (n[0] x n[1] x n[2], x fastest, negative inside) at `level`, in index
 * coordinates, triangles facing outward (towards larger values). */
apsm_status apsm_vtk_isosurface(apsm_context *ctx, const size_t n[3], const float *values,
                                double level, apsm_mesh *mesh) APSM_NODISCARD;

/* VTK: one line of text (UTF-8) in a sans-serif font, `pixels` high; *coverage (height x width,
 * rows from the top, 0..255) is malloc'ed, NULL for an empty text.  All lines of a size are equally
 * high; signs that the font lacks are left out.  Not for several threads at a time. */
apsm_status apsm_vtk_text(apsm_context *ctx, const char *text, size_t pixels, bool bold,
                          size_t *width, size_t *height, unsigned char **coverage) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
