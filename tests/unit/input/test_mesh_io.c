/* Meshes to files and back, and every way a file may be damaged. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "apsm/formats.h"
#include "geometry/topology.h"
#include "scratch_fixture.h"
#include "shapes.h"

static const char *const extensions[] = { ".ply", ".stl", ".obj", ".vtk", ".vtp" };
enum { N_EXTENSIONS = 5 };

static apsm_status read_text(fixture *f, const char *name, const char *text, apsm_mesh *mesh)
{
    const char *const path = scratch_path(f->folder, name);
    scratch_write(path, text, strlen(text));
    return apsm_read_mesh(f->ctx, path, mesh);
}

static void must_read(fixture *f, const char *path, apsm_mesh *mesh)
{
    if (apsm_read_mesh(f->ctx, path, mesh) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
}

static void must_read_text(fixture *f, const char *name, const char *text, apsm_mesh *mesh)
{
    if (read_text(f, name, text, mesh) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
}

static void refuses(fixture *f, const char *name, const char *text, const char *word)
{
    apsm_mesh mesh = { 0 };
    const apsm_status status = read_text(f, name, text, &mesh);
    if (status == APSM_OK) fail_msg("accepted, want '%s':\n%s", word, text);
    expect_failure(f->ctx, status, APSM_ERR_FORMAT, word, name);
    assert_null(mesh.V);
}

static void talus_reads_with_its_unknown_elements(void **state)
{
    fixture *const f = *state;
    apsm_mesh mesh = { 0 };
    apsm_mesh_defects defects;
    must_read(f, APSM_TEST_DATA "/KSBL_R_01_talus.ply", &mesh);
    assert_int_equal(mesh.nv, 20002);
    assert_int_equal(mesh.nf, 40000);
    assert_true(mesh.V[0] == -1.0527 && mesh.V[1] == -51.9865 && mesh.V[2] == -86.2739);
    assert_int_equal(apsm_mesh_inspect(&mesh, &defects), APSM_OK);
    assert_true(apsm_mesh_is_closed_manifold(&defects));
    assert_true(apsm_mesh_volume(&mesh) > 0.0);
    apsm_mesh_free(&mesh);
}

/* Coordinates that are float32 come back the same from every format, scaled by powers of two or
 * not, and so do the faces. */
static void every_format_comes_back(void **state)
{
    fixture *const f = *state;
    for (int k = 0; k < N_EXTENSIONS; k++)
        for (int exponent = -60; exponent <= 60; exponent += 60) {
            apsm_mesh mesh = shape_torus(9, 7, 3.0, 1.0), back = { 0 };
            for (size_t i = 0; i < 3 * mesh.nv; i++)
                mesh.V[i] = (double)(float)ldexp(mesh.V[i], exponent);
            char name[32];
            snprintf(name, sizeof name, "torus%d%s", exponent, extensions[k]);
            const char *const path = scratch_path(f->folder, name);
            assert_int_equal(apsm_write_mesh(f->ctx, path, &mesh), APSM_OK);
            must_read(f, path, &back);
            assert_int_equal(back.nv, mesh.nv);
            assert_int_equal(back.nf, mesh.nf);
            for (size_t i = 0; i < 3 * mesh.nf; i++)
                assert_memory_equal(back.V + 3 * back.F[i], mesh.V + 3 * mesh.F[i],
                                    3 * sizeof(double));
            if (k != 1) assert_memory_equal(back.F, mesh.F, 3 * mesh.nf * sizeof *mesh.F);
            apsm_mesh_free(&mesh);
            apsm_mesh_free(&back);
        }
}

static void doubles_survive_where_the_format_holds_them(void **state)
{
    fixture *const f = *state;
    for (int k = 2; k < N_EXTENSIONS; k++) {
        apsm_mesh mesh = shape_sphere(1, 1.0 / 3.0), back = { 0 };
        char name[32];
        snprintf(name, sizeof name, "sphere%s", extensions[k]);
        const char *const path = scratch_path(f->folder, name);
        assert_int_equal(apsm_write_mesh(f->ctx, path, &mesh), APSM_OK);
        must_read(f, path, &back);
        assert_memory_equal(back.V, mesh.V, 3 * mesh.nv * sizeof *mesh.V);
        apsm_mesh_free(&mesh);
        apsm_mesh_free(&back);
    }
}

