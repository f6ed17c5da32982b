/* Departures.  Points x_v of the template's surface are warped to shape i by its particles, y, and
 * by those that the others predict, y', r of (J3):
 *
 *   d0 = signed distance of y(p_i) from the surface / h
 *   d1 = signed distance of y(p_i - r_i) / h
 *   d2 = distance of the farthest vertex of the surface among those nearest to y(p_i), put on it /
 * h e_v = | d_v - usual d_v |, of d2 what is more than usual t_v = e_v / max(sqrt((s_v^2 + mean of
 * s over the points^2) / 2), .05),  s the usual e    (J4)
 */
#include "judge/depart.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/robust.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

enum { MOST_POINTS = 800, LEAST_PARTICLES = 12, OWN = 0, PREDICTED = 1, BEYOND = 2 };
static const double least_spread = 0.05; /* h */
static const double flat = 1e-6;         /* least over largest principal deviation */
/* Predictions err alike in all shapes, so that what stands out there counts for more. */
static const double counts = 1.3;
/* The others' worst parts, and how much their logarithms vary at least. */
static const double worst_usual = 0.75, least_deviation = 0.1;

/* ---- points ---- */

static bool is_flat(size_t J, const double *P)
{
    double c[3] = { 0 }, C[9] = { 0 }, U[9], s[3], V[9];
    for (size_t k = 0; k < 3 * J; k++) c[k % 3] += P[k] / (double)J;
    for (size_t k = 0; k < 9 * J; k++) {
        const double *p = P + 3 * (k / 9);
        const size_t a = k % 9 / 3, b = k % 3;
        C[k % 9] += (p[a] - c[a]) * (p[b] - c[b]);
    }
    apsm_svd3(C, U, s, V);
    return !(s[2] > flat * flat * s[0]);
}

static apsm_status take_points(apsm_context *ctx, const apsm_mesh *mesh, const double *P,
                               apsm_departs *d)
{
    const size_t step = (mesh->nv + MOST_POINTS - 1) / MOST_POINTS;
    d->n = mesh->nv / step;
    d->nearest = malloc(d->n * sizeof *d->nearest);
    double *X = malloc(3 * d->n * sizeof *X);
    apsm_status status = d->nearest && X ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t v = 0; v < d->n && status == APSM_OK; v++) {
        double least = INFINITY;
        memcpy(X + 3 * v, mesh->V + 3 * step * v, 3 * sizeof *X);
        for (size_t j = 0; j < d->J; j++) {
            const double d2 = vec3_distance2(X + 3 * v, P + 3 * j);
            if (d2 < least) least = d2, d->nearest[v] = (uint32_t)j;
        }
    }
    if (status == APSM_OK) status = apsm_warp_build(ctx, APSM_PHI_R, d->n, X, d->J, P, &d->warp);
    free(X);
    if (status != APSM_ERR_GEOMETRY) return status;
    d->n = 0; /* particles in few places, or nearly so: no warp, and nothing to look at */
    return APSM_OK;
}

apsm_status apsm_departs_make(apsm_context *ctx, const apsm_cohort *cohort, size_t J,
                              const double *P, apsm_departs *d)
{
    const size_t t = cohort->template_index, I = cohort->I;
    *d = (apsm_departs){ .I = I, .J = J };
    if (J < LEAST_PARTICLES || is_flat(J, P + 3 * J * t)) return APSM_OK;
    APSM_TRY(take_points(ctx, &cohort->shape[t].mesh, P + 3 * J * t, d));
    if (d->n == 0) return APSM_OK;
    const size_t all = I * d->n;
    double *x = malloc(((APSM_DEPART_LOOKS + 2) * all + 4 * I) * sizeof *x);
    d->found = calloc(I, sizeof *d->found);
    d->distance[0] = x;
    if (!x || !d->found) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < APSM_DEPART_LOOKS; k++) d->distance[k] = x + k * all;
    d->usual = x + APSM_DEPART_LOOKS * all;
    d->spread = d->usual + all;
    d->most = d->spread + all;
    d->scratch = d->most + I;
    return APSM_OK;
}

void apsm_departs_free(apsm_departs *d)
{
    apsm_warp_free(&d->warp);
    free(d->nearest);
    free(d->found);
    free(d->distance[0]);
    *d = (apsm_departs){ 0 };
}

/* ---- one shape ---- */

size_t apsm_depart_work_size(const apsm_departs *d)
{
    return 7 * d->n;
}

/* Where a surface ends there is no saying what lies beyond. */
static double signed_distance(const apsm_shape *shape, const double y[3], double x[3])
{
    apsm_closest c;
    double n[3], out[3];
    apsm_bvh_closest(shape->bvh, y, INFINITY, &c);
    memcpy(x, c.x, sizeof c.x);
    if (shape->rim.n > 0 && apsm_rim_has(&shape->rim, &shape->topology, &c.on)) return 0.0;
    apsm_surface_normal(&shape->mesh, shape->VN, &c.on, n);
    for (int a = 0; a < 3; a++) out[a] = y[a] - c.x[a];
    return copysign(sqrt(c.distance2), vec3_dot(out, n));
}

