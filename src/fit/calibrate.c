/* What left-out shapes say about a model.  The models without them are those of the fidelity
 * stage's prior (src/optimize/fidelity_prior.c): m modes, shapes left out one by one or in 32
 * folds. All in particles, so no surface is needed.
 *
 *   residual    root mean square of a coordinate's miss by the modes
 *   smooth      the misses x - U b of a shape are a smooth process beside white noise: of a grid of
 *               reaches and shares that with which (40) makes the left-out shapes most likely
 *   mahalanobis F of (45) over its expectation: modes are chosen where the cohort varies most, so
 *               new shapes vary less there and F is not quite distributed like F
 *   band        with a part of a shape hidden, by a plane, and the pose free: factor on the
 * standard deviations of (44) at which 90 % of hidden particles are within 1.645 of them
 *               along their normals */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/fit_model.h"
#include "fit/rigid.h"
#include "geometry/vec3.h"

enum { MOST_JUDGED = 12, DIRECTIONS = 4, REACHES = 5, SHARES = 3 };
static const double reaches[REACHES] = { 1, 1.5, 2.25, 3.4, 5 }; /* in h */
static const double shares[SHARES] = { 0.4, 0.7, 0.9 };          /* of the residual's variance */

typedef struct judging {
    apsm_fit_model *m;
    const double *P; /* I x 3J */
    apsm_fidelity_prior prior;
    size_t n;            /* shapes that are judged, evenly taken */
    fit_process process; /* of the present trial; lengths in h */
    double *result;      /* n, or n x FIT_BANDS x DIRECTIONS */
} judging;

static size_t shape_of(const judging *g, size_t k)
{
    return k * g->prior.I / g->n;
}

/* The variance that a mode has, from its weight in (12). */
static double variance_of(const apsm_fidelity_prior *p, size_t fold, size_t k)
{
    const double held = 1 - p->weight[fold * p->modes + k];
    return p->noise[fold] / (held * held);
}

/* Scores on the modes of the model without the shape; returns the squared miss.  Lengths in h. */
static double miss(const judging *g, size_t i, double *b, double *rest)
{
    const apsm_fidelity_prior *p = &g->prior;
    const size_t D = 3 * p->J, fold = i % p->folds;
    double sum = 0;
    for (size_t d = 0; d < D; d++) rest[d] = g->P[i * D + d] / g->m->h - p->mean[fold * D + d];
    for (size_t k = 0; k < p->modes; k++) {
        const double *u = p->mode + (fold * p->modes + k) * D;
        b[k] = 0;
        for (size_t d = 0; d < D; d++) b[k] += u[d] * rest[d];
        for (size_t d = 0; d < D; d++) rest[d] -= b[k] * u[d];
    }
    for (size_t d = 0; d < D; d++) sum += rest[d] * rest[d];
    return sum;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* ---- residual and distance from the mean ---- */

/* F of (45) for a shape outside the fold's model. */
static double f_of(const judging *g, size_t i, const double *b)
{
    const apsm_fidelity_prior *p = &g->prior;
    const size_t fold = i % p->folds;
    double d2 = 0, n = 0;
    for (size_t k = 0; k < p->I; k++) n += k % p->folds != fold;
    const double M = (double)p->modes;
    for (size_t k = 0; k < p->modes; k++) d2 += b[k] * b[k] / variance_of(p, fold, k);
    return d2 * n * (n - M) / ((n + 1) * (n - 1) * M);
}

static apsm_status judge_residuals(judging *g)
{
    const apsm_fidelity_prior *p = &g->prior;
    fit_calibration *c = &g->m->calibration;
    const size_t D = 3 * p->J, I = p->I;
    const double M = (double)p->modes, n = (double)(I - (I + p->folds - 1) / p->folds);
    double *rest = malloc((D + p->modes + 1 + I) * sizeof *rest), F = 0, sum = 0;
    if (!rest) return APSM_ERR_MEMORY;
    double *b = rest + D, *r = b + p->modes + 1;
    for (size_t i = 0; i < I; i++) {
        const double r2 = miss(g, i, b, rest) / (double)(D - p->modes);
        sum += r2 / (double)I;
        r[i] = sqrt(r2);
        if (p->modes > 0) F += f_of(g, i, b) / (double)I;
    }
    qsort(r, I, sizeof *r, by_value);
    c->residual = r[I / 2];
    c->residual_most = r[I - 1];
    c->noise = fmax(sum, 1e-8);
    const double expected = n - M > 2 ? (n - M) / (n - M - 2) : 1;
    c->mahalanobis = F > 0 ? F / expected : 1;
    free(rest);
    return APSM_OK;
}

/* ---- the smooth process ---- */

/* The model without shape i, with the present trial's process; lengths in h.  store of
 * fit_posterior_size and modes more. */
static posterior_model model_without(const judging *g, size_t i, double *store)
{
    const apsm_fidelity_prior *p = &g->prior;
    const size_t D = 3 * p->J, fold = i % p->folds;
    double *variance = store + fit_posterior_size(p->J, p->modes);
    for (size_t k = 0; k < p->modes; k++) variance[k] = variance_of(p, fold, k);
    const fit_modes known = { p->J, p->modes, p->mean + fold * D, p->mode + fold * p->modes * D,
                              variance };
    return fit_posterior_make(&known, &g->process, store);
}

/* Arrays for a posterior of a shape with a model of at most modes + 3 FIT_SMOOTH + FIT_RIGID. */
typedef struct bench {
    double *store, *x, *error, *y, *b, *B, *block, *work;
} bench;

static bool bench_alloc(const judging *g, bench *w)
{
    const size_t J = g->prior.J, M = g->prior.modes + 3 * FIT_SMOOTH + FIT_RIGID;
    const posterior_model most = { .D = 3 * J, .M = M };
    w->store = malloc((fit_posterior_size(J, g->prior.modes) + g->prior.modes) * sizeof(double));
    w->x = malloc((3 * J + J + 3 * J + M + M * M + 9 * J) * sizeof(double));
    w->work =
        malloc((posterior_particles_work_size(&most) + fit_rigid_size(&most)) * sizeof(double));
    if (w->x) {
        w->error = w->x + 3 * J;
        w->y = w->error + J;
        w->b = w->y + 3 * J;
        w->B = w->b + M;
        w->block = w->B + M * M;
    }
    return w->store && w->x && w->work;
}

static void bench_free(bench *w)
{
    free(w->store);
    free(w->x);
    free(w->work);
}

static apsm_status likelihood_of(apsm_context *ctx, size_t k, int worker, void *user)
{
    (void)ctx, (void)worker;
    const judging *g = user;
    const size_t i = shape_of(g, k), D = 3 * g->prior.J;
    bench w = { 0 };
    apsm_status status = bench_alloc(g, &w) ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        const posterior_model m = model_without(g, i, w.store);
        posterior_scores s = { .b = w.b, .B = w.B };
        memset(w.error, 0, g->prior.J * sizeof *w.error);
        for (size_t d = 0; d < D; d++) w.y[d] = g->P[i * D + d] / g->m->h;
        status = posterior_of_particles(&m, w.y, w.error, &s, NULL, NULL, w.work);
        g->result[k] = s.log_likelihood;
    }
    bench_free(&w);
    return status;
}

