/* Memory of the optimisation loop, taken once for all of its epochs. */
#include "optimize/workspace.h"

#include <math.h>
#include <stdlib.h>

#include "optimize/correspondence_loss.h"
#include "optimize/rbf_shape.h"
#include "optimize/sampling_loss.h"

double *optimizer_doubles(size_t n)
{
    return malloc((n ? n : 1) * sizeof(double));
}

size_t points_of(const apsm_optimize_options *o, size_t J)
{
    return (size_t)ceil(o->rbf.points * (double)J);
}

static bool worker_alloc(worker *w, size_t J, size_t R, size_t eigen, size_t terms)
{
    const size_t point_arrays = 9;
    w->B = optimizer_doubles(point_arrays * R);
    w->D = w->B ? w->B + 3 * R : NULL;
    if (w->B) {
        w->f = w->D + R;
        w->E = w->f + R;
        w->g = w->E + R;
        w->kbar = w->g + R;
        w->dL_df = w->kbar + R;
    }
    w->gs = optimizer_doubles((3 + terms) * 3 * J);
    if (w->gs) w->gc = w->gs + 3 * J, w->ge = w->gc + 3 * J, w->grad = w->ge + 3 * J;
    w->rbf_store = optimizer_doubles(apsm_rbf_store_size(J));
    w->factor_store = optimizer_doubles(apsm_polyharmonic_store_size(3 * J, false));
    const size_t fit_work = apsm_rbf_work_size(J), eval_work = apsm_rbf_eval_f32_work_size(J);
    w->rbf_work = optimizer_doubles(fit_work > eval_work ? fit_work : eval_work);
    w->sampling_work = optimizer_doubles(apsm_sampling_work_size(J, R));
    w->eigen_work = optimizer_doubles(eigen);
    return w->B && w->gs && w->rbf_store && w->factor_store && w->rbf_work && w->sampling_work &&
           w->eigen_work;
}

static void worker_free(worker *w)
{
    free(w->B);
    free(w->gs);
    free(w->rbf_store);
    free(w->factor_store);
    free(w->rbf_work);
    free(w->sampling_work);
    free(w->eigen_work);
}

void optimizer_free_factors(optimizer *op)
{
    const size_t n = op->I * cohort_parts(op->cohort);
    for (size_t i = 0; op->kept && i < n; i++) free(op->kept[i].store);
    free(op->kept);
    op->kept = NULL;
}

void optimizer_free(optimizer *op)
{
    if (op->worker)
        for (int k = 0; k < op->workers; k++) worker_free(&op->worker[k]);
    free(op->worker);
    free(op->tP);
    free(op->N6);
    free(op->on_rim);
    free(op->order);
    free(op->mean);
    free(op->Y);
    free(op->rows);
    free(op->template_pull);
    for (size_t d = 0; d < cohort_parts(op->cohort); d++) {
        if (op->anchors) apsm_warp_free(&op->anchors[d]);
        if (op->fidelity) apsm_fidelity_free(op->fidelity[d]);
    }
    free(op->anchors);
    free(op->fidelity);
    optimizer_free_factors(op);
    free(op->record);
    free(op->guess);
    free(op->N);
    free(op->fresh);
}

static size_t batch_limit(const apsm_optimize_options *o, size_t I)
{
    enum { FULL_BATCH = 256, MINIBATCH = 64 };
    const size_t wanted = o->batch > 0 ? (size_t)o->batch : I <= FULL_BATCH ? I : MINIBATCH;
    return wanted < I ? wanted : I;
}

apsm_status optimizer_alloc(apsm_context *ctx, const apsm_cohort *cohort,
                            const apsm_optimize_options *o, size_t n_terms,
                            const term *const *terms, apsm_optimizer_state *state, optimizer *op)
{
    const size_t I = cohort->I, J = state->J, K = batch_limit(o, I), parts = cohort_parts(cohort);
    const size_t F = cohort->features.F, more = (F * J + 2) / 3;
    const size_t eigen = K + (F > 0 ? 3 * (J + more) + 4 * F : 0);
    *op = (optimizer){ .ctx = ctx,
                       .cohort = cohort,
                       .o = o,
                       .state = state,
                       .n_terms = n_terms,
                       .terms = terms,
                       .I = I,
                       .J = J,
                       .all = J,
                       .R = points_of(o, J),
                       .K = K,
                       .row_particles = J + more };
    op->workers = apsm_draws_points(o, state) ? apsm_context_threads(ctx) : 0; /* of epochs */
    op->worker = calloc((size_t)op->workers + 1, sizeof *op->worker);
    op->tP = optimizer_doubles(7 * J);
    op->N6 = malloc(J * APSM_NEIGHBOURS * sizeof *op->N6);
    op->on_rim = calloc(J, sizeof *op->on_rim);
    op->order = malloc(I * sizeof *op->order);
    op->mean = optimizer_doubles(3 * J);
    op->Y = optimizer_doubles(K * J * 6 + K * K);
    op->N = optimizer_doubles(I * J * 3);
    op->fresh = calloc(I * parts, sizeof *op->fresh);
    op->record = calloc(I * parts, sizeof *op->record);
    op->anchors = calloc(parts, sizeof *op->anchors);
    op->fidelity = calloc(parts, sizeof *op->fidelity);
    if (cohort->part && !state->part) state->part = calloc(parts, sizeof *state->part);
    op->guess = calloc(I * J, sizeof *op->guess);
    if (F > 0) op->rows = optimizer_doubles(K * (J + more) * 3);
    if (o->correspondence.template_gradient) op->template_pull = optimizer_doubles(K * J * 3);
    bool ok = op->worker && op->tP && op->N6 && op->on_rim && op->order && op->mean && op->Y &&
              op->N && op->fresh && op->record && op->guess && op->anchors && op->fidelity &&
              (!cohort->part || state->part) && (F == 0 || op->rows) &&
              (!o->correspondence.template_gradient || op->template_pull);
    if (ok) {
        op->tN = op->tP + 3 * J;
        op->h_j = op->tN + 3 * J;
        op->step = op->Y + K * J * 3;
        op->L = op->step + K * J * 3;
        for (int k = 0; ok && k < op->workers; k++)
            ok = worker_alloc(&op->worker[k], J, op->R, eigen, n_terms);
    }
    if (ok) return APSM_OK;
    optimizer_free(op);
    return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for %zu shapes of %zu particles", I, J);
}
