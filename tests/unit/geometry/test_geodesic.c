/* Geodesic distances and paths against exact values, the smooth sphere, and themselves. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "core/random.h"
#include "geometry/geodesic.h"
#include "golden.h"
#include "shapes.h"

#include "golden_mesh.h"

typedef struct fixture {
    apsm_mesh mesh;
    apsm_topology topology;
    apsm_geodesic *g;
    apsm_geodesic_work *w;
} fixture;

static fixture setup(apsm_mesh mesh)
{
    return (fixture){ .mesh = mesh };
}

/* After setup, when the fixture has its final address. */
static void prepare(fixture *x)
{
    assert_int_equal(apsm_topology_build(&x->mesh, &x->topology), APSM_OK);
    assert_int_equal(apsm_geodesic_build(&x->mesh, &x->topology, &x->g), APSM_OK);
    assert_int_equal(apsm_geodesic_work_new(x->g, &x->w), APSM_OK);
}

static void teardown(fixture *x)
{
    apsm_geodesic_work_free(x->w);
    apsm_geodesic_free(x->g);
    apsm_topology_free(&x->topology);
    apsm_mesh_free(&x->mesh);
}

static void from(fixture *x, const apsm_surface_point *p, double radius)
{
    assert_int_equal(apsm_geodesic_from(x->g, p, radius, x->w), APSM_OK);
}

static apsm_surface_point at_vertex(const fixture *x, uint32_t v)
{
    const uint32_t k = x->topology.corner[x->topology.corner_start[v]];
    apsm_surface_point p = { .face = k / 3 };
    p.weight[k % 3] = 1;
    return p;
}

static apsm_surface_point random_point(const fixture *x, apsm_random *rng)
{
    double a = apsm_random_uniform(rng), b = apsm_random_uniform(rng);
    if (a + b > 1) a = 1 - a, b = 1 - b;
    return (apsm_surface_point){ (uint32_t)apsm_random_below(rng, x->mesh.nf),
                                 { 1 - a - b, a, b } };
}

static double length_of(size_t n, const double *X)
{
    double sum = 0;
    for (size_t i = 1; i < n; i++)
        sum += sqrt((X[3 * i] - X[3 * i - 3]) * (X[3 * i] - X[3 * i - 3]) +
                    (X[3 * i + 1] - X[3 * i - 2]) * (X[3 * i + 1] - X[3 * i - 2]) +
                    (X[3 * i + 2] - X[3 * i - 1]) * (X[3 * i + 2] - X[3 * i - 1]));
    return sum;
}

/* Length of the path from p to the last source, which must start at p and end at source. */
static double path_length(fixture *x, const apsm_surface_point *p, const apsm_surface_point *source)
{
    enum { CAP = 4000 };
    static double X[3 * CAP];
    double a[3], b[3];
    size_t n;
    assert_int_equal(apsm_geodesic_path(x->g, x->w, p, CAP, X, &n), APSM_OK);
    assert_true(n >= 1 && n <= CAP);
    apsm_surface_position(&x->mesh, p, a);
    apsm_surface_position(&x->mesh, source, b);
    golden_close("path starts", 3, X, a, 1e-12);
    golden_close("path ends", 3, X + 3 * (n - 1), b, 1e-12);
    return length_of(n, X);
}

/* The closest face and barycentric weights, by looking at all faces (points lie on the mesh). */
static apsm_surface_point locate(const apsm_mesh *m, const double x[3])
{
    apsm_surface_point best = { 0 };
    double best_d2 = INFINITY;
    for (uint32_t f = 0; f < m->nf; f++) {
        const double *a = m->V + 3 * m->F[3 * f], *b = m->V + 3 * m->F[3 * f + 1],
                     *c = m->V + 3 * m->F[3 * f + 2];
        double ee = 0, eg = 0, gg = 0, re = 0, rg = 0, d2 = 0;
        for (int k = 0; k < 3; k++) {
            const double e = b[k] - a[k], g = c[k] - a[k], r = x[k] - a[k];
            ee += e * e, eg += e * g, gg += g * g, re += r * e, rg += r * g;
        }
        const double det = ee * gg - eg * eg;
        const double u = fmin(fmax((gg * re - eg * rg) / det, 0), 1),
                     v = fmin(fmax((ee * rg - eg * re) / det, 0), 1 - u);
        for (int k = 0; k < 3; k++) {
            const double e = a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]) - x[k];
            d2 += e * e;
        }
        if (d2 < best_d2) {
            best_d2 = d2;
            best = (apsm_surface_point){ f, { 1 - u - v, u, v } };
        }
    }
    assert_true(best_d2 < 1e-18);
    return best;
}

