/* NIfTI-1 and NIfTI-2, plain or in gzip (whatever the name says), and pairs of .hdr and .img; and
 * Analyze 7.5, whose header NIfTI-1 was made from, without a place in space.
 *
 * Where a voxel is: by the sform if its code is set, else by the qform if its code is set, else by
 * the voxel sizes alone, whose axes are then taken for right, anterior, superior.  Lengths are in
 * the unit that the header names; mm if it names none. */
#include <math.h>
#include <stdlib.h>

#include "formats/image.h"
#include "formats/inflate.h"
#include "formats/input_file.h"

enum { HEAD_1 = 348, HEAD_2 = 540 };
enum { REGULAR = 38, ORIENT = 252 }; /* bytes of Analyze 7.5 */

typedef struct nifti {
    const unsigned char *head;
    bool second, big_endian, pair, analyze;
    int64_t dim[8];
    int type;
    double pixdim[8], offset, slope, intercept;
    int qform, sform;
    double quatern[3], qoffset[3], srow[12];
    double unit; /* in mm */
} nifti;

static double real_at(const nifti *h, size_t first, size_t second)
{
    return h->second ? scalar_real(SCALAR_F64, h->head + second, h->big_endian)
                     : scalar_real(SCALAR_F32, h->head + first, h->big_endian);
}

static int64_t code_at(const nifti *h, size_t first, size_t second)
{
    return h->second ? scalar_integer(SCALAR_I32, h->head + second, h->big_endian)
                     : scalar_integer(SCALAR_I16, h->head + first, h->big_endian);
}

/* Which NIfTI it is, in which order of bytes. */
static void recognise(scan *s, nifti *h)
{
    const int64_t little = scalar_integer(SCALAR_I32, h->head, false),
                  big = scalar_integer(SCALAR_I32, h->head, true);
    h->big_endian = big == HEAD_1 || big == HEAD_2;
    h->second = (h->big_endian ? big : little) == HEAD_2;
    if (!h->big_endian && little != HEAD_1 && little != HEAD_2) {
        scan_refuse(s, APSM_ERR_FORMAT,
                    "has no NIfTI header, whatever its name says; export it again");
        return;
    }
    const char *const magic = (const char *)h->head + (h->second ? 4 : 344);
    const bool single = memcmp(magic, "n+", 2) == 0, pair = memcmp(magic, "ni", 2) == 0;
    h->analyze =
        !h->second && !single && !pair && h->head[REGULAR] == 'r' && path_ends_in(s->path, ".hdr");
    h->pair = pair || h->analyze;
    if (!single && !h->pair)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "its header is damaged, or not that of NIfTI; copy or export it again");
    if (h->analyze && h->head[ORIENT] > 0 && h->head[ORIENT] < 6)
        scan_refuse(s, APSM_ERR_UNSUPPORTED,
                    "is an Analyze image with slices that are not transverse; convert it to NIfTI "
                    "(`nib-convert IN.img OUT.nii.gz`)");
}

static double unit_of(int code)
{
    return code == 1 ? 1e3 : code == 3 ? 1e-3 : 1.0; /* m, um, mm or unknown */
}

static void read_fields(nifti *h)
{
    for (size_t k = 0; k < 8; k++) {
        h->dim[k] = h->second ? scalar_integer(SCALAR_I64, h->head + 16 + 8 * k, h->big_endian)
                              : scalar_integer(SCALAR_I16, h->head + 40 + 2 * k, h->big_endian);
        h->pixdim[k] = real_at(h, 76 + 4 * k, 104 + 8 * k);
    }
    h->type = (int)scalar_integer(SCALAR_I16, h->head + (h->second ? 12 : 70), h->big_endian);
    h->offset = h->second ? (double)scalar_integer(SCALAR_I64, h->head + 168, h->big_endian)
                          : real_at(h, 108, 0);
    h->slope = real_at(h, 112, 176);
    h->intercept = real_at(h, 116, 184);
    h->qform = (int)code_at(h, 252, 344);
    h->sform = (int)code_at(h, 254, 348);
    for (size_t k = 0; k < 3; k++) {
        h->quatern[k] = real_at(h, 256 + 4 * k, 352 + 8 * k);
        h->qoffset[k] = real_at(h, 268 + 4 * k, 376 + 8 * k);
    }
    for (size_t k = 0; k < 12; k++) h->srow[k] = real_at(h, 280 + 4 * k, 400 + 8 * k);
    h->unit = unit_of(h->second ? (int)code_at(h, 0, 500) & 7 : h->head[123] & 7);
    if (h->analyze) { /* other things are in their places */
        h->qform = h->sform = 0;
        h->unit = 1.0;
    }
}

/* ---- sizes and types ---- */

