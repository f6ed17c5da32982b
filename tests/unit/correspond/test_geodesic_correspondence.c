/* Algorithm 1: neighbourhoods, mismatches, order and walks against the golden; what a pass must
 * and must not do on ellipsoids whose correspondence is known. */
#include "cmocka_all.h"

#include <string.h>

#include "core/random.h"
#include "correspond/geodesic_correspondence.h"
#include "golden.h"
#include "shapes.h"

static double distance2(const double *a, const double *b)
{
    return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
           (a[2] - b[2]) * (a[2] - b[2]);
}

typedef struct fixture {
    apsm_mesh mesh;
    apsm_topology topology;
    apsm_geodesic *g;
    apsm_geodesic_work *w;
    apsm_bvh *bvh;
} fixture;

static void prepare(fixture *x)
{
    assert_ok(apsm_topology_build(&x->mesh, &x->topology));
    assert_ok(apsm_geodesic_build(&x->mesh, &x->topology, &x->g));
    assert_ok(apsm_geodesic_work_new(x->g, &x->w));
    assert_ok(apsm_bvh_build(&x->mesh, &x->bvh));
}

static void teardown(fixture *x)
{
    apsm_bvh_free(x->bvh);
    apsm_geodesic_work_free(x->w);
    apsm_geodesic_free(x->g);
    apsm_topology_free(&x->topology);
    apsm_mesh_free(&x->mesh);
}

static void place(const fixture *x, size_t J, const double *X, apsm_surface_point *points,
                  double *P)
{
    for (size_t j = 0; j < J; j++) {
        apsm_closest c;
        apsm_bvh_closest(x->bvh, X + 3 * j, INFINITY, &c);
        points[j] = c.on;
        memcpy(P + 3 * j, c.x, sizeof c.x);
    }
}

enum { G = 16 }; /* particles of the golden */

static void check_row(const json_t *want, const uint32_t *got, size_t n)
{
    assert_int_equal(n, json_array_size(want));
    for (size_t i = 0; i < n; i++)
        assert_int_equal(got[i], json_integer_value(json_array_get(want, i)));
}

static void check_walks(fixture *x, const json_t *c, const apsm_neighbourhoods *reference,
                        const apsm_neighbourhoods *shape, const double *D,
                        const apsm_surface_point *points)
{
    json_t *walks = golden_get(c, "walks_at_entry");
    for (size_t i = 0; i < json_array_size(walks); i++) {
        const json_t *walk = json_array_get(walks, i);
        const uint32_t j = (uint32_t)golden_number(walk, "j");
        uint32_t missing[G], farthest = 0;
        const size_t n =
            apsm_missing_neighbours(reference, shape, golden_number(c, "factor"), j, missing);
        check_row(golden_get(walk, "missing"), missing, n);
        for (size_t m = 1; m < n; m++)
            if (D[j * G + missing[m]] > D[j * G + missing[farthest]]) farthest = (uint32_t)m;
        const uint32_t k = missing[farthest];
        assert_int_equal(k, (int)golden_number(walk, "farthest"));
        assert_near(shape->closest[k], golden_number(walk, "keep"), 1e-12);
        apsm_surface_point to;
        double at[3], *target = golden_member(walk, "target", 3);
        assert_ok(apsm_geodesic_from(x->g, points + k, INFINITY, x->w));
        assert_ok(apsm_geodesic_walk(x->g, x->w, points + j, shape->closest[k], &to));
        apsm_surface_position(&x->mesh, &to, at);
        golden_close("target", 3, at, target, 1e-9);
        free(target);
    }
}

static void agrees_with_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("alg1");
    fixture x = { .mesh = shape_alloc(121, 200) };
    double *F = golden_member(root, "F", 600), *V = golden_member(root, "V", 363);
    memcpy(x.mesh.V, V, 363 * sizeof *V);
    for (size_t i = 0; i < 600; i++) x.mesh.F[i] = (uint32_t)F[i];
    prepare(&x);
    double *D_reference = golden_member(root, "D_reference", G * G),
           *D_shape = golden_member(root, "D_shape", G * G),
           *X = golden_member(root, "shape", 3 * G), P[3 * G];
    apsm_surface_point points[G];
    apsm_neighbourhoods reference = { 0 }, shape = { 0 }, searched = { 0 };
    const double factor = golden_number(root, "ref_factor");
    assert_ok(apsm_matrix_neighbourhoods(G, D_reference, factor, &reference));
    for (size_t j = 0; j < G; j++)
        check_row(json_array_get(golden_get(root, "neighbours"), j),
                  reference.index + reference.start[j],
                  reference.start[j + 1] - reference.start[j]);
    assert_ok(apsm_matrix_neighbourhoods(G, D_shape, 2.0, &shape));
    place(&x, G, X, points, P);
    assert_ok(apsm_geodesic_neighbourhoods(x.g, x.w, G, points, P, 2.0, &searched));
    assert_memory_equal(searched.start, shape.start, (G + 1) * sizeof *shape.start);
    assert_memory_equal(searched.index, shape.index, shape.start[G] * sizeof *shape.index);
    golden_close("distance", shape.start[G], searched.distance, shape.distance, 1e-9);
    for (size_t i = 0; i < 2; i++) {
        const json_t *c = json_array_get(golden_get(root, "cases"), i);
        uint32_t count[G], order[G];
        apsm_mismatches(&reference, &shape, golden_number(c, "factor"), count);
        check_row(golden_get(c, "mismatches"), count, G);
        check_row(golden_get(c, "order"), order, apsm_mismatch_order(G, count, order));
        check_walks(&x, c, &reference, &shape, D_shape, points);
    }
    apsm_neighbourhoods_free(&reference);
    apsm_neighbourhoods_free(&shape);
    apsm_neighbourhoods_free(&searched);
    free(F);
    free(V);
    free(D_reference);
    free(D_shape);
    free(X);
    teardown(&x);
    json_decref(root);
}

