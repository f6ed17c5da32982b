/* A joint whose truth is known: a plate that stays and grows, an ellipsoid that turns about a
 * hinge. */
#include "cmocka_all.h"

#include <math.h>
#include <string.h>

#include "core/random.h"
#include "geometry/affine.h"
#include "joint/pose_shape.h"
#include "joint/se3.h"

enum { I = 9, A = 40, B = 60, J = A + B };
static const size_t first[] = { 0, A, J };
static const apsm_parts parts = { 2, first };

static void rotation(const double axis[3], double angle, double M[16])
{
    const double xi[6] = { axis[0] * angle, axis[1] * angle, axis[2] * angle, 0, 0, 0 };
    apsm_se3_exp(xi, M);
}

/* Part B turned by turn[i] about the axis y through (0, 0, 8), every subject moved anywhere; with
 * growth[i] part A is longer by that share along x. */
static void joint(const double *turn, const double *growth, double *P)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 5, 0);
    double base[3 * J];
    for (size_t k = 0; k < 3 * J; k++)
        base[k] = 5 * apsm_random_normal(&rng) * (k % 3 == 0 ? 2 : 1);
    for (size_t j = A; j < J; j++) base[3 * j + 2] += 30;
    for (size_t i = 0; i < I; i++) {
        double hinge[16], place[16], xi[6], *p = P + 3 * J * i;
        rotation((double[]){ 0, 1, 0 }, turn[i], hinge);
        memcpy(p, base, sizeof base);
        for (size_t j = 0; j < A; j++) p[3 * j] *= 1 + growth[i];
        for (size_t j = A; j < J; j++) p[3 * j + 2] -= 8;
        apsm_affine_apply(hinge, B, p + 3 * A, p + 3 * A);
        for (size_t j = A; j < J; j++) p[3 * j + 2] += 8;
        for (size_t k = 0; k < 6; k++) xi[k] = apsm_random_normal(&rng) * (k < 3 ? 1 : 50);
        apsm_se3_exp(xi, place);
        apsm_affine_apply(place, J, p, p);
    }
}

static double sum(size_t n, const double *x)
{
    double s = 0;
    for (size_t k = 0; k < n; k++) s += x[k];
    return s;
}

static void separated(const double *turn, const double *growth, apsm_joint_alignment alignment,
                      double *Q, apsm_pose_shape *ps)
{
    double P[I * J * 3], M[I * 2 * 16];
    const apsm_joint_align_options options = { .alignment = alignment, .by = 0, .reference = I };
    joint(turn, growth, P);
    assert_int_equal(apsm_joint_align(NULL, I, &parts, P, &options, M, Q), APSM_OK);
    assert_int_equal(apsm_pose_shape_separate(NULL, I, &parts, Q, ps), APSM_OK);
}

static void spread_turns(double degrees, double *turn)
{
    for (size_t i = 0; i < I; i++)
        turn[i] = degrees * acos(-1) / 180 * (2 * (double)i / (I - 1) - 1);
}

/* Turning alone, 15 degrees to either side: nothing of it is shape, and the angles come back. */
static void turning_is_pose(void **state)
{
    (void)state;
    double turn[I], growth[I] = { 0 }, Q[I * J * 3];
    apsm_pose_shape ps = { 0 };
    spread_turns(15, turn);
    separated(turn, growth, APSM_JOINT_BY, Q, &ps);
    const double pose = sum(ps.poses.modes, ps.poses.variance);
    assert_true(pose > 1);
    assert_true(sum(ps.shapes.modes, ps.shapes.variance) < 1e-18 * pose);
    for (size_t i = 0; i < I; i++) { /* part A stays, part B has turned */
        double angle2 = 0;
        for (size_t k = 0; k < 3; k++) {
            assert_true(fabs(ps.pose[12 * i + k]) < 1e-9);
            angle2 += ps.pose[12 * i + 6 + k] * ps.pose[12 * i + 6 + k];
        }
        assert_true(fabs(sqrt(angle2) - fabs(turn[i])) < 1e-9);
    }
    assert_true(ps.poses.variance[0] > 0.99 * pose); /* one hinge, one mode (but for its arc) */
    apsm_pose_shape_free(&ps);
}

/* All parts moved together by a map that the turning part shares in: shape stays clean all the
 * same. */
static void no_alignment_leaks(void **state)
{
    (void)state;
    double turn[I], growth[I] = { 0 }, Q[I * J * 3];
    apsm_pose_shape ps = { 0 };
    spread_turns(15, turn);
    separated(turn, growth, APSM_JOINT_GLOBAL, Q, &ps);
    assert_true(sum(ps.shapes.modes, ps.shapes.variance) <
                1e-18 * sum(ps.poses.modes, ps.poses.variance));
    apsm_pose_shape_free(&ps);
}

/* Growth is the same shape whether the parts turn or not, and what poses and shapes do not tell is
 * little. */
