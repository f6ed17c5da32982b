/* Specificity: distance of samples of the model to the nearest training shape (docs/method.md,
 * "Metrics").
 *
 * The samples of one draw are nested: x_m = x_{m-1} + b_m mode_m, so that one walk through the
 * modes serves all m.  A shape's distance D_n(x) = mean_j |x_j - p_nj| is a norm of x - p_n, hence
 *   D_n(x_m) >= D_n(x_a) - mean_j |x_m - x_a|_j >= D_n(x_a) - sqrt((S_m - S_a) / J)          (S1)
 * with S_m = sum_{l <= m} b_l^2 (modes are orthonormal; the mean is at most the root mean
 * square).  A shape is measured again only when (S1), from the step a where it was measured last,
 * no longer excludes it.  The result is that of measuring all. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "core/deal.h"
#include "core/random.h"
#include "evaluate/blocks.h"
#include "evaluate/metrics.h"
#include "linalg/linalg.h"

enum { CHUNK = 10 }; /* samples of a task: fixed, so that sums do not depend on threads */

/* Where the scores of a sample come from. */
typedef struct draws {
    const apsm_shape_model *model;
    const double *given; /* samples x modes, or NULL */
    apsm_definition definition;
    uint64_t seed;
} draws;

typedef struct scratch {
    double *x;        /* row: the sample's deviation from the mean */
    double *b;        /* modes: its scores */
    double *measured; /* I: D_n when last measured, times J */
    double *at;       /* I: S at that step */
} scratch;

typedef struct search {
    draws from;
    size_t samples, row, blocks;
    size_t modes;  /* largest m: those of the model, or fewer */
    double *mode;  /* all modes x row */
    double *shape; /* I x row: deviations of the training shapes */
    double *norm;  /* I: sum of their particles' lengths */
    double *mean;  /* chunks x modes: mean over a chunk's samples */
    double *sum2;  /* chunks x modes: sum of squared differences from it */
    scratch *worker;
    int threads;
} search;

static double standard_deviation(const draws *from, size_t k)
{
    const double variance = from->model->variance[k];
    if (from->definition != APSM_DEFINITION_SHAPEWORKS) return sqrt(variance);
    return sqrt(sqrt(variance * (double)(from->model->I - 1)));
}

static void draw(const draws *from, size_t sample, double *b)
{
    const size_t r = from->model->modes;
    if (from->given) {
        memcpy(b, from->given + sample * r, r * sizeof *b);
        return;
    }
    apsm_random rng = apsm_random_stream(from->seed, APSM_STREAM_SPECIFICITY, sample, 0);
    for (size_t k = 0; k < r; k++) {
        const double u = from->definition == APSM_DEFINITION_PAPER
                             ? 3.0 * (2.0 * apsm_random_uniform(&rng) - 1.0)
                             : apsm_random_normal(&rng);
        b[k] = u * standard_deviation(from, k);
    }
}

/* Can shape n be nearer than best?  (S1) in squares, with room for rounding. */
static inline int may_be_nearer(const scratch *w, size_t n, double best, double S, double J)
{
    const double gap = w->measured[n] * (1.0 - 1e-12) - best * (1.0 + 1e-12);
    return !(gap > 0.0 && gap * gap >= J * ((S - w->at[n]) + 1e-12 * S));
}

static double measure(const search *s, scratch *w, size_t n, double S)
{
    w->at[n] = S;
    return w->measured[n] = apsm_blocks_distance(s->blocks, w->x, s->shape + n * s->row);
}

/* The smallest sum of particle distances from w->x; *nearest (in: a guess, out) is the shape. */
static double nearest_shape(const search *s, scratch *w, double S, size_t *nearest)
{
    const size_t I = s->from.model->I, guess = *nearest;
    const double J = (double)s->from.model->J;
    double best = measure(s, w, guess, S);
    for (size_t n = 0; n < I; n++) {
        if (n == guess || !may_be_nearer(w, n, best, S, J)) continue;
        const double D = measure(s, w, n, S);
        if (D < best) {
            best = D;
            *nearest = n;
        }
    }
    return best;
}

/* Adds sample number `count` of a chunk (0-based) to its running means and squares (Welford). */
static void one_sample(const search *s, scratch *w, size_t sample, size_t count, double *mean,
                       double *sum2)
{
    const size_t I = s->from.model->I, r = s->modes;
    size_t nearest = 0;
    double S = 0.0;
    draw(&s->from, sample, w->b);
    memset(w->x, 0, s->row * sizeof *w->x);
    memset(w->at, 0, I * sizeof *w->at);
    memcpy(w->measured, s->norm, I * sizeof *w->measured);
    for (size_t m = 0; m < r; m++) {
        apsm_blocks_add(s->blocks, w->b[m], s->mode + m * s->row, w->x);
        S += w->b[m] * w->b[m];
        const double D = nearest_shape(s, w, S, &nearest) / (double)s->from.model->J;
        const double off = D - mean[m];
        mean[m] += off / (double)(count + 1);
        sum2[m] += off * (D - mean[m]);
    }
}

static apsm_status one_chunk(apsm_context *ctx, size_t chunk, int worker, void *user)
{
    (void)ctx;
    search *s = user;
    const size_t r = s->modes, first = chunk * CHUNK;
    const size_t n = s->samples - first < CHUNK ? s->samples - first : CHUNK;
    for (size_t k = 0; k < n; k++)
        one_sample(s, &s->worker[worker], first + k, k, s->mean + chunk * r, s->sum2 + chunk * r);
    return APSM_OK;
}

