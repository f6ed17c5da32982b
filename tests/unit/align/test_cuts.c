/* Planes in which shapes were cut off: found where they are, and nowhere else. */
#include "align/icp.h"
#include "align_shapes.h"

static size_t cuts_of(const apsm_mesh *mesh, apsm_cloud *cloud)
{
    assert_int_equal(apsm_cloud_sample(mesh, 400, 1, 0, cloud), APSM_OK);
    apsm_cloud_find_cuts(mesh, cloud);
    return cloud->cuts;
}

static size_t count_cuts(apsm_mesh mesh)
{
    apsm_cloud cloud;
    const size_t n = cuts_of(&mesh, &cloud);
    apsm_cloud_free(&cloud);
    apsm_mesh_free(&mesh);
    return n;
}

/* What lies beyond is pressed into the plane x = at. */
static apsm_mesh pressed(apsm_mesh mesh, double at)
{
    for (size_t v = 0; v < mesh.nv; v++) mesh.V[3 * v] = fmin(mesh.V[3 * v], at);
    return mesh;
}

static void round_shapes_are_whole(void **state)
{
    (void)state;
    assert_int_equal(count_cuts(shape_icosphere(4)), 0);
    for (size_t i = 0; i < 4; i++) /* up to 60 : 20 : 6, flat and long */
        assert_int_equal(count_cuts(align_shape(4, 60, 20, 6 + 4 * (double)i, 0.2, 0.5)), 0);
}

/* A cube has six faces and a plate two: neither is a shape that was cut. */
static void flat_shapes_are_whole(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        apsm_mesh mesh = shape_icosphere(4);
        for (size_t v = 0; v < mesh.nv; v++) {
            double *x = mesh.V + 3 * v;
            const double r = 1 / fmax(fmax(fabs(x[0]), fabs(x[1])), fabs(x[2]));
            shape_set3(x, 30 * r * x[0], 30 * r * x[1], (k ? 3 : 30) * r * x[2]);
        }
        assert_int_equal(count_cuts(mesh), 0);
    }
}

/* A shaft with three flat sides and round ends, 350 long and 8 across, bowed: the side that it
 * turns outwards is no cut. */
static void bowed_shafts_are_whole(void **state)
{
    (void)state;
    for (int k = 0; k < 6; k++) {
        apsm_mesh mesh = shape_icosphere(6);
        for (size_t v = 0; v < mesh.nv; v++) {
            double *x = mesh.V + 3 * v, across = 0;
            const double turn = 0.2 * k, phi = atan2(x[1], x[0]) + turn, z = x[2];
            for (int side = 0; side < 3; side++)
                across = fmax(across, cos(phi - 2 * M_PI * side / 3));
            const double r = 4 / across * pow(fmax(1 - pow(z, 8), 0), 1.0 / 8);
            shape_set3(x, r * cos(phi - turn) + (20 + 8 * k) * (1 - z * z), r * sin(phi - turn),
                       175 * z);
        }
        assert_int_equal(count_cuts(mesh), 0);
    }
}

static void cut_is_found_where_it_is(void **state)
{
    (void)state;
    for (size_t i = 0; i < 4; i++) {
        apsm_cloud cloud;
        apsm_mesh mesh = pressed(align_shape(4, 60, 20, 14, 0.2, 0.5), 10 + 10 * (double)i);
        double M[16], n[3] = { 1, 0, 0 }, x[3] = { 10 + 10 * (double)i, 0, 0 };
        align_random_pose(i, 100.0, M);
        apsm_mesh_transform(&mesh, M);
        apsm_affine_apply_normals(M, 1, n, n);
        apsm_affine_apply(M, 1, x, x);
        assert_int_equal(cuts_of(&mesh, &cloud), 1);
        double cosine = 0, offset = -cloud.cut[0][3];
        for (size_t c = 0; c < 3; c++) {
            cosine += n[c] * cloud.cut[0][c];
            offset += x[c] * cloud.cut[0][c];
        }
        if (!(cosine > 0.9999 && fabs(offset) < 0.2))
            fail_msg("cut at %g: cosine %g, off by %g mm", x[0], cosine, offset);
        apsm_cloud_free(&cloud);
        apsm_mesh_free(&mesh);
    }
}

/* Of a mask only what a border of its image, 20 degrees askew, explains is a cut. */
static void masks_are_cut_at_borders_only(void **state)
{
    (void)state;
    const double turned[3] = { cos(0.35), sin(0.35), 0 };
    apsm_borders meshes = { .known = false }, whole = { .known = true };
    apsm_borders across = { true, 1, { { 0, 1, 0 } } }, other = { true, 1, { { -1, 0, 0 } } };
    apsm_borders near = { true, 2, { { 0, 1, 0 }, { turned[0], turned[1], 0 } } };
    const struct {
        const apsm_borders *borders;
        size_t cuts;
    } cases[] = { { &meshes, 1 }, { &whole, 0 }, { &across, 0 }, { &other, 0 }, { &near, 1 } };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        apsm_cloud cloud = { .cuts = 1, .cut = { { 1, 0, 0, 5 } } };
        apsm_cloud_keep_cuts(cases[k].borders, &cloud);
        assert_int_equal(cloud.cuts, cases[k].cuts);
    }
    apsm_cloud two = { .cuts = 2, .cut = { { -1, 0, 0, 7 }, { 0, 1, 0, 8 } } };
    apsm_cloud_keep_cuts(&across, &two);
    assert_int_equal(two.cuts, 1);
    assert_true(two.cut[0][3] == 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(round_shapes_are_whole),        cmocka_unit_test(flat_shapes_are_whole),
        cmocka_unit_test(bowed_shafts_are_whole),        cmocka_unit_test(cut_is_found_where_it_is),
        cmocka_unit_test(masks_are_cut_at_borders_only),
    };
    return cmocka_run_group_tests_name("cuts", tests, NULL, NULL);
}
