#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "check.h"
#include "golden.h"
#include "linalg/linalg.h"
#include "optimize/eigenshape_loss.h"
#include "optimize/frobenius_loss.h"

enum { K = 5, J = 12, N3 = 3 * J };

/* Loss and gradient of the whole cohort. */
static double whole(size_t k, size_t j, const double *Y, const apsm_eigenshape_options *opt,
                    double *grad, double *reg)
{
    double loss, *L = check_alloc(k * k), *work = check_alloc(k);
    assert_int_equal(apsm_eigenshape_loss(k, j, Y, opt, &loss, L, reg), APSM_OK);
    for (size_t i = 0; i < k && grad; i++)
        apsm_eigenshape_gradient(k, j, Y, L, opt, i, grad + 3 * j * i, work);
    free(L);
    free(work);
    return loss;
}

static void equals_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("eigenshape");
    double *P = golden_member(root, "P", K * N3), *lagged = golden_member(root, "lagged_mean", N3);
    const json_t *cases = golden_get(root, "cases");
    for (size_t i = 0; i < json_array_size(cases); i++) {
        const json_t *c = json_array_get(cases, i);
        double *want = golden_member(c, "grad", K * N3), mean[N3], Y[K * N3], grad[K * N3];
        memcpy(mean, lagged, sizeof mean);
        if (strcmp(json_string_value(golden_get(c, "mean")), "batch") == 0)
            apsm_cohort_mean(K, J, P, mean);
        apsm_cohort_centre(K, J, P, mean, Y);
        const apsm_eigenshape_options opt = { .eigen_reg_absolute = golden_number(c, "reg"),
                                              .eigen_scale = APSM_EIGEN_NONE };
        const double loss = whole(K, J, Y, &opt, grad, NULL), expected = golden_number(c, "loss");
        golden_close("loss", 1, &loss, &expected, 1e-9);
        golden_close_max("grad", K * N3, grad, want, 1e-8);
        free(want);
    }
    free(P);
    free(lagged);
    json_decref(root);
}

/* The 3J x 3J form of the paper has the same value but for (3J - K)/2 log reg. */
static void primal_form_agrees(void **state)
{
    (void)state;
    json_t *root = golden_load("eigenshape");
    const json_t *check = golden_get(root, "primal_check");
    double *P = golden_member(root, "P", K * N3), mean[N3];
    apsm_cohort_mean(K, J, P, mean);
    apsm_cohort_centre(K, J, P, mean, P);
    const double reg = golden_number(check, "reg");
    const apsm_eigenshape_options opt = { .eigen_reg_absolute = reg,
                                          .eigen_scale = APSM_EIGEN_NONE };
    const double primal = whole(K, J, P, &opt, NULL, NULL) + 0.5 * (N3 - K) * log(reg);
    const double expected = golden_number(check, "half_logdet_primal");
    golden_close("primal", 1, &primal, &expected, 1e-9);
    free(P);
    json_decref(root);
}

/* One shape at distance 2 along one axis: G = 4/3, L = 1/2 log(G + reg). */
static void one_shape_by_hand(void **state)
{
    (void)state;
    const double Y[3] = { 2, 0, 0 };
    double grad[3], reg;
    apsm_eigenshape_options opt = { .eigen_reg = 0.5, .eigen_scale = APSM_EIGEN_NONE };
    const double loss = whole(1, 1, Y, &opt, grad, &reg);
    assert_true(fabs(reg - 2.0 / 3.0) < 1e-15 && fabs(loss - 0.5 * log(2.0)) < 1e-15);
    assert_true(fabs(grad[0] - 1.0 / 3.0) < 1e-15 && grad[1] == 0.0);
    opt.eigen_scale = APSM_EIGEN_FULL;
    assert_true(fabs(whole(1, 1, Y, &opt, grad, NULL) - 1.5 * log(2.0)) < 1e-15);
    assert_true(fabs(grad[0] - 1.0) < 1e-15);
}

/* Two shapes at +-2: G = 2/3 [1 -1; -1 1], mean eigenvalue 2/3. */
static void relative_reg_is_of_the_mean_eigenvalue(void **state)
{
    (void)state;
    const double Y[6] = { 2, 0, 0, -2, 0, 0 };
    const apsm_eigenshape_options opt = { .eigen_reg = 0.5, .eigen_scale = APSM_EIGEN_NONE };
    double reg;
    const double loss = whole(2, 1, Y, &opt, NULL, &reg);
    assert_true(fabs(reg - 1.0 / 3.0) < 1e-15);
    assert_true(fabs(loss - 0.5 * log(5.0 / 3.0 * 1.0 / 3.0)) < 1e-14);
}

