/* Headers in every variant: what comes out is compared with the rules of docs/formats.md, worked
 * out here from the numbers that the test itself puts in. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "apsm/formats.h"
#include "scratch_fixture.h"

enum { NX = 4, NY = 3, NZ = 2, VOXELS = NX * NY * NZ };

static int value_of(size_t i)
{
    return (int)(i * 5 % 7);
}

static void store(unsigned char *out, const void *value, size_t size, bool big)
{
    for (size_t b = 0; b < size; b++)
        out[big ? size - 1 - b : b] = ((const unsigned char *)value)[b];
}

static void expect_volume(const apsm_volume *v, const double M[12], const char *what)
{
    double got[16];
    assert_true(v->n[0] == NX && v->n[1] == NY && v->n[2] == NZ);
    apsm_volume_index_to_lps(v, got);
    for (int k = 0; k < 12; k++)
        if (!(fabs(got[k] - M[k]) <= 2e-6 * (1.0 + fabs(M[k]))))
            fail_msg("%s: M[%d] = %.9g, not %.9g", what, k, got[k], M[k]);
    for (size_t i = 0; i < VOXELS; i++) assert_int_equal(v->label[i], value_of(i));
}

/* ---- NIfTI ---- */

typedef struct nifti {
    bool second, big;
    int qform, sform, unit;
    double quatern[3], qoffset[3], pixdim[4], srow[12];
} nifti;

static void put_real(unsigned char *head, const nifti *h, size_t first, size_t second, double x)
{
    const float f = (float)x;
    if (h->second)
        store(head + second, &x, 8, h->big);
    else
        store(head + first, &f, 4, h->big);
}

static void put_code(unsigned char *head, const nifti *h, size_t first, size_t second, int x)
{
    const int16_t small = (int16_t)x;
    const int32_t wide = x;
    if (h->second)
        store(head + second, &wide, 4, h->big);
    else
        store(head + first, &small, 2, h->big);
}

static void write_nifti(const char *path, const nifti *h)
{
    unsigned char b[544 + VOXELS] = { 0 };
    const size_t head = h->second ? 544 : 352;
    const int32_t size = h->second ? 540 : 348;
    const int n[8] = { 3, NX, NY, NZ, 1, 1, 1, 1 };
    store(b, &size, 4, h->big);
    for (size_t k = 0; k < 8; k++) {
        const int16_t small = (int16_t)n[k];
        const int64_t wide = n[k];
        if (h->second)
            store(b + 16 + 8 * k, &wide, 8, h->big);
        else
            store(b + 40 + 2 * k, &small, 2, h->big);
    }
    const int16_t type = 2, bits = 8;
    store(b + (h->second ? 12 : 70), &type, 2, h->big);
    store(b + (h->second ? 14 : 72), &bits, 2, h->big);
    const int64_t offset = (int64_t)head;
    if (h->second)
        store(b + 168, &offset, 8, h->big);
    else
        put_real(b, h, 108, 0, (double)head);
    for (size_t k = 0; k < 4; k++) put_real(b, h, 76 + 4 * k, 104 + 8 * k, h->pixdim[k]);
    put_code(b, h, 252, 344, h->qform);
    put_code(b, h, 254, 348, h->sform);
    for (size_t k = 0; k < 3; k++) {
        put_real(b, h, 256 + 4 * k, 352 + 8 * k, h->quatern[k]);
        put_real(b, h, 268 + 4 * k, 376 + 8 * k, h->qoffset[k]);
    }
    for (size_t k = 0; k < 12; k++) put_real(b, h, 280 + 4 * k, 400 + 8 * k, h->srow[k]);
    if (h->second)
        put_code(b, h, 0, 500, h->unit);
    else
        b[123] = (unsigned char)h->unit;
    memcpy(b + (h->second ? 4 : 344), h->second ? "n+2\0\r\n\032\n" : "n+1", h->second ? 8 : 4);
    for (size_t i = 0; i < VOXELS; i++) b[head + i] = (unsigned char)value_of(i);
    scratch_write(path, b, head + VOXELS);
}

/* By the rule, with the rotation of half a turn and a bit about z: (a, 0, 0, d). */
static void expect_nifti(const nifti *h, double M[12])
{
    const double d = h->quatern[2], a = sqrt(1.0 - d * d),
                 unit = h->unit == 1   ? 1e3
                        : h->unit == 3 ? 1e-3
                                       : 1.0;
    const double R[9] = { a * a - d * d, -2 * a * d, 0, 2 * a * d, a * a - d * d, 0, 0, 0, 1 };
    for (int r = 0; r < 3; r++) {
        const double sign = r < 2 ? -unit : unit;
        for (int c = 0; c < 3; c++)
            M[4 * r + c] = sign * (h->sform   ? h->srow[4 * r + c]
                                   : h->qform ? R[3 * r + c] * h->pixdim[c + 1] *
                                                    (c == 2 && h->pixdim[0] < 0 ? -1 : 1)
                                              : (r == c) * h->pixdim[c + 1]);
        M[4 * r + 3] = sign * (h->sform ? h->srow[4 * r + 3] : h->qform ? h->qoffset[r] : 0.0);
    }
}

