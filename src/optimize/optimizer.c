/* The optimisation loop.  METHOD 5; numbers in brackets are equations of docs/method.md.
 *
 *   I, J, K, R   shapes, particles, shapes in a batch, near-surface points of a shape
 *   P_i, N_i     particles and unit normals of shape i (J x 3)
 *   t            the template; its particles at the epoch's start are everybody's target
 *   h            length unit of the stage, A = alpha h / 40
 *   gs, gc, ge   gradients of the sampling (7), correspondence (8), eigenshape (10) losses
 *   step_ij = -[A gs + gamma (h/8) gc + beta (h/8)^2 ge], shortened to h/4, then back to the
 *             surface                                                                   (11)
 *
 * All gradients of a batch are taken at its entry positions.  Each shape is one task with its
 * own random stream, and sums over shapes run in the order of the shapes: neither the number of
 * threads nor an interruption changes a byte. */
#include "apsm/optimizer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/correspondence_loss.h"
#include "apsm/eigenshape_loss.h"
#include "apsm/fidelity.h"
#include "apsm/frobenius_loss.h"
#include "apsm/linalg.h"
#include "apsm/rbf_shape.h"
#include "apsm/sampling_loss.h"
#include "apsm/snap.h"
#include "geometry/bvh_guess.h"
#include "optimize/geodesic_pass.h"
#include "optimize/schedule.h"

#define TEXT(name, text) text,
const char *apsm_stop_text(apsm_stop stop)
{
    static const char *const texts[] = { APSM_STOP_LIST(TEXT) };
    return (unsigned)stop < APSM_STOP_COUNT ? texts[stop] : "unknown";
}
#undef TEXT

apsm_status apsm_optimizer_state_alloc(size_t I, size_t J, apsm_optimizer_state *state)
{
    *state = (apsm_optimizer_state){ .I = I, .J = J, .stage = APSM_STAGE_1, .best_mismatched = 2 };
    state->P = calloc(I * J * 3, sizeof *state->P);
    state->mean = calloc(J * 3, sizeof *state->mean);
    if (state->P && state->mean) return APSM_OK;
    apsm_optimizer_state_free(state);
    return APSM_ERR_MEMORY;
}

void apsm_optimizer_state_free(apsm_optimizer_state *state)
{
    free(state->P);
    free(state->mean);
    free(state->own);
    state->P = state->mean = state->own = NULL;
    state->own_size = 0;
}

/* Scratch of one thread.  Point arrays have room for R points, particle arrays for J. */
typedef struct worker {
    double *B, *D, *f, *E, *g, *kbar, *dL_df; /* R x 3, then R each */
    double *gs, *gc, *ge;                     /* J x 3 each */
    double *rbf_store, *factor_store, *rbf_work, *sampling_work;
    double *eigen_work; /* K */
} worker;

/* What the losses of one shape came to in the current epoch. */
typedef struct shape_record {
    double sampling, correspondence, error2, step;
} shape_record;

/* The factor of a shape's RBF system at state->own, for the epochs that follow. */
typedef struct kept_factor {
    apsm_polyharmonic f;
    double *store; /* its arrays; NULL until they are needed */
    bool ready;
} kept_factor;

typedef struct optimizer {
    apsm_context *ctx;
    const apsm_cohort *cohort;
    const apsm_options *o;
    apsm_optimizer_state *state;
    size_t I, J, R, K; /* K: most shapes in a batch */
    bool quiet;        /* no progress: a step of something larger */
    schedule schedule;
    weights w;
    long epoch_seed; /* names the epoch's random streams */
    /* the template at the epoch's start */
    double *tP, *tN, *h_j; /* J x 3, J x 3, J */
    uint32_t *N6;          /* J x 6 */
    /* the current batch */
    size_t batch_size;
    size_t *order; /* I: shapes of the epoch in the order of the batches */
    const size_t *batch;
    double *mean;          /* J x 3: of this batch, or the lagged one */
    double *Y, *L;         /* K x 3J, K x K */
    double *step;          /* K x 3J */
    double *N;             /* I x 3J: normals where fresh */
    bool *fresh;           /* I: N belongs to P */
    double *template_pull; /* K x 3J if template_gradient, else NULL */
    uint32_t *guess;       /* I x J: where the surface was last; saves time, changes nothing else */
    double eigenshape;
    shape_record *record;    /* I */
    kept_factor *kept;       /* I if factors serve for several epochs, else NULL */
    apsm_fidelity *fidelity; /* of the last stage; NULL before */
    int workers;
    worker *worker;
} optimizer;

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
static apsm_eigenshape_options eigenshape_options(const optimizer *op)
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

