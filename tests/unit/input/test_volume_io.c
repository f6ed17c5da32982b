/* Segmentations to files and back: grids in every pose, the systems of coordinates, damage. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "apsm/formats.h"
#include "geometry/volume.h"
#include "input/input.h"
#include "scratch_fixture.h"

static const char *const extensions[] = { ".nrrd", ".nii", ".nii.gz", ".mha" };
enum { N_EXTENSIONS = 4 };

/* A grid of 5 x 4 x 3 with some labels.  flip: det -1. */
static apsm_volume make_volume(double angle, bool flip)
{
    apsm_volume v = { .n = { 5, 4, 3 },
                      .origin = { 12.5, -7.25, 100.0 },
                      .spacing = { 0.5, 1.25, 3.0 } };
    const double c = cos(angle), s = sin(angle);
    /* About the axis (2, 3, 6)/7, so that no entry is 0. */
    const double u[3] = { 2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0 };
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int k = 3 - i - j; /* the third index, if i != j */
            const double cross = i == j ? 0.0 : (j == (i + 1) % 3 ? -u[k] : u[k]);
            v.direction[3 * i + j] = (i == j) * c + s * cross + (1.0 - c) * u[i] * u[j];
        }
    for (int i = 0; flip && i < 3; i++) v.direction[3 * i] = -v.direction[3 * i];
    v.label = calloc(60, sizeof *v.label);
    for (size_t i = 0; i < 60; i++) v.label[i] = (int32_t)(i * i % 7);
    return v;
}

