/* A DICOM series with an oblique stack, its files in shuffled order. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "apsm/formats.h"
#include "scratch_fixture.h"

enum { COLUMNS = 6, ROWS = 5, SLICES = 12 };
static const double cos_a = 0.8, sin_a = 0.6; /* about the x axis */
static const double first[3] = { -10.5, 20.0, 30.25 };

/* ---- a minimal writer: explicit VR, little endian ---- */
typedef struct buffer {
    unsigned char bytes[4096];
    size_t n;
} buffer;

static void put(buffer *b, const void *data, size_t n)
{
    assert_true(b->n + n <= sizeof b->bytes);
    memcpy(b->bytes + b->n, data, n);
    b->n += n;
}

static void put16(buffer *b, unsigned value)
{
    put(b, (unsigned char[]){ (unsigned char)(value & 255), (unsigned char)(value >> 8 & 255) }, 2);
}

static bool implicit; /* write elements without VR, but for group 2 */

static void put_element(buffer *b, unsigned group, unsigned element, const char vr[3],
                        const void *value, size_t n)
{
    if (implicit && group != 2) {
        put16(b, group);
        put16(b, element);
        put16(b, (unsigned)(n + n % 2));
        put16(b, 0);
        put(b, value, n);
        if (n % 2) put(b, strcmp(vr, "UI") == 0 ? "" : " ", 1);
        return;
    }
    const bool is_long = strcmp(vr, "OB") == 0 || strcmp(vr, "OW") == 0;
    const char pad = strcmp(vr, "UI") == 0 ? '\0' : ' ';
    put16(b, group);
    put16(b, element);
    put(b, vr, 2);
    if (is_long) put16(b, 0);
    put16(b, (unsigned)(n + n % 2));
    if (is_long) put16(b, 0);
    put(b, value, n);
    if (n % 2) put(b, &pad, 1);
}

static void put_text(buffer *b, unsigned group, unsigned element, const char vr[3],
                     const char *text)
{
    put_element(b, group, element, vr, text, strlen(text));
}

static void put_us(buffer *b, unsigned group, unsigned element, unsigned value)
{
    const unsigned char v[2] = { (unsigned char)value, 0 };
    put_element(b, group, element, "US", v, 2);
}

static unsigned value_at(int i, int j, int k)
{
    return (unsigned)(i + 7 * j + 41 * k) % 5;
}

static void put_voxels(buffer *b, int k)
{
    unsigned char voxels[2 * COLUMNS * ROWS] = { 0 };
    for (int j = 0; j < ROWS; j++)
        for (int i = 0; i < COLUMNS; i++)
            voxels[2 * (i + COLUMNS * j)] = (unsigned char)value_at(i, j, k);
    put_element(b, 0x7fe0, 0x0010, "OW", voxels, sizeof voxels);
}

/* A plane in PackBits: a run of the first two bytes if they are equal, all else as it is. */
static size_t pack_bits(const unsigned char *voxels, size_t plane, unsigned char *out)
{
    const size_t n = (size_t)COLUMNS * ROWS;
    size_t at = 0, k = 0;
    while (k < n) {
        if (k + 1 < n && voxels[2 * k + plane] == voxels[2 * (k + 1) + plane]) {
            out[at++] = 255; /* -1: twice */
            out[at++] = voxels[2 * k + plane];
            k += 2;
        } else {
            out[at++] = 0; /* one byte */
            out[at++] = voxels[2 * k++ + plane];
        }
    }
    return at;
}

