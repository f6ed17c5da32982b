/* inflate.h -- zlib and gzip streams in memory, back into bytes of a known number. */
#ifndef APSM_FORMATS_INFLATE_H
#define APSM_FORMATS_INFLATE_H

#include <stdbool.h>
#include <stddef.h>

typedef enum inflated { INFLATED, INFLATE_SHORT, INFLATE_DAMAGED, INFLATE_NO_MEMORY } inflated;

/* *out <- the first `wanted` bytes of what packed[0..size) unpacks to, malloc'ed.  Memory grows
 * with what is really there, so a header that lies costs nothing.  The stream is read to its end,
 * so that its check sum is looked at; what it holds beyond `wanted` is dropped.  INFLATE_SHORT: it
 * is whole, but holds less.  INFLATE_DAMAGED: it is cut or wrong, or holds far more.  *out is NULL
 * unless INFLATED. */
inflated inflate_bytes(const unsigned char *packed, size_t size, size_t wanted,
                       unsigned char **out);

/* The first n (a few) bytes of what packed unpacks to, into out; how many there are. */
size_t inflate_head(const unsigned char *packed, size_t size, size_t n, unsigned char *out);

/* *out <- all of a stream without head and check sum (raw deflate), malloc'ed, *have bytes; at most
 * 256 times its size and 1 MiB, or it counts as damaged. */
inflated inflate_raw(const unsigned char *packed, size_t size, unsigned char **out, size_t *have);

/* Whether the bytes begin like gzip. */
static inline bool is_gzip(const unsigned char *bytes, size_t size)
{
    return size > 2 && bytes[0] == 0x1f && bytes[1] == 0x8b;
}

#endif
