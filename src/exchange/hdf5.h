/* hdf5.h -- the little of HDF5 that models need, after its File Format Specification 3.0: groups,
 * numbers and texts, stored in one piece. */
#ifndef APSM_EXCHANGE_HDF5_H
#define APSM_EXCHANGE_HDF5_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "files/files.h"

/* ---- writing: superblock 2, object headers 2, no times: the same values give the same bytes ----
 */

typedef struct h5_out h5_out;

/* NULL: out of memory. */
h5_out *h5_begin(void);
/* Groups on the way are made; a path is given once.  columns 0: one axis.  A text and an
 * attribute's name and text are borrowed until h5_end.  The first failure is told by h5_end. */
void h5_put_floats(h5_out *o, const char *path, size_t rows, size_t columns, const float *x);
void h5_put_ints(h5_out *o, const char *path, size_t rows, size_t columns, const int *x);
void h5_put_int(h5_out *o, const char *path, int x);
void h5_put_text(h5_out *o, const char *path, const char *text);
void h5_put_group(h5_out *o, const char *path);
void h5_put_attribute(h5_out *o, const char *group, const char *name, const char *text);
/* Writes all of it; o is freed in any case.  false: there was not memory enough. */
bool h5_end(h5_out *o, apsm_writer *w);

/* ---- reading: superblocks 0 to 3, groups old and new, numbers of any type in one
 * piece; or HDF5/JSON ---- */

typedef struct h5_in {
    apsm_context *ctx;
    const char *path;
    char *bytes;
    size_t size;
    uint64_t root;
    struct json_t *json; /* instead of the bytes: the same as JSON */
} h5_in;

apsm_status h5_open(apsm_context *ctx, const char *path, h5_in *in) APSM_NODISCARD;
void h5_close(h5_in *in);
/* *there <- whether the file has it. */
apsm_status h5_has(const h5_in *in, const char *name, bool *there) APSM_NODISCARD;
/* *x (malloc'ed) <- the numbers of a dataset of one or two axes (columns 1: one), or a scalar. */
apsm_status h5_read(const h5_in *in, const char *name, size_t *rows, size_t *columns,
                    double **x) APSM_NODISCARD;

/* ---- both ---- */

/* B. Jenkins' lookup3, the check sum of HDF5's headers. */
uint32_t h5_checksum(const unsigned char *bytes, size_t size);

enum {
    H5_SPACE = 1,
    H5_LINK_INFO = 2,
    H5_TYPE = 3,
    H5_FILL = 5,
    H5_LINK = 6,
    H5_EXTERNAL = 7,
    H5_LAYOUT = 8,
    H5_GROUP_INFO = 10,
    H5_ATTRIBUTE = 12,
    H5_CONTINUATION = 16,
    H5_SYMBOLS = 17
}; /* messages of an object's header */
#define H5_SIGNATURE "\x89HDF\r\n\x1a\n"

#endif
