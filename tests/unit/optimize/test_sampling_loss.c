#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "check.h"
#include "core/exp.h"
#include "golden.h"
#include "optimize/rbf_shape.h"
#include "optimize/sampling_loss.h"

/* ---- exp ---- */

/* libm's long double is the judge; the bound is one unit in the last place. */
static void exp_is_good_to_one_ulp(void **state)
{
    (void)state;
    for (int i = 0; i <= 400000; i++) {
        const double x = i < 200000 ? -700.0 * i / 200000 : -25.0 * (i - 200000) / 200000;
        const double want = (double)expl((long double)x), got = apsm_exp(x);
        if (!(fabs(got - want) <= DBL_EPSILON * want))
            fail_msg("exp(%.17g) = %.17g, expected %.17g", x, got, want);
    }
    assert_true(apsm_exp(0.0) == 1.0);
    assert_true(apsm_exp(-1e9) > 0.0 && apsm_exp(-1e9) < 1e-303);
    assert_true(apsm_exp(-INFINITY) == apsm_exp(-700.0));
}

static void expf_is_good_to_two_ulp(void **state)
{
    (void)state;
    for (int i = 0; i <= 400000; i++) {
        const float x =
            i < 200000 ? -87.0f * (float)i / 200000 : -15.0f * (float)(i - 200000) / 2e5f;
        const double want = exp((double)x), got = (double)apsm_expf(x);
        if (!(fabs(got - want) <= 2.0 * (double)FLT_EPSILON * want))
            fail_msg("expf(%.9g) = %.9g, expected %.9g", (double)x, got, want);
    }
    assert_true(apsm_expf(0.0f) == 1.0f);
    assert_true(apsm_expf(-INFINITY) == apsm_expf(-87.0f) && apsm_expf(-87.0f) > 0.0f);
}

static void exp2f_is_good_to_two_ulp(void **state)
{
    (void)state;
    for (int i = 0; i <= 400000; i++) {
        const float x =
            i < 200000 ? -126.0f * (float)i / 200000 : 22.0f * (float)(i - 300000) / 1e5f;
        const double want = exp2((double)x), got = (double)apsm_exp2f(x);
        if (!(fabs(got - want) <= 2.0 * (double)FLT_EPSILON * want))
            fail_msg("exp2f(%.9g) = %.9g, expected %.9g", (double)x, got, want);
    }
    for (int n = -126; n <= 126; n++) assert_true(apsm_exp2f((float)n) == ldexpf(1.0f, n));
    assert_true(apsm_exp2f(-INFINITY) == 0x1p-126f);
}

/* ---- the definition, written down plainly ---- */

typedef struct result {
    double loss, *grad, *kbar, *mass;
} result;

static result plain_loss(size_t J, const double *P, size_t R, const double *B, const double *g,
                         double tau)
{
    result x = { 0.0, check_alloc(3 * J), check_alloc(R), check_alloc(J) };
    double *k = check_alloc(J), *w = check_alloc(J);
    for (size_t r = 0; r < R; r++) {
        double least = INFINITY, sum = 0.0;
        for (size_t j = 0; j < J; j++) {
            k[j] = sqrt(pow(B[3 * r] - P[3 * j], 2) + pow(B[3 * r + 1] - P[3 * j + 1], 2) +
                        pow(B[3 * r + 2] - P[3 * j + 2], 2));
            least = fmin(least, k[j]);
        }
        for (size_t j = 0; j < J; j++) sum += w[j] = exp((least - k[j]) / tau);
        for (size_t j = 0; j < J; j++) x.kbar[r] += (w[j] /= sum) * k[j];
        x.loss += g[r] * x.kbar[r] / (double)(R * J);
        for (size_t j = 0; j < J; j++) {
            x.mass[j] += w[j] * g[r];
            for (size_t a = 0; a < 3; a++)
                x.grad[3 * j + a] += g[r] * w[j] * (1.0 - (k[j] - x.kbar[r]) / tau) *
                                     (P[3 * j + a] - B[3 * r + a]) / k[j] / (double)(R * J);
        }
    }
    free(k);
    free(w);
    return x;
}

static result result_new(size_t J, size_t R)
{
    return (result){ 0.0, check_alloc(3 * J), check_alloc(R), check_alloc(J) };
}

static void result_free(result *x)
{
    free(x->grad);
    free(x->kbar);
    free(x->mass);
}

