#include "formats/vtp_write.h"

#include <stdlib.h>
#include <string.h>
#define ZLIB_CONST
#include <zlib.h>

enum { BLOCK = 1 << 15, LEVEL = 6 };

typedef struct sink {
    apsm_writer *w;
    unsigned char *packed; /* what one array is packed into */
    size_t room;
} sink;

static void put_base64(apsm_writer *w, const unsigned char *bytes, size_t n)
{
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t at = 0; at < n; at += 3) {
        const size_t left = n - at;
        const uint32_t bits = (uint32_t)bytes[at] << 16 |
                              (left > 1 ? (uint32_t)bytes[at + 1] << 8 : 0) |
                              (left > 2 ? (uint32_t)bytes[at + 2] : 0);
        char out[4] = { digit[bits >> 18], digit[bits >> 12 & 63], digit[bits >> 6 & 63],
                        digit[bits & 63] };
        if (left < 3) out[3] = '=';
        if (left < 2) out[2] = '=';
        apsm_writer_write(w, out, 4);
    }
}

static void put_u64(unsigned char *out, uint64_t value)
{
    for (int b = 0; b < 8; b++) out[b] = (unsigned char)(value >> (8 * b));
}

/* n bytes in blocks, packed one by one: their number, their size, the size of the last if that is
 * another, and their packed sizes; then they. */
static bool put_packed(sink *k, const unsigned char *bytes, size_t n)
{
    const size_t blocks = (n + BLOCK - 1) / BLOCK, head = 8 * (3 + blocks);
    unsigned char *const header = malloc(head);
    size_t at = 0;
    bool good = header != NULL;
    for (size_t b = 0; good && b < blocks; b++) {
        const size_t size = n - b * BLOCK < BLOCK ? n - b * BLOCK : BLOCK;
        uLongf packed = (uLongf)(k->room - at);
        good = compress2(k->packed + at, &packed, bytes + b * BLOCK, (uLong)size, LEVEL) == Z_OK;
        put_u64(header + 8 * (3 + b), packed);
        at += packed;
    }
    if (good) {
        put_u64(header, blocks);
        put_u64(header + 8, BLOCK);
        put_u64(header + 16, n % BLOCK);
        put_base64(k->w, header, head);
        put_base64(k->w, k->packed, at);
    }
    free(header);
    return good;
}

static bool put_array(sink *k, const char *name, const char *type, const unsigned char *bytes,
                      size_t n)
{
    const bool points = strcmp(name, "Points") == 0;
    apsm_writer_printf(k->w, "<DataArray type=\"%s\" Name=\"%s\"%s format=\"binary\">", type, name,
                       points ? " NumberOfComponents=\"3\"" : "");
    const bool good = put_packed(k, bytes, n);
    apsm_writer_printf(k->w, "</DataArray>\n");
    return good;
}

static void little_endian(size_t n, const double *x, unsigned char *out)
{
    for (size_t i = 0; i < n; i++) {
        uint64_t bits;
        memcpy(&bits, &x[i], sizeof bits);
        put_u64(out + 8 * i, bits);
    }
}

/* raw: scratch for the largest array. */
static bool put_piece(sink *k, unsigned char *raw, size_t points, const double *P, size_t cells,
                      const uint32_t *cell)
{
    const size_t corners = cell ? 3 : 1;
    const char *const section = cell ? "Polys" : "Verts";
    apsm_writer_printf(k->w, "<Points>\n");
    little_endian(3 * points, P, raw);
    bool good = put_array(k, "Points", "Float64", raw, 24 * points);
    apsm_writer_printf(k->w, "</Points>\n<%s>\n", section);
    for (size_t c = 0; c < corners * cells; c++) put_u64(raw + 8 * c, cell ? cell[c] : c);
    good = good && put_array(k, "connectivity", "Int64", raw, 8 * corners * cells);
    for (size_t f = 0; f < cells; f++) put_u64(raw + 8 * f, corners * (f + 1));
    good = good && put_array(k, "offsets", "Int64", raw, 8 * cells);
    apsm_writer_printf(k->w, "</%s>\n", section);
    return good;
}

apsm_status vtp_write(apsm_context *ctx, const char *path, apsm_writer *w, size_t points,
                      const double *P, size_t cells, const uint32_t *cell)
{
    const size_t largest = 24 * (points > cells ? points : cells),
                 room = largest + (largest / BLOCK + 1) * 64 + 1024;
    unsigned char *const raw = malloc(largest + 1);
    sink k = { .w = w, .packed = malloc(room), .room = room };
    apsm_writer_printf(w,
                       "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
                       "byte_order=\"LittleEndian\" header_type=\"UInt64\" "
                       "compressor=\"vtkZLibDataCompressor\">\n<PolyData>\n<Piece "
                       "NumberOfPoints=\"%zu\" NumberOfVerts=\"%zu\" NumberOfLines=\"0\" "
                       "NumberOfStrips=\"0\" NumberOfPolys=\"%zu\">\n",
                       points, cell ? (size_t)0 : cells, cell ? cells : (size_t)0);
    const bool good = raw && k.packed && put_piece(&k, raw, points, P, cells, cell);
    apsm_writer_printf(w, "</Piece>\n</PolyData>\n</VTKFile>\n");
    free(raw);
    free(k.packed);
    if (good) return apsm_writer_commit(w);
    apsm_writer_abort(w);
    return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory; close other programs", path);
}
