/* hdf5_json.h -- the same as JSON (HDF5/JSON of the HDF Group), which Scalismo writes since 1.0. */
#ifndef APSM_EXCHANGE_HDF5_JSON_H
#define APSM_EXCHANGE_HDF5_JSON_H

#include <stdbool.h>
#include <stddef.h>

struct json_t;

/* The value of the dataset of that name, borrowed; NULL: there is none. */
const struct json_t *hdf5_json_find(const struct json_t *file, const char *name);
/* Its axes (columns 0: one axis or a scalar); false if it is neither number, row nor matrix. */
bool hdf5_json_size(const struct json_t *value, size_t *rows, size_t *columns);
/* x (rows x columns, out); false if not all are finite numbers, or a row is of another length. */
bool hdf5_json_get(const struct json_t *value, size_t rows, size_t columns, double *x);

#endif
