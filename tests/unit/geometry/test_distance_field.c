#include "cmocka_all.h"

#include "geometry/distance_field.h"
#include "golden.h"
#include "shapes.h"

/* A mesh with its tree and field. */
typedef struct fixture {
    apsm_context *ctx;
    apsm_mesh mesh;
    apsm_bvh *bvh;
    apsm_field *field;
} fixture;

/* The tree borrows the mesh, so the fixture must stay where it is: on the heap. */
static fixture *make(apsm_mesh mesh, double voxel, double band)
{
    fixture *f = malloc(sizeof *f);
    assert_non_null(f);
    f->mesh = mesh;
    f->ctx = apsm_context_new();
    assert_non_null(f->ctx);
    assert_ok(apsm_bvh_build(&f->mesh, &f->bvh));
    assert_ok(apsm_field_build(f->ctx, f->bvh, voxel, band, &f->field));
    return f;
}

static void drop(fixture *f)
{
    apsm_field_free(f->field);
    apsm_bvh_free(f->bvh);
    apsm_mesh_free(&f->mesh);
    apsm_context_free(f->ctx);
    free(f);
}

/* ---- dense grid, against snap.json ---- */

typedef struct snap {
    json_t *root;
    size_t n[3];
    double spacing, *origin, *centre, radius, *values, *points;
} snap;

enum { POINTS = 24 };

static snap load_snap(void)
{
    snap s = { .root = golden_load("snap") };
    const json_t *grid = golden_get(s.root, "grid"), *sphere = golden_get(s.root, "sphere");
    const size_t n = (size_t)golden_number(grid, "n");
    s.n[0] = s.n[1] = s.n[2] = n;
    s.spacing = golden_number(grid, "spacing");
    s.origin = golden_member(grid, "origin", 3);
    s.centre = golden_member(sphere, "centre", 3);
    s.radius = golden_number(sphere, "radius");
    s.points = golden_member(s.root, "points", 3 * POINTS);
    s.values = malloc(n * n * n * sizeof *s.values);
    assert_non_null(s.values);
    for (size_t i = 0; i < n * n * n; i++) {
        const double x = s.origin[0] + s.spacing * (double)(i % n) - s.centre[0],
                     y = s.origin[1] + s.spacing * (double)(i / n % n) - s.centre[1],
                     z = s.origin[2] + s.spacing * (double)(i / n / n) - s.centre[2];
        s.values[i] = sqrt(x * x + y * y + z * z) - s.radius;
    }
    return s;
}

static void free_snap(snap *s)
{
    json_decref(s->root);
    free(s->origin);
    free(s->centre);
    free(s->points);
    free(s->values);
}

static void check_golden(const snap *s, const char *key, size_t count, const double *got)
{
    double *want = golden_member(s->root, key, count);
    golden_close(key, count, got, want, 1e-9);
    free(want);
}

static void dense_grid_equals_golden(void **state)
{
    (void)state;
    snap s = load_snap();
    double D[POINTS], N[3 * POINTS], X[3 * POINTS];
    apsm_grid_sample(s.n, s.origin, s.spacing, s.values, POINTS, s.points, D, N);
    check_golden(&s, "D_trilinear", POINTS, D);
    check_golden(&s, "normal_trilinear", 3 * POINTS, N);
    memcpy(X, s.points, sizeof X);
    for (int times = 1; times <= 3; times++) {
        apsm_grid_sample(s.n, s.origin, s.spacing, s.values, POINTS, X, D, N);
        for (int i = 0; i < 3 * POINTS; i++) X[i] -= D[i / 3] * N[i];
        if (times == 1) check_golden(&s, "snapped_grid_1", 3 * POINTS, X);
    }
    check_golden(&s, "snapped_grid_3", 3 * POINTS, X);
    free_snap(&s);
}

