/* The sampling term: near-surface points, the RBF-shape's error there, and the loss (3)-(7). */
#include <math.h>

#include "optimize/epoch.h"
#include "optimize/rbf_shape.h"
#include "optimize/sampling_loss.h"
#include "optimize/terms.h"

static apsm_sampling_options sampling_options(const optimizer *op)
{
    apsm_sampling_options s = op->o->sampling;
    s.h = op->state->h;
    return s;
}

static apsm_phi kernel_of(const apsm_optimize_options *o)
{
    return o->rbf.kernel == 0 ? APSM_PHI_R : APSM_PHI_R3;
}

/* E is a weight: an error of f of 1e-2 s does not show in it.  Its gradient needs more. */
static bool is_single(const apsm_optimize_options *o)
{
    return o->sampling.precision == 0 && o->rbf.kernel == 0 &&
           o->sampling.error_gradient == APSM_ERROR_CONSTANT;
}

double apsm_kept_factor_bytes(const apsm_optimize_options *options, size_t I, size_t J)
{
    const double most = 0x1p30, each = 8.0 * (double)apsm_polyharmonic_store_size(3 * J, true);
    return is_single(options) && (double)I * each <= most ? each : 0;
}

bool keeps_factors(const optimizer *op)
{
    return op->w.c > 0 && apsm_kept_factor_bytes(op->o, op->I, op->all) > 0;
}

/* s: a share of h, but at most half the half-thickness of the shape where it is thin. */
static double dipole_length(const optimizer *op, const apsm_shape *shape)
{
    return apsm_dipole_length(shape, op->o->rbf.dipole * op->state->h);
}

static void draw_points(const optimizer *op, size_t i, worker *w)
{
    const apsm_shape *shape = &op->cohort->shape[i];
    const uint64_t epoch = op->o->rbf.resample ? (uint64_t)op->epoch_seed : 0;
    apsm_random rng =
        apsm_random_stream(apsm_context_seed(op->ctx), APSM_STREAM_BAND, op->d * op->I + i, epoch);
    apsm_field_draw(shape->field, &rng, op->o->rbf.band * dipole_length(op, shape), op->R, w->B,
                    w->D);
}

/* The fit (2) by a factor of its own. */
static apsm_status fit_anew(const optimizer *op, size_t i, const double *P, const double *N,
                            worker *w, double *store, apsm_rbf_shape *rbf,
                            apsm_polyharmonic *factor)
{
    const apsm_dipoles d = { P, N, dipole_length(op, &op->cohort->shape[i]) };
    const apsm_status status =
        apsm_rbf_fit(kernel_of(op->o), &d, is_single(op->o), store, factor, rbf, w->rbf_work);
    if (status == APSM_OK) return APSM_OK;
    return apsm_fail(op->ctx, status,
                     "%s: the particles do not determine a surface (coinciding, or all in a "
                     "plane); use fewer particles or check the shape",
                     op->cohort->shape[i].name);
}

/* The factor at state->own, made when it is first asked for: at once, or after a resume.  Where
 * memory is limited it is made anew each time, in w.  Overwrites w->gs and rbf. */
static apsm_status factor_at_own(const optimizer *op, size_t i, worker *w, apsm_rbf_shape *rbf,
                                 apsm_polyharmonic *spare, const apsm_polyharmonic **factor)
{
    kept_factor *k = &op->kept[i];
    const double *P = row_of(op, op->state->own, i);
    const bool keep = !op->cohort->shape[i].stored;
    *factor = keep ? &k->f : spare;
    if (k->ready) return APSM_OK;
    if (keep && !k->store)
        k->store = optimizer_doubles(apsm_polyharmonic_store_size(3 * op->J, true));
    double *store = keep ? k->store : w->factor_store;
    if (!store) return APSM_ERR_MEMORY;
    look_up_normals(op, i, P, guess_of(op, i), w->gs);
    APSM_TRY(fit_anew(op, i, P, w->gs, w, store, rbf, keep ? &k->f : spare));
    k->ready = keep;
    return APSM_OK;
}

