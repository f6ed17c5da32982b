#include "cmocka_all.h"

#include <math.h>

#include "joint/contact.h"
#include "shapes.h"

/* Unit balls whose centres are x apart. */
static apsm_contact balls(double x)
{
    apsm_mesh a = shape_icosphere(4), b = shape_icosphere(4);
    apsm_bvh *ta = NULL, *tb = NULL;
    apsm_contact c;
    for (size_t v = 0; v < b.nv; v++) b.V[3 * v] += x;
    assert_int_equal(apsm_bvh_build(&a, &ta), APSM_OK);
    assert_int_equal(apsm_bvh_build(&b, &tb), APSM_OK);
    apsm_contact_measure(ta, tb, &c);
    apsm_bvh_free(ta);
    apsm_bvh_free(tb);
    apsm_mesh_free(&a);
    apsm_mesh_free(&b);
    return c;
}

static void apart_and_into_each_other(void **state)
{
    (void)state;
    const apsm_contact apart = balls(2.5), in = balls(1.5);
    assert_true(fabs(apart.gap - 0.5) < 0.01 && apart.depth == 0 && apart.overlap == 0);
    assert_true(in.gap == 0 && fabs(in.depth - 0.5) < 0.01);
    /* of either ball the cap of height 1 - 0.75: 2 pi h of 4 pi */
    assert_true(fabs(in.overlap - 0.125) < 0.01);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(apart_and_into_each_other) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