/* An empty table of offsets, one fragment, the delimiter. */
static void put_rle_voxels(buffer *b, int k)
{
    unsigned char voxels[2 * COLUMNS * ROWS] = { 0 },
                                       out[64 + 8 * COLUMNS * ROWS] = { 2, 0, 0, 0, 64 };
    for (int i = 0; i < COLUMNS * ROWS; i++)
        voxels[2 * i] = (unsigned char)value_at(i % COLUMNS, i / COLUMNS, k);
    size_t n = 64 + pack_bits(voxels, 1, out + 64); /* the high bytes come first */
    out[8] = (unsigned char)n;
    n += pack_bits(voxels, 0, out + n);
    n += n % 2;
    put(b, "\xe0\x7f\x10\x00OB\0\0\xff\xff\xff\xff", 12);
    put(b, "\xfe\xff\x00\xe0\0\0\0\0", 8);
    put(b, "\xfe\xff\x00\xe0", 4);
    put16(b, (unsigned)n);
    put16(b, 0);
    put(b, out, n);
    put(b, "\xfe\xff\xdd\xe0\0\0\0\0", 8);
}

/* How a series differs from a plain one. */
typedef struct variant {
    double noise, tilt; /* mm along the normal, alternating; mm along y for each slice */
    int moved;          /* a slice that lies half a gap too far, or 0 */
    const char *syntax;
    const char *orientation; /* or NULL */
} variant;
static const variant plain = { .syntax = "1.2.840.10008.1.2.1" };

/* Slice k of a stack with gaps of 2.5 mm, as the file `name`. */
static void write_variant(const char *folder, const char *name, int k, const char *series,
                          const variant *o)
{
    static const char *const ct = "1.2.840.10008.5.1.4.1.1.2";
    buffer meta = { .n = 0 }, file = { .n = 128 };
    char text[96], uid[64];
    snprintf(uid, sizeof uid, "%s.%d", series, k + 1);
    put_element(&meta, 2, 1, "OB", "\0\1", 2);
    put_text(&meta, 2, 2, "UI", ct);
    put_text(&meta, 2, 3, "UI", uid);
    put_text(&meta, 2, 0x10, "UI", o->syntax);
    put_text(&meta, 2, 0x12, "UI", "1.2.3.4.5");
    put(&file, "DICM", 4);
    const unsigned char length[4] = { (unsigned char)(meta.n & 255), (unsigned char)(meta.n >> 8) };
    put_element(&file, 2, 0, "UL", length, 4);
    put(&file, meta.bytes, meta.n);
    put_text(&file, 0x08, 0x16, "UI", ct);
    put_text(&file, 0x08, 0x18, "UI", uid);
    put_text(&file, 0x08, 0x60, "CS", "CT");
    put_text(&file, 0x20, 0x0d, "UI", "1.2.3.4.6");
    put_text(&file, 0x20, 0x0e, "UI", series);
    put_text(&file, 0x20, 0x13, "IS", "1");
    /* The stack's normal is rows x columns = (0, -sin, cos). */
    const double height =
        2.5 * k + (k % 2 ? o->noise : -o->noise) + (k && k == o->moved ? 1.25 : 0.0);
    snprintf(text, sizeof text, "%.6f\\%.6f\\%.6f", first[0],
             first[1] - height * sin_a + o->tilt * k, first[2] + height * cos_a);
    put_text(&file, 0x20, 0x32, "DS", text);
    snprintf(text, sizeof text, "1\\0\\0\\0\\%.6f\\%.6f", cos_a, sin_a);
    put_text(&file, 0x20, 0x37, "DS", o->orientation ? o->orientation : text);
    put_text(&file, 0x20, 0x52, "UI", "1.2.3.4.7");
    put_us(&file, 0x28, 2, 1);
    put_text(&file, 0x28, 4, "CS", "MONOCHROME2");
    put_us(&file, 0x28, 0x10, ROWS);
    put_us(&file, 0x28, 0x11, COLUMNS);
    put_text(&file, 0x28, 0x30, "DS", "1.5\\0.5"); /* between rows, between columns */
    put_us(&file, 0x28, 0x100, 16);
    put_us(&file, 0x28, 0x101, 16);
    put_us(&file, 0x28, 0x102, 15);
    put_us(&file, 0x28, 0x103, 0);
    if (strcmp(o->syntax, "1.2.840.10008.1.2.5") == 0)
        put_rle_voxels(&file, k);
    else
        put_voxels(&file, k);
    scratch_write(scratch_path(folder, name), file.bytes, file.n);
}

