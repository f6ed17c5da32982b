/* Planes, spheres, cylinders of known size, and what planes cut of a cube. */
#include "cmocka_all.h"

#include <math.h>
#include <string.h>

#include "core/random.h"
#include "statistics/primitive.h"

enum { N = 60 };
static const double far[3] = { 300, -200, 70 };

static void sphere_of_known_radius(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, 0, 0);
    for (double scale = 1e-6; scale < 1e7; scale *= 1e6) {
        double P[3 * N], centre[3], radius, residual;
        for (size_t k = 0; k < N; k++) { /* a cap, which an algebraic fit finds too small */
            const double z = 0.5 + 0.5 * apsm_random_uniform(&rng),
                         a = 6.3 * apsm_random_uniform(&rng), r = sqrt(1 - z * z);
            const double x[3] = { r * cos(a), r * sin(a), z };
            for (size_t c = 0; c < 3; c++) P[3 * k + c] = scale * (far[c] + 7 * x[c]);
        }
        assert_ok(primitive_sphere(N, P, centre, &radius, &residual));
        assert_true(fabs(radius - 7 * scale) < 1e-9 * scale);
        for (size_t c = 0; c < 3; c++) assert_true(fabs(centre[c] - scale * far[c]) < 1e-9 * scale);
        assert_true(residual < 1e-9 * scale);
    }
}

/* With noise: no other centre and radius has a smaller sum of squares. */
static void sphere_is_a_minimum(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, 1, 0);
    double P[3 * N], x[4], residual;
    for (size_t k = 0; k < N; k++) {
        double length = 0;
        for (size_t c = 0; c < 3; c++) P[3 * k + c] = apsm_random_normal(&rng);
        for (size_t c = 0; c < 3; c++) length += P[3 * k + c] * P[3 * k + c];
        const double r = (5 + 0.3 * apsm_random_normal(&rng)) / sqrt(length);
        for (size_t c = 0; c < 3; c++) P[3 * k + c] = fabs(P[3 * k + c]) * r;
    }
    assert_ok(primitive_sphere(N, P, x, &x[3], &residual));
    for (size_t c = 0; c < 8; c++) {
        double y[4], sum = 0;
        memcpy(y, x, sizeof y);
        y[c / 2] += c % 2 ? 1e-3 : -1e-3;
        for (size_t k = 0; k < N; k++) {
            const double *p = P + 3 * k;
            const double d = hypot(hypot(p[0] - y[0], p[1] - y[1]), p[2] - y[2]) - y[3];
            sum += d * d;
        }
        assert_true(sqrt(sum / N) > residual);
    }
}

static void cylinder_of_known_radius(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, 2, 0);
    const double u[3] = { 0.6, 0.8, 0 }, v[3] = { 0, 0, 1 }, d[3] = { 0.8, -0.6, 0 };
    double P[3 * N], M[3 * N], at[3], axis[3], radius, residual;
    for (size_t k = 0; k < N; k++) { /* half around; normals off by some degrees */
        const double a = 3.1 * apsm_random_uniform(&rng), t = 4 * apsm_random_uniform(&rng);
        double length = 0;
        for (size_t c = 0; c < 3; c++) {
            const double n = cos(a) * u[c] + sin(a) * v[c];
            P[3 * k + c] = far[c] + 2.5 * n + t * d[c];
            M[3 * k + c] = n + 0.1 * apsm_random_normal(&rng);
            length += M[3 * k + c] * M[3 * k + c];
        }
        for (size_t c = 0; c < 3; c++) M[3 * k + c] /= sqrt(length);
    }
    assert_ok(primitive_cylinder(N, P, M, at, axis, &radius, &residual));
    assert_true(fabs(radius - 2.5) < 1e-7 && residual < 1e-7);
    assert_true(fabs(fabs(axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2]) - 1) < 1e-12);
}

static void what_does_not_fit_is_refused(void **state)
{
    (void)state;
    double P[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0 }, a[3], b[3], r, e;
    assert_int_equal(primitive_sphere(4, P, a, &r, &e), APSM_ERR_GEOMETRY);
    assert_int_equal(primitive_sphere(3, P, a, &r, &e), APSM_ERR_ARG);
    const double line[9] = { 0, 0, 0, 1, 1, 1, 2, 2, 2 };
    assert_int_equal(primitive_plane(3, line, a, b), APSM_ERR_GEOMETRY);
    assert_ok(primitive_plane(3, P, a, b));
    assert_true(fabs(b[2] - 1) < 1e-15); /* the points turn about +z */
}

/* The unit cube moved by `from` and turned inside out if inward, behind what mesh has. */
static void add_cube(double from, double side, apsm_mesh *mesh)
{
    static const uint32_t F[36] = { 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                    2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5 };
    for (uint32_t k = 0; k < 8; k++)
        for (uint32_t c = 0; c < 3; c++)
            mesh->V[3 * (mesh->nv + k) + c] = from + ((k >> c) & 1) * side;
    for (size_t k = 0; k < 36; k++) mesh->F[3 * mesh->nf + k] = F[k] + (uint32_t)mesh->nv;
    mesh->nv += 8;
    mesh->nf += 12;
}

static void planes_cut_cubes(void **state)
{
    (void)state;
    double V[48], segment[6 * 24];
    uint32_t F[72];
    size_t loop[24];
    apsm_mesh mesh = { 0, 0, V, F };
    add_cube(0, 1, &mesh);
    add_cube(5, 2, &mesh);
    const double centre[3] = { 0.3, 0.3, 0.5 }, up[3] = { 0, 0, 1 };
    const size_t n = primitive_cut(&mesh, 0, mesh.nf, centre, up, segment);
    primitive_loops(n, segment, loop);
    assert_int_equal(n, 8);
    for (size_t k = 0; k < n; k++) assert_int_equal(loop[k], loop[0]);
    assert_true(fabs(primitive_enclosed(n, segment, loop, loop[0], up) - 1) < 1e-14);
    /* The diagonal x = y = z cuts both in hexagons of 3 sqrt(3) / 4 side^2 at their middles. */
    const double s = 1 / sqrt(3), diagonal[3] = { s, s, s }, middle[3] = { 0.5, 0.5, 0.5 };
    const size_t m = primitive_cut(&mesh, 0, 12, middle, diagonal, segment);
    assert_true(fabs(primitive_enclosed(m, segment, NULL, SIZE_MAX, diagonal) - 3 * sqrt(3) / 4) <
                1e-14);
    /* x = y cuts both: two curves, 1 and 4 times sqrt(2). */
    const double across[3] = { sqrt(0.5), -sqrt(0.5), 0 }, origin[3] = { 0.01, 0, 0 };
    const size_t both = primitive_cut(&mesh, 0, mesh.nf, origin, across, segment);
    primitive_loops(both, segment, loop);
    const double one = primitive_enclosed(both, segment, loop, loop[0], across),
                 all = primitive_enclosed(both, segment, NULL, SIZE_MAX, across);
    assert_true(fabs(one - 0.99 * sqrt(2)) < 1e-12);
    assert_true(fabs(all - (0.99 + 2 * 1.99) * sqrt(2)) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sphere_of_known_radius),       cmocka_unit_test(sphere_is_a_minimum),
        cmocka_unit_test(cylinder_of_known_radius),     cmocka_unit_test(planes_cut_cubes),
        cmocka_unit_test(what_does_not_fit_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
