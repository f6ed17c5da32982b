/* Method psm: its kernel widths and entropy against known answers and differences; on ellipsoids,
 * even spacing and agreement with the affine map between them; and that a run depends on nothing
 * but cohort and options. */
#include "cmocka_all.h"

#include "check.h"
#include "psm/psm.h"
#include "psm/psm_entropy.h"
#include "psm/psm_sweep.h"
#include "shapes.h"
#include "synthetic.h"

/* ---- kernel width and entropy ---- */

static void test_width_of_a_ring(void **state)
{
    (void)state;
    double d2[6], w[6];
    for (size_t j = 0; j < 6; j++) d2[j] = 0.49, w[j] = 0.5;
    for (double start = 0.2; start < 5; start *= 2) {
        const double sigma = psm_kernel_width(6, d2, w, start);
        if (!(fabs(sigma - 0.7 / sqrt(3)) <= 2e-5)) fail_msg("start %g: %.8f", start, sigma);
    }
    if (psm_kernel_width(6, d2, w, 0.01) != 0) fail_msg("neighbours out of sight are seen");
}

/* The likelihood sum_j exp(-d_j^2 / 2 s^2) / s^3 is greatest there. */
static void test_width_is_likeliest(void **state)
{
    (void)state;
    double d2[30], w[30], value[3];
    check_uniform(1, 30, 0.5, 4, d2);
    check_uniform(2, 30, 0.1, 1, w);
    const double sigma = psm_kernel_width(30, d2, w, 1);
    for (int v = 0; v < 3; v++) {
        const double s = sigma * (1 + 0.01 * (v - 1));
        value[v] = 0;
        for (size_t j = 0; j < 30; j++) value[v] += w[j] * exp(-d2[j] / (2 * s * s)) / pow(s, 3);
    }
    if (!(value[1] > value[0] && value[1] > value[2]))
        fail_msg("not a maximum at %g: %g %g %g", sigma, value[0], value[1], value[2]);
}

enum { SHAPES = 5, COORDINATES = 12 };

static double entropy_value(const double *x, void *user)
{
    double Q[SHAPES * COORDINATES], grad[SHAPES * COORDINATES], blocks[3 * COORDINATES], value;
    double *work = check_alloc(psm_entropy_work_size(SHAPES, COORDINATES));
    memcpy(Q, x, sizeof Q);
    const double reg = *(const double *)user;
    assert_int_equal(psm_entropy(SHAPES, COORDINATES, reg, Q, grad, blocks, &value, work), APSM_OK);
    free(work);
    return value;
}

static void test_entropy_gradient(void **state)
{
    (void)state;
    double X[SHAPES * COORDINATES], Q[SHAPES * COORDINATES], grad[SHAPES * COORDINATES];
    double blocks[3 * COORDINATES], value, regs[] = { 0.3, INFINITY };
    double *work = check_alloc(psm_entropy_work_size(SHAPES, COORDINATES));
    check_uniform(3, SHAPES * COORDINATES, -1, 1, X);
    for (int r = 0; r < 2; r++) {
        memcpy(Q, X, sizeof Q);
        assert_int_equal(psm_entropy(SHAPES, COORDINATES, regs[r], Q, grad, blocks, &value, work),
                         APSM_OK);
        check_gradient("entropy", SHAPES * COORDINATES, X, 1, 4 * DBL_EPSILON, grad, entropy_value,
                       &regs[r]);
        double sum = 0; /* first block: sum over the shapes of g g', or 1 */
        for (size_t i = 0; i < SHAPES; i++) sum += grad[i * COORDINATES] * grad[i * COORDINATES];
        const double expected = isinf(regs[r]) ? 1 : sum;
        if (!(fabs(blocks[0] - expected) <= 1e-12)) fail_msg("block %g, not %g", blocks[0], sum);
    }
    free(work);
}

/* ---- runs ---- */

typedef struct scene {
    apsm_context *ctx;
    size_t I;
    apsm_mesh mesh[6], sphere;
    double transforms[6][16];
    const char *names[6];
    apsm_cohort cohort;
    apsm_optimize_options o;
} scene;

