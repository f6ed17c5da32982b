/* Non-rigid registration: known maps are found, tips arrive at tips, the sides of a sheet stay
 * apart. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "align/registration.h"
#include "geometry/bvh.h"
#include "shapes.h"

enum { POINTS = 400 };

/* Bends about the y axis: curvature `bend`. */
static void bend(double curvature, const double x[3], double y[3])
{
    const double angle = curvature * x[0], r = 1 / curvature + x[2];
    y[0] = r * sin(angle);
    y[1] = x[1];
    y[2] = r * cos(angle) - 1 / curvature;
}

static apsm_mesh bent(const apsm_mesh *mesh, double curvature)
{
    apsm_mesh other;
    assert_int_equal(apsm_mesh_copy(mesh, &other), APSM_OK);
    for (size_t v = 0; v < mesh->nv; v++) bend(curvature, mesh->V + 3 * v, other.V + 3 * v);
    return other;
}

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* Moves points of `from` (X, N: n x 3) to where registration to `to` takes them. */
static void move(const apsm_mesh *from, const apsm_mesh *to, size_t n, double *X, double *N)
{
    apsm_cloud a, b;
    apsm_registration *r;
    assert_int_equal(apsm_cloud_sample(from, POINTS, 0, 0, &a), APSM_OK);
    assert_int_equal(apsm_cloud_sample(to, POINTS, 0, 1, &b), APSM_OK);
    assert_int_equal(apsm_registration_new(&a, &r), APSM_OK);
    double *work = malloc(apsm_registration_work_size(r, POINTS) * sizeof *work);
    assert_non_null(work);
    assert_int_equal(apsm_registration_move(r, &b, n, X, N, work), APSM_OK);
    free(work);
    apsm_registration_free(r);
    apsm_cloud_free(&a);
    apsm_cloud_free(&b);
}

/* Every vertex of a rod 10 : 1 and where bending by 69 degrees takes it: the ends move by twice
 * the rod's thickness, so that closest points are of no use. */
static void bend_of_a_rod_is_found(void **state)
{
    (void)state;
    apsm_mesh rod = shape_ellipsoid(3, 60, 6, 6), other = bent(&rod, 0.01);
    double *X = malloc(6 * rod.nv * sizeof *X), *N = X + 3 * rod.nv, worst = 0, sum = 0, before = 0;
    assert_non_null(X);
    memcpy(X, rod.V, 3 * rod.nv * sizeof *X);
    apsm_mesh_vertex_normals(&rod, N);
    move(&rod, &other, rod.nv, X, N);
    for (size_t v = 0; v < rod.nv; v++) {
        const double d = distance(X + 3 * v, other.V + 3 * v);
        sum += d / (double)rod.nv;
        worst = fmax(worst, d);
        before = fmax(before, distance(rod.V + 3 * v, other.V + 3 * v));
    }
    assert_true(before > 15);
    if (!(sum < 2 && worst < 6)) fail_msg("off by %g in the mean, at most %g", sum, worst);
    free(X);
    apsm_mesh_free(&rod);
    apsm_mesh_free(&other);
}

/* Normals turn along: those of the moved vertices are the bent mesh's. */
static void normals_turn_along(void **state)
{
    (void)state;
    apsm_mesh rod = shape_ellipsoid(3, 60, 6, 6), other = bent(&rod, 0.01);
    double *X = malloc(9 * rod.nv * sizeof *X), *N = X + 3 * rod.nv, *VN = N + 3 * rod.nv, sum = 0;
    assert_non_null(X);
    memcpy(X, rod.V, 3 * rod.nv * sizeof *X);
    apsm_mesh_vertex_normals(&rod, N);
    apsm_mesh_vertex_normals(&other, VN);
    move(&rod, &other, rod.nv, X, N);
    for (size_t v = 0; v < rod.nv; v++) {
        const double *n = N + 3 * v, *m = VN + 3 * v;
        sum += (n[0] * m[0] + n[1] * m[1] + n[2] * m[2]) / (double)rod.nv;
        assert_true(fabs(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-12);
    }
    if (!(sum > 0.97)) fail_msg("mean cosine %g", sum);
    free(X);
    apsm_mesh_free(&rod);
    apsm_mesh_free(&other);
}

/* A sheet 40 times as wide as thick, bent so that its edges move by ten times its thickness: the
 * upper side's vertices come to lie above the lower side's, nearly all of them. */
static void sides_of_a_sheet_stay_apart(void **state)
{
    (void)state;
    apsm_mesh sheet = shape_box((size_t[3]){ 20, 16, 1 }, (double[3]){ 50, 40, 1.2 });
    apsm_mesh other = bent(&sheet, 0.025);
    const size_t n = sheet.nv;
    double *X = malloc(6 * n * sizeof *X), *N = X + 3 * n;
    assert_non_null(X);
    memcpy(X, sheet.V, 3 * n * sizeof *X);
    apsm_mesh_vertex_normals(&sheet, N);
    move(&sheet, &other, n, X, N);
    size_t crossed = 0, pairs = 0;
    for (size_t v = 0; v < n / 2; v++) { /* box vertices: lower layer first */
        const double *lower = X + 3 * v, *upper = X + 3 * (v + n / 2);
        double up[3];
        if (fabs(sheet.V[3 * v]) > 24 || fabs(sheet.V[3 * v + 1]) > 19) continue; /* the rim */
        for (int c = 0; c < 3; c++)
            up[c] = other.V[3 * (v + n / 2) + (size_t)c] - other.V[3 * v + (size_t)c];
        pairs++;
        crossed += (upper[0] - lower[0]) * up[0] + (upper[1] - lower[1]) * up[1] +
                       (upper[2] - lower[2]) * up[2] <=
                   0;
    }
    assert_true(pairs > 200);
    assert_int_equal(crossed, 0);
    free(X);
    apsm_mesh_free(&sheet);
    apsm_mesh_free(&other);
}

/* A shape registered to itself (other points of it) stays, and so it does at any size. */
static void equal_shapes_stay_and_units_do_not_matter(void **state)
{
    (void)state;
    apsm_mesh body = shape_ellipsoid(3, 30, 20, 14);
    const size_t n = 3 * body.nv;
    double *X = malloc(4 * n * sizeof *X), *N = X + n, *Y = N + n, *O = Y + n, worst = 0;
    assert_non_null(X);
    memcpy(X, body.V, n * sizeof *X);
    apsm_mesh_vertex_normals(&body, N);
    memcpy(O, N, n * sizeof *X);
    move(&body, &body, body.nv, X, N);
    for (size_t v = 0; v < body.nv; v++) worst = fmax(worst, distance(X + 3 * v, body.V + 3 * v));
    if (!(worst < 2)) fail_msg("a vertex moved by %g", worst);
    for (size_t k = 0; k < n; k++) Y[k] = body.V[k] *= 1024;
    move(&body, &body, body.nv, Y, O);
    for (size_t k = 0; k < n; k++) assert_true(Y[k] == 1024 * X[k] && O[k] == N[k]);
    free(X);
    apsm_mesh_free(&body);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bend_of_a_rod_is_found),
        cmocka_unit_test(normals_turn_along),
        cmocka_unit_test(sides_of_a_sheet_stay_apart),
        cmocka_unit_test(equal_shapes_stay_and_units_do_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
