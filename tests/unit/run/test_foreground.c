/* Of an image that is empty around its labels only a part is held: the same shape comes out, and
 * borders are the image's, not the part's. */
#include "cmocka_all.h"

#include <math.h>

#include "apsm/formats.h"
#include "formats/image.h"
#include "groom/groom.h"
#include "input/input.h"
#include "scratch_fixture.h"

enum { NX = 30, NY = 26, NZ = 22, VOXELS = NX * NY * NZ };

/* A ball of label 3 about (x, 13, 11), on a tilted grid of voxels that no rounding is exact for. */
static apsm_volume ball(int x, int32_t label[VOXELS])
{
    const apsm_volume v = { .n = { NX, NY, NZ },
                            .origin = { 12.345, -67.8, 9.1 },
                            .spacing = { 0.7, 0.71, 1.3 },
                            .direction = { 0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1 },
                            .label = label };
    for (int i = 0; i < VOXELS; i++) {
        const int a = i % NX - x, b = i / NX % NY - 13, c = i / (NX * NY) - 11;
        label[i] = a * a + b * b + 3 * c * c < 60 ? 3 : 0;
    }
    return v;
}

static void must(const fixture *f, apsm_status status)
{
    if (status != APSM_OK) fail_msg("%s", apsm_error_text(f->ctx));
}

static void expect_part(const apsm_volume *part, const apsm_volume *whole)
{
    for (size_t k = 0; k < whole->n[2]; k++)
        for (size_t j = 0; j < whole->n[1]; j++)
            for (size_t i = 0; i < whole->n[0]; i++) {
                const size_t p[3] = { i - part->first[0], j - part->first[1],
                                      k - part->first[2] }; /* below: too large */
                const bool held = p[0] < part->n[0] && p[1] < part->n[1] && p[2] < part->n[2];
                const int32_t wanted = whole->label[i + whole->n[0] * (j + whole->n[1] * k)];
                const size_t at = p[0] + part->n[0] * (p[1] + part->n[1] * p[2]);
                const int32_t got = !held ? 0 : part->small ? part->small[at] : part->label[at];
                assert_int_equal(got, wanted);
            }
}

/* Inside; and at the image's border, of which the surface says so. */
static void parts_make_the_same_shape(void **state)
{
    static const struct {
        int x;
        size_t first, n;
        unsigned border;
    } cases[] = { { 14, 6, 17, 0 }, { 4, 0, 13, 1 }, { 27, 19, 11, 2 } };
    fixture *const f = *state;
    const char *const path = scratch_path(f->folder, "b.nrrd");
    int32_t label[VOXELS];
    const apsm_groom_options opt = apsm_groom_defaults();
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const apsm_volume given = ball(cases[k].x, label);
        apsm_volume whole, part;
        apsm_mesh a, b;
        apsm_groom_report ra, rb;
        must(f, apsm_write_volume(f->ctx, path, &given));
        must(f, apsm_read_volume(f->ctx, path, &whole));
        must(f, volume_read_foreground(f->ctx, path, &part));
        assert_int_equal(whole.whole[0], 0);
        assert_true(part.whole[0] == NX && part.whole[1] == NY && part.whole[2] == NZ);
        assert_int_equal(part.first[0], cases[k].first);
        assert_int_equal(part.n[0], cases[k].n);
        expect_part(&part, &whole);
        assert_true(part.small && !part.label); /* bytes of the file, a quarter of the memory */
        must(f, apsm_groom_segmentation(f->ctx, "whole", &whole, &opt, &a, &ra));
        must(f, groom_taken_segmentation(f->ctx, "part", &part, &opt, &b, &rb));
        assert_null(part.label);
        assert_null(part.small);
        assert_int_equal(ra.border, cases[k].border);
        assert_int_equal(rb.border, cases[k].border);
        assert_int_equal(a.nv, b.nv);
        assert_memory_equal(a.V, b.V, 3 * a.nv * sizeof *a.V);
        assert_memory_equal(ra.border_normal, rb.border_normal, sizeof ra.border_normal);
        apsm_mesh_free(&a);
        apsm_mesh_free(&b);
        apsm_volume_free(&whole);
        apsm_volume_free(&part);
    }
}

static void read_text(const fixture *f, const char *type, const char *values, apsm_volume *v)
{
    const char *const path = scratch_path(f->folder, "t.nrrd");
    char text[512];
    snprintf(text, sizeof text,
             "NRRD0004\ntype: %s\ndimension: 3\nsizes: 3 3 3\nspacings: 1 1 1\nencoding: "
             "ascii\n\n%s",
             type, values);
    scratch_write(path, text, strlen(text));
    must(f, volume_read_foreground(f->ctx, path, v));
}

/* Nothing to leave out, no labels, and values between them: all is held. */
static void what_has_no_empty_rim_is_held_whole(void **state)
{
    static const char empty[] = "0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0",
                      half[] = "0 0 0 0 0 0 0 0 0 0 0 0 0 .5 0 0 0 0 0 0 0 0 0 0 0 0 0";
    fixture *const f = *state;
    apsm_volume v;
    read_text(f, "uint8", empty, &v);
    assert_true(v.label && v.whole[0] == 0 && v.n[0] == 3 && v.n[2] == 3);
    apsm_volume_free(&v);
    read_text(f, "float", half, &v);
    assert_true(v.value && !v.label && v.whole[0] == 0 && v.n[0] == 3 && v.first[0] == 0);
    assert_true(v.value[13] == .5f && v.value[0] == 0.0f);
    apsm_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parts_make_the_same_shape),
        cmocka_unit_test(what_has_no_empty_rim_is_held_whole),
    };
    return cmocka_run_group_tests_name("foreground", tests, setup, teardown);
}
