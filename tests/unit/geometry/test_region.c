/* Regions of a ball, whose answers are known, and rims. */
#include "cmocka_all.h"

#include "geometry/clip.h"
#include "geometry/region.h"
#include "geometry/rim.h"
#include "geometry/vec3.h"
#include "shapes.h"

static const double pi = 3.14159265358979323846;

static apsm_mesh cut(const apsm_mesh *mesh, const apsm_region *region)
{
    apsm_mesh part;
    double *field = malloc(mesh->nv * sizeof *field);
    assert_non_null(field);
    assert_int_equal(apsm_region_field(region, mesh, field), APSM_OK);
    assert_int_equal(apsm_mesh_clip_field(mesh, field, &part), APSM_OK);
    free(field);
    return part;
}

static void assert_share(const apsm_mesh *mesh, const apsm_region *region, double share)
{
    apsm_mesh part = cut(mesh, region);
    const double is = apsm_mesh_area(&part) / apsm_mesh_area(mesh);
    if (!(fabs(is - share) < 0.004)) fail_msg("%g of the ball is left, not %g", is, share);
    apsm_mesh_free(&part);
}

/* One rim of that length: no zigzag. */
static void assert_rim(const apsm_mesh *mesh, const apsm_region *region, double length)
{
    apsm_mesh part = cut(mesh, region);
    apsm_topology topology;
    apsm_rim rim;
    assert_int_equal(apsm_topology_build(&part, &topology), APSM_OK);
    assert_int_equal(apsm_rim_build(&part, &topology, &rim), APSM_OK);
    assert_int_equal(rim.loops, 1);
    const double is = apsm_rim_length(&rim);
    if (!(fabs(is / length - 1) < 0.02)) fail_msg("the rim is %g long, not %g", is, length);
    apsm_rim_free(&rim);
    apsm_topology_free(&topology);
    apsm_mesh_free(&part);
}

/* What a plane cuts off a ball is its height's share of the diameter; two planes leave a quarter.
 */
static void planes_leave_what_they_should(void **state)
{
    (void)state;
    apsm_mesh ball = shape_sphere(5, 10.0);
    double plane[2][4] = { { 0, 0, 1, 5 }, { 1, 0, 0, 0 } };
    apsm_region region = { .planes = 1, .plane = plane };
    assert_share(&ball, &region, 0.25);
    plane[0][3] = 0;
    region.planes = 2;
    assert_share(&ball, &region, 0.25);
    apsm_mesh part = cut(&ball, &region);
    for (size_t v = 0; v < part.nv; v++) { /* not a hair beyond */
        assert_true(part.V[3 * v] > -1e-12);
        assert_true(part.V[3 * v + 2] > -1e-12);
    }
    apsm_mesh_free(&part);
    apsm_mesh_free(&ball);
}

/* A sphere around the pole takes as much of the ball as its chord says: (r / 2 R)^2. */
static void spheres_take_what_they_should(void **state)
{
    (void)state;
    apsm_mesh ball = shape_sphere(5, 10.0);
    double sphere[2][4] = { { 0, 0, 10, 10 }, { 0, 0, -10, 10 } };
    apsm_region region = { .spheres = 1, .sphere = sphere };
    assert_share(&ball, &region, 0.75);
    region.spheres = 2;
    assert_share(&ball, &region, 0.5);
    apsm_mesh_free(&ball);
}

/* What lies in the level itself does not count: a box loses its lid and nothing else. */
static void faces_in_the_level_go(void **state)
{
    (void)state;
    apsm_mesh box = shape_box((size_t[3]){ 4, 4, 4 }, (double[3]){ 8, 8, 8 }), part;
    double lo[3], hi[3], *below = malloc(box.nv * sizeof *below);
    apsm_mesh_bounds(&box, lo, hi);
    for (size_t v = 0; v < box.nv; v++) below[v] = hi[2] - box.V[3 * v + 2];
    assert_int_equal(apsm_mesh_clip_field(&box, below, &part), APSM_OK);
    assert_true(fabs(apsm_mesh_area(&part) - 5 * 64) < 1e-9);
    free(below);
    apsm_mesh_free(&part);
    apsm_mesh_free(&box);
}

