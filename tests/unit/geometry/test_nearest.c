/* Nearest points by lanes, against a plain loop: the first of several, any number of points. */
#include <math.h>

#include "check.h"
#include "cmocka_all.h"
#include "geometry/nearest.h"
#include "geometry/vec3.h"

enum { MOST = 61 };

static void check_points(size_t n, const double *X, size_t J, const double *P, bool itself)
{
    uint32_t nearest[MOST];
    double work[4 * MOST], distance[MOST];
    apsm_nearest_points(n, X, J, P, itself, work, nearest, distance);
    for (size_t v = 0; v < n; v++) {
        double least = INFINITY;
        size_t first = 0;
        for (size_t k = 0; k < J; k++) {
            const double d2 = vec3_distance2(X + 3 * v, P + 3 * k);
            if ((itself && k == v) || !(d2 < least)) continue;
            least = d2;
            first = k;
        }
        assert_int_equal(nearest[v], first);
        assert_true(distance[v] == sqrt(least));
    }
}

static void as_by_a_plain_loop(void **state)
{
    (void)state;
    double X[3 * MOST], P[3 * MOST];
    check_uniform(1, 3 * MOST, -1, 1, X);
    check_uniform(2, 3 * MOST, -1, 1, P);
    for (size_t J = 1; J <= MOST; J++) {
        check_points(MOST, X, J, P, false);
        check_points(J, P, J, P, true);
    }
}

/* On a grid most points have several nearest. */
static void the_first_of_several(void **state)
{
    (void)state;
    double P[3 * MOST];
    for (size_t k = 0; k < MOST; k++)
        for (size_t c = 0; c < 3; c++) P[3 * k + c] = (double)(k * (c + 2) % 4);
    for (size_t J = 1; J <= MOST; J++) check_points(J, P, J, P, true);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_by_a_plain_loop),
        cmocka_unit_test(the_first_of_several),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
