/* Subjects of several parts in one optimisation: surfaces are each part's own, the eigenshape loss
 * is over all of them. */
#include <stdlib.h>
#include <string.h>

#include "cmocka_all.h"
#include "optimize/eigenshape_loss.h"
#include "optimize/optimizer.h"
#include "synthetic.h"

enum { I = 5, JA = 32, JB = 24, J = JA + JB, LEVEL = 3 };

static const char *const names[I] = { "a", "b", "c", "d", "e" };

/* Of this kind and size; order says which subject has which of its shapes. */
static apsm_cohort part_of_kind(apsm_context *ctx, synthetic_kind kind, double size,
                                const size_t order[I])
{
    apsm_mesh mesh[I];
    double M[16 * I] = { 0 };
    apsm_cohort c;
    const apsm_optimize_options o = apsm_optimize_defaults();
    for (size_t i = 0; i < I; i++) {
        mesh[i] = synthetic_shape(kind, order[i], I, LEVEL);
        for (size_t x = 0; x < 3 * mesh[i].nv; x++) mesh[i].V[x] *= size;
        for (size_t k = 0; k < 4; k++) M[16 * i + 5 * k] = 1;
    }
    const double h = apsm_expected_spacing(apsm_mesh_area(&mesh[0]), JB);
    const apsm_cohort_input in = { I, names, mesh, M, 0 };
    assert_int_equal(
        apsm_cohort_build(ctx, &in, 0.125 * h, 1.1 * o.rbf.band * o.rbf.dipole * h, &c), APSM_OK);
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
    return c;
}

static const size_t in_order[I] = { 0, 1, 2, 3, 4 }, turned[I] = { 0, 4, 3, 2, 1 };

static apsm_cohort bumps(apsm_context *ctx)
{
    return part_of_kind(ctx, SYNTHETIC_BUMP, 1, in_order);
}

static apsm_cohort joined(apsm_context *ctx, apsm_cohort a, apsm_cohort b, size_t jb)
{
    apsm_cohort parts[2] = { a, b }, c;
    const size_t own[2] = { JA, jb };
    assert_int_equal(apsm_cohort_join(ctx, 2, parts, own, &c), APSM_OK);
    return c;
}

static apsm_optimize_options options(bool over_parts)
{
    apsm_optimize_options o = apsm_optimize_defaults();
    o.schedule.stage1_epochs = 4;
    o.schedule.stage2_epochs = 4;
    o.fidelity.fidelity_rounds = 4;
    if (over_parts) o.schedule.beta = 0.3;
    return o;
}

typedef struct watch {
    double eigenshape; /* of the first epoch that has one */
    double beta, h;    /* then */
    double *before;    /* particles that it began with, I x J x 3 */
    long stop_after;   /* epochs; 0: none */
} watch;

static apsm_status on_epoch(void *user, const apsm_optimizer_state *s, const apsm_epoch_record *r)
{
    watch *w = user;
    if (isnan(w->eigenshape)) {
        w->eigenshape = r->loss[APSM_TERM_EIGENSHAPE];
        w->beta = r->beta;
        w->h = s->h;
        if (isnan(w->eigenshape)) memcpy(w->before, s->P, s->I * s->J * 3 * sizeof *s->P);
    }
    return w->stop_after > 0 && s->epochs_run == w->stop_after ? APSM_ERR_INTERRUPTED : APSM_OK;
}

/* P (I x n x 3, out); stopped: as often, and taken up again. */
static void optimise(apsm_context *ctx, const apsm_cohort *c, const apsm_optimize_options *o,
                     size_t n, long every, watch *w, double *P)
{
    apsm_optimizer_state s;
    apsm_status status = APSM_ERR_INTERRUPTED;
    assert_int_equal(apsm_optimizer_state_alloc(I, n, &s), APSM_OK);
    assert_int_equal(apsm_first_particles(ctx, c, o, n, s.P), APSM_OK);
    while (status == APSM_ERR_INTERRUPTED) {
        w->stop_after += every;
        status = apsm_optimize(ctx, c, o, &s, on_epoch, w);
    }
    assert_int_equal(status, APSM_OK);
    memcpy(P, s.P, I * n * 3 * sizeof *P);
    apsm_optimizer_state_free(&s);
}

