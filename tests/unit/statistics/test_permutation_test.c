#include "cmocka_all.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"
#include "golden.h"
#include "statistics/orders.h"
#include "statistics/permutation_test.h"
#include "statistics/tfce.h"

/* ---- goldens: full enumeration by another program ---- */

static void compare(const json_t *c, const char *statistic, double factor,
                    const apsm_permutation_result *r)
{
    double *want = golden_member(c, statistic, r->V), *got = malloc(r->V * sizeof *got);
    for (size_t v = 0; v < r->V; v++) got[v] = factor * r->statistic[v];
    golden_close(statistic, r->V, got, want, 1e-9);
    free(want);
    free(got);
    const char *const names[] = { "p", "p_familywise", "q_bh" };
    const double *const values[] = { r->p, r->p_familywise, r->q };
    for (int k = 0; k < 3; k++) {
        want = golden_member(c, names[k], r->V);
        golden_close(names[k], r->V, values[k], want, 1e-12);
        free(want);
    }
    assert_near(r->ratio, golden_number(c, "shape_ratio"), 1e-9);
    assert_near(r->p_ratio, golden_number(c, "p_shape"), 1e-12);
    assert_true(r->exact);
    assert_int_equal(r->permutations, (size_t)golden_number(c, "permutations"));
}

static void design_of(const json_t *c, apsm_design *design)
{
    const json_t *reduced = golden_get(c, "X_reduced"), *full = golden_get(c, "X_full");
    const size_t N = json_array_size(full), q = golden_count(full) / N,
                 r = golden_count(reduced) / N;
    double *Z = golden_array(reduced, N * r), *X = golden_array(full, N * q);
    double *T = malloc(N * (q - r) * sizeof *T);
    for (size_t i = 0; i < N; i++) /* the tested columns come last, or in between */
        for (size_t k = 0, m = 0; k < q; k++) {
            int known = 0;
            for (size_t z = 0; z < r; z++) {
                int same = 1;
                for (size_t l = 0; l < N; l++) same &= X[l * q + k] == Z[l * r + z];
                known |= same;
            }
            if (!known) T[i * (q - r) + m++] = X[i * q + k];
        }
    assert_ok(apsm_design_make(NULL, N, r, Z, q - r, T, design));
    free(Z);
    free(X);
    free(T);
}

static void golden_designs(void **state)
{
    (void)state;
    size_t k;
    json_t *root = golden_load("statistics"), *c;
    json_array_foreach(golden_get(root, "cases"), k, c)
    {
        apsm_design design = { 0 };
        apsm_permutation_result r = { 0 };
        if (json_object_get(c, "D")) continue;
        design_of(c, &design);
        const json_t *shapes = golden_get(c, "Y");
        const size_t V = golden_count(shapes) / design.N / 3;
        double *Y = golden_array(shapes, 0);
        const apsm_permutation_input in = {
            .design = &design, .Y = Y, .V = V, .w = 3, .permutations = 10000
        };
        apsm_context *ctx = apsm_context_new();
        assert_ok(apsm_permutation_test(ctx, &in, &r));
        apsm_context_free(ctx);
        compare(c, "lawley_hotelling", 1, &r);
        apsm_permutation_result_free(&r);
        apsm_design_free(&design);
        free(Y);
    }
    json_decref(root);
}

/* Differences within pairs: two rows a subject, which change places within it. */
static void golden_pairs(void **state)
{
    (void)state;
    size_t k;
    json_t *root = golden_load("statistics"), *c;
    json_array_foreach(golden_get(root, "cases"), k, c)
    {
        if (!json_object_get(c, "D")) continue;
        const json_t *differences = golden_get(c, "D");
        const size_t n = json_array_size(differences), V = golden_count(differences) / n / 3;
        double *D = golden_array(differences, 0), *Y = calloc(2 * n * V * 3, sizeof *Y);
        double *Z = calloc(2 * n * n, sizeof *Z), *T = malloc(2 * n * sizeof *T);
        size_t *block = malloc(2 * n * sizeof *block);
        for (size_t i = 0; i < 2 * n; i++) {
            block[i] = i / 2;
            Z[i * n + i / 2] = 1;
            T[i] = (double)(i % 2);
            for (size_t x = 0; x < 3 * V && i % 2; x++) Y[i * 3 * V + x] = D[i / 2 * 3 * V + x];
        }
        apsm_design design = { 0 };
        apsm_permutation_result r = { 0 };
        assert_ok(apsm_design_make(NULL, 2 * n, n, Z, 1, T, &design));
        const apsm_permutation_input in = {
            .design = &design, .Y = Y, .V = V, .w = 3, .block = block, .permutations = 10000
        };
        apsm_context *ctx = apsm_context_new();
        assert_ok(apsm_permutation_test(ctx, &in, &r));
        apsm_context_free(ctx);
        compare(c, "hotelling_t2", (double)(n - 1), &r);
        apsm_permutation_result_free(&r);
        apsm_design_free(&design);
        free(D), free(Y), free(Z), free(T), free(block);
    }
    json_decref(root);
}