enum { POINTS = 8 };

static void all_pairs(fixture *x, const apsm_surface_point p[POINTS], double D[POINTS][POINTS],
                      double path_tolerance)
{
    for (int a = 0; a < POINTS; a++) {
        from(x, p + a, INFINITY);
        for (int b = 0; b < POINTS; b++) {
            const double d = D[a][b] = apsm_geodesic_distance(x->g, x->w, p + b);
            const double l = path_length(x, p + b, p + a);
            if (!(fabs(l - d) <= path_tolerance * d + 1e-12))
                fail_msg("%d-%d: path %.9g, distance %.9g", b, a, l, d);
        }
    }
}

/* The plane and the cube's pairs come out exact; the tube only where one way is the shortest by
 * more than an edge, 0.2 % elsewhere. */
static void agrees_with_exact_polyhedra(void **state)
{
    (void)state;
    static const double tolerance[3] = { 1e-9, 2e-3, 1e-9 },
                        path_tolerance[3] = { 1e-9, 1e-9, .01 };
    json_t *root = golden_load("geodesic");
    for (size_t i = 0; i < 3; i++) {
        const json_t *c = json_array_get(golden_get(root, "cases"), i);
        fixture x = setup(golden_mesh(c));
        prepare(&x);
        double *P = golden_member(c, "points", 3 * POINTS), D[POINTS][POINTS];
        apsm_surface_point p[POINTS];
        for (int k = 0; k < POINTS; k++) p[k] = locate(&x.mesh, P + 3 * k);
        all_pairs(&x, p, D, path_tolerance[i]);
        double *want = golden_array(golden_get(c, i < 2 ? "D" : "pairs"), 0);
        for (int k = 0; k < (i < 2 ? POINTS * POINTS : 9); k++) {
            const int a = i < 2 ? k / POINTS : (int)want[3 * k],
                      b = i < 2 ? k % POINTS : (int)want[3 * k + 1];
            const double d = i < 2 ? want[k] : want[3 * k + 2];
            if (!(fabs(D[a][b] - d) <= tolerance[i] * d + 1e-12))
                fail_msg("case %zu, %d-%d: %.12g, expected %.12g", i, a, b, D[a][b], d);
        }
        free(want);
        free(P);
        teardown(&x);
    }
    json_decref(root);
}

static void agrees_with_golden_sphere(void **state)
{
    (void)state;
    json_t *root = golden_load("geodesic");
    const json_t *c = json_array_get(golden_get(root, "cases"), 3);
    fixture x = setup(golden_mesh(c));
    prepare(&x);
    double *D = golden_member(c, "D", 4 * x.mesh.nv), *s = golden_member(c, "sources", 4);
    const double near = 2 * apsm_mesh_mean_edge(&x.mesh);
    for (size_t k = 0; k < 4; k++) {
        const apsm_surface_point p = at_vertex(&x, (uint32_t)s[k]);
        from(&x, &p, INFINITY);
        for (uint32_t v = 0; v < x.mesh.nv; v++) {
            const double want = D[k * x.mesh.nv + v], got = apsm_geodesic_vertex_distance(x.w, v);
            if (!(fabs(got - want) <= 0.02 * fmax(want, near)))
                fail_msg("source %zu vertex %u: %g, expected %g", k, v, got, want);
        }
    }
    free(D);
    free(s);
    teardown(&x);
    json_decref(root);
}