static void one_of_two_is_as_alone(void **state)
{
    (void)state;
    static double P[I * JA * 3], Q[I * 2 * JA * 3], part[I * JA * 3], before[I * 2 * JA * 3];
    apsm_context *ctx = apsm_context_new();
    const apsm_optimize_options o = options(false);
    apsm_cohort alone = bumps(ctx), both = joined(ctx, bumps(ctx), bumps(ctx), JA);
    optimise(ctx, &alone, &o, JA, 0, &(watch){ .eigenshape = NAN, .before = before }, P);
    optimise(ctx, &both, &o, 2 * JA, 0, &(watch){ .eigenshape = NAN, .before = before }, Q);
    cohort_take_part(&both, 0, 2 * JA, Q, part);
    assert_memory_equal(part, P, sizeof P);
    cohort_take_part(&both, 1, 2 * JA, Q, part); /* other near-surface points, nothing else */
    double far = 0;
    for (size_t x = 0; x < I * JA * 3; x++) far = fmax(far, fabs(part[x] - P[x]));
    assert_true(far > 0 && far < apsm_expected_spacing(apsm_mesh_area(&alone.shape[0].mesh), JA));
    apsm_cohort_free(&alone);
    apsm_cohort_free(&both);
    apsm_context_free(ctx);
}

/* Part A next to B, whose subjects are in this order; part (I x JA x 3, out) is A's. */
static double beside(const apsm_optimize_options *o, const size_t order[I], int threads, long every,
                     double *part)
{
    static double P[I * J * 3], before[I * J * 3];
    watch w = { .eigenshape = NAN, .before = before };
    apsm_context *ctx = apsm_context_new();
    apsm_context_set_threads(ctx, threads);
    apsm_cohort c = joined(ctx, bumps(ctx), part_of_kind(ctx, SYNTHETIC_ELLIPSOID, 0.4, order), JB);
    optimise(ctx, &c, o, J, every, &w, P);
    cohort_take_part(&c, 0, J, P, part);
    for (size_t d = 0; d < 2; d++) /* every particle is on its own part's surface */
        for (size_t i = 0; i < I; i++)
            for (size_t j = c.first[d]; j < c.first[d + 1]; j++) {
                apsm_closest at;
                apsm_bvh_closest(c.part[d].shape[i].bvh, P + (i * J + j) * 3, INFINITY, &at);
                assert_true(at.distance2 < 1e-12);
            }
    apsm_cohort_free(&c);
    apsm_context_free(ctx);
    return w.eigenshape;
}

/* Without a term over both, a part does not ask which subject the other's shapes belong to. */
static void eigenshape_is_over_both(void **state)
{
    (void)state;
    static double P[I * JA * 3], Q[I * JA * 3];
    const apsm_optimize_options apart = options(false), over = options(true);
    beside(&apart, in_order, 1, 0, P);
    beside(&apart, turned, 1, 0, Q);
    assert_memory_equal(P, Q, sizeof P);
    beside(&over, in_order, 1, 0, P);
    beside(&over, turned, 1, 0, Q);
    assert_memory_not_equal(P, Q, sizeof P);
}

/* The column of history is (9) of whole rows. */
static void figure_is_of_whole_rows(void **state)
{
    (void)state;
    static double P[I * J * 3], before[I * J * 3], Y[I * J * 3], mean[J * 3], L[I * I];
    watch w = { .eigenshape = NAN, .before = before };
    double loss;
    apsm_context *ctx = apsm_context_new();
    const apsm_optimize_options o = options(true);
    apsm_cohort c =
        joined(ctx, bumps(ctx), part_of_kind(ctx, SYNTHETIC_ELLIPSOID, 0.4, in_order), JB);
    optimise(ctx, &c, &o, J, 0, &w, P);
    apsm_eigenshape_options e = o.eigenshape;
    e.least = w.beta * w.h * w.h / 64 / e.eigen_share; /* as the term bounds it, by the h of all */
    apsm_cohort_mean(I, J, before, mean);
    apsm_cohort_centre(I, J, before, mean, Y);
    assert_int_equal(apsm_eigenshape_loss(I, J, Y, &e, &loss, L, NULL), APSM_OK);
    assert_true(fabs(w.eigenshape - loss / (3.0 * J * I)) < 1e-12);
    apsm_cohort_free(&c);
    apsm_context_free(ctx);
}