/* ---- what must be so ---- */

enum { N = 40, V = 60, W = 3 };

static void noise(uint64_t index, double *Y)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, index, 0);
    for (size_t k = 0; k < N * V * W; k++) Y[k] = apsm_random_normal(&rng);
}

/* Ring of variables. */
static void ring(uint32_t *near)
{
    for (uint32_t v = 0; v < V; v++) {
        near[2 * v] = (v + 1) % V;
        near[2 * v + 1] = (v + V - 1) % V;
    }
}

static void run_stopping(int threads, const double *Y, size_t w, size_t permutations, double risk,
                         apsm_permutation_result *r)
{
    double Z[N * 2], T[N];
    uint32_t near[2 * V];
    apsm_design design = { 0 };
    apsm_context *ctx = apsm_context_new();
    apsm_context_set_threads(ctx, threads);
    ring(near);
    for (size_t i = 0; i < N; i++) {
        Z[2 * i] = 1;
        Z[2 * i + 1] = sin(1.7 * (double)i);
        T[i] = i < N / 2;
    }
    assert_ok(apsm_design_make(ctx, N, 2, Z, 1, T, &design));
    const apsm_permutation_input in = { .design = &design,
                                        .Y = Y,
                                        .V = V * W / w,
                                        .w = w,
                                        .permutations = permutations,
                                        .neighbours = w == W ? 2 : 0,
                                        .near = near,
                                        .stop_risk = risk,
                                        .level = 0.05 };
    assert_ok(apsm_permutation_test(ctx, &in, r));
    apsm_design_free(&design);
    apsm_context_free(ctx);
}

static void run(int threads, const double *Y, size_t w, size_t permutations,
                apsm_permutation_result *r)
{
    run_stopping(threads, Y, w, permutations, 0, r);
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    static double Y[N * V * W];
    apsm_permutation_result one = { 0 }, three = { 0 };
    noise(1, Y);
    run(1, Y, W, 333, &one);
    run(3, Y, W, 333, &three);
    assert_false(one.exact);
    assert_memory_equal(one.p, three.p, V * sizeof *one.p);
    assert_memory_equal(one.p_familywise, three.p_familywise, V * sizeof *one.p);
    assert_memory_equal(one.p_enhanced, three.p_enhanced, V * sizeof *one.p);
    assert_true(one.p_ratio == three.p_ratio);
    apsm_permutation_result_free(&one);
    apsm_permutation_result_free(&three);
}

static void assert_same_side(size_t n, const double *a, const double *b)
{
    for (size_t v = 0; v < n; v++) assert_int_equal(a[v] <= 0.05, b[v] <= 0.05);
}

/* Orders that end early say what all would, and end at the same one for any number of threads. */
static void ending_early_changes_no_conclusion(void **state)
{
    (void)state;
    static double Y[N * V * W];
    int early = 0;
    for (uint64_t set = 0; set < 12; set++) {
        apsm_permutation_result all = { 0 }, some = { 0 }, again = { 0 };
        noise(300 + set, Y);
        for (size_t i = 0; i < N / 2 && set % 3 == 0; i++)
            for (size_t v = 20; v < 28; v++) Y[(i * V + v) * W] += 4;
        run(2, Y, W, 4000, &all);
        run_stopping(1, Y, W, 4000, 0.01, &some);
        run_stopping(3, Y, W, 4000, 0.01, &again);
        assert_false(all.stopped);
        assert_int_equal(some.permutations, again.permutations);
        assert_memory_equal(some.p, again.p, V * sizeof *some.p);
        assert_true(some.stopped ? some.permutations % 512 == 0 : some.permutations == 4000);
        early += some.stopped;
        assert_same_side(1, &all.p_ratio, &some.p_ratio);
        if (some.stopped) {
            assert_same_side(V, all.p_familywise, some.p_familywise);
            assert_same_side(V, all.p_enhanced, some.p_enhanced);
            assert_same_side(V, all.q, some.q);
        }
        apsm_permutation_result_free(&all);
        apsm_permutation_result_free(&some);
        apsm_permutation_result_free(&again);
    }
    if (early < 3) fail_msg("only %d of 12 ended early", early);
}

/* A shift of some neighbours is found there, by the cluster enhancement more surely; elsewhere not.
 */
