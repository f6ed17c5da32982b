/* Shapes cut off at different places: where all of them still are, and cropping to it. */
#include "align/common_ends.h"
#include "align_shapes.h"
#include "geometry/topology.h"

enum { SHAPES = 6 };

/* A cohort of one bone in random poses, each larger than the one before by `size`; shape i is cut
 * off in the plane x = at[i], shape 2 in x + tilt y = at[2]. */
typedef struct cohort {
    apsm_mesh mesh[SHAPES];
    const apsm_mesh *list[SHAPES];
    double pose[SHAPES][16]; /* bone to shape */
    apsm_alignment alignment;
} cohort;

static void make_cohort(cohort *c, const double at[SHAPES], double tilt, double size)
{
    apsm_context *ctx = apsm_context_new();
    const apsm_align_options opt = { .align = APSM_ALIGN_RIGID,
                                     .mirror_check = APSM_MIRROR_OFF,
                                     .template_index = 1,
                                     .points = 400 };
    for (size_t i = 0; i < SHAPES; i++) {
        c->mesh[i] = align_shape(5, 60, 20, 14, 0.2, 0.5);
        for (size_t v = 0; v < c->mesh[i].nv; v++) {
            double *x = c->mesh[i].V + 3 * v;
            x[0] = fmin(x[0], at[i] - (i == 2 ? tilt * x[1] : 0));
        }
        align_random_pose(i, 100.0, c->pose[i]);
        align_scale_pose(1.0 + size * (double)i, c->pose[i]);
        apsm_mesh_transform(&c->mesh[i], c->pose[i]);
        c->list[i] = &c->mesh[i];
    }
    assert_int_equal(apsm_align_cohort(ctx, SHAPES, c->list, NULL, &opt, &c->alignment), APSM_OK);
    apsm_context_free(ctx);
}

static void free_cohort(cohort *c)
{
    apsm_alignment_free(&c->alignment);
    for (size_t i = 0; i < SHAPES; i++) apsm_mesh_free(&c->mesh[i]);
}

/* Height of the end's plane in the bone, by shape i: where it meets the bone's axis. */
static double height_in_bone(const cohort *c, size_t i, const apsm_common_end *end, double *cosine)
{
    const double axis[3] = { 1, 0, 0 }, origin[3] = { 0 };
    double M[16], n[3], o[3], along = 0, d = end->plane[3];
    apsm_affine_multiply(c->alignment.sized + 16 * i, c->pose[i], M);
    apsm_affine_apply_normals(M, 1, axis, n);
    apsm_affine_apply(M, 1, origin, o);
    for (size_t k = 0; k < 3; k++) along += n[k] * end->plane[k], d -= o[k] * end->plane[k];
    *cosine = along;
    return d / (along * cbrt(apsm_affine_det(M)));
}

/* Of six bones, up to 30 % larger, four are cut; the shortest at 20, askew by 11 degrees, so that
 * its cut face begins at 17. */
static void common_end_is_below_the_shortest(void **state)
{
    (void)state;
    const double at[SHAPES] = { 50, 100, 20, 35, 100, 42 };
    cohort c;
    apsm_common_ends ends;
    make_cohort(&c, at, 0.2, 0.06);
    apsm_find_common_ends(SHAPES, c.list, &c.alignment, 2, &ends);
    assert_int_equal(ends.n, 1);
    assert_int_equal(ends.end[0].cut, 4);
    assert_int_equal(ends.end[0].shortest, 2);
    for (size_t i = 0; i < SHAPES; i++) {
        double cosine;
        const double x = height_in_bone(&c, i, &ends.end[0], &cosine);
        if (!(x > 14 && x < 17 && cosine > 0.995))
            fail_msg("shape %zu: plane at %g, cosine %g", i, x, cosine);
    }
    /* beyond 20 of -60..81 is a quarter to a third of the whole ones' surface */
    assert_true(ends.most_loss > 0.25 && ends.most_loss < 0.5);
    assert_true(ends.loser == 1 || ends.loser == 4);
    assert_true(ends.mean_loss > 0.1 && ends.mean_loss < ends.most_loss);
    /* Without the shortest: as if it had never been there. */
    const double rest[SHAPES] = { 50, 100, 100, 35, 100, 42 };
    const double foretold = ends.next_loss, level = ends.end[0].next;
    free_cohort(&c);
    make_cohort(&c, rest, 0.2, 0.06);
    apsm_find_common_ends(SHAPES, c.list, &c.alignment, 2, &ends);
    assert_true(fabs(ends.end[0].plane[3] - level) < 1.0);
    assert_true(fabs(ends.mean_loss - foretold) < 0.03 && foretold > 0.02);
    free_cohort(&c);
}

/* Too few, none, or all at one place: nothing to crop. */
static void like_ends_are_let_be(void **state)
{
    (void)state;
    const double few[SHAPES] = { 100, 100, 30, 100, 100, 100 };
    const double none[SHAPES] = { 100, 100, 100, 100, 100, 100 };
    const double alike[SHAPES] = { 30, 30.5, 31, 30, 30, 30 };
    const double *const at[] = { few, none, alike };
    for (size_t k = 0; k < 3; k++) {
        cohort c;
        apsm_common_ends ends;
        make_cohort(&c, at[k], 0, 0);
        apsm_find_common_ends(SHAPES, c.list, &c.alignment, 2, &ends);
        assert_int_equal(ends.n, 0);
        apsm_find_common_ends(SHAPES, c.list, &c.alignment, 1, &ends);
        assert_int_equal(ends.n, k == 0);
        free_cohort(&c);
    }
}

