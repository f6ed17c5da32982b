/* What programs of brain imaging and of geometry write: GIFTI, FreeSurfer's surfaces and images,
 * Analyze, OFF, and images over several files.  All bytes are put together here; base64 was made by
 * Python's struct, zlib and base64. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <zlib.h>

#include "apsm/formats.h"
#include "scratch_fixture.h"

/* A tetrahedron, in the numbers of the files. */
enum { NV = 4, NF = 4 };
static const double points[NV][3] = { { 0, 0, 0 }, { 4, 0, 0 }, { 0, 2.5, 0 }, { 1, 1, -8 } };
static const uint32_t corners[NF][3] = { { 0, 2, 1 }, { 0, 1, 3 }, { 1, 2, 3 }, { 2, 0, 3 } };

static void put(unsigned char **at, const void *value, size_t size, bool big)
{
    for (size_t b = 0; b < size; b++)
        (*at)[big ? size - 1 - b : b] = ((const unsigned char *)value)[b];
    *at += size;
}

static void put_int(unsigned char **at, int32_t x, size_t size)
{
    const int16_t narrow = (int16_t)x;
    put(at, size == 2 ? (const void *)&narrow : &x, size, true);
}

static void put_float(unsigned char **at, double x)
{
    const float f = (float)x;
    put(at, &f, sizeof f, true);
}

static void put_text(unsigned char **at, const char *text)
{
    memcpy(*at, text, strlen(text));
    *at += strlen(text);
}

