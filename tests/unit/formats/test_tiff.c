/* TIFF stacks, written here byte by byte. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <zlib.h>

#include "apsm/formats.h"
#include "scratch_fixture.h"

enum { NX = 5, NY = 4, NZ = 3, ROOM = 8192 };

typedef struct variant {
    bool big;
    int bits, compression, rows; /* rows: of a strip */
    bool real, in_a_row;
    const char *text; /* the description */
    int samples, pages;
    bool circle;
} variant;

static const char *const fiji =
    "ImageJ=1.53t\nimages=3\nslices=3\nunit=mm\nspacing=2.5\nloop=false\n";
static const variant usual = { .bits = 8, .compression = 1, .rows = NY, .samples = 1, .pages = NZ };

typedef struct buffer {
    unsigned char b[ROOM];
    size_t n;
    bool big;
} buffer;

static void put(buffer *o, uint64_t value, size_t size)
{
    assert_true(o->n + size <= ROOM);
    for (size_t k = 0; k < size; k++)
        o->b[o->n++] = (unsigned char)(value >> 8 * (o->big ? size - 1 - k : k));
}

static void put_at(buffer *o, size_t at, uint64_t value, size_t size)
{
    const size_t n = o->n;
    o->n = at;
    put(o, value, size);
    o->n = n;
}

static int value_of(int x, int y, int z)
{
    return (x * 7 + y * 5 + z * 11) % 6;
}

static void put_value(buffer *o, const variant *v, int value)
{
    const float real = (float)value;
    uint32_t bits = (uint32_t)value;
    if (v->real) memcpy(&bits, &real, 4);
    put(o, bits, (size_t)v->bits / 8);
}

/* Rows [from, to) of a slice, packed as the variant has it. */
static void put_rows(buffer *o, const variant *v, int z, int from, int to)
{
    buffer plain = { .big = v->big };
    for (int y = from; y < to; y++)
        for (int x = 0; x < NX; x++)
            for (int c = 0; c < v->samples; c++) put_value(&plain, v, value_of(x, y, z));
    if (v->compression == 32773) { /* one literal, one repeated byte, and so on */
        for (size_t k = 0; k < plain.n; k += 2) {
            if (k + 1 < plain.n && plain.b[k] == plain.b[k + 1])
                put(o, 255, 1), put(o, plain.b[k], 1);
            else if (k + 1 < plain.n)
                put(o, 1, 1), put(o, plain.b[k], 1), put(o, plain.b[k + 1], 1);
            else
                put(o, 0, 1), put(o, plain.b[k], 1);
        }
    } else if (v->compression == 8) {
        uLongf size = ROOM - o->n;
        assert_int_equal(compress(o->b + o->n, &size, plain.b, plain.n), Z_OK);
        o->n += size;
    } else {
        memcpy(o->b + o->n, plain.b, plain.n);
        o->n += plain.n;
    }
}

static void put_entry(buffer *o, int tag, int type, uint64_t count, uint64_t value)
{
    put(o, (uint64_t)tag, 2);
    put(o, (uint64_t)type, 2);
    put(o, count, 4);
    if (type == 3 && count == 1) {
        put(o, value, 2);
        put(o, 0, 2);
    } else {
        put(o, value, 4);
    }
}

/* What stands outside of a page's entries. */
typedef struct outside {
    size_t strips, offsets, sizes, resolution, text;
} outside;

static outside put_outside(buffer *o, const variant *v, int z)
{
    outside at = { .strips = (size_t)((NY + v->rows - 1) / v->rows) };
    size_t offset[NY], size[NY];
    for (size_t k = 0; k < at.strips; k++) {
        const int to = (int)(k + 1) * v->rows;
        offset[k] = o->n;
        put_rows(o, v, z, (int)k * v->rows, to < NY ? to : NY);
        size[k] = o->n - offset[k];
    }
    if (v->in_a_row)
        for (int other = 1; other < NZ; other++) put_rows(o, v, other, 0, NY);
    at.offsets = o->n;
    for (size_t k = 0; k < at.strips; k++) put(o, offset[k], 4);
    at.sizes = o->n;
    for (size_t k = 0; k < at.strips; k++) put(o, size[k], 4);
    if (at.strips == 1) at.offsets = offset[0], at.sizes = size[0];
    at.resolution = o->n; /* columns: 4 a unit; rows: 5 / 4 */
    put(o, 4, 4), put(o, 1, 4), put(o, 5, 4), put(o, 4, 4);
    at.text = o->n;
    memcpy(o->b + o->n, v->text, strlen(v->text) + 1);
    o->n += strlen(v->text) + 1;
    return at;
}

