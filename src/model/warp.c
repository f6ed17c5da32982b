/* Warp by the polyharmonic interpolant with affine part ((1), (2) and "Metrics" of docs/method.md;
 * Bookstein, IEEE TPAMI 11, 1989, in space).  The interpolant is linear in its values, so the
 * positions of the warped vertices are W times the target's particles; an affine part makes W
 * reproduce the identity.  Particles that coincide are one centre, whose column is shared equally
 * among them. */
#include "model/warp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/hold.h"
#include "core/kernel.h"
#include "linalg/linalg.h"

enum { ROWS = 256, LEAST_CENTRES = 5 }; /* vertices of a task */
static const double COINCIDENT = 1e-9;  /* of the diagonal */

typedef struct builder {
    const double *X; /* n x 3: vertices */
    apsm_warp *warp;
    size_t n;         /* centres */
    size_t *centre;   /* J: which centre a particle belongs to */
    size_t *share;    /* n: particles of a centre */
    double *Q;        /* n x 3: centres */
    double *store;    /* of the factor */
    size_t work_size; /* of apsm_polyharmonic_map */
    double *work;     /* threads x work_size */
    double *row;      /* threads x ROWS x n, if centres are shared */
    apsm_polyharmonic f;
} builder;

static void builder_free(builder *b)
{
    free(b->centre);
    free(b->share);
    free(b->Q);
    free(b->store);
    free(b->work);
    free(b->row);
}

static double distance2(const double *a, const double *b)
{
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

static double diagonal2(size_t J, const double *P)
{
    double sum = 0.0;
    for (size_t a = 0; a < 3; a++) {
        double lo = P[a], hi = P[a];
        for (size_t j = 1; j < J; j++) {
            lo = fmin(lo, P[3 * j + a]);
            hi = fmax(hi, P[3 * j + a]);
        }
        sum += (hi - lo) * (hi - lo);
    }
    return sum;
}

/* Each particle goes to the first centre that is as good as at its place, else becomes one. */
static void make_centres(builder *b, size_t J, const double *P)
{
    const double near2 = COINCIDENT * COINCIDENT * diagonal2(J, P);
    b->n = 0;
    for (size_t j = 0; j < J; j++) {
        size_t c = 0;
        while (c < b->n && distance2(b->Q + 3 * c, P + 3 * j) > near2) c++;
        if (c == b->n) {
            memcpy(b->Q + 3 * c, P + 3 * j, 3 * sizeof *P);
            b->share[c] = 0;
            b->n++;
        }
        b->centre[j] = c;
        b->share[c]++;
    }
    for (size_t j = 0; j < J; j++) b->warp->merged += b->share[b->centre[j]] > 1;
}

static apsm_status fail_memory(apsm_context *ctx, const builder *b)
{
    return apsm_fail(ctx, APSM_ERR_MEMORY,
                     "out of memory for the warp of %zu vertices by %zu particles", b->warp->nv,
                     b->warp->J);
}

static apsm_status factor(apsm_phi phi, builder *b)
{
    b->store = malloc(apsm_polyharmonic_store_size(b->n, false) * sizeof *b->store);
    double *work = malloc(apsm_polyharmonic_factor_work_size(b->n) * sizeof *work);
    apsm_status status = APSM_ERR_MEMORY;
    if (b->store && work)
        status = apsm_polyharmonic_factor(phi, b->n, b->Q, false, 0.0, b->store, work, &b->f);
    free(work);
    return status;
}

static apsm_status map_rows(apsm_context *ctx, size_t task, int worker, void *user)
{
    (void)ctx;
    builder *b = user;
    const size_t J = b->warp->J, first = task * ROWS;
    const size_t rows = b->warp->nv - first < ROWS ? b->warp->nv - first : ROWS;
    double *W = b->warp->W + first * J, *work = b->work + (size_t)worker * b->work_size;
    if (!b->row) {
        apsm_polyharmonic_map(&b->f, b->Q, rows, b->X + 3 * first, W, work);
        return APSM_OK;
    }
    double *row = b->row + (size_t)worker * ROWS * b->n;
    apsm_polyharmonic_map(&b->f, b->Q, rows, b->X + 3 * first, row, work);
    for (size_t v = 0; v < rows; v++)
        for (size_t j = 0; j < J; j++) {
            const size_t c = b->centre[j];
            W[v * J + j] = row[v * b->n + c] / (double)b->share[c];
        }
    return APSM_OK;
}

/* Centres and their factor. */
static apsm_status prepare(apsm_context *ctx, apsm_phi phi, const double *P, builder *b)
{
    const size_t J = b->warp->J;
    if (b->warp->nv == 0 || J == 0 || !b->X || !P)
        return apsm_fail(ctx, APSM_ERR_ARG, "a warp needs vertices and particles");
    for (size_t k = 0; k < 3 * J; k++)
        if (!isfinite(P[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE, "particle %zu of the template is not finite",
                             k / 3);
    b->centre = malloc(J * sizeof *b->centre);
    b->share = malloc(J * sizeof *b->share);
    b->Q = malloc(3 * J * sizeof *b->Q);
    if (!b->centre || !b->share || !b->Q) return fail_memory(ctx, b);
    make_centres(b, J, P);
    if (b->n < LEAST_CENTRES)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                         "the template has %zu particles at different places: a warp needs %d",
                         b->n, LEAST_CENTRES);
    if (b->warp->merged > 0)
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%zu of the template's %zu particles coincide with another: the warp follows the "
                 "mean of each group",
                 b->warp->merged, J);
    const apsm_status status = factor(phi, b);
    if (status == APSM_ERR_SINGULAR)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                         "the template's particles lie in a plane or nearly coincide: no warp "
                         "through them exists");
    if (status != APSM_OK)
        return apsm_fail(ctx, status, "warp through %zu particles: %s", b->n,
                         apsm_status_text(status));
    return APSM_OK;
}

