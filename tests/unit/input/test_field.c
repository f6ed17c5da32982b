/* Labels by name and by bound, and images that are functions: balls of known radius. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "geometry/topology.h"
#include "input/input.h"
#include "scratch.h"

enum { N = 32, VOXELS = N * N * N };

static apsm_context *ctx;
static char logged[1024];

static void keep_log(void *user, apsm_log_level level, const char *text)
{
    (void)user, (void)level;
    snprintf(logged, sizeof logged, "%s", text);
}

static int setup(void **state)
{
    (void)state;
    ctx = apsm_context_new();
    apsm_context_set_log(ctx, keep_log, NULL);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    apsm_context_free(ctx);
    return 0;
}

/* sign * (distance to a ball of radius 10 mm about (16.5, 17.5, 15) mm), or a probability that is
 * .5 at its surface; voxels of 1 x 1 x .97 mm on a grid with a mirror image of the axes. */
static apsm_volume ball(double sign, bool probability)
{
    apsm_volume v = { .n = { N, N, N },
                      .spacing = { 1, 1, 0.97 },
                      .direction = { -1, 0, 0, 0, 1, 0, 0, 0, 1 },
                      .value = malloc(VOXELS * sizeof *v.value) };
    for (size_t i = 0; i < VOXELS; i++) {
        const double x = -(double)(i % N) + 16.5, y = (double)(i / N % N) - 17.5,
                     z = 0.97 * (double)(i / N / N) - 15.0;
        const double d = sqrt(x * x + y * y + z * z) - 10.0;
        v.value[i] = (float)(probability ? 1.0 / (1.0 + exp(d)) : sign * d);
    }
    return v;
}

static void expect_ball(const apsm_mesh *m, double radius)
{
    const double pi = acos(-1.0), wanted = 4.0 / 3.0 * pi * radius * radius * radius;
    apsm_mesh_defects d;
    assert_int_equal(apsm_mesh_inspect(m, &d), APSM_OK);
    assert_true(apsm_mesh_is_closed_manifold(&d));
    /* outward, though the grid is mirrored */
    if (!(fabs(apsm_mesh_volume(m) / wanted - 1.0) < 0.015))
        fail_msg("volume %g, not %g", apsm_mesh_volume(m), wanted);
    double lo[3], hi[3];
    apsm_mesh_bounds(m, lo, hi);
    const double centre[3] = { -16.5, 17.5, 15 };
    for (int c = 0; c < 3; c++) assert_true(fabs(0.5 * (lo[c] + hi[c]) - centre[c]) < 0.02);
}

static void distances_tell_their_inside(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        const apsm_labels none = { 0 };
        apsm_volume v = ball(sign, false);
        apsm_mesh m;
        if (apsm_field_surface(ctx, "d.nrrd", &none, &v, &m) != APSM_OK)
            fail_msg("%s", apsm_error_text(ctx));
        expect_ball(&m, 10.0);
        assert_non_null(strstr(v.notes, sign > 0 ? "negative inside" : "positive inside"));
        apsm_mesh_free(&m);
        apsm_volume_free(&v);
    }
}

static void bounds_choose_the_surface(void **state)
{
    (void)state;
    const struct {
        const char *text;
        bool probability;
        double radius;
    } cases[] = { { ">0.5", true, 10 }, { "<2", false, 12 }, { "<-3", false, 7 } };
    for (size_t k = 0; k < 3; k++) {
        apsm_labels l;
        apsm_volume v = ball(1, cases[k].probability);
        apsm_mesh m;
        assert_int_equal(apsm_labels_parse(ctx, cases[k].text, &l), APSM_OK);
        assert_int_equal(apsm_field_surface(ctx, "p.nrrd", &l, &v, &m), APSM_OK);
        expect_ball(&m, cases[k].radius);
        apsm_mesh_free(&m);
        apsm_volume_free(&v);
    }
}