static void write_tiff(const char *path, const variant *v)
{
    buffer o = { .big = v->big };
    put(&o, v->big ? 0x4d4d : 0x4949, 2);
    put(&o, 42, 2);
    size_t link = o.n, first = 0;
    put(&o, 0, 4);
    for (int z = 0; z < (v->in_a_row ? 1 : v->pages); z++) {
        const outside at = put_outside(&o, v, z);
        put_at(&o, link, o.n, 4);
        if (z == 0) first = o.n;
        put(&o, 12, 2);
        put_entry(&o, 256, 3, 1, NX);
        put_entry(&o, 257, 4, 1, NY);
        put_entry(&o, 258, 3, 1, (uint64_t)v->bits);
        put_entry(&o, 259, 3, 1, (uint64_t)v->compression);
        put_entry(&o, 270, 2, strlen(v->text) + 1, at.text);
        put_entry(&o, 273, 4, at.strips, at.offsets);
        put_entry(&o, 277, 3, 1, (uint64_t)v->samples);
        put_entry(&o, 278, 3, 1, (uint64_t)v->rows);
        put_entry(&o, 279, 4, at.strips, at.sizes);
        put_entry(&o, 282, 5, 1, at.resolution);
        put_entry(&o, 283, 5, 1, at.resolution + 8);
        put_entry(&o, 339, 3, 1, v->real ? 3 : 1);
        link = o.n;
        put(&o, 0, 4);
    }
    if (v->circle) put_at(&o, link, first, 4);
    scratch_write(path, o.b, o.n);
}

static void expect_stack(fixture *f, const variant *v, double unit)
{
    const char *const path = scratch_path(f->folder, "stack.tif");
    const double step[3] = { 0.25 * unit, 0.8 * unit, 2.5 * unit };
    apsm_volume got;
    double M[16];
    write_tiff(path, v);
    if (apsm_read_volume(f->ctx, path, &got) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    assert_true(got.n[0] == NX && got.n[1] == NY && got.n[2] == NZ);
    apsm_volume_index_to_lps(&got, M);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 4; c++)
            assert_true(fabs(M[4 * r + c] - (r == c ? step[r] : 0.0)) < 1e-9 * step[2]);
    for (int z = 0, i = 0; z < NZ; z++)
        for (int y = 0; y < NY; y++)
            for (int x = 0; x < NX; x++, i++) assert_int_equal(got.label[i], value_of(x, y, z));
    assert_non_null(strstr(got.notes, "left and right"));
    apsm_volume_free(&got);
}

static void every_kind_of_stack_is_read(void **state)
{
    static const int compressions[] = { 1, 8, 32773 }, bits[] = { 8, 16, 32 };
    for (int big = 0; big < 2; big++)
        for (int c = 0; c < 3; c++)
            for (int b = 0; b < 4; b++)
                for (int rows = 1; rows <= NY; rows++) {
                    variant v = usual;
                    v.text = fiji;
                    v.big = big;
                    v.compression = compressions[c];
                    v.bits = bits[b < 3 ? b : 2];
                    v.real = b == 3;
                    v.rows = rows;
                    expect_stack(*state, &v, 1.0);
                }
    variant row = usual;
    row.text = fiji;
    row.in_a_row = true;
    expect_stack(*state, &row, 1.0);
}

static void units_are_turned_into_mm(void **state)
{
    static const struct {
        const char *text;
        double mm;
    } known[] = { { "ImageJ=1.5\nimages=3\nunit=micron\nspacing=2.5\n", 1e-3 },
                  { "ImageJ=1.5\r\nimages=3\r\nunit=\\u00B5m\r\nspacing=2.5\r\n", 1e-3 },
                  { "ImageJ=1.5\nspacing=-2.5\nunit=cm\n", 10 } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        variant v = usual;
        v.text = known[k].text;
        expect_stack(*state, &v, known[k].mm);
    }
}

