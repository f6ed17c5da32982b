/* hdf5_file.h -- the little of HDF5 that models need; only in a build with APSM_HDF5. */
#ifndef APSM_EXCHANGE_HDF5_FILE_H
#define APSM_EXCHANGE_HDF5_FILE_H

#include <hdf5.h>
#include <stdbool.h>
#include <stddef.h>

/* All return whether it worked.  Groups on the way are made; no times are kept, so that the same
 * values give the same bytes. */
bool h5_put_floats(hid_t file, const char *path, size_t rows, size_t columns, const float *x);
bool h5_put_ints(hid_t file, const char *path, size_t rows, size_t columns, const int *x);
bool h5_put_int(hid_t file, const char *path, int x);
bool h5_put_text(hid_t file, const char *path, const char *text);
bool h5_put_group(hid_t file, const char *path);
bool h5_put_attribute(hid_t file, const char *group, const char *name, const char *text);
/* *x (malloc'ed) <- the numbers of a dataset of one or two axes (columns 1: one), or a scalar. */
bool h5_get(hid_t file, const char *path, size_t *rows, size_t *columns, double **x);

#endif
