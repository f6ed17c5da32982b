/* Readers on random damage: whatever the bytes, they return, with a mesh or volume that is
 * sound or with one line that names the file. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <sys/stat.h>
#include <time.h>

#include "apsm/formats.h"
#include "core/random.h"
#include "scratch_fixture.h"
#include "shapes.h"

static uint64_t rounds = 60; /* of each file; `make test-fuzz` does more */
enum { MOST_SECONDS = 5 };

/* Flips some bits, overwrites some bytes, or cuts the end off; returns the new size. */
static size_t damage(apsm_random *rng, const char *bytes, size_t size, char *out)
{
    memcpy(out, bytes, size);
    /* Half of the damage hits the header. */
    const size_t range = apsm_random_below(rng, 2) && size > 400 ? 400 : size;
    const uint64_t times = 1 + apsm_random_below(rng, 4);
    for (uint64_t k = 0; k < times; k++) {
        char *const at = out + apsm_random_below(rng, range);
        switch (apsm_random_below(rng, 4)) {
        case 0:
            *at = (char)(*at ^ (1 << apsm_random_below(rng, 8)));
            break;
        case 1:
            *at = (char)apsm_random_below(rng, 256);
            break;
        case 2:
            *at = "0123456789-.e \n\377"[apsm_random_below(rng, 16)];
            break;
        default:
            *at = '\0';
            break;
        }
    }
    return apsm_random_below(rng, 8) ? size : apsm_random_below(rng, size);
}

static void expect_sound_mesh(const apsm_mesh *mesh, const char *path)
{
    assert_true(mesh->nf > 0);
    for (size_t i = 0; i < 3 * mesh->nv; i++)
        if (!isfinite(mesh->V[i])) fail_msg("%s: not finite", path);
    for (size_t i = 0; i < 3 * mesh->nf; i++)
        if (mesh->F[i] >= mesh->nv) fail_msg("%s: index out of range", path);
}

static void read_and_check(fixture *f, const char *path, bool is_mesh)
{
    apsm_mesh mesh = { 0 };
    apsm_volume volume = { 0 };
    const clock_t start = clock();
    const apsm_status status =
        is_mesh ? apsm_read_mesh(f->ctx, path, &mesh) : apsm_read_volume(f->ctx, path, &volume);
    if (clock() - start > MOST_SECONDS * CLOCKS_PER_SEC) fail_msg("%s: takes too long", path);
    if (status != APSM_OK) {
        expect_failure(f->ctx, status, status, strrchr(path, '/'), "");
        assert_true(!mesh.V && !volume.label);
    } else if (is_mesh) {
        expect_sound_mesh(&mesh, path);
    } else {
        assert_true(!volume.label != !volume.value);
        int32_t sum = 0;
        for (size_t i = 0; volume.label && i < volume.n[0] * volume.n[1] * volume.n[2]; i++)
            sum ^= volume.label[i];
        assert_true(volume.spacing[0] > 0.0 && (sum == 0 || sum != 0));
    }
    apsm_mesh_free(&mesh);
    apsm_volume_free(&volume);
}

static void survive_damage(fixture *f, const char *name, bool is_mesh)
{
    const char *const path = scratch_path(f->folder, name);
    size_t size;
    char *const bytes = scratch_read(path, &size), *const out = malloc(size);
    char bad[SCRATCH_LENGTH * 2];
    for (uint64_t round = 0; round < rounds; round++) {
        snprintf(bad, sizeof bad, "%s/bad%u-%s", f->folder, (unsigned)round, name);
        apsm_random rng = apsm_random_stream(strlen(name), APSM_STREAM_TEST, round, 0);
        scratch_write(bad, out, damage(&rng, bytes, size, out));
        read_and_check(f, bad, is_mesh);
        unlink(bad);
    }
    free(bytes);
    free(out);
}

static void damaged_meshes_are_survived(void **state)
{
    fixture *const f = *state;
    const char *const names[] = { "m.ply", "m.stl", "m.obj", "m.vtk", "m.vtp" };
    apsm_mesh mesh = shape_cube(2, 1.5);
    for (int k = 0; k < 5; k++) {
        assert_int_equal(apsm_write_mesh(f->ctx, scratch_path(f->folder, names[k]), &mesh),
                         APSM_OK);
        survive_damage(f, names[k], true);
    }
    apsm_mesh_free(&mesh);
}

