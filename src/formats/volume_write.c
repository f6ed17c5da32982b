/* Labels into NRRD, NIfTI-1 and MetaImage files. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#define ZLIB_CONST
#include <zlib.h>

#include "apsm/formats.h"
#include "formats/input_file.h"

typedef struct output {
    const apsm_volume *v;
    size_t voxels;
    bool small; /* a byte a label, else int32 */
    unsigned char *bytes;
    size_t size;
} output;

static void put_bits(unsigned char *out, uint32_t bits, size_t size)
{
    for (size_t b = 0; b < size; b++) out[b] = (unsigned char)(bits >> (8 * b));
}

static bool encode(output *o)
{
    o->voxels = o->v->n[0] * o->v->n[1] * o->v->n[2];
    o->small = true;
    for (size_t k = 0; k < o->voxels; k++)
        o->small = o->small && o->v->label[k] >= 0 && o->v->label[k] <= 255;
    o->size = o->voxels * (o->small ? 1 : 4);
    o->bytes = malloc(o->size + 1);
    for (size_t k = 0; o->bytes && k < o->voxels; k++)
        put_bits(o->bytes + k * (o->small ? 1 : 4), (uint32_t)o->v->label[k], o->small ? 1 : 4);
    return o->bytes != NULL;
}

/* head and bytes through deflate; window 15: zlib, 31: gzip. */
static bool pack(int window, const unsigned char *head, size_t head_size, const output *o,
                 unsigned char **packed, size_t *size)
{
    z_stream z = { .next_in = head, .avail_in = (uInt)head_size };
    *packed = NULL;
    if (o->size > UINT32_MAX - 65536 ||
        deflateInit2(&z, 6, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        return false;
    const size_t room = deflateBound(&z, (uLong)(head_size + o->size));
    *packed = malloc(room);
    z.next_out = *packed;
    z.avail_out = (uInt)room;
    bool good = *packed && (head_size == 0 || deflate(&z, Z_NO_FLUSH) == Z_OK);
    z.next_in = o->bytes;
    z.avail_in = (uInt)o->size;
    good = good && deflate(&z, Z_FINISH) == Z_STREAM_END;
    *size = room - z.avail_out;
    deflateEnd(&z);
    return good;
}

/* ---- headers in text ---- */

static void put_vector(apsm_writer *w, const double x[3], const char *between)
{
    for (int c = 0; c < 3; c++) {
        if (c) apsm_writer_printf(w, "%s", between);
        apsm_writer_number(w, x[c]);
    }
}

static void write_nrrd_head(apsm_writer *w, const output *o)
{
    const apsm_volume *const v = o->v;
    apsm_writer_printf(w,
                       "NRRD0004\ntype: %s\ndimension: 3\nspace: left-posterior-superior\nsizes: "
                       "%zu %zu %zu\nspace directions:",
                       o->small ? "unsigned char" : "int", v->n[0], v->n[1], v->n[2]);
    for (int a = 0; a < 3; a++) {
        double step[3];
        for (int r = 0; r < 3; r++) step[r] = v->direction[3 * r + a] * v->spacing[a];
        apsm_writer_printf(w, " (");
        put_vector(w, step, ",");
        apsm_writer_printf(w, ")");
    }
    apsm_writer_printf(
        w, "\nkinds: domain domain domain\nendian: little\nencoding: gzip\nspace origin: (");
    put_vector(w, v->origin, ",");
    apsm_writer_printf(w, ")\n\n");
}

static void write_meta_head(apsm_writer *w, const output *o, size_t packed)
{
    const apsm_volume *const v = o->v;
    apsm_writer_printf(w,
                       "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = "
                       "False\nCompressedData = True\nCompressedDataSize = %zu\nTransformMatrix =",
                       packed);
    for (int a = 0; a < 3; a++)
        for (int r = 0; r < 3; r++) {
            apsm_writer_printf(w, " ");
            apsm_writer_number(w, v->direction[3 * r + a]);
        }
    apsm_writer_printf(w, "\nOffset = ");
    put_vector(w, v->origin, " ");
    apsm_writer_printf(w, "\nElementSpacing = ");
    put_vector(w, v->spacing, " ");
    apsm_writer_printf(w, "\nDimSize = %zu %zu %zu\nElementType = %s\nElementDataFile = LOCAL\n",
                       v->n[0], v->n[1], v->n[2], o->small ? "MET_UCHAR" : "MET_INT");
}

/* ---- NIfTI ---- */

enum { NIFTI_HEAD = 352 };

static void put_float(unsigned char *out, double x)
{
    const float f = (float)x;
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    put_bits(out, bits, 4);
}

/* The quaternion q = (a, b, c, d), a >= 0, of the rotation R: P holds 4 q q', and the row of its
 * largest diagonal entry is taken. */
static void quaternion(const double R[9], double q[4])
{
    const double ab = R[7] - R[5], ac = R[2] - R[6], ad = R[3] - R[1], bc = R[3] + R[1],
                 bd = R[2] + R[6], cd = R[7] + R[5];
    const double P[4][4] = { { 1 + R[0] + R[4] + R[8], ab, ac, ad },
                             { ab, 1 + R[0] - R[4] - R[8], bc, bd },
                             { ac, bc, 1 - R[0] + R[4] - R[8], cd },
                             { ad, bd, cd, 1 - R[0] - R[4] + R[8] } };
    int k = 0;
    for (int i = 1; i < 4; i++)
        if (P[i][i] > P[k][k]) k = i;
    const double sign = P[k][0] < 0.0 ? -1.0 : 1.0;
    for (int i = 0; i < 4; i++) q[i] = sign * P[k][i] / (2.0 * sqrt(P[k][k]));
}

static void nifti_head(const output *o, unsigned char head[NIFTI_HEAD])
{
    const apsm_volume *const v = o->v;
    double R[9], q[4];
    memset(head, 0, NIFTI_HEAD);
    put_bits(head, 348, 4);
    put_bits(head + 40, 3, 2);
    for (size_t c = 0; c < 7; c++) put_bits(head + 42 + 2 * c, c < 3 ? (uint32_t)v->n[c] : 1, 2);
    put_bits(head + 70, o->small ? 2 : 8, 2);
    put_bits(head + 72, o->small ? 8 : 32, 2);
    for (size_t c = 0; c < 3; c++) put_float(head + 80 + 4 * c, v->spacing[c]);
    put_float(head + 108, NIFTI_HEAD);
    put_float(head + 112, 1.0);
    head[123] = 2; /* mm */
    put_bits(head + 252, 1, 2);
    put_bits(head + 254, 1, 2);
    for (size_t r = 0; r < 3; r++) {
        const double sign = r < 2 ? -1.0 : 1.0; /* LPS to RAS */
        for (size_t c = 0; c < 3; c++) {
            R[3 * r + c] = sign * v->direction[3 * r + c];
            put_float(head + 280 + 16 * r + 4 * c, R[3 * r + c] * v->spacing[c]);
        }
        put_float(head + 280 + 16 * r + 12, sign * v->origin[r]);
        put_float(head + 268 + 4 * r, sign * v->origin[r]);
    }
    const double det = R[0] * (R[4] * R[8] - R[5] * R[7]) - R[1] * (R[3] * R[8] - R[5] * R[6]) +
                       R[2] * (R[3] * R[7] - R[4] * R[6]);
    for (int r = 0; r < 3 && det < 0.0; r++) R[3 * r + 2] = -R[3 * r + 2];
    quaternion(R, q);
    put_float(head + 76, det < 0.0 ? -1.0 : 1.0);
    for (size_t k = 0; k < 3; k++) put_float(head + 256 + 4 * k, q[k + 1]);
    memcpy(head + 344, "n+1", 4);
}

/* ---- files ---- */

static bool write_packed(apsm_writer *w, const char *path, const output *o)
{
    unsigned char head[NIFTI_HEAD], *packed;
    const bool nifti = path_ends_in(path, ".nii.gz"), meta = path_ends_in(path, ".mha");
    size_t size;
    if (nifti) nifti_head(o, head);
    const bool good = pack(meta ? 15 : 31, head, nifti ? NIFTI_HEAD : 0, o, &packed, &size);
    if (good && meta) write_meta_head(w, o, size);
    if (good && !meta && !nifti) write_nrrd_head(w, o);
    if (good) apsm_writer_write(w, packed, size);
    free(packed);
    return good;
}

static bool write_plain(apsm_writer *w, const output *o)
{
    unsigned char head[NIFTI_HEAD];
    nifti_head(o, head);
    apsm_writer_write(w, head, sizeof head);
    apsm_writer_write(w, o->bytes, o->size);
    return true;
}

apsm_status apsm_write_volume(apsm_context *ctx, const char *path, const apsm_volume *volume)
{
    output o = { .v = volume };
    const bool plain = path_ends_in(path, ".nii");
    apsm_writer *w;
    if (!plain && !path_ends_in(path, ".nii.gz") && !path_ends_in(path, ".nrrd") &&
        !path_ends_in(path, ".mha"))
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: images are written as .nrrd, .nii, .nii.gz or .mha", path);
    for (int c = 0; c < 3; c++)
        if (volume->n[c] > 32767 && (plain || path_ends_in(path, ".nii.gz")))
            return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                             "%s: NIfTI-1 holds at most 32767 voxels along an axis; use .nrrd",
                             path);
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    const bool good = encode(&o) && (plain ? write_plain(w, &o) : write_packed(w, path, &o));
    free(o.bytes);
    if (good) return apsm_writer_commit(w);
    apsm_writer_abort(w);
    return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: no memory to pack it; close other programs", path);
}