/* Sets the trial to this share of the residual's variance, and sums the likelihoods. */
static apsm_status try_smooth(apsm_context *ctx, judging *g, double total, double share,
                              double reach, double *sum)
{
    g->process = (fit_process){ share * total, reach, total - share * total };
    APSM_TRY(apsm_parallel_for(ctx, g->n, likelihood_of, g, NULL));
    *sum = 0;
    for (size_t k = 0; k < g->n; k++) *sum += g->result[k];
    return APSM_OK;
}

static apsm_status choose_smooth(apsm_context *ctx, judging *g)
{
    fit_calibration *c = &g->m->calibration;
    const double total = c->noise;
    double best, sum;
    APSM_TRY(try_smooth(ctx, g, total, 0, 1, &best));
    c->smooth = 0;
    c->reach = 1;
    for (size_t r = 0; r < REACHES; r++)
        for (size_t s = 0; s < SHARES; s++) {
            APSM_TRY(try_smooth(ctx, g, total, shares[s], reaches[r], &sum));
            if (!(sum > best)) continue;
            best = sum;
            c->smooth = g->process.smooth;
            c->reach = g->process.reach;
            c->noise = g->process.noise;
        }
    return APSM_OK;
}

/* ---- bands ---- */

/* All but eight particles are hidden, other ones for every k; those are measured like landmarks. */
static void hide_most(size_t J, size_t k, double *error)
{
    const size_t stride = J > 8 ? J / 8 : 1;
    for (size_t j = 0; j < J; j++)
        error[j] = j % stride == k * stride / DIRECTIONS ? fit_placing * fit_placing : INFINITY;
}

/* Particles beyond the plane across axis k (of a tetrahedron's four) that hides the share; error
 * INFINITY there.  order (J) is scratch. */
static void hide(const judging *g, const double *mean, size_t k, double share, double *order,
                 double *error)
{
    static const double axis[DIRECTIONS][3] = {
        { 1, 1, 1 }, { 1, -1, -1 }, { -1, 1, -1 }, { -1, -1, 1 }
    };
    const size_t J = g->prior.J, seen = (size_t)((1 - share) * (double)J);
    for (size_t j = 0; j < J; j++) order[j] = vec3_dot(axis[k], mean + 3 * j);
    qsort(order, J, sizeof *order, by_value);
    const double level = order[seen < J ? seen : J - 1];
    for (size_t j = 0; j < J; j++)
        error[j] = vec3_dot(axis[k], mean + 3 * j) >= level ? INFINITY : fit_part_error;
}

/* Deviation along n by a particle's covariance. */
static double deviation_along(const double n[3], const double block[9])
{
    double sum = 0;
    for (size_t a = 0; a < 3; a++) sum += n[a] * vec3_dot(block + 3 * a, n);
    return sqrt(sum);
}

