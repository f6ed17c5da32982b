/* With X = [Z T] and Q an orthonormal basis of its columns, the first r of them spanning Z:
 *   e = (I - Q_Z Q_Z^T) Y                      residuals of the reduced model
 *   C = Q^T P e,  G = e^T e                    for an order P of the rows
 *   H = C_T^T C_T,  E = G - C^T C              since Y* = Z b + P e has them, whatever b is
 * (Freedman-Lane) so an order costs one product of a q x N by an N x Vw matrix, and G stays.  Q^T P
 * = (P^T Q)^T: rows of Q are dealt out, e stays.  Many orders make one matrix product.
 *
 * Leading columns of Q that are constant within blocks (the intercept, subjects that were measured
 * repeatedly) have C = 0 in all orders and are left out.
 *
 * Where errors are symmetric but vary by different amounts, signs of e are drawn in place of orders
 * (Winkler et al. 2014, 2.2: independent and symmetric errors): C = Q^T S e, G stays again. */
#include "statistics/permutation_test.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/linalg.h"
#include "statistics/orders.h"
#include "statistics/stopping.h"
#include "statistics/tfce.h"

enum { BATCH = 16, ROUND = 512, WIDEST = 3 };
static const double slack = 1e-9;

typedef struct testing {
    const apsm_permutation_input *in;
    const apsm_design *d;
    size_t skip, q, r_left; /* columns that are left out; those of the full and the reduced model
                               that are left */
    apsm_orders orders;
    size_t done, end; /* orders gone through; where this round ends */
    tfce_graph graph;
    double *e;    /* N x Vw */
    double *G;    /* V x w x w */
    double total; /* sum of the traces of G */
    apsm_permutation_result *r;
    struct worker {
        size_t *sigma;                /* 3 N: with work */
        double *sign;                 /* N */
        double *Q;                    /* BATCH q x N */
        double *C;                    /* BATCH q x Vw */
        double *statistic, *enhanced; /* V */
        tfce_work tfce;
        size_t ratio, *p, *familywise, *cluster; /* counts */
    } * worker;
    size_t workers;
} testing;

/* ---- the statistic of one order ---- */

/* Cholesky of the w x w matrix A (lower, in place); false if it is not positive definite, against
 * `size`, the trace that it is what is left of. */
static bool factor(size_t w, double *A, double size)
{
    for (size_t j = 0; j < w; j++)
        for (size_t i = j; i < w; i++) {
            double x = A[i * w + j];
            for (size_t k = 0; k < j; k++) x -= A[i * w + k] * A[j * w + k];
            if (i > j)
                A[i * w + j] = x / A[j * w + j];
            else if (x > 1e-14 * size)
                A[j * w + j] = sqrt(x);
            else
                return false;
        }
    return true;
}

/* trace(H E^-1) = sum over rows c of C_T of |L^-1 c|^2 with E = L L^T.  c (q rows, stride apart)
 * are the variable's; INFINITY where nothing is left. */
static double lawley_hotelling(const testing *t, size_t v, const double *C, double *h)
{
    const size_t w = t->in->w, q = t->q, stride = t->in->V * w;
    const double *G = t->G + v * w * w;
    double L[WIDEST * WIDEST], sum = 0, size = 0;
    memcpy(L, G, w * w * sizeof *L);
    for (size_t m = 0; m < w; m++) size += G[m * w + m];
    for (size_t k = 0; k < q; k++)
        for (size_t a = 0; a < w; a++)
            for (size_t b = 0; b <= a; b++) L[a * w + b] -= C[k * stride + a] * C[k * stride + b];
    for (size_t k = t->r_left; k < q; k++)
        for (size_t a = 0; a < w; a++) *h += C[k * stride + a] * C[k * stride + a];
    if (!factor(w, L, size)) return INFINITY;
    for (size_t k = t->r_left; k < q; k++) {
        double y[WIDEST];
        for (size_t a = 0; a < w; a++) {
            y[a] = C[k * stride + a];
            for (size_t b = 0; b < a; b++) y[a] -= L[a * w + b] * y[b];
            y[a] /= L[a * w + a];
            sum += y[a] * y[a];
        }
    }
    return sum;
}

