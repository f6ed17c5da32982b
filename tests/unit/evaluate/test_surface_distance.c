#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "cohorts.h"
#include "context_fixture.h"
#include "golden.h"
#include "shapes.h"

#include "golden_mesh.h"

static void shift(apsm_mesh *mesh, double x, double y, double z)
{
    const double t[3] = { x, y, z };
    for (size_t k = 0; k < 3 * mesh->nv; k++) mesh->V[k] += t[k % 3];
}

static apsm_surface_distance compare(const apsm_mesh *shape, const apsm_mesh *reconstruction,
                                     const apsm_distance_fields *fields)
{
    apsm_surface_distance d;
    assert_int_equal(apsm_surface_distance_between(ctx, shape, NULL, reconstruction, fields, &d),
                     APSM_OK);
    return d;
}

static void agrees_with_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("metrics"), *s = golden_get(root, "surface_distance");
    apsm_mesh A = golden_mesh(golden_get(s, "A")), B = golden_mesh(golden_get(s, "B"));
    double *to_b = golden_member(s, "A_vertices_to_B", 42);
    double *to_a = golden_member(s, "B_vertices_to_A", 42);
    double pull[42], push[42];
    const apsm_distance_fields fields = { .pull = pull, .push = push };
    const double want[2] = { golden_number(s, "mean"), golden_number(s, "max") };
    const apsm_surface_distance d = compare(&B, &A, &fields);
    golden_close("A to B", 42, pull, to_b, 1e-9);
    golden_close("B to A", 42, push, to_a, 1e-9);
    golden_close("mean", 1, &d.two_way.mean, &want[0], 1e-9);
    golden_close("max", 1, &d.two_way.max, &want[1], 1e-9);
    apsm_mesh_free(&A);
    apsm_mesh_free(&B);
    free(to_b);
    free(to_a);
    json_decref(root);
}

/* Quantiles of 1..100, and of weights that make every second distance count alone. */
static void summaries_are_known(void **state)
{
    (void)state;
    double d[100], w[100];
    size_t order[200];
    apsm_distance_summary s;
    for (size_t k = 0; k < 100; k++) {
        d[k] = (double)((37 * k + 11) % 100 + 1);
        w[k] = (int)d[k] % 2 ? 2.0 : 0.0;
    }
    apsm_distance_summarize(100, d, NULL, order, &s);
    assert_true(s.mean == 50.5 && s.median == 50 && s.p95 == 95 && s.p99 == 99 && s.max == 100);
    for (size_t k = 1; k < 100; k++) assert_true(d[order[k - 1]] < d[order[k]]);
    apsm_distance_summarize(100, d, w, order, &s);
    assert_true(s.mean == 50 && s.median == 49 && s.p95 == 95 && s.p99 == 99 && s.max == 100);
    apsm_distance_summarize(1, d, NULL, order, &s);
    assert_true(s.mean == d[0] && s.median == d[0] && s.p95 == d[0] && s.max == d[0]);
}

/* Spheres of radius 20 and 21: 1 everywhere, up to the sag of the triangles. */
static void concentric_spheres(void **state)
{
    (void)state;
    apsm_mesh a = shape_sphere(4, 20), b = shape_sphere(4, 21);
    const apsm_surface_distance d = compare(&a, &b, NULL);
    const apsm_distance_summary all[4] = { d.two_way, d.pull, d.push, d.disagreement };
    for (int k = 0; k < 4; k++)
        if (!(fabs(all[k].mean - 1) < 0.02 && fabs(all[k].median - 1) < 0.02 &&
              fabs(all[k].max - 1) < 0.03))
            fail_msg("summary %d: mean %g, median %g, max %g", k, all[k].mean, all[k].median,
                     all[k].max);
    assert_true(fabs(d.diagonal - 40 * sqrt(3)) < 0.2);
    apsm_mesh_free(&a);
    apsm_mesh_free(&b);
}

/* A unit sphere moved by t: a point at angle u is | |x + t| - 1 | away; its largest is t, its mean
 * over the sphere is found by summation over cos u, which is uniform. */
static void translated_spheres(void **state)
{
    (void)state;
    const double t = 0.3;
    apsm_mesh a = shape_icosphere(5), b = shape_icosphere(5);
    shift(&b, t * 0.48, t * -0.6, t * 0.64);
    double mean = 0;
    for (int k = 0; k < 10000; k++) {
        const double c = -1 + (k + 0.5) / 5000;
        mean += fabs(sqrt(1 + t * t + 2 * t * c) - 1) / 10000;
    }
    const apsm_surface_distance d = compare(&a, &b, NULL);
    if (!(fabs(d.push.mean - mean) < 2e-3)) fail_msg("push %g, expected %g", d.push.mean, mean);
    if (!(fabs(d.two_way.mean - mean) < 2e-3)) fail_msg("%g, expected %g", d.two_way.mean, mean);
    if (!(fabs(d.two_way.max - t) < 2e-3)) fail_msg("max %g, expected %g", d.two_way.max, t);
    apsm_mesh_free(&a);
    apsm_mesh_free(&b);
}