static void scene_open(scene *s, size_t I, int level, double scale)
{
    *s = (scene){ .ctx = apsm_context_new(), .I = I, .o = apsm_optimize_defaults() };
    s->sphere = shape_icosphere(level);
    for (size_t i = 0; i < I; i++) {
        s->mesh[i] = synthetic_shape(SYNTHETIC_ELLIPSOID, i, I, level);
        for (size_t x = 0; x < 3 * s->mesh[i].nv; x++) s->mesh[i].V[x] *= scale;
        for (size_t a = 0; a < 16; a++) s->transforms[i][a] = a % 5 == 0;
        s->names[i] = "ellipsoid";
    }
    const apsm_cohort_input in = { I, s->names, s->mesh, s->transforms[0], 0 };
    assert_int_equal(apsm_cohort_build(s->ctx, &in, 0, 0, &s->cohort), APSM_OK);
    s->o.method = APSM_METHOD_PSM;
    s->o.psm.psm_unit = scale;
}

static void scene_close(scene *s)
{
    apsm_cohort_free(&s->cohort);
    for (size_t i = 0; i < s->I; i++) apsm_mesh_free(&s->mesh[i]);
    apsm_mesh_free(&s->sphere);
    apsm_context_free(s->ctx);
}

static void start(scene *s, size_t J, apsm_optimizer_state *state)
{
    assert_int_equal(apsm_optimizer_state_alloc(s->I, J, state), APSM_OK);
    apsm_psm_first_particle(&s->cohort, state);
}

static void run(scene *s, apsm_optimizer_state *state, apsm_epoch_fn fn, void *user)
{
    const apsm_status status = apsm_psm_optimize(s->ctx, &s->cohort, &s->o, state, fn, user);
    if (status != APSM_OK) fail_msg("%s", apsm_error_text(s->ctx));
}

/* Coefficient of variation of the distances to the nearest neighbour. */
static double unevenness(size_t J, const double *P)
{
    double sum = 0, sum2 = 0;
    for (size_t j = 0; j < J; j++) {
        double best = INFINITY;
        for (size_t k = 0; k < J; k++) {
            double d2 = 0;
            for (size_t a = 0; a < 3; a++) d2 += pow(P[3 * j + a] - P[3 * k + a], 2);
            if (k != j) best = fmin(best, d2);
        }
        sum += sqrt(best);
        sum2 += best;
    }
    const double mean = sum / (double)J;
    return sqrt(fmax(0, sum2 / (double)J - mean * mean)) / mean;
}

/* Mean distance on the unit sphere of the particles' places from their mean places. */
static double affine_deviation(const scene *s, const apsm_optimizer_state *state)
{
    const size_t J = state->J;
    double total = 0;
    for (size_t j = 0; j < J; j++) {
        double u[6][3], mean[3] = { 0, 0, 0 };
        for (size_t i = 0; i < s->I; i++) {
            synthetic_carry(s->cohort.shape[i].bvh, &s->sphere, state->P + (i * J + j) * 3, u[i]);
            for (int a = 0; a < 3; a++) mean[a] += u[i][a] / (double)s->I;
        }
        for (size_t i = 0; i < s->I; i++)
            total += sqrt(pow(u[i][0] - mean[0], 2) + pow(u[i][1] - mean[1], 2) +
                          pow(u[i][2] - mean[2], 2));
    }
    return total / (double)(J * s->I);
}

static void test_ellipsoids(void **unused)
{
    (void)unused;
    scene s;
    apsm_optimizer_state state;
    scene_open(&s, 6, 4, 1);
    s.o.psm.psm_iterations_per_split = 300;
    s.o.psm.psm_optimization_iterations = 1000;
    s.o.psm.psm_starting_share = 0.05;
    start(&s, 128, &state);
    run(&s, &state, NULL, NULL);
    assert_int_equal(state.stage, APSM_STAGE_DONE);
    double worst = 0;
    for (size_t i = 0; i < s.I; i++) worst = fmax(worst, unevenness(128, state.P + i * 128 * 3));
    const double deviation = affine_deviation(&s, &state);
    print_message("unevenness %.4f, deviation %.4f\n", worst, deviation);
    if (!(worst <= 0.08)) fail_msg("spacing varies by %.3f", worst);
    if (!(deviation <= 0.03)) fail_msg("%.4f from the affine map", deviation);
    apsm_optimizer_state_free(&state);
    scene_close(&s);
}

