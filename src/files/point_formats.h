/* point_formats.h -- the formats behind apsm/points_file.h that need no library of C++.  Readers
 * make *P (n x 3) by malloc and leave finiteness and n > 0 to the caller; writers are atomic. */
#ifndef APSM_FILES_POINT_FORMATS_H
#define APSM_FILES_POINT_FORMATS_H

#include <stddef.h>

#include "apsm/context.h"

/* I = 0 stands for two axes, n x 3. */
apsm_status apsm_npy_read(apsm_context *ctx, const char *path, size_t *I, size_t *n,
                          double **P) APSM_NODISCARD;
apsm_status apsm_npy_write(apsm_context *ctx, const char *path, size_t I, size_t n,
                           const double *P) APSM_NODISCARD;

/* The head of a .npy of 1 to 3 axes, of values as descr says ("<f8"); returns its length.  The
 * values follow, row by row, little-endian. */
enum { APSM_NPY_HEADER = 256 };
size_t apsm_npy_header(const char *descr, size_t axes, const size_t *shape,
                       char out[APSM_NPY_HEADER]);

apsm_status apsm_points_csv_read(apsm_context *ctx, const char *path, size_t *n,
                                 double **P) APSM_NODISCARD;
apsm_status apsm_points_csv_write(apsm_context *ctx, const char *path, size_t n,
                                  const double *P) APSM_NODISCARD;

apsm_status apsm_markups_read(apsm_context *ctx, const char *path, size_t *n,
                              double **P) APSM_NODISCARD;
apsm_status apsm_markups_write(apsm_context *ctx, const char *path, size_t n,
                               const double *P) APSM_NODISCARD;

#endif
