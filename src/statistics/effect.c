#include "statistics/effect.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"
#include "linalg/linalg.h"

enum { WIDEST = 3, REDRAWS = 100 };

void apsm_effect_free(apsm_effect *e)
{
    free(e->effect);
    free(e->standardised);
    free(e->along);
    free(e->low);
    free(e->high);
    *e = (apsm_effect){ 0 };
}

static apsm_status allocate(const apsm_effect_input *in, apsm_effect *e)
{
    *e = (apsm_effect){ .V = in->V, .w = in->w };
    e->effect = malloc((in->V * in->w + 1) * sizeof(double));
    e->standardised = malloc((in->V + 1) * sizeof(double));
    e->along = malloc((in->V + 1) * sizeof(double));
    if (!e->effect || !e->standardised || !e->along) return APSM_ERR_MEMORY;
    if (in->bootstraps == 0) return APSM_OK;
    e->low = malloc((in->V + 1) * sizeof(double));
    e->high = malloc((in->V + 1) * sizeof(double));
    return e->low && e->high ? APSM_OK : APSM_ERR_MEMORY;
}

/* effect (V w, out) = c B_T of Y under a design. */
static apsm_status contrast_of(const apsm_effect_input *in, const apsm_design *d, const double *Y,
                               double *B, double *effect)
{
    const size_t n = in->V * in->w;
    APSM_TRY(apsm_design_fit(d, n, Y, B));
    memset(effect, 0, n * sizeof *effect);
    for (size_t k = d->r; k < d->q; k++)
        for (size_t x = 0; x < n; x++) effect[x] += in->contrast[k - d->r] * B[k * n + x];
    return APSM_OK;
}

static double along(const apsm_effect_input *in, const double *effect, size_t v)
{
    if (!in->direction) return effect[v];
    double sum = 0;
    for (size_t a = 0; a < in->w; a++) sum += in->direction[v * in->w + a] * effect[v * in->w + a];
    return sum;
}

/* sqrt(x^T S^-1 x) by Cholesky of the w x w matrix S (destroyed); INFINITY if singular. */
static double mahalanobis(size_t w, double *S, const double *x)
{
    double y[WIDEST], sum = 0;
    for (size_t i = 0; i < w; i++) {
        for (size_t j = 0; j <= i; j++) {
            double s = S[i * w + j];
            for (size_t k = 0; k < j; k++) s -= S[i * w + k] * S[j * w + k];
            if (i == j && !(s > 0)) return INFINITY;
            S[i * w + j] = i == j ? sqrt(s) : s / S[j * w + j];
        }
        y[i] = x[i];
        for (size_t k = 0; k < i; k++) y[i] -= S[i * w + k] * y[k];
        y[i] /= S[i * w + i];
        sum += y[i] * y[i];
    }
    return sqrt(sum);
}

static apsm_status standardise(const apsm_effect_input *in, apsm_effect *e)
{
    const apsm_design *d = in->design;
    const size_t w = in->w, width = in->V * w;
    double *left = malloc((d->N * width + 1) * sizeof *left);
    if (!left) return APSM_ERR_MEMORY;
    apsm_design_residuals(d, d->q, width, in->Y, left);
    for (size_t v = 0; v < in->V; v++) {
        double S[WIDEST * WIDEST] = { 0 };
        for (size_t i = 0; i < d->N; i++)
            for (size_t k = 0; k < w * w; k++)
                S[k] += left[i * width + v * w + k / w] * left[i * width + v * w + k % w] /
                        (double)(d->N - d->q);
        e->standardised[v] = mahalanobis(w, S, e->effect + v * w);
    }
    free(left);
    return APSM_OK;
}

/* ---- bootstrap ---- */

typedef struct drawing {
    const apsm_effect_input *in;
    double *drawn;          /* bootstraps x V: along the direction */
    size_t *member, *first; /* N, strata + 1: rows by stratum */
    size_t strata;
} drawing;

static void list_strata(const apsm_effect_input *in, drawing *g)
{
    size_t n = 0;
    for (size_t b = 0; n < in->design->N; b++) {
        g->first[b] = n;
        for (size_t i = 0; i < in->design->N; i++)
            if ((in->stratum ? in->stratum[i] : 0) == b) g->member[n++] = i;
        g->strata = b + 1;
    }
    g->first[g->strata] = n;
}

static void draw_rows(const drawing *g, uint64_t seed, size_t k, size_t again, size_t *row)
{
    apsm_random rng = apsm_random_stream(seed, APSM_STREAM_BOOTSTRAP, k, again);
    for (size_t b = 0; b < g->strata; b++)
        for (size_t m = g->first[b]; m < g->first[b + 1]; m++)
            row[m] =
                g->member[g->first[b] + apsm_random_below(&rng, g->first[b + 1] - g->first[b])];
}

