/* The comparison method `psm`; docs/method.md, "Comparison methods".  As ShapeWorks runs it (code
 * read: Optimize.cpp, GradientDescentOptimizer.cpp, SamplingFunction.cpp,
 * CorrespondenceFunction.cpp), written anew:
 *
 *   splitting     J = 1, 2, 4, ..: every particle gets a twin beside it, then
 *                 psm_iterations_per_split iterations with psm_initial_relative_weighting.  The
 *                 correspondence term is the mean energy |Y|^2 / 2, as in ShapeWorks unless its
 *                 multiscale mode is on (psm_shape_statistics_in_init: the entropy)
 *   optimisation  psm_optimization_iterations with psm_relative_weighting and the entropy H(Z),
 *                 whose regularisation decays exponentially
 *   iteration     correspondence gradient once for all shapes, then a pass over the particles of
 *                 each shape (psm_sweep.c).  A particle follows -(sampling gradient + rel
 *                 correspondence gradient), both as they are, times its own step
 *
 * What the sampling gradient (1 / length) and the mean energy's (length) have in common is the
 * unit: psm_unit is the length that stands for ShapeWorks' mm, and regularisations and first steps
 * are in its square.  Where this differs from ShapeWorks:
 *   - The first particle is the point next to the upper corner of the template's box (there: of the
 *     first shape's), and what is next to that on the others; twins go in directions of a fixed
 *     sequence (there: random), 1/20 of the spacing away (there: 0.1 mm).
 *   - The last split is partial if J is no power of two: the particles with the widest kernels get
 *     twins (there: J is rounded up).
 *   - psm_starting_share sets the regularisation by the cohort: the documented way to tune it.
 *   - Procrustes transforms serve the correspondence term alone; particles stay in the frame of the
 *     groomed shapes. */
#include "psm/psm.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "model/procrustes.h"
#include "psm/psm_entropy.h"
#include "psm/psm_sweep.h"

enum { BLOCK = 10 }; /* iterations from one call of on_epoch to the next, at most */

typedef struct psm {
    apsm_context *ctx;
    const apsm_cohort *cohort;
    const apsm_optimize_options *o;
    apsm_optimizer_state *state;
    size_t I, J;
    double unit;
    double longest;          /* longest side of all shapes' boxes */
    double *sampling;        /* I: factors of the sampling gradients */
    double *Q, *grad;        /* I x 3J: particles in the common frame, correspondence gradient */
    double *blocks;          /* J x 9 */
    double *work;            /* of the entropy */
    double *sweep;           /* threads x psm_sweep_work_size(J) */
    psm_sweep_record *swept; /* I */
    /* the current iteration */
    size_t now; /* particles there are */
    double rel, reg, value;
} psm;

/* ---- the method's own part of the state: reg, then for each shape M, sigma, step, N ---- */

static size_t own_stride(size_t J)
{
    return 16 + 5 * J;
}

size_t apsm_psm_own_size(size_t I, size_t J)
{
    return 1 + I * own_stride(J);
}

static double *own(const psm *p, size_t i)
{
    return p->state->own + 1 + i * own_stride(p->J);
}

/* Regularisation with which stage 2 starts. */
static double *own_reg(const psm *p)
{
    return p->state->own;
}

static psm_particles particles_of(const psm *p, size_t i)
{
    double *at = own(p, i) + 16;
    return (psm_particles){ .J = p->now,
                            .P = p->state->P + i * p->J * 3,
                            .sigma = at,
                            .step = at + p->J,
                            .N = at + 2 * p->J };
}

static apsm_status own_alloc(psm *p)
{
    apsm_optimizer_state *s = p->state;
    static const double identity[16] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    if (s->own) return APSM_OK;
    s->own_size = apsm_psm_own_size(p->I, p->J);
    s->own = calloc(s->own_size, sizeof *s->own);
    if (!s->own) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < p->I; i++) {
        p->now = 1;
        const psm_particles at = particles_of(p, i);
        apsm_surface_point on;
        memcpy(own(p, i), identity, sizeof identity);
        apsm_shape_look_up(&p->cohort->shape[i], 1, at.P, &on, NULL, at.N);
    }
    return APSM_OK;
}

/* ---- schedule ---- */

/* Splits from 1 to J particles. */
static long splits(size_t J)
{
    long n = 0;
    while (((size_t)1 << n) < J) n++;
    return n;
}