static void must_read(fixture *f, const char *path, apsm_volume *v)
{
    if (apsm_read_volume(f->ctx, path, v) != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
}

/* tolerance in mm for positions, as the map from index to space counts. */
static void expect_same(const apsm_volume *a, const apsm_volume *b, double tolerance,
                        const char *what)
{
    double A[16], B[16];
    assert_memory_equal(a->n, b->n, sizeof a->n);
    apsm_volume_index_to_lps(a, A);
    apsm_volume_index_to_lps(b, B);
    for (int k = 0; k < 16; k++)
        if (!(fabs(A[k] - B[k]) <= tolerance))
            fail_msg("%s: M[%d] = %.17g, not %.17g", what, k, B[k], A[k]);
    assert_memory_equal(a->label, b->label, a->n[0] * a->n[1] * a->n[2] * sizeof *a->label);
}

/* NIfTI keeps its geometry in float32: 1e-5 of 100 mm.  The others print 17 digits or nearly. */
static void oriented_grids_come_back(void **state)
{
    fixture *const f = *state;
    for (int k = 0; k < N_EXTENSIONS; k++)
        for (int pose = 0; pose < 8; pose++) {
            apsm_volume v = make_volume(0.7 * (pose / 2), pose % 2), back = { 0 };
            char name[32];
            snprintf(name, sizeof name, "v%d%s", pose, extensions[k]);
            const char *const path = scratch_path(f->folder, name);
            if (apsm_write_volume(f->ctx, path, &v) != APSM_OK)
                fail_msg("%s", apsm_error_text(f->ctx));
            must_read(f, path, &back);
            expect_same(&v, &back, k == 1 || k == 2 ? 1e-5 : 1e-9, name);
            apsm_volume_free(&v);
            apsm_volume_free(&back);
        }
    assert_int_equal(scratch_count(f->folder), 8 * N_EXTENSIONS); /* no temporary is left */
}

static void wide_labels_come_back(void **state)
{
    fixture *const f = *state;
    for (int k = 0; k < N_EXTENSIONS; k++) {
        apsm_volume v = make_volume(0.0, false), back = { 0 };
        v.label[3] = -5;
        v.label[4] = INT32_MAX;
        char name[32];
        snprintf(name, sizeof name, "wide%s", extensions[k]);
        const char *const path = scratch_path(f->folder, name);
        assert_int_equal(apsm_write_volume(f->ctx, path, &v), APSM_OK);
        must_read(f, path, &back);
        expect_same(&v, &back, 1e-5, name);
        apsm_volume_free(&v);
        apsm_volume_free(&back);
    }
}

static apsm_status read_text(fixture *f, const char *name, const char *text, apsm_volume *v)
{
    const char *const path = scratch_path(f->folder, name);
    scratch_write(path, text, strlen(text));
    return apsm_read_volume(f->ctx, path, v);
}

#define NRRD_HEAD(space, directions, origin)                                                       \
    "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: " space                                   \
    "\nsizes: 2 2 2\nspace directions: " directions                                                \
    "\nkinds: domain domain domain\nencoding: ascii\nspace origin: " origin "\n\n"
#define VALUES "0 1 0 2\n0 0 0 1\n"

/* The same grid, told in RAS and in LPS.  The sheared directions of dependencies.md: lengths
 * .632 and .949. */
static void nrrd_space_is_turned_to_lps(void **state)
{
    fixture *const f = *state;
    apsm_volume lps = { 0 }, ras = { 0 };
    assert_int_equal(read_text(f, "lps.nrrd",
                               NRRD_HEAD("left-posterior-superior", "(1,0,0) (0,.6,.2) (0,-.3,.9)",
                                         "(10,20,30)") VALUES,
                               &lps),
                     APSM_OK);
    assert_int_equal(read_text(f, "ras.nrrd",
                               NRRD_HEAD("right-anterior-superior", "(-1,0,0) (0,-.6,.2) (0,.3,.9)",
                                         "(-10,-20,30)") VALUES,
                               &ras),
                     APSM_OK);
    expect_same(&lps, &ras, 1e-12, "ras");
    assert_true(fabs(lps.spacing[1] - sqrt(.4)) < 1e-12);
    assert_true(fabs(lps.spacing[2] - sqrt(.9)) < 1e-12);
    double M[16];
    apsm_volume_index_to_lps(&lps, M);
    const double wanted[16] = { 1, 0, 0, 10, 0, .6, -.3, 20, 0, .2, .9, 30, 0, 0, 0, 1 };
    for (int k = 0; k < 16; k++) assert_true(fabs(M[k] - wanted[k]) < 1e-12);
    assert_int_equal(lps.label[3], 2);
    apsm_volume_free(&lps);
    apsm_volume_free(&ras);
}

/* A hippocampus mask: the file says RAS, so the first two axes must come out negative. */
static void nifti_is_turned_to_lps(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    must_read(f, APSM_DATA "/hippocampus/hippocampus_001.nii.gz", &v);
    double M[16];
    apsm_volume_index_to_lps(&v, M);
    assert_true(M[0] == -1.0 && M[5] == -1.0 && M[10] == 1.0);
    size_t labelled = 0;
    for (size_t i = 0; i < v.n[0] * v.n[1] * v.n[2]; i++) {
        assert_in_range(v.label[i], 0, 2);
        labelled += v.label[i] != 0;
    }
    assert_in_range(labelled, 2380, 4400); /* ml of 1 mm voxels, by its PROVENANCE */
    apsm_volume_free(&v);
}

/* MetaImage headers with values that follow as text. */
#define MHA(dims, size, spacing, type, rest)                                                       \
    "ObjectType = Image\nNDims = " dims "\nBinaryData = False\nDimSize = " size                    \
    "\nElementSpacing = " spacing rest "\nElementType = " type "\nElementDataFile = LOCAL\n"

static void values_must_be_labels(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    const char *const head = MHA("3", "2 2 2", "1 1 1", "MET_FLOAT", "");
    char text[512];
    snprintf(text, sizeof text, "%s0 1 0 2 0 0 0 3\n", head);
    assert_int_equal(read_text(f, "f.mha", text, &v), APSM_OK);
    assert_int_equal(v.label[7], 3);
    apsm_volume_free(&v);
    snprintf(text, sizeof text, "%s0 1 0 2 0 0.5 0 0.25\n", head);
    assert_int_equal(read_text(f, "half.mha", text, &v), APSM_OK); /* a function, no labels */
    assert_null(v.label);
    const float wanted[8] = { 0, 1, 0, 2, 0, 0.5f, 0, 0.25f };
    assert_memory_equal(v.value, wanted, sizeof wanted);
    apsm_volume_free(&v);
    snprintf(text, sizeof text, "%s0 1 0 2 0 3e9 0 1\n", head);
    expect_failure(f->ctx, read_text(f, "big.mha", text, &v), APSM_ERR_FORMAT, "(1, 0, 1)",
                   "3e+09");
}

static void grids_must_be_proper(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    const char *const values = "0 1 0 2 0 0 0 3\n";
    const struct {
        const char *head, *word;
    } cases[] = {
        { MHA("2", "4 2", "1 1", "MET_UCHAR", ""), "flat" },
        { MHA("-3", "2 2 2", "1 1 1", "MET_UCHAR", ""), "-3 dimensions" },
        { MHA("4", "2 2 1 2", "1 1 1 1", "MET_UCHAR", ""), "3-D" },
        { MHA("3", "2 2 2", "1 0 1", "MET_UCHAR", ""), "spacing" },
        { MHA("3", "2 2 2", "1 nan 1", "MET_UCHAR", ""), "" },
        { MHA("3", "2 2 2", "1 -1 1", "MET_UCHAR", ""), "spacing" },
        { MHA("3", "2 2 2", "1 1 1", "MET_UCHAR", "\nTransformMatrix = 1 0 0 1 0 0 0 0 1"),
          "independent" },
        { MHA("3", "2 2 1", "1 1 1", "MET_UCHAR", "\nElementNumberOfChannels = 2"), "components" },
        { MHA("3", "200000 200000 200", "1 1 1", "MET_UCHAR", ""), "promises" },
        { MHA("3", "2000000000 2000000000 2000000000", "1 1 1", "MET_UCHAR", ""), "" },
        { MHA("3", "2 2 2", "1 1 1", "MET_UCHAR",
              "\nCompressedData = True\nCompressedDataSize = 9000000000000000000"),
          "promises" },
        { MHA("3", "2 0 2", "1 1 1", "MET_UCHAR", ""), "" },
        { "garbage", "not a MetaImage" },
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char text[512];
        snprintf(text, sizeof text, "%s%s", cases[k].head, values);
        expect_failure(f->ctx, read_text(f, "bad.mha", text, &v), APSM_ERR_FORMAT, cases[k].word,
                       "bad.mha");
        assert_null(v.label);
    }
    char text[512];
    snprintf(text, sizeof text, "%s%s", MHA("4", "2 2 2 1", "1 1 1 1", "MET_UCHAR", ""), values);
    assert_int_equal(read_text(f, "trailing.mha", text, &v), APSM_OK);
    apsm_volume_free(&v);
    expect_failure(f->ctx, read_text(f, "x.png", "x", &v), APSM_ERR_UNSUPPORTED, ".nrrd", "x.png");
    expect_failure(f->ctx, apsm_read_volume(f->ctx, scratch_path(f->folder, "none.nrrd"), &v),
                   APSM_ERR_IO, "none.nrrd", "");
}

static void truncated_files_are_refused(void **state)
{
    fixture *const f = *state;
    for (int k = 0; k < N_EXTENSIONS; k++) {
        apsm_volume v = make_volume(0.3, false), back = { 0 };
        char name[32];
        snprintf(name, sizeof name, "cut%s", extensions[k]);
        const char *const path = scratch_path(f->folder, name);
        assert_int_equal(apsm_write_volume(f->ctx, path, &v), APSM_OK);
        size_t size;
        char *const bytes = scratch_read(path, &size);
        for (size_t left = 0; left + 12 < size; left += 1 + size / 37) {
            scratch_write(path, bytes, left);
            expect_failure(f->ctx, apsm_read_volume(f->ctx, path, &back), APSM_ERR_FORMAT, name,
                           "");
        }
        free(bytes);
        apsm_volume_free(&v);
    }
}

/* The reader's decomposition of the matrix would never end on these. */
static void wild_nifti_grids_are_refused(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "wild.nii");
    const float wild[] = { NAN, INFINITY, -1.7e38f, 1e18f };
    const size_t places[] = { 80, 256, 268, 280, 296, 324 }; /* sizes, qform, sform */
    apsm_volume v = make_volume(0.3, false), back = { 0 };
    assert_int_equal(apsm_write_volume(f->ctx, path, &v), APSM_OK);
    size_t size;
    char *const bytes = scratch_read(path, &size);
    for (size_t p = 0; p < sizeof places / sizeof *places; p++)
        for (size_t w = 0; w < sizeof wild / sizeof *wild; w++) {
            float saved;
            memcpy(&saved, bytes + places[p], sizeof saved);
            memcpy(bytes + places[p], &wild[w], sizeof saved);
            scratch_write(path, bytes, size);
            memcpy(bytes + places[p], &saved, sizeof saved);
            expect_failure(f->ctx, apsm_read_volume(f->ctx, path, &back), APSM_ERR_FORMAT, "grid",
                           "wild.nii");
        }
    free(bytes);
    apsm_volume_free(&v);
}

