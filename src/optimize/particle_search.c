/* The search for a number of particles: bracket it by adding particles, then halve the bracket.
 * Every trial is a whole fidelity stage, judged on the shapes left out. */
#include "optimize/particle_search.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "optimize/fidelity.h"
#include "optimize/fidelity_shape.h"
#include "optimize/reseat.h"

enum { EVERY = 4, LEAST_SHAPES = 6 };

/* Particles at a trial's begin and end. */
typedef struct trial {
    size_t J;
    double *begin, *end; /* I x J x 3 each, one array */
    double error;
} trial;

typedef struct search {
    const apsm_cohort *cohort;
    const apsm_optimize_options *o;
    bool *left_out; /* I */
    size_t *judged; /* the shapes left out */
    size_t n_judged, most, trials;
    double scale; /* of progress */
} search;

static void trial_free(trial *t)
{
    free(t->begin);
    *t = (trial){ 0 };
}

static apsm_status trial_alloc(const search *s, size_t J, trial *t)
{
    const size_t n = s->cohort->I * J * 3;
    *t = (trial){ .J = J, .begin = malloc(2 * n * sizeof *t->begin) };
    if (!t->begin) return APSM_ERR_MEMORY;
    t->end = t->begin + n;
    return APSM_OK;
}

/* ---- the error on the shapes left out ---- */

typedef struct judge_task {
    const search *s;
    const apsm_fidelity *f;
    const trial *t;
    fidelity_work *work;
    double *distance; /* n_judged */
} judge_task;

static apsm_status judge_shape(apsm_context *ctx, size_t k, int worker, void *user)
{
    (void)ctx;
    const judge_task *j = user;
    const size_t i = j->s->judged[k], D = 3 * j->t->J;
    fidelity_work *w = &j->work[worker];
    memcpy(w->a.P, j->t->end + i * D, D * sizeof *w->a.P);
    fidelity_measure(j->f, i, 0, &w->a, w);
    j->distance[k] = w->a.distance * apsm_fidelity_spacing(j->f);
    return APSM_OK;
}

/* Of the stage that has just been run, by all vertices. */
static apsm_status judge(apsm_context *ctx, const search *s, apsm_fidelity *f, trial *t)
{
    const size_t threads = (size_t)apsm_context_threads(ctx);
    judge_task j = { .s = s, .f = f, .t = t };
    j.work = calloc(threads, sizeof *j.work);
    j.distance = calloc(s->n_judged, sizeof *j.distance);
    apsm_status status = j.work && j.distance ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t k = 0; status == APSM_OK && k < threads; k++)
        status = fidelity_work_alloc(f, 0, &j.work[k]);
    f->o.fidelity_points = LONG_MAX; /* measured only: steps have no room for so many */
    if (status == APSM_OK) status = apsm_parallel_for(ctx, s->n_judged, judge_shape, &j, NULL);
    t->error = 0;
    for (size_t k = 0; status == APSM_OK && k < s->n_judged; k++)
        t->error += j.distance[k] / (double)s->n_judged;
    for (size_t k = 0; j.work && k < threads; k++) fidelity_work_free(&j.work[k]);
    free(j.work);
    free(j.distance);
    return status;
}

/* ---- a trial ---- */

static apsm_status run_and_judge(apsm_context *ctx, const search *s, trial *t)
{
    apsm_fidelity *f = NULL;
    apsm_fidelity_options o = s->o->fidelity;
    o.left_out = s->left_out;
    const double *T = t->begin + s->cohort->template_index * t->J * 3;
    memcpy(t->end, t->begin, s->cohort->I * t->J * 3 * sizeof *t->end);
    APSM_TRY(apsm_fidelity_new(ctx, s->cohort, t->J, T, &o, &f));
    apsm_status status = APSM_OK;
    for (long k = 0; status == APSM_OK && k < o.fidelity_rounds; k++) {
        apsm_fidelity_record r;
        status = apsm_fidelity_round(ctx, f, k, t->begin, t->end, &r);
        if (status == APSM_OK && apsm_interrupted(ctx)) status = APSM_ERR_INTERRUPTED;
    }
    if (status == APSM_OK) status = judge(ctx, s, f, t);
    apsm_fidelity_free(f);
    return status;
}

static apsm_status try_out(apsm_context *ctx, search *s, trial *t)
{
    APSM_TRY(run_and_judge(ctx, s, t));
    s->trials++;
    apsm_log(ctx, APSM_LOG_INFO, "%zu particles: %.4g on %zu shapes left out", t->J, t->error,
             s->n_judged);
    return APSM_OK;
}