/* ---- as weights of the particles ---- */

static apsm_status build(apsm_context *ctx, apsm_phi phi, const double *P, builder *b)
{
    const size_t threads = (size_t)apsm_context_threads(ctx), n = b->warp->nv;
    APSM_TRY(prepare(ctx, phi, P, b));
    b->work_size = apsm_polyharmonic_solve_work_size(b->n, APSM_POLYHARMONIC_BLOCK);
    b->work = malloc(threads * b->work_size * sizeof *b->work);
    if (b->n < b->warp->J) b->row = malloc(threads * ROWS * b->n * sizeof *b->row);
    b->warp->W = malloc(n * b->warp->J * sizeof *b->warp->W);
    if (!b->work || !b->warp->W || (!b->row && b->n < b->warp->J)) return fail_memory(ctx, b);
    return apsm_parallel_for(ctx, (n + ROWS - 1) / ROWS, map_rows, b, "warp");
}

apsm_status apsm_warp_build(apsm_context *ctx, apsm_phi phi, size_t n, const double *X, size_t J,
                            const double *P, apsm_warp *warp)
{
    *warp = (apsm_warp){ .nv = n, .J = J };
    builder b = { .X = X, .warp = warp };
    const apsm_status status = build(ctx, phi, P, &b);
    builder_free(&b);
    if (status != APSM_OK) apsm_warp_free(warp);
    return status;
}

/* ---- shared ---- */

typedef struct apsm_shared_warp {
    size_t users;
    apsm_phi phi;
    double *X, *P; /* what it is of */
    apsm_warp warp;
} apsm_shared_warp;

static void release(void *object)
{
    apsm_shared_warp *s = object;
    if (--s->users > 0) return;
    free(s->X);
    free(s->P);
    free(s->warp.W);
    free(s);
}

static void lend(apsm_shared_warp *s, apsm_warp *warp)
{
    s->users++;
    *warp = s->warp;
    warp->lent = s;
}

static bool is_of(const apsm_shared_warp *s, apsm_phi phi, size_t n, const double *X, size_t J,
                  const double *P)
{
    return s->phi == phi && s->warp.nv == n && s->warp.J == J &&
           memcmp(s->X, X, 3 * n * sizeof *X) == 0 && memcmp(s->P, P, 3 * J * sizeof *P) == 0;
}

