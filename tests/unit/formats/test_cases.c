/* Files that people have brought, small.  What is expected was worked out apart: voxels counted and
 * headers read with Python's struct and zlib, the rest by hand from the numbers in the headers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <time.h>

#include "apsm/formats.h"
#include "context_fixture.h"
#include "scratch.h"

#define CASES APSM_TEST_DATA "/cases/"

static apsm_volume must_read(const char *path)
{
    apsm_volume v;
    if (apsm_read_volume(ctx, path, &v) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
    return v;
}

static void expect_grid(const apsm_volume *v, const double step[3], const double origin[3])
{
    double M[16];
    apsm_volume_index_to_lps(v, M);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            const double wanted = r == c ? step[r] : 0.0;
            if (!(fabs(M[4 * r + c] - wanted) < 1e-6))
                fail_msg("M[%d,%d] = %g, not %g", r, c, M[4 * r + c], wanted);
        }
    for (int r = 0; r < 3; r++)
        if (!(fabs(M[4 * r + 3] - origin[r]) < 1e-4))
            fail_msg("origin[%d] = %g, not %g", r, M[4 * r + 3], origin[r]);
}

static void expect_note(const apsm_volume *v, const char *word)
{
    if (!word && v->notes) fail_msg("unexpected note: %s", v->notes);
    if (word && (!v->notes || !strstr(v->notes, word)))
        fail_msg("'%s' is not in: %s", word, v->notes ? v->notes : "(nothing)");
}

/* The four files hold the same voxels: 50249, whose indices sum up to these. */
static void headers_of_nifti_are_read_by_the_rule(void **state)
{
    (void)state;
    const struct {
        const char *file, *note;
        double step[3], origin[3];
    } cases[] = {
        { "a_both", NULL, { .8, .8, 1.2 }, { -35.42733, -66.05967, -90.02802 } },
        { "f_q0_s0", "neither sform nor qform", { -.8, -.8, 1.2 }, { 0, 0, 0 } },
        { "h_q1_pixdim_vs_sform",
          "voxels of 0.768 mm3, its voxel sizes of 1",
          { .8, .8, 1.2 },
          { -35.42733, -66.05967, -90.02802 } },
        { "m_hand_q1_s2", "mirror images", { -.8, .8, 1.2 }, { 0, 0, 0 } },
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char path[512];
        snprintf(path, sizeof path, CASES "qsform/%s.nii.gz", cases[k].file);
        apsm_volume v = must_read(path);
        size_t count = 0, sum[3] = { 0, 0, 0 };
        assert_true(v.n[0] == 68 && v.n[1] == 80 && v.n[2] == 41);
        for (size_t i = 0; i < 68 * 80 * 41; i++)
            if (v.label[i]) count++, sum[0] += i % 68, sum[1] += i / 68 % 80, sum[2] += i / 5440;
        assert_int_equal(count, 50249);
        assert_true(sum[0] == 1777504 && sum[1] == 2017052 && sum[2] == 1017817);
        expect_grid(&v, cases[k].step, cases[k].origin);
        expect_note(&v, cases[k].note);
        apsm_volume_free(&v);
    }
}

static void small_voxels_are_read(void **state)
{
    (void)state;
    apsm_volume v = must_read(CASES "smallvox/nibabel_default_0.02mm.nii.gz");
    size_t count = 0;
    for (size_t i = 0; i < 56 * 66 * 48; i++) count += v.label[i] != 0;
    assert_int_equal(count, 38577);
    expect_grid(&v, (double[]){ .02, .02, .02 }, (double[]){ 0, 0, 0 });
    expect_note(&v, NULL);
    apsm_volume_free(&v);
}

static void segments_have_names(void **state)
{
    (void)state;
    const struct {
        const char *file, *first, *second;
    } cases[] = { { "p01", "talus", "calcaneus" }, { "p09", "calcaneus", "talus" } };
    for (int k = 0; k < 2; k++) {
        char path[512];
        snprintf(path, sizeof path, CASES "segnrrd/%s.seg.nrrd", cases[k].file);
        apsm_volume v = must_read(path);
        assert_int_equal(v.segments, 2);
        for (int i = 0; i < 2; i++)
            assert_string_equal(v.segment[i].name,
                                v.segment[i].label == 1 ? cases[k].first : cases[k].second);
        apsm_volume_free(&v);
    }
}

static size_t count_label(const apsm_volume *v, size_t layer, int32_t label)
{
    const size_t voxels = v->n[0] * v->n[1] * v->n[2];
    size_t n = 0;
    for (size_t i = 0; i < voxels; i++) n += v->label[layer * voxels + i] == label;
    return n;
}

