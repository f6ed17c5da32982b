/* Every text format with lines that end in LF, CR LF or CR, and legacy VTK's images: what comes out
 * was put in by this file. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "apsm/formats.h"
#include "formats/vtk_grid.h"
#include "formats/vtk_image.h"
#include "input/input.h"
#include "scratch_fixture.h"

/* `text` with its line ends as `end`; *size <- how long. */
static char *with_ends(const char *text, const char *end, size_t *size)
{
    char *const out = malloc(2 * strlen(text) + 1);
    assert_non_null(out);
    *size = 0;
    for (const char *c = text; *c; c++)
        if (*c == '\n')
            for (const char *e = end; *e; e++) out[(*size)++] = *e;
        else
            out[(*size)++] = *c;
    return out;
}

/* The file of that name, written so. */
static const char *write_with_ends(const fixture *f, const char *name, const char *text,
                                   const char *end)
{
    size_t size;
    char *const bytes = with_ends(text, end, &size);
    const char *const path = scratch_path(f->folder, name);
    scratch_write(path, bytes, size);
    free(bytes);
    return path;
}

static const char *const ends[] = { "\n", "\r\n", "\r" };
enum { ENDS = sizeof ends / sizeof *ends };

/* ---- meshes ---- */

static const double points[4][3] = { { 0, 0, 0 }, { 4, 0, 0 }, { 0, 2.5, 0 }, { 1, 1, -8 } };