static result loss_with(size_t J, const double *P, size_t R, const double *B, const double *g,
                        apsm_sampling_options opt)
{
    result x = result_new(J, R);
    double *work = check_alloc(apsm_sampling_work_size(J, R));
    const apsm_sampling_points points = { J, R, P, B, g };
    const apsm_sampling_result wanted = { &x.loss, x.grad, x.kbar, x.mass };
    assert_int_equal(apsm_sampling_loss(&points, &opt, &wanted, work), APSM_OK);
    free(work);
    return x;
}

static result fast_loss(size_t J, const double *P, size_t R, const double *B, const double *g,
                        double tau, double cut, int norm)
{
    return loss_with(J, P, R, B, g,
                     (apsm_sampling_options){ .sampling_scale = norm,
                                              .tau_absolute = tau,
                                              .cut_double = cut,
                                              .precision = APSM_PRECISION_DOUBLE });
}

static result single_loss(size_t J, const double *P, size_t R, const double *B, const double *g,
                          double tau, double cut)
{
    const apsm_sampling_options opt = { .sampling_scale = APSM_SAMPLING_MEAN,
                                        .tau_absolute = tau,
                                        .cut_single = cut,
                                        .precision = APSM_PRECISION_SINGLE };
    return loss_with(J, P, R, B, g, opt);
}

/* Points in a band about a sphere of radius 10 with J particles. */
static void scene(size_t J, size_t R, double *P, double *B, double *g)
{
    double *N = check_alloc(3 * (J > R ? J : R)), *d = check_alloc(R);
    check_sphere(1, J, 10.0, N, P);
    check_sphere(2, R, 10.0, N, B);
    check_uniform(3, R, 0.95, 1.05, d);
    check_uniform(4, R, 0.0, 2.0, g);
    for (size_t i = 0; i < 3 * R; i++) B[i] *= d[i / 3];
    free(N);
    free(d);
}

static void compare(const result *got, const result *want, size_t J, size_t R, double factor,
                    double tol)
{
    for (size_t i = 0; i < 3 * J; i++) want->grad[i] *= factor;
    if (!(fabs(got->loss - factor * want->loss) <= tol * factor * want->loss))
        fail_msg("loss %.17g, expected %.17g", got->loss, factor * want->loss);
    golden_close_max("grad", 3 * J, got->grad, want->grad, tol);
    golden_close_max("kbar", R, got->kbar, want->kbar, tol);
    golden_close_max("mass", J, got->mass, want->mass, tol);
}

/* Sizes around the widths of blocks and groups, one particle, softness from sharp to flat; what
 * is cut off is below e^-25. */
static void equals_the_plain_definition(void **state)
{
    (void)state;
    static const size_t sizes[][2] = { { 1, 5 },    { 7, 16 },   { 8, 17 },    { 9, 1 },
                                       { 65, 200 }, { 300, 64 }, { 513, 2000 } };
    static const double taus[] = { 0.02, 0.3, 2.0, 40.0 };
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        for (size_t t = 0; t < 4; t++) {
            const size_t J = sizes[i][0], R = sizes[i][1];
            double *P = check_alloc(3 * J), *B = check_alloc(3 * R), *g = check_alloc(R);
            scene(J, R, P, B, g);
            result want = plain_loss(J, P, R, B, g, taus[t]);
            result all = fast_loss(J, P, R, B, g, taus[t], 700.0, APSM_SAMPLING_MEAN);
            result cut = fast_loss(J, P, R, B, g, taus[t], 25.0, APSM_SAMPLING_VORONOI);
            result single = single_loss(J, P, R, B, g, taus[t], 15.0);
            compare(&single, &want, J, R, 1.0, taus[t] < 0.1 ? 2e-4 : 2e-5);
            compare(&all, &want, J, R, 1.0, 1e-11);
            compare(&cut, &want, J, R, (double)(J * J), 1e-9);
            result_free(&want);
            result_free(&all);
            result_free(&cut);
            result_free(&single);
            free(P);
            free(B);
            free(g);
        }
}

/* ---- golden ---- */

typedef struct golden {
    double P[96], N[96], B[240], D[80], s;
} golden;

static void copy_member(const json_t *root, const char *key, size_t n, double *to)
{
    double *x = golden_member(root, key, n);
    memcpy(to, x, n * sizeof *to);
    free(x);
}