static void other_functions_are_refused(void **state)
{
    (void)state;
    const apsm_labels none = { 0 };
    apsm_labels high;
    apsm_volume v = ball(1, true);
    apsm_mesh m;
    expect_failure(ctx, apsm_field_surface(ctx, "p.nrrd", &none, &v, &m), APSM_ERR_FORMAT,
                   "probability", "--label");
    assert_int_equal(apsm_labels_parse(ctx, ">7", &high), APSM_OK);
    expect_failure(ctx, apsm_field_surface(ctx, "p.nrrd", &high, &v, &m), APSM_ERR_GEOMETRY,
                   "above 7", "p.nrrd");
    apsm_volume_free(&v);
    v = ball(1, false);
    for (size_t i = 0; i < VOXELS; i++) v.value[i] *= 3.0f; /* steeper than a distance can be */
    expect_failure(ctx, apsm_field_surface(ctx, "i.nrrd", &none, &v, &m), APSM_ERR_FORMAT,
                   "neither labels nor distances", "i.nrrd");
    assert_null(m.V);
    apsm_volume_free(&v);
}

/* Two layers of four voxels; label 1 is the talus in one and the tibia in the other. */
static apsm_volume layered(void)
{
    static const int32_t label[8] = { 1, 0, 2, 0, 0, 1, 1, 0 };
    static const char *const names[3] = { "talus", "fibula", "tibia" };
    apsm_volume v = { .n = { 4, 1, 1 }, .layers = 2, .segments = 3 };
    v.label = malloc(sizeof label);
    memcpy(v.label, label, sizeof label);
    v.segment = calloc(3, sizeof *v.segment);
    for (size_t k = 0; k < 3; k++)
        v.segment[k] = (apsm_segment){ strdup(names[k]), k == 1 ? 2 : 1, k == 2 };
    return v;
}

static void segments_are_taken_by_name(void **state)
{
    (void)state;
    const struct {
        const char *text;
        int32_t mask[4];
    } cases[] = { { "talus", { 1, 0, 0, 0 } },    { "TIBIA", { 0, 1, 1, 0 } },
                  { "2", { 0, 0, 1, 0 } },        { "talus,tibia", { 1, 1, 1, 0 } },
                  { "fibula,9", { 0, 0, 1, 0 } }, { "all", { 1, 1, 1, 0 } } };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        apsm_volume v = layered();
        apsm_labels l;
        assert_int_equal(apsm_labels_parse(ctx, cases[k].text, &l), APSM_OK);
        if (apsm_label_union(ctx, "s", &l, &v) != APSM_OK) fail_msg("%s", apsm_error_text(ctx));
        assert_memory_equal(v.label, cases[k].mask, sizeof cases[k].mask);
        assert_int_equal(v.layers, 1);
        apsm_labels_free(&l);
        apsm_volume_free(&v);
    }
}

static void unclear_segments_are_refused(void **state)
{
    (void)state;
    const char *const texts[] = { "1", "", "femur" }, *const words[] = { "choose by name",
                                                                         "1 (talus)", "none of" };
    for (int k = 0; k < 3; k++) {
        apsm_volume v = layered();
        apsm_labels l;
        assert_int_equal(apsm_labels_parse(ctx, texts[k], &l), APSM_OK);
        expect_failure(ctx, apsm_label_union(ctx, "s", &l, &v), APSM_ERR_GEOMETRY, words[k],
                       "--label");
        apsm_labels_free(&l);
        apsm_volume_free(&v);
    }
}

static void names_are_compared_over_the_cohort(void **state)
{
    (void)state;
    const char *const names[] = { "a", "b", "c" };
    const char *const same[] = { "1 talus", NULL, "1 talus" };
    const char *const other[] = { "1 talus", NULL, "1 tibia" };
    logged[0] = '\0';
    apsm_labels_compare(ctx, 3, names, same);
    assert_string_equal(logged, "");
    apsm_labels_compare(ctx, 3, names, other);
    assert_non_null(strstr(logged, "a has 1 talus, c has 1 tibia"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(distances_tell_their_inside),
        cmocka_unit_test(bounds_choose_the_surface),
        cmocka_unit_test(other_functions_are_refused),
        cmocka_unit_test(segments_are_taken_by_name),
        cmocka_unit_test(unclear_segments_are_refused),
        cmocka_unit_test(names_are_compared_over_the_cohort),
    };
    return cmocka_run_group_tests_name("field", tests, setup, teardown);
}
