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
static bool put_piece(sink *k, unsigned char *raw, const vtp_piece *p)
{
    const size_t corners = p->cell ? 3 : 1;
    const char *const section = p->cell ? "Polys" : "Verts";
    bool good = true;
    if (p->fields > 0) apsm_writer_printf(k->w, "<PointData Scalars=\"%s\">\n", p->field[0].name);
    for (size_t f = 0; f < p->fields; f++) {
        little_endian(p->points, p->field[f].value, raw);
        good = good && put_array(k, p->field[f].name, "Float64", raw, 8 * p->points);
    }
    apsm_writer_printf(k->w, p->fields > 0 ? "</PointData>\n<Points>\n" : "<Points>\n");
    little_endian(3 * p->points, p->P, raw);
    good = good && put_array(k, "Points", "Float64", raw, 24 * p->points);
    apsm_writer_printf(k->w, "</Points>\n<%s>\n", section);
    for (size_t c = 0; c < corners * p->cells; c++) put_u64(raw + 8 * c, p->cell ? p->cell[c] : c);
    good = good && put_array(k, "connectivity", "Int64", raw, 8 * corners * p->cells);
    for (size_t f = 0; f < p->cells; f++) put_u64(raw + 8 * f, corners * (f + 1));
    good = good && put_array(k, "offsets", "Int64", raw, 8 * p->cells);
    apsm_writer_printf(k->w, "</%s>\n", section);
    return good;
}

apsm_status vtp_write(apsm_context *ctx, const char *path, apsm_writer *w, const vtp_piece *piece)
{
    const size_t largest = 24 * (piece->points > piece->cells ? piece->points : piece->cells),
                 room = largest + (largest / BLOCK + 1) * 64 + 1024,
                 vertices = piece->cell ? 0 : piece->cells;
    unsigned char *const raw = malloc(largest + 1);
    sink k = { .w = w, .packed = malloc(room), .room = room };
    apsm_writer_printf(w,
                       "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
                       "byte_order=\"LittleEndian\" header_type=\"UInt64\" "
                       "compressor=\"vtkZLibDataCompressor\">\n<PolyData>\n<Piece "
                       "NumberOfPoints=\"%zu\" NumberOfVerts=\"%zu\" NumberOfLines=\"0\" "
                       "NumberOfStrips=\"0\" NumberOfPolys=\"%zu\">\n",
                       piece->points, vertices, piece->cells - vertices);
    const bool good = raw && k.packed && put_piece(&k, raw, piece);
    apsm_writer_printf(w, "</Piece>\n</PolyData>\n</VTKFile>\n");
    free(raw);
    free(k.packed);
    if (good) return apsm_writer_commit(w);
    apsm_writer_abort(w);
    return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory; close other programs", path);
}