/* The points with x and y (times `sign`) moved by `shift` before. */
static void expect_tetrahedron(fixture *f, const char *path, double sign, const double shift[3])
{
    apsm_mesh m = { 0 };
    if (apsm_read_mesh(f->ctx, path, &m) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    assert_int_equal(m.nv, NV);
    assert_int_equal(m.nf, NF);
    for (int v = 0; v < NV; v++)
        for (int c = 0; c < 3; c++) {
            const double wanted = (c < 2 ? sign : 1) * (points[v][c] + shift[c]);
            if (fabs(m.V[3 * v + c] - wanted) > 1e-12)
                fail_msg("%s: point %d: %g, not %g", path, v, m.V[3 * v + c], wanted);
        }
    assert_memory_equal(m.F, corners, sizeof corners);
    apsm_mesh_free(&m);
}

static void refuses(fixture *f, const char *name, const void *bytes, size_t size, const char *word)
{
    const char *const path = scratch_path(f->folder, name);
    apsm_mesh m = { 0 };
    scratch_write(path, bytes, size);
    if (apsm_read_mesh(f->ctx, path, &m) == APSM_OK) fail_msg("%s: accepted, want %s", name, word);
    if (!strstr(apsm_error_text(f->ctx), word))
        fail_msg("'%s' is not in '%s'", word, apsm_error_text(f->ctx));
    assert_null(m.V);
}

static void refuses_text(fixture *f, const char *name, const char *text, const char *word)
{
    refuses(f, name, text, strlen(text), word);
}

/* ---- GIFTI ---- */

static const char head[] =
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!DOCTYPE GIFTI SYSTEM \"gifti.dtd\">\n"
    "<GIFTI Version=\"1.0\" NumberOfDataArrays=\"2\"><MetaData/><LabelTable/>\n";
static const char array[] =
    "<DataArray Intent=\"NIFTI_INTENT_%s\" DataType=\"NIFTI_TYPE_%s\" "
    "ArrayIndexingOrder=\"%sMajorOrder\" Dimensionality=\"2\" Dim0=\"%s\" Dim1=\"3\" "
    "Encoding=\"%s\" Endian=\"%sEndian\"><MetaData><MD><Name>a</Name><Value>1</Value></MD>"
    "</MetaData><CoordinateSystemTransformMatrix><DataSpace>x</DataSpace>"
    "<MatrixData>2 0 0 9 0 2 0 9 0 0 2 9 0 0 0 1</MatrixData>"
    "</CoordinateSystemTransformMatrix><Data>%s</Data></DataArray>\n";

typedef struct gifti {
    const char *point_type, *corner_type, *order, *encoding, *endian, *points, *corners;
} gifti;

/* way: 0 points first, 1 triangles first, 2 points alone, 3 triangles alone, 4 all twice */
static const char *gifti_text(const gifti *g, int way, char out[8192])
{
    char p[2048], t[2048];
    snprintf(p, sizeof p, array, "POINTSET", g->point_type, g->order, "4", g->encoding, g->endian,
             g->points);
    snprintf(t, sizeof t, array, "TRIANGLE", g->corner_type, g->order, "4", g->encoding, g->endian,
             g->corners);
    const char *const first = way == 1 || way == 3 ? t : p, *const second = way == 1 ? p : t;
    snprintf(out, 8192, "%s%s%s%s</GIFTI>\n", head, first, way == 2 || way == 3 ? "" : second,
             way == 4 ? p : "");
    return out;
}

static const gifti written[] = {
    { "FLOAT32", "INT32", "Row", "Base64Binary", "Little",
      "AAAAAAAAAAAAAAAAAACAQAAAAAAAAAAAAAAAAAAAIEAAAAAAAACAPwAAgD8AAADB",
      "AAAAAAIAAAABAAAAAAAAAAEAAAADAAAAAQAAAAIAAAADAAAAAgAAAAAAAAADAAAA" },
    { "FLOAT32", "INT32", "Row", "Base64Binary", "Big",
      "AAAAAAAAAAAAAAAAQIAAAAAAAAAAAAAA\nAAAAAEAgAAAAAAAAP4AAAD+AAADBAAAA",
      "AAAAAAAAAAIAAAABAAAAAAAAAAEAAAADAAAAAQAAAAIAAAADAAAAAgAAAAAAAAAD" },
    { "FLOAT32", "INT32", "Row", "GZipBase64Binary", "Little",
      "eJxjYEAGDQ4oXAYFKL/BHoIZDgIALCMDYA==", "eJxjYGBgYAJiRgYIANHMUJoJymaCyoHYAAG4ABM=" },
    { "FLOAT32", "INT32", "Row", "GZipBase64Binary", "Big",
      "eJxjYEAAhwYGFOCgAKHtGyD4IJANADMAA2A=", "eJxjYAADJiBmhDDBNDOUZoKymaByzAABggAT" },
    { "FLOAT64", "INT32", "Row", "ASCII", "Little", "0 0 0  4 0 0\n0 2.5 0  1 1 -8e0",
      "0 2 1\n0 1 3\n1 2 3\n2 0 3\n" },
    { "FLOAT64", "UINT8", "Column", "ASCII", "Little", "0 4 0 1  0 0 2.5 1  0 0 0 -8",
      "0 0 1 2  2 1 2 0  1 3 3 3" },
};

static void gifti_is_read_however_it_is_written(void **state)
{
    static const double still[3] = { 0, 0, 0 };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "a.surf.gii");
    char text[8192];
    for (size_t k = 0; k < sizeof written / sizeof *written; k++)
        for (int way = 0; way < 2; way++) {
            gifti_text(&written[k], way, text);
            scratch_write(path, text, strlen(text));
            expect_tetrahedron(f, path, -1, still);
        }
}

/* Doubles by columns, and corners by columns with the highest byte first. */
static void gifti_by_columns_in_base64(void **state)
{
    static const double still[3] = { 0, 0, 0 };
    static const char columns[] = "AAAAAAAAAAAAAAAAAAAQQAAAAAAAAAAAAAAAAAAA8D8AAAAAAAAAAAAAAAAAAAAA"
                                  "AAAAAAAABEAAAAAAAADwPwAAAAAA"
                                  "AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAACDA";
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "c.gii");
    char p[2048], t[2048], text[8192];
    snprintf(p, sizeof p, array, "POINTSET", "FLOAT64", "Column", "4", "Base64Binary", "Little",
             columns);
    snprintf(t, sizeof t, array, "TRIANGLE", "INT32", "Column", "4", "Base64Binary", "Big",
             "AAAAAAAAAAAAAAABAAAAAgAAAAIAAAABAAAAAgAAAAAAAAABAAAAAwAAAAMAAAAD");
    snprintf(text, sizeof text, "%s%s%s</GIFTI>", head, p, t);
    scratch_write(path, text, strlen(text));
    expect_tetrahedron(f, path, -1, still);
}