static void planted_shift_is_found(void **state)
{
    (void)state;
    static double Y[N * V * W];
    apsm_permutation_result r = { 0 };
    noise(2, Y);
    for (size_t i = 0; i < N / 2; i++)
        for (size_t v = 20; v < 28; v++) Y[(i * V + v) * W] += 1.5;
    run(2, Y, W, 999, &r);
    size_t found = 0, enhanced = 0, wrong = 0;
    for (size_t v = 0; v < V; v++) {
        const int planted = v >= 20 && v < 28;
        found += planted && r.p_familywise[v] < 0.05;
        enhanced += planted && r.p_enhanced[v] < 0.05;
        wrong += !planted && r.p_familywise[v] < 0.05;
    }
    if (found < 2 || enhanced < found || enhanced < 6)
        fail_msg("%zu of 8 found, %zu by the enhancement", found, enhanced);
    assert_int_equal(wrong, 0);
    assert_true(r.p_ratio < 0.01);
    apsm_permutation_result_free(&r);
}

/* Without an effect, p is uniform: over 200 sets 5 % are below 5 %, to what chance allows. */
static void level_is_kept(void **state)
{
    (void)state;
    static double Y[N * V * W];
    int below = 0, family = 0;
    for (uint64_t k = 0; k < 200; k++) {
        apsm_permutation_result r = { 0 };
        noise(100 + k, Y);
        run(2, Y, W, 199, &r);
        below += r.p_ratio <= 0.05;
        double least = 1;
        for (size_t v = 0; v < V; v++) least = fmin(least, r.p_familywise[v]);
        family += least <= 0.05;
        apsm_permutation_result_free(&r);
    }
    assert_in_range(below, 2, 20);
    assert_in_range(family, 2, 20);
}

/* Family-wise alarms of 150 sets in which ten rows vary twice as much as the others. */
static int alarms_of_a_wide_group(bool unequal)
{
    enum { WIDE = 10, SOME = 20 };
    static double Y[N * V * W];
    double Z[N], T[N];
    int alarms = 0;
    for (size_t i = 0; i < N; i++) Z[i] = 1, T[i] = i < WIDE;
    for (uint64_t set = 0; set < 150; set++) {
        apsm_design design = { 0 };
        apsm_permutation_result r = { 0 };
        apsm_context *ctx = apsm_context_new();
        noise(500 + set, Y);
        for (size_t k = 0; k < WIDE * SOME * W; k++) Y[k] *= 2;
        assert_ok(apsm_design_make(ctx, N, 1, Z, 1, T, &design));
        const apsm_permutation_input in = {
            .design = &design, .Y = Y, .V = SOME, .w = W, .permutations = 199, .unequal = unequal
        };
        assert_ok(apsm_permutation_test(ctx, &in, &r));
        double least = 1;
        for (size_t v = 0; v < SOME; v++) least = fmin(least, r.p_familywise[v]);
        alarms += least <= 0.05;
        apsm_permutation_result_free(&r);
        apsm_design_free(&design);
        apsm_context_free(ctx);
    }
    return alarms;
}

/* Orders give far too many, signs 5 %. */
static void signs_keep_the_level_where_a_group_varies_more(void **state)
{
    (void)state;
    const int orders = alarms_of_a_wide_group(false), signs = alarms_of_a_wide_group(true);
    if (orders < 25 || signs < 1 || signs > 17)
        fail_msg("of 150 sets %d alarms by orders, %d by signs", orders, signs);
}

/* For one number a variable the trace is F times s / (N - q). */
static void one_number_is_f(void **state)
{
    (void)state;
    static double Y[N * V * W];
    apsm_permutation_result r = { 0 };
    noise(3, Y);
    run(1, Y, 1, 19, &r);
    double x[N], Z[N * 3], B[3], rss[2] = { 0, 0 };
    for (size_t i = 0; i < N; i++) x[i] = Y[i * V * W + 7];
    for (int full = 0; full < 2; full++) { /* by normal equations, apart from the code under test */
        const size_t q = full ? 3 : 2;
        double A[3][4] = { { 0 } };
        for (size_t i = 0; i < N; i++) {
            const double row[3] = { 1, sin(1.7 * (double)i), i < N / 2 };
            memcpy(Z + 3 * i, row, sizeof row);
            for (size_t a = 0; a < q; a++) {
                for (size_t b = 0; b < q; b++) A[a][b] += row[a] * row[b];
                A[a][3] += row[a] * x[i];
            }
        }
        for (size_t a = 0; a < q; a++)
            for (size_t b = 0; b < q; b++) {
                if (b == a) continue;
                const double f = A[b][a] / A[a][a];
                for (size_t k = 0; k < 4; k++) A[b][k] -= f * A[a][k];
            }
        for (size_t a = 0; a < q; a++) B[a] = A[a][3] / A[a][a];
        for (size_t i = 0; i < N; i++) {
            double fit = 0;
            for (size_t a = 0; a < q; a++) fit += B[a] * Z[3 * i + a];
            rss[full] += (x[i] - fit) * (x[i] - fit);
        }
    }
    assert_near(r.statistic[7], (rss[0] - rss[1]) / rss[1], 1e-10);
    apsm_permutation_result_free(&r);
}

