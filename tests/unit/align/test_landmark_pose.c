/* Shapes come back from known motions by their landmarks. */
#include <math.h>
#include <string.h>

#include "align/landmark_pose.h"
#include "check.h"
#include "cmocka_all.h"
#include "geometry/affine.h"
#include "synthetic.h"

enum { I = 5, L = 6 };

static void turn(size_t i, double size, double M[16])
{
    const double a = 0.7 * (double)i, c = cos(a) * size, s = sin(a) * size, x = (double)i;
    const double R[16] = { c, -s, 0, 3 * x, s, c, 0, -x, 0, 0, size, 2 * x, 0, 0, 0, 1 };
    memcpy(M, R, sizeof R);
}

/* Landmarks of equal shapes in frames of their own; shape 4 misses two. */
static void make(landmark_table *t, double size)
{
    static const char *const names[L] = { "a", "b", "c", "d", "e", "f" };
    double x[3 * L], y[3], M[16];
    check_uniform(1, 3 * L, -10, 10, x);
    landmark_table_begin(I, t);
    for (size_t i = 0; i < I; i++) {
        landmark_list list = { 0 };
        turn(i, i == 3 ? size : 1, M);
        for (size_t l = 0; l < (i == 4 ? L - 2 : L); l++) {
            apsm_affine_apply(M, 1, x + 3 * l, y);
            assert_int_equal(landmark_list_add(NULL, "", names[l], y, &list), APSM_OK);
        }
        assert_int_equal(landmark_table_take(t, i, &list), APSM_OK);
        landmark_list_free(&list);
    }
}

/* Largest distance between equal landmarks in the world. */
static double spread(const landmark_table *t, const double *M)
{
    double most = 0;
    for (size_t l = 0; l < t->L; l++)
        for (size_t i = 1; i < I; i++) {
            double a[3], b[3], d2 = 0;
            if (!landmark_is_there(t, i, l)) continue;
            apsm_affine_apply(M, 1, landmark_at(t, 0, l), a);
            apsm_affine_apply(M + 16 * i, 1, landmark_at(t, i, l), b);
            for (size_t c = 0; c < 3; c++) d2 += (a[c] - b[c]) * (a[c] - b[c]);
            most = fmax(most, sqrt(d2));
        }
    return most;
}

static void poses_come_back(void **state)
{
    (void)state;
    landmark_table t;
    double M[16 * I], first[16];
    size_t kept;
    for (size_t i = 0; i < I; i++) turn(i, 1, M + 16 * i); /* far from the truth */
    memcpy(first, M, sizeof first);
    make(&t, 1);
    landmark_pose_options o = { .template_index = 0 };
    assert_int_equal(landmark_pose(NULL, &t, NULL, &o, M, &kept), APSM_OK);
    assert_int_equal(kept, 0);
    assert_memory_equal(M, first, sizeof first);
    assert_true(spread(&t, M) < 1e-9);
    landmark_table_free(&t);
    make(&t, 2); /* sizes differ: only similarities bring them together */
    assert_int_equal(landmark_pose(NULL, &t, NULL, &o, M, &kept), APSM_OK);
    assert_true(spread(&t, M) > 1);
    o.scale = true;
    assert_int_equal(landmark_pose(NULL, &t, NULL, &o, M, &kept), APSM_OK);
    assert_true(spread(&t, M) < 1e-6);
    landmark_table_free(&t);
}

static void too_few_landmarks_leave_a_shape(void **state)
{
    (void)state;
    landmark_table t;
    double M[16 * I], was[16];
    size_t kept;
    for (size_t i = 0; i < I; i++) turn(i, 1, M + 16 * i);
    make(&t, 1);
    for (size_t l = 2; l < L; l++) t.has[2 * L + l] = false;
    memcpy(was, M + 32, sizeof was);
    const landmark_pose_options o = { .template_index = 0 };
    assert_int_equal(landmark_pose(NULL, &t, NULL, &o, M, &kept), APSM_OK);
    assert_int_equal(kept, 1);
    assert_memory_equal(M + 32, was, sizeof was);
    landmark_table_free(&t);
}

/* Of a sphere the surface says nothing of the turn; with its landmarks it stays where the surface
 * is and turns as they do. */
static void surfaces_have_their_half(void **state)
{
    (void)state;
    enum { N = 2 };
    landmark_table t;
    double M[16 * N];
    size_t kept;
    apsm_mesh mesh[N];
    const apsm_mesh *meshes[N] = { &mesh[0], &mesh[1] };
    landmark_table_begin(N, &t);
    for (size_t i = 0; i < N; i++) {
        landmark_list list = { 0 };
        mesh[i] = shape_sphere(3, 10);
        apsm_affine_identity(M + 16 * i);
        for (size_t l = 0; l < 4; l++) {
            char name[2] = { (char)('a' + l), 0 };
            double x[3], R[16];
            memcpy(x, mesh[i].V + 3 * (l * mesh[i].nv / 4), sizeof x);
            turn(i, 1, R);
            R[3] = R[7] = R[11] = 0;
            apsm_affine_apply(R, 1, x, x);
            x[0] += 2 * (double)i; /* and off their surface */
            assert_int_equal(landmark_list_add(NULL, "", name, x, &list), APSM_OK);
        }
        assert_int_equal(landmark_table_take(&t, i, &list), APSM_OK);
        landmark_list_free(&list);
    }
    apsm_context *ctx = apsm_context_new();
    landmark_pose_options o = { .template_index = 0 };
    assert_int_equal(landmark_pose(ctx, &t, meshes, &o, M, &kept), APSM_OK);
    const double alone = hypot(hypot(M[19], M[23]), M[27]);
    o.surfaces = true;
    assert_int_equal(landmark_pose(ctx, &t, meshes, &o, M, &kept), APSM_OK);
    const double both = hypot(hypot(M[19], M[23]), M[27]);
    assert_true(fabs(alone - 2) < 1e-6);
    assert_true(both < 1.5 && both > 0.3);
    assert_true(fabs(acos(M[16]) - 0.7) < 0.05);
    apsm_context_free(ctx);
    for (size_t i = 0; i < N; i++) apsm_mesh_free(&mesh[i]);
    landmark_table_free(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(poses_come_back),
                                        cmocka_unit_test(too_few_landmarks_leave_a_shape),
                                        cmocka_unit_test(surfaces_have_their_half) };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
