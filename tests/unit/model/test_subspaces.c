/* Angles between spans of modes: known ones, whatever basis describes the spans. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "model/subspaces.h"

enum { D = 9 };

/* a spans e0, e1 by a skew basis; b spans e0 and cos(t) e1 + sin(t) e2. */
static void make(double t, double a[2][D], double b[2][D])
{
    memset(a, 0, 2 * D * sizeof(double));
    memset(b, 0, 2 * D * sizeof(double));
    a[0][0] = 3, a[0][1] = 1;
    a[1][0] = -2, a[1][1] = 5;
    b[0][0] = 7, b[0][1] = cos(t), b[0][2] = sin(t);
    b[1][0] = 0.1;
}

static void known_angles_come_back(void **state)
{
    (void)state;
    double a[2][D], b[2][D], cosine[2], work[500];
    assert_true(apsm_subspaces_work_size(2, 2, D) <= 500);
    for (double t = 0.1; t < 1.5; t += 0.2) {
        make(t, a, b);
        assert_int_equal(apsm_subspace_cosines(2, 2, D, &a[0][0], &b[0][0], cosine, work), APSM_OK);
        assert_true(fabs(cosine[0] - 1) < 1e-12);
        assert_true(fabs(cosine[1] - cos(t)) < 1e-12);
    }
}

static void shares_are_squared_cosines(void **state)
{
    (void)state;
    double a[2][D], b[2][D], share[2], work[500];
    make(0.7, a, b);
    a[0][0] = 0; /* e1 alone */
    assert_int_equal(apsm_subspace_shares(2, 2, D, &a[0][0], &b[0][0], share, work), APSM_OK);
    assert_true(fabs(share[0] - cos(0.7) * cos(0.7)) < 1e-12);
    const double in = 4 + 25 * cos(0.7) * cos(0.7);
    assert_true(fabs(share[1] - in / 29) < 1e-12);
}

static void spans_of_different_size(void **state)
{
    (void)state;
    double a[1][D] = { { 1, 1, 1 } }, b[3][D] = { { 2 }, { 1, 4 }, { 0, 0, 0, 1 } }, cosine,
           work[500];
    assert_int_equal(apsm_subspace_cosines(1, 3, D, &a[0][0], &b[0][0], &cosine, work), APSM_OK);
    assert_true(fabs(cosine - sqrt(2.0 / 3)) < 1e-12);
    assert_int_equal(apsm_subspace_cosines(3, 1, D, &b[0][0], &a[0][0], &cosine, work), APSM_OK);
    assert_true(fabs(cosine - sqrt(2.0 / 3)) < 1e-12);
}

static void dependent_rows_are_refused(void **state)
{
    (void)state;
    double a[2][D] = { { 1, 2 }, { 2, 4 } }, b[2][D] = { { 1 }, { 0, 1 } }, cosine[2], work[500];
    assert_int_equal(apsm_subspace_cosines(2, 2, D, &a[0][0], &b[0][0], cosine, work),
                     APSM_ERR_SINGULAR);
    memset(a[1], 0, sizeof a[1]);
    assert_int_equal(apsm_subspace_cosines(2, 2, D, &b[0][0], &a[0][0], cosine, work),
                     APSM_ERR_SINGULAR);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_angles_come_back),
        cmocka_unit_test(shares_are_squared_cosines),
        cmocka_unit_test(spans_of_different_size),
        cmocka_unit_test(dependent_rows_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