static void equal_meshes_make_equal_bytes(void **state)
{
    fixture *const f = *state;
    apsm_mesh mesh = shape_sphere(2, 5.0);
    for (int k = 0; k < N_EXTENSIONS; k++) {
        char *bytes[2];
        size_t size[2];
        for (int i = 0; i < 2; i++) {
            char name[32];
            snprintf(name, sizeof name, "same%d%s", i, extensions[k]);
            const char *const path = scratch_path(f->folder, name);
            assert_int_equal(apsm_write_mesh(f->ctx, path, &mesh), APSM_OK);
            bytes[i] = scratch_read(path, &size[i]);
        }
        assert_int_equal(size[0], size[1]);
        assert_memory_equal(bytes[0], bytes[1], size[0]);
        free(bytes[0]);
        free(bytes[1]);
    }
    apsm_mesh_free(&mesh);
}

static void writing_is_all_or_nothing(void **state)
{
    fixture *const f = *state;
    apsm_mesh mesh = shape_cube(1, 2.0);
    for (int k = 0; k < N_EXTENSIONS; k++) {
        char name[32];
        snprintf(name, sizeof name, "whole%s", extensions[k]);
        const char *const path = scratch_path(f->folder, name);
        scratch_write(path, "old", 3);
        const double x = mesh.V[4];
        mesh.V[4] = NAN;
        expect_failure(f->ctx, apsm_write_mesh(f->ctx, path, &mesh), APSM_ERR_NONFINITE, "point 1",
                       name);
        mesh.V[4] = x;
        size_t size;
        char *const bytes = scratch_read(path, &size);
        assert_string_equal(bytes, "old");
        free(bytes);
        assert_int_equal(apsm_write_mesh(f->ctx, path, &mesh), APSM_OK);
    }
    expect_failure(f->ctx, apsm_write_mesh(f->ctx, scratch_path(f->folder, "no/x.ply"), &mesh),
                   APSM_ERR_IO, "x.ply", "");
    expect_failure(f->ctx, apsm_write_mesh(f->ctx, scratch_path(f->folder, "x.off"), &mesh),
                   APSM_ERR_UNSUPPORTED, ".off", ".ply");
    mesh.V[0] = 1e300;
    expect_failure(f->ctx, apsm_write_mesh(f->ctx, scratch_path(f->folder, "big.ply"), &mesh),
                   APSM_ERR_NONFINITE, "float32", "big.ply");
    assert_int_equal(scratch_count(f->folder), N_EXTENSIONS); /* no temporary is left */
    apsm_mesh_free(&mesh);
}

static void polygons_are_cut(void **state)
{
    fixture *const f = *state;
    apsm_mesh mesh = { 0 };
    /* An L, not convex: the fan from its first corner would leave it. */
    must_read_text(f, "l.obj",
                   "v 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nv 0 0 0\nf 2 3 4 5 6 1\n", &mesh);
    assert_int_equal(mesh.nf, 4);
    assert_true(fabs(apsm_mesh_area(&mesh) - 3.0) < 1e-12);
    double n[18];
    apsm_mesh_vertex_normals(&mesh, n);
    for (size_t v = 0; v < 6; v++) assert_true(n[3 * v + 2] > 0.999999);
    apsm_mesh_free(&mesh);
    /* Triangles beside quads keep their place. */
    must_read_text(f, "q.ply",
                   "ply\nformat ascii 1.0\nelement vertex 5\nproperty double x\nproperty double y\n"
                   "property double z\nelement face 2\nproperty list uchar int vertex_index\n"
                   "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n3 0 1 4\n4 0 1 2 3\n",
                   &mesh);
    assert_int_equal(mesh.nf, 3);
    assert_int_equal(mesh.F[2], 4);
    apsm_mesh_free(&mesh);
}

