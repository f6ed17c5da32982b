/* Remeshing: what must hold on shapes with sharp tips, thin sheets, handles, slivers. */
#include "cmocka_all.h"

#include "geometry/clip.h"
#include "geometry/rim.h"
#include "geometry/topology.h"
#include "groom/remesh.h"
#include "shapes.h"

static apsm_mesh remeshed(const apsm_mesh *mesh, size_t faces, apsm_remesh_report *report)
{
    apsm_context *ctx = apsm_context_new();
    apsm_remesh_options opt = apsm_remesh_defaults();
    apsm_bvh *tree;
    apsm_mesh out;
    opt.faces = (long)faces;
    assert_int_equal(apsm_bvh_build(mesh, &tree), APSM_OK);
    if (apsm_remesh(ctx, mesh, tree, &opt, &out, report) != APSM_OK)
        fail_msg("%s", apsm_error_text(ctx));
    apsm_bvh_free(tree);
    apsm_context_free(ctx);
    return out;
}

static void assert_sound(const apsm_mesh *mesh, long genus)
{
    apsm_mesh_defects d;
    apsm_topology t;
    assert_int_equal(apsm_mesh_inspect(mesh, &d), APSM_OK);
    assert_true(apsm_mesh_is_closed_manifold(&d));
    assert_int_equal(d.components, 1);
    assert_true(apsm_mesh_volume(mesh) > 0.0);
    assert_int_equal(apsm_topology_build(mesh, &t), APSM_OK);
    assert_int_equal(apsm_mesh_euler(mesh, &t), 2 - 2 * genus);
    apsm_topology_free(&t);
    for (size_t i = 0; i < 3 * mesh->nv; i++) assert_true(mesh->V[i] == (double)(float)mesh->V[i]);
}

static void assert_below(const char *what, double value, double bound)
{
    if (!(value <= bound)) fail_msg("%s is %g, should be at most %g", what, value, bound);
}

static double diagonal(const apsm_mesh *mesh)
{
    double lo[3], hi[3];
    apsm_mesh_bounds(mesh, lo, hi);
    return sqrt((hi[0] - lo[0]) * (hi[0] - lo[0]) + (hi[1] - lo[1]) * (hi[1] - lo[1]) +
                (hi[2] - lo[2]) * (hi[2] - lo[2]));
}

static void fine_ellipsoid_is_coarsened(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_ellipsoid(6, 40, 20, 15);
    apsm_remesh_report r;
    apsm_mesh out = remeshed(&mesh, 10000, &r);
    assert_sound(&out, 0);
    assert_in_range(out.nf, 9000, 11000);
    assert_below("mean distance", fmax(r.forward_mean, r.backward_mean), 5e-4 * diagonal(&mesh));
    assert_below("largest distance", fmax(r.forward_max, r.backward_max), 3e-3 * diagonal(&mesh));
    assert_below("volume", fabs(r.volume_change), 0.005);
    assert_true(r.min_angle > 25.0);
    assert_below("faces below 30 degrees", (double)r.below_30, 10);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&out);
}

static void coarse_sphere_is_refined_unless_told_not_to(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(2, 3.0), out;
    apsm_remesh_report r;
    out = remeshed(&mesh, 5000, &r);
    assert_sound(&out, 0);
    assert_in_range(out.nf, 4500, 5500);
    assert_below("distance to the coarse faces", r.forward_max, 0.03); /* across its creases */
    apsm_mesh_free(&out);

    apsm_remesh_options opt = apsm_remesh_defaults();
    opt.refine = false;
    apsm_bvh *tree;
    assert_int_equal(apsm_bvh_build(&mesh, &tree), APSM_OK);
    assert_int_equal(apsm_remesh(NULL, &mesh, tree, &opt, &out, NULL), APSM_OK);
    assert_in_range(out.nf, 250, 400);
    apsm_bvh_free(tree);
    apsm_mesh_free(&out);
    apsm_mesh_free(&mesh);
}

static void torus_keeps_its_handle(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_torus(200, 80, 20.0, 4.0);
    apsm_remesh_report r;
    apsm_mesh out = remeshed(&mesh, 4000, &r);
    assert_sound(&out, 1);
    assert_below("mean distance", r.backward_mean, 1e-3 * diagonal(&mesh));
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&out);
}

/* A flat ellipsoid 100 times wider than thick: its sides must not meet and its rim must stay. */
static void thin_sheet_stays_two_sided(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_ellipsoid(6, 50, 50, 0.5);
    apsm_remesh_report r;
    apsm_mesh out = remeshed(&mesh, 4000, &r);
    assert_sound(&out, 0);
    assert_below("volume", fabs(r.volume_change), 0.02);
    assert_below("largest distance", r.backward_max, 0.5);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&out);
}

/* A ball with a spike 25 times longer than its foot is wide. */
static void spike_is_not_cut_off(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_sphere(6, 10.0);
    double top = 0.0;
    for (size_t v = 0; v < mesh.nv; v++) {
        double *x = mesh.V + 3 * v;
        const double rho = sqrt(x[0] * x[0] + x[1] * x[1]) / 0.8;
        if (x[2] > 0.0 && rho < 1.0) x[2] += 20.0 * (1.0 - rho);
        top = fmax(top, x[2]);
    }
    apsm_remesh_report r;
    apsm_mesh out = remeshed(&mesh, 6000, &r);
    assert_sound(&out, 0);
    double reached = 0.0;
    for (size_t v = 0; v < out.nv; v++) reached = fmax(reached, out.V[3 * v + 2]);
    assert_below("lost height", top - reached, 0.5);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&out);
}