/* Second-order differences make the gradient of a parabola exact, also at the rim. */
static void dense_rim_is_second_order(void **state)
{
    (void)state;
    const size_t n[3] = { 4, 3, 5 };
    const double origin[3] = { 1.0, 2.0, 3.0 }, h = 0.5;
    double values[60], D, N[3];
    for (size_t i = 0; i < 60; i++) {
        const double x = h * (double)(i % 4), y = h * (double)(i / 4 % 3), z = h * (double)(i / 12);
        values[i] = x * x + 2.0 * y * y - z * z + x * y + 3.0 * x - y + z;
    }
    for (size_t i = 0; i < 60; i++) {
        const double x = h * (double)(i % 4), y = h * (double)(i / 4 % 3), z = h * (double)(i / 12);
        const double X[3] = { 1.0 + x, 2.0 + y, 3.0 + z };
        const double g[3] = { 2.0 * x + y + 3.0, 4.0 * y + x - 1.0, -2.0 * z + 1.0 };
        const double r = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
        apsm_grid_sample(n, origin, h, values, 1, X, &D, N);
        assert_near(D, values[i], 1e-14);
        for (int c = 0; c < 3; c++) assert_near(N[c], g[c] / r, 1e-14);
    }
    const double outside[3] = { 9.0, -9.0, 4.0 }; /* clamped to (2.5, 2, 4) */
    apsm_grid_sample(n, origin, h, values, 1, outside, &D, NULL);
    assert_near(D, 1.5 * 1.5 - 1.0 + 4.5 + 1.0, 1e-14);
}

static void flat_grids_do_not_read_outside(void **state)
{
    (void)state;
    const double values[2] = { 1.0, 3.0 }, origin[3] = { 0 }, X[3] = { 0.25, 0.0, 0.0 };
    double D, N[3];
    apsm_grid_sample((size_t[3]){ 2, 1, 1 }, origin, 1.0, values, 1, X, &D, N);
    assert_near(D, 1.5, 1e-15);
    assert_near(N[0], 1.0, 1e-15);
    apsm_grid_sample((size_t[3]){ 1, 1, 1 }, origin, 1.0, values, 1, X, &D, N);
    assert_near(D, 1.0, 1e-15);
    assert_near(N[2], 1.0, 1e-15);
}

/* ---- sparse field ---- */

/* The field is the dense grid of exact distances, but for float32: with values up to band + 1.75
 * voxels, D errs by 2^-24 of that, and N, a difference of two values, by little more than the
 * same number of voxels; at the rim of the band N may be exact instead. */
static void field_equals_dense_grid(void **state)
{
    (void)state;
    const double voxel = 0.13, band = 0.4;
    fixture *f = make(shape_torus(60, 30, 2.0, 0.8), voxel, band);
    double lo[3], hi[3], origin[3];
    size_t n[3];
    apsm_mesh_bounds(&f->mesh, lo, hi);
    for (int c = 0; c < 3; c++) {
        const double margin = ceil((band + 1.75 * voxel) / voxel);
        origin[c] = lo[c] - margin * voxel;
        n[c] = (size_t)(ceil((hi[c] - lo[c]) / voxel) + 2.0 * margin + 1.0);
    }
    double *values = malloc(n[0] * n[1] * n[2] * sizeof *values);
    assert_non_null(values);
    for (size_t i = 0; i < n[0] * n[1] * n[2]; i++) {
        const double x[3] = { origin[0] + voxel * (double)(i % n[0]),
                              origin[1] + voxel * (double)(i / n[0] % n[1]),
                              origin[2] + voxel * (double)(i / n[0] / n[1]) };
        values[i] = apsm_bvh_signed_distance(f->bvh, x, NULL);
    }
    enum { COUNT = 4000 };
    static double X[3 * COUNT], D[COUNT], N[3 * COUNT], D0[COUNT], N0[3 * COUNT], D1[COUNT];
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    apsm_field_draw(f->field, &rng, band, COUNT, X, D1);
    apsm_field_sample(f->field, COUNT, X, D, N);
    apsm_grid_sample(n, origin, voxel, values, COUNT, X, D0, N0);
    const double tol = 0x1p-24 * (band + 1.75 * voxel);
    for (int i = 0; i < COUNT; i++) {
        apsm_closest at;
        const double exact = apsm_bvh_signed_distance(f->bvh, X + 3 * i, &at);
        const bool rim = fabs(D[i]) > band - 0.75 * voxel;
        assert_true(D[i] == D1[i]);
        assert_near(D[i], D0[i], tol + 1e-14);
        for (int c = 0; c < 3; c++)
            if (!rim || fabs(N[3 * i + c] - (X[3 * i + c] - at.x[c]) / exact) > 1e-12)
                assert_near(N[3 * i + c], N0[3 * i + c], 4.0 * tol / voxel);
    }
    apsm_field_sample(f->field, COUNT, X, D1, NULL);
    assert_memory_equal(D, D1, sizeof D);
    free(values);
    drop(f);
}

/* Trilinear interpolation of a distance errs by at most 3/8 voxel^2 times its curvature; the
 * exact distance of the mesh is itself off the sphere's by the sagitta of its faces. */