static void variants_of_the_formats_are_understood(void **state)
{
    fixture *const f = *state;
    apsm_mesh mesh = { 0 };
    must_read_text(
        f, "n.obj",
        "# c\r\nmtllib a.mtl\r\no x\r\nv +0 0 0 1\r\nvn 0 0 1\r\nvt 0 0\r\nv 1 0 0 .5 .5 "
        ".5\r\nv 0 1e0 0\r\ns off\r\nf -3//1 \\\r\n 2/1/1 3/1\r\n",
        &mesh);
    assert_int_equal(mesh.nf, 1);
    assert_int_equal(mesh.F[0], 0);
    apsm_mesh_free(&mesh);
    must_read_text(f, "s.vtk",
                   "# vtk DataFile Version 5.1\nx\nASCII\nDATASET POLYDATA\nFIELD FieldData 1\n"
                   "TIME 1 1 double\n0\nMETADATA\nINFORMATION 0\n\nPOINTS 4 float\n0 0 0 1 0 0\n"
                   "0 1 0 1 1 0\nTRIANGLE_STRIPS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY "
                   "vtktypeint64\n0 1 2 3\nPOINT_DATA 4\nanything\n",
                   &mesh);
    assert_int_equal(mesh.nf, 2);
    const uint32_t strip[6] = { 0, 1, 2, 2, 1, 3 };
    assert_memory_equal(mesh.F, strip, sizeof strip);
    apsm_mesh_free(&mesh);
    must_read_text(f, "two.stl",
                   "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                   "vertex 0 1 0\nendloop\nendfacet\nendsolid a\nsolid b\nfacet normal 0 0 1\n"
                   "outer loop\nvertex 1 0 -0.0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\n"
                   "endsolid\n",
                   &mesh);
    assert_int_equal(mesh.nv, 4); /* corners that coincide are one, and -0 is 0 */
    assert_int_equal(mesh.nf, 2);
    apsm_mesh_free(&mesh);
}

#define PLY_HEAD(v, f)                                                                             \
    "ply\nformat ascii 1.0\nelement vertex " v                                                     \
    "\nproperty float x\nproperty float y\nproperty float z\nelement face " f                      \
    "\nproperty list uchar int vertex_indices\nend_header\n"
#define PLY_POINTS "0 0 0\n1 0 0\n0 1 0\n"

static void damaged_ply_is_refused_with_its_line(void **state)
{
    fixture *const f = *state;
    refuses(f, "a.ply", "", "empty");
    refuses(f, "a.ply", "PK\003\004", "does not begin with 'ply'");
    refuses(f, "a.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty real x\n", "line 4");
    refuses(f, "a.ply", "ply\nelement vertex 3\nproperty float x\nend_header\n", "no format");
    refuses(f, "a.ply", "ply\nformat ascii 1.0\nbogus\nend_header\n", "line 3");
    refuses(f, "a.ply", "ply\nformat ascii 1.0\nelement vertex 0\n", "file ends");
    refuses(f, "a.ply", PLY_HEAD("3", "1") PLY_POINTS, "file ends");
    refuses(f, "a.ply", PLY_HEAD("3", "9") PLY_POINTS "3 0 1 2\n", "file can hold");
    refuses(f, "a.ply", PLY_HEAD("99999999999", "1") PLY_POINTS "3 0 1 2\n", "line 3");
    refuses(f, "a.ply", PLY_HEAD("-3", "1") PLY_POINTS "3 0 1 2\n", "line 3");
    refuses(f, "a.ply", PLY_HEAD("3", "0") PLY_POINTS, "no faces");
    refuses(f, "a.ply", PLY_HEAD("3", "1") "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n", "line 11");
    refuses(f, "a.ply", PLY_HEAD("3", "1") "0 0 0\n1 inf 0\n0 1 0\n3 0 1 2\n", "not finite");
    refuses(f, "a.ply", PLY_HEAD("3", "1") "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n", "found 'x'");
    refuses(f, "a.ply", PLY_HEAD("3", "1") PLY_POINTS "3 0 1 3\n", "point 3");
    refuses(f, "a.ply", PLY_HEAD("3", "1") PLY_POINTS "3 0 -1 2\n", "line 13");
    refuses(f, "a.ply", PLY_HEAD("3", "1") PLY_POINTS "2 0 1\n", "2 corners");
    refuses(f, "a.ply", PLY_HEAD("3", "1") PLY_POINTS "3 0 1.5 2\n", "1.5");
    refuses(f, "a.ply", PLY_HEAD("3", "1") PLY_POINTS "200 0 1 2\n", "list length");
    refuses(f, "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
            "no property y");
    refuses(f, "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
            "property float z\nend_header\n1 2 3\n",
            "point cloud");
    refuses(f, "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
            "property float z\nelement tristrips 1\nproperty list int int vertex_indices\n"
            "end_header\n" PLY_POINTS "4 0 1 2 -1\n",
            "strips of triangles");
}