static void damaged_text_is_survived(void **state)
{
    fixture *const f = *state;
    const struct {
        const char *name, *text;
    } files[] = {
        { "t.ply",
          "ply\nformat ascii 1.0\nelement a 2\nproperty list uint8 int8 b\nelement vertex 4"
          "\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty "
          "list uchar int vertex_indices\nproperty int p\nend_header\n1 0\n2 3 4\n0 0 0\n1 0 "
          "0\n1 1 0\n0 1 0\n4 0 1 2 3 0\n3 0 1 2 7\n" },
        { "t.stl",
          "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 "
          "0\nendloop\nendfacet\nendsolid a\n" },
        { "t.vtk",
          "# vtk DataFile Version 4.2\nt\nASCII\nDATASET POLYDATA\nFIELD FieldData 1\nT 1 1 "
          "double\n0\nPOINTS 4 float\n0 0 0 1 0 0 1 1 0 0 1 0\nLINES 1 3\n2 0 1\nPOLYGONS 1 "
          "5\n4 0 1 2 3\nTRIANGLE_STRIPS 1 5\n4 0 1 2 3\n" },
        { "t.off", "OFF\n# c\n4 2 0\n0 0 0\n1 0 0 9 9\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 2 1 5\n" },
        { "t.gii",
          "<GIFTI><DataArray Intent=\"NIFTI_INTENT_POINTSET\" DataType=\"NIFTI_TYPE_FLOAT32\" "
          "Dim0=\"4\" Dim1=\"3\" Encoding=\"GZipBase64Binary\" Endian=\"LittleEndian\"><Data>"
          "eJxjYEAGDQ4oXAYFKL/BHoIZDgIALCMDYA==</Data></DataArray><DataArray "
          "Intent=\"NIFTI_INTENT_TRIANGLE\" DataType=\"NIFTI_TYPE_INT32\" Dim0=\"4\" Dim1=\"3\" "
          "Encoding=\"Base64Binary\" Endian=\"LittleEndian\"><Data>"
          "AAAAAAIAAAABAAAAAAAAAAEAAAADAAAAAQAAAAIAAAADAAAAAgAAAAAAAAADAAAA</Data></DataArray>"
          "</GIFTI>" },
    };
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        scratch_write(scratch_path(f->folder, files[k].name), files[k].text, strlen(files[k].text));
        apsm_mesh mesh = { 0 };
        if (apsm_read_mesh(f->ctx, scratch_path(f->folder, files[k].name), &mesh) != APSM_OK)
            fail_msg("%s", apsm_error_text(f->ctx));
        apsm_mesh_free(&mesh);
        survive_damage(f, files[k].name, true);
    }
}

/* FreeSurfer's: zeros but for what is set. */
static void damaged_freesurfer_is_survived(void **state)
{
    fixture *const f = *state;
    char surface[3 + 4 + 8 + 36 + 12 + 80] = "\xff\xff\xfe"
                                             "c\n\n";
    surface[9] = 3;           /* points */
    surface[13] = 1;          /* triangles */
    surface[14 + 12] = 0x3f;  /* 1, 0, 0 */
    surface[14 + 28] = 0x3f;  /* 0, 1, 0 */
    surface[14 + 36 + 7] = 1; /* 0, 1, 2 */
    surface[14 + 36 + 11] = 2;
    memcpy(surface + 14 + 48, "\0\0\0\024valid = 1\ncras = 1 2 3\n", 27);
    scratch_write(scratch_path(f->folder, "s.white"), surface, 14 + 48 + 27);
    survive_damage(f, "s.white", true);
    char image[284 + 27] = { 0, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, 3, 0, 0, 0, 3, 0, 0, 0, 1 };
    image[284 + 13] = 1;
    scratch_write(scratch_path(f->folder, "i.mgh"), image, sizeof image);
    survive_damage(f, "i.mgh", false);
}

static void damaged_vtk_images_are_survived(void **state)
{
    fixture *const f = *state;
    const char *const image = "# vtk DataFile Version 4.2\rt\rASCII\rDATASET STRUCTURED_POINTS\r"
                              "DIMENSIONS 3 2 2\rSPACING 1 1 1\rORIGIN 0 0 0\rCELL_DATA 2\r"
                              "SCALARS c int\rLOOKUP_TABLE d\r1 2\rVECTORS v int\r1 2 3 4 5 6\r"
                              "POINT_DATA 12\r"
                              "SCALARS s short 1\rLOOKUP_TABLE default\r0 1 0 0 1 1 0 0 0 7 0 0\r";
    scratch_write(scratch_path(f->folder, "i.vtk"), image, strlen(image));
    survive_damage(f, "i.vtk", false);
}