/* Corners and edges of a cube. */
static void cube_keeps_its_edges(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(24, 10.0);
    apsm_remesh_report r;
    apsm_mesh out = remeshed(&mesh, 3000, &r);
    assert_sound(&out, 0);
    assert_below("volume", fabs(r.volume_change), 0.01);
    assert_below("largest distance", r.backward_max, 0.02 * diagonal(&mesh));
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&out);
}

static void power_of_two_scales_exactly(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_ellipsoid(5, 3, 2, 1), large;
    assert_int_equal(apsm_mesh_copy(&mesh, &large), APSM_OK);
    for (size_t i = 0; i < 3 * mesh.nv; i++) large.V[i] *= 1024.0;
    apsm_remesh_report r, s;
    apsm_mesh a = remeshed(&mesh, 3000, &r), b = remeshed(&large, 3000, &s);
    assert_int_equal(a.nv, b.nv);
    assert_int_equal(a.nf, b.nf);
    assert_memory_equal(a.F, b.F, 3 * a.nf * sizeof *a.F);
    for (size_t i = 0; i < 3 * a.nv; i++) assert_true(1024.0 * a.V[i] == b.V[i]);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&large);
    apsm_mesh_free(&a);
    apsm_mesh_free(&b);
}

/* A torus whose faces are needles, 12 round the tube and 600 along it. */
static void slivers_become_good_faces(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_torus(600, 12, 20.0, 5.0);
    apsm_remesh_report r;
    apsm_mesh out = remeshed(&mesh, 6000, &r);
    assert_sound(&out, 1);
    assert_true(r.min_angle > 15.0);
    assert_below("faces below 30 degrees", (double)r.below_30, 0.02 * (double)out.nf);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&out);
}

/* The half-axes 40, 20, 15 below z = 5 and, with corners, before x = 10; 2: or, and the corners of
 * the rim point inwards. */
static apsm_mesh bowl(int corners)
{
    apsm_mesh whole = shape_ellipsoid(6, 40, 20, 15), open;
    double *inside = malloc(whole.nv * sizeof *inside);
    assert_non_null(inside);
    for (size_t v = 0; v < whole.nv; v++) {
        inside[v] = 5.0 - whole.V[3 * v + 2];
        if (corners == 1) inside[v] = fmin(inside[v], 10.0 - whole.V[3 * v]);
        if (corners == 2) inside[v] = fmax(inside[v], 10.0 - whole.V[3 * v]);
    }
    assert_int_equal(apsm_mesh_clip_field(&whole, inside, &open), APSM_OK);
    free(inside);
    apsm_mesh_free(&whole);
    return open;
}

static double rim_of(const apsm_mesh *mesh, apsm_rim *rim)
{
    apsm_topology t;
    assert_int_equal(apsm_topology_build(mesh, &t), APSM_OK);
    assert_int_equal(apsm_mesh_euler(mesh, &t), 1);
    assert_int_equal(apsm_rim_build(mesh, &t, rim), APSM_OK);
    apsm_topology_free(&t);
    assert_int_equal(rim->loops, 1);
    return apsm_rim_length(rim);
}

static void open_mesh_keeps_its_rim(void **state)
{
    (void)state;
    for (int corners = 0; corners < 3; corners++) {
        apsm_mesh mesh = bowl(corners);
        apsm_remesh_report r;
        apsm_rim before, after;
        apsm_mesh out = remeshed(&mesh, 5000, &r);
        assert_in_range(out.nf, 4000, 6000);
        assert_below("mean distance", fmax(r.forward_mean, r.backward_mean),
                     1e-3 * diagonal(&mesh));
        const double length = rim_of(&mesh, &before);
        assert_below("length of the rim", fabs(rim_of(&out, &after) / length - 1.0), 0.005);
        for (size_t e = 0; e < before.n; e++) { /* both ways: corners stay, nothing bulges */
            apsm_rim_point on;
            apsm_rim_closest(&after, mesh.V + 3 * mesh.F[before.half_edge[e]], &on);
            assert_below("rim from rim", sqrt(on.distance2), 0.15 * r.edge);
        }
        for (size_t e = 0; e < after.n; e++) {
            apsm_rim_point on;
            apsm_rim_closest(&before, out.V + 3 * out.F[after.half_edge[e]], &on);
            assert_below("vertex of the rim", sqrt(on.distance2), 1e-5);
        }
        assert_true(r.min_angle > 10.0);
        apsm_rim_free(&before);
        apsm_rim_free(&after);
        apsm_mesh_free(&mesh);
        apsm_mesh_free(&out);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fine_ellipsoid_is_coarsened),
        cmocka_unit_test(coarse_sphere_is_refined_unless_told_not_to),
        cmocka_unit_test(torus_keeps_its_handle),
        cmocka_unit_test(thin_sheet_stays_two_sided),
        cmocka_unit_test(spike_is_not_cut_off),
        cmocka_unit_test(cube_keeps_its_edges),
        cmocka_unit_test(power_of_two_scales_exactly),
        cmocka_unit_test(slivers_become_good_faces),
        cmocka_unit_test(open_mesh_keeps_its_rim),
    };
    return cmocka_run_group_tests_name("remesh", tests, NULL, NULL);
}
