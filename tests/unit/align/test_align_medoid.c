/* Choice of the template among residuals that are known. */
#include <math.h>

#include "align/medoid.h"
#include "cmocka_all.h"

static void small_cohorts_are_compared_completely(void **state)
{
    (void)state;
    size_t eligible[5] = { 1, 4, 5, 8, 9 };
    apsm_medoid_plan plan;
    apsm_medoid_draw(5, eligible, 0, &plan);
    assert_int_equal(plan.candidates, 5);
    assert_int_equal(plan.shapes, 5);
    for (size_t k = 0; k < 5; k++) {
        assert_int_equal(plan.candidate[k], eligible[k]);
        assert_int_equal(plan.shape[k], eligible[k]);
    }
}

static void check_ascending(size_t n, const size_t *index, size_t end)
{
    for (size_t k = 0; k < n; k++) {
        assert_true(index[k] < end);
        if (k > 0) assert_true(index[k] > index[k - 1]);
    }
}

static void large_cohorts_are_drawn_from(void **state)
{
    (void)state;
    static size_t eligible[2000];
    size_t seen = 0;
    for (uint64_t seed = 0; seed < 200; seed++) {
        const size_t n = seed % 2 ? 2000 : 40;
        apsm_medoid_plan plan;
        for (size_t i = 0; i < n; i++) eligible[i] = i;
        apsm_medoid_draw(n, eligible, seed, &plan);
        assert_int_equal(plan.candidates, 32);
        assert_int_equal(plan.shapes, n < 64 ? n : 64);
        check_ascending(plan.candidates, plan.candidate, n);
        check_ascending(plan.shapes, plan.shape, n);
        if (n == 40)
            for (size_t k = 0; k < 32; k++) seen += plan.candidate[k] == 39;
    }
    assert_in_range(seen, 65, 95); /* 80 expected of 100, standard deviation 4 */
}

/* Points on a line: the middle one is closest to the others.  A candidate is not compared with
 * itself, so one that is not among the shapes has one term more. */
static void middle_is_picked(void **state)
{
    (void)state;
    const double x[6] = { 0, 1, 2.5, 3, 9, 2.9 };
    const apsm_medoid_plan plan = {
        .candidates = 3, .shapes = 5, .candidate = { 1, 2, 5 }, .shape = { 0, 1, 2, 3, 4 }
    };
    double R[15];
    for (size_t a = 0; a < 3; a++)
        for (size_t b = 0; b < 5; b++) R[5 * a + b] = fabs(x[plan.candidate[a]] - x[plan.shape[b]]);
    R[1] = R[7] = 1000.0; /* candidates 1 and 2 with themselves */
    /* Means: 1: (1 + 1.5 + 2 + 8)/4, 2: (2.5 + 1.5 + 0.5 + 6.5)/4, 5: (2.9+1.9+.4+.1+6.1)/5 */
    assert_int_equal(apsm_medoid_pick(&plan, R), 5);
    R[14] += 2.5; /* 5 now has (11.4 + 2.5)/5 = 2.78 > 2.75 */
    assert_int_equal(apsm_medoid_pick(&plan, R), 2);
}

static void ties_go_to_the_first(void **state)
{
    (void)state;
    const apsm_medoid_plan plan = {
        .candidates = 2, .shapes = 2, .candidate = { 3, 7 }, .shape = { 3, 7 }
    };
    const double R[4] = { 0, 1, 1, 0 };
    assert_int_equal(apsm_medoid_pick(&plan, R), 3);
}

/* Candidate 1 is as good as 0, being better and worse in turns; 2 is worse by 1 with a scatter of
 * 1; 3 by 0.1, which may be chance. */
static void the_beaten_drop_out(void **state)
{
    (void)state;
    enum { SHAPES = 32 };
    apsm_medoid_plan plan = { .candidates = 4, .shapes = SHAPES, .candidate = { 40, 41, 42, 43 } };
    double R[4 * SHAPES];
    for (size_t b = 0; b < SHAPES; b++) {
        const double turn = b / APSM_MEDOID_PARTS % 2 ? 1.0 : -1.0;
        plan.shape[b] = b;
        R[b] = 10.0 + (double)(b % 5);
        R[SHAPES + b] = R[b] + 0.01 + 0.5 * turn;
        R[2 * SHAPES + b] = R[b] + 1.0 + turn;
        R[3 * SHAPES + b] = R[b] + 0.1 + turn;
    }
    apsm_medoid_drop(&plan, 1, R); /* of four shapes */
    for (size_t a = 0; a < 4; a++) assert_false(plan.out[a]);
    apsm_medoid_drop(&plan, 4, R);
    assert_true(plan.out[2]);
    assert_false(plan.out[0] || plan.out[1] || plan.out[3]);
    plan.out[0] = true;
    assert_int_equal(apsm_medoid_pick(&plan, R), 41);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(small_cohorts_are_compared_completely),
        cmocka_unit_test(large_cohorts_are_drawn_from),
        cmocka_unit_test(middle_is_picked),
        cmocka_unit_test(ties_go_to_the_first),
        cmocka_unit_test(the_beaten_drop_out),
    };
    return cmocka_run_group_tests_name("align_medoid", tests, NULL, NULL);
}