static void threads_and_stops_change_nothing(void **state)
{
    (void)state;
    static double P[I * JA * 3], Q[I * JA * 3];
    const apsm_optimize_options over = options(true);
    beside(&over, in_order, 1, 0, P);
    beside(&over, in_order, 2, 3, Q);
    assert_memory_equal(P, Q, sizeof P);
}

static void fixed_subjects_stay(void **state)
{
    (void)state;
    static double P[I * J * 3];
    apsm_context *ctx = apsm_context_new();
    const apsm_optimize_options o = options(true);
    apsm_cohort parts[2] = { bumps(ctx), part_of_kind(ctx, SYNTHETIC_ELLIPSOID, 0.4, in_order) }, c;
    const size_t own[2] = { JA, JB };
    for (size_t d = 0; d < 2; d++) {
        parts[d].fixed = calloc(I, sizeof *parts[d].fixed);
        parts[d].fixed[2] = true;
    }
    assert_int_equal(apsm_cohort_join(ctx, 2, parts, own, &c), APSM_OK);
    apsm_optimizer_state s;
    assert_int_equal(apsm_optimizer_state_alloc(I, J, &s), APSM_OK);
    assert_int_equal(apsm_first_particles(ctx, &c, &o, J, s.P), APSM_OK);
    for (size_t j = 0; j < J; j++) /* those of the template, carried to nothing */
        memcpy(s.P + (2 * J + j) * 3, s.P + j * 3, 3 * sizeof *s.P);
    memcpy(P, s.P, sizeof P);
    assert_int_equal(apsm_optimize(ctx, &c, &o, &s, NULL, NULL), APSM_OK);
    for (size_t i = 0; i < I; i++)
        for (size_t d = 0; d < 2; d++) {
            const size_t from = (i * J + c.first[d]) * 3;
            const bool same = !memcmp(P + from, s.P + from, own[d] * 3 * sizeof *P);
            assert_true(same == (i == 2));
        }
    apsm_optimizer_state_free(&s);
    apsm_cohort_free(&c);
    apsm_context_free(ctx);
}

static void parts_that_do_not_fit_are_refused(void **state)
{
    (void)state;
    apsm_context *ctx = apsm_context_new();
    const size_t own[2] = { JA, JB };
    for (int k = 0; k < 4; k++) {
        apsm_cohort parts[2] = { bumps(ctx), bumps(ctx) }, c;
        size_t J2[2] = { own[0], own[1] };
        if (k == 0) parts[1].template_index = 1;
        if (k == 1) parts[1].fixed = calloc(I, sizeof(bool)), parts[1].fixed[4] = true;
        if (k == 2) J2[1] = 0;
        if (k == 3) {
            apsm_cohort_free(&parts[1]);
            parts[1] = (apsm_cohort){ .I = I - 1 };
        }
        assert_int_equal(apsm_cohort_join(ctx, 2, parts, J2, &c), APSM_ERR_ARG);
        assert_null(c.part);
        assert_null(parts[0].shape);
    }
    apsm_cohort parts[2] = { bumps(ctx), bumps(ctx) }, c;
    apsm_optimizer_state s;
    const apsm_optimize_options o = options(false);
    assert_int_equal(apsm_cohort_join(ctx, 2, parts, own, &c), APSM_OK);
    assert_int_equal(apsm_optimizer_state_alloc(I, J + 1, &s), APSM_OK);
    assert_int_equal(apsm_optimize(ctx, &c, &o, &s, NULL, NULL), APSM_ERR_ARG);
    apsm_optimizer_state_free(&s);
    apsm_cohort_free(&c);
    apsm_context_free(ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_of_two_is_as_alone),
        cmocka_unit_test(eigenshape_is_over_both),
        cmocka_unit_test(figure_is_of_whole_rows),
        cmocka_unit_test(threads_and_stops_change_nothing),
        cmocka_unit_test(fixed_subjects_stay),
        cmocka_unit_test(parts_that_do_not_fit_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
