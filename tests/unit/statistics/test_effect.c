/* Effects of known size, their bands, and groups told apart. */
#include "cmocka_all.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"
#include "statistics/classify.h"
#include "statistics/effect.h"

enum { N = 60, V = 12, W = 3 };

/* Noise of standard deviation 1; the first half of the rows is moved by `shift` along x of
 * variable 4. */
static void data(uint64_t index, double shift, double *Y)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, index, 0);
    for (size_t k = 0; k < N * V * W; k++) Y[k] = apsm_random_normal(&rng);
    for (size_t i = 0; i < N / 2; i++) Y[(i * V + 4) * W] += shift;
}

static void two_groups(apsm_design *d, size_t *group)
{
    double Z[N], T[N];
    for (size_t i = 0; i < N; i++) {
        Z[i] = 1;
        T[i] = i < N / 2 ? 1 : -1;
        group[i] = i >= N / 2;
    }
    assert_ok(apsm_design_make(NULL, N, 1, Z, 1, T, d));
}

static void direction_x(double *direction)
{
    for (size_t k = 0; k < V * W; k++) direction[k] = k % W == 0;
}

static void difference_of_means(void **state)
{
    (void)state;
    static double Y[N * V * W], direction[V * W];
    size_t group[N];
    const double contrast = 2;
    apsm_design d = { 0 };
    apsm_effect e = { 0 };
    apsm_context *ctx = apsm_context_new();
    data(1, 1.5, Y);
    two_groups(&d, group);
    direction_x(direction);
    const apsm_effect_input in = { &d, Y, V, W, &contrast, direction, group, 500 };
    assert_ok(apsm_effect_measure(ctx, &in, &e));
    for (size_t v = 0; v < V; v++) { /* the difference of the groups' means, computed here */
        double want[W] = { 0 };
        for (size_t i = 0; i < N; i++)
            for (size_t a = 0; a < W; a++)
                want[a] += (group[i] ? -1 : 1) * Y[(i * V + v) * W + a] / (N / 2);
        for (size_t a = 0; a < W; a++) assert_near(e.effect[v * W + a], want[a], 1e-12);
        assert_near(e.along[v], want[0], 1e-12);
        assert_true(e.low[v] < e.along[v] && e.along[v] < e.high[v]);
        /* width of a 95 % band: 2 x 1.96 sqrt(2 / 30) */
        assert_true(fabs(e.high[v] - e.low[v] - 1.01) < 0.35);
    }
    assert_true(e.low[4] > 0.5);
    assert_true(fabs(e.standardised[4] - 1.5) < 0.6);
    apsm_effect_free(&e);
    apsm_design_free(&d);
    apsm_context_free(ctx);
}

/* 95 % bands hold the truth in 95 % of the data sets, to what chance allows. */
static void bands_cover(void **state)
{
    (void)state;
    static double Y[N * V * W], direction[V * W];
    size_t group[N], inside = 0, all = 0;
    const double contrast = 2;
    apsm_context *ctx = apsm_context_new();
    apsm_design d = { 0 };
    two_groups(&d, group);
    direction_x(direction);
    for (uint64_t k = 0; k < 60; k++) {
        apsm_effect e = { 0 };
        data(100 + k, 1, Y);
        const apsm_effect_input in = { &d, Y, V, W, &contrast, direction, group, 200 };
        assert_ok(apsm_effect_measure(ctx, &in, &e));
        for (size_t v = 0; v < V; v++, all++) {
            const double truth = v == 4;
            inside += e.low[v] <= truth && truth <= e.high[v];
        }
        apsm_effect_free(&e);
    }
    const double share = (double)inside / (double)all;
    if (!(share > 0.91 && share < 0.98)) fail_msg("%.3f of the bands hold the truth", share);
    apsm_design_free(&d);
    apsm_context_free(ctx);
}

static void detectable(void **state)
{
    (void)state;
    /* (1.959964 + 0.841621) sqrt(1 / 20 + 1 / 20) */
    assert_near(apsm_detectable_shift(20, 20, 0.05, 0.8), 0.88593, 1e-5);
}

static double auc_of(double shift, uint64_t index)
{
    static double P[N * V * W];
    size_t group[N];
    double score[N];
    apsm_design d = { 0 };
    apsm_classification c;
    apsm_context *ctx = apsm_context_new();
    two_groups(&d, group);
    data(index, shift, P);
    for (size_t i = 0; i < N; i++) /* a strong mode that says nothing of the group */
        for (size_t v = 0; v < V; v++) P[(i * V + v) * W + 1] += 5 * sin(2.3 * (double)i);
    assert_ok(apsm_classify(ctx, N, V, P, group, 10, score, &c));
    assert_true(c.auc_low <= c.auc && c.auc <= c.auc_high);
    apsm_design_free(&d);
    apsm_context_free(ctx);
    return c.auc;
}

/* What is there is found; where nothing is, nothing is: the folds are honest. */
static void told_apart(void **state)
{
    (void)state;
    double none = 0;
    assert_true(auc_of(4, 7) > 0.9);
    for (uint64_t k = 0; k < 20; k++) none += auc_of(0, 200 + k) / 20;
    if (!(fabs(none - 0.5) < 0.06)) fail_msg("without a difference the area is %.3f", none);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(difference_of_means),
                                        cmocka_unit_test(bands_cover), cmocka_unit_test(detectable),
                                        cmocka_unit_test(told_apart) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