/* Whether a factor serves for several epochs. */
static bool keeps_factors(const optimizer *op)
{
    return op->w.c > 0 && apsm_kept_factor_bytes(op->o, op->I, op->J) > 0;
}

/* s: a share of h, but at most half the half-thickness of the shape where it is thin. */
static double dipole_length(const optimizer *op, const apsm_shape *shape)
{
    return apsm_dipole_length(shape, op->o->dipole * op->state->h);
}

/* ---- memory ---- */

static double *doubles(size_t n)
{
    return malloc((n ? n : 1) * sizeof(double));
}

static bool worker_alloc(worker *w, size_t J, size_t R, size_t K)
{
    const size_t point_arrays = 9;
    w->B = doubles(point_arrays * R);
    w->D = w->B ? w->B + 3 * R : NULL;
    if (w->B) {
        w->f = w->D + R;
        w->E = w->f + R;
        w->g = w->E + R;
        w->kbar = w->g + R;
        w->dL_df = w->kbar + R;
    }
    w->gs = doubles(9 * J);
    if (w->gs) w->gc = w->gs + 3 * J, w->ge = w->gc + 3 * J;
    w->rbf_store = doubles(apsm_rbf_store_size(J));
    w->factor_store = doubles(apsm_polyharmonic_store_size(3 * J, false));
    const size_t fit_work = apsm_rbf_work_size(J), eval_work = apsm_rbf_eval_f32_work_size(J);
    w->rbf_work = doubles(fit_work > eval_work ? fit_work : eval_work);
    w->sampling_work = doubles(apsm_sampling_work_size(J, R));
    w->eigen_work = doubles(K);
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

static void free_factors(optimizer *op)
{
    for (size_t i = 0; op->kept && i < op->I; i++) free(op->kept[i].store);
    free(op->kept);
    op->kept = NULL;
}

static void optimizer_free(optimizer *op)
{
    if (op->worker)
        for (int k = 0; k < op->workers; k++) worker_free(&op->worker[k]);
    free(op->worker);
    free(op->tP);
    free(op->N6);
    free(op->order);
    free(op->mean);
    free(op->Y);
    free(op->template_pull);
    free_factors(op);
    free(op->record);
    free(op->guess);
    free(op->N);
    free(op->fresh);
    apsm_fidelity_free(op->fidelity);
}

static size_t batch_limit(const apsm_options *o, size_t I)
{
    enum { FULL_BATCH = 256, MINIBATCH = 64 };
    const size_t wanted = o->batch > 0 ? (size_t)o->batch : I <= FULL_BATCH ? I : MINIBATCH;
    return wanted < I ? wanted : I;
}

static apsm_status optimizer_alloc(apsm_context *ctx, const apsm_cohort *cohort,
                                   const apsm_options *o, apsm_optimizer_state *state,
                                   optimizer *op)
{
    const size_t I = cohort->I, J = state->J, K = batch_limit(o, I);
    *op = (optimizer){ .ctx = ctx,
                       .cohort = cohort,
                       .o = o,
                       .state = state,
                       .I = I,
                       .J = J,
                       .R = (size_t)ceil(o->points * (double)J),
                       .K = K };
    op->workers = apsm_context_threads(ctx);
    op->worker = calloc((size_t)op->workers, sizeof *op->worker);
    op->tP = doubles(7 * J);
    op->N6 = malloc(J * APSM_NEIGHBOURS * sizeof *op->N6);
    op->order = malloc(I * sizeof *op->order);
    op->mean = doubles(3 * J);
    op->Y = doubles(K * J * 6 + K * K);
    op->N = doubles(I * J * 3);
    op->fresh = calloc(I, sizeof *op->fresh);
    op->record = calloc(I, sizeof *op->record);
    op->guess = calloc(I * J, sizeof *op->guess);
    if (o->template_gradient) op->template_pull = doubles(K * J * 3);
    bool ok = op->worker && op->tP && op->N6 && op->order && op->mean && op->Y && op->record &&
              op->guess && (!o->template_gradient || op->template_pull);
    if (ok) {
        op->tN = op->tP + 3 * J;
        op->h_j = op->tN + 3 * J;
        op->step = op->Y + K * J * 3;
        op->L = op->step + K * J * 3;
        for (int k = 0; ok && k < op->workers; k++) ok = worker_alloc(&op->worker[k], J, op->R, K);
    }
    if (ok) return APSM_OK;
    optimizer_free(op);
    return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for %zu shapes of %zu particles", I, J);
}

static double *particles(const optimizer *op, size_t i)
{
    return op->state->P + i * op->J * 3;
}

/* ---- the pieces of an epoch, for one shape ---- */

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

/* Normals of shape i's particles; a shape's are looked up when it has moved, while its tree is at
 * hand. */
static const double *normals(const optimizer *op, size_t i)
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
    if (keep && !k->store) k->store = doubles(apsm_polyharmonic_store_size(3 * op->J, true));
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

/* Weight of the correspondence term in (11): the squared Frobenius norm's gradient is a length
 * already. */
static double correspondence_weight(const optimizer *op)
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

static apsm_status gradients_of_shape(apsm_context *ctx, size_t k, int worker_index, void *user)
{
    optimizer op = *(optimizer *)user; /* a copy with the task's own error line */
    op.ctx = ctx;
    const size_t i = op.batch[k];
    worker *w = &op.worker[worker_index];
    const double *P = particles(&op, i);
    const double *N = normals(&op, i);
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

static apsm_status move_shape(apsm_context *ctx, size_t k, int worker_index, void *user)
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
    normals(op, i);
    return APSM_OK;
}

/* ---- the pieces of an epoch, for the cohort ---- */

static apsm_status freeze_template(optimizer *op)
{
    const size_t t = op->cohort->template_index;
    memcpy(op->tP, particles(op, t), op->J * 3 * sizeof *op->tP);
    memcpy(op->tN, normals(op, t), op->J * 3 * sizeof *op->tN);
    APSM_TRY(apsm_neighbours6(op->J, op->tP, op->N6));
    const double h = apsm_spacing(op->J, op->tP, op->N6, op->h_j);
    if (!(op->state->h > 0)) op->state->h = h; /* fixed once a stage */
    return APSM_OK;
}

/* A seeded order of the shapes if there is more than one batch (Fisher-Yates). */
static void shuffle(optimizer *op)
{
    for (size_t i = 0; i < op->I; i++) op->order[i] = i;
    if (op->K == op->I) return;
    apsm_random rng = apsm_random_stream(apsm_context_seed(op->ctx), APSM_STREAM_BATCH, 0,
                                         (uint64_t)op->epoch_seed);
    for (size_t i = op->I - 1; i > 0; i--) {
        const size_t j = (size_t)apsm_random_below(&rng, i + 1), other = op->order[j];
        op->order[j] = op->order[i];
        op->order[i] = other;
    }
}

/* Y, its factor and the loss (9); the mean is the batch's own if the batch is the cohort. */
static apsm_status eigenshape_of_batch(optimizer *op)
{
    const bool full = op->batch_size == op->I;
    const bool needs_mean =
        op->w.beta > 0 || (op->w.gamma > 0 && op->o->correspondence != APSM_CORRES_NEIGHBOURHOOD);
    op->eigenshape = NAN;
    if (!needs_mean) return APSM_OK;
    for (size_t k = 0; k < op->batch_size; k++)
        memcpy(op->Y + k * op->J * 3, particles(op, op->batch[k]), op->J * 3 * sizeof *op->Y);
    if (full)
        apsm_cohort_mean(op->batch_size, op->J, op->Y, op->mean);
    else
        memcpy(op->mean, op->state->mean, op->J * 3 * sizeof *op->mean);
    if (!(op->w.beta > 0)) return APSM_OK;
    apsm_cohort_centre(op->batch_size, op->J, op->Y, op->mean, op->Y);
    const apsm_eigenshape_options eo = eigenshape_options(op);
    const apsm_status status =
        apsm_eigenshape_loss(op->batch_size, op->J, op->Y, &eo, &op->eigenshape, op->L, NULL);
    if (status != APSM_ERR_SINGULAR) return status;
    op->w.beta = 0; /* all shapes of the batch are equal: no variation to compress */
    op->eigenshape = NAN;
    return APSM_OK;
}

/* With template_gradient the template also feels what the others' terms ask of it. */
static void pull_template(optimizer *op)
{
    if (!op->template_pull || !(op->w.gamma > 0)) return;
    const bool scaled = op->o->step == APSM_STEP_SCALED;
    const double weight = scaled ? correspondence_weight(op) : op->o->learning_rate * op->w.gamma;
    for (size_t k = 0; k < op->batch_size; k++) {
        if (op->batch[k] != op->cohort->template_index) continue;
        double *step = op->step + k * op->J * 3;
        for (size_t l = 0; l < op->batch_size; l++)
            for (size_t x = 0; x < op->J * 3; x++)
                step[x] -= weight * op->template_pull[l * op->J * 3 + x];
    }
}

static apsm_status run_batch(optimizer *op, const size_t *batch, size_t size)
{
    op->batch = batch;
    op->batch_size = size;
    const weights w = op->w;
    APSM_TRY(eigenshape_of_batch(op));
    APSM_TRY(apsm_parallel_for(op->ctx, size, gradients_of_shape, op, NULL));
    pull_template(op);
    APSM_TRY(apsm_parallel_for(op->ctx, size, move_shape, op, NULL));
    op->w = w;
    return APSM_OK;
}

/* ---- Algorithm 1 and the stop rule of stage 1 ---- */

/* The decay phase begins early if every shape has few mismatched particles, or if two passes
 * brought nothing. */
static void judge_pass(optimizer *op, const apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    if (s->epoch >= op->schedule.decay1) return;
    const bool better = r->worst_mismatched < s->best_mismatched;
    s->passes_without_gain = better ? 0 : s->passes_without_gain + 1;
    if (better) s->best_mismatched = r->worst_mismatched;
    if (s->epoch == 0) return; /* the loss has not had its say yet */
    if (r->worst_mismatched <= op->o->stop_mismatched)
        s->stage1_stop = APSM_STOP_MATCHED;
    else if (s->passes_without_gain >= 2)
        s->stage1_stop = APSM_STOP_STALLED;
    if (s->stage1_stop != APSM_STOP_NOT_YET) s->epoch = op->schedule.decay1;
}

/* First particles of which many are mismatched were not brought by registration, or it failed.
 * What follows presumes that they are about right: they get epochs of their own to settle. */
static void judge_first_pass(optimizer *op, const apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    if (op->schedule.settle == 0 || !(r->mismatched > op->o->settle_mismatched)) return;
    s->epoch = -op->schedule.settle;
    if (op->quiet) return;
    apsm_log(op->ctx, APSM_LOG_INFO,
             "%.0f %% of the first particles are mismatched: up to %ld epochs to settle come first",
             100.0 * r->mismatched, op->schedule.settle);
}

/* Settled if few are mismatched, or if a pass finds no fewer. */
static void judge_settling(optimizer *op, const apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    const bool better = r->worst_mismatched < s->best_mismatched;
    if (better) s->best_mismatched = r->worst_mismatched;
    s->passes_without_gain = better ? 0 : s->passes_without_gain + 1;
    if (r->worst_mismatched > op->o->stop_mismatched && s->passes_without_gain < 2) return;
    s->passes_without_gain = 0;
    s->epoch = 0;
}

static apsm_status run_pass(optimizer *op, apsm_epoch_record *r)
{
    geodesic_pass_result pass;
    memset(op->fresh, 0, op->I * sizeof *op->fresh);
    APSM_TRY(geodesic_pass(op->ctx, op->cohort, op->o, op->J, op->state->h, op->state->P, &pass));
    r->mismatched = pass.mean;
    r->worst_mismatched = pass.worst;
    r->walked = pass.walked;
    if (op->state->epoch < 0)
        judge_settling(op, r);
    else
        judge_pass(op, r);
    if (op->state->epochs_run == 0) judge_first_pass(op, r);
    return APSM_OK;
}

/* ---- epoch, stage, run ---- */

static double mean_over_shapes(const optimizer *op, size_t field)
{
    double sum = 0;
    for (size_t i = 0; i < op->I; i++)
        sum += *(const double *)((const char *)&op->record[i] + field);
    return sum / (double)op->I;
}

static void fill_record(const optimizer *op, apsm_epoch_record *r)
{
    r->stage = op->state->stage;
    r->alpha = op->w.alpha;
    r->beta = op->w.beta;
    r->gamma = op->w.gamma;
    r->c = op->w.c;
    r->sampling = mean_over_shapes(op, offsetof(shape_record, sampling));
    r->correspondence = mean_over_shapes(op, offsetof(shape_record, correspondence));
    r->surface_error = sqrt(mean_over_shapes(op, offsetof(shape_record, error2))) / op->state->h;
    r->step = mean_over_shapes(op, offsetof(shape_record, step));
    /* Of (9) itself, whatever its factor: a cohort's size does not change the figure. */
    const double size = op->o->eigen_scale == 0 ? 3.0 * (double)(op->J * op->batch_size) : 1.0;
    r->eigenshape = op->eigenshape / size;
}

static void tell_progress(const optimizer *op, const apsm_epoch_record *r)
{
    static const char *const names[] = { "settling", "stage 1", "stage 2", "fidelity" };
    const bool settling = r->epoch < 0;
    const long before = settling ? op->schedule.settle : 0;
    const apsm_progress p = { .stage = names[settling ? 0 : r->stage],
                              .done = (size_t)(r->epoch + 1 + before),
                              .total = (size_t)(settling ? before : op->schedule.epochs),
                              .loss = { r->sampling, r->correspondence, r->eigenshape },
                              .mismatched = r->mismatched };
    apsm_report_progress(op->ctx, &p);
}

/* Factors are made anew every RENEWAL epochs of a stage, at the positions then, which the state
 * keeps: whoever resumes in between makes the same ones. */
static apsm_status renew_factors(optimizer *op)
{
    enum { RENEWAL = 25 };
    apsm_optimizer_state *s = op->state;
    const size_t n = op->I * op->J * 3;
    if (!keeps_factors(op)) return APSM_OK;
    if (!op->kept) op->kept = calloc(op->I, sizeof *op->kept);
    if (!op->kept) return APSM_ERR_MEMORY;
    if (s->epoch > 0 && s->epoch % RENEWAL > 0 && s->own_size == n) return APSM_OK;
    if (s->own_size != n) {
        free(s->own);
        s->own = doubles(n);
        s->own_size = s->own ? n : 0;
    }
    if (!s->own) return APSM_ERR_MEMORY;
    memcpy(s->own, s->P, n * sizeof *s->own);
    for (size_t i = 0; i < op->I; i++) op->kept[i].ready = false;
    return APSM_OK;
}

static apsm_status run_epoch(optimizer *op, apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    *r = (apsm_epoch_record){ .mismatched = NAN, .worst_mismatched = NAN };
    op->epoch_seed = s->epochs_run;
    APSM_TRY(freeze_template(op));
    if (pass_is_due(&op->schedule, s->epoch)) {
        APSM_TRY(run_pass(op, r));
        APSM_TRY(freeze_template(op));
    }
    r->epoch = s->epoch;
    op->w = weights_of_epoch(op->o, &op->schedule, s->stage, s->epoch, s->epochs_run);
    APSM_TRY(renew_factors(op));
    shuffle(op);
    for (size_t first = 0; first < op->I; first += op->K) {
        const size_t rest = op->I - first;
        APSM_TRY(run_batch(op, op->order + first, rest < op->K ? rest : op->K));
    }
    if (op->K < op->I) apsm_cohort_mean(op->I, op->J, s->P, s->mean);
    fill_record(op, r);
    s->epoch++;
    s->epochs_run++;
    return APSM_OK;
}

/* ---- the fidelity stage ---- */

static apsm_status begin_fidelity(optimizer *op)
{
    apsm_optimizer_state *s = op->state;
    free_factors(op);
    if (s->epoch == 0) {
        const size_t n = op->I * op->J * 3;
        double *own = doubles(n);
        if (!own) return APSM_ERR_MEMORY;
        memcpy(own, s->P, n * sizeof *own);
        free(s->own);
        s->own = own;
        s->own_size = n;
    }
    const apsm_fidelity_options fo = apsm_fidelity_of(op->o);
    APSM_TRY(apsm_fidelity_new(op->ctx, op->cohort, op->J,
                               particles(op, op->cohort->template_index), &fo, &op->fidelity));
    s->h = apsm_fidelity_spacing(op->fidelity);
    return APSM_OK;
}

static apsm_status run_round(optimizer *op, apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    apsm_fidelity_record f;
    if (!op->fidelity) APSM_TRY(begin_fidelity(op));
    APSM_TRY(apsm_fidelity_round(op->ctx, op->fidelity, s->epoch, s->own, s->P, &f));
    *r = (apsm_epoch_record){ .stage = s->stage,
                              .epoch = s->epoch,
                              .alpha = NAN,
                              .beta = NAN,
                              .gamma = NAN,
                              .c = NAN,
                              .sampling = NAN,
                              .correspondence = NAN,
                              .eigenshape = NAN,
                              .surface_error = f.after,
                              .step = f.step,
                              .mismatched = NAN,
                              .worst_mismatched = NAN };
    s->epoch++;
    s->epochs_run++;
    return APSM_OK;
}

static void next_stage(apsm_optimizer_state *s)
{
    if (s->stage == APSM_STAGE_1 && s->stage1_stop == APSM_STOP_NOT_YET)
        s->stage1_stop = APSM_STOP_LIMIT;
    s->stage++;
    s->epoch = 0;
    s->h = 0;
}

/* An interrupted epoch is undone: its entry positions are kept in `entry`. */
static apsm_status run_stages(optimizer *op, double *entry, apsm_epoch_fn on_epoch, void *user)
{
    apsm_optimizer_state *s = op->state;
    const size_t bytes = op->I * op->J * 3 * sizeof *entry;
    for (; s->stage < APSM_STAGE_DONE; next_stage(s)) {
        op->schedule = schedule_of_stage(op->o, s->stage);
        while (s->epoch < op->schedule.epochs) {
            apsm_epoch_record r;
            const apsm_optimizer_state before = *s;
            memcpy(entry, s->P, bytes);
            const bool last = s->stage == APSM_STAGE_FIDELITY;
            const apsm_status status = last ? run_round(op, &r) : run_epoch(op, &r);
            if (status != APSM_OK) {
                const apsm_optimizer_state now = *s;
                *s = before;
                s->own = now.own;
                s->own_size = now.own_size;
                memcpy(s->P, entry, bytes);
                return status;
            }
            if (!op->quiet) tell_progress(op, &r);
            if (on_epoch) APSM_TRY(on_epoch(user, s, &r));
            if (apsm_interrupted(op->ctx)) return APSM_ERR_INTERRUPTED;
        }
    }
    return APSM_OK;
}

static apsm_status optimize(apsm_context *ctx, const apsm_cohort *cohort,
                            const apsm_options *options, apsm_optimizer_state *state, bool quiet,
                            apsm_epoch_fn on_epoch, void *user)
{
    apsm_linalg_single_thread();
    optimizer op;
    APSM_TRY(optimizer_alloc(ctx, cohort, options, state, &op));
    op.quiet = quiet;
    if (state->epochs_run == 0) apsm_cohort_mean(state->I, state->J, state->P, state->mean);
    double *entry = doubles(state->I * state->J * 3);
    const apsm_status status = entry ? run_stages(&op, entry, on_epoch, user) : APSM_ERR_MEMORY;
    free(entry);
    optimizer_free(&op);
    return status;
}

apsm_status apsm_optimize(apsm_context *ctx, const apsm_cohort *cohort, const apsm_options *options,
                          apsm_optimizer_state *state, apsm_epoch_fn on_epoch, void *user)
{
    if (state->I != cohort->I || state->J < 7)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "%zu shapes in the state, %zu in the cohort; at least 7 particles needed",
                         state->I, cohort->I);
    return optimize(ctx, cohort, options, state, false, on_epoch, user);
}

/* ---- spreading the particles of one shape ---- */

enum { SPREAD_ALPHA = 10 }; /* steps up to h/4: a farthest-point sample is far from even */

apsm_status apsm_spread(apsm_context *ctx, const apsm_cohort *cohort, size_t i,
                        const apsm_options *options, size_t J, long epochs, double *P)
{
    apsm_cohort one = { .I = 1, .shape = &cohort->shape[i], .template_index = 0 };
    apsm_options o = *options;
    apsm_optimizer_state state = {
        .I = 1, .J = J, .stage = APSM_STAGE_1, .best_mismatched = 2, .P = P
    };
    o.stage1_epochs = epochs;
    o.stage2_epochs = 0;
    o.fidelity = 0;
    if (o.step == APSM_STEP_SCALED) o.alpha = SPREAD_ALPHA;
    o.beta = o.gamma = 0;
    o.batch = 0;
    state.mean = doubles(3 * J);
    if (!state.mean) return APSM_ERR_MEMORY;
    const apsm_status status = optimize(ctx, &one, &o, &state, true, NULL, NULL);
    free(state.mean);
    return status;
}