/* Headers whose voxels are in files beside them. */
static void damaged_headers_are_survived(void **state)
{
    fixture *const f = *state;
    char analyze[348] = { 0x5c, 1 };
    const char *const meta = "NDims = 3\nDimSize = 3 3 2\nElementType = MET_UCHAR\n"
                             "ElementDataFile = LIST\na.raw\nb.raw\n",
                      *const pattern =
                          "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 3 3 2\nencoding: "
                          "raw\ndata file: p%01d.raw 1 2 1\n";
    const char *const data[] = { "a.raw", "b.raw", "p1.raw", "p2.raw", "h.img" };
    for (int k = 0; k < 5; k++)
        scratch_write(scratch_path(f->folder, data[k]), "\0\0\0\0\1\0\0\0\0\0\0\0\0\0\0\0\0\0", 18);
    analyze[38] = 'r';
    for (int k = 0; k < 4; k++) analyze[40 + 2 * k] = (char)(k == 3 ? 2 : 3);
    analyze[70] = 2;
    for (int k = 1; k < 4; k++) analyze[79 + 4 * k] = 0x3f;
    scratch_write(scratch_path(f->folder, "l.mhd"), meta, strlen(meta));
    scratch_write(scratch_path(f->folder, "p.nhdr"), pattern, strlen(pattern));
    scratch_write(scratch_path(f->folder, "h.hdr"), analyze, sizeof analyze);
    survive_damage(f, "l.mhd", false);
    survive_damage(f, "p.nhdr", false);
    survive_damage(f, "h.hdr", false);
}

static void damaged_volumes_are_survived(void **state)
{
    fixture *const f = *state;
    const char *const names[] = { "v.nrrd", "v.nii", "v.nii.gz", "v.mha" };
    int32_t label[60];
    for (int i = 0; i < 60; i++) label[i] = i % 5;
    const apsm_volume v = { .n = { 5, 4, 3 },
                            .spacing = { 1, 1, 1 },
                            .direction = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                            .label = label };
    for (int k = 0; k < 4; k++) {
        assert_int_equal(apsm_write_volume(f->ctx, scratch_path(f->folder, names[k]), &v), APSM_OK);
        survive_damage(f, names[k], false);
    }
}

/* The files that people brought, and a DICOM segmentation in a folder of its own. */
static void damaged_cases_are_survived(void **state)
{
    fixture *const f = *state;
    const struct {
        const char *from, *name;
    } files[] = { { "/cases/vtp/m2_c1_h0_b1.vtp", "a.vtp" },
                  { "/cases/vtp/m3_c0_h1_b1.vtp", "b.vtp" },
                  { "/cases/qsform/a_both.nii.gz", "c.nii.gz" },
                  { "/cases/segnrrd/p01.seg.nrrd", "d.seg.nrrd" } };
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        char path[512];
        size_t size;
        snprintf(path, sizeof path, APSM_TEST_DATA "%s", files[k].from);
        char *const bytes = scratch_read(path, &size);
        scratch_write(scratch_path(f->folder, files[k].name), bytes, size);
        free(bytes);
        survive_damage(f, files[k].name, k < 2);
    }
}

static void damaged_dicom_is_survived(void **state)
{
    fixture *const f = *state;
    size_t size;
    char *const bytes = scratch_read(APSM_TEST_DATA "/cases/seg/h_seg_gap/seg.dcm", &size);
    char *const out = malloc(size), folder[SCRATCH_LENGTH + 8];
    snprintf(folder, sizeof folder, "%s/dicom", f->folder);
    assert_int_equal(mkdir(folder, 0777), 0);
    for (uint64_t round = 0; round < rounds; round++) {
        apsm_random rng = apsm_random_stream(11, APSM_STREAM_TEST, round, 0);
        apsm_volume v = { 0 };
        /* The tree of elements ends before the pixels. */
        memcpy(out, bytes, size);
        for (int k = 0; k < 3; k++)
            out[132 + apsm_random_below(&rng, 3000)] = (char)apsm_random_below(&rng, 256);
        scratch_write(scratch_path(folder, "s.dcm"), out,
                      apsm_random_below(&rng, 4) ? size : apsm_random_below(&rng, size));
        const apsm_status status = apsm_read_dicom(f->ctx, folder, &v);
        if (status != APSM_OK) expect_failure(f->ctx, status, status, f->folder, "");
        assert_true(status == APSM_OK ? v.label != NULL : v.label == NULL);
        apsm_volume_free(&v);
    }
    free(bytes);
    free(out);
}

int main(int argc, char **argv)
{
    if (argc > 1) rounds = strtoull(argv[1], NULL, 10);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(damaged_meshes_are_survived),
        cmocka_unit_test(damaged_text_is_survived),
        cmocka_unit_test(damaged_freesurfer_is_survived),
        cmocka_unit_test(damaged_vtk_images_are_survived),
        cmocka_unit_test(damaged_headers_are_survived),
        cmocka_unit_test(damaged_volumes_are_survived),
        cmocka_unit_test(damaged_cases_are_survived),
        cmocka_unit_test(damaged_dicom_is_survived),
    };
    return cmocka_run_group_tests_name("damaged", tests, setup, teardown);
}
