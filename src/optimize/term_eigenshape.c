/* The eigenshape term (9), (10): one matrix a batch, a row of it a shape.  With features a row has
 * them, too: (p_1 ... p_J, h f_1 ... h f_J), f the weighted features at the particles, so that a
 * deviation of one is as much as a spacing; their part of the gradient goes to the particles by
 * the features' slopes. */
#include <math.h>
#include <string.h>

#include "geometry/vec3.h"
#include "initialize/features.h"
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

/* ---- features ---- */

/* f and slopes (3 F) of shape i at x. */
static void look_up(const optimizer *op, size_t i, const double *x, double *f, double *slope)
{
    apsm_surface_point on;
    apsm_shape_look_up(&op->cohort->shape[i], 1, x, &on, NULL, NULL);
    apsm_features_at(op->cohort, i, &on, f, slope);
}

/* Rows from Y and the features; columns that no feature fills are 0. */
static void make_rows(optimizer *op)
{
    const size_t K = op->batch_size, J = op->J, F = op->cohort->features.F;
    const size_t width = 3 * op->row_particles;
    memset(op->rows, 0, K * width * sizeof *op->rows);
    for (size_t k = 0; k < K; k++) {
        double *row = op->rows + k * width, *f = row + 3 * J;
        memcpy(row, op->Y + 3 * k * J, 3 * J * sizeof *row);
        for (size_t j = 0; j < J; j++)
            look_up(op, op->batch[k], particles(op, op->batch[k]) + 3 * j, f + j * F, NULL);
    }
    for (size_t c = 3 * J; c < 3 * J + F * J; c++) {
        double mean = 0;
        for (size_t k = 0; k < K; k++) mean += op->rows[k * width + c] / (double)K;
        for (size_t k = 0; k < K; k++)
            op->rows[k * width + c] = op->state->h * (op->rows[k * width + c] - mean);
    }
}

/* g (J x 3) <- gradient of the row (row_particles x 3) by the particles. */
static void to_particles(const optimizer *op, size_t k, const double *row, double *work, double *g)
{
    const size_t J = op->J, F = op->cohort->features.F, i = op->batch[k];
    double *f = work, *slope = work + F;
    memcpy(g, row, 3 * J * sizeof *g);
    for (size_t j = 0; j < J; j++) {
        look_up(op, i, particles(op, i) + 3 * j, f, slope);
        for (size_t s = 0; s < F; s++)
            vec3_add_scaled(g + 3 * j, op->state->h * row[3 * J + j * F + s], slope + 3 * s);
    }
}

/* ---- the term ---- */

static const double *rows_of(const optimizer *op)
{
    return op->rows ? op->rows : op->Y;
}

/* Y, its factor and the loss (9). */
static apsm_status prepare(optimizer *op)
{
    op->eigenshape = NAN;
    if (!(op->w.beta > 0)) return APSM_OK;
    gather_batch(op);
    apsm_cohort_centre(op->batch_size, op->J, op->Y, op->mean, op->Y);
    const apsm_eigenshape_options eo = options_of(op);
    if (op->rows) make_rows(op);
    const apsm_status status = apsm_eigenshape_loss(op->batch_size, op->row_particles, rows_of(op),
                                                    &eo, &op->eigenshape, op->L, NULL);
    if (status != APSM_ERR_SINGULAR) return status;
    op->w.beta = 0; /* all shapes of the batch are equal: no variation to compress */
    op->eigenshape = NAN;
    return APSM_OK;
}

static apsm_status gradient(const optimizer *op, size_t k, worker *w, double *loss, double *g)
{
    const apsm_eigenshape_options eo = options_of(op);
    *loss = NAN; /* a batch has one, its shapes have none */
    double *row = op->rows ? w->eigen_work + op->K : g;
    apsm_eigenshape_gradient(op->batch_size, op->row_particles, rows_of(op), op->L, &eo, k, row,
                             w->eigen_work);
    if (op->rows) to_particles(op, k, row, row + 3 * op->row_particles, g);
    return APSM_OK;
}

/* Of (9) itself, whatever its factor: a cohort's size does not change the figure. */
static double figure(const optimizer *op)
{
    const double size = op->o->eigenshape.eigen_scale == 0
                            ? 3.0 * (double)(op->row_particles * op->batch_size)
                            : 1.0;
    return op->eigenshape / size * ((double)op->batch_size / (double)op->I);
}

const term term_eigenshape = { .name = "eigenshape",
                               .over_parts = true,
                               .is_on = is_on,
                               .weight = weight,
                               .prepare = prepare,
                               .gradient = gradient,
                               .figure = figure };
