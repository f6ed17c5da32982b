/* The assignment against the goldens, and its proof of optimality on larger problems. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "core/random.h"
#include "golden.h"
#include "initialize/assignment.h"
#include "shapes.h"

/* A permutation whose prices prove that none is cheaper.  Returns its cost. */
static double assign(size_t n, const double *cost, uint32_t *column)
{
    double *u = malloc(n * sizeof *u), *v = malloc(n * sizeof *v), total = 0, prices = 0, most = 0;
    void *work = malloc(apsm_assign_work_size(n));
    bool *taken = calloc(n, sizeof *taken);
    assert_true(u && v && work && taken);
    assert_int_equal(apsm_assign(n, cost, column, u, v, work), APSM_OK);
    for (size_t k = 0; k < n * n; k++) most = fmax(most, fabs(cost[k]));
    for (size_t i = 0; i < n; i++) {
        assert_true(column[i] < n && !taken[column[i]]);
        taken[column[i]] = true;
        total += cost[i * n + column[i]];
        prices += u[i] + v[i];
        for (size_t j = 0; j < n; j++)
            if (!(cost[i * n + j] - u[i] - v[j] >= -1e-12 * most))
                fail_msg("price too high at %zu, %zu by %g", i, j, u[i] + v[j] - cost[i * n + j]);
    }
    assert_true(fabs(total - prices) <= 1e-12 * most * (double)n);
    free(u);
    free(v);
    free(work);
    free(taken);
    return total;
}

static void agrees_with_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("hungarian");
    json_t *cases = golden_get(root, "cases");
    for (size_t i = 0; i < json_array_size(cases); i++) {
        const json_t *c = json_array_get(cases, i), *want = golden_get(c, "assignment");
        const size_t n = json_array_size(golden_get(c, "cost"));
        double *cost = golden_member(c, "cost", n * n);
        uint32_t column[64];
        const double total = assign(n, cost, column), least = golden_number(c, "total");
        golden_close("total", 1, &total, &least, 1e-12);
        for (size_t k = 0; json_is_array(want) && k < n; k++)
            assert_int_equal(column[k], json_integer_value(json_array_get(want, k)));
        free(cost);
    }
    json_decref(root);
}

/* Distances between two sets of random points: the kind of matrix it is for. */
static double *point_costs(size_t n, uint64_t index)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, index, n);
    double *x = malloc(6 * n * sizeof *x), *cost = malloc(n * n * sizeof *cost);
    assert_true(x && cost);
    for (size_t k = 0; k < 6 * n; k++) x[k] = apsm_random_uniform(&rng);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) {
            const double *a = x + 3 * i, *b = x + 3 * (n + j);
            cost[i * n + j] = sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                                   (a[2] - b[2]) * (a[2] - b[2]));
        }
    free(x);
    return cost;
}

static void prices_prove_optimality(void **state)
{
    (void)state;
    static const size_t sizes[] = { 1, 2, 3, 7, 50, 128, 300 };
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        double *cost = point_costs(sizes[s], s);
        uint32_t column[300];
        assign(sizes[s], cost, column);
        free(cost);
    }
}

static void ties_and_negative_costs(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(2, APSM_STREAM_TEST, 0, 0);
    for (size_t n = 1; n < 40; n++) {
        double cost[40 * 40];
        uint32_t column[40];
        for (size_t k = 0; k < n * n; k++) cost[k] = (double)apsm_random_below(&rng, 4) - 2;
        assign(n, cost, column);
        for (size_t k = 0; k < n * n; k++) cost[k] = 5;
        assert_true(assign(n, cost, column) == 5.0 * (double)n);
    }
}

static void every_permutation_of_six_costs_more(void **state)
{
    (void)state;
    enum { N = 6 };
    double *cost = point_costs(N, 9);
    uint32_t column[N];
    const double total = assign(N, cost, column);
    for (int code = 0; code < 46656; code++) { /* all 6^6 maps, those that are permutations */
        int c = code, used = 0;
        double sum = 0;
        for (int i = 0; i < N; i++, c /= N) {
            used |= 1 << c % N;
            sum += cost[i * N + c % N];
        }
        if (used == 63) assert_true(sum >= total - 1e-12);
    }
    free(cost);
}

static void refuses_what_is_not_finite(void **state)
{
    (void)state;
    double cost[4] = { 1, 2, NAN, 3 }, u[2], v[2], work[16];
    uint32_t column[2];
    assert_true(apsm_assign_work_size(2) <= sizeof work);
    assert_int_equal(apsm_assign(2, cost, column, u, v, work), APSM_ERR_NONFINITE);
}

/* Shuffled samples next to the references get their names back, on two components too. */
static void samples_get_the_names_of_references(void **state)
{
    (void)state;
    enum { J = 40 };
    apsm_mesh one = shape_icosphere(3), mesh = shape_alloc(2 * one.nv, 2 * one.nf);
    for (size_t i = 0; i < 3 * one.nv; i++) {
        mesh.V[i] = one.V[i];
        mesh.V[3 * one.nv + i] = one.V[i] + 3;
    }
    for (size_t i = 0; i < 3 * one.nf; i++) {
        mesh.F[i] = one.F[i];
        mesh.F[3 * one.nf + i] = one.F[i] + (uint32_t)one.nv;
    }
    apsm_topology topology;
    apsm_geodesic *g;
    apsm_geodesic_work *w;
    assert_int_equal(apsm_topology_build(&mesh, &topology), APSM_OK);
    assert_int_equal(apsm_geodesic_build(&mesh, &topology, &g), APSM_OK);
    assert_int_equal(apsm_geodesic_work_new(g, &w), APSM_OK);
    apsm_surface_point reference[J], samples[J], matched[J];
    for (uint32_t j = 0; j < J; j++) {
        const uint32_t face = j * (uint32_t)(mesh.nf / J);
        reference[j] = (apsm_surface_point){ face, { 0.4, 0.3, 0.3 } };
        samples[7 * j % J] = (apsm_surface_point){ face, { 0.2, 0.5, 0.3 } };
    }
    void *work = malloc(apsm_match_samples_work_size(J));
    assert_non_null(work);
    assert_int_equal(apsm_match_samples(g, w, J, reference, samples, matched, work), APSM_OK);
    for (uint32_t j = 0; j < J; j++) assert_int_equal(matched[j].face, reference[j].face);
    free(work);
    apsm_geodesic_work_free(w);
    apsm_geodesic_free(g);
    apsm_topology_free(&topology);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&one);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_golden),
        cmocka_unit_test(prices_prove_optimality),
        cmocka_unit_test(ties_and_negative_costs),
        cmocka_unit_test(every_permutation_of_six_costs_more),
        cmocka_unit_test(refuses_what_is_not_finite),
        cmocka_unit_test(samples_get_the_names_of_references),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