static void variances_add(void **state)
{
    (void)state;
    double turn[I], none[I] = { 0 }, growth[I], Q[I * J * 3];
    apsm_pose_shape grown = { 0 }, both = { 0 };
    spread_turns(4, turn);
    for (size_t i = 0; i < I; i++) growth[i] = 0.1 * cos(2.4 * (double)i);
    separated(none, growth, APSM_JOINT_BY, Q, &grown);
    separated(turn, growth, APSM_JOINT_BY, Q, &both);
    const double shape = sum(grown.shapes.modes, grown.shapes.variance);
    assert_true(fabs(grown.leak) < 0.01);
    assert_true(fabs(sum(both.shapes.modes, both.shapes.variance) - shape) < 1e-9 * shape);
    assert_true(fabs(both.leak) < 0.01);
    assert_true(both.both.modes <= I - 1);
    apsm_pose_shape_free(&grown);
    apsm_pose_shape_free(&both);
}

/* Poses and shapes of a subject put together are its particles again. */
static void composes(void **state)
{
    (void)state;
    double turn[I], growth[I], Q[I * J * 3], x[J * 3];
    apsm_pose_shape ps = { 0 };
    spread_turns(40, turn);
    for (size_t i = 0; i < I; i++) growth[i] = 0.02 * (double)i;
    separated(turn, growth, APSM_JOINT_GLOBAL, Q, &ps);
    for (size_t i = 0; i < I; i++) {
        apsm_pose_shape_compose(&ps, &parts, ps.pose + 12 * i, ps.shape + 3 * J * i, x);
        for (size_t k = 0; k < 3 * J; k++) assert_true(fabs(x[k] - Q[3 * J * i + k]) < 1e-9);
    }
    apsm_pose_shape_free(&ps);
}

static void alignments(void **state)
{
    (void)state;
    double turn[I], growth[I] = { 0 }, P[I * J * 3], Q[I * J * 3], M[I * 2 * 16];
    spread_turns(15, turn);
    joint(turn, growth, P);
    apsm_joint_align_options options = { .alignment = APSM_JOINT_BY, .by = 0, .reference = 3 };
    assert_int_equal(apsm_joint_align(NULL, I, &parts, P, &options, M, Q), APSM_OK);
    for (size_t i = 0; i < I;
         i++) /* part A lies on that of subject 3, whose frame is the world's */
        for (size_t k = 0; k < 3 * A; k++)
            assert_true(fabs(Q[3 * J * i + k] - P[3 * J * 3 + k]) < 1e-8);
    for (size_t i = 0; i < I; i++) assert_memory_equal(M + 32 * i, M + 32 * i + 16, 16 * sizeof *M);
    options.alignment = APSM_JOINT_APART;
    assert_int_equal(apsm_joint_align(NULL, I, &parts, P, &options, M, Q), APSM_OK);
    for (size_t i = 0; i < I; i++)
        for (size_t k = 0; k < 3 * J; k++)
            assert_true(fabs(Q[3 * J * i + k] - P[3 * J * 3 + k]) < 1e-8);
    options = (apsm_joint_align_options){ .alignment = APSM_JOINT_BY, .by = 2 };
    assert_int_equal(apsm_joint_align(NULL, I, &parts, P, &options, M, Q), APSM_ERR_ARG);
}

/* exp and log are inverse, up to half a turn; the mean of motions spread about one is that one. */
static void motions(void **state)
{
    (void)state;
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 6, 0);
    double M[5 * 16], mean[16], centre[16];
    for (size_t t = 0; t < 200; t++) {
        double xi[6], back[6], E[16];
        for (size_t k = 0; k < 6; k++) xi[k] = apsm_random_normal(&rng);
        const double theta = sqrt(xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]);
        const double to = t < 100 ? 3.14159 * (double)t / 100 : pow(10, -(double)(t - 100) / 8);
        for (size_t k = 0; k < 3; k++) xi[k] *= to / theta;
        apsm_se3_exp(xi, E);
        assert_true(fabs(apsm_affine_det(E) - 1) < 1e-12);
        apsm_se3_log(E, back);
        for (size_t k = 0; k < 6; k++) assert_true(fabs(back[k] - xi[k]) < 1e-9 * (to + 1e-3));
    }
    rotation((double[]){ 0.6, 0, 0.8 }, 1.1, centre);
    for (int i = 0; i < 5; i++) {
        double turn[16];
        rotation((double[]){ 0, 1, 0 }, 0.4 * (i - 2), turn);
        apsm_affine_multiply(centre, turn, M + 16 * i);
        M[16 * i + 3] = i;
    }
    apsm_se3_mean(5, M, mean);
    centre[3] = 2;
    for (size_t k = 0; k < 16; k++) assert_true(fabs(mean[k] - centre[k]) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(turning_is_pose), cmocka_unit_test(no_alignment_leaks),
        cmocka_unit_test(variances_add),   cmocka_unit_test(composes),
        cmocka_unit_test(alignments),      cmocka_unit_test(motions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
