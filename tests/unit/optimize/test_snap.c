#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "check.h"
#include "golden.h"
#include "optimize/correspondence_loss.h"
#include "optimize/eigenshape_loss.h"
#include "optimize/rbf_shape.h"
#include "optimize/sampling_loss.h"
#include "optimize/snap.h"
#include "shapes.h"

/* ---- one complete epoch of three spheres, tests/golden/step.json ---- */

enum { I = 3, J = 16, R = 60, N3 = 3 * J };

typedef struct epoch {
    const json_t *root, *options;
    double *P, *N, *B, *D, grad_s[I * N3], grad_c[I * N3], grad_e[I * N3];
    double sampling, correspondence, eigenshape;
} epoch;

static void do_sampling(epoch *e)
{
    const double c = golden_number(e->options, "c"), s = golden_number(e->options, "s");
    const apsm_sampling_options opt = { .sampling_scale = APSM_SAMPLING_SUM,
                                        .tau_absolute = golden_number(e->options, "tau"),
                                        .cut_double = 25.0,
                                        .precision = APSM_PRECISION_DOUBLE };
    double store[12 * J], f[R], g[R], loss,
        *work = check_alloc(apsm_rbf_work_size(J)),
        *factor_store = check_alloc(apsm_polyharmonic_store_size(3 * J, false)),
        *work_s = check_alloc(apsm_sampling_work_size(J, R));
    for (size_t i = 0; i < I; i++) {
        apsm_rbf_shape shape;
        apsm_polyharmonic factor;
        apsm_rbf_bind(&shape, J, store);
        const apsm_dipoles d = { e->P + N3 * i, e->N + N3 * i, s };
        assert_int_equal(apsm_rbf_fit(APSM_PHI_R, &d, false, factor_store, &factor, &shape, work),
                         APSM_OK);
        apsm_rbf_eval(&shape, R, e->B + 3 * R * i, f, NULL);
        apsm_sampling_weights(R, f, e->D + R * i, c, false, f, g);
        const apsm_sampling_points points = { J, R, e->P + N3 * i, e->B + 3 * R * i, g };
        const apsm_sampling_result result = { .loss = &loss, .grad = e->grad_s + N3 * i };
        assert_int_equal(apsm_sampling_loss(&points, &opt, &result, work_s), APSM_OK);
        e->sampling += loss;
    }
    free(work);
    free(factor_store);
    free(work_s);
}

static void do_correspondence(epoch *e)
{
    const size_t t = (size_t)golden_number(e->root, "template");
    apsm_correspondence_options opt = apsm_correspondence_defaults();
    double *neighbours = golden_member(e->root, "neighbours", 6 * J), h_j[J], loss;
    uint32_t N6[6 * J];
    opt.neighbour_scale = APSM_SCALE_NONE;
    assert_int_equal(apsm_neighbours6(J, e->P + N3 * t, N6), APSM_OK);
    for (size_t k = 0; k < 6 * J; k++) assert_int_equal(N6[k], (uint32_t)neighbours[k]);
    apsm_spacing(J, e->P + N3 * t, N6, h_j);
    const apsm_correspondence_target target = { J, e->P + N3 * t, e->N + N3 * t, N6, h_j };
    for (size_t i = 0; i < I; i++) {
        assert_int_equal(apsm_correspondence_loss(&target, e->P + N3 * i, e->N + N3 * i, &opt,
                                                  &loss, e->grad_c + N3 * i, NULL),
                         APSM_OK);
        e->correspondence += loss;
    }
    free(neighbours);
}

static void do_eigenshape(epoch *e)
{
    const apsm_eigenshape_options opt = { .eigen_reg_absolute = golden_number(e->options, "reg"),
                                          .eigen_scale = APSM_EIGEN_NONE };
    double mean[N3], Y[I * N3], L[I * I], work[I];
    apsm_cohort_mean(I, J, e->P, mean);
    apsm_cohort_centre(I, J, e->P, mean, Y);
    assert_int_equal(apsm_eigenshape_loss(I, J, Y, &opt, &e->eigenshape, L, NULL), APSM_OK);
    for (size_t i = 0; i < I; i++)
        apsm_eigenshape_gradient(I, J, Y, L, &opt, i, e->grad_e + N3 * i, work);
}

