/* Tail probabilities: closed forms, and Hotelling's distribution against drawn cohorts. */
#include "cmocka_all.h"

#include <math.h>

#include "core/random.h"
#include "fit/tail.h"

/* F(2, b): (1 + 2 f / b)^(-b/2).  F(1, 1): 1 - 2/pi atan sqrt f.  F(a, 2): 1 - (a f/(2 + a
 * f))^(a/2) */
static void closed_forms(void **state)
{
    (void)state;
    for (double f = 0.01; f < 200; f *= 1.7)
        for (double b = 1; b < 400; b *= 1.9) {
            const double x = pow(1 + 2 * f / b, -b / 2);
            const double y = 1 - pow(b * f / (2 + b * f), b / 2);
            assert_true(fabs(fit_tail_f(f, 2, b) - x) < 1e-12 * (1 + x / 1e-3));
            assert_true(fabs(fit_tail_f(f, b, 2) - y) < 1e-11);
        }
    for (double f = 0.01; f < 200; f *= 1.7)
        assert_true(fabs(fit_tail_f(f, 1, 1) - (1 - 2 / 3.141592653589793 * atan(sqrt(f)))) <
                    1e-12);
    assert_true(fit_tail_f(0, 3, 5) == 1);
    assert_true(isnan(fit_tail_mahalanobis(1, 5, 5)));
}

/* In one dimension (45) is Student's t for one more number: with 5 shapes a tenth of the new ones
 * is farther off than where the tail is 0.1, by chi-square it would be 17 %. */
static void one_dimension(void **state)
{
    (void)state;
    enum { N = 5, DRAWS = 40000 };
    apsm_random r = apsm_random_stream(3, APSM_STREAM_TEST, 1, 4);
    size_t beyond = 0;
    for (int k = 0; k < DRAWS; k++) {
        double x[N + 1], mean = 0, var = 0;
        for (int i = 0; i <= N; i++) x[i] = apsm_random_normal(&r);
        for (int i = 0; i < N; i++) mean += x[i] / N;
        for (int i = 0; i < N; i++) var += (x[i] - mean) * (x[i] - mean) / (N - 1);
        beyond += fit_tail_mahalanobis((x[N] - mean) * (x[N] - mean) / var, N, 1) < 0.1;
    }
    assert_true(fabs((double)beyond / DRAWS - 0.1) < 0.006);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(closed_forms),
                                        cmocka_unit_test(one_dimension) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
