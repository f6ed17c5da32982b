#include "cmocka_all.h"

#include "core/random.h"
#include "geometry/vec3.h"
#include "geometry/walk.h"
#include "shapes.h"

enum { POINTS = 400 };

typedef struct surface {
    apsm_mesh mesh;
    apsm_topology topology;
    apsm_bvh *bvh;
} surface;

static void begin(apsm_mesh mesh, surface *s)
{
    s->mesh = mesh;
    assert_ok(apsm_topology_build(&s->mesh, &s->topology));
    assert_ok(apsm_bvh_build(&s->mesh, &s->bvh));
}

static void end(surface *s)
{
    apsm_bvh_free(s->bvh);
    apsm_topology_free(&s->topology);
    apsm_mesh_free(&s->mesh);
}

static void random_point(apsm_random *rng, double size, double x[3])
{
    for (int c = 0; c < 3; c++) x[c] = size * (2.0 * apsm_random_uniform(rng) - 1.0);
}

/* From what was closest to a point two edges away the walk ends where the tree's search does, or,
 * in a dent between two faces, on the one that it comes to, which is hardly farther. */
static void walk_ends_where_a_search_does(void **state)
{
    (void)state;
    surface s;
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_TEST, 0, 0);
    size_t moved = 0, same = 0;
    begin(shape_torus(60, 40, 2.0, 0.8), &s);
    for (int k = 0; k < POINTS; k++) {
        const double *v = s.mesh.V + 3 * apsm_random_below(&rng, s.mesh.nv);
        double x[3], y[3], by[3];
        apsm_closest before, found, walked;
        random_point(&rng, 0.1, x);
        random_point(&rng, 0.25, by);
        for (int c = 0; c < 3; c++) {
            x[c] += v[c];
            y[c] = x[c] + by[c];
        }
        apsm_bvh_closest(s.bvh, x, INFINITY, &before);
        apsm_bvh_closest(s.bvh, y, INFINITY, &found);
        apsm_walk_closest(&s.mesh, &s.topology, y, before.on.face, &walked);
        assert_true(walked.distance2 >= found.distance2);
        assert_true(walked.distance2 <= 1.05 * found.distance2);
        same += walked.distance2 == found.distance2;
        moved += walked.on.face != before.on.face;
    }
    assert_true(moved > POINTS / 2 && same > POINTS * 9 / 10);
    end(&s);
}

/* Across a plane there is no other end than the closest point, also beyond the border. */
static void walk_crosses_a_plane_from_anywhere(void **state)
{
    (void)state;
    surface s;
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_TEST, 0, 0);
    begin(shape_plane(12, 9, 4.0, 3.0), &s);
    for (int k = 0; k < POINTS; k++) {
        const uint32_t face = (uint32_t)apsm_random_below(&rng, s.mesh.nf);
        double x[3];
        apsm_closest found, walked;
        random_point(&rng, 3.0, x);
        apsm_bvh_closest(s.bvh, x, INFINITY, &found);
        apsm_walk_closest(&s.mesh, &s.topology, x, face, &walked);
        assert_near(walked.distance2, found.distance2, 1e-12);
    }
    end(&s);
}

/* It does not change to the other side of a sheet that happens to be nearer. */
static void walk_stays_on_its_side(void **state)
{
    (void)state;
    surface s;
    double lo[3], hi[3];
    begin(shape_box((size_t[3]){ 8, 8, 1 }, (double[3]){ 2.0, 2.0, 0.1 }), &s);
    apsm_mesh_bounds(&s.mesh, lo, hi);
    const double middle[2] = { 0.5 * (lo[0] + hi[0]) + 0.03, 0.5 * (lo[1] + hi[1]) + 0.02 };
    const double below[3] = { middle[0], middle[1], lo[2] - 0.01 },
                 above[3] = { middle[0] + 0.3, middle[1], hi[2] + 0.01 };
    apsm_closest c;
    apsm_bvh_closest(s.bvh, below, INFINITY, &c);
    apsm_walk_closest(&s.mesh, &s.topology, above, c.on.face, &c);
    assert_near(c.x[0], above[0], 1e-12);
    assert_near(c.x[1], above[1], 1e-12);
    assert_near(c.x[2], lo[2], 1e-12);
    end(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(walk_ends_where_a_search_does),
        cmocka_unit_test(walk_crosses_a_plane_from_anywhere),
        cmocka_unit_test(walk_stays_on_its_side),
    };
    return cmocka_run_group_tests_name("walk", tests, NULL, NULL);
}
