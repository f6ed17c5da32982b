/* The eigenshape term (9), (10): one matrix a batch, a row of it a shape. */
#include <math.h>
#include <string.h>

#include "optimize/eigenshape_loss.h"
#include "optimize/terms.h"

/* The step of (11) is beta (h/8)^2 (G + reg I)^-1 Y: reg keeps it below a share of Y. */
static apsm_eigenshape_options options_of(const optimizer *op)
{
    const apsm_optimize_options *o = op->o;
    const double h8 = op->state->h / 8;
    apsm_eigenshape_options e = o->eigenshape;
    if (e.eigen_share > 0 && o->step.step == APSM_STEP_SCALED)
        e.least = op->w.beta * h8 * h8 / e.eigen_share;
    return e;
}

static bool is_on(const optimizer *op)
{
    return op->w.beta > 0;
}

static double weight(const optimizer *op)
{
    const double h8 = op->state->h / 8;
    return op->o->step.step == APSM_STEP_SCALED ? op->w.beta * h8 * h8
                                                : op->o->step.learning_rate * op->w.beta;
}

/* Y, its factor and the loss (9). */
static apsm_status prepare(optimizer *op)
{
    op->eigenshape = NAN;
    if (!(op->w.beta > 0)) return APSM_OK;
    gather_batch(op);
    apsm_cohort_centre(op->batch_size, op->J, op->Y, op->mean, op->Y);
    const apsm_eigenshape_options eo = options_of(op);
    const apsm_status status =
        apsm_eigenshape_loss(op->batch_size, op->J, op->Y, &eo, &op->eigenshape, op->L, NULL);
    if (status != APSM_ERR_SINGULAR) return status;
    op->w.beta = 0; /* all shapes of the batch are equal: no variation to compress */
    op->eigenshape = NAN;
    return APSM_OK;
}

static apsm_status gradient(const optimizer *op, size_t k, worker *w, double *loss, double *g)
{
    const apsm_eigenshape_options eo = options_of(op);
    *loss = NAN; /* a batch has one, its shapes have none */
    apsm_eigenshape_gradient(op->batch_size, op->J, op->Y, op->L, &eo, k, g, w->eigen_work);
    return APSM_OK;
}

/* Of (9) itself, whatever its factor: a cohort's size does not change the figure. */
static double figure(const optimizer *op)
{
    const double size =
        op->o->eigenshape.eigen_scale == 0 ? 3.0 * (double)(op->J * op->batch_size) : 1.0;
    return op->eigenshape / size * ((double)op->batch_size / (double)op->I);
}

const term term_eigenshape = { .name = "eigenshape",
                               .over_parts = true,
                               .is_on = is_on,
                               .weight = weight,
                               .prepare = prepare,
                               .gradient = gradient,
                               .figure = figure };