/* The design and the shapes of the rows that were drawn. */
static apsm_status redraw(const drawing *g, const size_t *row, double *Z, double *T, double *Y,
                          apsm_design *design)
{
    const apsm_design *d = g->in->design;
    const size_t s = d->q - d->r, width = g->in->V * g->in->w;
    for (size_t i = 0; i < d->N; i++) {
        memcpy(Z + i * d->r, d->X + row[i] * d->q, d->r * sizeof *Z);
        memcpy(T + i * s, d->X + row[i] * d->q + d->r, s * sizeof *T);
        memcpy(Y + i * width, g->in->Y + row[i] * width, width * sizeof *Y);
    }
    return apsm_design_make(NULL, d->N, d->r, Z, s, T, design);
}

static apsm_status draw_one(apsm_context *ctx, const drawing *g, size_t k, double *memory,
                            size_t *row)
{
    const apsm_effect_input *in = g->in;
    const apsm_design *d = in->design;
    const size_t width = in->V * in->w;
    double *Y = memory, *B = Y + d->N * width, *effect = B + d->q * width, *Z = effect + width,
           *T = Z + d->N * d->r;
    apsm_design again = { 0 };
    apsm_status status = APSM_ERR_ARG;
    for (size_t attempt = 0; attempt < REDRAWS && status == APSM_ERR_ARG; attempt++) {
        draw_rows(g, apsm_context_seed(ctx), k, attempt, row);
        status = redraw(g, row, Z, T, Y, &again);
    }
    if (status == APSM_ERR_ARG)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "too few subjects for bootstrap bands; say "
                         "--bootstraps 0");
    if (status == APSM_OK) status = contrast_of(in, &again, Y, B, effect);
    for (size_t v = 0; status == APSM_OK && v < in->V; v++)
        g->drawn[k * in->V + v] = along(in, effect, v);
    apsm_design_free(&again);
    return status;
}

static apsm_status draw(apsm_context *ctx, size_t k, int worker, void *user)
{
    (void)worker;
    const drawing *g = user;
    const apsm_design *d = g->in->design;
    const size_t width = g->in->V * g->in->w;
    double *memory = malloc(((d->N + d->q + 1) * width + d->N * d->q + 1) * sizeof *memory);
    size_t *row = malloc((d->N + 1) * sizeof *row);
    const apsm_status status = memory && row ? draw_one(ctx, g, k, memory, row) : APSM_ERR_MEMORY;
    free(memory);
    free(row);
    return status;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

static void take_bands(const drawing *g, double *column, apsm_effect *e)
{
    const size_t n = g->in->bootstraps;
    const size_t cut = (size_t)(0.025 * (double)n);
    for (size_t v = 0; v < g->in->V; v++) {
        for (size_t k = 0; k < n; k++) column[k] = g->drawn[k * g->in->V + v];
        qsort(column, n, sizeof *column, by_size);
        e->low[v] = column[cut];
        e->high[v] = column[n - 1 - cut];
    }
}

static apsm_status bands(apsm_context *ctx, const apsm_effect_input *in, apsm_effect *e)
{
    drawing g = { .in = in };
    g.drawn = malloc((in->bootstraps * in->V + 1) * sizeof *g.drawn);
    g.member = malloc((in->design->N + 1) * sizeof *g.member);
    g.first = malloc((in->design->N + 2) * sizeof *g.first);
    double *column = malloc((in->bootstraps + 1) * sizeof *column);
    apsm_status status = g.drawn && g.member && g.first && column ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        list_strata(in, &g);
        status = apsm_parallel_for(ctx, in->bootstraps, draw, &g, "bootstraps");
    }
    if (status == APSM_OK) take_bands(&g, column, e);
    free(g.drawn);
    free(g.member);
    free(g.first);
    free(column);
    return status;
}

apsm_status apsm_effect_measure(apsm_context *ctx, const apsm_effect_input *input,
                                apsm_effect *effect)
{
    double *B = malloc((input->design->q * input->V * input->w + 1) * sizeof *B);
    apsm_status status = allocate(input, effect);
    if (!B) status = APSM_ERR_MEMORY;
    if (status == APSM_OK) status = contrast_of(input, input->design, input->Y, B, effect->effect);
    for (size_t v = 0; status == APSM_OK && v < input->V; v++)
        effect->along[v] = along(input, effect->effect, v);
    if (status == APSM_OK) status = standardise(input, effect);
    if (status == APSM_OK && input->bootstraps > 0) status = bands(ctx, input, effect);
    free(B);
    if (status != APSM_OK) apsm_effect_free(effect);
    return status;
}

/* The upper quantile of the normal distribution, by bisection of erfc. */
static double normal_quantile(double upper)
{
    double lo = -40, hi = 40;
    for (int k = 0; k < 200; k++) {
        const double x = 0.5 * (lo + hi);
        *(0.5 * erfc(x / sqrt(2)) > upper ? &lo : &hi) = x;
    }
    return lo;
}

double apsm_detectable_shift(size_t n1, size_t n2, double alpha, double power)
{
    if (n1 == 0 || n2 == 0) return INFINITY;
    return (normal_quantile(alpha / 2) + normal_quantile(1 - power)) *
           sqrt(1 / (double)n1 + 1 / (double)n2);
}