/* ImageJ leaves a spacing of 1 out, and stores signed voxels 32768 higher. */
static void what_imagej_leaves_out_is_known(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "stack.tif");
    apsm_volume got;
    double M[16];
    variant v = usual;
    v.bits = 16;
    v.text = "ImageJ=1.5\nimages=3\nunit=mm\ncf=0\nc0=3.0\nc1=2.0\n";
    write_tiff(path, &v);
    assert_int_equal(apsm_read_volume(f->ctx, path, &got), APSM_OK);
    apsm_volume_index_to_lps(&got, M);
    assert_true(fabs(M[10] - 1.0) < 1e-12);
    for (int z = 0, i = 0; z < NZ; z++)
        for (int y = 0; y < NY; y++)
            for (int x = 0; x < NX; x++, i++)
                assert_int_equal(got.label[i], 3 + 2 * value_of(x, y, z));
    apsm_volume_free(&got);
}

static void expect_refused(fixture *f, const variant *v, const char *word)
{
    const char *const path = scratch_path(f->folder, "bad.tif");
    apsm_volume got;
    write_tiff(path, v);
    assert_int_not_equal(apsm_read_volume(f->ctx, path, &got), APSM_OK);
    if (!strstr(apsm_error_text(f->ctx), word)) fail_msg("%s: %s", word, apsm_error_text(f->ctx));
}

static void what_is_not_told_is_not_guessed(void **state)
{
    static const char *const texts[] = { "",
                                         "by hand",
                                         "ImageJ=1.5\nimages=3\nunit=mm\nspacing=0\n",
                                         "ImageJ=1.5\nimages=3\nspacing=2\n",
                                         "ImageJ=1.5\nunit=pixel\nspacing=2\n",
                                         "ImageJ=1.5\nunit=mm\nspacing=2\nzunit=micron\n" };
    for (size_t k = 0; k < sizeof texts / sizeof *texts; k++) {
        variant v = usual;
        v.text = texts[k];
        expect_refused(*state, &v, "how large its voxels are");
    }
}

static void others_are_refused_by_name(void **state)
{
    variant v = usual;
    v.text = fiji;
    variant colours = v, packed = v, flat = v, frames = v, circle = v, bits = v;
    colours.samples = 3;
    packed.compression = 5;
    flat.pages = 1;
    flat.text = "";
    frames.text = "ImageJ=1.5\nimages=3\nchannels=3\nunit=mm\nspacing=2\n";
    circle.circle = true;
    bits.bits = 1;
    expect_refused(*state, &bits, "1 bits");
    expect_refused(*state, &colours, "colours");
    expect_refused(*state, &packed, "LZW");
    expect_refused(*state, &flat, "flat picture");
    expect_refused(*state, &frames, "channels");
    expect_refused(*state, &circle, "ends before"); /* all pages hold no more than the file */
}

/* However much is missing, or whichever byte is wrong: a volume, or one line. */
static void damage_is_survived(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "cut.tif");
    for (int c = 0; c < 3; c++) {
        static const int compressions[] = { 1, 8, 32773 };
        variant v = usual;
        size_t size;
        v.text = fiji;
        v.rows = 2;
        v.compression = compressions[c];
        write_tiff(path, &v);
        char *const bytes = scratch_read(path, &size);
        for (size_t k = 0; k < 2 * size; k += 3) {
            const char kept = bytes[k % size];
            apsm_volume got;
            if (k >= size) bytes[k % size] = (char)(kept ^ 0xff);
            scratch_write(path, bytes, k < size ? k : size);
            const apsm_status status = apsm_read_volume(f->ctx, path, &got);
            assert_true(status == APSM_OK || apsm_error_text(f->ctx)[0]);
            apsm_volume_free(&got);
            bytes[k % size] = kept;
        }
        free(bytes);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(every_kind_of_stack_is_read, setup, teardown),
        cmocka_unit_test_setup_teardown(what_imagej_leaves_out_is_known, setup, teardown),
        cmocka_unit_test_setup_teardown(units_are_turned_into_mm, setup, teardown),
        cmocka_unit_test_setup_teardown(what_is_not_told_is_not_guessed, setup, teardown),
        cmocka_unit_test_setup_teardown(others_are_refused_by_name, setup, teardown),
        cmocka_unit_test_setup_teardown(damage_is_survived, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