static void other_damaged_formats_are_refused(void **state)
{
    fixture *const f = *state;
    refuses(f, "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4");
    refuses(f, "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4");
    refuses(f, "a.obj", "v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "line 2");
    refuses(f, "a.obj", "v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "line 3");
    refuses(f, "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "2 corners");
    refuses(f, "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces");
    refuses(f, "a.obj", "hello\n", "line 1");
    refuses(f, "a.stl", "solid x\nendsolid x\n", "no faces");
    refuses(f, "a.stl", "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "file ends");
    refuses(f, "a.stl", "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 nan\n", "line 4");
    refuses(f, "a.stl", "nonsense", "too short");
    refuses(f, "a.vtk", "# vtk DataFile Version x\n", "legacy VTK");
    refuses(f, "a.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_GRID\n",
            "not POLYDATA");
    refuses(f, "a.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\n",
            "an image, where a surface is needed");
    refuses(f, "a.vtk",
            "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 99999999999 float\n0",
            "file can hold");
    refuses(f, "a.vtk",
            "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n"
            "0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 7\n",
            "point 7");
    refuses(f, "a.vtk",
            "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n"
            "0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n9 0 1 2\n",
            "9 corners");
    refuses(f, "a.vtp", "<VTKFile type=\"UnstructuredGrid\"></VTKFile>", "not a VTP");
    refuses(f, "a.vtp", "hello", "not a VTP");
    refuses(f, "a.vtp",
            "<VTKFile type=\"PolyData\" version=\"1.0\"><PolyData><Piece "
            "NumberOfPoints=\"99999999999\" NumberOfPolys=\"1\"></Piece></PolyData></VTKFile>",
            "NumberOfPoints");
    apsm_mesh mesh = { 0 };
    expect_failure(f->ctx, apsm_read_mesh(f->ctx, scratch_path(f->folder, "none.ply"), &mesh),
                   APSM_ERR_IO, "none.ply", "");
    expect_failure(f->ctx, apsm_read_mesh(f->ctx, f->folder, &mesh), APSM_ERR_IO, f->folder, "");
    expect_failure(f->ctx, read_text(f, "a.wrl", "OFF", &mesh), APSM_ERR_UNSUPPORTED, ".off", "");
}

/* A binary STL is known by its size; "solid" at its start means nothing. */
static void binary_stl_is_known_by_its_size(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "b.stl");
    apsm_mesh mesh = shape_cube(1, 2.0), back = { 0 };
    assert_int_equal(apsm_write_mesh(f->ctx, path, &mesh), APSM_OK);
    size_t size;
    char *const bytes = scratch_read(path, &size);
    memcpy(bytes, "solid ", 6);
    scratch_write(path, bytes, size);
    must_read(f, path, &back);
    assert_int_equal(back.nv, 8);
    apsm_mesh_free(&back);
    memcpy(bytes, "binary", 6);
    scratch_write(path, bytes, size - 7);
    expect_failure(f->ctx, apsm_read_mesh(f->ctx, path, &back), APSM_ERR_FORMAT, "12 triangles",
                   "b.stl");
    const float nan = NAN;
    memcpy(bytes + 84 + 50 + 12, &nan, sizeof nan);
    scratch_write(path, bytes, size);
    expect_failure(f->ctx, apsm_read_mesh(f->ctx, path, &back), APSM_ERR_FORMAT, "triangle 1",
                   "not finite");
    free(bytes);
    apsm_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(talus_reads_with_its_unknown_elements),
        cmocka_unit_test(every_format_comes_back),
        cmocka_unit_test(doubles_survive_where_the_format_holds_them),
        cmocka_unit_test(equal_meshes_make_equal_bytes),
        cmocka_unit_test_setup_teardown(writing_is_all_or_nothing, setup, teardown),
        cmocka_unit_test(polygons_are_cut),
        cmocka_unit_test(variants_of_the_formats_are_understood),
        cmocka_unit_test(damaged_ply_is_refused_with_its_line),
        cmocka_unit_test(other_damaged_formats_are_refused),
        cmocka_unit_test(binary_stl_is_known_by_its_size),
    };
    return cmocka_run_group_tests_name("mesh_io", tests, setup, teardown);
}