/* The 90th percentile of |miss| / sd along the normals of hidden particles, over that of a
 * Gaussian.
 */
static double band_of(const judging *g, const bench *w, double *z)
{
    const size_t J = g->prior.J;
    size_t n = 0;
    for (size_t j = 0; j < J; j++) {
        if (!isinf(w->error[j])) continue;
        const double *normal = g->m->TN + 3 * j;
        double miss[3];
        vec3_sub(w->y + 3 * j, w->x + 3 * j, miss);
        z[n++] = fabs(vec3_dot(miss, normal)) / deviation_along(normal, w->block + 9 * j);
    }
    if (n == 0) return 1;
    qsort(z, n, sizeof *z, by_value);
    return z[(size_t)(0.9 * (double)(n - 1))] / 1.6449;
}

static apsm_status bands_of(apsm_context *ctx, size_t k, int worker, void *user)
{
    (void)ctx, (void)worker;
    const judging *g = user;
    const size_t i = shape_of(g, k), J = g->prior.J, D = 3 * J;
    bench w = { 0 };
    double *z = malloc(D * sizeof *z);
    apsm_status status = z && bench_alloc(g, &w) ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        const posterior_model shape = model_without(g, i, w.store);
        const posterior_model m = fit_rigid_add(&shape, shape.mean, g->m->radius / g->m->h, w.work);
        double *work = w.work + fit_rigid_size(&m);
        posterior_scores s = { .b = w.b, .B = w.B };
        for (size_t d = 0; d < D; d++) w.y[d] = g->P[i * D + d] / g->m->h;
        for (size_t q = 0; q < FIT_BANDS * DIRECTIONS && status == APSM_OK; q++) {
            const double missing = fit_band_missing[q / DIRECTIONS];
            const bool landmarks = missing >= 1;
            if (landmarks)
                hide_most(J, q % DIRECTIONS, w.error);
            else
                hide(g, shape.mean, q % DIRECTIONS, missing, z, w.error);
            status = landmarks ? posterior_of_particles(&m, w.y, w.error, &s, w.x, w.block, work)
                               : posterior_along_normals(&m, g->m->TN, w.y, w.error, &s, w.x,
                                                         w.block, work);
            g->result[k * FIT_BANDS * DIRECTIONS + q] = band_of(g, &w, z);
        }
    }
    bench_free(&w);
    free(z);
    return status;
}

/* Medians over shapes and directions would leave half of them outside; the mean square does not. */
static void sum_up_bands(const judging *g, fit_calibration *c)
{
    for (size_t q = 0; q < FIT_BANDS; q++) {
        double sum = 0;
        for (size_t k = 0; k < g->n; k++)
            for (size_t a = 0; a < DIRECTIONS; a++) {
                const double z = g->result[(k * FIT_BANDS + q) * DIRECTIONS + a];
                sum += z * z / (double)(g->n * DIRECTIONS);
            }
        c->band[q] = sqrt(sum);
    }
}

static apsm_status judge(apsm_context *ctx, judging *g)
{
    fit_calibration *c = &g->m->calibration;
    c->modes = (double)g->prior.modes;
    g->n = g->prior.I < MOST_JUDGED ? g->prior.I : MOST_JUDGED;
    g->result = malloc(g->n * FIT_BANDS * DIRECTIONS * sizeof *g->result);
    if (!g->result) return APSM_ERR_MEMORY;
    APSM_TRY(judge_residuals(g));
    APSM_TRY(choose_smooth(ctx, g));
    g->process = (fit_process){ c->smooth, c->reach, c->noise };
    APSM_TRY(apsm_parallel_for(ctx, g->n, bands_of, g, NULL));
    sum_up_bands(g, c);
    return APSM_OK;
}

apsm_status fit_calibrate_scores(apsm_context *ctx, const double *P, apsm_fit_model *m)
{
    judging g = { .m = m, .P = P };
    APSM_TRY(apsm_fidelity_prior_fit(ctx, m->model.I, m->model.J, P, m->h,
                                     m->options.optimize.fidelity.fidelity_modes, NULL, &g.prior));
    if (g.prior.modes > m->model.modes) g.prior.modes = m->model.modes;
    m->calibration.modes = (double)g.prior.modes;
    m->calibration.reach = 1;
    const apsm_status status = judge_residuals(&g);
    apsm_fidelity_prior_free(&g.prior);
    return status;
}

apsm_status fit_calibrate(apsm_context *ctx, const double *P, apsm_fit_model *m)
{
    judging g = { .m = m, .P = P };
    APSM_TRY(apsm_fidelity_prior_fit(ctx, m->model.I, m->model.J, P, m->h,
                                     m->options.optimize.fidelity.fidelity_modes, NULL, &g.prior));
    if (g.prior.modes > m->model.modes) g.prior.modes = m->model.modes;
    const apsm_status status = judge(ctx, &g);
    apsm_fidelity_prior_free(&g.prior);
    free(g.result);
    return status;
}
