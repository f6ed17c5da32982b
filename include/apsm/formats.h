/* formats.h -- meshes, points and segmentations from files and into them, by extension.
 *
 * What is read is checked byte by byte: memory and time are bounded by the size of the file, and
 * whatever is wrong comes back as one line that names the file, the place and the remedy.  All may
 * run in several threads at once. */
#ifndef APSM_FORMATS_H
#define APSM_FORMATS_H

#include <stdbool.h>

#include "apsm/mesh.h"
#include "apsm/volume.h"

#ifdef __cplusplus
extern "C" {
#endif

/* PLY, STL, OBJ, OFF, legacy VTK, VTP, GIFTI, FreeSurfer: see docs/formats.md.  Those that say they
 * are in RAS come out in LPS.  Polygons are cut into triangles, coinciding points (STL)
 * merged; nothing else is changed.  mesh is overwritten, and {0} on failure. */
APSM_API apsm_status apsm_read_mesh(apsm_context *ctx, const char *path,
                                    apsm_mesh *mesh) APSM_NODISCARD;
/* Binary PLY, binary STL, OBJ, legacy VTK or VTP, atomically; equal meshes give equal bytes.  PLY
 * and STL hold float32 coordinates. */
APSM_API apsm_status apsm_write_mesh(apsm_context *ctx, const char *path,
                                     const apsm_mesh *mesh) APSM_NODISCARD;

/* A number at every vertex of a mesh; both borrowed.  name: a word of letters, digits and _. */
typedef struct apsm_mesh_field {
    const char *name;
    const double *value; /* nv */
} apsm_mesh_field;
/* Binary PLY with n fields as float32 properties of the vertices, or VTP with them as float64
 * arrays of its points, atomically. */
APSM_API apsm_status apsm_write_mesh_fields(apsm_context *ctx, const char *path,
                                            const apsm_mesh *mesh, size_t n,
                                            const apsm_mesh_field *field) APSM_NODISCARD;

/* The field `name` of the n vertices of a PLY, legacy VTK or VTP file, whose mesh apsm_read_mesh
 * reads; value: n. APSM_ERR_FORMAT: it has none, or of another number of vertices. */
APSM_API apsm_status apsm_read_mesh_field(apsm_context *ctx, const char *path, const char *name,
                                          size_t n, double *value) APSM_NODISCARD;

/* The points of a legacy VTK or VTP file without polygons, in their order.  *P (n x 3) is
 * malloc'ed.  A mesh is refused. */
APSM_API apsm_status apsm_read_mesh_points(apsm_context *ctx, const char *path, size_t *n,
                                           double **P) APSM_NODISCARD;
/* Writes P (n x 3) as points, each with a vertex cell so that viewers show it, atomically, by
 * extension .vtk or .vtp, to the last bit. */
APSM_API apsm_status apsm_write_mesh_points(apsm_context *ctx, const char *path, size_t n,
                                            const double *P) APSM_NODISCARD;

/* A segmentation: NIfTI-1 and 2 (.nii, .nii.gz, .hdr with .img), NRRD (.nrrd, .nhdr, Slicer's
 * .seg.nrrd with names and layers), MetaImage (.mha, .mhd), TIFF stacks, FreeSurfer's .mgh and
 * .mgz, Analyze 7.5; in LPS and mm whatever the file says. Whole numbers are labels; a real-valued
 * image with others comes as volume->value.  Where a header contradicts itself or lacks what
 * matters, the rule of docs/formats.md decides, and the volume's notes say so.  volume is
 * overwritten, and {0} on failure. */
APSM_API apsm_status apsm_read_volume(apsm_context *ctx, const char *path,
                                      apsm_volume *volume) APSM_NODISCARD;
/* The same from a folder that holds one DICOM series or one DICOM segmentation (SEG), or from one
 * file with frames; plain, deflated or run-length encoded; other compressions are refused by name.
 */
APSM_API apsm_status apsm_read_dicom(apsm_context *ctx, const char *folder,
                                     apsm_volume *volume) APSM_NODISCARD;
/* Labels of one layer into .nrrd, .nii, .nii.gz or .mha, packed but for .nii, atomically. */
APSM_API apsm_status apsm_write_volume(apsm_context *ctx, const char *path,
                                       const apsm_volume *volume) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