/* One shape of one case: E, then g, loss, gradients with E constant and through the weights. */
static void check_shape(const golden *in, const json_t *c, size_t i, const apsm_rbf_shape *shape,
                        const apsm_polyharmonic *factor, double *work)
{
    enum { J = 16, R = 40 };
    const double *P = in->P + 48 * i, *B = in->B + 120 * i, *D = in->D + 40 * i;
    double f[R], E[R], g[R], a[R];
    double *loss = golden_member(c, "loss_per_shape", 2), *kbar = golden_member(c, "kbar", 80),
           *mass = golden_member(c, "cell_mass", 32), *want_E = golden_member(c, "E", 80),
           *constant = golden_member(c, "grad_E_constant", 96),
           *through = golden_member(c, "grad_E_through_w", 96);
    apsm_rbf_eval(shape, R, B, f, NULL);
    const double factor_E = apsm_sampling_weights(R, f, D, golden_number(c, "c"), false, E, g);
    golden_close_max("E", R, E, want_E + R * i, 1e-9);
    result x = fast_loss(J, P, R, B, g, golden_number(c, "tau"), 25.0, APSM_SAMPLING_MEAN);
    golden_close("loss", 1, &x.loss, loss + i, 1e-9);
    golden_close_max("kbar", R, x.kbar, kbar + R * i, 1e-9);
    golden_close_max("mass", J, x.mass, mass + J * i, 1e-9);
    golden_close_max("E constant", 3 * J, x.grad, constant + 48 * i, 1e-8);
    apsm_sampling_dL_df(J, R, f, D, x.kbar, factor_E, APSM_SAMPLING_MEAN, a);
    apsm_rbf_adjoint(shape, factor, R, B, a, x.grad, work);
    golden_close_max("E through w", 3 * J, x.grad, through + 48 * i, 1e-8);
    result_free(&x);
    double *all[] = { loss, kbar, mass, want_E, constant, through };
    for (size_t k = 0; k < 6; k++) free(all[k]);
}

static void equals_golden(void **state)
{
    (void)state;
    enum { J = 16 };
    json_t *root = golden_load("sampling");
    golden in = { .s = golden_number(root, "s") };
    copy_member(root, "P", 96, in.P);
    copy_member(root, "N", 96, in.N);
    copy_member(root, "B", 240, in.B);
    copy_member(root, "D", 80, in.D);
    double store[12 * J], *factor_store = check_alloc(apsm_polyharmonic_store_size(3 * J, false)),
                          *work = check_alloc(apsm_rbf_work_size(J));
    const json_t *cases = golden_get(root, "cases");
    for (size_t i = 0; i < 2; i++) {
        apsm_rbf_shape shape;
        apsm_polyharmonic factor;
        apsm_rbf_bind(&shape, J, store);
        const apsm_dipoles d = { in.P + 48 * i, in.N + 48 * i, in.s };
        assert_int_equal(apsm_rbf_fit(APSM_PHI_R, &d, false, factor_store, &factor, &shape, work),
                         APSM_OK);
        for (size_t k = 0; k < json_array_size(cases); k++)
            check_shape(&in, json_array_get(cases, k), i, &shape, &factor, work);
    }
    free(factor_store);
    free(work);
    json_decref(root);
}

/* With one point and g = 1 the mass is w itself. */
static void softmin_row_equals_golden(void **state)
{
    (void)state;
    json_t *root = golden_load("sampling");
    double *P = golden_member(root, "P", 96), *B = golden_member(root, "B", 240),
           *want = golden_member(root, "softmin_row0_shape0_tau1", 16), one = 1.0;
    result x = fast_loss(16, P, 1, B, &one, 1.0, 25.0, APSM_SAMPLING_MEAN);
    golden_close_max("w", 16, x.mass, want, 1e-9);
    result_free(&x);
    free(P);
    free(B);
    free(want);
    json_decref(root);
}

/* ---- what must be true ---- */

typedef struct fixed {
    size_t J, R;
    const double *B, *g;
    int norm;
} fixed;

static double loss_at(const double *P, void *user)
{
    const fixed *s = user;
    result x = fast_loss(s->J, P, s->R, s->B, s->g, 1.5, 25.0, s->norm);
    const double loss = x.loss;
    result_free(&x);
    return loss;
}