static double batch_loss(const double *P, void *user)
{
    double mean[N3], Y[K * N3];
    apsm_cohort_mean(K, J, P, mean);
    apsm_cohort_centre(K, J, P, mean, Y);
    return whole(K, J, Y, user, NULL, NULL);
}

/* Also when the mean moves with the shapes: its gradient cancels. */
static void gradient_matches_differences(void **state)
{
    (void)state;
    double P[K * N3], mean[N3], Y[K * N3], grad[K * N3];
    apsm_eigenshape_options opt = { .eigen_reg_absolute = 0.05 };
    check_uniform(1, K * N3, -2.0, 2.0, P);
    apsm_cohort_mean(K, J, P, mean);
    apsm_cohort_centre(K, J, P, mean, Y);
    whole(K, J, Y, &opt, grad, NULL);
    check_gradient("eigenshape", K * N3, P, 2.0, DBL_EPSILON, grad, batch_loss, &opt);
}

/* Scaled by 4: the gradient falls to a quarter (10), whatever the unit.  Shapes in another order,
 * or turned together, have the same loss. */
static void scale_order_and_motion(void **state)
{
    (void)state;
    double P[K * N3], Y[K * N3], mean[N3], grad[K * N3], other[K * N3];
    const apsm_eigenshape_options opt = apsm_eigenshape_defaults();
    check_uniform(2, K * N3, -2.0, 2.0, P);
    apsm_cohort_mean(K, J, P, mean);
    apsm_cohort_centre(K, J, P, mean, Y);
    const double loss = whole(K, J, Y, &opt, grad, NULL);
    for (size_t i = 0; i < K * N3; i++) Y[i] *= 4.0;
    whole(K, J, Y, &opt, other, NULL);
    check_scaled("grad", K * N3, other, grad, 0.25);
    for (size_t k = 0; k < K; k++)
        for (size_t j = 0; j < J; j++) {
            const double *p = P + N3 * (K - 1 - k) + 3 * j;
            double *y = Y + N3 * k + 3 * j;
            y[0] = 0.6 * p[0] - 0.8 * p[1] + 9.0;
            y[1] = 0.8 * p[0] + 0.6 * p[1];
            y[2] = p[2];
        }
    apsm_cohort_mean(K, J, Y, mean);
    apsm_cohort_centre(K, J, Y, mean, Y);
    const double moved = whole(K, J, Y, &opt, other, NULL);
    golden_close("loss", 1, &moved, &loss, 1e-12);
}

static void equal_shapes_are_singular(void **state)
{
    (void)state;
    double Y[2 * N3] = { 0 }, L[4], loss;
    const apsm_eigenshape_options opt = apsm_eigenshape_defaults();
    assert_int_equal(apsm_eigenshape_loss(2, J, Y, &opt, &loss, L, NULL), APSM_ERR_SINGULAR);
}

/* ---- Frobenius ---- */

static void frobenius_equals_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("corres");
    const json_t *f = golden_get(root, "frobenius");
    double *P = golden_member(root, "P", 192), *mean = golden_member(f, "mean", 48),
           *want = golden_member(f, "grad", 192), own[48], grad[192], loss = 0.0;
    apsm_cohort_mean(4, 16, P, own);
    golden_close("mean", 48, own, mean, 1e-14);
    for (size_t i = 0; i < 4; i++)
        loss += apsm_frobenius_loss(16, P + 48 * i, mean, false, grad + 48 * i);
    const double expected = golden_number(f, "loss");
    golden_close("loss", 1, &loss, &expected, 1e-9);
    golden_close_max("grad", 192, grad, want, 1e-8);
    free(P);
    free(mean);
    free(want);
    json_decref(root);
}

static void frobenius_by_hand(void **state)
{
    (void)state;
    const double P[6] = { 3, 0, 0, 0, 4, 0 }, mean[6] = { 0 };
    double grad[6];
    assert_true(apsm_frobenius_loss(2, P, mean, false, grad) == 5.0 && grad[4] == 0.8);
    assert_true(apsm_frobenius_loss(2, P, mean, true, grad) == 12.5 && grad[4] == 4.0);
    assert_true(apsm_frobenius_loss(2, mean, mean, false, grad) == 0.0 && grad[4] == 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(relative_reg_is_of_the_mean_eigenvalue),
        cmocka_unit_test(equals_golden),
        cmocka_unit_test(primal_form_agrees),
        cmocka_unit_test(one_shape_by_hand),
        cmocka_unit_test(gradient_matches_differences),
        cmocka_unit_test(scale_order_and_motion),
        cmocka_unit_test(equal_shapes_are_singular),
        cmocka_unit_test(frobenius_equals_golden),
        cmocka_unit_test(frobenius_by_hand),
    };
    return cmocka_run_group_tests_name("eigenshape_loss", tests, NULL, NULL);
}
