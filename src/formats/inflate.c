#include "formats/inflate.h"

#include <stdint.h>
#include <stdlib.h>
#define ZLIB_CONST
#include <zlib.h>

enum { PIECE = 1 << 30, FIRST = 1 << 16, MOST_EXCESS = 1 << 20, ZLIB_OR_GZIP = 47 };

typedef struct unpacking {
    z_stream z;
    const unsigned char *packed;
    size_t packed_left, wanted, have, room, excess;
    unsigned char *out;
} unpacking;

static unsigned piece(size_t n)
{
    return n < PIECE ? (unsigned)n : PIECE;
}

/* Room for more, at most for what is wanted. */
static bool grow(unpacking *u)
{
    if (u->have < u->room || u->room == u->wanted) return true;
    size_t next = u->room ? 2 * u->room : FIRST;
    if (next > u->wanted || next < u->room) next = u->wanted;
    unsigned char *const larger = realloc(u->out, next);
    if (!larger) return false;
    u->out = larger;
    u->room = next;
    return true;
}

/* One call of inflate, into the room or, when all that is wanted is there, into a drain. */
static int step(unpacking *u)
{
    unsigned char drain[4096];
    const bool full = u->have == u->wanted;
    const unsigned room = full ? sizeof drain : piece(u->room - u->have);
    if (u->z.avail_in == 0) {
        u->z.avail_in = piece(u->packed_left);
        u->z.next_in = u->packed;
        u->packed += u->z.avail_in;
        u->packed_left -= u->z.avail_in;
    }
    u->z.next_out = full ? drain : u->out + u->have;
    u->z.avail_out = room;
    const int state = inflate(&u->z, Z_NO_FLUSH);
    *(full ? &u->excess : &u->have) += room - u->z.avail_out;
    return state;
}

/* gzip files may be several streams, one after the other. */
static bool next_member(unpacking *u)
{
    return u->have < u->wanted && u->z.avail_in > 2 && is_gzip(u->z.next_in, u->z.avail_in) &&
           inflateReset(&u->z) == Z_OK;
}

static inflated unpack(unpacking *u)
{
    for (;;) {
        if (!grow(u)) return INFLATE_NO_MEMORY;
        const int state = step(u);
        if (state == Z_MEM_ERROR) return INFLATE_NO_MEMORY;
        if (state == Z_STREAM_END && !next_member(u))
            return u->have == u->wanted ? INFLATED : INFLATE_SHORT;
        if (state != Z_OK && state != Z_STREAM_END) return INFLATE_DAMAGED;
        if (u->excess > u->wanted + MOST_EXCESS) return INFLATE_DAMAGED;
    }
}

inflated inflate_bytes(const unsigned char *packed, size_t size, size_t wanted, unsigned char **out)
{
    unpacking u = { .packed = packed, .packed_left = size, .wanted = wanted };
    *out = NULL;
    if (inflateInit2(&u.z, ZLIB_OR_GZIP) != Z_OK) return INFLATE_NO_MEMORY;
    const inflated result = unpack(&u);
    inflateEnd(&u.z);
    if (result == INFLATED)
        *out = u.out;
    else
        free(u.out);
    return result;
}

size_t inflate_head(const unsigned char *packed, size_t size, size_t n, unsigned char *out)
{
    z_stream z = { .next_in = packed, .avail_in = piece(size) };
    if (inflateInit2(&z, ZLIB_OR_GZIP) != Z_OK) return 0;
    z.next_out = out;
    z.avail_out = (unsigned)n;
    while (z.avail_out && inflate(&z, Z_SYNC_FLUSH) == Z_OK) {
    }
    inflateEnd(&z);
    return n - z.avail_out;
}

inflated inflate_raw(const unsigned char *packed, size_t size, unsigned char **out, size_t *have)
{
    enum { MOST_GROWTH = 256 };
    const size_t most = size < SIZE_MAX / MOST_GROWTH - MOST_EXCESS ? size * MOST_GROWTH : size;
    unpacking u = { .packed = packed, .packed_left = size, .wanted = most + MOST_EXCESS };
    int state = Z_OK;
    *out = NULL;
    if (inflateInit2(&u.z, -MAX_WBITS) != Z_OK) return INFLATE_NO_MEMORY;
    while (state == Z_OK && grow(&u)) state = step(&u);
    inflateEnd(&u.z);
    if (state == Z_STREAM_END && u.excess) state = Z_DATA_ERROR;
    if (state == Z_STREAM_END) {
        *out = u.out;
        *have = u.have;
        return INFLATED;
    }
    free(u.out);
    return state == Z_OK || state == Z_MEM_ERROR ? INFLATE_NO_MEMORY : INFLATE_DAMAGED;
}