/* A plate over a plate of the same width but half the length: pull, from the small one, sees
 * nothing; push sees that half the area is up to 4 away; disagreement is never below push. */
static void push_sees_what_pull_cannot(void **state)
{
    (void)state;
    apsm_mesh shape = shape_plane(32, 16, 8, 4), half = shape_plane(4, 4, 4, 4);
    double push[33 * 17], disagreement[33 * 17];
    const apsm_distance_fields fields = { .push = push, .disagreement = disagreement };
    apsm_surface_distance d = compare(&shape, &half, &fields);
    assert_true(d.pull.max == 0);
    assert_true(fabs(d.push.mean - 1) < 1e-3 * 8 && fabs(d.push.max - 4) < 1e-12);
    assert_true(fabs(d.push.median) < 0.26);
    for (size_t v = 0; v < shape.nv; v++) assert_true(disagreement[v] >= push[v]);
    /* one raised vertex pulls up the triangle below it */
    shift(&half, 0, 0, 0.125);
    half.V[3 * 12 + 2] = 1;
    d = compare(&shape, &half, &fields);
    assert_true(d.pull.max == 1);
    size_t raised = 0;
    for (size_t v = 0; v < shape.nv; v++) raised += disagreement[v] == 1 && push[v] < 1;
    assert_int_equal(raised, 3);
    for (size_t v = 0; v < shape.nv; v++) assert_true(disagreement[v] >= push[v]);
    apsm_mesh_free(&shape);
    apsm_mesh_free(&half);
}

/* Area weights: refining one half of the shape moves the unweighted mean, not push. */
static void push_does_not_depend_on_the_triangles(void **state)
{
    (void)state;
    apsm_mesh coarse = shape_plane(16, 4, 8, 2), fine = shape_plane(16, 4, 8, 2);
    apsm_mesh line = shape_plane(1, 4, 1, 2);
    for (size_t v = 0; v < fine.nv; v++) { /* denser to the right: x = 8 (1 - (1 - x/8)^2) */
        const double x = 1 - fine.V[3 * v] / 8;
        fine.V[3 * v] = 8 * (1 - x * x);
    }
    const apsm_surface_distance a = compare(&coarse, &line, NULL), b = compare(&fine, &line, NULL);
    assert_true(fabs(a.push.mean - 49.0 / 16) < 0.02 && fabs(b.push.mean - 49.0 / 16) < 0.02);
    assert_true(fabs(a.two_way.mean - b.two_way.mean) > 0.5);
    apsm_mesh_free(&coarse);
    apsm_mesh_free(&fine);
    apsm_mesh_free(&line);
}

/* Shape 2, which is larger than its particles say, in the place of template 1: every other shape is
 * missed by about 0.5; the mean over all but the template (1, 2, 3, 0 in turn) has that and exact
 * ones in it. */
static void check_other_templates(size_t I, size_t J, const double *P, const apsm_mesh *mesh)
{
    const apsm_mesh_source source = apsm_mesh_source_array(mesh);
    apsm_surface_aggregate one, all, none;
    apsm_surface_distance d[8];
    apsm_warp warp;
    double mean = 0;
    assert_int_equal(apsm_other_templates(ctx, I, J, P, &source, 1, 1, &one), APSM_OK);
    assert_int_equal(apsm_other_templates(ctx, I, J, P, &source, 1, 99, &all), APSM_OK);
    assert_int_equal(apsm_other_templates(ctx, I, J, P, &source, 1, 0, &none), APSM_OK);
    assert_int_equal(apsm_warp_build(ctx, APSM_PHI_R, mesh[2].nv, mesh[2].V, J, P + 6 * J, &warp),
                     APSM_OK);
    assert_int_equal(apsm_surface_distances(ctx, &warp, &mesh[2], I, P, &source, d), APSM_OK);
    for (size_t i = 0; i < I; i++) mean += i == 2 ? 0 : d[i].two_way.mean / (double)(I - 1);
    golden_close("other", 1, &one.mean, &mean, 1e-12);
    assert_true(one.mean > 0.25 && none.mean == 0 && all.max >= one.max);
    assert_true(all.mean < one.mean && all.mean > one.mean / (double)(I - 1));
    apsm_warp_free(&warp);
}

/* An affine cohort of ellipsoids with the vertices' own particles is reconstructed exactly; a
 * shape whose mesh lies 0.5 beside its particles is 0.5 away. */