static void gradient_matches_differences(void **state)
{
    (void)state;
    enum { J = 20, R = 90 };
    double P[3 * J], B[3 * R], g[R];
    scene(J, R, P, B, g);
    for (int norm = APSM_SAMPLING_MEAN; norm <= APSM_SAMPLING_VORONOI; norm++) {
        fixed s = { J, R, B, g, norm };
        result x = fast_loss(J, P, R, B, g, 1.5, 25.0, norm);
        check_gradient("sampling", 3 * J, P, 10.0, DBL_EPSILON, x.grad, loss_at, &s);
        result_free(&x);
    }
}

/* Two particles at distance 2, the point 1 beside the middle: by hand. */
static void two_particles_by_hand(void **state)
{
    (void)state;
    const double P[6] = { -1, 0, 0, 1, 0, 0 }, B[3] = { 0, 1, 0 };
    result x = fast_loss(2, P, 1, B, NULL, 1.0, 25.0, APSM_SAMPLING_SUM);
    const double r = sqrt(2.0), want[6] = { -0.5 / r, -0.5 / r, 0, 0.5 / r, -0.5 / r, 0 };
    golden_close("loss", 1, &x.loss, &r, 1e-15);
    golden_close("grad", 6, x.grad, want, 1e-15);
    assert_true(x.mass[0] == 0.5 && x.mass[1] == 0.5);
    result_free(&x);
}

static void scales_exactly(void **state)
{
    (void)state;
    enum { J = 100, R = 300 };
    double P[3 * J], B[3 * R], g[R];
    scene(J, R, P, B, g);
    result x = fast_loss(J, P, R, B, g, 0.7, 25.0, APSM_SAMPLING_VORONOI);
    for (size_t i = 0; i < 3 * J; i++) P[i] *= 0x1p-30;
    for (size_t i = 0; i < 3 * R; i++) B[i] *= 0x1p-30;
    result y = fast_loss(J, P, R, B, g, 0x1p-30 * 0.7, 25.0, APSM_SAMPLING_VORONOI);
    check_scaled("loss", 1, &y.loss, &x.loss, 0x1p-30);
    check_scaled("grad", 3 * J, y.grad, x.grad, 1.0);
    result_free(&x);
    result_free(&y);
}

/* Neither the order of particles and points nor a rigid motion matters. */
static void order_and_motion_do_not_matter(void **state)
{
    (void)state;
    enum { J = 90, R = 400 };
    double P[3 * J], B[3 * R], g[R], Q[3 * J], C[3 * R], e[R], want[3 * J];
    scene(J, R, P, B, g);
    result x = fast_loss(J, P, R, B, g, 0.7, 25.0, APSM_SAMPLING_VORONOI);
    for (size_t i = 0; i < J + R; i++) { /* reversed, turned about z by the 3-4-5 angle, shifted */
        const double *p = i < J ? P + 3 * i : B + 3 * (i - J), *n = x.grad + 3 * i;
        double *q = i < J ? Q + 3 * (J - 1 - i) : C + 3 * (R - 1 - (i - J));
        q[0] = 0.6 * p[0] - 0.8 * p[1] + 70.0;
        q[1] = 0.8 * p[0] + 0.6 * p[1] - 30.0;
        q[2] = p[2] + 50.0;
        if (i >= J) {
            e[R - 1 - (i - J)] = g[i - J];
            continue;
        }
        double *v = want + 3 * (J - 1 - i);
        v[0] = 0.6 * n[0] - 0.8 * n[1];
        v[1] = 0.8 * n[0] + 0.6 * n[1];
        v[2] = n[2];
    }
    result y = fast_loss(J, Q, R, C, e, 0.7, 25.0, APSM_SAMPLING_VORONOI);
    golden_close("loss", 1, &y.loss, &x.loss, 1e-12);
    golden_close_max("grad", 3 * J, y.grad, want, 1e-9); /* e^-25 is cut differently */
    result_free(&x);
    result_free(&y);
}

/* In single precision a shift costs nothing: coordinates are relative to where a group lies. */
static void single_precision_is_of_distances(void **state)
{
    (void)state;
    enum { J = 200, R = 1000 };
    double P[3 * J], B[3 * R], g[R];
    scene(J, R, P, B, g);
    result x = single_loss(J, P, R, B, g, 0.2, 15.0);
    for (size_t i = 0; i < 3 * J; i++) P[i] += 1e6;
    for (size_t i = 0; i < 3 * R; i++) B[i] += 1e6;
    result y = single_loss(J, P, R, B, g, 0.2, 15.0);
    compare(&y, &x, J, R, 1.0, 2e-5);
    result_free(&x);
    result_free(&y);
}

