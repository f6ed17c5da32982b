/* The surface of a ball on a grid: closed, outward, of known size. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "geometry/isosurface.h"
#include "geometry/topology.h"

enum { N = 41 };
static const size_t n[3] = { N, N + 2, N + 4 };

/* Signed distance to a ball, negative inside, or its square with values that are integers. */
static float *ball(double radius, bool squared)
{
    float *const values = malloc(n[0] * n[1] * n[2] * sizeof *values);
    for (size_t k = 0, at = 0; k < n[2]; k++)
        for (size_t j = 0; j < n[1]; j++)
            for (size_t i = 0; i < n[0]; i++) {
                const double x = (double)i - 20.0, y = (double)j - 21.0, z = (double)k - 22.0;
                const double d2 = x * x + y * y + z * z;
                values[at++] = (float)(squared ? d2 - radius * radius : sqrt(d2) - radius);
            }
    return values;
}

static void expect_ball(const apsm_mesh *mesh, double radius, double tolerance)
{
    const double pi = acos(-1.0), volume = 4.0 / 3.0 * pi * pow(radius, 3);
    apsm_mesh_defects defects;
    assert_int_equal(apsm_mesh_inspect(mesh, &defects), APSM_OK);
    if (!apsm_mesh_is_closed_manifold(&defects))
        fail_msg("%zu borders, %zu non-manifold, %zu flipped, %zu degenerate", defects.border_edges,
                 defects.nonmanifold_edges, defects.flipped_edges, defects.degenerate_faces);
    assert_int_equal(defects.components, 1);
    assert_int_equal(defects.unused_vertices, 0);
    if (!(fabs(apsm_mesh_volume(mesh) / volume - 1.0) < tolerance))
        fail_msg("volume %g, not %g", apsm_mesh_volume(mesh), volume);
    double lo[3], hi[3];
    apsm_mesh_bounds(mesh, lo, hi);
    for (int c = 0; c < 3; c++) { /* in index coordinates, the ball about (20, 21, 22) */
        assert_true(fabs(0.5 * (lo[c] + hi[c]) - 20.0 - c) < 1e-3);
        assert_true(fabs(hi[c] - lo[c] - 2.0 * radius) < 0.02);
    }
}

static void a_ball_faces_outward(void **state)
{
    (void)state;
    apsm_context *const ctx = apsm_context_new();
    float *const values = ball(12.3, false);
    apsm_mesh mesh = { 0 };
    assert_int_equal(apsm_isosurface(ctx, n, values, 0.0, &mesh), APSM_OK);
    expect_ball(&mesh, 12.3, 5e-3);
    apsm_mesh_free(&mesh);
    assert_int_equal(apsm_isosurface(ctx, n, values, 2.0, &mesh), APSM_OK);
    expect_ball(&mesh, 14.3, 5e-3);
    apsm_mesh_free(&mesh);
    free(values);
    apsm_context_free(ctx);
}

/* |x|^2 - 15^2 is exactly 0 at many nodes, such as (15,0,0), (9,12,0) and (10,10,5). */
static void exact_zeros_make_no_degenerate_triangles(void **state)
{
    (void)state;
    apsm_context *const ctx = apsm_context_new();
    float *const values = ball(15.0, true);
    size_t zeros = 0;
    for (size_t i = 0; i < n[0] * n[1] * n[2]; i++) zeros += values[i] == 0.0f;
    assert_true(zeros > 50);
    apsm_mesh mesh = { 0 };
    assert_int_equal(apsm_isosurface(ctx, n, values, 0.0, &mesh), APSM_OK);
    expect_ball(&mesh, 15.0, 5e-3);
    apsm_mesh_free(&mesh);
    free(values);
    apsm_context_free(ctx);
}

/* Every way in which a cell can be cut occurs, and cells fit each other; values times anything give
 * the same triangles. */
static void noise_makes_closed_manifolds(void **state)
{
    (void)state;
    apsm_context *const ctx = apsm_context_new();
    const size_t m[3] = { 14, 15, 16 };
    float values[14 * 15 * 16], scaled[14 * 15 * 16];
    uint32_t seed = 7;
    for (size_t i = 0; i < 14 * 15 * 16; i++) {
        const size_t x[3] = { i % 14, i / 14 % 15, i / 210 };
        bool rim = false;
        for (int c = 0; c < 3; c++) rim = rim || x[c] == 0 || x[c] + 1 == m[c];
        seed = 1664525u * seed + 1013904223u;
        values[i] = rim ? 1.0f : (float)(seed >> 8) / 8388608.0f - 1.0f;
        scaled[i] = 1024.0f * values[i];
    }
    apsm_mesh a, b;
    apsm_mesh_defects d;
    assert_int_equal(apsm_isosurface(ctx, m, values, 0.0, &a), APSM_OK);
    assert_int_equal(apsm_isosurface(ctx, m, scaled, 0.0, &b), APSM_OK);
    assert_int_equal(apsm_mesh_inspect(&a, &d), APSM_OK);
    assert_true(apsm_mesh_is_closed_manifold(&d) && a.nf > 5000);
    assert_true(apsm_mesh_volume(&a) > 0.0);
    assert_true(a.nv == b.nv && a.nf == b.nf);
    assert_memory_equal(a.F, b.F, 3 * a.nf * sizeof *a.F);
    assert_memory_equal(a.V, b.V, 3 * a.nv * sizeof *a.V);
    apsm_mesh_free(&a);
    apsm_mesh_free(&b);
    apsm_context_free(ctx);
}

static void bad_grids_are_refused(void **state)
{
    (void)state;
    apsm_context *const ctx = apsm_context_new();
    float *const values = ball(5.0, false);
    apsm_mesh mesh = { 0 };
    const size_t flat[3] = { 8, 8, 1 };
    assert_int_equal(apsm_isosurface(ctx, flat, values, 0.0, &mesh), APSM_ERR_ARG);
    values[7] = NAN;
    assert_int_equal(apsm_isosurface(ctx, n, values, 0.0, &mesh), APSM_ERR_NONFINITE);
    values[7] = 1.0f;
    assert_int_equal(apsm_isosurface(ctx, n, values, 1e6, &mesh), APSM_ERR_GEOMETRY);
    assert_null(mesh.V);
    free(values);
    apsm_context_free(ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ball_faces_outward),
        cmocka_unit_test(exact_zeros_make_no_degenerate_triangles),
        cmocka_unit_test(noise_makes_closed_manifolds),
        cmocka_unit_test(bad_grids_are_refused),
    };
    return cmocka_run_group_tests_name("isosurface", tests, NULL, NULL);
}