static void expect_nifti_notes(const nifti *h, const char *notes)
{
    const double det = h->srow[0] * h->srow[5] * h->srow[10]; /* off the diagonal it is 0 */
    const double sizes = h->pixdim[1] * h->pixdim[2] * h->pixdim[3];
    const bool mirrored = h->sform && h->qform && (det < 0) != (h->pixdim[0] < 0);
    const bool sized = h->sform && fabs(fabs(det) / sizes - 1) > 0.02;
    const struct {
        bool wanted;
        const char *word;
    } says[] = { { mirrored, "mirror images" },
                 { sized, "check the size" },
                 { !h->sform && !h->qform, "neither" },
                 { h->unit == 1 || h->unit == 3, "turned into mm" } };
    for (int k = 0; k < 4; k++)
        if (says[k].wanted != (notes && strstr(notes, says[k].word)))
            fail_msg("'%s' %s: %s", says[k].word, says[k].wanted ? "is missing" : "is there",
                     notes ? notes : "(no notes)");
}

static void every_nifti_header_is_read_by_the_rule(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "h.nii");
    for (unsigned k = 0; k < 2u * 2 * 2 * 3 * 2 * 2 * 4; k++) {
        unsigned i = k;
        nifti h = { .second = i & 1, .big = i >> 1 & 1, .qform = i >> 2 & 1 };
        i >>= 3;
        h.sform = (int)(i % 3);
        i /= 3;
        h.pixdim[0] = i & 1 ? -1 : 1;
        const bool bigger = i >> 1 & 1;
        h.unit = (int)(i >> 2 & 3);
        const double pixdim[3] = { 0.5, 0.75, 2 }, offset[3] = { 12.5, -7, 100 };
        for (int c = 0; c < 3; c++) {
            h.pixdim[c + 1] = pixdim[c];
            h.qoffset[c] = offset[c];
            h.srow[5 * c] = pixdim[c] * (bigger ? 1.25 : 1) * (c == 0 && k % 5 == 0 ? -1 : 1);
            h.srow[4 * c + 3] = -2 * offset[c];
        }
        h.quatern[2] = 0.6;
        apsm_volume v;
        double M[12];
        write_nifti(path, &h);
        expect_nifti(&h, M);
        if (apsm_read_volume(f->ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
        expect_volume(&v, M, "nifti");
        expect_nifti_notes(&h, v.notes);
        apsm_volume_free(&v);
    }
}

/* The rounding of a rotated sform to three decimals leaves axes that are not quite at right
 * angles; what is said is what is taken. */
static void rounded_sforms_are_read(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "r.nii");
    nifti h = { .sform = 1, .unit = 2, .pixdim = { 1, .3, .3, .3 } };
    const double srow[12] = { .26, -.15, .001, 5, .15, .26, 0, 6, 0, .001, .3, 7 };
    memcpy(h.srow, srow, sizeof srow);
    write_nifti(path, &h);
    apsm_volume v;
    double M[12];
    expect_nifti(&h, M);
    if (apsm_read_volume(f->ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    expect_volume(&v, M, "rounded");
    apsm_volume_free(&v);
}

/* Labels stored as 30 k and 30 k + 15, slope and intercept rounded to floats, are labels (the
 * largest of them 5 + 2e-7); with a slope that is more than rounding away they are values. */
static void labels_in_scaled_images_are_labels(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "scaled.nii");
    const nifti h = { .sform = 1,
                      .unit = 2,
                      .pixdim = { 1, 1, 1, 1 },
                      .srow = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 } };
    const float slope[3] = { 1 / 30.f, 1 / 30.f, 1.00001f / 30 }, intercept[3] = { 0, -.5f, 0 };
    for (int k = 0; k < 3; k++) {
        unsigned char data[VOXELS];
        for (size_t i = 0; i < VOXELS; i++)
            data[i] = (unsigned char)(30 * value_of(i) + 15 * (k == 1));
        write_nifti(path, &h);
        FILE *file = fopen(path, "r+b");
        assert_true(file && fseek(file, 112, SEEK_SET) == 0 && fwrite(slope + k, 4, 1, file) == 1);
        assert_true(fwrite(intercept + k, 4, 1, file) == 1 && fseek(file, 352, SEEK_SET) == 0);
        assert_true(fwrite(data, VOXELS, 1, file) == 1 && fclose(file) == 0);
        apsm_volume v;
        if (apsm_read_volume(f->ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
        assert_true(k < 2 ? v.label && !v.value : v.value && !v.label);
        for (size_t i = 0; i < VOXELS && k < 2; i++) assert_int_equal(v.label[i], value_of(i));
        apsm_volume_free(&v);
    }
}

/* ---- NRRD and MetaImage: every type, both orders, text ---- */

static const struct type {
    const char *nrrd, *meta;
    size_t size;
    bool real;
} types[] = { { "signed char", "MET_CHAR", 1, false },
              { "uint8", "MET_UCHAR", 1, false },
              { "short", "MET_SHORT", 2, false },
              { "ushort", "MET_USHORT", 2, false },
              { "int", "MET_INT", 4, false },
              { "uint32_t", "MET_UINT", 4, false },
              { "long long", "MET_LONG_LONG", 8, false },
              { "uint64", "MET_ULONG_LONG", 8, false },
              { "float", "MET_FLOAT", 4, true },
              { "double", "MET_DOUBLE", 8, true } };
enum { TYPES = sizeof types / sizeof *types };

static size_t put_values(unsigned char *out, const struct type *t, bool big, bool text)
{
    size_t at = 0;
    for (size_t i = 0; i < VOXELS; i++) {
        const int64_t whole = value_of(i);
        const double wide = value_of(i);
        const float narrow = (float)wide;
        if (text) {
            at += (size_t)sprintf((char *)out + at, "%d ", value_of(i));
            continue;
        }
        store(out + at, t->real ? (t->size == 4 ? (const void *)&narrow : &wide) : &whole, t->size,
              big);
        at += t->size;
    }
    return at;
}

/* way: 0 directions in LPS, 1 directions in RAS, 2 spacings, 3 neither. */
static int nrrd_head(char *out, const struct type *t, bool big, bool text, int way)
{
    static const char *const grids[] = {
        "space: left-posterior-superior\nspace directions: (0.5,0,0) (0,0.6,0.8) (0,-1.6,1.2)\n"
        "space origin: (1,2,3)\n",
        "space: RAS\nspace directions: (-0.5,0,0) (0,-0.6,0.8) (0,1.6,1.2)\nspace origin: "
        "(-1,-2,3)\n",
        "spacings: 0.5 1 2\naxis mins: 1 2 3\n", ""
    };
    return sprintf(out,
                   "NRRD0005\n# c\ntype: %s\ndimension: 3\nsizes: 4 3 2\n%sendian: %s\n"
                   "encoding: %s\n\n",
                   t->nrrd, grids[way], big ? "big" : "little", text ? "txt" : "raw");
}

static void every_nrrd_header_is_read(void **state)
{
    static const double M[4][12] = { { .5, 0, 0, 1, 0, .6, -1.6, 2, 0, .8, 1.2, 3 },
                                     { .5, 0, 0, 1, 0, .6, -1.6, 2, 0, .8, 1.2, 3 },
                                     { .5, 0, 0, 1, 0, 1, 0, 2, 0, 0, 2, 3 },
                                     { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 } };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "h.nrrd");
    for (int k = 0; k < TYPES * 2 * 2 * 4; k++) {
        const struct type *const t = &types[k % TYPES];
        const bool big = k / TYPES & 1, text = k / TYPES & 2;
        const int way = k / TYPES / 4;
        unsigned char bytes[2048];
        const int head = nrrd_head((char *)bytes, t, big, text, way);
        scratch_write(path, bytes, (size_t)head + put_values(bytes + head, t, big, text));
        apsm_volume v;
        if (apsm_read_volume(f->ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
        expect_volume(&v, M[way], t->nrrd);
        assert_true((way == 3) == (v.notes && strstr(v.notes, "1 mm")));
        apsm_volume_free(&v);
    }
}

static void every_metaimage_header_is_read(void **state)
{
    static const char *const grids[] = {
        "TransformMatrix = 1 0 0 0 .6 .8 0 -.8 .6\nOffset = 1 2 3\nElementSpacing = .5 1 2\n",
        "Orientation = 1 0 0 0 .6 .8 0 -.8 .6\nPosition = 1 2 3\nElementSize = .5 1 2\n",
        "Origin = 1 2 3\nElementSpacing = .5 1 2\n", ""
    };
    static const double M[4][12] = { { .5, 0, 0, 1, 0, .6, -1.6, 2, 0, .8, 1.2, 3 },
                                     { .5, 0, 0, 1, 0, .6, -1.6, 2, 0, .8, 1.2, 3 },
                                     { .5, 0, 0, 1, 0, 1, 0, 2, 0, 0, 2, 3 },
                                     { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 } };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "h.mha");
    for (int k = 0; k < TYPES * 2 * 2 * 4; k++) {
        const struct type *const t = &types[k % TYPES];
        const bool big = k / TYPES & 1, text = k / TYPES & 2;
        const int way = k / TYPES / 4;
        unsigned char bytes[2048];
        const int head =
            sprintf((char *)bytes,
                    "ObjectType = Image\nNDims = 3\nBinaryData = %s\n"
                    "BinaryDataByteOrderMSB = %s\n%sDimSize = 4 3 2\nElementType = "
                    "%s\nElementDataFile = LOCAL\n",
                    text ? "False" : "True", big ? "True" : "False", grids[way], t->meta);
        scratch_write(path, bytes, (size_t)head + put_values(bytes + head, t, big, text));
        apsm_volume v;
        if (apsm_read_volume(f->ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
        expect_volume(&v, M[way], t->meta);
        assert_true((way == 3) == (v.notes && strstr(v.notes, "1 mm")));
        apsm_volume_free(&v);
    }
}

/* Of the 48 ways in which axes can run, the letters of the side that each comes from or runs to
 * agree with the matrix, and all others are told. */
static void orientations_that_disagree_are_told(void **state)
{
    static const char sides[] =
        "RLAPIS"; /* letter 2 r: where LPS axis r comes from; + 1: runs to */
    static const int axes[6][3] = { { 0, 1, 2 }, { 0, 2, 1 }, { 1, 0, 2 },
                                    { 1, 2, 0 }, { 2, 0, 1 }, { 2, 1, 0 } };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "o.mha");
    for (int k = 0; k < 48; k++)
        for (int said = 0; said < 4; said++) { /* from, to, one letter turned over, none */
            double M[9] = { 0 };
            char letters[4] = "", line[64] = "", text[512];
            for (int c = 0; c < 3; c++) {
                const int r = axes[k / 8][c], up = k >> c & 1;
                M[3 * c + r] = up ? 1 : -1; /* MetaImage writes axis after axis */
                letters[c] = sides[2 * r + ((said == 1) == up) -
                                   (said == 2 && c == k % 3) * (((said == 1) == up) ? 1 : -1)];
            }
            if (said < 3) snprintf(line, sizeof line, "AnatomicalOrientation = %s\n", letters);
            const int head = snprintf(
                text, sizeof text,
                "NDims = 3\nDimSize = 4 3 2\nElementSpacing = 1 1 1\nTransformMatrix = %g %g %g "
                "%g %g %g %g %g %g\n%sElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
                M[0], M[1], M[2], M[3], M[4], M[5], M[6], M[7], M[8], line);
            for (int i = 0; i < VOXELS; i++) text[head + i] = (char)value_of((size_t)i);
            scratch_write(path, text, (size_t)head + VOXELS);
            apsm_volume v;
            assert_int_equal(apsm_read_volume(f->ctx, path, &v), APSM_OK);
            if ((said == 2) != (v.notes && strstr(v.notes, "AnatomicalOrientation")))
                fail_msg("%s: %s", text, v.notes ? v.notes : "no word");
            apsm_volume_free(&v);
        }
}

/* Two layers in which label 1 is one thing and another, as Slicer writes them. */
static void layers_of_segments_are_kept_apart(void **state)
{
    fixture *const f = *state;
    const char *const text =
        "NRRD0004\ntype: uint8\ndimension: 4\nspace: left-posterior-superior\nsizes: 2 2 1 2\n"
        "space directions: none (1,0,0) (0,1,0) (0,0,1)\nkinds: list domain domain domain\n"
        "encoding: ascii\nspace origin: (0,0,0)\nSegment0_Name:=left\nSegment0_LabelValue:=1\n"
        "Segment0_Layer:=0\nSegment1_Name:=right\nSegment1_LabelValue:=1\nSegment1_Layer:=1\n\n"
        "1 0  0 1  1 1  0 0\n";
    const char *const path = scratch_path(f->folder, "l.seg.nrrd");
    scratch_write(path, text, strlen(text));
    apsm_volume v;
    if (apsm_read_volume(f->ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    const int32_t wanted[8] = { 1, 0, 1, 0, 0, 1, 1, 0 };
    assert_true(v.layers == 2 && v.segments == 2 && v.n[0] == 2 && v.n[2] == 2);
    assert_memory_equal(v.label, wanted, sizeof wanted);
    assert_string_equal(v.segment[1].name, "right");
    assert_int_equal(v.segment[1].layer, 1);
    apsm_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_nifti_header_is_read_by_the_rule),
        cmocka_unit_test(rounded_sforms_are_read),
        cmocka_unit_test(labels_in_scaled_images_are_labels),
        cmocka_unit_test(every_nrrd_header_is_read),
        cmocka_unit_test(every_metaimage_header_is_read),
        cmocka_unit_test(orientations_that_disagree_are_told),
        cmocka_unit_test(layers_of_segments_are_kept_apart),
    };
    return cmocka_run_group_tests_name("headers", tests, setup, teardown);
}