static size_t chunks_of(size_t samples)
{
    return (samples + CHUNK - 1) / CHUNK;
}

static apsm_status search_alloc(search *s)
{
    const size_t I = s->from.model->I, r = s->from.model->modes, chunks = chunks_of(s->samples);
    s->mode = malloc(r * s->row * sizeof *s->mode);
    s->shape = malloc(I * s->row * sizeof *s->shape);
    s->norm = malloc(I * sizeof *s->norm);
    s->mean = calloc(chunks * s->modes, sizeof *s->mean);
    s->sum2 = calloc(chunks * s->modes, sizeof *s->sum2);
    s->worker = calloc((size_t)s->threads, sizeof *s->worker);
    if (!s->mode || !s->shape || !s->norm || !s->mean || !s->sum2 || !s->worker)
        return APSM_ERR_MEMORY;
    for (int k = 0; k < s->threads; k++) {
        scratch *w = &s->worker[k];
        w->x = malloc(s->row * sizeof *w->x);
        w->b = malloc(r * sizeof *w->b);
        w->measured = malloc(I * sizeof *w->measured);
        w->at = malloc(I * sizeof *w->at);
        if (!w->x || !w->b || !w->measured || !w->at) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

static void search_free(search *s)
{
    for (int k = 0; s->worker && k < s->threads; k++) {
        free(s->worker[k].x);
        free(s->worker[k].b);
        free(s->worker[k].measured);
        free(s->worker[k].at);
    }
    free(s->worker);
    free(s->mode);
    free(s->shape);
    free(s->norm);
    free(s->mean);
    free(s->sum2);
}

static void fill(search *s)
{
    const apsm_shape_model *model = s->from.model;
    const size_t I = model->I, r = model->modes;
    for (size_t k = 0; k < r; k++)
        apsm_blocks_pack(model->J, model->mode + k * 3 * model->J, s->mode + k * s->row);
    apsm_gemm(0, 0, I, s->row, r, 1.0, model->score, r, s->mode, s->row, 0.0, s->shape, s->row);
    for (size_t n = 0; n < I; n++) s->norm[n] = apsm_blocks_norm(s->blocks, s->shape + n * s->row);
}

/* Puts the chunks' means and squares together in their order (Chan, Golub & LeVeque 1983). */
static void combine(const search *s, size_t M, double *specificity, double *error)
{
    const size_t r = s->modes;
    for (size_t m = 0; m < r; m++) {
        double n = 0.0, mean = 0.0, sum2 = 0.0;
        for (size_t c = 0; c < chunks_of(s->samples); c++) {
            const size_t left = s->samples - c * CHUNK;
            const double k = left < CHUNK ? (double)left : CHUNK;
            const double off = s->mean[c * r + m] - mean;
            mean += off * k / (n + k);
            sum2 += s->sum2[c * r + m] + off * off * n * k / (n + k);
            n += k;
        }
        specificity[m] = mean;
        if (error) error[m] = n > 1.0 ? sqrt(sum2 / (n * (n - 1.0))) : 0.0;
    }
    for (size_t m = r; m < M; m++) {
        specificity[m] = r ? specificity[r - 1] : 0.0;
        if (error) error[m] = r ? error[r - 1] : 0.0;
    }
}

/* The chunks, shared by the processes if there are several. */
static apsm_status walk_all(apsm_context *ctx, search *s)
{
    const size_t bytes = s->modes * sizeof(double);
    const apsm_shared_loop loop = { .kind = "specificity",
                                    .n = chunks_of(s->samples),
                                    .fn = one_chunk,
                                    .user = s,
                                    .stage = "specificity",
                                    .made = { { s->mean, bytes }, { s->sum2, bytes } } };
    return apsm_shared_for(ctx, &loop);
}

static apsm_status run(apsm_context *ctx, const draws *from, size_t samples, size_t modes,
                       double *specificity, double *error)
{
    search s = { .from = *from,
                 .samples = samples,
                 .modes = modes < from->model->modes ? modes : from->model->modes,
                 .row = apsm_blocks_row(from->model->J),
                 .threads = apsm_context_threads(ctx) };
    s.blocks = s.row / (3 * APSM_BLOCK);
    if (from->model->I < 2) return APSM_OK;
    apsm_status status = APSM_OK;
    if (s.modes > 0) {
        status = search_alloc(&s);
        if (status == APSM_OK) {
            fill(&s);
            status = walk_all(ctx, &s);
        } else {
            apsm_fail(ctx, status, "out of memory for the specificity of %zu shapes",
                      from->model->I);
        }
    }
    if (status == APSM_OK)
        combine(&s, modes < from->model->I - 1 ? modes : from->model->I - 1, specificity, error);
    search_free(&s);
    return status;
}

apsm_status apsm_specificity(apsm_context *ctx, const apsm_shape_model *model,
                             apsm_definition definition, size_t samples, size_t modes,
                             double *specificity, double *error)
{
    const draws from = { .model = model, .definition = definition, .seed = apsm_context_seed(ctx) };
    if (samples == 0) samples = apsm_definition_samples(definition);
    return run(ctx, &from, samples, modes, specificity, error);
}

apsm_status apsm_specificity_of(apsm_context *ctx, const apsm_shape_model *model, size_t samples,
                                const double *scores, double *specificity, double *error)
{
    const draws from = { .model = model, .given = scores };
    if (samples == 0 || !scores)
        return apsm_fail(ctx, APSM_ERR_ARG, "specificity needs at least one sample");
    return run(ctx, &from, samples, SIZE_MAX, specificity, error);
}
