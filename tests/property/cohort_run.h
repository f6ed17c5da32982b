/* cohort_run.h -- a synthetic cohort through first particles and optimisation, in memory. */
#ifndef APSM_TEST_COHORT_RUN_H
#define APSM_TEST_COHORT_RUN_H

#include "cmocka_all.h"
#include "geometry/affine.h"
#include "optimize/optimizer.h"
#include "synthetic.h"

typedef struct cohort_run {
    size_t I, J;
    apsm_mesh *mesh;
    apsm_cohort cohort;
    apsm_optimizer_state state;
    apsm_context *ctx;
} cohort_run;

static inline void ok(const cohort_run *r, apsm_status status)
{
    if (status != APSM_OK) fail_msg("%s: %s", apsm_status_text(status), apsm_error_text(r->ctx));
}

/* Shapes i = order[k] (NULL: k) of a cohort of I, scaled and moved by M (NULL: not), without
 * alignment: the synthetic shapes share a frame.  Template: the middle one. */
static inline cohort_run cohort_begin(synthetic_kind kind, size_t I, int level, size_t J,
                                      const double *M, int threads)
{
    static const char *const names[] = { "a", "b", "c", "d", "e", "f", "g", "h" };
    cohort_run r = { .I = I, .J = J, .mesh = calloc(I, sizeof *r.mesh), .ctx = apsm_context_new() };
    double *transforms = calloc(I * 16, sizeof *transforms);
    assert_true(r.mesh && r.ctx && transforms && I <= sizeof names / sizeof names[0]);
    apsm_context_set_threads(r.ctx, threads);
    for (size_t i = 0; i < I; i++) {
        r.mesh[i] = synthetic_shape(kind, i, I, level);
        if (M) apsm_mesh_transform(&r.mesh[i], M);
        apsm_affine_identity(transforms + 16 * i);
    }
    const double h = apsm_expected_spacing(apsm_mesh_area(&r.mesh[I / 2]), J);
    const apsm_cohort_input in = { I, names, r.mesh, transforms, I / 2 };
    ok(&r, apsm_cohort_build(r.ctx, &in, h / 8, h, &r.cohort));
    ok(&r, apsm_optimizer_state_alloc(I, J, &r.state));
    free(transforms);
    return r;
}

static inline void cohort_optimize(cohort_run *r, const apsm_optimize_options *options)
{
    ok(r, apsm_first_particles(r->ctx, &r->cohort, options, r->J, r->state.P));
    ok(r, apsm_first_pass(r->ctx, &r->cohort, options, &r->state));
    ok(r, apsm_optimize(r->ctx, &r->cohort, options, &r->state, NULL, NULL));
}

static inline void cohort_end(cohort_run *r)
{
    apsm_optimizer_state_free(&r->state);
    apsm_cohort_free(&r->cohort);
    for (size_t i = 0; i < r->I; i++) apsm_mesh_free(&r->mesh[i]);
    free(r->mesh);
    apsm_context_free(r->ctx);
}

/* Mean truth error over the shapes but the template, in h. */
static inline double cohort_truth_error(const cohort_run *r, double h)
{
    const size_t t = r->cohort.template_index;
    double sum = 0;
    for (size_t i = 0; i < r->I; i++) {
        if (i == t) continue;
        sum += synthetic_truth_error(r->cohort.shape[i].bvh, &r->cohort.shape[t].mesh, r->J,
                                     r->state.P + i * r->J * 3, r->state.P + t * r->J * 3);
    }
    return sum / (double)(r->I - 1) / h;
}

#endif