static void other_gifti_is_refused(void **state)
{
    fixture *const f = *state;
    char text[8192];
    gifti g = written[0];
    refuses_text(f, "labels.gii", gifti_text(&g, 3, text), "give the surface (.surf.gii)");
    refuses_text(f, "cloud.gii", gifti_text(&g, 2, text), "a point cloud?");
    refuses_text(f, "two.gii", gifti_text(&g, 4, text), "several surfaces");
    g.encoding = "ExternalFileBinary";
    refuses_text(f, "external.gii", gifti_text(&g, 0, text), "gifti-convert");
    g = written[4];
    g.points = "0 0 0 4 0 0 0 2.5 0 1 1";
    refuses_text(f, "short.gii", gifti_text(&g, 0, text), "cut short");
    g = written[0];
    g.corners = "AAAAAAIAAAABAAAA";
    refuses_text(f, "short64.gii", gifti_text(&g, 0, text), "fewer values");
    g.corners = "";
    refuses_text(f, "empty.gii", gifti_text(&g, 0, text), "fewer values");
    g = written[2];
    g.points = "eJxjYEAGDQ4oXAYFKL/BHoIZ";
    refuses_text(f, "packed.gii", gifti_text(&g, 0, text), "fewer values");
    g = written[4];
    g.corners = "0 2 1 0 1 3 1 2 3 2 0 4";
    refuses_text(f, "beyond.gii", gifti_text(&g, 0, text), "refers to point 4");
    refuses_text(f, "torn.gii", "<GIFTI><DataArray", "line 1: its XML");
    refuses_text(f, "html.gii", "<x/>", "is not a GIFTI file");
    refuses_text(f, "bomb.gii", "<!DOCTYPE GIFTI [<!ENTITY a \"b\">]><GIFTI>&a;</GIFTI>",
                 "document type of its own");
}

/* ---- FreeSurfer's surfaces ---- */

static const char volume_info[] =
    "valid = %d  # volume info valid\nfilename = ../mri/filled.mgz\nvolume = 256 256 256\n"
    "voxelsize = 1.0000000000e+00 1 1\nxras   = -1 0 0\nyras   = 0 0 -1\nzras   = 0 1 0\n"
    "cras   = 5.5 -18 2.7e1\n";

/* tag: 0 no volume, 1 the tag alone, 3 after two numbers, 4 after two that say "in the scanner". */
static size_t freesurfer_bytes(unsigned char *out, int tag, int valid)
{
    unsigned char *at = out;
    char info[512];
    put_text(&at, "\xff\xff\xfe"
                  "created by someone on a day\n\n");
    put_int(&at, NV, 4);
    put_int(&at, NF, 4);
    for (int v = 0; v < NV; v++)
        for (int c = 0; c < 3; c++) put_float(&at, points[v][c]);
    for (int t = 0; t < NF; t++)
        for (int k = 0; k < 3; k++) put_int(&at, (int32_t)corners[t][k], 4);
    if (tag >= 3) put_int(&at, 2, 4), put_int(&at, tag == 4, 4);
    if (tag) put_int(&at, 20, 4);
    snprintf(info, sizeof info, volume_info, valid);
    if (tag) put_text(&at, info);
    return (size_t)(at - out);
}

