#include "cmocka_all.h"

#include "apsm/mesh.h"
#include "geometry/affine.h"
#include "shapes.h"

static const double pi = 3.14159265358979323846;

static void cube_measures_are_exact(void **state)
{
    (void)state;
    apsm_mesh cube = shape_cube(3, 2.0);
    double lo[3], hi[3], c[3];
    assert_int_equal(cube.nv, 56);
    assert_int_equal(cube.nf, 108);
    assert_near(apsm_mesh_area(&cube), 24.0, 1e-13);
    assert_near(apsm_mesh_volume(&cube), 8.0, 1e-13);
    apsm_mesh_bounds(&cube, lo, hi);
    apsm_mesh_centroid(&cube, c);
    for (int k = 0; k < 3; k++) {
        assert_true(lo[k] == -1.0 && hi[k] == 1.0);
        assert_near(c[k], 0.0, 108.0 * 0x1p-52); /* a sum over 108 faces */
    }
    assert_near(apsm_mesh_mean_edge(&cube), (2.0 + sqrt(2.0)) / 3.0 * 2.0 / 3.0, 1e-14);
    apsm_mesh_free(&cube);
    assert_null(cube.V);
}

static void sphere_and_torus_measures_converge(void **state)
{
    (void)state;
    apsm_mesh sphere = shape_icosphere(5), torus = shape_torus(200, 100, 5.0, 2.0);
    assert_near(apsm_mesh_area(&sphere), 4.0 * pi, 0.01);
    assert_near(apsm_mesh_volume(&sphere), 4.0 / 3.0 * pi, 0.01);
    assert_near(apsm_mesh_area(&torus) / (4.0 * pi * pi * 10.0), 1.0, 1e-3);
    assert_near(apsm_mesh_volume(&torus) / (2.0 * pi * pi * 20.0), 1.0, 2e-3);
    apsm_mesh_free(&sphere);
    apsm_mesh_free(&torus);
}

/* Far from the origin the volume keeps its digits, as it is measured from a vertex.  Coordinates
 * are rounded to 2^-20 first, so that the shift itself loses nothing. */
static void volume_survives_a_shift(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_ellipsoid(3, 3.0, 2.0, 1.0);
    for (size_t i = 0; i < 3 * mesh.nv; i++) mesh.V[i] = ldexp(rint(ldexp(mesh.V[i], 20)), -20);
    const double before = apsm_mesh_volume(&mesh);
    for (size_t i = 0; i < 3 * mesh.nv; i++) mesh.V[i] += 0x1p30;
    assert_near(apsm_mesh_volume(&mesh), before, 1e-12);
    apsm_mesh_free(&mesh);
}

static void vertex_normals_are_known(void **state)
{
    (void)state;
    apsm_mesh cube = shape_cube(2, 2.0), sphere = shape_icosphere(3);
    double *N = malloc(3 * sphere.nv * sizeof *N);
    assert_non_null(N);
    apsm_mesh_vertex_normals(&sphere, N);
    for (size_t i = 0; i < 3 * sphere.nv; i++) assert_near(N[i], sphere.V[i], 0.01);
    apsm_mesh_vertex_normals(&cube, N);
    for (size_t v = 0; v < cube.nv; v++) {
        /* Weighted by angle, a corner's normal is the diagonal however its sides are cut. */
        const double *p = cube.V + 3 * v, r = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        for (size_t k = 0; k < 3; k++) assert_near(N[3 * v + k], p[k] / r, 1e-14);
    }
    free(N);
    apsm_mesh_free(&cube);
    apsm_mesh_free(&sphere);
}

static void lonely_vertex_gets_z(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_alloc(4, 2);
    const double V[12] = { 0, 0, 0, 1, 0, 0, 2, 0, 0, 5, 5, 5 }; /* one face, without area */
    const uint32_t F[6] = { 0, 1, 2, 0, 0, 1 };
    double N[12];
    memcpy(mesh.V, V, sizeof V);
    memcpy(mesh.F, F, sizeof F);
    apsm_mesh_vertex_normals(&mesh, N);
    for (int v = 0; v < 4; v++) {
        assert_true(N[3 * v] == 0.0 && N[3 * v + 1] == 0.0);
        assert_true(N[3 * v + 2] == 1.0);
    }
    apsm_mesh_free(&mesh);
}