/* A new one, the caller its one user. */
static apsm_status make_shared(apsm_context *ctx, apsm_phi phi, const double *X, const double *P,
                               const apsm_warp *warp, apsm_shared_warp **made)
{
    const size_t n = 3 * warp->nv * sizeof *X, m = 3 * warp->J * sizeof *P;
    apsm_shared_warp *s = *made = calloc(1, sizeof *s);
    if (!s) return APSM_ERR_MEMORY;
    *s = (apsm_shared_warp){ .users = 1, .phi = phi, .X = malloc(n), .P = malloc(m) };
    if (!s->X || !s->P) return APSM_ERR_MEMORY;
    memcpy(s->X, X, n);
    memcpy(s->P, P, m);
    return apsm_warp_build(ctx, phi, warp->nv, X, warp->J, P, &s->warp);
}

apsm_status apsm_warp_share(apsm_context *ctx, apsm_phi phi, size_t n, const double *X, size_t J,
                            const double *P, apsm_warp *warp)
{
    *warp = (apsm_warp){ .nv = n, .J = J };
    apsm_shared_warp *s = apsm_held(ctx, release);
    if (s && X && P && is_of(s, phi, n, X, J, P)) {
        lend(s, warp);
        return APSM_OK;
    }
    if (n == 0 || J == 0 || !X || !P || !apsm_hold(ctx, NULL, NULL))
        return apsm_warp_build(ctx, phi, n, X, J, P, warp);
    const apsm_status status = make_shared(ctx, phi, X, P, warp, &s);
    if (status == APSM_OK) {
        lend(s, warp);
        apsm_hold(ctx, s, release);
    } else {
        if (s) release(s);
        *warp = (apsm_warp){ 0 };
    }
    return status;
}

/* ---- to few shapes ---- */

typedef struct carrying {
    const builder *b;
    apsm_interpolants f;
    double *w, *c; /* of f: three interpolants a shape */
    double *work;  /* of one thread: of the solution and, a block of points, of evaluation */
    size_t block;  /* of work */
    double *Y;
} carrying;

/* Values at the centres (n x 3I, out): means of the particles that they stand for. */
static void fill_values(const builder *b, size_t I, const double *Q, double *value)
{
    const size_t J = b->warp->J, m = 3 * I;
    memset(value, 0, b->n * m * sizeof *value);
    for (size_t i = 0; i < I; i++)
        for (size_t j = 0; j < J; j++)
            for (size_t a = 0; a < 3; a++)
                value[b->centre[j] * m + 3 * i + a] +=
                    Q[3 * (i * J + j) + a] / (double)b->share[b->centre[j]];
}

static apsm_status carry_rows(apsm_context *ctx, size_t task, int worker, void *user)
{
    (void)ctx;
    const carrying *t = user;
    const size_t nv = t->b->warp->nv, first = task * ROWS, m = t->f.m;
    const size_t rows = nv - first < ROWS ? nv - first : ROWS;
    double *work = t->work + (size_t)worker * t->block,
           *y = work + APSM_POLYHARMONIC_BLOCK * t->b->n;
    apsm_polyharmonic_eval_many(&t->f, rows, t->b->X + 3 * first, work, y);
    for (size_t v = 0; v < rows; v++)
        for (size_t i = 0; 3 * i < m; i++)
            memcpy(t->Y + 3 * (i * nv + first + v), y + v * m + 3 * i, 3 * sizeof *y);
    return APSM_OK;
}

static apsm_status carry(apsm_context *ctx, size_t I, const double *Q, carrying *t)
{
    const builder *b = t->b;
    const size_t n = b->n, m = 3 * I, threads = (size_t)apsm_context_threads(ctx);
    const size_t solve = apsm_polyharmonic_solve_work_size(n, m);
    t->block = APSM_POLYHARMONIC_BLOCK * n + ROWS * m;
    t->w = malloc(n * m * sizeof *t->w);
    t->c = malloc(4 * m * sizeof *t->c);
    t->work = malloc((threads * t->block > solve ? threads * t->block : solve) * sizeof *t->work);
    if (!t->w || !t->c || !t->work) return fail_memory(ctx, b);
    fill_values(b, I, Q, t->w);
    apsm_polyharmonic_solve(&b->f, m, t->w, NULL, t->w, t->c, t->work);
    t->f = (apsm_interpolants){ b->f.phi, n, m, b->Q, t->w, t->c };
    return apsm_parallel_for(ctx, (b->warp->nv + ROWS - 1) / ROWS, carry_rows, t, NULL);
}

