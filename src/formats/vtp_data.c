#include "formats/vtp_data.h"

#include <stdlib.h>

#include "formats/inflate.h"

static int base64_digit(char c)
{
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

/* Three bytes, or fewer at the end of a piece, into the carry.  Pieces follow each other. */
static bool next_group(vtp_source *from)
{
    uint32_t bits = 0;
    int digits = 0, fill = 0;
    while (digits + fill < 4 && from->at < from->end) {
        const char c = *from->at;
        const int digit = base64_digit(c);
        if (digit < 0 && c != '=' && c != ' ' && c != '\n' && c != '\r' && c != '\t') break;
        from->at++;
        if (digit >= 0 && fill) return false;
        if (digit >= 0) bits = bits << 6 | (uint32_t)digit;
        digits += digit >= 0;
        fill += c == '=';
    }
    if (digits + fill < 4 || digits < 2) return false;
    bits <<= 6 * fill;
    from->carried = 3 - fill;
    for (int k = 0; k < from->carried; k++) from->carry[k] = (unsigned char)(bits >> (16 - 8 * k));
    return true;
}

bool vtp_take(vtp_source *from, size_t n, unsigned char *out)
{
    if (!from->base64) {
        if ((size_t)(from->end - from->at) < n) return false;
        memcpy(out, from->at, n);
        from->at += n;
        return true;
    }
    while (n > 0) {
        if (from->carried == 0 && !next_group(from)) return false;
        while (n > 0 && from->carried > 0) {
            *out++ = from->carry[0];
            memmove(from->carry, from->carry + 1, 2);
            from->carried--;
            n--;
        }
    }
    return true;
}

/* At most so many bytes can come. */
static size_t held(const vtp_source *from)
{
    const size_t left = (size_t)(from->end - from->at);
    return from->base64 ? left / 4 * 3 + (size_t)from->carried : left;
}

static void cut_short(scan *s, const char *name)
{
    scan_refuse(s, APSM_ERR_FORMAT,
                "its array '%s' holds fewer values than it should; the file is damaged: copy or "
                "export it again",
                name);
}

/* A number before the data; SIZE_MAX if there is none. */
static uint64_t take_count(const vtp_encoding *e, vtp_source *from)
{
    unsigned char raw[8];
    return vtp_take(from, e->header, raw) ? scalar_bits(raw, e->header, e->big_endian) : UINT64_MAX;
}

static unsigned char *take_plain(scan *s, const char *name, const vtp_encoding *e, vtp_source *from,
                                 size_t n)
{
    const uint64_t there = take_count(e, from);
    if (there == UINT64_MAX || there < n || held(from) < n) {
        cut_short(s, name);
        return NULL;
    }
    unsigned char *const bytes = malloc(n + 1);
    if (!bytes) {
        scan_no_memory(s);
    } else if (!vtp_take(from, n, bytes)) {
        cut_short(s, name);
        free(bytes);
        return NULL;
    }
    return bytes;
}

/* One packed block of `size` bytes, which makes `wanted` bytes, appended to *bytes. */
static bool take_block(scan *s, const char *name, vtp_source *from, size_t size, size_t wanted,
                       unsigned char **bytes, size_t *have)
{
    unsigned char *const packed = size <= held(from) ? malloc(size + 1) : NULL, *block = NULL;
    inflated result = size <= held(from) ? INFLATE_NO_MEMORY : INFLATE_SHORT;
    if (packed)
        result = vtp_take(from, size, packed) ? inflate_bytes(packed, size, wanted, &block)
                                              : INFLATE_SHORT;
    free(packed);
    unsigned char *const larger = result == INFLATED ? realloc(*bytes, *have + wanted + 1) : NULL;
    if (larger) {
        *bytes = larger;
        if (wanted) memcpy(larger + *have, block, wanted);
        *have += wanted;
    } else if (result == INFLATED || result == INFLATE_NO_MEMORY) {
        scan_no_memory(s);
    } else {
        cut_short(s, name);
    }
    free(block);
    return larger != NULL;
}

/* blocks, size of each, size of the last if that is another, then their packed sizes. */
static unsigned char *take_packed(scan *s, const char *name, const vtp_encoding *e,
                                  vtp_source *from, size_t n)
{
    const uint64_t blocks = take_count(e, from), size = take_count(e, from),
                   last = take_count(e, from);
    if (last == UINT64_MAX || blocks > held(from) / e->header || size > UINT32_MAX ||
        last > UINT32_MAX) {
        cut_short(s, name);
        return NULL;
    }
    uint64_t *const packed = malloc((blocks + 1) * sizeof *packed);
    unsigned char *bytes = malloc(1);
    size_t have = 0;
    bool good = packed && bytes;
    if (!good) scan_no_memory(s);
    for (uint64_t b = 0; good && b < blocks; b++) packed[b] = take_count(e, from);
    if (good && from->base64) from->carried = 0; /* the data are a piece of their own */
    for (uint64_t b = 0; good && b < blocks; b++)
        good = take_block(s, name, from, packed[b], last && b + 1 == blocks ? last : size, &bytes,
                          &have);
    free(packed);
    if (good && have < n) cut_short(s, name);
    if (scan_ok(s)) return bytes;
    free(bytes);
    return NULL;
}

unsigned char *vtp_bytes(scan *s, const char *name, const vtp_encoding *e, vtp_source from,
                         size_t n)
{
    if (!scan_ok(s)) return NULL;
    return e->packed ? take_packed(s, name, e, &from, n) : take_plain(s, name, e, &from, n);
}