/* Error on the unit sphere of 4^level falls about as the square root of the face count. */
static void converges_on_spheres(void **state)
{
    (void)state;
    static const double most[3] = { 0.02, 0.013, 0.008 }, mean[3] = { 0.008, 0.004, 0.002 };
    for (int level = 3; level < 6; level++) {
        fixture x = setup(shape_icosphere(level));
        prepare(&x);
        apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, (uint64_t)level, 0);
        const double near = 2 * apsm_mesh_mean_edge(&x.mesh);
        double worst = 0, sum = 0, worst_path = 0;
        size_t n = 0;
        for (int k = 0; k < 6; k++) {
            const apsm_surface_point p =
                k % 2 ? random_point(&x, &rng) : at_vertex(&x, 21u * (uint32_t)k);
            double a[3];
            apsm_surface_position(&x.mesh, &p, a);
            const double r = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
            from(&x, &p, INFINITY);
            for (uint32_t v = 0; v < x.mesh.nv; v++) {
                const double *b = x.mesh.V + 3 * v;
                const double cosine = (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / r;
                const double want = acos(fmin(fmax(cosine, -1), 1));
                if (want < near) continue;
                const double d = apsm_geodesic_vertex_distance(x.w, v);
                worst = fmax(worst, fabs(d / want - 1));
                sum += fabs(d / want - 1);
                n++;
                if (v % 17) continue;
                const apsm_surface_point q = at_vertex(&x, v);
                worst_path = fmax(worst_path, fabs(path_length(&x, &q, &p) / d - 1));
            }
        }
        if (!(worst <= most[level - 3] && sum / (double)n <= mean[level - 3]))
            fail_msg("level %d: error %g max, %g mean", level, worst, sum / (double)n);
        if (!(worst_path <= 0.02)) fail_msg("level %d: path %g too long", level, worst_path);
        teardown(&x);
    }
}

/* On an anisotropic mesh with obtuse and thin triangles the plane is still flat. */
static void plane_is_exact_whatever_the_triangles(void **state)
{
    (void)state;
    fixture x = setup(shape_plane(12, 9, 60, 9));
    apsm_random rng = apsm_random_stream(2, APSM_STREAM_TEST, 0, 0);
    for (size_t j = 1; j < 9; j++)
        for (size_t i = 1; i < 12; i++) {
            double *v = x.mesh.V + 3 * (j * 13 + i);
            v[0] += 4 * (apsm_random_uniform(&rng) - 0.5);
            v[1] += 0.6 * (apsm_random_uniform(&rng) - 0.5);
        }
    prepare(&x);
    for (int k = 0; k < 40; k++) {
        const apsm_surface_point p = random_point(&x, &rng);
        double a[3], b[3];
        apsm_surface_position(&x.mesh, &p, a);
        from(&x, &p, INFINITY);
        for (int l = 0; l < 20; l++) {
            const apsm_surface_point q = random_point(&x, &rng);
            apsm_surface_position(&x.mesh, &q, b);
            const double want = hypot(a[0] - b[0], a[1] - b[1]);
            const double d = apsm_geodesic_distance(x.g, x.w, &q);
            if (!(fabs(d - want) <= 1e-9 * want + 1e-12))
                fail_msg("distance %.12g, expected %.12g", d, want);
            if (!(fabs(path_length(&x, &q, &p) - want) <= 1e-9 * want + 1e-12))
                fail_msg("path differs from %.12g", want);
        }
    }
    teardown(&x);
}

/* A square ring: paths bend at the corners of the hole, and never cross it. */
static void paths_bend_around_a_hole(void **state)
{
    (void)state;
    fixture x = setup(shape_plane(12, 12, 12, 12));
    size_t kept = 0;
    for (size_t f = 0; f < x.mesh.nf; f++) {
        double c[2] = { 0, 0 };
        for (size_t k = 0; k < 3; k++)
            for (size_t e = 0; e < 2; e++) c[e] += x.mesh.V[3 * x.mesh.F[3 * f + k] + e] / 3;
        if (fmax(fabs(c[0] - 6), fabs(c[1] - 6)) < 3) continue;
        memmove(x.mesh.F + 3 * kept++, x.mesh.F + 3 * f, 3 * sizeof *x.mesh.F);
    }
    x.mesh.nf = kept;
    prepare(&x);
    const double A[3] = { 6, 1, 0 }, B[3] = { 6.25, 11, 0 }, C[3] = { 10.5, 4.5, 0 };
    const apsm_surface_point a = locate(&x.mesh, A), b = locate(&x.mesh, B), c = locate(&x.mesh, C);
    from(&x, &a, INFINITY);
    const double right = hypot(3, 2) + 6 + hypot(2.75, 2), once = hypot(3, 2) + hypot(1.5, 1.5);
    const double d = apsm_geodesic_distance(x.g, x.w, &b);
    if (!(fabs(d - right) <= 1e-9)) fail_msg("around two corners: %.12g, not %.12g", d, right);
    const double e = apsm_geodesic_distance(x.g, x.w, &c);
    if (!(fabs(e - once) <= 1e-9)) fail_msg("around one corner: %.12g, not %.12g", e, once);
    assert_true(fabs(path_length(&x, &b, &a) - right) <= 1e-9);
    teardown(&x);
}