static void sphere_distance_and_normal(void **state)
{
    (void)state;
    const double voxel = 0.05, band = 0.2;
    fixture *f = make(shape_icosphere(5), voxel, band);
    enum { COUNT = 5000 };
    static double X[3 * COUNT], D[COUNT], N[3 * COUNT];
    apsm_random rng = apsm_random_stream(2, APSM_STREAM_TEST, 0, 0);
    apsm_field_draw(f->field, &rng, band, COUNT, X, D);
    apsm_field_sample(f->field, COUNT, X, NULL, N);
    for (int i = 0; i < COUNT; i++) {
        const double *x = X + 3 * i, r = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        assert_near(D[i], r - 1.0, 0.375 * voxel * voxel * 2.0 / (1.0 - band) + 4e-4);
        const double *m = N + 3 * i;
        assert_near((x[0] * m[0] + x[1] * m[1] + x[2] * m[2]) / r, 1.0, 1e-3);
        assert_near(m[0] * m[0] + m[1] * m[1] + m[2] * m[2], 1.0, 1e-14);
    }
    drop(f);
}

/* Away from edges a cube's distance is linear, so the field is exact up to float32. */
static void cube_faces_are_exact(void **state)
{
    (void)state;
    const double voxel = 0.1, band = 0.3;
    fixture *f = make(shape_cube(2, 4.0), voxel, band);
    apsm_random rng = apsm_random_stream(3, APSM_STREAM_TEST, 0, 0);
    for (int i = 0; i < 2000; i++) {
        const int axis = i % 3;
        const double d = 0.3 * (2.0 * apsm_random_uniform(&rng) - 1.0), side = i % 2 ? 1.0 : -1.0;
        double x[3], D, N[3];
        for (int c = 0; c < 3; c++) x[c] = 1.2 * (2.0 * apsm_random_uniform(&rng) - 1.0);
        x[axis] = side * (2.0 + d);
        apsm_field_sample(f->field, 1, x, &D, N);
        assert_near(D, d, 0x1p-24 * (band + 2.5 * voxel) + 1e-15);
        assert_near(N[axis], side, 1e-6);
    }
    drop(f);
}

/* A plate two voxels thick has an inside, one much thinner than a voxel at least two sides. */
static void thin_plates_have_two_sides(void **state)
{
    (void)state;
    for (int thin = 0; thin < 2; thin++) {
        const double thickness = thin ? 1e-3 : 0.2, height = 0.5 * thickness + (thin ? 0.25 : 0.15);
        fixture *f =
            make(shape_box((size_t[3]){ 6, 5, 1 }, (double[3]){ 3, 2, thickness }), 0.1, 0.3);
        double D, N[3];
        for (int i = 0; i < 200; i++) {
            const double x[3] = { 0.01 * (i - 100), 0.3, i % 2 ? height : -height };
            apsm_field_sample(f->field, 1, x, &D, N);
            assert_near(D, height - 0.5 * thickness, 1e-6);
            assert_near(N[2], i % 2 ? 1.0 : -1.0, 1e-6);
        }
        const double middle[3] = { 0.2, 0.3, 0.0 };
        apsm_field_sample(f->field, 1, middle, &D, NULL);
        if (!thin) assert_near(D, -0.1, 1e-6);
        drop(f);
    }
}

/* Between nodes a slanted sheet thinner than a voxel has no stored distance near 0: draws from a
 * narrow band must end all the same, and lie in it. */
static void draws_end_on_a_thin_sheet(void **state)
{
    (void)state;
    enum { COUNT = 5 };
    double X[3 * COUNT], D[COUNT];
    apsm_mesh sheet = shape_box((size_t[3]){ 1, 1, 1 }, (double[3]){ 1.07, 1.07, 1e-3 });
    for (size_t v = 0; v < sheet.nv; v++)
        sheet.V[3 * v + 2] += 0.31 * sheet.V[3 * v] - 0.17 * sheet.V[3 * v + 1];
    fixture *f = make(sheet, 0.2, 0.2);
    apsm_random rng = apsm_random_stream(4, APSM_STREAM_TEST, 0, 0);
    apsm_field_draw(f->field, &rng, 2e-3, COUNT, X, D);
    for (int i = 0; i < COUNT; i++) {
        assert_true(fabs(D[i]) <= 2e-3);
        assert_near(D[i], apsm_bvh_signed_distance(f->bvh, X + 3 * i, NULL), 0.1);
    }
    drop(f);
}