/* J particles from where an earlier trial ended. */
static apsm_status grow(apsm_context *ctx, search *s, const trial *from, size_t J, trial *to)
{
    APSM_TRY(trial_alloc(s, J, to));
    APSM_TRY(apsm_reseat(ctx, s->cohort, from->J, from->end, s->left_out, s->o->schedule.adaptivity,
                         J, to->begin));
    return try_out(ctx, s, to);
}

/* ---- the search ---- */

/* The error falls about as 1 / J. */
static size_t next_number(const search *s, const trial *t)
{
    const double factor = fmin(fmax(1.05 * t->error / s->o->search.error, 1.1), 2);
    const size_t J = (size_t)ceil(factor * (double)t->J);
    return J < s->most ? J : s->most;
}

/* Adds particles until the error is met (`high`) or hope is lost (`high` as well, unmet). */
static apsm_status bracket(apsm_context *ctx, search *s, trial *low, trial *high)
{
    while (true) {
        APSM_TRY(grow(ctx, s, low, next_number(s, low), high));
        const double gain = 1 - high->error / low->error;
        const double more = (double)high->J / (double)low->J - 1;
        if (high->error <= s->o->search.error || high->J >= s->most || gain < 0.1 * more)
            return APSM_OK;
        trial_free(low);
        *low = *high;
        *high = (trial){ 0 };
    }
}

static apsm_status narrow(apsm_context *ctx, search *s, trial *low, trial *high)
{
    while (high->J - low->J > high->J / 16 + 1) {
        trial middle = { 0 };
        const apsm_status status = grow(ctx, s, low, (low->J + high->J) / 2, &middle);
        if (status != APSM_OK) {
            trial_free(&middle);
            return status;
        }
        trial *replaced = middle.error <= s->o->search.error ? high : low;
        trial_free(replaced);
        *replaced = middle;
    }
    return APSM_OK;
}

static apsm_status choose_left_out(apsm_context *ctx, search *s)
{
    const size_t I = s->cohort->I;
    if (I < LEAST_SHAPES)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "error = %g: %zu shapes are too few to leave some out; %d are needed, or "
                         "give the number of particles",
                         s->o->search.error, I, LEAST_SHAPES);
    s->left_out = calloc(I, sizeof *s->left_out);
    s->judged = malloc(I * sizeof *s->judged);
    if (!s->left_out || !s->judged) return APSM_ERR_MEMORY;
    for (size_t i = EVERY / 2; i < I; i += EVERY) {
        const size_t k = i == s->cohort->template_index ? i - 1 : i;
        s->left_out[k] = true;
        s->judged[s->n_judged++] = k;
    }
    return APSM_OK;
}

static apsm_status run(apsm_context *ctx, search *s, size_t J, const double *P, trial *low,
                       trial *high)
{
    APSM_TRY(choose_left_out(ctx, s));
    APSM_TRY(trial_alloc(s, J, low));
    memcpy(low->begin, P, s->cohort->I * J * 3 * sizeof *P);
    APSM_TRY(try_out(ctx, s, low));
    if (low->error <= s->o->search.error || J >= s->most) {
        *high = *low;
        *low = (trial){ 0 };
        return APSM_OK;
    }
    APSM_TRY(bracket(ctx, s, low, high));
    return high->error <= s->o->search.error ? narrow(ctx, s, low, high) : APSM_OK;
}

apsm_status apsm_search_particles(apsm_context *ctx, const apsm_cohort *cohort,
                                  const apsm_optimize_options *options, size_t J, const double *P,
                                  apsm_particle_search *result)
{
    search s = { .cohort = cohort,
                 .o = options,
                 .most = cohort->shape[cohort->template_index].mesh.nv / 4 };
    trial low = { 0 }, high = { 0 };
    *result = (apsm_particle_search){ 0 };
    const apsm_status status = run(ctx, &s, J, P, &low, &high);
    if (status == APSM_OK) {
        *result = (apsm_particle_search){ .J = high.J,
                                          .P = high.begin,
                                          .error = high.error,
                                          .met = high.error <= options->search.error,
                                          .left_out = s.n_judged,
                                          .trials = s.trials };
        high.begin = NULL; /* taken */
    }
    trial_free(&low);
    trial_free(&high);
    free(s.left_out);
    free(s.judged);
    return status;
}