static void cohorts_are_measured(void **state)
{
    (void)state;
    enum { I = 4 };
    apsm_mesh mesh[I];
    const size_t stride = 5;
    for (size_t i = 0; i < I; i++) mesh[i] = shape_ellipsoid(3, 10 + (double)i, 8, 6);
    const size_t J = mesh[0].nv / stride;
    double *P = malloc(I * 3 * J * sizeof *P);
    assert_non_null(P);
    for (size_t i = 0; i < I; i++)
        for (size_t j = 0; j < J; j++)
            memcpy(P + 3 * (i * J + j), mesh[i].V + 3 * stride * j, 3 * sizeof *P);
    for (size_t k = 0; k < mesh[2].nv; k++) /* outwards, so that it is 0.5 everywhere */
        for (size_t a = 0; a < 3; a++) mesh[2].V[3 * k + a] *= 1.05;
    apsm_warp warp;
    apsm_surface_distance d[I], again[I];
    apsm_surface_summary s;
    const apsm_mesh_source source = apsm_mesh_source_array(mesh);
    assert_int_equal(apsm_warp_build(ctx, APSM_PHI_R, mesh[1].nv, mesh[1].V, J, P + 3 * J, &warp),
                     APSM_OK);
    assert_int_equal(apsm_surface_distances(ctx, &warp, &mesh[1], I, P, &source, d), APSM_OK);
    apsm_context_set_threads(ctx, 3);
    assert_int_equal(apsm_surface_distances(ctx, &warp, &mesh[1], I, P, &source, again), APSM_OK);
    apsm_context_set_threads(ctx, 1);
    assert_memory_equal(d, again, sizeof d);
    for (size_t i = 0; i < I; i++) {
        if (i != 2 && !(d[i].two_way.max < 1e-8)) fail_msg("shape %zu: %g", i, d[i].two_way.max);
        if (i == 2 && !(d[i].two_way.mean > 0.25 && d[i].two_way.max < 0.61))
            fail_msg("shape 2: %g %g", d[i].two_way.mean, d[i].two_way.max);
    }
    apsm_surface_summarize(I, d, 1, &s);
    golden_close("mean", 1, &s.two_way.mean, &(double){ d[2].two_way.mean / (I - 1) }, 1e-6);
    golden_close("max", 1, &s.two_way.max, &d[2].two_way.max, 0);
    golden_close("mean of max", 1, &s.two_way.mean_max, &(double){ d[2].two_way.max / (I - 1) },
                 1e-6);
    golden_close("push", 1, &s.push.mean, &(double){ d[2].push.mean / (I - 1) }, 1e-6);
    apsm_warp_free(&warp);
    check_other_templates(I, J, P, mesh);
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
    free(P);
}

/* Three templates share 26 shapes: one of them, that of shapes 1, 4, 7 ..., meets the one shape
 * that is larger than its particles say. */
static void other_templates_share_the_shapes(void **state)
{
    (void)state;
    enum { I = 26, LARGER = 4, SHARE = 9 };
    apsm_mesh mesh[I];
    apsm_surface_aggregate a;
    for (size_t i = 0; i < I; i++) mesh[i] = shape_ellipsoid(2, 10 + (double)i, 8, 6);
    const size_t J = mesh[0].nv / 5;
    double *P = malloc(I * 3 * J * sizeof *P);
    assert_non_null(P);
    for (size_t i = 0; i < I; i++)
        for (size_t j = 0; j < J; j++)
            memcpy(P + 3 * (i * J + j), mesh[i].V + 15 * j, 3 * sizeof *P);
    for (size_t k = 0; k < 3 * mesh[LARGER].nv; k++) mesh[LARGER].V[k] *= 1.05;
    const apsm_mesh_source source = apsm_mesh_source_array(mesh);
    assert_int_equal(apsm_other_templates(ctx, I, J, P, &source, 0, 3, &a), APSM_OK);
    assert_true(a.max > 0.3);
    golden_close("shared", 1, &a.mean_max, &(double){ a.max / (3 * SHARE) }, 1e-6);
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
    free(P);
}

static void refuses_empty_and_infinite_meshes(void **state)
{
    (void)state;
    apsm_mesh a = shape_icosphere(0), none = { 0 };
    apsm_surface_distance d;
    assert_int_equal(apsm_surface_distance_between(ctx, &a, NULL, &none, NULL, &d),
                     APSM_ERR_GEOMETRY);
    a.V[4] = NAN;
    assert_int_equal(apsm_surface_distance_between(ctx, &a, NULL, &a, NULL, &d),
                     APSM_ERR_NONFINITE);
    apsm_mesh_free(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_golden),
        cmocka_unit_test(summaries_are_known),
        cmocka_unit_test(concentric_spheres),
        cmocka_unit_test(translated_spheres),
        cmocka_unit_test(push_sees_what_pull_cannot),
        cmocka_unit_test(push_does_not_depend_on_the_triangles),
        cmocka_unit_test(cohorts_are_measured),
        cmocka_unit_test(other_templates_share_the_shapes),
        cmocka_unit_test(refuses_empty_and_infinite_meshes),
    };
    return cmocka_run_group_tests_name("surface_distance", tests, set_up, tear_down);
}