apsm_status apsm_warp_to_shapes(apsm_context *ctx, size_t n, const double *X, size_t J,
                                const double *P, size_t I, const double *Q, double *Y)
{
    apsm_warp warp = { .nv = n, .J = J }; /* without W */
    builder b = { .X = X, .warp = &warp };
    carrying t = { .b = &b, .Y = Y };
    apsm_status status = prepare(ctx, APSM_PHI_R, P, &b);
    if (status == APSM_OK) status = carry(ctx, I, Q, &t);
    free(t.w);
    free(t.c);
    free(t.work);
    builder_free(&b);
    return status;
}

/* ---- its use ---- */

void apsm_warp_free(apsm_warp *warp)
{
    if (warp->lent)
        release(warp->lent);
    else
        free(warp->W);
    *warp = (apsm_warp){ 0 };
}

/* Weights are read once, in their order; CHUNK of them make a sum, SPAN columns of particles are at
 * hand in the nearest cache. */
enum { LANES = 8, CHUNK = 64, SPAN = 1024 };

/* Lanes are summed in one order on all machines. */
KERNEL_INLINE double dot_in_lanes(size_t n, const double *w, const double *x)
{
    double sum[LANES] = { 0 };
    size_t j = 0;
    for (; j + LANES <= n; j += LANES)
        for (size_t l = 0; l < LANES; l++) sum[l] += w[j + l] * x[j + l];
    for (; j < n; j++) sum[0] += w[j] * x[j];
    return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

/* (BLAS takes twice as long for three columns.) */
APSM_KERNEL void apsm_warp_apply(const apsm_warp *warp, const double *P, double *Y)
{
    const size_t J = warp->J;
    double x[3 * SPAN];
    memset(Y, 0, 3 * warp->nv * sizeof *Y);
    for (size_t first = 0; first < J; first += SPAN) {
        const size_t span = J - first < SPAN ? J - first : SPAN;
        for (size_t j = 0; j < span; j++)
            for (size_t c = 0; c < 3; c++) x[c * SPAN + j] = P[3 * (first + j) + c];
        for (size_t v = 0; v < warp->nv; v++)
            for (size_t j = 0; j < span; j += CHUNK) {
                const size_t n = span - j < CHUNK ? span - j : CHUNK;
                for (size_t c = 0; c < 3; c++)
                    Y[3 * v + c] += dot_in_lanes(n, warp->W + v * J + first + j, x + c * SPAN + j);
            }
    }
}

/* Three columns (SPAN apart) of moves times n (a multiple of LANES) weights, added to y. */
KERNEL_INLINE void add_moves(size_t n, const float *restrict w, const float *restrict x,
                             double y[3])
{
    float sum[3][LANES] = { { 0 } };
    for (size_t j = 0; j < n; j += LANES)
        for (size_t c = 0; c < 3; c++)
            for (size_t l = 0; l < LANES; l++) sum[c][l] += w[j + l] * x[c * SPAN + j + l];
    for (size_t c = 0; c < 3; c++)
        y[c] += (double)(((sum[c][0] + sum[c][4]) + (sum[c][1] + sum[c][5])) +
                         ((sum[c][2] + sum[c][6]) + (sum[c][3] + sum[c][7])));
}

APSM_KERNEL void apsm_warp_displace(size_t nv, size_t J, const float *W, const double *X,
                                    const double *D, double *Y)
{
    float x[3 * SPAN];
    memcpy(Y, X, 3 * nv * sizeof *Y);
    for (size_t first = 0; first < J; first += SPAN) {
        const size_t span = J - first < SPAN ? J - first : SPAN;
        for (size_t j = 0; j < span; j++)
            for (size_t c = 0; c < 3; c++) x[c * SPAN + j] = (float)D[3 * (first + j) + c];
        for (size_t v = 0; v < nv; v++) {
            const float *w = W + v * J + first;
            for (size_t j = 0; j < span; j += CHUNK) {
                const size_t n = span - j < CHUNK ? span - j : CHUNK, whole = n - n % LANES;
                add_moves(whole, w + j, x + j, Y + 3 * v);
                for (size_t k = j + whole; k < j + n; k++)
                    for (size_t c = 0; c < 3; c++) Y[3 * v + c] += (double)(w[k] * x[c * SPAN + k]);
            }
        }
    }
}