/* A handle: both ways around the tube of a torus; symmetric within the solver's error. */
static void torus_is_symmetric(void **state)
{
    (void)state;
    fixture x = setup(shape_torus(60, 30, 3, 1));
    prepare(&x);
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, 0, 0);
    double worst = 0, path = 0;
    for (int k = 0; k < 200; k++) {
        const apsm_surface_point p = random_point(&x, &rng), q = random_point(&x, &rng);
        from(&x, &p, INFINITY);
        const double d = apsm_geodesic_distance(x.g, x.w, &q);
        path = fmax(path, fabs(path_length(&x, &q, &p) / d - 1));
        from(&x, &q, INFINITY);
        worst = fmax(worst, fabs(apsm_geodesic_distance(x.g, x.w, &p) / d - 1));
    }
    if (!(worst <= 0.02)) fail_msg("asymmetry %g", worst);
    if (!(path <= 0.02)) fail_msg("path %g", path);
    const apsm_surface_point a = at_vertex(&x, 0); /* outer equator, vertex (i, j) = 30 i + j */
    from(&x, &a, INFINITY);
    const double half = apsm_geodesic_vertex_distance(x.w, 15), pi = 3.14159265358979323846;
    assert_true(fabs(half - pi) <= 0.01 * pi); /* half around the tube */
    teardown(&x);
}

static void bounded_search_agrees_and_resets(void **state)
{
    (void)state;
    fixture x = setup(shape_icosphere(4)), y = setup(shape_icosphere(4));
    prepare(&x);
    prepare(&y);
    apsm_random rng = apsm_random_stream(4, APSM_STREAM_TEST, 0, 0);
    for (int k = 0; k < 20; k++) {
        const apsm_surface_point p = random_point(&x, &rng), q = random_point(&x, &rng);
        const double radius = 0.2 + 0.1 * k;
        from(&x, &p, radius);
        from(&y, &p, INFINITY);
        for (uint32_t v = 0; v < x.mesh.nv; v++) {
            const double d = apsm_geodesic_vertex_distance(y.w, v);
            const double b = apsm_geodesic_vertex_distance(x.w, v);
            if (d > radius * (1 + 1e-9)) assert_true(b == INFINITY);
            if (d < radius * (1 - 1e-9) && !(fabs(b - d) <= 1e-12))
                fail_msg("vertex %u: %.15g within radius, %.15g without", v, b, d);
        }
        const double reached = apsm_geodesic_reach(x.g, x.w, &q);
        const double want = apsm_geodesic_distance(y.g, y.w, &q);
        if (!(fabs(reached - want) <= 1e-12)) fail_msg("reach: %.15g, not %.15g", reached, want);
    }
    teardown(&x);
    teardown(&y);
}

static void scaling_by_powers_of_two_is_exact(void **state)
{
    (void)state;
    fixture x = setup(shape_ellipsoid(3, 5, 3, 2)), y = setup(shape_ellipsoid(3, 5, 3, 2));
    for (size_t i = 0; i < 3 * y.mesh.nv; i++) y.mesh.V[i] *= 0x1p-20;
    prepare(&x);
    prepare(&y);
    const apsm_surface_point p = { 77, { 0.2, 0.3, 0.5 } };
    from(&x, &p, 6);
    from(&y, &p, 6 * 0x1p-20);
    for (uint32_t v = 0; v < x.mesh.nv; v++)
        assert_true(apsm_geodesic_vertex_distance(y.w, v) ==
                    0x1p-20 * apsm_geodesic_vertex_distance(x.w, v));
    teardown(&x);
    teardown(&y);
}

/* Walking to `keep` from the source, then measuring from the source, gives `keep`. */
static void walk_stops_where_told(void **state)
{
    (void)state;
    fixture x = setup(shape_ellipsoid(4, 5, 3, 2));
    prepare(&x);
    apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, 0, 0);
    for (int k = 0; k < 100; k++) {
        const apsm_surface_point p = random_point(&x, &rng), q = random_point(&x, &rng);
        apsm_surface_point to;
        from(&x, &p, INFINITY);
        const double d = apsm_geodesic_distance(x.g, x.w, &q), keep = d * (k % 10) / 10;
        assert_int_equal(apsm_geodesic_walk(x.g, x.w, &q, keep, &to), APSM_OK);
        const double e = apsm_geodesic_distance(x.g, x.w, &to);
        assert_true(to.weight[0] >= 0 && to.weight[1] >= 0 && to.weight[2] >= 0);
        if (!(fabs(e - keep) <= 0.01 * d)) fail_msg("kept %g, not %g of %g", e, keep, d);
        assert_int_equal(apsm_geodesic_walk(x.g, x.w, &q, 1.1 * d, &to), APSM_OK);
        assert_memory_equal(&to, &q, sizeof to);
    }
    teardown(&x);
}