/* Particles on points, coinciding particles and a flat cloud stay finite. */
static void degenerate_scenes_stay_finite(void **state)
{
    (void)state;
    enum { J = 20, R = 40 };
    double P[3 * J], B[3 * R], g[R];
    scene(J, R, P, B, g);
    memcpy(P, B, 9 * sizeof *P);
    memcpy(P + 9, B, 9 * sizeof *P);
    result x = fast_loss(J, P, R, B, g, 0.5, 25.0, APSM_SAMPLING_VORONOI);
    for (size_t i = 0; i < 3 * J; i++) assert_true(isfinite(x.grad[i]));
    assert_true(x.mass[0] == x.mass[3]);
    result_free(&x);
    x = single_loss(J, P, R, B, g, 0.5, 15.0);
    for (size_t i = 0; i < 3 * J; i++) assert_true(isfinite(x.grad[i]));
    assert_true(x.mass[0] == x.mass[3]);
    result_free(&x);
    for (size_t i = 0; i < R; i++) memcpy(B + 3 * i, P, 3 * sizeof *B);
    x = fast_loss(1, P, R, B, g, 0.5, 25.0, APSM_SAMPLING_VORONOI);
    assert_true(x.loss == 0.0 && x.grad[0] == 0.0);
    result_free(&x);
}

static void refuses_bad_arguments(void **state)
{
    (void)state;
    double P[3] = { 0 }, B[3] = { 1, 0, 0 }, loss = 5.0, work[4096];
    assert_true(apsm_sampling_work_size(1, 1) <= 4096);
    apsm_sampling_options opt = apsm_sampling_defaults();
    const apsm_sampling_result wanted = { .loss = &loss };
    const apsm_sampling_points one = { 1, 1, P, B, NULL }, none = { 0, 1, P, B, NULL };
    assert_int_equal(apsm_sampling_loss(&one, &opt, &wanted, work), APSM_ERR_ARG); /* h is 0 */
    assert_true(loss == 5.0);
    opt.tau = opt.h = 1.0;
    opt.precision = APSM_PRECISION_DOUBLE;
    assert_int_equal(apsm_sampling_loss(&none, &opt, &wanted, work), APSM_ERR_ARG);
    assert_int_equal(apsm_sampling_loss(&one, &opt, &wanted, work), APSM_OK);
    assert_true(loss == 1.0);
    B[2] = NAN;
    assert_int_equal(apsm_sampling_loss(&one, &opt, &wanted, work), APSM_ERR_NONFINITE);
}

static void weights_have_mean_one_when_relative(void **state)
{
    (void)state;
    const double f[3] = { 1, 2, 3 }, D[3] = { 1, 1, 1 };
    double E[3], g[3];
    assert_true(apsm_sampling_weights(3, f, D, 0.5, true, E, g) == 0.3); /* .5 / (5/3) */
    assert_true(E[2] == 4.0 && g[0] == 0.5 && fabs(g[0] + g[1] + g[2] - 3.0) < 1e-15);
    assert_true(apsm_sampling_weights(3, f, D, 0.5, false, E, E) == 0.5);
    assert_true(E[0] == 0.5 && E[1] == 1.0 && E[2] == 2.5);
    apsm_sampling_weights(3, D, D, 1.0, true, E, g);
    assert_true(g[0] == 1.0 && g[1] == 1.0 && g[2] == 1.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exp_is_good_to_one_ulp),
        cmocka_unit_test(expf_is_good_to_two_ulp),
        cmocka_unit_test(exp2f_is_good_to_two_ulp),
        cmocka_unit_test(equals_the_plain_definition),
        cmocka_unit_test(equals_golden),
        cmocka_unit_test(softmin_row_equals_golden),
        cmocka_unit_test(gradient_matches_differences),
        cmocka_unit_test(two_particles_by_hand),
        cmocka_unit_test(scales_exactly),
        cmocka_unit_test(order_and_motion_do_not_matter),
        cmocka_unit_test(single_precision_is_of_distances),
        cmocka_unit_test(degenerate_scenes_stay_finite),
        cmocka_unit_test(refuses_bad_arguments),
        cmocka_unit_test(weights_have_mean_one_when_relative),
    };
    return cmocka_run_group_tests_name("sampling_loss", tests, NULL, NULL);
}