/* Six times what the faces enclose, < 0 if they look inward. */
static double volume(const apsm_mesh *m)
{
    double sum = 0;
    for (size_t t = 0; t < m->nf; t++) {
        const double *a = m->V + 3 * (size_t)m->F[3 * t], *b = m->V + 3 * (size_t)m->F[3 * t + 1],
                     *c = m->V + 3 * (size_t)m->F[3 * t + 2];
        sum += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
               a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    return sum;
}

static void expect_tetrahedron(fixture *f, const char *path)
{
    apsm_mesh m = { 0 };
    if (apsm_read_mesh(f->ctx, path, &m) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    assert_int_equal(m.nv, 4);
    assert_int_equal(m.nf, 4);
    if (fabs(volume(&m) + 80) > 1e-12) fail_msg("%s: encloses %g", path, volume(&m));
    for (int v = 0; v < 4; v++) {
        double least = HUGE_VAL; /* STL has its points in another order */
        for (int w = 0; w < 4; w++)
            least =
                fmin(least, fabs(m.V[3 * v] - points[w][0]) + fabs(m.V[3 * v + 1] - points[w][1]) +
                                fabs(m.V[3 * v + 2] - points[w][2]));
        if (least > 0) fail_msg("%s: point %d is none of those that were written", path, v);
    }
    apsm_mesh_free(&m);
}

static const struct {
    const char *name, *text;
} meshes[] = {
    { "a.obj", "# a comment, v 9 9 9\nv 0 0 0\nv 4 0 0\nv 0 2.5 0\nv 1 1 \\\n-8\nf 1 3 2\nf 1 2 4\n"
               "g a name\nf 2 3 4\nf 3 1 4\n" },
    { "a.off", "OFF\n# four points\n4 4 6\n0 0 0\n4 0 0\n0 2.5 0 # the third\n1 1 -8\n3 0 2 1\n"
               "3 0 1 3\n3 1 2 3\n3 2 0 3\n" },
    { "a.ply", "ply\nformat ascii 1.0\ncomment element vertex 9\nelement vertex 4\n"
               "property float x\nproperty float y\nproperty float z\nelement face 4\n"
               "property list uchar int vertex_indices\nend_header\n0 0 0\n4 0 0\n0 2.5 0\n1 1 -8\n"
               "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n" },
    { "a.vtk",
      "# vtk DataFile Version 3.0\na title\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0\n"
      "4 0 0\n0 2.5 0\n1 1 -8\nPOLYGONS 4 16\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n" },
    { "a.stl", "solid a name\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 2.5 0\n"
               "vertex 4 0 0\nendloop\nendfacet\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\n"
               "vertex 4 0 0\nvertex 1 1 -8\nendloop\nendfacet\nfacet normal 0 0 0\nouter loop\n"
               "vertex 4 0 0\nvertex 0 2.5 0\nvertex 1 1 -8\nendloop\nendfacet\n"
               "facet normal 0 0 0\nouter loop\nvertex 0 2.5 0\nvertex 0 0 0\nvertex 1 1 -8\n"
               "endloop\nendfacet\nendsolid a name\n" },
};

static void meshes_are_the_same_whatever_ends_their_lines(void **state)
{
    fixture *const f = *state;
    for (size_t k = 0; k < sizeof meshes / sizeof *meshes; k++)
        for (int e = 0; e < ENDS; e++)
            expect_tetrahedron(f, write_with_ends(f, meshes[k].name, meshes[k].text, ends[e]));
}

/* In a comment, say, that two programs wrote. */
static void a_cr_that_strayed_ends_no_line(void **state)
{
    fixture *const f = *state;
    char text[256];
    const char *const path = scratch_path(f->folder, "stray.obj");
    snprintf(text, sizeof text, "# made by hand\r%s", meshes[0].text);
    scratch_write(path, text, strlen(text));
    expect_tetrahedron(f, path);
}

static void surfaces_in_gzip_are_named(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "packed.vtk");
    apsm_mesh m = { 0 };
    scratch_write(path, "\x1f\x8b\x08\0\0\0\0\0", 8);
    assert_int_equal(apsm_read_mesh(f->ctx, path, &m), APSM_ERR_FORMAT);
    assert_non_null(strstr(apsm_error_text(f->ctx), "packed by gzip"));
}

/* Points that are moved leave a file that is read as the one before was. */
static void vtk_surfaces_keep_their_line_ends(void **state)
{
    fixture *const f = *state;
    for (int e = 0; e < ENDS; e++) {
        const char *const path = write_with_ends(f, "a.vtk", meshes[3].text, ends[e]);
        vtk_grid g;
        assert_int_equal(vtk_grid_read(f->ctx, path, &g), APSM_OK);
        assert_int_equal(vtk_grid_write(f->ctx, path, &g, g.x), APSM_OK);
        expect_tetrahedron(f, path);
        vtk_grid_free(&g);
    }
}

static void fields_behind_those_of_cells_are_found(void **state)
{
    fixture *const f = *state;
    char text[512];
    double x[4];
    const char *const path = scratch_path(f->folder, "field.vtk");
    snprintf(text, sizeof text,
             "%sCELL_DATA 4\nNORMALS n float\n1 0 0 1 0 0 1 0 0 1 0 0\nPOINT_DATA 4\n"
             "SCALARS x float\nLOOKUP_TABLE default\n5 6 7 8\n",
             meshes[3].text);
    scratch_write(path, text, strlen(text));
    if (apsm_read_mesh_field(f->ctx, path, "x", 4, x) != APSM_OK)
        fail_msg("%s", apsm_error_text(f->ctx));
    assert_true(fabs(x[3] - 8) < 1e-12);
}

/* The first byte of the values may look like the other half of a line end. */
static void binary_values_begin_right_behind_the_header(void **state)
{
    static const char head[] = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
                               "property uchar x\nproperty uchar y\nproperty uchar z\n"
                               "element face 1\nproperty list uchar uchar vertex_indices\n"
                               "end_header\n";
    static const unsigned char values[] = { 10, 13, 10, 13, 10, 10, 0, 0, 0, 3, 0, 1, 2 };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "b.ply");
    for (int e = 0; e < ENDS; e++) {
        size_t size;
        char *text = with_ends(head, ends[e], &size);
        text = realloc(text, size + sizeof values);
        assert_non_null(text);
        memcpy(text + size, values, sizeof values);
        scratch_write(path, text, size + sizeof values);
        apsm_mesh m = { 0 };
        if (apsm_read_mesh(f->ctx, path, &m) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
        for (size_t c = 0; c < 9; c++)
            if (fabs(m.V[c] - values[c]) > 0) fail_msg("end %d: value %zu is %g", e, c, m.V[c]);
        apsm_mesh_free(&m);
        free(text);
    }
}

/* ---- images ---- */

enum { NX = 3, NY = 2, NZ = 2, VOXELS = NX * NY * NZ };
static const int labels[VOXELS] = { 0, 1, 0, 2, 0, 0, 0, 10, 13, 0, 0, 7 };

static void expect_image(fixture *f, const char *path)
{
    static const double spacing[3] = { 1, 2, 3 };
    apsm_volume v = { 0 };
    if (apsm_read_volume(f->ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
    assert_int_equal(v.n[0], NX);
    assert_int_equal(v.n[1], NY);
    assert_int_equal(v.n[2], NZ);
    for (int c = 0; c < 3; c++)
        if (fabs(v.spacing[c] - spacing[c]) + fabs(v.origin[c] - (5 + c)) > 1e-12)
            fail_msg("%s: axis %d: spacing %g, origin %g", path, c, v.spacing[c], v.origin[c]);
    for (int k = 0; k < VOXELS; k++)
        if (v.label[k] != labels[k])
            fail_msg("%s: voxel %d is %d, not %d", path, k, v.label[k], labels[k]);
    apsm_volume_free(&v);
}

#define VTK     "# vtk DataFile Version 3.0\na title\n"
#define GRID    "DATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 2\nSPACING 1 2 3\nORIGIN 5 6 7\n"
#define NUMBERS "0 1 0\n2 0 0\n0 10 13\n0 0 7\n"

static const struct {
    const char *name, *text;
} images[] = {
    { "a.nrrd", "NRRD0004\n# a comment\ntype: short\ndimension: 3\nspace: left-posterior-superior\n"
                "sizes: 3 2 2\nspace directions: (1,0,0) (0,2,0) (0,0,3)\n"
                "space origin: (5,6,7)\nencoding: ascii\n\n" NUMBERS },
    { "a.mha",
      "ObjectType = Image\nNDims = 3\nBinaryData = False\nDimSize = 3 2 2\nOffset = 5 6 7\n"
      "ElementSpacing = 1 2 3\nElementType = MET_SHORT\nElementDataFile = LOCAL\n" NUMBERS },
    { "a.vtk", VTK "ASCII\n" GRID "POINT_DATA 12\nSCALARS s short 1\nLOOKUP_TABLE default\n" NUMBERS
                   "METADATA\nINFORMATION 0\n\n" },
    { "c.vtk", VTK "ASCII\n" GRID "CELL_DATA 2\nSCALARS c float 2\nLOOKUP_TABLE default\n1 2 3 4\n"
                   "VECTORS v double\n1 2 3\n4 5 6\nFIELD f 1\nx 2 2 int\n1 2\n3 4\nMETADATA\n"
                   "INFORMATION 0\n\nPOINT_DATA 12\nSCALARS s short\nLOOKUP_TABLE t\n" NUMBERS },
    { "b.vtk", VTK "ASCII\nDATASET STRUCTURED_POINTS\nFIELD f 1\nTIME 1 1 double\n0.5\n"
                   "DIMENSIONS 3 2 2\nASPECT_RATIO 1 2 3\nORIGIN 5 6 7\nPOINT_DATA 12\nMETADATA\n"
                   "INFORMATION 0\n\nFIELD all 2\ns 1 12 float\n" NUMBERS "t 1 12 int\n" NUMBERS },
};

static void images_are_the_same_whatever_ends_their_lines(void **state)
{
    fixture *const f = *state;
    for (size_t k = 0; k < sizeof images / sizeof *images; k++)
        for (int e = 0; e < ENDS; e++)
            expect_image(f, write_with_ends(f, images[k].name, images[k].text, ends[e]));
}

static void voxels_in_another_file_are_found_whatever_ends_the_lines(void **state)
{
    static const char meta[] =
        "NDims = 3\nDimSize = 3 2 2\nOffset = 5 6 7\nElementSpacing = 1 2 3\n"
        "ElementType = MET_UCHAR\nElementDataFile = LIST\none.raw\ntwo.raw\n";
    fixture *const f = *state;
    unsigned char bytes[VOXELS];
    for (int k = 0; k < VOXELS; k++) bytes[k] = (unsigned char)labels[k];
    scratch_write(scratch_path(f->folder, "one.raw"), bytes, VOXELS / 2);
    scratch_write(scratch_path(f->folder, "two.raw"), bytes + VOXELS / 2, VOXELS / 2);
    for (int e = 0; e < ENDS; e++) {
        const char *const path = write_with_ends(f, "l.mhd", meta, ends[e]);
        apsm_file_list files;
        expect_image(f, path);
        assert_int_equal(apsm_input_data_files(path, &files), APSM_OK);
        assert_int_equal(files.n, 2); /* which the manifest's check sum is made of */
        assert_string_equal(strrchr(files.path[1], '/'), "/two.raw");
        apsm_file_list_free(&files);
    }
}

/* Else what the file holds would not be in the check sum. */
static void long_lines_hide_no_data_file(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "long.nhdr");
    char text[5200];
    for (int comment = 4090; comment < 4100; comment++) {
        apsm_file_list files;
        const int size =
            snprintf(text, sizeof text, "NRRD0004\n#%0*d\ndata file: v.raw\n", comment - 1, 0);
        scratch_write(path, text, (size_t)size);
        assert_int_equal(apsm_input_data_files(path, &files), APSM_OK);
        assert_int_equal(files.n, 1);
        apsm_file_list_free(&files);
    }
}

/* ---- images of VTK ---- */

static void binary_vtk_images_are_big_endian(void **state)
{
    static const char head[] =
        VTK "BINARY\n" GRID "POINT_DATA 12\nSCALARS s short\nLOOKUP_TABLE t\n";
    fixture *const f = *state;
    char bytes[sizeof head + 2 * VOXELS];
    const size_t lead = sizeof head - 1;
    memcpy(bytes, head, lead);
    for (int k = 0; k < VOXELS; k++) {
        bytes[lead + 2 * (size_t)k] = 0;
        bytes[lead + 2 * (size_t)k + 1] = (char)labels[k];
    }
    const char *const path = scratch_path(f->folder, "big.VTK");
    scratch_write(path, bytes, lead + 2 * VOXELS);
    apsm_input_kind kind = APSM_INPUT_MESH;
    assert_true(apsm_input_kind_of(path, &kind));
    assert_int_equal(kind, APSM_INPUT_VOLUME);
    expect_image(f, path);
}

static void vtk_images_that_hold_no_labels_are_refused(void **state)
{
    static const struct {
        const char *text, *word;
    } bad[] = {
        { VTK "ASCII\n" GRID "POINT_DATA 12\nSCALARS s short 3\nLOOKUP_TABLE t\n" NUMBERS,
          "3 values a voxel" },
        { VTK "ASCII\n" GRID "POINT_DATA 12\nVECTORS s short\n" NUMBERS, "found 'VECTORS'" },
        { VTK "ASCII\n" GRID "POINT_DATA 11\nSCALARS s short\nLOOKUP_TABLE t\n" NUMBERS,
          "line 8: 11 values, but 3 x 2 x 2 points" },
        { VTK "ASCII\n" GRID "CELL_DATA 2\nSCALARS s short\nLOOKUP_TABLE t\n1 1\n",
          "belong to cells" },
        { VTK "ASCII\n" GRID "CELL_DATA 2\nSCALARS s short\nLOOKUP_TABLE t\n1",
          "expected a value" },
        { VTK "ASCII\n" GRID "CELL_DATA 30\nSCALARS s short 4\nLOOKUP_TABLE t\n1",
          "larger than the file" },
        { VTK "ASCII\n" GRID "CELL_DATA 2\nCOLOR_SCALARS s 3\n1 1 1 0 0 0\nPOINT_DATA 12\n",
          "cell data come first" },
        { VTK "ASCII\n" GRID "POINT_DATA 12\nSCALARS s bit\nLOOKUP_TABLE t\n" NUMBERS,
          "found 'bit'" },
        { VTK "ASCII\n" GRID "POINT_DATA 12\nSCALARS s short\nLOOKUP_TABLE t\n0 1 0\n",
          "the file holds" },
        { VTK "BINARY\n" GRID "POINT_DATA 12\nSCALARS s double\nLOOKUP_TABLE t\n0123456789",
          "more voxels than the file holds" },
        { VTK "ASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 -2 2\n", "-2 points along an axis" },
        { VTK
          "ASCII\nDATASET STRUCTURED_POINTS\nPOINT_DATA 4\nSCALARS s int\nLOOKUP_TABLE t\n1 1 1 1",
          "0 x 0 x 0 points" },
        { VTK "ASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 2\nSPACING 1 0 1\nPOINT_DATA 12\n"
              "SCALARS s int\nLOOKUP_TABLE t\n" NUMBERS,
          "spacing 0 along axis 1" },
        { VTK "ASCII\n" GRID, "the file ends" },
    };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "bad.vtk");
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        apsm_volume v = { 0 };
        scratch_write(path, bad[k].text, strlen(bad[k].text));
        assert_true(vtk_is_image(path));
        if (apsm_read_volume(f->ctx, path, &v) == APSM_OK) fail_msg("%s: accepted", bad[k].word);
        if (!strstr(apsm_error_text(f->ctx), bad[k].word))
            fail_msg("'%s' is not in '%s'", bad[k].word, apsm_error_text(f->ctx));
        assert_null(v.label);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(meshes_are_the_same_whatever_ends_their_lines),
        cmocka_unit_test(a_cr_that_strayed_ends_no_line),
        cmocka_unit_test(surfaces_in_gzip_are_named),
        cmocka_unit_test(vtk_surfaces_keep_their_line_ends),
        cmocka_unit_test(fields_behind_those_of_cells_are_found),
        cmocka_unit_test(long_lines_hide_no_data_file),
        cmocka_unit_test(binary_values_begin_right_behind_the_header),
        cmocka_unit_test(images_are_the_same_whatever_ends_their_lines),
        cmocka_unit_test(voxels_in_another_file_are_found_whatever_ends_the_lines),
        cmocka_unit_test(binary_vtk_images_are_big_endian),
        cmocka_unit_test(vtk_images_that_hold_no_labels_are_refused),
    };
    return cmocka_run_group_tests_name("line_ends", tests, setup, teardown);
}