/* A circle drawn at 60 degrees of latitude from the pole parts the ball at a quarter and three. */
static void loops_part_by_their_query_point(void **state)
{
    (void)state;
    enum { CORNERS = 40 };
    apsm_mesh ball = shape_sphere(5, 10.0);
    double corner[3 * CORNERS];
    size_t start[2] = { 0, CORNERS };
    for (int turn = 0; turn < 2; turn++) { /* drawn either way round */
        for (size_t k = 0; k < CORNERS; k++) {
            const double u = (turn ? -2 : 2) * pi * (double)k / CORNERS;
            corner[3 * k] = 10 * sin(pi / 3) * cos(u);
            corner[3 * k + 1] = 10 * sin(pi / 3) * sin(u);
            corner[3 * k + 2] = 5;
        }
        apsm_region region = {
            .loops = 1, .loop_start = start, .boundary = corner, .query = { 1, 1, 9.8 }
        };
        assert_share(&ball, &region, 0.25);
        assert_rim(&ball, &region, 2 * pi * 10 * sin(pi / 3));
        region.query[2] = -9.8;
        assert_share(&ball, &region, 0.75);
    }
    apsm_mesh_free(&ball);
}

static void loop_that_parts_nothing_is_refused(void **state)
{
    (void)state;
    apsm_mesh ball = shape_sphere(3, 10.0);
    double corner[9] = { 0, 0, 10, 0.1, 0, 10, 0, 0.1, 10 },
           *field = malloc(ball.nv * sizeof *field);
    size_t start[2] = { 0, 3 };
    const apsm_region region = { .loops = 1, .loop_start = start, .boundary = corner };
    assert_int_equal(apsm_region_field(&region, &ball, field), APSM_ERR_GEOMETRY);
    free(field);
    apsm_mesh_free(&ball);
}

/* Painted on the vertices of another, coarser ball. */
static void paint_is_that_of_the_nearest_point(void **state)
{
    (void)state;
    apsm_mesh ball = shape_sphere(5, 10.0), coarse = shape_sphere(4, 10.0);
    bool *in = malloc(coarse.nv * sizeof *in);
    for (size_t v = 0; v < coarse.nv; v++) in[v] = coarse.V[3 * v + 1] > 5;
    const apsm_region region = { .painted = coarse.nv, .point = coarse.V, .in = in };
    assert_share(&ball, &region, 0.25);
    free(in);
    apsm_mesh_free(&ball);
    apsm_mesh_free(&coarse);
}

static void rim_is_walked_and_found(void **state)
{
    (void)state;
    apsm_mesh ball = shape_sphere(5, 10.0);
    double plane[1][4] = { { 0, 0, 1, 6 } };
    const apsm_region region = { .planes = 1, .plane = plane };
    apsm_mesh cap = cut(&ball, &region);
    apsm_topology topology;
    apsm_rim rim;
    apsm_rim_point p, q;
    assert_int_equal(apsm_topology_build(&cap, &topology), APSM_OK);
    assert_int_equal(apsm_rim_build(&cap, &topology, &rim), APSM_OK);
    assert_int_equal(rim.loops, 1);
    const double length = apsm_rim_length(&rim);
    assert_true(fabs(length / (2 * pi * 8) - 1) < 0.005);
    for (int k = 0; k < 7; k++) {
        apsm_rim_walk(&rim, 0, length * k / 7.0 - 2 * length, &p);
        apsm_rim_closest(&rim, p.x, &q);
        assert_true(q.distance2 < 1e-20);
        assert_true(fabs(p.x[2] - 6) < 1e-9);
        assert_true(apsm_rim_has(&rim, &topology, &p.on));
        double x[3];
        apsm_surface_position(&cap, &p.on, x);
        assert_true(vec3_distance2(x, p.x) < 1e-20);
    }
    const double above[3] = { 0, 20, 6 };
    apsm_rim_closest(&rim, above, &p);
    assert_true(fabs(sqrt(p.distance2) - 12) < 0.05);
    const apsm_surface_point inner = { 0, { 0.3, 0.3, 0.4 } };
    assert_false(apsm_rim_has(&rim, &topology, &inner));
    apsm_rim_free(&rim);
    apsm_topology_free(&topology);
    assert_int_equal(apsm_topology_build(&ball, &topology), APSM_OK);
    assert_int_equal(apsm_rim_build(&ball, &topology, &rim), APSM_OK);
    assert_int_equal(rim.n, 0); /* closed */
    apsm_topology_free(&topology);
    apsm_mesh_free(&cap);
    apsm_mesh_free(&ball);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planes_leave_what_they_should),
        cmocka_unit_test(spheres_take_what_they_should),
        cmocka_unit_test(faces_in_the_level_go),
        cmocka_unit_test(loops_part_by_their_query_point),
        cmocka_unit_test(loop_that_parts_nothing_is_refused),
        cmocka_unit_test(paint_is_that_of_the_nearest_point),
        cmocka_unit_test(rim_is_walked_and_found),
    };
    return cmocka_run_group_tests_name("region", tests, NULL, NULL);
}