static void surface_points_interpolate(void **state)
{
    (void)state;
    apsm_mesh cube = shape_cube(1, 2.0);
    double N[24], n[3], x[3];
    apsm_mesh_vertex_normals(&cube, N);
    const apsm_surface_point p = { 0, { 0.25, 0.5, 0.25 } };
    apsm_surface_position(&cube, &p, x);
    for (size_t k = 0; k < 3; k++)
        assert_near(x[k],
                    0.25 * cube.V[3 * cube.F[0] + k] + 0.5 * cube.V[3 * cube.F[1] + k] +
                        0.25 * cube.V[3 * cube.F[2] + k],
                    1e-15);
    apsm_surface_normal(&cube, N, &p, n);
    assert_near(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1.0, 1e-14);
    memset(N, 0, sizeof N); /* normals that cancel: the face's own */
    apsm_surface_normal(&cube, N, &p, n);
    assert_near(n[0], -1.0, 1e-15);
    apsm_mesh_free(&cube);
}

static void mirror_keeps_the_outside_out(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_ellipsoid(2, 3.0, 2.0, 1.0);
    const double before = apsm_mesh_volume(&mesh);
    double M[16];
    apsm_affine_identity(M);
    M[0] = -2.0;
    M[3] = 7.0;
    apsm_mesh_transform(&mesh, M);
    assert_near(apsm_mesh_volume(&mesh), 2.0 * before, 1e-12);
    apsm_mesh_free(&mesh);
}

static void copy_is_deep_and_sizes_are_checked(void **state)
{
    (void)state;
    apsm_mesh a = shape_cube(1, 1.0), b, none;
    assert_ok(apsm_mesh_copy(&a, &b));
    assert_memory_equal(a.V, b.V, 24 * sizeof(double));
    assert_memory_equal(a.F, b.F, 36 * sizeof(uint32_t));
    assert_ptr_not_equal(a.V, b.V);
    assert_int_equal(apsm_mesh_alloc(&none, SIZE_MAX / 8, 1), APSM_ERR_MEMORY);
    assert_null(none.V);
    apsm_mesh_free(&a);
    apsm_mesh_free(&b);
}

/* Every measure of a mesh twice (four, eight times) as large is exactly as many times larger. */
static void measures_scale_exactly(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_ellipsoid(3, 3.0, 2.0, 1.1), big;
    double *N = malloc(3 * mesh.nv * sizeof *N), *M = malloc(3 * mesh.nv * sizeof *M);
    assert_true(N && M);
    assert_ok(apsm_mesh_copy(&mesh, &big));
    for (size_t i = 0; i < 3 * big.nv; i++) big.V[i] *= 1024.0;
    assert_true(apsm_mesh_area(&big) == 0x1p20 * apsm_mesh_area(&mesh));
    assert_true(apsm_mesh_volume(&big) == 0x1p30 * apsm_mesh_volume(&mesh));
    assert_true(apsm_mesh_mean_edge(&big) == 0x1p10 * apsm_mesh_mean_edge(&mesh));
    apsm_mesh_vertex_normals(&mesh, N);
    apsm_mesh_vertex_normals(&big, M);
    assert_memory_equal(N, M, 3 * mesh.nv * sizeof *N);
    free(N);
    free(M);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&big);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cube_measures_are_exact),
        cmocka_unit_test(sphere_and_torus_measures_converge),
        cmocka_unit_test(volume_survives_a_shift),
        cmocka_unit_test(vertex_normals_are_known),
        cmocka_unit_test(lonely_vertex_gets_z),
        cmocka_unit_test(surface_points_interpolate),
        cmocka_unit_test(mirror_keeps_the_outside_out),
        cmocka_unit_test(copy_is_deep_and_sizes_are_checked),
        cmocka_unit_test(measures_scale_exactly),
    };
    return cmocka_run_group_tests_name("mesh", tests, NULL, NULL);
}
