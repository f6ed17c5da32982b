/* Neighbouring vertices are near each other in a mesh file, so their differences are small, the
 * high bytes of these nearly all 0, and zlib does the rest: about a third of the plain bytes. */
#include "report/pack.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum { LEVEL = 6 };

static unsigned char *grow(pack *p, size_t n)
{
    if (p->failed) return NULL;
    if (p->size + n > p->capacity) {
        const size_t capacity = 2 * p->capacity > p->size + n ? 2 * p->capacity : p->size + n;
        unsigned char *data = realloc(p->data, capacity);
        if (!data) {
            p->failed = 1;
            return NULL;
        }
        p->data = data;
        p->capacity = capacity;
    }
    p->size += n;
    return p->data + p->size - n;
}

/* Signed difference modulo 2^bits, folded: 0, -1, 1, -2 ... -> 0, 1, 2, 3 ... */
static uint32_t fold(uint32_t x, uint32_t before, int width)
{
    const int spare = 32 - 8 * width;
    const int32_t d = (int32_t)((x - before) << spare) / (int32_t)(1u << spare);
    return d < 0 ? ~((uint32_t)d << 1) : (uint32_t)d << 1;
}

struct json_t *pack_integers(pack *p, size_t n, size_t stride, int width, const uint32_t *x)
{
    const size_t offset = p->size;
    unsigned char *out = grow(p, n * (size_t)width);
    if (!out) return NULL;
    for (size_t k = 0; k < n; k++) {
        const uint32_t f = fold(x[k], k < stride ? 0 : x[k - stride], width);
        for (int b = 0; b < width; b++) out[(size_t)b * n + k] = (unsigned char)(f >> (8 * b));
    }
    return json_pack("[I, I, I, i]", (json_int_t)offset, (json_int_t)n, (json_int_t)stride, width);
}

static uint32_t rounded(double x, uint32_t most)
{
    return x >= most ? most : x > 0 ? (uint32_t)(x + 0.5) : 0;
}

struct json_t *pack_points(pack *p, size_t n, const double lo[3], double step, const double *base,
                           const double *x)
{
    uint32_t *q = malloc((3 * n + 1) * sizeof *q);
    if (!q) return p->failed = 1, NULL;
    for (size_t k = 0; k < 3 * n; k++) {
        q[k] = rounded((x[k] - lo[k % 3]) / step, 0xffff);
        if (base) q[k] = (q[k] - rounded((base[k] - lo[k % 3]) / step, 0xffff)) & 0xffff;
    }
    json_t *where = pack_integers(p, 3 * n, 3, 2, q);
    free(q);
    return where;
}

struct json_t *pack_distances(pack *p, size_t n, double largest, const double *x)
{
    uint32_t *q = malloc((n + 1) * sizeof *q);
    if (!q) return p->failed = 1, NULL;
    for (size_t k = 0; k < n; k++) q[k] = rounded(255 * sqrt(x[k] / largest), 255);
    json_t *where = pack_integers(p, n, 1, 1, q);
    free(q);
    return where;
}

/* ---- base64 ---- */

static void write_base64(apsm_writer *out, size_t n, const unsigned char *x)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t k = 0; k < n; k += 3) {
        const size_t left = n - k;
        const unsigned v = (unsigned)x[k] << 16 | (left > 1 ? (unsigned)x[k + 1] << 8 : 0) |
                           (left > 2 ? (unsigned)x[k + 2] : 0);
        const char text[4] = { digits[v >> 18], digits[v >> 12 & 63],
                               left > 1 ? digits[v >> 6 & 63] : '=',
                               left > 2 ? digits[v & 63] : '=' };
        apsm_writer_write(out, text, 4);
    }
}

static unsigned char *deflated(const char *text, const pack *p, size_t *size)
{
    const size_t length = strlen(text), total = 4 + length + p->size;
    uLongf n = compressBound((uLong)total);
    unsigned char *plain = malloc(total), *small = malloc(n);
    int result = Z_MEM_ERROR;
    if (plain && small) {
        for (int b = 0; b < 4; b++) plain[b] = (unsigned char)(length >> (8 * b));
        memcpy(plain + 4, text, length);
        if (p->size > 0) memcpy(plain + 4 + length, p->data, p->size);
        result = compress2(small, &n, plain, (uLong)total, LEVEL);
    }
    free(plain);
    if (result != Z_OK) {
        free(small);
        return NULL;
    }
    *size = n;
    return small;
}

apsm_status pack_write(apsm_context *ctx, pack *p, const struct json_t *root, apsm_writer *out)
{
    size_t size = 0;
    char *text =
        p->failed || !root ? NULL : json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(9));
    unsigned char *bytes = text ? deflated(text, p, &size) : NULL;
    free(text);
    if (!bytes) return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for the report");
    write_base64(out, size, bytes);
    free(bytes);
    return APSM_OK;
}

void pack_free(pack *p)
{
    free(p->data);
    *p = (pack){ 0 };
}