/* Shapes of ten thousand times the usual area: unscaled, the pull to the mean keeps particles
 * together; with psm_sampling_scale they spread as on shapes of the usual size. */
static double unevenness_of_large(bool scaled)
{
    scene s;
    apsm_optimizer_state state;
    scene_open(&s, 4, 3, 3000);
    s.o.psm.psm_unit = 1;
    s.o.psm.psm_iterations_per_split = 200;
    s.o.psm.psm_optimization_iterations = 0;
    s.o.psm.psm_sampling_scale = scaled;
    start(&s, 16, &state);
    run(&s, &state, NULL, NULL);
    double worst = 0;
    for (size_t i = 0; i < s.I; i++) worst = fmax(worst, unevenness(16, state.P + i * 16 * 3));
    apsm_optimizer_state_free(&state);
    scene_close(&s);
    return worst;
}

static void test_size_is_made_up_for(void **unused)
{
    (void)unused;
    const double plain = unevenness_of_large(false), scaled = unevenness_of_large(true);
    print_message("unevenness %.3f, scaled %.3f\n", plain, scaled);
    if (!(scaled <= 0.2)) fail_msg("spacing varies by %.3f", scaled);
    if (!(plain >= 4 * scaled))
        fail_msg("%.3f without, %.3f with: nothing to make up for", plain, scaled);
}

/* The first particle lies at an end, not in the hollow that faces the centroid. */
static void test_first_particle_is_at_an_end(void **unused)
{
    (void)unused;
    scene s;
    apsm_optimizer_state state;
    scene_open(&s, 4, 4, 1);
    start(&s, 2, &state);
    for (size_t i = 0; i < s.I; i++) {
        double c[3];
        apsm_mesh_centroid(&s.mesh[i], c);
        for (int a = 0; a < 3; a++)
            if (!(state.P[6 * i + (size_t)a] > c[a]))
                fail_msg("shape %zu: not the upper corner", i);
    }
    apsm_optimizer_state_free(&state);
    scene_close(&s);
}

/* Few particles and iterations, with everything in it: partial split, registration, the entropy
 * from the start. */
static void open_small(scene *s, double scale)
{
    scene_open(s, 4, 3, scale);
    s->o.psm.psm_iterations_per_split = 25;
    s->o.psm.psm_optimization_iterations = 30;
    s->o.psm.psm_starting_share = 0.05;
    s->o.psm.psm_shape_statistics_in_init = true;
    s->o.psm.psm_procrustes = true;
    s->o.psm.psm_procrustes_scaling = true;
}

enum { FEW = 20 };

static void check_same(const char *what, const apsm_optimizer_state *a,
                       const apsm_optimizer_state *b, double scale)
{
    for (size_t x = 0; x < a->I * a->J * 3; x++)
        if (a->P[x] * scale != b->P[x]) fail_msg("%s: %a and %a", what, a->P[x] * scale, b->P[x]);
}

static void test_threads_and_unit(void **unused)
{
    (void)unused;
    scene s, t;
    apsm_optimizer_state a, b;
    open_small(&s, 1);
    open_small(&t, 4);
    apsm_context_set_threads(t.ctx, 3);
    start(&s, FEW, &a);
    start(&t, FEW, &b);
    run(&s, &a, NULL, NULL);
    run(&t, &b, NULL, NULL);
    check_same("4 times as large, 3 threads", &a, &b, 4);
    for (size_t i = 0; i < s.I; i++) {
        double even = unevenness(FEW, a.P + i * FEW * 3);
        if (!(even < 0.5)) fail_msg("a particle lies on another: %g", even);
        for (size_t j = 0; j < FEW; j++) {
            apsm_closest on;
            apsm_bvh_closest(s.cohort.shape[i].bvh, a.P + (i * FEW + j) * 3, INFINITY, &on);
            if (!(on.distance2 < 1e-20)) fail_msg("%g off the surface", sqrt(on.distance2));
        }
    }
    apsm_optimizer_state_free(&a);
    apsm_optimizer_state_free(&b);
    scene_close(&s);
    scene_close(&t);
}

