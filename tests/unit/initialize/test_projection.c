/* Projection keeps its side of a thin plate and separates what coincides. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "golden.h"
#include "initialize/projection.h"
#include "shapes.h"

static double distance2(const double *a, const double *b)
{
    return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
           (a[2] - b[2]) * (a[2] - b[2]);
}

static apsm_bvh *tree(const apsm_mesh *mesh)
{
    apsm_bvh *bvh;
    assert_int_equal(apsm_bvh_build(mesh, &bvh), APSM_OK);
    return bvh;
}

/* The reference's upper side lies below the thin plate's lower side: closest points would be on
 * the wrong side. */
static void stays_on_its_side_of_a_sheet(void **state)
{
    (void)state;
    apsm_mesh plate = shape_box((size_t[3]){ 10, 10, 1 }, (double[3]){ 10, 10, 0.4 });
    apsm_bvh *bvh = tree(&plate);
    double X[6] = { 1.3, 2.1, -0.5, 1.3, 2.1, 0.6 }, N[6] = { 0, 0, 1, 0, 0, -1 }, P[6];
    apsm_surface_point S[2];
    const apsm_projection_options o = apsm_projection_defaults(1.0);
    size_t close;
    apsm_project_particles(bvh, 2, X, N, &o, S, P, &close);
    assert_true(fabs(P[2] - 0.2) < 1e-12 && fabs(P[5] + 0.2) < 1e-12);
    for (size_t j = 0; j < 2; j++) {
        double x[3];
        apsm_surface_position(&plate, S + j, x);
        golden_close("position", 3, x, P + 3 * j, 1e-12);
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&plate);
}

/* A normal that nothing near agrees with: the closest point. */
static void falls_back_to_the_closest_point(void **state)
{
    (void)state;
    apsm_mesh sphere = shape_icosphere(3);
    apsm_bvh *bvh = tree(&sphere);
    const double X[3] = { 1.2, 0, 0 }, N[3] = { -1, 0, 0 };
    double P[3];
    apsm_surface_point S;
    const apsm_projection_options o = apsm_projection_defaults(0.2);
    apsm_project_particles(bvh, 1, X, N, &o, &S, P, NULL);
    assert_true(P[0] > 0.98);
    apsm_bvh_free(bvh);
    apsm_mesh_free(&sphere);
}

static void coincident_particles_part(void **state)
{
    (void)state;
    enum { J = 12 };
    apsm_mesh sphere = shape_icosphere(4);
    apsm_bvh *bvh = tree(&sphere);
    double X[3 * J], N[3 * J], P[3 * J], Q[3 * J];
    apsm_surface_point S[J];
    for (size_t j = 0; j < J; j++) { /* two heaps of six on one ray each */
        const double n[3] = { j % 2 ? 1 : 0, j % 2 ? 0 : 1, 0 };
        for (size_t k = 0; k < 3; k++) {
            N[3 * j + k] = n[k];
            X[3 * j + k] = (1.0 + 0.1 * (double)(j / 4)) * n[k];
        }
    }
    const apsm_projection_options o = apsm_projection_defaults(0.2);
    size_t close;
    apsm_project_particles(bvh, J, X, N, &o, S, P, &close);
    assert_int_equal(close, 0);
    for (size_t j = 0; j < J; j++)
        for (size_t k = 0; k < j; k++) assert_true(distance2(P + 3 * j, P + 3 * k) >= 0.01);
    apsm_project_particles(bvh, J, X, N, &o, S, Q, NULL);
    assert_memory_equal(P, Q, sizeof P);
    apsm_bvh_free(bvh);
    apsm_mesh_free(&sphere);
}

/* A sphere's particles on an ellipsoid: where they are apart, nothing but the closest point. */
static void well_spread_particles_are_only_projected(void **state)
{
    (void)state;
    apsm_mesh sphere = shape_icosphere(1), body = shape_ellipsoid(4, 1.2, 1.0, 0.9);
    apsm_bvh *bvh = tree(&body);
    double P[3 * 42];
    apsm_surface_point S[42];
    const apsm_projection_options o = apsm_projection_defaults(0.5);
    size_t close;
    apsm_project_particles(bvh, sphere.nv, sphere.V, sphere.V, &o, S, P, &close);
    assert_int_equal(close, 0);
    for (size_t j = 0; j < sphere.nv; j++) {
        apsm_closest c;
        apsm_bvh_closest(bvh, sphere.V + 3 * j, INFINITY, &c);
        golden_close("closest", 3, P + 3 * j, c.x, 1e-12);
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&sphere);
    apsm_mesh_free(&body);
}

/* Particles above each other on a sheet thinner than their least separation stay there; two on one
 * side do not. */
static void sides_of_a_sheet_do_not_push_each_other(void **state)
{
    (void)state;
    apsm_mesh plate = shape_box((size_t[3]){ 10, 10, 1 }, (double[3]){ 10, 10, 0.4 });
    apsm_bvh *bvh = tree(&plate);
    const double X[9] = { 1.3, 2.1, 0.3, 1.3, 2.1, -0.3, 1.4, 2.1, -0.3 };
    const double N[9] = { 0, 0, 1, 0, 0, -1, 0, 0, -1 };
    double P[9];
    apsm_surface_point S[3];
    const apsm_projection_options o = apsm_projection_defaults(1.0);
    size_t close;
    apsm_project_particles(bvh, 2, X, N, &o, S, P, &close);
    assert_int_equal(close, 0);
    assert_true(fabs(P[0] - P[3]) < 1e-12 && fabs(P[1] - P[4]) < 1e-12);
    apsm_project_particles(bvh, 3, X, N, &o, S, P, &close);
    assert_int_equal(close, 0);
    assert_true(distance2(P + 3, P + 6) >= 0.25 && fabs(P[0] - 1.3) < 1e-12);
    apsm_bvh_free(bvh);
    apsm_mesh_free(&plate);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sides_of_a_sheet_do_not_push_each_other),
        cmocka_unit_test(stays_on_its_side_of_a_sheet),
        cmocka_unit_test(falls_back_to_the_closest_point),
        cmocka_unit_test(coincident_particles_part),
        cmocka_unit_test(well_spread_particles_are_only_projected),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
