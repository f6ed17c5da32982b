/* What must not change the particles: the number of threads, an interruption, a power-of-two unit,
 * a rigid motion, the rounding of another unit. */
#include "cohort_run.h"

#include <string.h>

enum { I = 5, J = 64 };

static apsm_optimize_options short_run(void)
{
    apsm_optimize_options o = apsm_optimize_defaults();
    o.schedule.stage1_epochs = 12;
    o.schedule.stage2_epochs = 8;
    return o;
}

static cohort_run optimized(const double *M, int threads)
{
    const apsm_optimize_options o = short_run();
    cohort_run r = cohort_begin(SYNTHETIC_BUMP, I, 4, J, M, threads);
    cohort_optimize(&r, &o);
    return r;
}

static void same_bytes(const cohort_run *a, const cohort_run *b, double scale)
{
    for (size_t x = 0; x < (size_t)I * J * 3; x++)
        if (a->state.P[x] * scale != b->state.P[x])
            fail_msg("number %zu: %.17g and %.17g", x, a->state.P[x] * scale, b->state.P[x]);
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    cohort_run one = optimized(NULL, 1), three = optimized(NULL, 3);
    same_bytes(&one, &three, 1);
    cohort_end(&one);
    cohort_end(&three);
}

/* Scales by s. */
static void scaling(double s, double M[16])
{
    apsm_affine_identity(M);
    M[0] = M[5] = M[10] = s;
}

static void a_power_of_two_scales_exactly(void **state)
{
    (void)state;
    double M[16];
    scaling(0x1p-10, M);
    cohort_run a = optimized(NULL, 2), b = optimized(M, 2);
    same_bytes(&a, &b, 0x1p-10);
    cohort_end(&a);
    cohort_end(&b);
}

/* Rounding differs in another unit, but not more than particles forget.  A shear takes the
 * symmetry from the shapes: mirror images of a farthest point are ties that rounding decides. */
static void another_unit_changes_little(void **state)
{
    (void)state;
    static const double scales[] = { 1, 1000, 0.001 };
    cohort_run r[3];
    for (size_t k = 0; k < 3; k++) {
        double M[16];
        scaling(scales[k], M);
        M[1] = 0.13 * scales[k];
        M[8] = 0.21 * scales[k];
        r[k] = optimized(M, 2);
    }
    const double h = apsm_expected_spacing(apsm_mesh_area(&r[0].mesh[I / 2]), J);
    for (size_t k = 1; k < 3; k++)
        for (size_t x = 0; x < (size_t)I * J * 3; x++) {
            const double d = fabs(r[0].state.P[x] - r[k].state.P[x] / scales[k]) / h;
            if (!(d < 0.1)) fail_msg("scale %g, number %zu moved by %g h", scales[k], x, d);
        }
    for (size_t k = 0; k < 3; k++) cohort_end(&r[k]);
}

/* Stops after a number of epochs by the interrupt flag. */
typedef struct stopper {
    int left;
    volatile int flag;
    int *settling; /* epochs before the first */
} stopper;

static apsm_status count_down(void *user, const apsm_optimizer_state *s,
                              const apsm_epoch_record *record)
{
    (void)s;
    stopper *stop = user;
    *stop->settling += record->epoch < 0;
    if (--stop->left == 0) stop->flag = 1;
    return APSM_OK;
}