/* Keeps the state of one call, as a checkpoint would. */
typedef struct keeper {
    long wanted, calls;
    apsm_optimizer_state kept;
} keeper;

static double *copy(const double *x, size_t n)
{
    double *y = check_alloc(n);
    memcpy(y, x, n * sizeof *y);
    return y;
}

static apsm_status keep(void *user, const apsm_optimizer_state *state,
                        const apsm_epoch_record *record)
{
    keeper *k = user;
    if (!isfinite(record->loss[APSM_TERM_SAMPLING]) ||
        !isfinite(record->loss[APSM_TERM_CORRESPONDENCE]))
        fail_msg("record of epoch %ld is not finite", record->epoch);
    if (k->calls++ != k->wanted) return APSM_OK;
    k->kept = *state;
    k->kept.P = copy(state->P, state->I * state->J * 3);
    k->kept.mean = copy(state->mean, state->J * 3);
    k->kept.own = copy(state->own, state->own_size);
    return APSM_OK;
}

static void test_resume(void **unused)
{
    (void)unused;
    scene s;
    apsm_optimizer_state whole;
    open_small(&s, 1);
    const long calls[] = { 1, 2, 7, 14, 16 };
    for (size_t c = 0; c < sizeof calls / sizeof calls[0]; c++) {
        keeper k = { .wanted = calls[c] };
        start(&s, FEW, &whole);
        run(&s, &whole, keep, &k);
        if (!k.kept.P) fail_msg("only %ld calls", k.calls);
        run(&s, &k.kept, NULL, NULL);
        check_same("resumed", &whole, &k.kept, 1);
        apsm_optimizer_state_free(&whole);
        apsm_optimizer_state_free(&k.kept);
    }
    scene_close(&s);
}

/* An interrupted block is undone, and the run goes on to the same bytes. */
typedef struct stopper {
    volatile int flag;
    long calls;
} stopper;

static apsm_status stop_later(void *user, const apsm_optimizer_state *state,
                              const apsm_epoch_record *record)
{
    (void)state;
    (void)record;
    stopper *stop = user;
    stop->flag = ++stop->calls == 5;
    return APSM_OK;
}

static void test_interrupt(void **unused)
{
    (void)unused;
    scene s;
    apsm_optimizer_state whole, parts;
    stopper stop = { 0 };
    open_small(&s, 1);
    start(&s, FEW, &whole);
    start(&s, FEW, &parts);
    run(&s, &whole, NULL, NULL);
    apsm_context_set_interrupt(s.ctx, &stop.flag);
    assert_int_equal(apsm_psm_optimize(s.ctx, &s.cohort, &s.o, &parts, stop_later, &stop),
                     APSM_ERR_INTERRUPTED);
    assert_int_equal(apsm_psm_optimize(s.ctx, &s.cohort, &s.o, &parts, stop_later, &stop),
                     APSM_ERR_INTERRUPTED); /* the flag is still up: nothing is done */
    stop.flag = 0;
    run(&s, &parts, stop_later, &stop);
    check_same("interrupted", &whole, &parts, 1);
    apsm_optimizer_state_free(&whole);
    apsm_optimizer_state_free(&parts);
    scene_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_width_of_a_ring),
        cmocka_unit_test(test_width_is_likeliest),
        cmocka_unit_test(test_entropy_gradient),
        cmocka_unit_test(test_ellipsoids),
        cmocka_unit_test(test_size_is_made_up_for),
        cmocka_unit_test(test_first_particle_is_at_an_end),
        cmocka_unit_test(test_threads_and_unit),
        cmocka_unit_test(test_resume),
        cmocka_unit_test(test_interrupt),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