static void freesurfer_surfaces_come_out_in_the_scanner(void **state)
{
    static const double still[3] = { 0, 0, 0 }, centre[3] = { 5.5, -18, 27 };
    fixture *const f = *state;
    const char *const names[] = { "lh.white", "rh.pial", "lh.pial.T1" };
    const int tags[] = { 0, 1, 3 };
    unsigned char bytes[1024];
    for (int k = 0; k < 3; k++) {
        const char *const path = scratch_path(f->folder, names[k]);
        scratch_write(path, bytes, freesurfer_bytes(bytes, tags[k], 1));
        expect_tetrahedron(f, path, -1, k == 0 ? still : centre);
    }
    const char *const path = scratch_path(f->folder, "x.surf");
    scratch_write(path, bytes, freesurfer_bytes(bytes, 3, 0));
    expect_tetrahedron(f, path, -1, still);
    scratch_write(path, bytes, freesurfer_bytes(bytes, 4, 1));
    expect_tetrahedron(f, path, -1, still);
}

static void other_freesurfer_files_are_refused(void **state)
{
    fixture *const f = *state;
    unsigned char bytes[1024];
    size_t size = freesurfer_bytes(bytes, 0, 0);
    refuses(f, "lh.white", bytes, size - 1, "cut short");
    bytes[2] = 0xff;
    refuses(f, "lh.white", bytes, size, "map of values");
    bytes[0] = 'x';
    refuses(f, "lh.white", bytes, size, "no surface of FreeSurfer");
    size = freesurfer_bytes(bytes, 0, 0);
    bytes[3 + 29] = 0x7f; /* the highest byte of the number of points */
    refuses(f, "lh.white", bytes, size, "more than the file can hold");
    refuses_text(f, "x.surf", "# HyperSurface 0.1 BINARY\n", "Amira");
}

/* ---- OFF ---- */

static void off_is_read_with_all_that_may_stand_in_it(void **state)
{
    static const double still[3] = { 0, 0, 0 };
    static const char faces[] = "3 0 2 1\n3 0 1 3 # c\n3 1 2 3 255 0 0\n3 2 0 3\n";
    static const char *const texts[] = {
        "OFF\n4 4 6\n0 0 0\n4 0 0\n0 2.5 0\n1 1 -8\n%s",
        "# made by hand\noff 4 4 0\n\n0 0 0\n# c\n4 0 0\n0 2.5 0\n1 1 -8\n\n%s",
        "COFF\r\n4 4 0\r\n0 0 0 255 0 0 255\r\n4 0 0 1 1 1 1\r\n0 2.5 0 9 9 9 9\r\n1 1 -8 1 2 3 "
        "4\r\n%s",
        "STNOFF\n4 4 0\n0 0 0 0 0 1 .5 .5\n4 0 0 0 0 1\n0 2.5 0\n1 1 -8\n%s",
        "4 4 0\n0 0 0\n4 0 0\n0 2.5 0\n1 1 -8\n%s"
    };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "t.off");
    char text[512];
    for (size_t k = 0; k < sizeof texts / sizeof *texts; k++) {
        snprintf(text, sizeof text, texts[k], faces);
        scratch_write(path, text, strlen(text));
        expect_tetrahedron(f, path, 1, still);
    }
    const char *const quad = "OFF 4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    apsm_mesh m;
    scratch_write(path, quad, strlen(quad));
    assert_int_equal(apsm_read_mesh(f->ctx, path, &m), APSM_OK);
    assert_int_equal(m.nf, 2);
    apsm_mesh_free(&m);
}