/* On a thin plate the closest particle in space is on the far side, not a neighbour: rows must
 * be those of the full distance matrix. */
static void far_side_of_a_sheet_is_far(void **state)
{
    (void)state;
    enum { N = 50 };
    fixture x = { .mesh = shape_box((size_t[3]){ 20, 20, 1 }, (double[3]){ 20, 20, 0.5 }) };
    prepare(&x);
    apsm_surface_point points[N];
    double X[3 * N], P[3 * N], D[N * N];
    for (size_t j = 0; j < N; j++) { /* 5 x 5 on either side */
        const double side = j < N / 2 ? 1 : -1;
        const size_t i = j % (N / 2);
        X[3 * j] = 3.7 * ((double)(i % 5) - 2) + 0.1 * side + 0.03 * (double)(i * i % 7);
        X[3 * j + 1] = 3.9 * ((double)(i / 5) - 2) + 0.07 * (double)i;
        X[3 * j + 2] = 0.25 * side;
    }
    place(&x, N, X, points, P);
    for (size_t j = 0; j < N; j++) {
        assert_ok(apsm_geodesic_from(x.g, points + j, INFINITY, x.w));
        for (size_t k = 0; k < N; k++) D[j * N + k] = apsm_geodesic_distance(x.g, x.w, points + k);
    }
    apsm_neighbourhoods full = { 0 }, searched = { 0 };
    assert_ok(apsm_matrix_neighbourhoods(N, D, 2.0, &full));
    assert_ok(apsm_geodesic_neighbourhoods(x.g, x.w, N, points, P, 2.0, &searched));
    assert_memory_equal(searched.start, full.start, (N + 1) * sizeof *full.start);
    assert_memory_equal(searched.index, full.index, full.start[N] * sizeof *full.index);
    golden_close("distance", full.start[N], searched.distance, full.distance, 1e-9);
    golden_close("closest", N, searched.closest, full.closest, 1e-9);
    assert_memory_equal(searched.nearest, full.nearest, N * sizeof *full.nearest);
    assert_true(apsm_neighbour_distance(&searched, 12, 37) == INFINITY); /* back to back */
    apsm_neighbourhoods_free(&full);
    apsm_neighbourhoods_free(&searched);
    teardown(&x);
}

/* ---- two ellipsoids, J particles at corresponding places ---- */

enum { J = 100 };

typedef struct pair {
    fixture reference, shape;
    apsm_surface_point points[J], reference_points[J];
    double P[3 * J], reference_P[3 * J], h;
    apsm_neighbourhoods rows;
    apsm_walk_work *work;
} pair;

static void spiral(size_t j, double u[3])
{
    const double z = 1 - (2.0 * (double)j + 1) / J, r = sqrt(1 - z * z);
    u[0] = r * cos(2.399963229728653 * (double)j);
    u[1] = r * sin(2.399963229728653 * (double)j);
    u[2] = z;
}

static void make_pair(pair *p, double scale)
{
    memset(p, 0, sizeof *p);
    p->reference.mesh = shape_ellipsoid(4, 12 * scale, 10 * scale, 9 * scale);
    p->shape.mesh = shape_ellipsoid(4, 13 * scale, 10 * scale, 8.5 * scale);
    prepare(&p->reference);
    prepare(&p->shape);
    double X[3 * J], Y[3 * J], u[3];
    const double a[3] = { 12 * scale, 10 * scale, 9 * scale };
    const double b[3] = { 13 * scale, 10 * scale, 8.5 * scale };
    for (size_t j = 0; j < J; j++) {
        spiral(j, u);
        for (size_t c = 0; c < 3; c++) X[3 * j + c] = a[c] * u[c], Y[3 * j + c] = b[c] * u[c];
    }
    place(&p->reference, J, X, p->reference_points, p->reference_P);
    place(&p->shape, J, Y, p->points, p->P);
    assert_ok(apsm_geodesic_neighbourhoods(p->reference.g, p->reference.w, J, p->reference_points,
                                           p->reference_P, APSM_REFERENCE_FACTOR, &p->rows));
    assert_ok(apsm_walk_work_new(J, &p->work));
    p->h = 3.8 * scale;
}

