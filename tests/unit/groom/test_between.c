/* Interpolation of slices far apart by shape. */
#include "cmocka_all.h"

#include <math.h>
#include <stdlib.h>

#include "groom/between.h"

enum { NX = 40, NY = 6, NZ = 9, R = 3 };

/* x < 8 + slope z, z in units of the shortest spacing. */
static void tilted(double slope, unsigned char mask[NX * NY * NZ])
{
    size_t i = 0;
    for (size_t z = 0; z < NZ; z++)
        for (size_t y = 0; y < NY; y++)
            for (size_t x = 0; x < NX; x++) mask[i++] = (double)x < 8.25 + slope * R * (double)z;
}

/* Where the values of a fine row pass one half. */
static double crossing(const float *row)
{
    size_t x = 0;
    while (x + 1 < NX && row[x + 1] > 0.5f) x++;
    return (double)x + ((double)row[x] - 0.5) / ((double)row[x] - (double)row[x + 1]);
}

static void contours_that_move_leave_a_slope(void **state)
{
    (void)state;
    static unsigned char mask[NX * NY * NZ];
    const antialias_input in = {
        .n = { NX, NY, NZ }, .mask = mask, .refine = { 1, 1, R }, .spacing = { 1, 1, R }
    };
    float *values = malloc(NX * NY * ((NZ - 1) * R + 1) * sizeof *values);
    assert_non_null(values);
    for (int k = 1; k <= 3; k++) {
        const double slope = k / 3.0; /* contours move by 1, 2, 3 nodes a slice */
        tilted(slope, mask);
        assert_int_equal(between_axis(&in), 2);
        assert_ok(between_slices(&in, 2, values));
        for (size_t z = 0; z <= (NZ - 1) * R; z++) {
            const double at = crossing(values + NX * (2 + NY * z));
            assert_true(fabs(at - (8.25 + slope * (double)z)) < 0.5); /* nodes cannot tell more */
            if (z % R == 0) continue;
            /* the step between slices is passed evenly */
            const double low = crossing(values + NX * (2 + NY * (z - z % R))),
                         high = crossing(values + NX * (2 + NY * (z - z % R + R)));
            assert_true(fabs(at - low - (double)(z % R) / R * (high - low)) < 0.25);
        }
    }
    free(values);
}

/* (A3) at every fine node: the slices' contours are straight, so that distances are along x. */
static void values_are_those_of_the_formula(void **state)
{
    (void)state;
    static unsigned char mask[NX * NY * NZ];
    const double W = 0.6 * R;
    const antialias_input in = {
        .n = { NX, NY, NZ }, .mask = mask, .refine = { 1, 1, R }, .spacing = { 1, 1, R }
    };
    float *values = malloc(NX * NY * ((NZ - 1) * R + 1) * sizeof *values);
    assert_non_null(values);
    tilted(2.0 / 3.0, mask);
    assert_ok(between_slices(&in, 2, values));
    for (size_t z = 0; z <= (NZ - 1) * R; z++)
        for (size_t x = 0; x < NX; x++) {
            double depth = 0.0;
            for (size_t k = 0; k < 2 && (k == 0 || z % R != 0); k++) {
                const double t = (double)(z % R) / R, below = k ? t : 1.0 - t;
                /* half a node from the last node with x < 8.25 + 2 slice */
                const double edge = 8.5 + 2.0 * (double)(z / R + k);
                depth += below * fmax(-W, fmin(W, edge - (double)x));
            }
            const double got = (double)values[x + NX * (3 + NY * z)];
            if (fabs(got - (0.5 + depth / (2.0 * W))) > 1e-5)
                fail_msg("x %zu, z %zu: %g", x, z, got);
        }
    assert_true(fabs((double)between_slope(&in, 2) - 1.0 / (2.0 * W)) < 1e-6);
    free(values);
}

static void only_slices_are_slices(void **state)
{
    (void)state;
    const antialias_input cubes = { .refine = { 1, 1, 1 } }, rods = { .refine = { 3, 1, 3 } },
                          side = { .refine = { 2, 1, 1 } };
    assert_int_equal(between_axis(&cubes), -1);
    assert_int_equal(between_axis(&rods), -1);
    assert_int_equal(between_axis(&side), 0);
}

/* Along each axis the same values, whichever axis the slices are across. */
static void axes_are_alike(void **state)
{
    (void)state;
    enum { N = 9 };
    unsigned char mask[3][N * N * N];
    float *values[3];
    for (int a = 0; a < 3; a++) {
        antialias_input in = {
            .n = { N, N, N }, .mask = mask[a], .refine = { 1, 1, 1 }, .spacing = { 1, 1, 1 }
        };
        in.refine[a] = 2;
        in.spacing[a] = 2;
        for (size_t i = 0; i < N * N * N; i++) {
            const size_t x[3] = { i % N, i / N % N, i / (N * N) };
            const double u = (double)x[(a + 1) % 3] - 4, v = (double)x[(a + 2) % 3] - 3.5,
                         w = 2 * ((double)x[a] - 4);
            mask[a][i] = u * u + v * v + w * w < 12;
        }
        values[a] = malloc(N * N * (2 * N - 1) * sizeof **values);
        assert_non_null(values[a]);
        assert_ok(between_slices(&in, a, values[a]));
    }
    for (size_t w = 0; w < 2 * N - 1; w++)
        for (size_t v = 0; v < N; v++)
            for (size_t u = 0; u < N; u++) {
                const float z = values[2][u + N * (v + N * w)];
                assert_true(values[0][w + (2 * N - 1) * (u + N * v)] == z);
                assert_true(values[1][v + N * (w + (2 * N - 1) * u)] == z);
            }
    for (int a = 0; a < 3; a++) free(values[a]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(contours_that_move_leave_a_slope),
        cmocka_unit_test(values_are_those_of_the_formula),
        cmocka_unit_test(only_slices_are_slices),
        cmocka_unit_test(axes_are_alike),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
