/* NumPy's .npy, version 1.0: magic, version, the header's length, the header (a Python dictionary
 * of three keys, padded with blanks), the values row by row.  Nothing is allocated by what the
 * header claims before that agrees with the size of the file.
 *
 * Format: NumPy Enhancement Proposal 1. */
#include "files/point_formats.h"

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/io.h"

#define NPY_LIMIT ((size_t)1 << 36)
enum { MAGIC = 6, HEADER_AT = 10, ALIGN = 64, LONGEST_TEXT = 16 };
static const char magic[MAGIC] = { '\x93', 'N', 'U', 'M', 'P', 'Y' };

/* ---- Header ---- */

typedef struct header {
    const char *at, *end;
    char descr[LONGEST_TEXT];
    bool fortran;
    size_t axes, shape[3];
    unsigned seen; /* a bit for each key */
} header;

static bool next_is(header *h, char wanted)
{
    while (h->at < h->end && (*h->at == ' ' || *h->at == '\n')) h->at++;
    if (h->at == h->end || *h->at != wanted) return false;
    h->at++;
    return true;
}

static bool take_text(header *h, char text[LONGEST_TEXT])
{
    const char quote = next_is(h, '\'') ? '\'' : '"';
    if (quote == '"' && !next_is(h, '"')) return false;
    const char *stop = memchr(h->at, quote, (size_t)(h->end - h->at));
    if (!stop || stop - h->at >= LONGEST_TEXT) return false;
    snprintf(text, LONGEST_TEXT, "%.*s", (int)(stop - h->at), h->at);
    h->at = stop + 1;
    return true;
}

static bool take_bool(header *h, bool *value)
{
    *value = next_is(h, 'T');
    const char *rest = *value ? "rue" : "alse";
    if (!*value && !next_is(h, 'F')) return false;
    for (; *rest; rest++, h->at++)
        if (h->at == h->end || *h->at != *rest) return false;
    return true;
}

static bool take_size(header *h, size_t *value)
{
    const char *first = h->at;
    *value = 0;
    for (; h->at < h->end && *h->at >= '0' && *h->at <= '9'; h->at++) {
        const size_t digit = (size_t)(*h->at - '0');
        if (*value > (SIZE_MAX - digit) / 10) return false;
        *value = 10 * *value + digit;
    }
    return h->at > first;
}

/* "(27, 128, 3)"; more than three axes are counted but not kept. */
static bool take_shape(header *h)
{
    if (!next_is(h, '(')) return false;
    while (!next_is(h, ')')) {
        size_t length;
        if (h->axes > 0 && !next_is(h, ',')) return false;
        if (h->axes > 0 && next_is(h, ')')) break;
        while (next_is(h, ' ')) continue;
        if (!take_size(h, &length)) return false;
        if (h->axes < 3) h->shape[h->axes] = length;
        h->axes++;
    }
    return true;
}

static bool take_pair(header *h)
{
    static const char *const keys[] = { "descr", "fortran_order", "shape" };
    char key[LONGEST_TEXT];
    unsigned k = 0;
    if (!take_text(h, key)) return false;
    while (k < 3 && strcmp(key, keys[k]) != 0) k++;
    if (k == 3 || h->seen & 1u << k || !next_is(h, ':')) return false;
    h->seen |= 1u << k;
    if (k == 0) return take_text(h, h->descr);
    return k == 1 ? take_bool(h, &h->fortran) : take_shape(h);
}

static bool take_dictionary(header *h)
{
    if (!next_is(h, '{')) return false;
    do {
        if (next_is(h, '}')) break;
        if (!take_pair(h)) return false;
        if (next_is(h, '}')) break;
    } while (next_is(h, ','));
    next_is(h, '\0'); /* passes the blanks */
    return h->seen == 7 && h->at == h->end && h->at[-1] == '\n';
}

static apsm_status read_header(apsm_context *ctx, const char *path, const char *data, size_t size,
                               header *h)
{
    const unsigned char *byte = (const unsigned char *)data;
    if (size < HEADER_AT || memcmp(data, magic, MAGIC) != 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: does not begin like a NumPy file; make it with numpy.save", path);
    if (byte[6] != 1 || byte[7] != 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: NumPy format version %d.%d is not read; save with version 1.0", path,
                         byte[6], byte[7]);
    const size_t length = byte[8] + ((size_t)byte[9] << 8);
    if (length > size - HEADER_AT)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: ends within its header; save it again", path);
    *h = (header){ .at = data + HEADER_AT, .end = data + HEADER_AT + length };
    if (!take_dictionary(h))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: byte %td: the header cannot be understood; make it with numpy.save",
                         path, h->at - data);
    return APSM_OK;
}