/* Far from the surface the answer is the tree's, bit for bit. */
static void outside_the_band_is_exact(void **state)
{
    (void)state;
    fixture *f = make(shape_torus(40, 20, 2.0, 0.8), 0.05, 0.1);
    apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, 0, 0);
    int far = 0;
    for (int i = 0; i < 2000; i++) {
        double x[3], D, N[3];
        apsm_closest c;
        for (int k = 0; k < 3; k++)
            x[k] = (i % 9 ? 3.0 : 1e6) * (2.0 * apsm_random_uniform(&rng) - 1.0);
        const double want = apsm_bvh_signed_distance(f->bvh, x, &c);
        apsm_field_sample(f->field, 1, x, &D, N);
        if (fabs(want) < 0.1 + 4.0 * 0.05) {
            assert_near(D, want, 0.05);
            continue;
        }
        far++;
        assert_true(D == want);
        for (int k = 0; k < 3; k++) assert_near(N[k], (x[k] - c.x[k]) / want, 1e-12);
    }
    assert_true(far > 500);
    drop(f);
}

/* Shells about a torus have volumes in proportion to their thickness. */
static void draws_reach_beyond_the_band(void **state)
{
    (void)state;
    enum { COUNT = 3000 };
    static double X[3 * COUNT], D[COUNT];
    fixture *f = make(shape_torus(60, 30, 2.0, 0.8), 0.05, 0.1);
    apsm_random rng = apsm_random_stream(8, APSM_STREAM_TEST, 0, 0);
    double within = 0.0;
    apsm_field_draw(f->field, &rng, 0.3, COUNT, X, D);
    for (int i = 0; i < COUNT; i++) {
        assert_near(D[i], apsm_bvh_signed_distance(f->bvh, X + 3 * i, NULL), 0.01);
        assert_true(fabs(D[i]) <= 0.3);
        within += fabs(D[i]) <= 0.1;
    }
    assert_near(within / COUNT, 1.0 / 3.0, 0.03);
    drop(f);
}

/* chi-square of counts that should be equal to share[i] * total; beyond mean + 5 sd is a fault. */
static void check_uniform(size_t bins, const double *count, const double *share)
{
    double total = 0.0, chi2 = 0.0;
    for (size_t i = 0; i < bins; i++) total += count[i];
    for (size_t i = 0; i < bins; i++) {
        const double e = total * share[i];
        chi2 += (count[i] - e) * (count[i] - e) / e;
    }
    const double dof = (double)bins - 1.0;
    if (chi2 > dof + 5.0 * sqrt(2.0 * dof)) fail_msg("chi-square %g for %g degrees", chi2, dof);
}

/* On a sphere the volume of a shell is known.  The mesh's own volume and the interpolation move
 * the shells by about 1e-3 of the radius: few enough draws do not see it. */
static void draws_are_uniform(void **state)
{
    (void)state;
    enum { COUNT = 20000, SHELLS = 10 };
    static double X[3 * COUNT], D[COUNT];
    fixture *f = make(shape_icosphere(5), 0.03, 0.3);
    const double bands[] = { 0.3, 0.1, 0.02 };
    for (int b = 0; b < 3; b++) {
        const double band = bands[b];
        apsm_random rng = apsm_random_stream(6, APSM_STREAM_TEST, (uint64_t)b, 0);
        double shell[SHELLS] = { 0 }, octant[8] = { 0 }, share[SHELLS], eighth[8];
        double within[3][8] = { { 0 } }; /* place along each axis in steps of 8 half voxels */
        apsm_field_draw(f->field, &rng, band, COUNT, X, D);
        for (int i = 0; i < COUNT; i++) {
            const double *x = X + 3 * i;
            assert_true(fabs(D[i]) <= band);
            const int k = (int)((D[i] + band) / (2.0 * band) * SHELLS);
            shell[k < SHELLS ? k : SHELLS - 1] += 1.0;
            for (int c = 0; c < 3; c++) {
                const double u = (x[c] + 3.0) / (4.0 * 0.03);
                within[c][(int)(8.0 * (u - floor(u)))] += 1.0;
            }
            octant[(x[0] > 0.0) + 2 * (x[1] > 0.0) + 4 * (x[2] > 0.0)] += 1.0;
        }
        const double all = pow(1.0 + band, 3.0) - pow(1.0 - band, 3.0);
        for (int k = 0; k < SHELLS; k++) {
            const double r = 1.0 - band + 2.0 * band * k / SHELLS, s = r + 2.0 * band / SHELLS;
            share[k] = (pow(s, 3.0) - pow(r, 3.0)) / all;
        }
        for (int k = 0; k < 8; k++) eighth[k] = 0.125;
        check_uniform(SHELLS, shell, share);
        check_uniform(8, octant, eighth);
        for (int c = 0; c < 3; c++) check_uniform(8, within[c], eighth);
    }
    drop(f);
}