static void check_sizes(scan *s, const nifti *h, image *m)
{
    const int64_t dimensions = h->dim[0];
    if (dimensions < 1 || dimensions > 7) {
        scan_refuse(s, APSM_ERR_FORMAT, "has %lld dimensions; export it again",
                    (long long)dimensions);
        return;
    }
    for (int64_t d = 1; d <= dimensions; d++) {
        if (h->dim[d] < 1)
            scan_refuse(s, APSM_ERR_FORMAT, "has %lld voxels along an axis; export it again",
                        (long long)h->dim[d]);
        if (d > 3 && h->dim[d] != 1)
            scan_refuse(s, APSM_ERR_FORMAT, "is not 3-D; extract one volume of the series");
        if (d <= 3) m->n[d - 1] = (size_t)h->dim[d];
    }
    if (dimensions < 3)
        scan_refuse(s, APSM_ERR_FORMAT, "is a flat image, not 3-D; give the whole stack of slices");
}

static void read_type(scan *s, const nifti *h, image *m)
{
    static const struct {
        int code;
        scalar type;
    } known[] = { { 2, SCALAR_U8 },    { 4, SCALAR_I16 },   { 8, SCALAR_I32 },
                  { 16, SCALAR_F32 },  { 64, SCALAR_F64 },  { 256, SCALAR_I8 },
                  { 512, SCALAR_U16 }, { 768, SCALAR_U32 }, { 1024, SCALAR_I64 },
                  { 1280, SCALAR_U64 } };
    m->big_endian = h->big_endian;
    if (isfinite(h->slope) && isfinite(h->intercept) && fabs(h->slope) > 0.0) {
        m->slope = h->slope;
        m->intercept = h->intercept;
    }
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (known[k].code == h->type) {
            m->type = known[k].type;
            return;
        }
    if (h->type == 128 || h->type == 2304)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "has colours, several components per voxel; save it with one label per voxel");
    scan_refuse(s, APSM_ERR_FORMAT, "voxels are of NIfTI type %d; save them as integers", h->type);
}

/* ---- the grid, in RAS and the file's unit ---- */

typedef struct grid {
    double step[9], origin[3];
} grid;

static grid grid_of_sform(const nifti *h)
{
    grid g;
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) g.step[3 * r + c] = h->srow[4 * r + c];
        g.origin[r] = h->srow[4 * r + 3];
    }
    return g;
}

/* The rotation of the quaternion (a, b, c, d), times the voxel sizes; pixdim[0] < 0 turns the
 * third axis over. */
static grid grid_of_qform(const nifti *h)
{
    double b = h->quatern[0], c = h->quatern[1], d = h->quatern[2];
    double a = 1.0 - (b * b + c * c + d * d);
    if (a < 1e-7) { /* as the standard has it: half a turn, up to rounding */
        const double length = 1.0 / sqrt(b * b + c * c + d * d);
        b *= length, c *= length, d *= length, a = 0.0;
    } else {
        a = sqrt(a);
    }
    const double R[9] = { a * a + b * b - c * c - d * d, 2 * (b * c - a * d),
                          2 * (b * d + a * c),           2 * (b * c + a * d),
                          a * a + c * c - b * b - d * d, 2 * (c * d - a * b),
                          2 * (b * d - a * c),           2 * (c * d + a * b),
                          a * a + d * d - b * b - c * c };
    grid g;
    for (int r = 0; r < 3; r++) {
        for (int k = 0; k < 3; k++)
            g.step[3 * r + k] =
                R[3 * r + k] * fabs(h->pixdim[k + 1]) * (k == 2 && h->pixdim[0] < 0.0 ? -1 : 1);
        g.origin[r] = h->qoffset[r];
    }
    return g;
}

/* Of Analyze the first axis is taken to run to the left. */
static grid grid_of_sizes(const nifti *h)
{
    grid g = { .step = { 0 } };
    for (int c = 0; c < 3; c++) g.step[4 * c] = fabs(h->pixdim[c + 1]);
    if (h->analyze) g.step[0] = -g.step[0];
    return g;
}

static double determinant(const double D[9])
{
    return D[0] * (D[4] * D[8] - D[5] * D[7]) - D[1] * (D[3] * D[8] - D[5] * D[6]) +
           D[2] * (D[3] * D[7] - D[4] * D[6]);
}

/* Every number of a form that is switched on. */
static void check_numbers(scan *s, const nifti *h)
{
    static const double most = 1e15;
    bool good = true;
    for (int k = 1; k <= 3; k++) good = good && fabs(h->pixdim[k]) < most;
    for (int k = 0; k < 3 && h->qform > 0; k++)
        good = good && fabs(h->quatern[k]) < 2.0 && fabs(h->qoffset[k]) < most;
    for (int k = 0; k < 12 && h->sform > 0; k++) good = good && fabs(h->srow[k]) < most;
    if (!good)
        scan_refuse(s, APSM_ERR_FORMAT,
                    "its grid has no place in space; correct qform and sform in its header");
}

/* Where the parts of the header contradict each other so that the hand or the size depends on
 * which is taken. */
