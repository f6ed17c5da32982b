#include "optimize/epoch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/bvh_guess.h"
#include "optimize/correspondence_loss.h"
#include "optimize/frobenius_loss.h"
#include "optimize/rbf_shape.h"
#include "optimize/sampling_loss.h"
#include "optimize/snap.h"

/* ---- options in the kernels' own words ---- */

static apsm_sampling_options sampling_options(const optimizer *op)
{
    static const apsm_sampling_norm norm[] = { APSM_SAMPLING_VORONOI, APSM_SAMPLING_MEAN,
                                               APSM_SAMPLING_SUM };
    apsm_sampling_options s = apsm_sampling_defaults();
    s.norm = norm[op->o->sampling_scale];
    s.single = op->o->precision == 0;
    if (s.single) s.cut = 15;
    s.tau = op->o->tau_absolute > 0 ? op->o->tau_absolute : op->o->tau * op->state->h;
    return s;
}

static apsm_correspondence_options correspondence_options(const apsm_options *o)
{
    static const apsm_rotation rotation[] = { APSM_ROTATION_TRANSPORT, APSM_ROTATION_AXIS,
                                              APSM_ROTATION_NONE, APSM_ROTATION_PROCRUSTES };
    static const apsm_distance distance[] = { APSM_DISTANCE_NORM, APSM_DISTANCE_PSEUDO_HUBER,
                                              APSM_DISTANCE_SQUARED };
    apsm_correspondence_options c = apsm_correspondence_defaults();
    c.rotation = rotation[o->rotation];
    c.distance = distance[o->neighbour_norm];
    c.times_spacing = c.mean_of_six = o->neighbour_scale == 0;
    return c;
}

/* The step of (11) is beta (h/8)^2 (G + reg I)^-1 Y: reg keeps it below a share of Y. */
apsm_eigenshape_options eigenshape_options(const optimizer *op)
{
    const apsm_options *o = op->o;
    const double h8 = op->state->h / 8;
    apsm_eigenshape_options e = apsm_eigenshape_defaults();
    if (o->eigen_share > 0 && o->step == APSM_STEP_SCALED)
        e.least = op->w.beta * h8 * h8 / o->eigen_share;
    e.relative = o->eigen_reg_absolute == 0;
    e.reg = e.relative ? o->eigen_reg : o->eigen_reg_absolute;
    e.times_size = o->eigen_scale == 0;
    return e;
}

static apsm_phi kernel_of(const apsm_options *o)
{
    return o->kernel == 0 ? APSM_PHI_R : APSM_PHI_R3;
}

/* E is a weight: an error of f of 1e-2 s does not show in it.  Its gradient needs more. */
static bool is_single(const apsm_options *o)
{
    return o->precision == 0 && o->kernel == 0 && o->error_gradient == APSM_ERROR_CONSTANT;
}

double apsm_kept_factor_bytes(const apsm_options *options, size_t I, size_t J)
{
    const double most = 0x1p30, each = 8.0 * (double)apsm_polyharmonic_store_size(3 * J, true);
    return is_single(options) && (double)I * each <= most ? each : 0;
}

bool keeps_factors(const optimizer *op)
{
    return op->w.c > 0 && apsm_kept_factor_bytes(op->o, op->I, op->J) > 0;
}

/* s: a share of h, but at most half the half-thickness of the shape where it is thin. */
static double dipole_length(const optimizer *op, const apsm_shape *shape)
{
    return apsm_dipole_length(shape, op->o->dipole * op->state->h);
}

/* ---- gradients ---- */

/* Unit normals N at P; guess as in apsm_snap_closest. */
static void look_up_normals(const optimizer *op, size_t i, const double *P, uint32_t *guess,
                            double *N)
{
    const apsm_shape *shape = &op->cohort->shape[i];
    if (op->o->snap == APSM_SNAP_FIELD) {
        apsm_field_sample(shape->field, op->J, P, NULL, N);
        return;
    }
    for (size_t j = 0; j < op->J; j++) {
        apsm_closest c;
        bvh_closest_guess(shape->bvh, P + 3 * j, INFINITY, guess + j, &c);
        apsm_surface_normal(&shape->mesh, shape->VN, &c.on, N + 3 * j);
    }
}

const double *optimizer_normals(const optimizer *op, size_t i)
{
    double *N = op->N + i * op->J * 3;
    if (!op->fresh[i]) look_up_normals(op, i, particles(op, i), op->guess + i * op->J, N);
    op->fresh[i] = true;
    return N;
}

static void draw_points(const optimizer *op, size_t i, worker *w)
{
    const apsm_shape *shape = &op->cohort->shape[i];
    const uint64_t epoch = op->o->resample ? (uint64_t)op->epoch_seed : 0;
    apsm_random rng = apsm_random_stream(apsm_context_seed(op->ctx), APSM_STREAM_BAND, i, epoch);
    apsm_field_draw(shape->field, &rng, op->o->band * dipole_length(op, shape), op->R, w->B, w->D);
}

