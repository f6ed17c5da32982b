/* Warp by the polyharmonic interpolant with affine part ((1), (2) and "Metrics" of docs/method.md;
 * Bookstein, IEEE TPAMI 11, 1989, in space).  The interpolant is linear in its values, so the
 * positions of the warped vertices are W times the target's particles; an affine part makes W
 * reproduce the identity.  Particles that coincide are one centre, whose column is shared equally
 * among them. */
#include "model/warp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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

static apsm_status factor(apsm_context *ctx, apsm_phi phi, builder *b)
{
    const size_t threads = (size_t)apsm_context_threads(ctx);
    b->work_size = apsm_polyharmonic_solve_work_size(b->n, APSM_POLYHARMONIC_BLOCK);
    b->store = malloc(apsm_polyharmonic_store_size(b->n, false) * sizeof *b->store);
    b->work = malloc(threads * b->work_size * sizeof *b->work);
    if (b->n < b->warp->J) b->row = malloc(threads * ROWS * b->n * sizeof *b->row);
    double *work = malloc(apsm_polyharmonic_factor_work_size(b->n) * sizeof *work);
    apsm_status status = APSM_ERR_MEMORY;
    if (b->store && b->work && work && (b->row || b->n == b->warp->J))
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

static apsm_status build(apsm_context *ctx, apsm_phi phi, const double *P, builder *b)
{
    const size_t J = b->warp->J, n = b->warp->nv;
    b->centre = malloc(J * sizeof *b->centre);
    b->share = malloc(J * sizeof *b->share);
    b->Q = malloc(3 * J * sizeof *b->Q);
    b->warp->W = malloc(n * J * sizeof *b->warp->W);
    if (!b->centre || !b->share || !b->Q || !b->warp->W)
        return apsm_fail(ctx, APSM_ERR_MEMORY,
                         "out of memory for the warp of %zu vertices by %zu particles", n, J);
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
    const apsm_status status = factor(ctx, phi, b);
    if (status == APSM_ERR_SINGULAR)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                         "the template's particles lie in a plane or nearly coincide: no warp "
                         "through them exists");
    if (status != APSM_OK)
        return apsm_fail(ctx, status, "warp through %zu particles: %s", b->n,
                         apsm_status_text(status));
    return apsm_parallel_for(ctx, (n + ROWS - 1) / ROWS, map_rows, b, "warp");
}

apsm_status apsm_warp_build(apsm_context *ctx, apsm_phi phi, size_t n, const double *X, size_t J,
                            const double *P, apsm_warp *warp)
{
    *warp = (apsm_warp){ .nv = n, .J = J };
    if (n == 0 || J == 0 || !X || !P)
        return apsm_fail(ctx, APSM_ERR_ARG, "a warp needs vertices and particles");
    for (size_t k = 0; k < 3 * J; k++)
        if (!isfinite(P[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE, "particle %zu of the template is not finite",
                             k / 3);
    builder b = { .X = X, .warp = warp };
    const apsm_status status = build(ctx, phi, P, &b);
    builder_free(&b);
    if (status != APSM_OK) apsm_warp_free(warp);
    return status;
}

void apsm_warp_free(apsm_warp *warp)
{
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