static void write_slice(const char *folder, const char *name, int k, const char *series)
{
    write_variant(folder, name, k, series, &plain);
}

static void write_variants(const char *folder, const variant *o)
{
    for (int k = 0; k < SLICES; k++) {
        char name[64];
        snprintf(name, sizeof name, "%c%d", 'a' + k * 7 % SLICES, k);
        write_variant(folder, name, k, "1.2.3.9", o);
    }
}

static void write_series(const char *folder, const char *series, int without)
{
    for (int k = 0; k < SLICES; k++) {
        char name[64];
        snprintf(name, sizeof name, "%c%d-%s", 'a' + k * 7 % SLICES, k, series);
        if (k != without) write_slice(folder, name, k, series);
    }
}

static void an_oblique_series_is_read(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    write_series(f->folder, "1.2.3.9", -1);
    if (apsm_read_dicom(f->ctx, f->folder, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    assert_int_equal(v.n[0], COLUMNS);
    assert_int_equal(v.n[1], ROWS);
    assert_int_equal(v.n[2], SLICES);
    double M[16];
    apsm_volume_index_to_lps(&v, M);
    const double wanted[16] = {
        0.5,      0, 0,           first[0],    0,        1.5 * cos_a, -2.5 * sin_a,
        first[1], 0, 1.5 * sin_a, 2.5 * cos_a, first[2], 0,           0,
        0,        1
    };
    for (int k = 0; k < 16; k++)
        if (!(fabs(M[k] - wanted[k]) < 1e-5)) fail_msg("M[%d] = %g, not %g", k, M[k], wanted[k]);
    for (int k = 0; k < SLICES; k++)
        for (int j = 0; j < ROWS; j++)
            for (int i = 0; i < COLUMNS; i++)
                assert_int_equal(v.label[i + COLUMNS * (j + ROWS * k)], value_at(i, j, k));
    apsm_volume_free(&v);
}

static void bad_series_are_refused(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    expect_failure(f->ctx, apsm_read_dicom(f->ctx, f->folder, &v), APSM_ERR_FORMAT, "no DICOM",
                   f->folder);
    write_series(f->folder, "1.2.3.9", 5);
    expect_failure(f->ctx, apsm_read_dicom(f->ctx, f->folder, &v), APSM_ERR_FORMAT, "evenly",
                   f->folder);
    write_series(f->folder, "1.2.3.8", -1);
    expect_failure(f->ctx, apsm_read_dicom(f->ctx, f->folder, &v), APSM_ERR_FORMAT,
                   "2 DICOM series", f->folder);
    assert_null(v.label);
}

/* Rows along the columns have no plane, a direction of length 2 would double the shape, and one 5
 * degrees off the right angle shear it; three decimals are rounding. */
static void orientations_are_directions(void **state)
{
    static const char *const wrong[] = { "1\\0\\0\\1\\0\\0", "2\\0\\0\\0\\2\\0", "0\\0\\0\\0\\1\\0",
                                         "1\\0\\0\\0.087156\\0.996195\\0", "1.005\\0\\0\\0\\1\\0" };
    fixture *const f = *state;
    apsm_volume v = { 0 };
    variant o = plain;
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        o.orientation = wrong[k];
        write_variants(f->folder, &o);
        expect_failure(f->ctx, apsm_read_dicom(f->ctx, f->folder, &v), APSM_ERR_FORMAT,
                       "ImageOrientationPatient", "right angles");
    }
    o.orientation = "0.866\\0.4\\0.3\\-0.5\\0.693\\0.52";
    write_variants(f->folder, &o);
    if (apsm_read_dicom(f->ctx, f->folder, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    apsm_volume_free(&v);
}

/* Two decimals are brought to right angles, with a word; more decimals of the same are wrong. */
static void coarse_orientations_are_straightened(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    variant o = plain;
    double M[16], product = 0, length[2] = { 0 };
    o.orientation = "0.87\\0.4\\0.3\\-0.5\\0.69\\0.52";
    write_variants(f->folder, &o);
    if (apsm_read_dicom(f->ctx, f->folder, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    apsm_volume_index_to_lps(&v, M);
    for (int r = 0; r < 3; r++) {
        length[0] += M[4 * r] * M[4 * r];
        length[1] += M[4 * r + 1] * M[4 * r + 1];
        product += M[4 * r] * M[4 * r + 1];
    }
    assert_true(fabs(product) < 1e-6 && fabs(sqrt(length[0]) - v.spacing[0]) < 1e-6 &&
                fabs(sqrt(length[1]) - v.spacing[1]) < 1e-6);
    assert_true(fabs(M[0] / v.spacing[0] - 0.87) < 0.01 && fabs(M[1] / v.spacing[1] + 0.5) < 0.01);
    assert_non_null(strstr(v.notes, "two decimals"));
    apsm_volume_free(&v);
    o.orientation = "0.874\\0.4\\0.3\\-0.5\\0.69\\0.52";
    write_variants(f->folder, &o);
    expect_failure(f->ctx, apsm_read_dicom(f->ctx, f->folder, &v), APSM_ERR_FORMAT,
                   "ImageOrientationPatient", "right angles");
}

/* Where rows and columns are off by their decimals, the step between slices says where the plane
 * lies: no shear is made, nor told.  A gantry that is tilted by more stays so. */
static void coarse_planes_lie_across_the_step(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    variant o = plain;
    double M[16];
    o.orientation = "0.98\\0.15\\0.12\\-0.19\\0.79\\0.59"; /* .35 degrees off */
    write_variants(f->folder, &o);
    if (apsm_read_dicom(f->ctx, f->folder, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    apsm_volume_index_to_lps(&v, M);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < a; b++) {
            const double product = M[a] * M[b] + M[4 + a] * M[4 + b] + M[8 + a] * M[8 + b];
            assert_true(fabs(product) < 1e-5);
        }
    assert_true(fabs(M[0] / v.spacing[0] - 0.98) < 0.01 && fabs(M[5] / v.spacing[1] - 0.79) < 0.01);
    assert_non_null(strstr(v.notes, "two decimals"));
    assert_null(strstr(v.notes, "sheared"));
    apsm_volume_free(&v);
    o.tilt = 0.1;
    write_variants(f->folder, &o);
    if (apsm_read_dicom(f->ctx, f->folder, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    assert_non_null(strstr(v.notes, "sheared"));
    apsm_volume_free(&v);
}

/* What the size of a deviation is, not its presence, decides: a hundredth of the gap is the
 * rounding of someone's decimals, half of it a slice out of its place. */
static void positions_need_not_be_exact(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    variant o = plain;
    o.noise = 0.025;
    write_variants(f->folder, &o);
    if (apsm_read_dicom(f->ctx, f->folder, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    assert_true(fabs(v.spacing[2] - 2.5) < 0.01);
    apsm_volume_free(&v);
    o.moved = 4;
    write_variants(f->folder, &o);
    expect_failure(f->ctx, apsm_read_dicom(f->ctx, f->folder, &v), APSM_ERR_FORMAT, "evenly",
                   "missing");
}

/* The columns of the map are what was written: from slice to slice 2.5 mm along the normal and
 * half a millimetre along y. */
static void a_tilted_gantry_is_a_shear(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    variant o = plain;
    o.tilt = 0.5;
    write_variants(f->folder, &o);
    if (apsm_read_dicom(f->ctx, f->folder, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    double M[16];
    apsm_volume_index_to_lps(&v, M);
    assert_true(fabs(M[2]) < 1e-6 && fabs(M[6] - (0.5 - 2.5 * sin_a)) < 1e-6 &&
                fabs(M[10] - 2.5 * cos_a) < 1e-6);
    assert_non_null(strstr(v.notes, "sheared"));
    apsm_volume_free(&v);
}

static void other_encodings_are_read(void **state)
{
    fixture *const f = *state;
    const char *const syntax[] = { "1.2.840.10008.1.2", "1.2.840.10008.1.2.5" };
    for (int way = 0; way < 2; way++) {
        apsm_volume v = { 0 };
        variant o = plain;
        o.syntax = syntax[way];
        implicit = way == 0;
        write_variants(f->folder, &o);
        implicit = false;
        if (apsm_read_dicom(f->ctx, f->folder, &v) != APSM_OK)
            fail_msg("%s", apsm_error_text(f->ctx));
        for (int i = 0; i < COLUMNS * ROWS * SLICES; i++)
            assert_int_equal(v.label[i],
                             value_at(i % COLUMNS, i / COLUMNS % ROWS, i / COLUMNS / ROWS));
        apsm_volume_free(&v);
    }
}

static void compressions_are_refused_by_name(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    variant o = plain;
    o.syntax = "1.2.840.10008.1.2.4.90";
    write_variants(f->folder, &o);
    expect_failure(f->ctx, apsm_read_dicom(f->ctx, f->folder, &v), APSM_ERR_UNSUPPORTED,
                   "JPEG 2000", "gdcmconv");
}

static void cut_slices_end_in_one_line(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    write_variants(f->folder, &plain);
    const char *const path = scratch_path(f->folder, "d9");
    size_t size;
    char *const bytes = scratch_read(path, &size);
    for (size_t left = 200; left < size; left += 37) {
        scratch_write(path, bytes, left);
        expect_failure(f->ctx, apsm_read_dicom(f->ctx, f->folder, &v), APSM_ERR_FORMAT, ":",
                       f->folder);
        assert_null(v.label);
    }
    free(bytes);
}

/* ---- a fractional segmentation ---- */

/* A tag with a length: of a sequence (with its VR), an item, or the end of either. */
static void put_mark(buffer *b, unsigned group, unsigned element, const char *vr, bool end)
{
    const unsigned char length[4] = { 255, 255, 255, 255 };
    put16(b, group);
    put16(b, element);
    put(b, vr, strlen(vr));
    if (*vr) put16(b, 0);
    put(b, end ? (const unsigned char *)"\0\0\0" : length, 4);
}

static void put_frame_position(buffer *b, int k)
{
    char text[32];
    snprintf(text, sizeof text, "-3\\4\\%g", 2.0 * k);
    put_mark(b, 0xfffe, 0xe000, "", false);
    put_mark(b, 0x20, 0x9113, "SQ", false);
    put_mark(b, 0xfffe, 0xe000, "", false);
    put_text(b, 0x20, 0x32, "DS", text);
    put_mark(b, 0xfffe, 0xe00d, "", true);
    put_mark(b, 0xfffe, 0xe0dd, "", true);
    put_mark(b, 0x62, 0x0a, "SQ", false);
    put_mark(b, 0xfffe, 0xe000, "", false);
    put_us(b, 0x62, 0x0b, 1);
    put_mark(b, 0xfffe, 0xe00d, "", true);
    put_mark(b, 0xfffe, 0xe0dd, "", true);
    put_mark(b, 0xfffe, 0xe00d, "", true);
}

static void put_segments(buffer *b, int segments)
{
    put_mark(b, 0x62, 2, "SQ", false);
    for (int k = 0; k < segments; k++) {
        put_mark(b, 0xfffe, 0xe000, "", false);
        put_us(b, 0x62, 4, (unsigned)k + 1);
        put_text(b, 0x62, 5, "LO", "liver");
        put_mark(b, 0xfffe, 0xe00d, "", true);
    }
    put_mark(b, 0xfffe, 0xe0dd, "", true);
}

/* SLICES frames of COLUMNS x ROWS bytes; of frame `without`, nothing. */
static void write_fractions(const char *path, int segments, int without)
{
    buffer file = { .n = 128 };
    put(&file, "DICM", 4);
    put_text(&file, 2, 0x10, "UI", "1.2.840.10008.1.2.1");
    put_text(&file, 0x08, 0x60, "CS", "SEG");
    put_us(&file, 0x28, 2, 1);
    put_text(&file, 0x28, 8, "IS", without < 0 ? "12" : "11");
    put_us(&file, 0x28, 0x10, ROWS);
    put_us(&file, 0x28, 0x11, COLUMNS);
    put_text(&file, 0x28, 0x30, "DS", "1.5\\0.5");
    put_us(&file, 0x28, 0x100, 8);
    put_us(&file, 0x28, 0x101, 8);
    put_us(&file, 0x28, 0x102, 7);
    put_us(&file, 0x28, 0x103, 0);
    put_text(&file, 0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0");
    put_text(&file, 0x62, 1, "CS", "FRACTIONAL");
    put_segments(&file, segments);
    put_us(&file, 0x62, 0x0e, 200);
    put_mark(&file, 0x5200, 0x9230, "SQ", false);
    for (int k = 0; k < SLICES; k++)
        if (k != without) put_frame_position(&file, k);
    put_mark(&file, 0xfffe, 0xe0dd, "", true);
    unsigned char pixels[SLICES * ROWS * COLUMNS];
    size_t n = 0;
    for (int k = 0; k < SLICES; k++)
        for (int i = 0; i < ROWS * COLUMNS && k != without; i++)
            pixels[n++] = (unsigned char)((7 * i + 31 * k) % 201);
    put_element(&file, 0x7fe0, 0x10, "OB", pixels, n);
    scratch_write(path, file.bytes, file.n);
}

static void fractions_are_values(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "seg.dcm");
    for (int without = -1; without < 6; without += 6) { /* all frames; the sixth is left out */
        apsm_volume v;
        double M[16];
        write_fractions(path, 1, without);
        if (apsm_read_dicom(f->ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
        assert_true(v.n[0] == COLUMNS && v.n[1] == ROWS && v.n[2] == SLICES);
        assert_null(v.label);
        assert_non_null(v.value);
        apsm_volume_index_to_lps(&v, M);
        assert_true(fabs(M[0] - 0.5) + fabs(M[5] - 1.5) + fabs(M[10] - 2.0) < 1e-9);
        assert_true(fabs(M[3] + 3.0) + fabs(M[7] - 4.0) + fabs(M[11]) < 1e-9);
        for (int k = 0; k < SLICES; k++)
            for (int i = 0; i < ROWS * COLUMNS; i++) {
                const double wanted = k == without ? 0.0 : (7 * i + 31 * k) % 201 / 200.0;
                assert_true(fabs((double)v.value[k * ROWS * COLUMNS + i] - wanted) < 1e-6);
            }
        apsm_volume_free(&v);
    }
    apsm_volume v;
    write_fractions(path, 2, -1);
    assert_int_equal(apsm_read_dicom(f->ctx, path, &v), APSM_ERR_UNSUPPORTED);
    assert_non_null(strstr(apsm_error_text(f->ctx), "one by one"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(an_oblique_series_is_read, setup, teardown),
        cmocka_unit_test_setup_teardown(bad_series_are_refused, setup, teardown),
        cmocka_unit_test_setup_teardown(orientations_are_directions, setup, teardown),
        cmocka_unit_test_setup_teardown(coarse_orientations_are_straightened, setup, teardown),
        cmocka_unit_test_setup_teardown(coarse_planes_lie_across_the_step, setup, teardown),
        cmocka_unit_test_setup_teardown(positions_need_not_be_exact, setup, teardown),
        cmocka_unit_test_setup_teardown(a_tilted_gantry_is_a_shear, setup, teardown),
        cmocka_unit_test_setup_teardown(other_encodings_are_read, setup, teardown),
        cmocka_unit_test_setup_teardown(compressions_are_refused_by_name, setup, teardown),
        cmocka_unit_test_setup_teardown(fractions_are_values, setup, teardown),
        cmocka_unit_test_setup_teardown(cut_slices_end_in_one_line, setup, teardown),
    };
    return cmocka_run_group_tests_name("dicom", tests, NULL, NULL);
}