static long iterations_of_stage(const psm *p)
{
    switch (p->state->stage) {
    case APSM_STAGE_1:
        return splits(p->J) * p->o->psm.psm_iterations_per_split;
    case APSM_STAGE_2:
        return p->o->psm.psm_optimization_iterations;
    default:
        return 0; /* the fidelity stage is not part of this method */
    }
}

/* How many particles there are after n splits. */
static size_t after_splits(size_t J, long n)
{
    const size_t all = (size_t)1 << n;
    return all < J ? all : J;
}

/* Particles that there are when the state's next iteration begins, its split not yet done. */
static size_t particles_before(const psm *p)
{
    const long per_split = p->o->psm.psm_iterations_per_split;
    if (p->state->stage != APSM_STAGE_1) return p->state->epoch > 0 || per_split ? p->J : 1;
    const long e = p->state->epoch;
    return per_split ? after_splits(p->J, (e + per_split - 1) / per_split) : 1;
}

/* ---- splitting ---- */

/* A direction for particle k's twin that is the same on every shape: from an even sequence on the
 * sphere, or along an axis if that is too close to the particle's mean normal. */
static void twin_direction(const psm *p, size_t k, long split, double d[3])
{
    const double two_pi = 6.283185307179586, least_sine = 0.5;
    const double u = ((double)k + 0.5) * 0.6180339887498949 + (double)split * 0.4142135623730950;
    const double v = ((double)k + 0.5) * 0.7548776662466927 + (double)split * 0.5698402909980532;
    const double z = 2 * (u - floor(u)) - 1, r = sqrt(fmax(0, 1 - z * z));
    double n[3] = { 0, 0, 0 };
    for (size_t i = 0; i < p->I; i++) vec3_add_scaled(n, 1, particles_of(p, i).N + 3 * k);
    vec3_normalise(n);
    d[0] = r * cos(two_pi * v);
    d[1] = r * sin(two_pi * v);
    d[2] = z;
    vec3_add_scaled(d, -vec3_dot(d, n), n);
    if (vec3_normalise(d) > least_sine) return;
    int axis = 0;
    for (int a = 1; a < 3; a++)
        if (fabs(n[a]) < fabs(n[axis])) axis = a;
    for (int a = 0; a < 3; a++) d[a] = a == axis;
    vec3_add_scaled(d, -vec3_dot(d, n), n);
    vec3_normalise(d);
}

/* Puts particle k's twin on shape i, as particle `twin`. */
static void add_twin(const psm *p, size_t i, size_t k, size_t twin, const double direction[3],
                     double apart)
{
    const apsm_shape *shape = &p->cohort->shape[i];
    const psm_particles at = particles_of(p, i);
    const double *P = at.P + 3 * k, *n = at.N + 3 * k;
    double d[3] = { direction[0], direction[1], direction[2] };
    vec3_add_scaled(d, -vec3_dot(d, n), n);
    if (!(vec3_normalise(d) > 0)) memcpy(d, direction, sizeof d);
    for (int a = 0; a < 3; a++) d[a] = P[a] + apart * d[a];
    apsm_closest to;
    apsm_bvh_closest(shape->bvh, d, INFINITY, &to);
    memcpy(at.P + 3 * twin, to.x, sizeof to.x);
    apsm_surface_normal(&shape->mesh, shape->VN, &to.on, at.N + 3 * twin);
}

/* chosen[k]: particle k gets a twin.  All do, but if only `room` can those with the widest kernels
 * (mean over the shapes; ties: the first). */
static apsm_status choose(const psm *p, size_t room, bool *chosen)
{
    for (size_t k = 0; k < p->now; k++) chosen[k] = room >= p->now;
    if (room >= p->now) return APSM_OK;
    double *width = calloc(p->now, sizeof *width);
    if (!width) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < p->I; i++)
        for (size_t k = 0; k < p->now; k++) width[k] += particles_of(p, i).sigma[k];
    for (size_t r = 0; r < room; r++) {
        size_t best = 0;
        while (chosen[best]) best++;
        for (size_t k = best + 1; k < p->now; k++)
            if (!chosen[k] && width[k] > width[best]) best = k;
        chosen[best] = true;
    }
    free(width);
    return APSM_OK;
}

