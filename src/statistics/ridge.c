/* With K = Xc Xc' = Q diag(w) Q' and H = 11'/N + Q diag(w / (w + l)) Q', the prediction of shape i
 * by the model of all is (H y)_i, and by that of the others y_i - (y_i - (H y)_i) / (1 - H_ii),
 * exactly but for the mean, which is taken as known. */
#include "statistics/ridge.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"
#include "linalg/linalg.h"

enum { PENALTIES = 28, PER_DECADE = 3 };
static const double least_penalty = 1e-4;

typedef struct dual {
    size_t N;
    double *w, *Q; /* N; N x N, rows are vectors */
    double *c;     /* N: Q (y - mean) */
    double trace;  /* mean eigenvalue */
} dual;

void ridge_free(ridge *model)
{
    free(model->x_mean);
    free(model->slope);
    *model = (ridge){ 0 };
}

static void centre(size_t N, size_t V, double *X, double *mean)
{
    memset(mean, 0, V * sizeof *mean);
    for (size_t i = 0; i < N; i++)
        for (size_t v = 0; v < V; v++) mean[v] += X[i * V + v] / (double)N;
    for (size_t i = 0; i < N; i++)
        for (size_t v = 0; v < V; v++) X[i * V + v] -= mean[v];
}

/* Mean square error of shapes left out, with the penalty l. */
static double left_out_error(const dual *d, const double *y, double l)
{
    double sum = 0;
    for (size_t i = 0; i < d->N; i++) {
        double fit = 0, h = 1 / (double)d->N;
        for (size_t k = 0; k < d->N; k++) {
            const double q = d->Q[k * d->N + i], s = d->w[k] / (d->w[k] + l);
            fit += q * s * d->c[k];
            h += q * q * s;
        }
        const double e = (y[i] - fit) / fmax(1 - h, 1e-12);
        sum += e * e;
    }
    return sum / (double)d->N;
}

static double choose_penalty(const dual *d, const double *y)
{
    double best = INFINITY, chosen = 0;
    for (size_t k = 0; k < PENALTIES; k++) {
        const double l = d->trace * least_penalty * pow(10, (double)k / PER_DECADE);
        const double error = left_out_error(d, y, l);
        if (error < best) best = error, chosen = l;
    }
    return chosen;
}

static apsm_status decompose(const double *X, size_t V, const double *y, dual *d)
{
    const size_t N = d->N;
    double *K = malloc(N * N * sizeof *K);
    d->w = malloc(2 * N * sizeof *d->w);
    d->Q = malloc(N * N * sizeof *d->Q);
    if (!K || !d->w || !d->Q) {
        free(K);
        return APSM_ERR_MEMORY;
    }
    d->c = d->w + N;
    apsm_gram(N, V, 1, X, K);
    const apsm_status status = apsm_symmetric_eigen(N, K, d->w, d->Q);
    free(K);
    APSM_TRY(status);
    for (size_t k = 0; k < N; k++) {
        d->w[k] = fmax(d->w[k], 0);
        d->trace += d->w[k] / (double)N;
        d->c[k] = 0;
        for (size_t i = 0; i < N; i++) d->c[k] += d->Q[k * N + i] * y[i];
    }
    return APSM_OK;
}

/* alpha = Q' diag(1 / (w + l)) c, and the slope of it. */
static void make_slope(const dual *d, const double *X, double l, ridge *m)
{
    memset(m->slope, 0, m->V * sizeof *m->slope);
    for (size_t i = 0; i < d->N; i++) {
        double alpha = 0;
        for (size_t k = 0; k < d->N; k++) alpha += d->Q[k * d->N + i] * d->c[k] / (d->w[k] + l);
        for (size_t v = 0; v < m->V; v++) m->slope[v] += alpha * X[i * m->V + v];
    }
}

/* X and y are centred in place. */
static apsm_status fit_centred(double *X, double *y, ridge *m)
{
    dual d = { .N = m->N };
    m->y_mean = 0;
    for (size_t i = 0; i < m->N; i++) m->y_mean += y[i] / (double)m->N;
    for (size_t i = 0; i < m->N; i++) y[i] -= m->y_mean;
    centre(m->N, m->V, X, m->x_mean);
    const apsm_status status = decompose(X, m->V, y, &d);
    if (status == APSM_OK && d.trace > 0) {
        const double l = choose_penalty(&d, y);
        m->lambda = l / d.trace;
        make_slope(&d, X, l, m);
    }
    free(d.w);
    free(d.Q);
    return status;
}

/* Of the n rows `row` of X and y. */
static apsm_status fit_rows(size_t n, const size_t *row, size_t V, const double *X, const double *y,
                            ridge *m)
{
    *m = (ridge){
        .N = n, .V = V, .x_mean = calloc(V, sizeof(double)), .slope = calloc(V, sizeof(double))
    };
    double *x = malloc((n * V + n) * sizeof *x);
    apsm_status status = m->x_mean && m->slope && x ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        for (size_t k = 0; k < n; k++) {
            memcpy(x + k * V, X + row[k] * V, V * sizeof *x);
            x[n * V + k] = y[row[k]];
        }
        status = fit_centred(x, x + n * V, m);
    }
    free(x);
    if (status != APSM_OK) ridge_free(m);
    return status;
}

apsm_status ridge_fit(apsm_context *ctx, size_t N, size_t V, const double *X, const double *y,
                      ridge *model)
{
    if (N < 4) return apsm_fail(ctx, APSM_ERR_ARG, "%zu shapes are too few to learn from", N);
    size_t *row = malloc(N * sizeof *row);
    if (!row) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < N; i++) row[i] = i;
    const apsm_status status = fit_rows(N, row, V, X, y, model);
    free(row);
    return status;
}

double ridge_predict(const ridge *m, const double *x)
{
    double sum = m->y_mean;
    for (size_t v = 0; v < m->V; v++) sum += m->slope[v] * (x[v] - m->x_mean[v]);
    return sum;
}

typedef struct validating {
    size_t N, V, folds;
    const double *X, *y;
    const size_t *order;
    double *predicted;
} validating;

static apsm_status run_fold(apsm_context *ctx, size_t f, int worker, void *user)
{
    (void)ctx, (void)worker;
    const validating *c = user;
    ridge m = { 0 };
    size_t *row = malloc(c->N * sizeof *row), n = 0;
    if (!row) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < c->N; i++)
        if (c->order[i] % c->folds != f) row[n++] = i;
    const apsm_status status = fit_rows(n, row, c->V, c->X, c->y, &m);
    for (size_t i = 0; i < c->N && status == APSM_OK; i++)
        if (c->order[i] % c->folds == f) c->predicted[i] = ridge_predict(&m, c->X + i * c->V);
    ridge_free(&m);
    free(row);
    return status;
}

apsm_status ridge_cross_validate(apsm_context *ctx, size_t N, size_t V, const double *X,
                                 const double *y, size_t folds, double *predicted)
{
    apsm_random rng = apsm_random_stream(apsm_context_seed(ctx), APSM_STREAM_BOOTSTRAP, 0, 2);
    size_t *order = malloc(N * sizeof *order);
    if (!order) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < N; i++) order[i] = i;
    for (size_t i = 0; i < N; i++) {
        const size_t other = i + (size_t)apsm_random_below(&rng, N - i), swap = order[i];
        order[i] = order[other];
        order[other] = swap;
    }
    validating c = { N, V, folds < N ? folds : N, X, y, order, predicted };
    const apsm_status status = apsm_parallel_for(ctx, c.folds, run_fold, &c, NULL);
    free(order);
    return status;
}