/* Sum of squares that the reduced columns take up after the rows were dealt out. */
static double taken_by_reduced(const testing *t, const double *C)
{
    double sum = 0;
    const size_t n = t->r_left * t->in->V * t->in->w;
    for (size_t k = 0; k < n; k++) sum += C[k] * C[k];
    return sum;
}

/* statistic (V, out) of the order whose products are C; returns the ratio of all together. */
static double statistics(const testing *t, const double *C, double *statistic)
{
    double h = 0;
    for (size_t v = 0; v < t->in->V; v++)
        statistic[v] = lawley_hotelling(t, v, C + v * t->in->w, &h);
    const double left = t->total - taken_by_reduced(t, C) - h;
    return left > 0 ? h / left : INFINITY;
}

/* Order sigma, with signs, becomes number b of the batch. */
static void deal(const testing *t, size_t b, struct worker *k)
{
    const size_t N = t->d->N, q = t->q;
    for (size_t i = 0; i < N; i++) {
        const double *row = t->d->Q + k->sigma[i] * t->d->q + t->skip;
        for (size_t c = 0; c < q; c++) k->Q[(b * q + c) * N + i] = k->sign[i] * row[c];
    }
}

/* C of n orders from number `from` on. */
static void products(apsm_context *ctx, const testing *t, size_t from, size_t n, struct worker *k)
{
    const size_t N = t->d->N, width = t->in->V * t->in->w;
    for (size_t b = 0; b < n; b++) {
        if (t->in->unequal)
            apsm_orders_signs(N, apsm_context_seed(ctx), from + b, k->sign);
        else
            apsm_orders_get(&t->orders, apsm_context_seed(ctx), from + b, k->sigma, k->sigma + N);
        deal(t, b, k);
    }
    apsm_gemm(0, 0, n * t->q, width, N, 1, k->Q, N, t->e, width, 0, k->C, width);
}

static double largest(size_t n, const double *x)
{
    double most = 0;
    for (size_t k = 0; k < n; k++) most = fmax(most, x[k]);
    return most;
}

static bool reaches(double x, double given)
{
    return x >= given * (1 - slack);
}

static void enhance(const testing *t, struct worker *k, const double *statistic, double *out)
{
    /* the root of the trace is a distance, as t is: TFCE's own exponents are made for that */
    for (size_t v = 0; v < t->in->V; v++) k->statistic[v] = sqrt(fmin(statistic[v], 1e300));
    tfce_enhance(&t->graph, k->statistic, &k->tfce, out);
}

static void count(const testing *t, struct worker *k, double ratio)
{
    const apsm_permutation_result *r = t->r;
    const double most = largest(r->V, k->statistic);
    k->ratio += reaches(ratio, r->ratio);
    for (size_t v = 0; v < r->V; v++) {
        k->p[v] += reaches(k->statistic[v], r->statistic[v]);
        k->familywise[v] += reaches(most, r->statistic[v]);
    }
    if (!r->enhanced) return;
    enhance(t, k, k->statistic, k->enhanced);
    const double peak = largest(r->V, k->enhanced);
    for (size_t v = 0; v < r->V; v++) k->cluster[v] += reaches(peak, r->enhanced[v]);
}

static apsm_status run_batch(apsm_context *ctx, size_t batch, int worker, void *user)
{
    const testing *t = user;
    struct worker *k = &t->worker[worker];
    const size_t from = t->done + batch * BATCH, left = t->end - from;
    const size_t n = left < BATCH ? left : BATCH;
    products(ctx, t, from, n, k);
    for (size_t b = 0; b < n; b++) {
        const double ratio = statistics(t, k->C + b * t->q * t->in->V * t->in->w, k->statistic);
        count(t, k, ratio);
    }
    return APSM_OK;
}