/* Twins for as many particles as there is room for. */
static apsm_status split(psm *p, long number)
{
    const double share = 0.05;
    const apsm_mesh *t = &p->cohort->shape[p->cohort->template_index].mesh;
    const double apart = share * apsm_expected_spacing(apsm_mesh_area(t), p->now);
    bool *chosen = malloc(p->now * sizeof *chosen);
    if (!chosen) return APSM_ERR_MEMORY;
    apsm_status status = choose(p, p->J - p->now, chosen);
    size_t twin = p->now;
    for (size_t k = 0; k < p->now && status == APSM_OK; k++) {
        double d[3];
        if (!chosen[k]) continue;
        twin_direction(p, k, number, d);
        for (size_t i = 0; i < p->I; i++) add_twin(p, i, k, twin, d, apart);
        twin++;
    }
    if (status == APSM_OK) p->now = twin;
    for (size_t i = 0; i < p->I && status == APSM_OK; i++)
        memset(particles_of(p, i).sigma, 0, p->now * sizeof(double));
    free(chosen);
    return status;
}

static void reset_steps(psm *p)
{
    for (size_t i = 0; i < p->I; i++) {
        double *step = particles_of(p, i).step;
        for (size_t k = 0; k < p->now; k++) step[k] = p->unit * p->unit;
    }
}

/* ---- the correspondence term ---- */

/* Q <- the particles in the common frame, in units. */
static void collect(psm *p)
{
    const size_t n = 3 * p->now;
    for (size_t i = 0; i < p->I; i++) {
        double *Q = p->Q + i * n;
        apsm_affine_apply(own(p, i), p->now, p->state->P + i * p->J * 3, Q);
        for (size_t x = 0; x < n; x++) Q[x] /= p->unit;
    }
}

static apsm_status register_shapes(psm *p)
{
    apsm_procrustes_options po = apsm_procrustes_defaults();
    const size_t n = p->now * 3;
    po.pose = p->o->psm.psm_procrustes_rotation_translation;
    po.scale = p->o->psm.psm_procrustes_scaling;
    for (size_t i = 0; i < p->I; i++)
        memcpy(p->Q + i * n, p->state->P + i * p->J * 3, n * sizeof *p->Q);
    double *M = malloc(p->I * 16 * sizeof *M);
    if (!M) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_procrustes(p->ctx, p->I, p->now, p->Q, &po, M, NULL);
    for (size_t i = 0; i < p->I && status == APSM_OK; i++)
        memcpy(own(p, i), M + 16 * i, 16 * sizeof *M);
    free(M);
    return status;
}

/* What the term asks of shape i; its gradient is taken to the shape's own frame and unit. */
static psm_pull pull_of(const psm *p, size_t i)
{
    const size_t n = 3 * p->now;
    const double *M = own(p, i);
    double *g = p->grad + i * n;
    psm_pull pull = { .rel = p->rel, .g = g, .Y = p->Q + i * n, .C = p->blocks };
    for (int a = 0; a < 9; a++) pull.L[a] = M[4 * (a / 3) + a % 3] / p->unit;
    for (size_t k = 0; k < n; k += 3) {
        const double v[3] = { g[k], g[k + 1], g[k + 2] };
        for (size_t a = 0; a < 3; a++)
            g[k + a] = p->rel * (pull.L[a] * v[0] + pull.L[3 + a] * v[1] + pull.L[6 + a] * v[2]);
    }
    return pull;
}

/* Steps down to this, in unit^2, are made even uphill: 1, from the middle of the iterations that
 * follow a split (or of stage 2) falling to e^-5. */
static double least_step(const psm *p)
{
    const bool first = p->state->stage == APSM_STAGE_1;
    const long n =
        first ? p->o->psm.psm_iterations_per_split : p->o->psm.psm_optimization_iterations;
    const long e = first ? p->state->epoch % n : p->state->epoch, half = n / 2;
    return e > half ? exp(-5 * (double)(e - half) / (double)(n - half)) : 1;
}

/* rel and reg of the next iteration. */
static apsm_status set_weights(psm *p)
{
    const apsm_optimize_options *o = p->o;
    const long e = p->state->epoch;
    const double decay = o->psm.psm_ending_regularization / o->psm.psm_starting_regularization;
    const bool first = p->state->stage == APSM_STAGE_1;
    p->rel = first ? o->psm.psm_initial_relative_weighting : o->psm.psm_relative_weighting;
    const long n = first ? o->psm.psm_iterations_per_split : o->psm.psm_optimization_iterations;
    const double done = (double)(first ? e % n : e) / (double)n;
    if (first && !o->psm.psm_shape_statistics_in_init) return p->reg = INFINITY, APSM_OK;
    if (e == 0 || (first && e % n == 0)) {
        *own_reg(p) = o->psm.psm_starting_regularization;
        if (o->psm.psm_starting_share > 0) {
            double largest;
            collect(p);
            APSM_TRY(psm_largest_variance(p->I, 3 * p->now, p->Q, &largest, p->work));
            *own_reg(p) = fmax(o->psm.psm_starting_share * largest, 1e-300);
        }
    }
    p->reg = *own_reg(p) * pow(o->psm.psm_starting_share > 0 ? 0.1 : decay, done);
    return APSM_OK;
}

