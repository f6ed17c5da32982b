#include "cmocka_all.h"

#include <math.h>

#include "check.h"
#include "core/random.h"
#include "statistics/stopping.h"

/* (1) as a product of whole numbers' quotients, apart from the code under test. */
static double left_side(size_t k, size_t n, double p)
{
    double x = (double)n + 1;
    for (size_t i = 1; i <= n; i++) {
        x *= i <= k ? p : 1 - p;
        if (i <= k) x *= (double)(n - k + i) / (double)i;
    }
    return x;
}

static void ends_are_where_evidence_is_the_risk(void **state)
{
    (void)state;
    const size_t cases[][2] = { { 3, 40 }, { 20, 40 }, { 39, 40 }, { 1, 300 } };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const size_t k = cases[c][0], n = cases[c][1];
        double low, high;
        stopping_interval(k, n, 0.01, &low, &high);
        assert_true(low < (double)k / (double)n && high > (double)k / (double)n);
        assert_near(left_side(k, n, low), 0.01, 1e-9);
        assert_near(left_side(k, n, high), 0.01, 1e-9);
        assert_true(stopping_is_decided(k, n, 0.01, 0.99 * low));
        assert_false(stopping_is_decided(k, n, 0.01, 1.01 * low));
    }
    double low, high;
    stopping_interval(0, 100, 0.01, &low, &high);
    assert_true(low == 0);
    assert_near(pow(1 - high, 100) * 101, 0.01, 1e-9);
    stopping_interval(100, 100, 0.01, &low, &high);
    assert_true(high == 1);
}

/* Of many sequences that are looked at after every 50 draws, the wrong side is told no more often
 * than the risk, and most end. */
static void wrong_sides_are_rare(void **state)
{
    (void)state;
    enum { SEQUENCES = 2000, MOST = 5000, LOOK = 50 };
    const double risk = 0.05, level = 0.05, p[] = { 0.04, 0.062 };
    for (size_t c = 0; c < 2; c++) {
        int wrong = 0, ended = 0;
        for (uint64_t s = 0; s < SEQUENCES; s++) {
            apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, s, c);
            for (size_t n = 0, k = 0; n < MOST;) {
                for (int i = 0; i < LOOK; i++, n++) k += apsm_random_uniform(&rng) < p[c];
                if (!stopping_is_decided(k, n, risk, level)) continue;
                ended++;
                wrong += ((double)k / (double)n <= level) != (p[c] <= level);
                break;
            }
        }
        if (wrong > risk * SEQUENCES || ended < SEQUENCES / 4)
            fail_msg("p = %g: %d of %d wrong, %d ended", p[c], wrong, (int)SEQUENCES, ended);
    }
}

static void rates_are_decided_when_no_end_changes_them(void **state)
{
    (void)state;
    bool decided;
    double work[8];
    const size_t sure[2] = { 0, 500 }, open[2] = { 26, 500 }, tight[2] = { 20, 500 };
    assert_ok(stopping_rates_decided(2, sure, 1000, 0.01, 0.05, work, &decided));
    assert_true(decided); /* p of the first below 0.012, twice that below 5 % */
    assert_ok(stopping_rates_decided(2, open, 1000, 0.01, 0.05, work, &decided));
    assert_false(decided); /* near 0.026, twice that is near 5 % */
    assert_ok(stopping_rates_decided(2, tight, 100000, 0.01, 0.05, work, &decided));
    assert_true(decided);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ends_are_where_evidence_is_the_risk),
        cmocka_unit_test(wrong_sides_are_rare),
        cmocka_unit_test(rates_are_decided_when_no_end_changes_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