/* The fit (2) with the factor of an earlier epoch; by its own where that does not do. */
static apsm_status fit_again(const optimizer *op, size_t i, const double *P, const double *N,
                             worker *w, apsm_rbf_shape *rbf, apsm_polyharmonic *spare)
{
    static const apsm_resolve_options o = { true, APSM_RBF_TOLERANCE, 24 };
    const apsm_dipoles d = { P, N, dipole_length(op, &op->cohort->shape[i]) };
    const apsm_polyharmonic *factor;
    size_t iterations;
    APSM_TRY(factor_at_own(op, i, w, rbf, spare, &factor));
    const apsm_status status = apsm_rbf_refit(factor, &d, &o, rbf, &iterations, w->rbf_work);
    return status == APSM_OK ? status : fit_anew(op, i, P, N, w, w->factor_store, rbf, spare);
}

/* g (5) of the points from the RBF-shape's error (4) there, and, if asked for, the share of the
 * gradient that runs through the fit. */
static apsm_status surface_error(const optimizer *op, size_t i, const double *P, const double *N,
                                 worker *w, apsm_rbf_shape *rbf, apsm_polyharmonic *factor,
                                 double *e_factor)
{
    const bool single = is_single(op->o);
    apsm_rbf_bind(rbf, op->J, w->rbf_store);
    APSM_TRY(op->kept ? fit_again(op, i, P, N, w, rbf, factor)
                      : fit_anew(op, i, P, N, w, w->factor_store, rbf, factor));
    if (single)
        apsm_rbf_eval_f32(rbf, op->R, w->B, w->f, w->rbf_work);
    else
        apsm_rbf_eval(rbf, op->R, w->B, w->f, NULL);
    *e_factor = apsm_sampling_weights(
        op->R, w->f, w->D, op->w.c, op->o->sampling.error_scale == APSM_ERROR_RELATIVE, w->E, w->g);
    double sum = 0;
    for (size_t r = 0; r < op->R; r++) sum += w->E[r];
    op->record[i].error2 = sum / (double)op->R;
    return APSM_OK;
}

static apsm_status gradient(const optimizer *op, size_t k, worker *w, double *loss, double *g)
{
    const size_t i = op->batch[k];
    const double *P = particles(op, i), *N = optimizer_normals(op, i);
    apsm_rbf_shape rbf;
    apsm_polyharmonic factor;
    double e_factor = 0;
    const bool adaptive = op->w.c > 0;
    const apsm_sampling_options so = sampling_options(op);
    draw_points(op, i, w);
    if (adaptive) APSM_TRY(surface_error(op, i, P, N, w, &rbf, &factor, &e_factor));
    const apsm_sampling_points points = { op->J, op->R, P, w->B, adaptive ? w->g : NULL };
    const apsm_sampling_result result = { .loss = loss, .grad = g, .kbar = w->kbar };
    APSM_TRY(apsm_sampling_loss(&points, &so, &result, w->sampling_work));
    if (adaptive && op->o->sampling.error_gradient == APSM_ERROR_THROUGH_W) {
        apsm_sampling_dL_df(op->J, op->R, w->f, w->D, w->kbar, e_factor, so.sampling_scale,
                            w->dL_df);
        apsm_rbf_adjoint(&rbf, &factor, op->R, w->B, w->dL_df, g, w->rbf_work);
    }
    return APSM_OK;
}

static bool is_on(const optimizer *op)
{
    (void)op; /* its loss is told even where it has no weight */
    return true;
}

static double weight(const optimizer *op)
{
    return op->o->step.step == APSM_STEP_SCALED ? op->w.alpha * op->state->h / 40
                                                : op->o->step.learning_rate * op->w.alpha;
}

const term term_sampling = {
    .name = "sampling", .is_on = is_on, .weight = weight, .gradient = gradient
};