/* A thin rod across a large box: the field's memory follows the rod all the same, and points lie
 * evenly along it and on both sides. */
static void draws_are_uniform_on_a_rod_across(void **state)
{
    (void)state;
    enum { COUNT = 20000, PARTS = 16 };
    static double X[3 * COUNT], D[COUNT];
    apsm_mesh rod = shape_box((size_t[3]){ 1, 1, 1 }, (double[3]){ 20.0, 0.1, 0.1 });
    const double s = 1.0 / sqrt(2.0), r = 1.0 / sqrt(3.0), q = s * r;
    for (size_t v = 0; v < rod.nv; v++) { /* x along (1,1,-1) */
        double *x = rod.V + 3 * v;
        const double a = x[0], b = x[1], c = x[2];
        x[0] = r * a + s * b + q * c;
        x[1] = r * a - s * b + q * c;
        x[2] = 2.0 * q * c - r * a;
    }
    fixture *f = make(rod, 0.02, 0.05);
    assert_true(apsm_field_bytes(f->field) < 20000000);
    apsm_random rng = apsm_random_stream(9, APSM_STREAM_TEST, 0, 0);
    double part[PARTS] = { 0 }, side[2] = { 0 }, share[PARTS];
    int drawn = 0;
    apsm_field_draw(f->field, &rng, 0.05, COUNT, X, D);
    for (int i = 0; i < COUNT; i++) {
        const double *x = X + 3 * i, along = r * (x[0] + x[1] - x[2]);
        assert_near(D[i], apsm_bvh_signed_distance(f->bvh, x, NULL), 0.02);
        if (fabs(along) >= 9.0) continue;
        part[(int)((along + 9.0) / 18.0 * PARTS)] += 1.0;
        side[x[0] + x[1] + x[2] > along * r] += 1.0;
        drawn++;
    }
    for (int k = 0; k < PARTS; k++) share[k] = 1.0 / PARTS;
    assert_true(drawn > COUNT / 2);
    check_uniform(PARTS, part, share);
    check_uniform(2, side, (double[2]){ 0.5, 0.5 });
    drop(f);
}

static void draws_repeat_with_the_stream(void **state)
{
    (void)state;
    enum { COUNT = 100 };
    double A[3 * COUNT], B[3 * COUNT];
    fixture *f = make(shape_icosphere(3), 0.05, 0.1), *g = make(shape_icosphere(3), 0.05, 0.1);
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_BAND, 1, 2), same = rng;
    apsm_field_draw(f->field, &rng, 0.1, COUNT, A, NULL);
    apsm_field_draw(g->field, &same, 0.1, COUNT, B, NULL);
    assert_memory_equal(A, B, sizeof A);
    assert_memory_equal(&rng, &same, sizeof rng);
    drop(f);
    drop(g);
}

/* Half the voxel at the same number of voxels in the band: four times the bricks, not eight. */
static void memory_follows_the_surface(void **state)
{
    (void)state;
    size_t bytes[3];
    for (int level = 0; level < 3; level++) {
        const double voxel = 0.04 / (1 << level);
        fixture *f = make(shape_icosphere(4), voxel, 3.0 * voxel);
        bytes[level] = apsm_field_bytes(f->field);
        drop(f);
    }
    for (int level = 0; level < 2; level++)
        assert_near((double)bytes[level + 1] / (double)bytes[level], 4.0, 0.8);
}

/* A shape 2^k as large has exactly the same field, 2^k as large; a shifted one the same but for
 * rounding. */