/* Two segments that overlap: 20 and 24 frames 2 mm apart, from z = -88.428017; and one whose
 * twentieth slice (z = -64.428017) was left out. */
static void dicom_segmentations_are_read(void **state)
{
    (void)state;
    apsm_volume v;
    if (apsm_read_dicom(ctx, CASES "seg/f_seg_two", &v) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    assert_true(v.n[0] == 56 && v.n[1] == 66 && v.n[2] == 24 && v.layers == 2);
    expect_grid(&v, (double[]){ 1, 1, 2 }, (double[]){ -36.027338, -66.659668, -88.428017 });
    assert_int_equal(v.segments, 2);
    assert_string_equal(v.segment[0].name, "organ1");
    assert_int_equal(count_label(&v, v.segment[0].layer, 1), 19259);
    assert_int_equal(count_label(&v, v.segment[1].layer, 2), 3456);
    apsm_volume_free(&v);
    if (apsm_read_dicom(ctx, CASES "seg/h_seg_gap", &v) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    assert_true(v.n[2] == 20 && v.layers == 1);
    expect_grid(&v, (double[]){ 1, 1, 2 }, (double[]){ -36.027338, -66.659668, -84.428017 });
    assert_int_equal(count_label(&v, 0, 1), 17827);
    for (size_t i = 0; i < 56 * 66; i++) assert_int_equal(v.label[10 * 56 * 66 + i], 0);
    apsm_volume_free(&v);
}

/* The same solid written by VTK in many ways: its points are (1/3 or -1, 0 or 1, 0 or 1). */
static void vtp_is_read_however_it_is_written(void **state)
{
    (void)state;
    const char *const files[] = { "m0_c0_h0_b0", "m1_c0_h0_b1", "m1_c1_h1_b0", "m2_c0_h0_b0",
                                  "m2_c1_h0_b1", "m3_c0_h1_b1", "m3_c1_h0_b0" };
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        char path[512];
        apsm_mesh m;
        snprintf(path, sizeof path, CASES "vtp/%s.vtp", files[k]);
        if (apsm_read_mesh(ctx, path, &m) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
        assert_true(m.nv == 8 && m.nf == 12);
        for (size_t i = 0; i < 8; i++)
            assert_true(m.V[3 * i] == (i & 1 ? 1.0 / 3 : -1.0) && m.V[3 * i + 1] == (i >> 1 & 1) &&
                        m.V[3 * i + 2] == (double)(i >> 2));
        assert_true(fabs(fabs(apsm_mesh_volume(&m)) - 4.0 / 3) < 1e-12);
        apsm_mesh_free(&m);
    }
    apsm_mesh m;
    expect_failure(ctx, apsm_read_mesh(ctx, CASES "vtp/m3_c2_h0_b0.vtp", &m), APSM_ERR_UNSUPPORTED,
                   "LZ4", "m3_c2_h0_b0.vtp");
}

static void damaged_files_end_in_one_line(void **state)
{
    (void)state;
    const struct {
        const char *file, *word;
    } cases[] = { { "l1000.nrrd", "header" },      { "min.mha", "dimensions" },
                  { "nd.mha", "dimensions" },      { "t.mha", "dimensions" },
                  { "big.nhdr", "promises" },      { "z.mhd", "pipe or device" },
                  { "zg.nhdr", "pipe or device" }, { "zz.nhdr", "pipe or device" },
                  { "segv.vtp", "offsets" },       { "mem.vtp", "no faces" } };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char path[512];
        apsm_volume v = { 0 };
        apsm_mesh m = { 0 };
        const clock_t start = clock();
        snprintf(path, sizeof path, CASES "damaged/%s", cases[k].file);
        const bool is_mesh = strstr(path, ".vtp") != NULL;
        const apsm_status status =
            is_mesh ? apsm_read_mesh(ctx, path, &m) : apsm_read_volume(ctx, path, &v);
        expect_failure(ctx, status, APSM_ERR_FORMAT, cases[k].word, cases[k].file);
        assert_true(!m.V && !v.label && clock() - start < CLOCKS_PER_SEC);
        assert_null(strstr(apsm_error_text(ctx), ".cxx"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(headers_of_nifti_are_read_by_the_rule),
        cmocka_unit_test(small_voxels_are_read),
        cmocka_unit_test(segments_have_names),
        cmocka_unit_test(dicom_segmentations_are_read),
        cmocka_unit_test(vtp_is_read_however_it_is_written),
        cmocka_unit_test(damaged_files_end_in_one_line),
    };
    return cmocka_run_group_tests_name("cases", tests, set_up, tear_down);
}