/* ---- iterations ---- */

static apsm_status sweep_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx;
    const psm *p = user;
    const psm_particles at = particles_of(p, i);
    const psm_pull pull = pull_of(p, i);
    const psm_measure by = { .longest = p->longest,
                             .unit = p->unit,
                             .least_step = least_step(p),
                             .sampling = p->sampling[i] };
    p->swept[i] = psm_sweep(&p->cohort->shape[i], &by, &pull, &at,
                            p->sweep + (size_t)worker * psm_sweep_work_size(p->J));
    return APSM_OK;
}

/* What is due before an iteration: a split, fresh steps, a registration. */
static apsm_status prepare(psm *p)
{
    const apsm_optimizer_state *s = p->state;
    const long per_split = p->o->psm.psm_iterations_per_split;
    p->now = particles_before(p);
    if (s->stage == APSM_STAGE_1) {
        if (s->epoch % per_split) return APSM_OK;
        APSM_TRY(split(p, s->epoch / per_split));
        reset_steps(p);
        return APSM_OK;
    }
    for (long n = 0; p->now < p->J; n++) APSM_TRY(split(p, n));
    if (s->epoch == 0) reset_steps(p);
    if (p->o->psm.psm_procrustes && s->epoch % p->o->psm.psm_procrustes_interval == 0)
        return register_shapes(p);
    return APSM_OK;
}

static apsm_status iterate(psm *p)
{
    APSM_TRY(prepare(p));
    APSM_TRY(set_weights(p));
    collect(p);
    APSM_TRY(psm_entropy(p->I, 3 * p->now, p->reg, p->Q, p->grad, p->blocks, &p->value, p->work));
    APSM_TRY(apsm_parallel_for(p->ctx, p->I, sweep_shape, p, NULL));
    p->state->epoch++;
    return APSM_OK;
}

static void fill_record(const psm *p, apsm_epoch_record *r)
{
    const double h = p->state->h;
    *r = (apsm_epoch_record){ .stage = p->state->stage,
                              .epoch = p->state->epoch - 1,
                              .alpha = 1,
                              .gamma = p->rel,
                              .beta = p->reg,
                              .loss = { 0, p->value, NAN, NAN, NAN, NAN },
                              .surface_error = NAN,
                              .mismatched = NAN,
                              .worst_mismatched = NAN };
    for (size_t i = 0; i < p->I; i++) {
        r->loss[APSM_TERM_SAMPLING] += (p->swept[i].log_density + 3 * log(h)) / (double)p->I;
        r->step += p->swept[i].move / h / (double)p->I;
    }
}

static void tell_progress(const psm *p, const apsm_epoch_record *r)
{
    const apsm_progress progress = { .stage =
                                         r->stage == APSM_STAGE_1 ? "splitting" : "optimization",
                                     .done = (size_t)p->state->epoch,
                                     .total = (size_t)iterations_of_stage(p),
                                     .loss = { r->loss[0], r->loss[1], NAN },
                                     .mismatched = NAN };
    apsm_report_progress(p->ctx, &progress);
}

/* Up to BLOCK iterations, none across a split or the end of the stage. */
static apsm_status run_block(psm *p)
{
    apsm_optimizer_state *s = p->state;
    const long per_split = p->o->psm.psm_iterations_per_split, total = iterations_of_stage(p);
    for (int b = 0; b < BLOCK; b++) {
        APSM_TRY(iterate(p));
        if (s->epoch >= total) break;
        if (s->stage == APSM_STAGE_1 && s->epoch % per_split == 0) break;
    }
    s->epochs_run++;
    return APSM_OK;
}

