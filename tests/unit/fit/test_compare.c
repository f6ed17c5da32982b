/* The sign test of two models' left-out shapes: known binomial tails. */
#include "cmocka_all.h"

#include "fit/compare.h"

static void signs_are_binomial(void **state)
{
    (void)state;
    static const struct {
        size_t less, n;
        double p;
    } known[] = { { 0, 0, 1 },
                  { 5, 10, 1 },
                  { 0, 10, 2.0 / 1024 },
                  { 10, 10, 2.0 / 1024 },
                  { 2, 10, 2.0 * 56 / 1024 },
                  { 8, 10, 2.0 * 56 / 1024 } };
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        assert_true(fabs(compare_sign_p(known[k].less, known[k].n) - known[k].p) < 1e-12);
    /* where powers of a half are no longer numbers */
    assert_true(compare_sign_p(1000, 2000) > 0.99 && compare_sign_p(900, 2000) < 1e-4);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(signs_are_binomial) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
