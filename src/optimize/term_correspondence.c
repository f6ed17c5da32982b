/* The correspondence term: neighbourhoods as the template's (8), or the distance to the mean. */
#include <math.h>
#include <string.h>

#include "optimize/correspondence_loss.h"
#include "optimize/epoch.h"
#include "optimize/frobenius_loss.h"
#include "optimize/terms.h"

static bool is_on(const optimizer *op)
{
    return op->w.gamma > 0;
}

/* The squared Frobenius norm's gradient is a length already. */
static double weight(const optimizer *op)
{
    const bool is_length = op->o->correspondence.correspondence == APSM_CORRES_FROBENIUS_SQUARED;
    if (op->o->step.step != APSM_STEP_SCALED) return op->o->step.learning_rate * op->w.gamma;
    return is_length ? op->w.gamma : op->w.gamma * op->state->h / 8;
}

static apsm_status prepare(optimizer *op)
{
    if (op->w.gamma > 0 && op->o->correspondence.correspondence != APSM_CORRES_NEIGHBOURHOOD)
        gather_batch(op);
    return APSM_OK;
}

static apsm_status gradient(const optimizer *op, size_t k, worker *w, double *loss, double *g)
{
    const size_t i = op->batch[k];
    const double *P = particles(op, i), *N = optimizer_normals(op, i);
    (void)w;
    if (op->o->correspondence.correspondence != APSM_CORRES_NEIGHBOURHOOD) {
        *loss = apsm_frobenius_loss(
            op->J, P, op->mean,
            op->o->correspondence.correspondence == APSM_CORRES_FROBENIUS_SQUARED, g);
        return APSM_OK;
    }
    const apsm_correspondence_target target = { op->J, op->tP, op->tN, op->N6, op->h_j };
    double *pull = op->template_pull ? row_of(op, op->template_pull, k) : NULL;
    if (i == op->cohort->template_index) {
        *loss = 0;
        memset(g, 0, op->J * 3 * sizeof *g);
        if (pull) memset(pull, 0, op->J * 3 * sizeof *pull);
        return APSM_OK;
    }
    return apsm_correspondence_loss(&target, P, N, &op->o->correspondence, loss, g, pull);
}

/* With template_gradient the template also feels what the others' terms ask of it. */
static void pull_template(optimizer *op)
{
    if (!op->template_pull || !(op->w.gamma > 0)) return;
    const double factor = weight(op);
    for (size_t k = 0; k < op->batch_size; k++) {
        if (op->batch[k] != op->cohort->template_index) continue;
        if (!cohort_moves(op->cohort, op->batch[k])) continue;
        double *step = row_of(op, op->step, k);
        for (size_t l = 0; l < op->batch_size; l++)
            for (size_t x = 0; x < op->J * 3; x++)
                step[x] -= factor * row_of(op, op->template_pull, l)[x];
    }
}

const term term_correspondence = { .name = "correspondence",
                                   .is_on = is_on,
                                   .weight = weight,
                                   .prepare = prepare,
                                   .gradient = gradient,
                                   .finish = pull_template };