static void tell_conflicts(scan *s, const nifti *h, image *m, const grid *taken)
{
    static const double same = 0.02; /* of volume: more than rounded headers differ by */
    const double det = determinant(taken->step);
    if (h->sform > 0 && h->qform > 0 && det * determinant(grid_of_qform(h).step) < 0.0)
        image_note(s, m,
                   "its sform and qform are mirror images of each other; the sform was taken: "
                   "check left and right");
    const double sizes = fabs(h->pixdim[1] * h->pixdim[2] * h->pixdim[3]);
    if (h->sform > 0 && fabs(fabs(det) / sizes - 1.0) > same)
        image_note(s, m,
                   "its sform makes voxels of %.6g mm3, its voxel sizes of %.6g; the sform was "
                   "taken: check the size",
                   fabs(det) * pow(h->unit, 3), sizes * pow(h->unit, 3));
    if (h->analyze)
        image_note(s, m,
                   "an Analyze image does not tell left from right; its axes were taken for left, "
                   "anterior, superior: check left and right");
    else if (h->sform <= 0 && h->qform <= 0)
        image_note(s, m,
                   "neither sform nor qform says where it lies; its axes were taken for right, "
                   "anterior, superior: check left and right");
    if (h->sform <= 0 && !h->analyze &&
        (h->pixdim[1] < 0.0 || h->pixdim[2] < 0.0 || h->pixdim[3] < 0.0))
        image_note(s, m,
                   "a voxel size in its header is negative, which means nothing in NIfTI; taken "
                   "without the sign: check left and right");
    if (h->unit < 1.0 || h->unit > 1.0)
        image_note(s, m, "its lengths are in %s; turned into mm",
                   h->unit < 1.0 ? "micrometres" : "metres");
}

static void place(scan *s, const nifti *h, image *m)
{
    check_numbers(s, h);
    if (!scan_ok(s)) return;
    const grid g = h->sform > 0   ? grid_of_sform(h)
                   : h->qform > 0 ? grid_of_qform(h)
                                  : grid_of_sizes(h);
    tell_conflicts(s, h, m, &g);
    for (int r = 0; r < 3; r++) {
        const double scale = r < 2 ? -h->unit : h->unit; /* RAS to LPS */
        for (int c = 0; c < 3; c++) m->step[3 * r + c] = scale * g.step[3 * r + c];
        m->origin[r] = scale * g.origin[r];
    }
}

/* ---- data ---- */

/* "x.hdr" has its voxels in "x.img" or "x.img.gz". */
static void load_pair(scan *s, image *m)
{
    const char *const base = apsm_path_last(s->path);
    const size_t stem = strlen(base) > 4 ? strlen(base) - 4 : 0;
    char *const name = malloc(strlen(base) + 8), *const folder = apsm_path_folder(s->path);
    if (!name || !folder) scan_no_memory(s);
    for (int packed = 0; packed < 2 && scan_ok(s) && !m->detached; packed++) {
        memcpy(name, base, stem);
        strcpy(name + stem, packed ? ".img.gz" : ".img");
        char *const path = apsm_path_join(folder, name);
        if (packed || (path && apsm_file_exists(path))) image_load_data(s, m, name);
        free(path);
    }
    free(name);
    free(folder);
    m->packing = m->data && is_gzip(m->data, m->size) ? PACKED : PLAIN;
}

/* What is before the voxels: to be passed in plain data, to be unpacked in others. */
static void skip_to_voxels(scan *s, const nifti *h, image *m)
{
    const double least = h->pair ? 0.0 : h->second ? HEAD_2 : HEAD_1;
    const double offset = h->offset < least && !h->pair ? least : h->offset;
    if (!(offset >= 0.0) || offset > 1e9 || (m->packing == PLAIN && offset > (double)m->size)) {
        scan_refuse(s, APSM_ERR_FORMAT, "ends before its first voxel; copy or export it again");
        return;
    }
    m->lead = (size_t)offset;
}

void read_nifti(scan *s, image *m)
{
    unsigned char unpacked[HEAD_2] = { 0 };
    nifti h = { .head = (const unsigned char *)s->bytes };
    size_t held = s->size;
    m->data = (const unsigned char *)s->bytes;
    m->size = s->size;
    m->packing = is_gzip(m->data, m->size) ? PACKED : PLAIN;
    if (m->packing == PACKED) {
        held = inflate_head(m->data, m->size, sizeof unpacked, unpacked);
        h.head = unpacked;
    }
    if (held < HEAD_1 || (held < HEAD_2 && h.head[0] != 92 && h.head[3] != 92)) {
        scan_refuse(s, APSM_ERR_FORMAT,
                    "is too short for a NIfTI file; it is cut short or damaged: copy or export it "
                    "again");
        return;
    }
    recognise(s, &h);
    if (!scan_ok(s)) return;
    read_fields(&h);
    check_sizes(s, &h, m);
    image_simple(m);
    read_type(s, &h, m);
    place(s, &h, m);
    if (scan_ok(s) && h.pair) load_pair(s, m);
    if (scan_ok(s)) skip_to_voxels(s, &h, m);
}