/* A section is a way on the surface, nearly the shortest where that is smooth, and does not go past
 * a border or beyond its limit. */
static void sections_bound_distances(void **state)
{
    (void)state;
    fixture x = setup(shape_icosphere(4)), y = setup(shape_plane(10, 10, 2.0, 1.0));
    apsm_random rng = apsm_random_stream(11, APSM_STREAM_TEST, 0, 0);
    int arrived = 0;
    prepare(&x);
    prepare(&y);
    for (int i = 0; i < 500; i++) {
        const apsm_surface_point p = random_point(&x, &rng), q = random_point(&x, &rng);
        double a[3], b[3];
        apsm_surface_position(&x.mesh, &p, a);
        apsm_surface_position(&x.mesh, &q, b);
        const double chord = sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                                  (a[2] - b[2]) * (a[2] - b[2]));
        const double d = apsm_geodesic_section(x.g, &p, &q, INFINITY), exact = 2 * asin(chord / 2);
        arrived += d < INFINITY;
        if (!(d < INFINITY) || exact > 2) continue; /* antipodes: any plane will do */
        if (!(d >= 0.99 * exact && d <= 1.01 * exact)) fail_msg("%g, on the sphere %g", d, exact);
        assert_true(apsm_geodesic_section(x.g, &p, &q, 0.999 * d) == INFINITY);
        assert_true(apsm_geodesic_section(x.g, &p, &q, 1.001 * d) == d);
    }
    assert_true(arrived > 490);
    for (int i = 0; i < 100; i++) {
        const apsm_surface_point p = random_point(&y, &rng), q = random_point(&y, &rng);
        double a[3], b[3];
        apsm_surface_position(&y.mesh, &p, a);
        apsm_surface_position(&y.mesh, &q, b);
        const double chord = sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]));
        const double d = apsm_geodesic_section(y.g, &p, &q, INFINITY);
        golden_close("plane", 1, &d, &chord, 1e-12);
    }
    teardown(&x);
    teardown(&y);
}

static void other_components_are_infinitely_far(void **state)
{
    (void)state;
    fixture x = setup(shape_icosphere(2));
    apsm_mesh two = shape_alloc(2 * x.mesh.nv, 2 * x.mesh.nf);
    for (size_t i = 0; i < 3 * x.mesh.nv; i++) {
        two.V[i] = x.mesh.V[i];
        two.V[3 * x.mesh.nv + i] = x.mesh.V[i] + 5;
    }
    for (size_t i = 0; i < 3 * x.mesh.nf; i++) {
        two.F[i] = x.mesh.F[i];
        two.F[3 * x.mesh.nf + i] = x.mesh.F[i] + (uint32_t)x.mesh.nv;
    }
    const uint32_t other = (uint32_t)x.mesh.nf;
    apsm_mesh_free(&x.mesh);
    x.mesh = two;
    prepare(&x);
    const apsm_surface_point p = { 0, { 1, 0, 0 } }, q = { other, { 0, 0, 1 } };
    apsm_surface_point to;
    from(&x, &p, INFINITY);
    assert_true(apsm_geodesic_distance(x.g, x.w, &q) == INFINITY);
    assert_true(apsm_geodesic_reach(x.g, x.w, &q) == INFINITY);
    assert_int_equal(apsm_geodesic_walk(x.g, x.w, &q, 0.1, &to), APSM_ERR_GEOMETRY);
    teardown(&x);
}

/* Repeated corners, zero areas, coincident vertices, unused vertices: distances stay between the
 * straight line and the sum of edges, paths end. */