static apsm_status check_header(apsm_context *ctx, const char *path, const header *h, size_t bytes)
{
    if (strcmp(h->descr, "<f8") != 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: holds values of type '%s', not '<f8'; save a.astype('<f8')", path,
                         h->descr);
    if (h->fortran)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: is stored column by column; save numpy.ascontiguousarray(a)", path);
    if (h->axes < 2 || h->axes > 3 || h->shape[h->axes - 1] != 3)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: its array is neither n x 3 nor shapes x n x 3; reshape it", path);
    const size_t rows = h->shape[0], columns = h->axes == 3 ? h->shape[1] : 1;
    if (rows == 0 || columns == 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: holds no particles; make it anew", path);
    const size_t most = bytes / (3 * sizeof(double));
    if (bytes % (3 * sizeof(double)) != 0 || rows > most / columns || rows * columns != most)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: %zu bytes of values do not fit its shape; it is cut short or "
                         "damaged: copy or save it again",
                         path, bytes);
    return APSM_OK;
}

/* ---- Values: little-endian, whatever the machine ---- */

static double value_of(const char *bytes)
{
    uint64_t bits = 0;
    double x;
    for (size_t b = 8; b-- > 0;) bits = bits << 8 | (unsigned char)bytes[b];
    memcpy(&x, &bits, sizeof x);
    return x;
}

static void put_value(apsm_writer *w, double x)
{
    uint64_t bits;
    unsigned char bytes[8];
    memcpy(&bits, &x, sizeof x);
    for (size_t b = 0; b < 8; b++) bytes[b] = (unsigned char)(bits >> 8 * b);
    apsm_writer_write(w, bytes, sizeof bytes);
}

static apsm_status parse(apsm_context *ctx, const char *path, const char *data, size_t size,
                         size_t *I, size_t *n, double **P)
{
    header h;
    APSM_TRY(read_header(ctx, path, data, size, &h));
    const size_t bytes = size - (size_t)(h.end - data), count = bytes / sizeof **P;
    APSM_TRY(check_header(ctx, path, &h, bytes));
    *P = malloc(bytes + 1);
    if (!*P) return apsm_fail_errno(ctx, path, "cannot be read", ENOMEM);
    for (size_t k = 0; k < count; k++) (*P)[k] = value_of(h.end + 8 * k);
    *I = h.axes == 3 ? h.shape[0] : 0;
    *n = h.shape[h.axes - 2];
    return APSM_OK;
}

apsm_status apsm_npy_read(apsm_context *ctx, const char *path, size_t *I, size_t *n, double **P)
{
    char *data;
    size_t size;
    *I = *n = 0;
    *P = NULL;
    APSM_TRY(apsm_read_file(ctx, path, NPY_LIMIT, &data, &size));
    const apsm_status status = parse(ctx, path, data, size, I, n, P);
    free(data);
    return status;
}

size_t apsm_npy_header(const char *descr, size_t axes, const size_t *shape,
                       char out[APSM_NPY_HEADER])
{
    char text[APSM_NPY_HEADER], list[80] = "";
    size_t used = 0;
    for (size_t a = 0; a < axes; a++)
        used += (size_t)snprintf(list + used, sizeof list - used, a ? " %zu," : "%zu,", shape[a]);
    if (axes > 1) list[used - 1] = '\0'; /* only (n,) keeps its comma */
    const int length = snprintf(
        text, sizeof text, "{'descr': '%s', 'fortran_order': False, 'shape': (%s), }", descr, list);
    /* Blanks and a newline, so that the values begin at a multiple of 64. */
    const size_t whole = (HEADER_AT + (size_t)length + 1 + ALIGN - 1) / ALIGN * ALIGN;
    const size_t rest = whole - HEADER_AT;
    const unsigned char fixed[4] = { 1, 0, (unsigned char)rest, (unsigned char)(rest >> 8) };
    memcpy(out, magic, MAGIC);
    memcpy(out + MAGIC, fixed, sizeof fixed);
    memset(out + HEADER_AT, ' ', rest - 1);
    memcpy(out + HEADER_AT, text, (size_t)length);
    out[whole - 1] = '\n';
    return whole;
}

apsm_status apsm_npy_write(apsm_context *ctx, const char *path, size_t I, size_t n, const double *P)
{
    const size_t shape[3] = { I, n, 3 };
    char head[APSM_NPY_HEADER];
    apsm_writer *w;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    const size_t length = apsm_npy_header("<f8", I ? 3 : 2, I ? shape : shape + 1, head);
    apsm_writer_write(w, head, length);
    for (size_t k = 0; k < 3 * n * (I ? I : 1); k++) put_value(w, P[k]);
    return apsm_writer_commit(w);
}