/* ---- the given order ---- */

static void cross_products(testing *t)
{
    const size_t w = t->in->w, width = t->in->V * w;
    memset(t->G, 0, width * w * sizeof *t->G);
    for (size_t i = 0; i < t->d->N; i++)
        for (size_t v = 0; v < t->in->V; v++) {
            const double *e = t->e + i * width + v * w;
            for (size_t k = 0; k < w * w; k++) t->G[v * w * w + k] += e[k / w] * e[k % w];
        }
    t->total = 0;
    for (size_t v = 0; v < t->in->V; v++)
        for (size_t k = 0; k < w; k++) t->total += t->G[v * w * w + k * (w + 1)];
}

static apsm_status judge_given(apsm_context *ctx, testing *t)
{
    apsm_permutation_result *r = t->r;
    struct worker *k = &t->worker[0];
    const size_t w = t->in->w, width = t->in->V * w;
    apsm_gemm(1, 0, t->q, width, t->d->N, 1, t->d->Q + t->skip, t->d->q, t->e, width, 0, k->C,
              width);
    r->ratio = statistics(t, k->C, r->statistic);
    for (size_t v = 0; v < r->V; v++) {
        double h = 0, g = 0;
        if (!isfinite(lawley_hotelling(t, v, k->C + v * w, &h)))
            return apsm_fail(
                ctx, APSM_ERR_GEOMETRY,
                "variable %zu does not vary beyond what the formula explains; there is "
                "nothing to test against",
                v + 1);
        for (size_t a = 0; a < w; a++) g += t->G[v * w * w + a * (w + 1)];
        r->share[v] = h / g;
    }
    if (r->enhanced) enhance(t, k, r->statistic, r->enhanced);
    return APSM_OK;
}

/* ---- all ---- */

static bool is_constant_in_blocks(const apsm_design *d, const size_t *block, size_t column)
{
    for (size_t i = 1; i < d->N; i++) {
        size_t first = 0;
        while (block && block[first] != block[i]) first++;
        if (d->Q[i * d->q + column] != d->Q[first * d->q + column]) return false;
    }
    return true;
}

static void skip_constant_columns(testing *t)
{
    const apsm_design *d = t->d;
    while (!t->in->unequal && t->skip < d->r && is_constant_in_blocks(d, t->in->block, t->skip))
        t->skip++;
    t->q = d->q - t->skip;
    t->r_left = d->r - t->skip;
}