/* A tilted gantry: the file says x = .5 i + .1 k (RAS), so x (LPS) changes by -.1 a slice; the
 * angle is atan(.1 / 3) = 1.9 degrees. */
static void sheared_nifti_grids_are_kept(void **state)
{
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "tilt.nii");
    apsm_volume v = make_volume(0, false), back = { 0 };
    assert_int_equal(apsm_write_volume(f->ctx, path, &v), APSM_OK);
    size_t size;
    char *const bytes = scratch_read(path, &size);
    for (int tilted = 0; tilted < 2; tilted++) {
        const float shift = tilted ? 0.1f : 0.0f; /* of slices 3 mm apart */
        memcpy(bytes + 280 + 8, &shift, sizeof shift);
        scratch_write(path, bytes, size);
        must_read(f, path, &back);
        double M[16];
        apsm_volume_index_to_lps(&back, M);
        assert_true(fabs(M[2] + (tilted ? 0.1 : 0.0)) < 1e-6);
        assert_true(fabs(M[10] - 3.0) < 1e-6 && fabs(M[0] - 0.5) < 1e-6);
        if (tilted)
            assert_non_null(strstr(back.notes, "sheared by 1.9 degrees"));
        else
            assert_null(back.notes);
        apsm_volume_free(&back);
    }
    free(bytes);
    apsm_volume_free(&v);
}