/* The fit (2) by a factor of its own. */
static apsm_status fit_anew(const optimizer *op, size_t i, const double *P, const double *N,
                            worker *w, double *store, apsm_rbf_shape *rbf,
                            apsm_polyharmonic *factor)
{
    const double s = dipole_length(op, &op->cohort->shape[i]);
    const apsm_status status =
        apsm_rbf_fit(kernel_of(op->o), P, N, s, is_single(op->o), store, factor, rbf, w->rbf_work);
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
    const double *P = op->state->own + i * op->J * 3;
    const bool keep = !op->cohort->shape[i].stored;
    *factor = keep ? &k->f : spare;
    if (k->ready) return APSM_OK;
    if (keep && !k->store)
        k->store = optimizer_doubles(apsm_polyharmonic_store_size(3 * op->J, true));
    double *store = keep ? k->store : w->factor_store;
    if (!store) return APSM_ERR_MEMORY;
    look_up_normals(op, i, P, op->guess + i * op->J, w->gs);
    APSM_TRY(fit_anew(op, i, P, w->gs, w, store, rbf, keep ? &k->f : spare));
    k->ready = keep;
    return APSM_OK;
}

/* The fit (2) with the factor of an earlier epoch; by its own where that does not do. */
static apsm_status fit_again(const optimizer *op, size_t i, const double *P, const double *N,
                             worker *w, apsm_rbf_shape *rbf, apsm_polyharmonic *spare)
{
    enum { MOST_ITERATIONS = 24 };
    const double s = dipole_length(op, &op->cohort->shape[i]);
    const apsm_polyharmonic *factor;
    size_t iterations;
    APSM_TRY(factor_at_own(op, i, w, rbf, spare, &factor));
    const apsm_status status = apsm_rbf_refit(factor, P, N, s, true, APSM_RBF_TOLERANCE,
                                              MOST_ITERATIONS, rbf, &iterations, w->rbf_work);
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
    *e_factor = apsm_sampling_weights(op->R, w->f, w->D, op->w.c,
                                      op->o->error_scale == APSM_ERROR_RELATIVE, w->E, w->g);
    double sum = 0;
    for (size_t r = 0; r < op->R; r++) sum += w->E[r];
    op->record[i].error2 = sum / (double)op->R;
    return APSM_OK;
}

static apsm_status sampling_gradient(const optimizer *op, size_t i, const double *P,
                                     const double *N, worker *w)
{
    apsm_rbf_shape rbf;
    apsm_polyharmonic factor;
    double e_factor = 0;
    const bool adaptive = op->w.c > 0;
    const apsm_sampling_options so = sampling_options(op);
    draw_points(op, i, w);
    if (adaptive) APSM_TRY(surface_error(op, i, P, N, w, &rbf, &factor, &e_factor));
    APSM_TRY(apsm_sampling_loss(op->J, P, op->R, w->B, adaptive ? w->g : NULL, &so,
                                &op->record[i].sampling, w->gs, w->kbar, NULL, w->sampling_work));
    if (adaptive && op->o->error_gradient == APSM_ERROR_THROUGH_W) {
        apsm_sampling_dL_df(op->J, op->R, w->f, w->D, w->kbar, e_factor, so.norm, w->dL_df);
        apsm_rbf_adjoint(&rbf, &factor, op->R, w->B, w->dL_df, w->gs, w->rbf_work);
    }
    return APSM_OK;
}

/* The squared Frobenius norm's gradient is a length already. */
double correspondence_weight(const optimizer *op)
{
    const bool is_length = op->o->correspondence == APSM_CORRES_FROBENIUS_SQUARED;
    return is_length ? op->w.gamma : op->w.gamma * op->state->h / 8;
}

static apsm_status correspondence_gradient(const optimizer *op, size_t i, size_t k, const double *P,
                                           const double *N, worker *w)
{
    double *loss = &op->record[i].correspondence;
    if (op->o->correspondence != APSM_CORRES_NEIGHBOURHOOD) {
        *loss = apsm_frobenius_loss(op->J, P, op->mean,
                                    op->o->correspondence == APSM_CORRES_FROBENIUS_SQUARED, w->gc);
        return APSM_OK;
    }
    const apsm_correspondence_options co = correspondence_options(op->o);
    const apsm_correspondence_target target = { op->J, op->tP, op->tN, op->N6, op->h_j };
    double *pull = op->template_pull ? op->template_pull + k * op->J * 3 : NULL;
    if (i == op->cohort->template_index) {
        *loss = 0;
        memset(w->gc, 0, op->J * 3 * sizeof *w->gc);
        if (pull) memset(pull, 0, op->J * 3 * sizeof *pull);
        return APSM_OK;
    }
    return apsm_correspondence_loss(&target, P, N, &co, loss, w->gc, pull);
}