static void degenerate_triangles_do_no_harm(void **state)
{
    (void)state;
    fixture x = setup(shape_plane(10, 10, 10, 10));
    apsm_random rng = apsm_random_stream(6, APSM_STREAM_TEST, 0, 0);
    for (int k = 0; k < 60; k++) { /* collapse onto neighbours or onto grid lines */
        double *v = x.mesh.V + 3 * apsm_random_below(&rng, x.mesh.nv);
        if (k % 2)
            v[0] = floor(v[0] + 1);
        else
            v[1] = floor(v[1]) + 1;
    }
    x.mesh.F[33] = x.mesh.F[34];
    prepare(&x);
    for (int k = 0; k < 50; k++) {
        const apsm_surface_point p = random_point(&x, &rng), q = random_point(&x, &rng);
        double a[3], b[3];
        apsm_surface_position(&x.mesh, &p, a);
        apsm_surface_position(&x.mesh, &q, b);
        from(&x, &p, INFINITY);
        const double d = apsm_geodesic_distance(x.g, x.w, &q);
        const double straight = hypot(a[0] - b[0], a[1] - b[1]);
        assert_true(d >= 0.9 * straight - 1e-9 && d < 40);
        assert_true(path_length(&x, &q, &p) >= straight - 1e-9);
    }
    teardown(&x);
}

/* Needles and caps on a sphere: still between chord and a little more than the arc. */
static void bad_triangles_on_a_sphere(void **state)
{
    (void)state;
    fixture x = setup(shape_icosphere(4));
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_TEST, 0, 0);
    const double edge = apsm_mesh_mean_edge(&x.mesh);
    for (size_t v = 0; v < x.mesh.nv; v++) {
        double *p = x.mesh.V + 3 * v, r = 0;
        for (int k = 0; k < 3; k++) p[k] += 0.8 * edge * (apsm_random_uniform(&rng) - 0.5);
        for (int k = 0; k < 3; k++) r += p[k] * p[k];
        for (int k = 0; k < 3; k++) p[k] /= sqrt(r);
    }
    prepare(&x);
    double worst = 0, path = 0;
    for (int k = 0; k < 100; k++) {
        const apsm_surface_point p = random_point(&x, &rng), q = random_point(&x, &rng);
        double a[3], b[3];
        apsm_surface_position(&x.mesh, &p, a);
        apsm_surface_position(&x.mesh, &q, b);
        const double ra = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]),
                     rb = sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2]);
        const double arc = acos((a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / ra / rb);
        if (arc < 2 * edge) continue;
        from(&x, &p, INFINITY);
        const double d = apsm_geodesic_distance(x.g, x.w, &q);
        worst = fmax(worst, fabs(d / arc - 1));
        path = fmax(path, fabs(path_length(&x, &q, &p) / d - 1));
    }
    if (!(worst <= 0.03)) fail_msg("distance error %g", worst);
    if (!(path <= 0.03)) fail_msg("path error %g", path);
    teardown(&x);
}

static void growing_set_of_sources_is_the_minimum(void **state)
{
    (void)state;
    fixture x = setup(shape_ellipsoid(4, 5, 3, 2));
    prepare(&x);
    double *nearest = malloc(x.mesh.nv * sizeof *nearest), *want = malloc(x.mesh.nv * sizeof *want);
    assert_true(nearest && want);
    for (size_t v = 0; v < x.mesh.nv; v++) nearest[v] = want[v] = INFINITY;
    for (uint32_t k = 0; k < 12; k++) {
        const apsm_surface_point p = at_vertex(&x, 200 * k + 3);
        assert_int_equal(apsm_geodesic_add_source(x.g, &p, nearest, x.w), APSM_OK);
        from(&x, &p, INFINITY);
        for (uint32_t v = 0; v < x.mesh.nv; v++)
            want[v] = fmin(want[v], apsm_geodesic_vertex_distance(x.w, v));
    }
    golden_close("nearest", x.mesh.nv, nearest, want, 0.003);
    free(nearest);
    free(want);
    teardown(&x);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_exact_polyhedra),
        cmocka_unit_test(agrees_with_golden_sphere),
        cmocka_unit_test(converges_on_spheres),
        cmocka_unit_test(plane_is_exact_whatever_the_triangles),
        cmocka_unit_test(paths_bend_around_a_hole),
        cmocka_unit_test(torus_is_symmetric),
        cmocka_unit_test(bounded_search_agrees_and_resets),
        cmocka_unit_test(scaling_by_powers_of_two_is_exact),
        cmocka_unit_test(walk_stops_where_told),
        cmocka_unit_test(sections_bound_distances),
        cmocka_unit_test(other_components_are_infinitely_far),
        cmocka_unit_test(degenerate_triangles_do_no_harm),
        cmocka_unit_test(bad_triangles_on_a_sphere),
        cmocka_unit_test(growing_set_of_sources_is_the_minimum),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