/* Voxels in a file of their own, as some programs write them; complete, cut, gone. */
static void detached_voxels_are_read(void **state)
{
    fixture *const f = *state;
    apsm_volume v = { 0 };
    const char *const head = "ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = 2 2 2\n"
                             "ElementSpacing = 1 1 1\nElementType = MET_UCHAR\n"
                             "ElementDataFile = d.raw\n";
    const char *const nrrd = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nspacings: 1 1 1\n"
                             "encoding: raw\ndata file: d.raw\n";
    const char *const names[] = { "d.mhd", "d.nhdr" };
    for (int k = 0; k < 2; k++) {
        scratch_write(scratch_path(f->folder, "d.raw"), "\0\1\2\3\4\5\6\7", 8);
        if (read_text(f, names[k], k ? nrrd : head, &v) != APSM_OK)
            fail_msg("%s", apsm_error_text(f->ctx));
        for (int i = 0; i < 8; i++) assert_int_equal(v.label[i], i);
        apsm_volume_free(&v);
        scratch_write(scratch_path(f->folder, "d.raw"), "\0\1\2", 3);
        expect_failure(f->ctx, read_text(f, names[k], k ? nrrd : head, &v), APSM_ERR_FORMAT,
                       names[k], "");
        unlink(scratch_path(f->folder, "d.raw"));
        expect_failure(f->ctx, read_text(f, names[k], k ? nrrd : head, &v), APSM_ERR_FORMAT,
                       names[k], "");
    }
}