static void other_off_is_refused(void **state)
{
    fixture *const f = *state;
    refuses_text(f, "b.off", "OFF BINARY\n1 2 3", "binary OFF");
    refuses_text(f, "n.off", "nOFF 4\n1 1 0\n", "not 3-D");
    refuses_text(f, "4.off", "4OFF\n1 1 0\n0 0 0 1\n", "not 3-D");
    refuses_text(f, "x.off", "solid a\n", "is not an OFF file");
    refuses_text(f, "p.off", "OFF\n1 0 0\n1 2 3\n", "a point cloud?");
    refuses_text(f, "l.off", "OFF\n2 1 0\n1 2 3\n1 2 4\n2 0 1\n", "contours?");
    refuses_text(f, "m.off", "OFF\n900000000 1 0\n1 2 3\n", "more than the file can hold");
    refuses_text(f, "i.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "line 6: a face refers");
    refuses_text(f, "c.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1", "line 5: expected a coordinate");
}

/* ---- images ---- */

enum { NX = 4, NY = 3, NZ = 2, VOXELS = NX * NY * NZ };

static int value_of(size_t i)
{
    return (int)(i * 5 % 7);
}

static void expect_image(fixture *f, const char *path, const double M[12], const char *note)
{
    apsm_volume v;
    double got[16];
    if (apsm_read_volume(f->ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    assert_true(v.n[0] == NX && v.n[1] == NY && v.n[2] == NZ);
    apsm_volume_index_to_lps(&v, got);
    for (int k = 0; k < 12; k++)
        if (!(fabs(got[k] - M[k]) <= 2e-6 * (1.0 + fabs(M[k]))))
            fail_msg("%s: M[%d] = %.9g, not %.9g", path, k, got[k], M[k]);
    for (size_t i = 0; i < VOXELS; i++) assert_int_equal(v.label[i], value_of(i));
    if (note ? !v.notes || !strstr(v.notes, note) : v.notes != NULL)
        fail_msg("%s: note '%s', not '%s'", path, v.notes ? v.notes : "", note ? note : "");
    apsm_volume_free(&v);
}

static void refuses_image(fixture *f, const char *path, const char *word)
{
    apsm_volume v;
    if (apsm_read_volume(f->ctx, path, &v) == APSM_OK)
        fail_msg("%s: accepted, not '%s'", path, word);
    if (!strstr(apsm_error_text(f->ctx), word))
        fail_msg("'%s' is not in '%s'", word, apsm_error_text(f->ctx));
}

static void put_mgh_value(unsigned char **at, int type, int value)
{
    static const size_t size[] = { 1, 4, 0, 0, 2, 0, 0, 0, 0, 0, 2 };
    if (type == 3)
        put_float(at, value);
    else if (type == 0)
        *(*at)++ = (unsigned char)value;
    else
        put_int(at, value, size[type]);
}

/* Voxels of .5 x .75 x 2, axes to the left, down and to the front (coronal), tilted. */
static size_t mgh_bytes(unsigned char *out, int type, int placed, int frames)
{
    static const double numbers[15] = { .5, .75, 2, -1, 0, 0, 0, .6, -.8, 0, .8, .6, 5, -18, 27 };
    unsigned char *at = out;
    memset(out, 0, 284);
    const int first[] = { 1, NX, NY, NZ, frames, type, 0 };
    for (int k = 0; k < 7; k++) put_int(&at, first[k], 4);
    put_int(&at, placed, 2);
    for (int k = 0; k < 15; k++) put_float(&at, numbers[k]);
    at = out + 284;
    for (size_t i = 0; i < VOXELS; i++) put_mgh_value(&at, type, value_of(i));
    put_text(&at, "tail of scan parameters and tags");
    return (size_t)(at - out);
}

/* In RAS a step along the axes is .5 (-1, 0, 0), .75 (0, .6, -.8), 2 (0, .8, .6); the centre
 * (5, -18, 27) is 2, 1.5 and 1 steps from the first voxel.  LPS turns x and y over. */
static void freesurfer_images_are_read(void **state)
{
    static const double M[12] = { .5, 0,    0,    -5 - .5 * 2,
                                  0,  -.45, -1.6, 18 - (-.45 * 1.5 - 1.6 * 1),
                                  0,  -.6,  1.2,  27 - (-.6 * 1.5 + 1.2 * 1) };
    static const double coronal[12] = { 1, 0, 0, -2, 0, 0, -1, 1, 0, -1, 0, 1.5 };
    static const int types[] = { 0, 1, 3, 4, 10 };
    fixture *const f = *state;
    unsigned char bytes[1024];
    for (int k = 0; k < 5; k++) {
        const char *const path = scratch_path(f->folder, "a.mgh");
        scratch_write(path, bytes, mgh_bytes(bytes, types[k], 1, 1));
        expect_image(f, path, M, NULL);
    }
    const char *const path = scratch_path(f->folder, "a.mgz");
    const size_t size = mgh_bytes(bytes, 1, 0, 1);
    gzFile const packed = gzopen(path, "wb");
    assert_int_equal(gzwrite(packed, bytes, (unsigned)size), size);
    gzclose(packed);
    expect_image(f, path, coronal, "coronal");
}

static void other_mgh_is_refused(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "b.mgh");
    unsigned char bytes[1024];
    scratch_write(path, bytes, mgh_bytes(bytes, 1, 1, 2));
    refuses_image(f, path, "has 2 frames");
    scratch_write(path, bytes, mgh_bytes(bytes, 1, 1, 1) - 60);
    refuses_image(f, path, "more voxels than the file holds");
    (void)mgh_bytes(bytes, 2, 1, 1);
    scratch_write(path, bytes, 500);
    refuses_image(f, path, "of type 2");
    bytes[3] = 9;
    scratch_write(path, bytes, 500);
    refuses_image(f, path, "no image of FreeSurfer");
    scratch_write(path, bytes, 80);
    refuses_image(f, path, "no image of FreeSurfer");
}

/* Analyze 7.5: NIfTI-1's sizes, types and voxel sizes in the same places, and no word of space. */
static void write_analyze(fixture *f, int orient, bool big)
{
    unsigned char h[348] = { 0 }, *at = h, voxels[2 * VOXELS];
    const int32_t size = 348;
    const int16_t dim[4] = { 3, NX, NY, NZ }, type[2] = { 4, 16 };
    const float pixdim[4] = { 0, .5f, .75f, 2 };
    put(&at, &size, 4, big);
    h[38] = 'r';
    at = h + 40;
    for (int k = 0; k < 4; k++) put(&at, &dim[k], 2, big);
    at = h + 70;
    for (int k = 0; k < 2; k++) put(&at, &type[k], 2, big);
    at = h + 76;
    for (int k = 0; k < 4; k++) put(&at, &pixdim[k], 4, big);
    h[123] = 'm'; /* of "mm"; NIfTI has a code there */
    h[252] = (unsigned char)orient;
    h[254] = h[255] = 7; /* where NIfTI has its codes, SPM has an origin */
    at = voxels;
    for (size_t i = 0; i < VOXELS; i++) {
        const int16_t value = (int16_t)value_of(i);
        put(&at, &value, 2, big);
    }
    scratch_write(scratch_path(f->folder, "a.hdr"), h, sizeof h);
    scratch_write(scratch_path(f->folder, "a.img"), voxels, sizeof voxels);
}

static void analyze_is_read_with_a_word_on_the_hand(void **state)
{
    static const double M[12] = { .5, 0, 0, 0, 0, -.75, 0, 0, 0, 0, 2, 0 };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "a.hdr");
    for (int big = 0; big < 2; big++) {
        write_analyze(f, 0, big);
        expect_image(f, path, M, "check left and right");
    }
    write_analyze(f, 2, false);
    refuses_image(f, path, "not transverse");
}

/* ---- several files ---- */

/* Shorts with the highest byte first, a slice a file, each with `skip` bytes before. */
static void write_slices(fixture *f, size_t skip)
{
    for (int k = 0; k < NZ; k++) {
        unsigned char bytes[2 * NX * NY + 16] = { 0 }, *at = bytes + skip;
        char name[32];
        for (size_t i = 0; i < NX * NY; i++) put_int(&at, value_of((size_t)k * NX * NY + i), 2);
        snprintf(name, sizeof name, "slice%03d.raw", 9 + k);
        scratch_write(scratch_path(f->folder, name), bytes, (size_t)(at - bytes));
    }
}

static void slices_in_several_files_are_joined(void **state)
{
    static const double M[12] = { .5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0 };
    static const char meta[] = "NDims = 3\nDimSize = 4 3 2\nElementSpacing = .5 1 2\nElementType = "
                               "MET_SHORT\nElementByteOrderMSB = True\n%sElementDataFile = %s";
    static const char nrrd[] = "NRRD0005\ntype: short\ndimension: 3\nsizes: 4 3 2\nspacings: .5 1 "
                               "2\nendian: big\nencoding: raw\n%sdata file: %s";
    static const char *const files[] = { "LIST\nslice009.raw\nslice010.raw\n",
                                         "LIST 2\nslice009.raw\r\n\nslice010.raw",
                                         "slice%03d.raw 9 10 1\n", "slice%03d.raw 9 11 2\n" };
    static const size_t skips[] = { 0, 0, 0, 0, 5, 5 };
    fixture *const f = *state;
    for (int k = 0; k < 6; k++)
        for (int is_nrrd = 0; is_nrrd < 2; is_nrrd++) {
            const char *const path = scratch_path(f->folder, is_nrrd ? "s.nhdr" : "s.mhd");
            char text[512], skip[64];
            snprintf(skip, sizeof skip, is_nrrd ? "byte skip: %d\n" : "HeaderSize = %d\n",
                     k == 5 ? -1 : (int)skips[k]);
            snprintf(text, sizeof text, is_nrrd ? nrrd : meta, skip, files[k < 4 ? k : 0]);
            scratch_write(path, text, strlen(text));
            write_slices(f, skips[k]);
            if (k == 3)
                refuses_image(f, path, "slice011.raw' is not there");
            else
                expect_image(f, path, M, NULL);
        }
}

static void slices_that_do_not_fit_are_refused(void **state)
{
    static const struct {
        const char *files, *word;
    } bad[] = { { "LIST\nslice009.raw\n", "holds fewer voxels" },
                { "LIST\n", "0 data files" },
                { "LIST\nslice009.raw\nslice009.raw\n", "same data file twice" },
                { "LIST\nslice009.raw\nslice010.raw\nslice011.raw\n", "3 data files for 2 slices" },
                { "LIST\nslice009.raw\n../b\n", "'../b' is not there" },
                { "slice%03x.raw 9 10 1\n", "is no pattern" },
                { "slice%s%03d.raw 9 10 1\n", "is no pattern" },
                { "slice%03d.raw 9 10 0\n", "is no pattern" },
                { "slice%03d.raw 9 10 -1\n", "is no pattern" },
                { "slice%99999d.raw 9 10 1\n", "is no pattern" },
                { "slice%03d.raw 9 1e9 1\n", "is no pattern" } };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "s.mhd");
    char text[512];
    write_slices(f, 0);
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        snprintf(text, sizeof text,
                 "NDims = 3\nDimSize = 4 3 2\nElementType = MET_SHORT\nElementDataFile = %s",
                 bad[k].files);
        scratch_write(path, text, strlen(text));
        refuses_image(f, path, bad[k].word);
    }
    scratch_write(scratch_path(f->folder, "slice010.raw"), "short", 5);
    snprintf(text, sizeof text,
             "NDims = 3\nDimSize = 4 3 2\nElementType = MET_SHORT\nElementDataFile = %s",
             "slice%03d.raw 9 10 1\n");
    scratch_write(path, text, strlen(text));
    refuses_image(f, path, "'slice010.raw' holds fewer voxels");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gifti_is_read_however_it_is_written),
        cmocka_unit_test(gifti_by_columns_in_base64),
        cmocka_unit_test(other_gifti_is_refused),
        cmocka_unit_test(freesurfer_surfaces_come_out_in_the_scanner),
        cmocka_unit_test(other_freesurfer_files_are_refused),
        cmocka_unit_test(off_is_read_with_all_that_may_stand_in_it),
        cmocka_unit_test(other_off_is_refused),
        cmocka_unit_test(freesurfer_images_are_read),
        cmocka_unit_test(other_mgh_is_refused),
        cmocka_unit_test(analyze_is_read_with_a_word_on_the_hand),
        cmocka_unit_test(slices_in_several_files_are_joined),
        cmocka_unit_test(slices_that_do_not_fit_are_refused),
    };
    return cmocka_run_group_tests_name("neuro", tests, setup, teardown);
}