static void free_pair(pair *p)
{
    apsm_walk_work_free(p->work);
    apsm_neighbourhoods_free(&p->rows);
    teardown(&p->reference);
    teardown(&p->shape);
}

static apsm_walk_report pass(pair *p, const apsm_walk_options *o)
{
    apsm_walk_report report;
    const apsm_walk_ground ground = { p->shape.g, p->shape.w, p->shape.bvh };
    assert_ok(
        apsm_geodesic_correspondence(&ground, J, &p->rows, o, p->points, p->P, p->work, &report));
    for (size_t j = 0; j < J; j++) {
        double x[3];
        apsm_surface_position(&p->shape.mesh, p->points + j, x);
        golden_close("points and P", 3, p->P + 3 * j, x, 1e-12);
    }
    return report;
}

static void sound_correspondence_stays(void **state)
{
    (void)state;
    static pair p;
    make_pair(&p, 1);
    double before[3 * J];
    memcpy(before, p.P, sizeof before);
    const apsm_walk_options o = apsm_walk_defaults(p.h);
    const apsm_walk_report r = pass(&p, &o);
    assert_int_equal(r.before[1], 0);
    assert_int_equal(r.moved, 0);
    assert_memory_equal(before, p.P, sizeof before);
    free_pair(&p);
}

/* Particles thrown off by up to 2 h come nearer to where they belong, nobody is crowded, and
 * fewer particles are mismatched. */
static void displace(pair *p, size_t n)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 1, 0);
    double X[3 * J];
    memcpy(X, p->P, sizeof X);
    for (size_t i = 0; i < n; i++) {
        const size_t j = (13 * i) % J;
        for (size_t c = 0; c < 3; c++)
            X[3 * j + c] += 2 * p->h * (2 * apsm_random_uniform(&rng) - 1);
    }
    place(&p->shape, J, X, p->points, p->P);
}

static double truth_error(const pair *p, const double *truth)
{
    double sum = 0;
    for (size_t j = 0; j < J; j++) sum += sqrt(distance2(p->P + 3 * j, truth + 3 * j)) / J;
    return sum;
}

static void displaced_particles_come_back(void **state)
{
    (void)state;
    static pair p;
    make_pair(&p, 1);
    double truth[3 * J];
    memcpy(truth, p.P, sizeof truth);
    displace(&p, 12);
    const double error = truth_error(&p, truth);
    const apsm_walk_options o = apsm_walk_defaults(p.h);
    const apsm_walk_report r = pass(&p, &o);
    assert_true(r.moved >= 6);
    assert_true(r.after[1] < r.before[1] && r.before[1] <= r.before[0]);
    if (!(truth_error(&p, truth) < 0.7 * error))
        fail_msg("error %g, was %g", truth_error(&p, truth), error);
    const apsm_walk_report again = pass(&p, &o); /* counts are those of a fresh look */
    assert_memory_equal(again.before, r.after, sizeof r.after);
    free_pair(&p);
}

static double least_separation(const pair *p)
{
    double least = INFINITY;
    for (size_t j = 0; j < J; j++)
        for (size_t k = 0; k < j; k++) least = fmin(least, distance2(p->P + 3 * j, p->P + 3 * k));
    return sqrt(least);
}

static void guard_keeps_particles_apart(void **state)
{
    (void)state;
    static pair p;
    make_pair(&p, 1);
    displace(&p, 60);
    const double apart = least_separation(&p);
    apsm_walk_options o = apsm_walk_defaults(p.h);
    const apsm_walk_report first = pass(&p, &o);
    assert_true(least_separation(&p) >= fmin(apart, o.min_separation * p.h));
    const apsm_walk_report again = pass(&p, &o);
    assert_memory_equal(again.before, first.after, sizeof first.after);
    free_pair(&p);
    make_pair(&p, 1);
    displace(&p, 60);
    o.geodesic_guard = false;
    const apsm_walk_report free_walk = pass(&p, &o);
    assert_int_equal(free_walk.refused, 0);
    assert_true(free_walk.moved > 30);
    assert_true(least_separation(&p) < o.min_separation * p.h);
    for (int k = 0; k < 5; k++) { /* counts after many moves are those of a fresh look */
        const apsm_walk_report one = pass(&p, &o), two = pass(&p, &o);
        assert_memory_equal(two.before, one.after, sizeof one.after);
    }
    free_pair(&p);
}