/* A block that fails or is interrupted is undone from `entry`. */
static apsm_status run_stages(psm *p, double *entry, apsm_epoch_fn on_epoch, void *user)
{
    apsm_optimizer_state *s = p->state;
    const size_t n = p->I * p->J * 3;
    for (; s->stage < APSM_STAGE_DONE; s->stage++, s->epoch = 0)
        while (s->epoch < iterations_of_stage(p)) {
            const apsm_optimizer_state before = *s;
            apsm_epoch_record r;
            memcpy(entry, s->P, n * sizeof *entry);
            memcpy(entry + n, s->own, s->own_size * sizeof *entry);
            const apsm_status status = run_block(p);
            if (status != APSM_OK) {
                *s = before;
                memcpy(s->P, entry, n * sizeof *entry);
                memcpy(s->own, entry + n, s->own_size * sizeof *entry);
                return status;
            }
            fill_record(p, &r);
            tell_progress(p, &r);
            if (on_epoch) APSM_TRY(on_epoch(user, s, &r));
            if (apsm_interrupted(p->ctx)) return APSM_ERR_INTERRUPTED;
        }
    return APSM_OK;
}

/* ---- set-up ---- */

static double *doubles(size_t n)
{
    return malloc((n ? n : 1) * sizeof(double));
}

static void psm_free(psm *p)
{
    free(p->sampling);
    free(p->Q);
    free(p->grad);
    free(p->blocks);
    free(p->work);
    free(p->sweep);
    free(p->swept);
}

/* The size that bounds kernels, and what psm_sampling_scale makes of the shapes' areas. */
static void measure_shapes(psm *p)
{
    const double usual_area = 12250 * p->unit * p->unit;
    for (size_t i = 0; i < p->I; i++) {
        const apsm_mesh *mesh = &p->cohort->shape[i].mesh;
        double lo[3], hi[3];
        apsm_mesh_bounds(mesh, lo, hi);
        for (int a = 0; a < 3; a++) p->longest = fmax(p->longest, hi[a] - lo[a]);
        p->sampling[i] = p->o->psm.psm_sampling_scale ? apsm_mesh_area(mesh) / usual_area : 1;
    }
}

static apsm_status psm_alloc(psm *p)
{
    const size_t n = 3 * p->J, threads = (size_t)apsm_context_threads(p->ctx);
    p->sampling = doubles(p->I);
    p->Q = doubles(p->I * n);
    p->grad = doubles(p->I * n);
    p->blocks = doubles(3 * n);
    p->work = doubles(psm_entropy_work_size(p->I, n));
    p->sweep = doubles(threads * psm_sweep_work_size(p->J));
    p->swept = calloc(p->I, sizeof *p->swept);
    if (!p->sampling || !p->Q || !p->grad || !p->blocks || !p->work || !p->sweep || !p->swept)
        return APSM_ERR_MEMORY;
    measure_shapes(p);
    return own_alloc(p);
}

apsm_status apsm_psm_optimize(apsm_context *ctx, const apsm_cohort *cohort,
                              const apsm_optimize_options *options, apsm_optimizer_state *state,
                              apsm_epoch_fn on_epoch, void *user)
{
    if (cohort->part)
        return apsm_fail(ctx, APSM_ERR_ARG, "method psm takes subjects of one part each");
    if (state->I != cohort->I || state->J < 2)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "%zu shapes in the state, %zu in the cohort; at least 2 particles needed",
                         state->I, cohort->I);
    psm p = { .ctx = ctx,
              .cohort = cohort,
              .o = options,
              .state = state,
              .I = state->I,
              .J = state->J,
              .unit = options->psm.psm_unit };
    const apsm_shape *t = &cohort->shape[cohort->template_index];
    state->h = apsm_expected_spacing(apsm_mesh_area(&t->mesh), state->J);
    apsm_status status = psm_alloc(&p);
    double *entry = status == APSM_OK ? doubles(p.I * p.J * 3 + state->own_size) : NULL;
    if (status == APSM_OK) status = entry ? run_stages(&p, entry, on_epoch, user) : APSM_ERR_MEMORY;
    if (status == APSM_ERR_MEMORY)
        status = apsm_fail(ctx, status, "out of memory for %zu shapes of %zu particles", p.I, p.J);
    free(entry);
    psm_free(&p);
    return status;
}

void apsm_psm_first_particle(const apsm_cohort *cohort, apsm_optimizer_state *state)
{
    const apsm_shape *t = &cohort->shape[cohort->template_index];
    double lo[3], corner[3];
    apsm_closest first;
    apsm_mesh_bounds(&t->mesh, lo, corner);
    apsm_bvh_closest(t->bvh, corner, INFINITY, &first);
    for (size_t i = 0; i < cohort->I; i++) {
        apsm_closest here;
        apsm_bvh_closest(cohort->shape[i].bvh, first.x, INFINITY, &here);
        for (size_t j = 0; j < state->J; j++)
            memcpy(state->P + (i * state->J + j) * 3, here.x, sizeof here.x);
    }
}