static double shortest_edge(const apsm_mesh *mesh)
{
    double least = INFINITY;
    for (size_t h = 0; h < 3 * mesh->nf; h++) {
        const double *a = mesh->V + 3 * mesh->F[h],
                     *b = mesh->V + 3 * mesh->F[h % 3 == 2 ? h - 2 : h + 1];
        double d2 = 0;
        for (size_t c = 0; c < 3; c++) d2 += (a[c] - b[c]) * (a[c] - b[c]);
        least = fmin(least, sqrt(d2));
    }
    return least;
}

/* Planes through a bone, some of them through vertices: what is left is the bone below, closed. */
static void cropped_is_closed_and_the_rest_is_as_it_was(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    const apsm_mesh bone = align_shape(4, 60, 20, 14, 0.2, 0.5);
    apsm_groom_options opt = apsm_groom_defaults();
    for (size_t k = 0; k < 24; k++) {
        const double *at = bone.V + 3 * (k * 61 % bone.nv);
        double M[16], plane[2][4] = { { 0 }, { -1, 0, 0, 45 } };
        apsm_mesh cropped, open;
        apsm_mesh_defects defects;
        align_random_pose(k, 1.0, M);
        for (size_t c = 0; c < 3; c++) plane[0][c] = k % 4 ? M[c] : c == 0;
        for (size_t c = 0; c < 3; c++) plane[0][3] += plane[0][c] * at[c] * (k % 2 ? 0.5 : 1.0);
        plane[0][3] = fmax(plane[0][3], 2.0);
        opt.remesh = k % 3 == 0;
        opt.remesh_options.faces = 2000;
        assert_int_equal(apsm_mesh_clip(&bone, plane[0], &open), APSM_OK);
        assert_int_equal(
            apsm_crop_mesh(ctx, "bone", &bone, 2, (const double(*)[4])plane, &opt, &cropped),
            APSM_OK);
        assert_int_equal(apsm_mesh_inspect(&cropped, &defects), APSM_OK);
        assert_true(apsm_mesh_is_closed_manifold(&defects));
        assert_int_equal(defects.components, 1);
        for (size_t v = 0; v < cropped.nv; v++)
            for (size_t p = 0; p < 2; p++) {
                double z = -plane[p][3];
                for (size_t c = 0; c < 3; c++) z += plane[p][c] * cropped.V[3 * v + c];
                if (z > 0.5) fail_msg("plane %zu of %zu: vertex %g mm beyond", p, k, z);
            }
        assert_true(apsm_mesh_volume(&cropped) > 0.2 * apsm_mesh_volume(&bone));
        assert_true(shortest_edge(&open) > 0.005 * apsm_mesh_mean_edge(&bone));
        assert_true(apsm_mesh_area(&open) <= apsm_mesh_area(&bone) * (1 + 1e-12));
        apsm_mesh_free(&cropped);
        apsm_mesh_free(&open);
    }
    apsm_mesh free_me = bone;
    apsm_mesh_free(&free_me);
    apsm_context_free(ctx);
}

/* The two halves of a clipped bone are the whole, and the volume of a ball's half is right. */
static void halves_make_the_whole(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_mesh ball = shape_icosphere(4);
    const double area = apsm_mesh_area(&ball), volume = apsm_mesh_volume(&ball);
    double sums[2] = { 0 };
    apsm_groom_options opt = apsm_groom_defaults();
    opt.remesh = false;
    for (int side = -1; side <= 1; side += 2) {
        const double plane[1][4] = { { 0.6 * side, 0, 0.8 * side, 0.1 * side } };
        apsm_mesh open, cropped;
        assert_int_equal(apsm_mesh_clip(&ball, plane[0], &open), APSM_OK);
        assert_int_equal(apsm_crop_mesh(ctx, "ball", &ball, 1, plane, &opt, &cropped), APSM_OK);
        sums[0] += apsm_mesh_area(&open);
        sums[1] += apsm_mesh_volume(&cropped);
        apsm_mesh_free(&open);
        apsm_mesh_free(&cropped);
    }
    assert_true(fabs(sums[0] - area) < 2e-3 * area);
    assert_true(fabs(sums[1] - volume) < 2e-3 * volume);
    apsm_mesh_free(&ball);
    apsm_context_free(ctx);
}

/* Nothing is left: an error, and no mesh. */
static void nothing_left_is_an_error(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    apsm_mesh ball = shape_icosphere(3), cropped;
    const double plane[1][4] = { { 1, 0, 0, -2 } };
    assert_int_not_equal(apsm_crop_mesh(ctx, "ball", &ball, 1, plane, NULL, &cropped), APSM_OK);
    assert_null(cropped.V);
    apsm_mesh_free(&ball);
    apsm_context_free(ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(common_end_is_below_the_shortest),
        cmocka_unit_test(like_ends_are_let_be),
        cmocka_unit_test(cropped_is_closed_and_the_rest_is_as_it_was),
        cmocka_unit_test(halves_make_the_whole),
        cmocka_unit_test(nothing_left_is_an_error),
    };
    return cmocka_run_group_tests_name("common_ends", tests, NULL, NULL);
}