/* Without the count at 1.5 the same particles are found and walk, whether few are displaced or
 * many; targets differ by as much as sections are longer than geodesics. */
static void sections_find_the_same_particles(void **state)
{
    (void)state;
    for (size_t n = 0; n <= 60; n += 20) {
        static pair p, q;
        make_pair(&p, 1);
        make_pair(&q, 1);
        displace(&p, n);
        displace(&q, n);
        apsm_walk_options o = apsm_walk_defaults(p.h);
        const apsm_walk_report r = pass(&p, &o);
        o.strict = false;
        const apsm_walk_report s = pass(&q, &o);
        assert_int_equal(s.before[1], r.before[1]);
        assert_int_equal(s.moved + s.refused, r.moved + r.refused);
        assert_true(s.before[0] == 0 && s.after[0] == 0);
        for (size_t j = 0; j < J; j++)
            assert_true(distance2(p.P + 3 * j, q.P + 3 * j) < 0.01 * p.h * p.h);
        const apsm_walk_report again = pass(&q, &o);
        assert_int_equal(again.before[1], s.after[1]);
        free_pair(&p);
        free_pair(&q);
    }
}

/* The paper's reading runs: farthest neighbour, F = 1.5, no guard, without a tree. */
static void literal_pass_runs(void **state)
{
    (void)state;
    static pair p;
    make_pair(&p, 1);
    displace(&p, 30);
    const apsm_walk_options o = { .geodesic_factor = 1.5,
                                  .geodesic_target = APSM_TARGET_FARTHEST,
                                  .geodesic_walk = 1.0 };
    apsm_walk_report r;
    const apsm_walk_ground ground = { p.shape.g, p.shape.w, NULL };
    assert_ok(apsm_geodesic_correspondence(&ground, J, &p.rows, &o, p.points, p.P, p.work, &r));
    assert_true(r.moved >= 30 && r.moved <= J);
    const apsm_walk_options mean = apsm_walk_defaults(p.h);
    assert_int_equal(
        apsm_geodesic_correspondence(&ground, J, &p.rows, &mean, p.points, p.P, p.work, &r),
        APSM_ERR_ARG);
    free_pair(&p);
}

/* Half a walk goes half as far. */
static void half_a_walk_is_half(void **state)
{
    (void)state;
    static pair p, q;
    double start[3], moved[2];
    for (int half = 0; half < 2; half++) {
        pair *a = half ? &q : &p;
        make_pair(a, 1);
        double X[3 * J];
        memcpy(X, a->P, sizeof X);
        memcpy(X + 3 * 50, a->P + 3 * 58, 3 * sizeof *X); /* 50 goes next to a far particle */
        X[3 * 50] += 0.3 * a->h;
        place(&a->shape, J, X, a->points, a->P);
        memcpy(start, a->P + 3 * 50, sizeof start);
        apsm_walk_options o = apsm_walk_defaults(a->h);
        o.geodesic_target = APSM_TARGET_FARTHEST;
        o.geodesic_guard = false;
        o.geodesic_factor = 4; /* only 50 is far enough off */
        o.geodesic_walk = half ? 0.5 : 1;
        pass(a, &o);
        moved[half] = sqrt(distance2(start, a->P + 3 * 50));
    }
    assert_true(moved[0] > p.h);
    assert_true(moved[1] > 0.4 * moved[0] && moved[1] < 0.6 * moved[0]);
    free_pair(&p);
    free_pair(&q);
}

static void scaling_by_powers_of_two_is_exact(void **state)
{
    (void)state;
    static pair p, q;
    make_pair(&p, 1);
    make_pair(&q, 0x1p-10);
    displace(&p, 20);
    displace(&q, 20);
    const apsm_walk_options a = apsm_walk_defaults(p.h), b = apsm_walk_defaults(q.h);
    const apsm_walk_report r = pass(&p, &a), s = pass(&q, &b);
    assert_memory_equal(&r, &s, sizeof r);
    for (size_t i = 0; i < 3 * J; i++) assert_true(q.P[i] == 0x1p-10 * p.P[i]);
    free_pair(&p);
    free_pair(&q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_golden),
        cmocka_unit_test(far_side_of_a_sheet_is_far),
        cmocka_unit_test(sound_correspondence_stays),
        cmocka_unit_test(displaced_particles_come_back),
        cmocka_unit_test(guard_keeps_particles_apart),
        cmocka_unit_test(sections_find_the_same_particles),
        cmocka_unit_test(literal_pass_runs),
        cmocka_unit_test(half_a_walk_is_half),
        cmocka_unit_test(scaling_by_powers_of_two_is_exact),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