/* Interrupted after every third epoch, as in one go; returns the epochs before the first. */
static int compare_interrupted(const apsm_optimize_options o)
{
    cohort_run whole = cohort_begin(SYNTHETIC_BUMP, I, 4, J, NULL, 2);
    cohort_optimize(&whole, &o);
    cohort_run parts = cohort_begin(SYNTHETIC_BUMP, I, 4, J, NULL, 2);
    ok(&parts, apsm_first_particles(parts.ctx, &parts.cohort, &o, J, parts.state.P));
    apsm_status status = APSM_ERR_INTERRUPTED;
    int pieces = 0, settling = 0;
    for (; status == APSM_ERR_INTERRUPTED; pieces++) {
        stopper stop = { .left = 3, .settling = &settling };
        apsm_context_set_interrupt(parts.ctx, &stop.flag);
        ok(&parts, apsm_first_pass(parts.ctx, &parts.cohort, &o, &parts.state));
        status = apsm_optimize(parts.ctx, &parts.cohort, &o, &parts.state, count_down, &stop);
        apsm_context_set_interrupt(parts.ctx, NULL);
    }
    ok(&parts, status);
    assert_true(pieces > 4);
    same_bytes(&whole, &parts, 1);
    cohort_end(&whole);
    cohort_end(&parts);
    return settling;
}

/* Also while particles settle that were matched badly, which registered ones never are. */
static void an_interruption_does_not_matter(void **state)
{
    (void)state;
    apsm_optimize_options o = short_run();
    assert_int_equal(compare_interrupted(o), 0);
    o.first.initialize = APSM_INIT_FPS;
    o.schedule.settle_epochs = 17;
    o.walk.stop_mismatched = 0; /* to the last of them */
    o.schedule.settle_mismatched = 0.02;
    assert_in_range(compare_interrupted(o), 11, 17);
    o.schedule.stage1_epochs = o.schedule.stage2_epochs = 0; /* adaptive, with factors kept */
    o.schedule.settle_epochs = 27;
    assert_in_range(compare_interrupted(o), 11, 27);
}

/* Batches of 2 of 5 shapes run, resume and repeat as one batch does. */
static void minibatches_are_reproducible(void **state)
{
    (void)state;
    apsm_optimize_options o = short_run();
    o.batch = 2;
    cohort_run a = cohort_begin(SYNTHETIC_BUMP, I, 4, J, NULL, 1);
    cohort_run b = cohort_begin(SYNTHETIC_BUMP, I, 4, J, NULL, 3);
    cohort_optimize(&a, &o);
    cohort_optimize(&b, &o);
    same_bytes(&a, &b, 1);
    cohort_end(&a);
    cohort_end(&b);
}

/* Particles end on the surface and apart from each other. */
static void particles_are_on_the_surface(void **state)
{
    (void)state;
    cohort_run r = optimized(NULL, 2);
    const double h = apsm_expected_spacing(apsm_mesh_area(&r.mesh[I / 2]), J);
    for (size_t i = 0; i < I; i++)
        for (size_t j = 0; j < J; j++) {
            apsm_closest c;
            apsm_bvh_closest(r.cohort.shape[i].bvh, r.state.P + (i * J + j) * 3, INFINITY, &c);
            assert_true(sqrt(c.distance2) < 1e-9 * h);
        }
    cohort_end(&r);
}

/* They are spread over the template by steps of their own. */
static void first_particles_do_not_depend_on_alpha(void **state)
{
    (void)state;
    apsm_optimize_options o = short_run();
    cohort_run a = cohort_begin(SYNTHETIC_BUMP, I, 4, J, NULL, 2);
    cohort_run b = cohort_begin(SYNTHETIC_BUMP, I, 4, J, NULL, 2);
    ok(&a, apsm_first_particles(a.ctx, &a.cohort, &o, J, a.state.P));
    o.schedule.alpha = 1;
    ok(&b, apsm_first_particles(b.ctx, &b.cohort, &o, J, b.state.P));
    same_bytes(&a, &b, 1);
    cohort_end(&a);
    cohort_end(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(a_power_of_two_scales_exactly),
        cmocka_unit_test(another_unit_changes_little),
        cmocka_unit_test(an_interruption_does_not_matter),
        cmocka_unit_test(minibatches_are_reproducible),
        cmocka_unit_test(particles_are_on_the_surface),
        cmocka_unit_test(first_particles_do_not_depend_on_alpha),
    };
    return cmocka_run_group_tests_name("invariance", tests, NULL, NULL);
}
