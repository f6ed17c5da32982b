/* vtp_data.h -- the values of one DataArray of a VTP file: as text, in base64 or raw, packed by
 * zlib or not. */
#ifndef APSM_FORMATS_VTP_DATA_H
#define APSM_FORMATS_VTP_DATA_H

#include "formats/scan.h"

/* How the whole file is written. */
typedef struct vtp_encoding {
    bool big_endian, packed;
    size_t header; /* bytes of the numbers before the data: 4 or 8 */
} vtp_encoding;

/* Where the bytes of an array come from. */
typedef struct vtp_source {
    const char *at, *end;
    bool base64;
    unsigned char carry[3]; /* decoded, not yet taken */
    int carried;
} vtp_source;

/* out <- the next n bytes; false if there are fewer. */
bool vtp_take(vtp_source *from, size_t n, unsigned char *out);

/* *bytes <- the first n bytes of the array at `from`, malloc'ed; NULL on failure, which is
 * recorded with the array's name. */
unsigned char *vtp_bytes(scan *s, const char *name, const vtp_encoding *e, vtp_source from,
                         size_t n);

#endif