/* Distance and normal of the analytic sphere. */
static void snap_to_spheres(epoch *e)
{
    double *centres = golden_member(e->root, "centres", 9),
           *radii = golden_member(e->root, "radii", 3);
    for (size_t i = 0; i < I; i++) {
        double D[J], N[N3];
        for (size_t j = 0; j < J; j++) {
            double d[3], r2 = 0.0;
            for (size_t a = 0; a < 3; a++) {
                d[a] = e->P[N3 * i + 3 * j + a] - centres[3 * i + a];
                r2 += d[a] * d[a];
            }
            for (size_t a = 0; a < 3; a++) N[3 * j + a] = d[a] / sqrt(r2);
            D[j] = sqrt(r2) - radii[i];
        }
        apsm_snap(J, D, N, e->P + N3 * i);
    }
    free(centres);
    free(radii);
}

static void compare(const epoch *e, const char *key, const double *got, double tol)
{
    double *want = golden_member(e->root, key, I * N3);
    golden_close_max(key, I * N3, got, want, tol);
    free(want);
}

static void epoch_equals_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("step");
    epoch e = { .root = root, .options = golden_get(root, "options") };
    e.P = golden_member(root, "P", I * N3);
    e.N = golden_member(root, "N", I * N3);
    e.B = golden_member(root, "B", 3 * I * R);
    e.D = golden_member(root, "D", I * R);
    do_sampling(&e);
    do_correspondence(&e);
    do_eigenshape(&e);
    const double losses[3] = { e.sampling, e.correspondence, e.eigenshape };
    const double expected[3] = { golden_number(root, "sampling"),
                                 golden_number(root, "correspondence"),
                                 golden_number(root, "eigenshape") };
    golden_close("losses", 3, losses, expected, 1e-9);
    const double lr = golden_number(e.options, "lr");
    const double weight[3] = { lr * golden_number(e.options, "alpha"),
                               lr * golden_number(e.options, "gamma"),
                               lr * golden_number(e.options, "beta") };
    double step[I * N3], grad[I * N3];
    for (size_t i = 0; i < I; i++) {
        const double *g[3] = { e.grad_s + N3 * i, e.grad_c + N3 * i, e.grad_e + N3 * i };
        apsm_step(J, 3, weight, g, INFINITY, step + N3 * i);
    }
    for (size_t i = 0; i < I * N3; i++) {
        grad[i] = -step[i] / lr;
        e.P[i] += step[i];
    }
    compare(&e, "grad", grad, 1e-8);
    compare(&e, "P_after_step", e.P, 1e-9);
    snap_to_spheres(&e);
    compare(&e, "P_after_snap", e.P, 1e-9);
    double *all[] = { e.P, e.N, e.B, e.D };
    for (size_t i = 0; i < 4; i++) free(all[i]);
    json_decref(root);
}

/* ---- step and snap by themselves ---- */

static void long_steps_are_clipped(void **state)
{
    (void)state;
    const double a[6] = { 3, 0, 0, 0, 0.25, 0 }, b[6] = { 0, 2, 0, 0, 0, 0 }, w[3] = { 1, 2, 9 };
    const double *g[3] = { a, b, NULL };
    double step[6];
    const double mean = apsm_step(2, 3, w, g, 2.5, step);
    const double want[6] = { -1.5, -2, 0, 0, -0.25, 0 };
    golden_close("step", 6, step, want, 1e-15);
    assert_true(fabs(mean - 1.375) < 1e-15);
    apsm_step(2, 3, w, g, INFINITY, step);
    assert_true(step[0] == -3.0 && step[1] == -4.0);
}

static void snaps_to_the_closest_point(void **state)
{
    (void)state;
    apsm_mesh mesh = shape_cube(2, 2.0);
    apsm_bvh *bvh;
    assert_int_equal(apsm_bvh_build(&mesh, &bvh), APSM_OK);
    double P[6] = { 0.25, 0.125, 1.5, -0.5, 0.25, 0.25 }, X[3];
    apsm_surface_point on[2];
    assert_true(apsm_snap_closest(bvh, 2, P, on, NULL) == 0.5);
    const double want[6] = { 0.25, 0.125, 1, -1, 0.25, 0.25 };
    golden_close("P", 6, P, want, 1e-15);
    for (size_t j = 0; j < 2; j++) {
        apsm_surface_position(&mesh, on + j, X);
        golden_close("on", 3, X, want + 3 * j, 1e-15);
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(epoch_equals_golden),
        cmocka_unit_test(long_steps_are_clipped),
        cmocka_unit_test(snaps_to_the_closest_point),
    };
    return cmocka_run_group_tests_name("snap", tests, NULL, NULL);
}