static void field_scales_and_shifts_with_the_shape(void **state)
{
    (void)state;
    enum { COUNT = 500 };
    static double X[3 * COUNT], Y[3 * COUNT], D[COUNT], E[COUNT], N[3 * COUNT], M[3 * COUNT];
    const double shift[3] = { 123.4, -56.7, 1000.1 };
    apsm_mesh small = shape_torus(30, 20, 2.0, 0.8), big = shape_torus(30, 20, 2.0, 0.8),
              far = shape_torus(30, 20, 2.0, 0.8);
    for (size_t i = 0; i < 3 * big.nv; i++) {
        big.V[i] *= 0x1p60;
        far.V[i] += shift[i % 3];
    }
    fixture *f = make(small, 0.11, 0.3), *g = make(big, 0.11 * 0x1p60, 0.3 * 0x1p60),
            *h = make(far, 0.11, 0.3);
    apsm_random rng = apsm_random_stream(8, APSM_STREAM_TEST, 0, 0), same = rng;
    apsm_field_draw(f->field, &rng, 0.3, COUNT, X, D);
    apsm_field_draw(g->field, &same, 0x1p60 * 0.3, COUNT, Y, E);
    for (int i = 0; i < COUNT; i++)
        assert_true(Y[3 * i] == 0x1p60 * X[3 * i] && E[i] == 0x1p60 * D[i]);
    apsm_field_sample(f->field, COUNT, X, D, N);
    apsm_field_sample(g->field, COUNT, Y, E, M);
    assert_memory_equal(N, M, sizeof N);
    for (int i = 0; i < 3 * COUNT; i++) Y[i] = X[i] + shift[i % 3];
    apsm_field_sample(h->field, COUNT, Y, E, M);
    for (int i = 0; i < COUNT; i++) assert_near(E[i], D[i], 1e-6 * 0.11);
    assert_int_equal(apsm_field_bytes(f->field), apsm_field_bytes(g->field));
    assert_true(apsm_field_voxel(f->field) == 0.11 && apsm_field_band(f->field) == 0.3);
    drop(f);
    drop(g);
    drop(h);
}

static void torus_snaps_to_the_surface(void **state)
{
    (void)state;
    json_t *root = golden_load("snap"), *torus = golden_get(root, "torus");
    double *X = golden_member(torus, "points", 48), *want = golden_member(torus, "snapped", 48);
    fixture *f =
        make(shape_torus(240, 80, golden_number(torus, "R"), golden_number(torus, "r")), 0.25, 2.5);
    double D[16], N[48];
    for (int times = 0; times < 3; times++) {
        apsm_field_sample(f->field, 16, X, D, N);
        for (int i = 0; i < 48; i++) X[i] -= D[i / 3] * N[i];
    }
    /* sagitta of the mesh 0.003, interpolation 3/8 * 0.25^2 * curvature 1/3, drift along it */
    for (int i = 0; i < 48; i++) assert_near(X[i], want[i], 0.02);
    free(X);
    free(want);
    json_decref(root);
    drop(f);
}

static void bad_arguments_are_named(void **state)
{
    (void)state;
    fixture *f = make(shape_cube(1, 1.0), 0.2, 0.2);
    apsm_field *field;
    const volatile int stop = 1;
    assert_int_equal(apsm_field_build(f->ctx, f->bvh, 0.0, 1.0, &field), APSM_ERR_ARG);
    assert_int_equal(apsm_field_build(f->ctx, f->bvh, 0.1, NAN, &field), APSM_ERR_ARG);
    assert_int_equal(apsm_field_build(f->ctx, f->bvh, 1e-9, 1e-9, &field), APSM_ERR_ARG);
    assert_non_null(strstr(apsm_error_text(f->ctx), "too small"));
    apsm_context_set_interrupt(f->ctx, &stop);
    assert_int_equal(apsm_field_build(f->ctx, f->bvh, 0.1, 0.1, &field), APSM_ERR_INTERRUPTED);
    assert_null(field);
    apsm_field_free(NULL);
    drop(f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dense_grid_equals_golden),
        cmocka_unit_test(dense_rim_is_second_order),
        cmocka_unit_test(flat_grids_do_not_read_outside),
        cmocka_unit_test(field_equals_dense_grid),
        cmocka_unit_test(sphere_distance_and_normal),
        cmocka_unit_test(cube_faces_are_exact),
        cmocka_unit_test(thin_plates_have_two_sides),
        cmocka_unit_test(draws_end_on_a_thin_sheet),
        cmocka_unit_test(draws_reach_beyond_the_band),
        cmocka_unit_test(outside_the_band_is_exact),
        cmocka_unit_test(draws_are_uniform),
        cmocka_unit_test(draws_are_uniform_on_a_rod_across),
        cmocka_unit_test(draws_repeat_with_the_stream),
        cmocka_unit_test(memory_follows_the_surface),
        cmocka_unit_test(field_scales_and_shifts_with_the_shape),
        cmocka_unit_test(torus_snaps_to_the_surface),
        cmocka_unit_test(bad_arguments_are_named),
    };
    return cmocka_run_group_tests_name("distance_field", tests, NULL, NULL);
}