static apsm_status make_workers(apsm_context *ctx, testing *t)
{
    const size_t N = t->d->N, q = t->q, V = t->in->V, width = V * t->in->w;
    t->workers = (size_t)apsm_context_threads(ctx);
    t->worker = calloc(t->workers, sizeof *t->worker);
    for (size_t k = 0; t->worker && k < t->workers; k++) {
        struct worker *w = &t->worker[k];
        w->sigma = malloc(3 * N * sizeof *w->sigma);
        w->sign = malloc((N + 1) * sizeof *w->sign);
        w->Q = malloc(BATCH * q * N * sizeof *w->Q);
        w->C = malloc(BATCH * q * width * sizeof *w->C);
        w->statistic = malloc(2 * V * sizeof *w->statistic);
        w->p = calloc(3 * V, sizeof *w->p);
        w->tfce = tfce_work_make(V);
        if (!w->sigma || !w->sign || !w->Q || !w->C || !w->statistic || !w->p || !w->tfce.order)
            return APSM_ERR_MEMORY;
        for (size_t i = 0; i < N; i++) w->sigma[i] = i, w->sign[i] = 1;
        w->enhanced = w->statistic + V;
        w->familywise = w->p + V;
        w->cluster = w->p + 2 * V;
    }
    return t->worker ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status make_result(const apsm_permutation_input *in, apsm_permutation_result *r)
{
    const size_t n = (in->V + 1) * sizeof(double);
    *r = (apsm_permutation_result){ .V = in->V };
    r->statistic = malloc(n);
    r->p = malloc(n);
    r->p_familywise = malloc(n);
    r->q = malloc(n);
    r->share = malloc(n);
    if (!r->statistic || !r->p || !r->p_familywise || !r->q || !r->share) return APSM_ERR_MEMORY;
    if (in->neighbours == 0) return APSM_OK;
    r->enhanced = malloc(n);
    r->p_enhanced = malloc(n);
    return r->enhanced && r->p_enhanced ? APSM_OK : APSM_ERR_MEMORY;
}

void apsm_permutation_result_free(apsm_permutation_result *r)
{
    free(r->statistic);
    free(r->p);
    free(r->p_familywise);
    free(r->q);
    free(r->share);
    free(r->enhanced);
    free(r->p_enhanced);
    *r = (apsm_permutation_result){ 0 };
}

static void testing_free(testing *t)
{
    for (size_t k = 0; t->worker && k < t->workers; k++) {
        struct worker *w = &t->worker[k];
        free(w->sigma);
        free(w->sign);
        free(w->Q);
        free(w->C);
        free(w->statistic);
        free(w->p);
        tfce_work_free(&w->tfce);
    }
    free(t->worker);
    free(t->e);
    free(t->G);
    tfce_graph_free(&t->graph);
    apsm_orders_free(&t->orders);
}

/* Orders so far that reached the given one. */
typedef struct counted {
    size_t ratio, p, familywise, cluster;
} counted;

static counted sum_of_workers(const testing *t, size_t v)
{
    counted sum = { 0 };
    for (size_t k = 0; k < t->workers; k++) {
        sum.ratio += t->worker[k].ratio;
        sum.p += t->worker[k].p[v];
        sum.familywise += t->worker[k].familywise[v];
        sum.cluster += t->worker[k].cluster[v];
    }
    return sum;
}

/* Random orders do not have the given one among them: it is counted in. */
static void settle(testing *t)
{
    apsm_permutation_result *r = t->r;
    const size_t given = r->exact ? 0 : 1;
    const double n = (double)(r->permutations + given);
    r->p_ratio = (double)(sum_of_workers(t, 0).ratio + given) / n;
    r->p_error = r->exact ? 0 : sqrt(r->p_ratio * (1 - r->p_ratio) / n);
    for (size_t v = 0; v < r->V; v++) {
        const counted sum = sum_of_workers(t, v);
        r->p[v] = (double)(sum.p + given) / n;
        r->p_familywise[v] = (double)(sum.familywise + given) / n;
        if (r->p_enhanced) r->p_enhanced[v] = (double)(sum.cluster + given) / n;
    }
}

/* ---- ending early ---- */

/* Whether the side of every figure is known, each with its share of the risk. */
static apsm_status look(const testing *t, size_t *count, double *work, bool *decided)
{
    const apsm_permutation_input *in = t->in;
    const double risk = in->stop_risk / (double)(3 * in->V + 1);
    *decided = stopping_is_decided(sum_of_workers(t, 0).ratio, t->done, risk, in->level);
    for (size_t v = 0; v < in->V && *decided; v++) {
        const counted sum = sum_of_workers(t, v);
        count[v] = sum.p;
        *decided =
            stopping_is_decided(sum.familywise, t->done, risk, in->level) &&
            (!t->r->p_enhanced || stopping_is_decided(sum.cluster, t->done, risk, in->level));
    }
    if (!*decided) return APSM_OK;
    return stopping_rates_decided(in->V, count, t->done, risk, in->level, work, decided);
}

static apsm_status may_stop(testing *t, bool *decided)
{
    *decided = false;
    if (t->orders.exact || t->in->stop_risk <= 0 || t->done == t->orders.count) return APSM_OK;
    size_t *count = malloc(t->in->V * sizeof *count);
    double *work = malloc(4 * t->in->V * sizeof *work);
    const apsm_status status = count && work ? look(t, count, work, decided) : APSM_ERR_MEMORY;
    free(count);
    free(work);
    return status;
}

/* All orders in one go, or in rounds of which each may be the last: where they end does not depend
 * on the threads. */
static apsm_status go_through_orders(apsm_context *ctx, testing *t)
{
    const size_t round = t->in->stop_risk > 0 ? ROUND : t->orders.count;
    bool decided = false;
    while (t->done < t->orders.count && !decided) {
        const size_t left = t->orders.count - t->done;
        t->end = t->done + (round < left ? round : left);
        APSM_TRY(apsm_parallel_for(ctx, (t->end - t->done + BATCH - 1) / BATCH, run_batch, t,
                                   "permutations"));
        t->done = t->end;
        APSM_TRY(may_stop(t, &decided));
    }
    t->r->permutations = t->done;
    t->r->stopped = decided;
    return APSM_OK;
}

typedef struct ranked {
    double p;
    size_t v;
} ranked;

static int by_p(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    if (x->p != y->p) return x->p < y->p ? -1 : 1;
    return x->v < y->v ? -1 : x->v > y->v;
}

/* q of the k-th smallest p is the least n p / m of it and the larger ones. */
apsm_status apsm_false_discovery(size_t n, const double *p, double *q)
{
    double least = 1;
    ranked *order = malloc((n + 1) * sizeof *order);
    if (!order) return APSM_ERR_MEMORY;
    for (size_t v = 0; v < n; v++) order[v] = (ranked){ p[v], v };
    qsort(order, n, sizeof *order, by_p);
    for (size_t k = n; k-- > 0;) {
        least = fmin(least, order[k].p * (double)n / (double)(k + 1));
        q[order[k].v] = least;
    }
    free(order);
    return APSM_OK;
}

static apsm_status test(apsm_context *ctx, testing *t)
{
    const apsm_permutation_input *in = t->in;
    const size_t N = t->d->N, width = in->V * in->w;
    t->e = malloc((N * width + 1) * sizeof *t->e);
    t->G = malloc((width * in->w + 1) * sizeof *t->G);
    if (!t->e || !t->G) return APSM_ERR_MEMORY;
    apsm_design_residuals(t->d, t->d->r, width, in->Y, t->e);
    cross_products(t);
    skip_constant_columns(t);
    APSM_TRY(make_workers(ctx, t));
    if (in->neighbours > 0) {
        t->graph = tfce_graph_make(in->V, in->neighbours, in->near);
        if (!t->graph.start) return APSM_ERR_MEMORY;
    }
    APSM_TRY(judge_given(ctx, t));
    if (in->unequal)
        t->orders.count = in->permutations;
    else
        APSM_TRY(apsm_orders_make(ctx, t->d, in->block, in->permutations, &t->orders));
    t->r->exact = t->orders.exact;
    APSM_TRY(go_through_orders(ctx, t));
    settle(t);
    return apsm_false_discovery(t->r->V, t->r->p, t->r->q);
}

apsm_status apsm_permutation_test(apsm_context *ctx, const apsm_permutation_input *input,
                                  apsm_permutation_result *result)
{
    testing t = { .in = input, .d = input->design, .r = result };
    *result = (apsm_permutation_result){ 0 };
    if (input->w < 1 || input->w > WIDEST || input->V == 0 || input->permutations == 0)
        return apsm_fail(ctx, APSM_ERR_ARG, "variables of 1 to 3 numbers and an order are needed");
    if (t.d->N < t.d->q + input->w)
        return apsm_fail(
            ctx, APSM_ERR_ARG,
            "%zu subjects are too few for a model with %zu coefficients of %zu numbers", t.d->N,
            t.d->q, input->w);
    apsm_status status = make_result(input, result);
    if (status == APSM_OK) status = test(ctx, &t);
    testing_free(&t);
    if (status != APSM_OK) apsm_permutation_result_free(result);
    return status;
}
