/* Two halves of a box that touch in a wall. */
#include "cmocka_all.h"

#include "joint/contact.h"
#include "joint/shared_boundary.h"
#include "shapes.h"

/* A box of 10 x 8 x 6 from x = at on, its faces as fine as an edge of about 0.5. */
static apsm_mesh box_at(double at)
{
    apsm_mesh box = shape_box((size_t[3]){ 20, 16, 12 }, (double[3]){ 10, 8, 6 });
    double lo[3], hi[3];
    apsm_mesh_bounds(&box, lo, hi);
    for (size_t v = 0; v < box.nv; v++) box.V[3 * v] += at - lo[0];
    return box;
}

static void split(double gap, double tolerance, apsm_status expected, apsm_shared_boundary *s)
{
    apsm_mesh a = box_at(0), b = box_at(10 + gap);
    apsm_bvh *tree[2];
    apsm_contact contact;
    assert_int_equal(apsm_bvh_build(&a, &tree[0]), APSM_OK);
    assert_int_equal(apsm_bvh_build(&b, &tree[1]), APSM_OK);
    apsm_contact_measure(tree[0], tree[1], &contact);
    assert_true(fabs(contact.gap - gap) < 1e-9);
    assert_int_equal(apsm_split_shared(tree[0], tree[1], tolerance, s), expected);
    apsm_bvh_free(tree[0]);
    apsm_bvh_free(tree[1]);
    apsm_mesh_free(&a);
    apsm_mesh_free(&b);
}

static void the_wall_is_shared(void **state)
{
    (void)state;
    apsm_shared_boundary s;
    split(0.1, 0.3, APSM_OK, &s);
    const double wall = 8 * 6, all = 2 * (10 * 8 + 10 * 6 + 8 * 6);
    assert_true(fabs(apsm_mesh_area(&s.shared) / wall - 1) < 0.15);
    for (int k = 0; k < 2; k++)
        assert_true(fabs(apsm_mesh_area(&s.rest[k]) / (all - wall) - 1) < 0.03);
    for (size_t v = 0; v < s.shared.nv; v++) assert_true(s.shared.V[3 * v] > 9.4);
    apsm_shared_boundary_free(&s);
}

static void parts_that_do_not_touch_share_nothing(void **state)
{
    (void)state;
    apsm_shared_boundary s;
    split(0.5, 0.3, APSM_ERR_GEOMETRY, &s);
    assert_null(s.shared.V);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_wall_is_shared),
        cmocka_unit_test(parts_that_do_not_touch_share_nothing),
    };
    return cmocka_run_group_tests_name("shared boundary", tests, NULL, NULL);
}