/* Many reads at once, good and bad, give what each would give alone. */
enum { JOBS = 64 };
static apsm_status read_job(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    fixture *const f = user;
    apsm_volume v = { 0 }, wanted = make_volume(0.7 * (double)(i % 4), false);
    char path[2 * SCRATCH_LENGTH];
    snprintf(path, sizeof path, "%s/t%zu%s", f->folder, i % 4, extensions[i / 4 % N_EXTENSIONS]);
    APSM_TRY(apsm_read_volume(ctx, path, &v));
    const bool same = memcmp(v.label, wanted.label, 60 * sizeof *v.label) == 0 &&
                      fabs(v.direction[1] - wanted.direction[1]) < 1e-5;
    apsm_volume_free(&v);
    apsm_volume_free(&wanted);
    snprintf(path, sizeof path, "%s/none%zu.nrrd", f->folder, i);
    const bool failed = apsm_read_volume(ctx, path, &v) == APSM_ERR_IO;
    const bool named = strstr(apsm_error_text(ctx), strrchr(path, '/')) != NULL;
    return same && failed && named
               ? APSM_OK
               : apsm_fail(ctx, APSM_ERR_STATE, "job %zu: %d %d %d", i, same, failed, named);
}

static void threads_do_not_disturb_each_other(void **state)
{
    fixture *const f = *state;
    for (int pose = 0; pose < 4; pose++)
        for (int k = 0; k < N_EXTENSIONS; k++) {
            apsm_volume v = make_volume(0.7 * pose, false);
            char name[32];
            snprintf(name, sizeof name, "t%d%s", pose, extensions[k]);
            assert_int_equal(apsm_write_volume(f->ctx, scratch_path(f->folder, name), &v), APSM_OK);
            apsm_volume_free(&v);
        }
    apsm_context_set_threads(f->ctx, 8);
    if (apsm_parallel_for(f->ctx, JOBS, read_job, f, NULL) != APSM_OK)
        fail_msg("%s", apsm_error_text(f->ctx));
}

/* One voxel of 60 is labelled.  What a bound takes of the others counts, wherever they lie. */
static void bounds_see_the_whole_image(void **state)
{
    static const struct {
        const char *text;
        size_t taken;
    } bounds[] = { { "<1", 59 }, { "<0.5", 59 }, { ">-1", 60 }, { ">0", 1 }, { ">0.5", 1 } };
    fixture *const f = *state;
    apsm_volume v = make_volume(0.3, false);
    for (size_t i = 0; i < 60; i++) v.label[i] = i == 0;
    const char *const path = scratch_path(f->folder, "one.nrrd");
    assert_int_equal(apsm_write_volume(f->ctx, path, &v), APSM_OK);
    for (size_t k = 0; k < sizeof bounds / sizeof *bounds; k++) {
        const apsm_input_case one = { .path = (char *)path, .kind = APSM_INPUT_VOLUME };
        apsm_labels labels;
        apsm_input_shape shape;
        size_t taken = 0;
        assert_int_equal(apsm_labels_parse(f->ctx, bounds[k].text, &labels), APSM_OK);
        assert_int_equal(apsm_input_read(f->ctx, &one, &labels, &shape), APSM_OK);
        const size_t *const n = shape.volume.n;
        for (size_t i = 0; i < n[0] * n[1] * n[2]; i++)
            taken += volume_label(&shape.volume, i) != 0;
        assert_int_equal(taken, bounds[k].taken);
        apsm_input_shape_free(&shape);
    }
    apsm_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(oriented_grids_come_back, setup, teardown),
        cmocka_unit_test(wide_labels_come_back),
        cmocka_unit_test(nrrd_space_is_turned_to_lps),
        cmocka_unit_test(nifti_is_turned_to_lps),
        cmocka_unit_test(values_must_be_labels),
        cmocka_unit_test(grids_must_be_proper),
        cmocka_unit_test(truncated_files_are_refused),
        cmocka_unit_test(wild_nifti_grids_are_refused),
        cmocka_unit_test(sheared_nifti_grids_are_kept),
        cmocka_unit_test(detached_voxels_are_read),
        cmocka_unit_test(bounds_see_the_whole_image),
        cmocka_unit_test(threads_do_not_disturb_each_other),
    };
    return cmocka_run_group_tests_name("volume_io", tests, setup, teardown);
}
