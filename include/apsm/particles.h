/* particles.h -- particle sets from and to the files of other programs.
 *
 * The extension, in any case, names the format:
 *   .particles .lpts .wpts   ShapeWorks, text; 9 significant digits
 *   .csv                     header x,y,z, one particle a line
 *   .npy                     NumPy, version 1.0, float64 little-endian, n x 3 or I x n x 3
 *   .mrk.json                3D Slicer markups, one fiducial list; RAS is turned into LPS
 *   .vtk .vtp                points of VTK poly data without polygons
 * All but the first keep every bit of a coordinate.  The order of the particles is always kept: it
 * is the correspondence. */
#ifndef APSM_PARTICLES_H
#define APSM_PARTICLES_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The extension of path, with its dot as in the list above: a constant text, NULL if it is none
 * of them. */
APSM_API const char *apsm_points_extension(const char *path);

/* *P (n x 3, malloc'ed) <- the particles of path; n >= 1 and all finite.  Refused with a line that
 * names file and place: anything damaged, of another shape or kind, and a .npy of three axes. */
APSM_API apsm_status apsm_points_read(apsm_context *ctx, const char *path, size_t *n,
                                      double **P) APSM_NODISCARD;
/* Writes P (n x 3) atomically.  APSM_ERR_NONFINITE names the particle. */
APSM_API apsm_status apsm_points_write(apsm_context *ctx, const char *path, size_t n,
                                       const double *P) APSM_NODISCARD;

/* A whole cohort: *P (I x n x 3, malloc'ed).  Only a .npy has three axes; of any other file, and
 * of a .npy of two axes, *I is 0 and *P one set (n x 3). */
APSM_API apsm_status apsm_points_read_cohort(apsm_context *ctx, const char *path, size_t *I,
                                             size_t *n, double **P) APSM_NODISCARD;
/* Writes P (I x n x 3) as .npy of three axes, atomically. */
APSM_API apsm_status apsm_points_write_cohort(apsm_context *ctx, const char *path, size_t I,
                                              size_t n, const double *P) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