static int by_first(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The row of X (n x 4, by its first number; x, y, z and the point) nearest to p. */
static size_t nearest_row(size_t n, const double *X, const double *p)
{
    size_t lo = 0, hi = n, best = 0;
    double least = INFINITY;
    while (lo < hi) {
        const size_t middle = (lo + hi) / 2;
        if (X[4 * middle] < p[0])
            lo = middle + 1;
        else
            hi = middle;
    }
    for (size_t k = lo; k < n && (X[4 * k] - p[0]) * (X[4 * k] - p[0]) < least; k++) {
        const double d2 = vec3_distance2(X + 4 * k, p);
        if (d2 < least) least = d2, best = k;
    }
    for (size_t k = lo; k-- > 0 && (X[4 * k] - p[0]) * (X[4 * k] - p[0]) < least;) {
        const double d2 = vec3_distance2(X + 4 * k, p);
        if (d2 < least) least = d2, best = k;
    }
    return best;
}

/* far (n) <- how far the farthest vertex is of those nearest to each of the rows. */
static void reach_beyond(const apsm_mesh *mesh, size_t n, double *X, double h, double *far)
{
    qsort(X, n, 4 * sizeof *X, by_first);
    memset(far, 0, n * sizeof *far);
    for (size_t v = 0; v < mesh->nv; v++) {
        const double *p = mesh->V + 3 * v, *x = X + 4 * nearest_row(n, X, p);
        double *most = &far[(size_t)x[3]];
        *most = fmax(*most, sqrt(vec3_distance2(x, p)) / h);
    }
}

void apsm_depart_look(const apsm_departs *d, size_t i, const apsm_shape *shape, const double *P,
                      const double *predicted, double h, double *work)
{
    const size_t n = d->n;
    double *Y = work, *X = work + 3 * n, x[3];
    double *own = d->distance[OWN] + i * n, *said = d->distance[PREDICTED] + i * n;
    if (n == 0) return;
    apsm_warp_apply(&d->warp, predicted, Y);
    for (size_t v = 0; v < n; v++) said[v] = signed_distance(shape, Y + 3 * v, x) / h;
    apsm_warp_apply(&d->warp, P, Y);
    for (size_t v = 0; v < n; v++) {
        own[v] = signed_distance(shape, Y + 3 * v, X + 4 * v) / h;
        X[4 * v + 3] = (double)v;
    }
    reach_beyond(&shape->mesh, n, X, h, d->distance[BEYOND] + i * n);
}

/* ---- beside the others ---- */

/* The distances of look k become those from what is usual. */
static void leave_usual(apsm_departs *d, size_t k)
{
    double *x = d->distance[k];
    robust_left_out_medians(d->I, d->n, x, d->usual, d->scratch);
    for (size_t a = 0; a < d->I * d->n; a++) {
        const double more = x[a] - d->usual[a];
        x[a] = k == BEYOND ? fmax(more, 0.0) : fabs(more);
    }
    robust_left_out_medians(d->I, d->n, x, d->spread, d->scratch);
}

/* (J4) of shape i: where it is most. */
static void find_most(apsm_departs *d, size_t k, size_t i, double *where)
{
    const double *e = d->distance[k] + i * d->n, *s = d->spread + i * d->n;
    double level = 0.0, most = 1e-3;
    for (size_t v = 0; v < d->n; v++) level += s[v] / (double)d->n;
    apsm_departure *found = &d->found[i];
    *found = (apsm_departure){ 0 };
    for (size_t v = 0; v < d->n; v++) {
        const double t = e[v] / fmax(sqrt(0.5 * (s[v] * s[v] + level * level)), least_spread);
        const uint32_t j = d->nearest[v];
        where[j] = fmax(where[j], t);
        if (!(t > most)) continue;
        most = t;
        found->size = e[v];
        found->at = j;
    }
    d->most[i] = log(most);
}

void apsm_depart_compare(apsm_departs *d, size_t k, double *where)
{
    const size_t I = d->I;
    double *other = d->scratch, *excess = other + I, *scratch = excess + I;
    leave_usual(d, k);
    for (size_t i = 0; i < I; i++) find_most(d, k, i, where + d->J * i);
    robust_excesses(I, d->most, least_deviation, excess, other, scratch);
    robust_left_out_quantiles(I, d->most, worst_usual, other, scratch);
    for (size_t i = 0; i < I; i++) {
        d->found[i].excess = excess[i];
        d->found[i].times = (k == PREDICTED ? counts : 1.0) * exp(d->most[i] - other[i]);
    }
}
