/* pack.h -- arrays of numbers as bytes that compress well, and the way into a text file. */
#ifndef APSM_REPORT_PACK_H
#define APSM_REPORT_PACK_H

#include <stddef.h>
#include <stdint.h>

#include "files/files.h"

struct json_t;

/* Packed arrays one after the other.  Zero-initialise with {0}; pack_free leaves it so. */
typedef struct pack {
    unsigned char *data;
    size_t size, capacity;
    int failed; /* out of memory, at any time: told by pack_write */
} pack;

/* Appends n integers below 2^(8 width), width 1, 2 or 4, as differences to the number `stride`
 * before, folded to small positive ones, all lowest bytes first.  Returns where and what it is for
 * the viewer, [offset, n, stride, width]: a new reference, NULL if out of memory. */
struct json_t *pack_integers(pack *p, size_t n, size_t stride, int width, const uint32_t *x);

/* Points x (n x 3) as integers of 16 bits, x = lo + step * integer; base (n x 3, or NULL): as the
 * difference to the integers of those points, modulo 2^16. */
struct json_t *pack_points(pack *p, size_t n, const double lo[3], double step, const double *base,
                           const double *x);
/* Numbers x >= 0 as bytes, x = largest * (integer / 255)^2: fine where they are small. */
struct json_t *pack_distances(pack *p, size_t n, double largest, const double *x);

/* Writes root and the packed arrays as base64 of a zlib stream: length of the JSON text (4
 * bytes, little-endian), the text, the arrays. */
apsm_status pack_write(apsm_context *ctx, pack *p, const struct json_t *root, apsm_writer *out);
void pack_free(pack *p);

#endif