static void what_cannot_be_told_apart(void **state)
{
    (void)state;
    double Z[N * 2], T[N];
    apsm_design design = { 0 };
    for (size_t i = 0; i < N; i++) {
        Z[2 * i] = 1;
        Z[2 * i + 1] = (double)i;
        T[i] = 3 - 2 * (double)i;
    }
    assert_int_equal(apsm_design_make(NULL, N, 2, Z, 1, T, &design), APSM_ERR_ARG);
    assert_null(design.X);
    assert_int_equal(apsm_design_make(NULL, 3, 2, Z, 1, T, &design), APSM_ERR_ARG);
}

/* ---- orders ---- */

/* All orders of a design are different ones, and number 0 is the given one. */
static void orders_are_all(void **state)
{
    (void)state;
    enum { n = 6 };
    double Z[n], T[n] = { 1, 0, 1, 0, 0, 1 };
    size_t sigma[3 * n], block[n] = { 0, 0, 0, 0, 1, 1 };
    apsm_design design = { 0 };
    apsm_orders orders = { 0 };
    for (size_t i = 0; i < n; i++) Z[i] = 1;
    assert_ok(apsm_design_make(NULL, n, 1, Z, 1, T, &design));
    assert_ok(apsm_orders_make(NULL, &design, block, 100, &orders));
    assert_true(orders.exact);
    assert_int_equal(orders.count, 12); /* 6 of 4 over 2, twice */
    int seen[64] = { 0 };
    for (size_t k = 0; k < orders.count; k++) {
        unsigned code = 0, used = 0;
        apsm_orders_get(&orders, 0, k, sigma, sigma + n);
        for (size_t i = 0; i < n; i++) {
            code |= (unsigned)T[sigma[i]] << i;
            used |= 1u << sigma[i];
            assert_int_equal(block[sigma[i]], block[i]);
            if (k == 0) assert_true(T[sigma[i]] == T[i]);
        }
        assert_int_equal(used, 63);
        assert_int_equal(seen[code]++, 0);
    }
    apsm_orders_free(&orders);
    assert_ok(apsm_orders_make(NULL, &design, NULL, 19, &orders)); /* 20 differ */
    assert_false(orders.exact);
    assert_int_equal(orders.count, 19);
    apsm_orders_free(&orders);
    apsm_design_free(&design);
}

/* ---- cluster enhancement ---- */

/* By its definition: the integral by small steps of the height. */
static void enhancement_is_the_integral(void **state)
{
    (void)state;
    enum { STEPS = 20000 };
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 9, 0);
    uint32_t near[2 * V];
    double x[V], out[V], want[V] = { 0 };
    ring(near);
    for (size_t v = 0; v < V; v++) x[v] = fabs(apsm_random_normal(&rng));
    tfce_graph graph = tfce_graph_make(V, 2, near);
    tfce_work work = tfce_work_make(V);
    tfce_enhance(&graph, x, &work, out);
    for (size_t s = 0; s < STEPS; s++) {
        const double dt = 4.0 / STEPS, t = ((double)s + 0.5) * dt;
        for (size_t v = 0; v < V; v++) {
            if (x[v] < t) continue;
            size_t size = 1;
            for (size_t k = 1; k < V && x[(v + k) % V] >= t; k++) size++;
            for (size_t k = 1; k < V && size < V && x[(v + V - k) % V] >= t; k++) size++;
            want[v] += sqrt((double)size / V) * t * t * dt;
        }
    }
    for (size_t v = 0; v < V; v++) assert_near(out[v], want[v], 1e-3 * (1 + want[v]));
    tfce_graph_free(&graph);
    tfce_work_free(&work);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(golden_designs),
        cmocka_unit_test(golden_pairs),
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(ending_early_changes_no_conclusion),
        cmocka_unit_test(planted_shift_is_found),
        cmocka_unit_test(level_is_kept),
        cmocka_unit_test(signs_keep_the_level_where_a_group_varies_more),
        cmocka_unit_test(one_number_is_f),
        cmocka_unit_test(what_cannot_be_told_apart),
        cmocka_unit_test(orders_are_all),
        cmocka_unit_test(enhancement_is_the_integral),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