/* The unclipped step (11) of shape i = batch[k]. */
static void add_up(const optimizer *op, size_t k, worker *w)
{
    const bool scaled = op->o->step == APSM_STEP_SCALED;
    const double h = op->state->h, lr = op->o->learning_rate;
    const double weight[] = { scaled ? op->w.alpha * h / 40 : lr * op->w.alpha,
                              scaled ? correspondence_weight(op) : lr * op->w.gamma,
                              scaled ? op->w.beta * (h / 8) * (h / 8) : lr * op->w.beta };
    const double *const grad[] = { w->gs, op->w.gamma > 0 ? w->gc : NULL,
                                   op->w.beta > 0 ? w->ge : NULL };
    apsm_step(op->J, 3, weight, grad, INFINITY, op->step + k * op->J * 3);
}

apsm_status gradients_of_shape(apsm_context *ctx, size_t k, int worker_index, void *user)
{
    optimizer op = *(optimizer *)user; /* a copy with the task's own error line */
    op.ctx = ctx;
    const size_t i = op.batch[k];
    worker *w = &op.worker[worker_index];
    const double *P = particles(&op, i);
    const double *N = optimizer_normals(&op, i);
    op.record[i] = (shape_record){ .correspondence = NAN, .error2 = NAN };
    APSM_TRY(sampling_gradient(&op, i, P, N, w));
    if (op.w.gamma > 0) APSM_TRY(correspondence_gradient(&op, i, k, P, N, w));
    if (op.w.beta > 0) {
        const apsm_eigenshape_options eo = eigenshape_options(&op);
        apsm_eigenshape_gradient(op.batch_size, op.J, op.Y, op.L, &eo, k, w->ge, w->eigen_work);
    }
    add_up(&op, k, w);
    return APSM_OK;
}

static void snap_to_surface(const optimizer *op, size_t i, double *P, worker *w)
{
    const apsm_shape *shape = &op->cohort->shape[i];
    if (op->o->snap == APSM_SNAP_CLOSEST)
        apsm_snap_closest(shape->bvh, op->J, P, NULL, op->guess + i * op->J);
    if (op->o->snap != APSM_SNAP_FIELD) return;
    for (long n = 0; n < op->o->snaps; n++) { /* ge holds D, gc the normals */
        apsm_field_sample(shape->field, op->J, P, w->ge, w->gc);
        apsm_snap(op->J, w->ge, w->gc, P);
    }
}

/* A step of h/4 may reach through a thin shape: particles return to the side that they left (N:
 * their normals there), unless the way is longer by `detour`. */
static void snap_to_side(const apsm_shape *shape, size_t J, const double *N, double detour,
                         double *P)
{
    for (size_t j = 0; j < J; j++) {
        apsm_closest any, side;
        apsm_bvh_closest(shape->bvh, P + 3 * j, INFINITY, &any);
        const double reach = sqrt(any.distance2) + detour;
        apsm_bvh_closest_facing(shape->bvh, P + 3 * j, N + 3 * j, 0, reach * reach, &side);
        memcpy(P + 3 * j, side.distance2 < INFINITY ? side.x : any.x, sizeof any.x);
    }
}

static bool is_thin(const optimizer *op, size_t i)
{
    const double thickness = 2 * op->cohort->shape[i].half_thickness;
    return op->o->snap == APSM_SNAP_CLOSEST && thickness < op->state->h;
}

apsm_status move_shape(apsm_context *ctx, size_t k, int worker_index, void *user)
{
    const optimizer *op = user;
    const size_t i = op->batch[k];
    double *P = particles(op, i), *step = op->step + k * op->J * 3;
    const double minus_one = -1, *const grad = step;
    const double clip = op->o->step_clip > 0 ? op->o->step_clip * op->state->h : INFINITY;
    op->record[i].step = apsm_step(op->J, 1, &minus_one, &grad, clip, step) / op->state->h;
    for (size_t x = 0; x < op->J * 3; x++) {
        P[x] += step[x];
        if (!isfinite(P[x]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE,
                             "%s: particle %zu left the finite numbers; lower alpha, beta or gamma",
                             op->cohort->shape[i].name, x / 3);
    }
    if (is_thin(op, i))
        snap_to_side(&op->cohort->shape[i], op->J, op->N + i * op->J * 3, op->state->h, P);
    else
        snap_to_surface(op, i, P, &op->worker[worker_index]);
    op->fresh[i] = false;
    optimizer_normals(op, i);
    return APSM_OK;
}
