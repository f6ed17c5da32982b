/* Poses and starts first, at equal arc lengths: of a closed curve every start and both directions,
 * of an open one both directions, are tried against the template.  Then in rounds every curve is
 * matched elastically to the mean, and brought to it by what corresponds. */
#include "contour/contours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

enum { N = CONTOUR_POINTS, ROUNDS = 4 };

/* y <- curve x from its start-th point on, forward or back. */
static void reorder(const double *x, bool closed, size_t start, bool back, double *y)
{
    for (size_t k = 0; k < N; k++) {
        const size_t at = !closed ? (back ? N - 1 - k : k) : (start + (back ? N - k : k)) % N;
        memcpy(y + 3 * k, x + 3 * at, 3 * sizeof *y);
    }
}

/* M <- the best map of x to y; returns the mean squared distance. */
static double fit(const double *x, const double *y, int align, double M[16])
{
    double sum = 0, z[3];
    if (align == APSM_ALIGN_NONE)
        apsm_affine_identity(M);
    else
        apsm_affine_fit(N, x, y, NULL, align == APSM_ALIGN_SIMILARITY, M);
    for (size_t k = 0; k < N; k++) {
        apsm_affine_apply(M, 1, x + 3 * k, z);
        sum += vec3_distance2(z, y + 3 * k) / N;
    }
    return sum;
}

/* Curve q in place: begins and runs as the target does, and lies on it; M its map. */
static void lay(const double *target, bool closed, int align, double *q, double M[16])
{
    double x[3 * N], best_x[3 * N], best = INFINITY, try_M[16];
    memcpy(best_x, q, sizeof best_x);
    for (size_t start = 0; start < (closed ? N : 1); start++)
        for (int back = 0; back < 2; back++) {
            reorder(q, closed, start, back, x);
            const double residual = fit(x, target, align, try_M);
            if (!(residual < best * (1 - 1e-9))) continue;
            best = residual;
            memcpy(best_x, x, sizeof x);
            memcpy(M, try_M, sizeof try_M);
        }
    apsm_affine_apply(M, N, best_x, q);
}

static void find_mean(contour_cohort *c)
{
    memset(c->mean, 0, 3 * N * sizeof *c->mean);
    for (size_t i = 0; i < c->I; i++)
        for (size_t k = 0; k < N; k++) {
            double x[3];
            curve_at(N, c->Q + 3 * i * N, c->closed, c->gamma[i * N + k], x);
            vec3_add_scaled(c->mean + 3 * k, 1 / (double)c->I, x);
        }
}

/* One round: matched to the mean, and moved to it. */
static void match_all(contour_cohort *c, const contour_options *o, double *work)
{
    double x[3 * N], mean[3 * N], M[16];
    curve_resample(N, c->mean, c->closed, N, mean); /* its points are at equal lengths again */
    for (size_t i = 0; i < c->I; i++) {
        double *q = c->Q + 3 * i * N, *gamma = c->gamma + i * N;
        curve_match(N, mean, q, c->closed, gamma, work);
        for (size_t k = 0; k < N; k++) curve_at(N, q, c->closed, gamma[k], x + 3 * k);
        fit(x, mean, o->align, M);
        apsm_affine_apply(M, N, q, q);
        apsm_affine_multiply(M, c->M + 16 * i, c->M + 16 * i);
    }
    find_mean(c);
}

/* ---- other starts and directions ---- */

enum { NEAR = N / 16 }; /* starts nearer than this are the same, and matching finds the place */
static const double same_way = 20.0; /* degrees by which curves turn that came in one orientation */

/* The angle of M's rotation in degrees; M may scale. */
static double angle_of(const double M[16])
{
    const double scale = sqrt(M[0] * M[0] + M[4] * M[4] + M[8] * M[8]);
    const double c = ((M[0] + M[5] + M[10]) / scale - 1) / 2;
    return acos(fmax(-1, fmin(1, c))) * 180 / acos(-1);
}

static bool came_in_one_way(const contour_cohort *c)
{
    for (size_t i = 0; i < c->I; i++)
        if (angle_of(c->M + 16 * i) > same_way) return false;
    return true;
}

/* Of curve i against the mean.  Where all curves came in one orientation, only what keeps that
 * could be meant. */
static double rival_of(const contour_cohort *c, size_t i, const double *mean, int align, bool kept)
{
    double x[3 * N], M[16], whole[16], best = INFINITY;
    const double *q = c->Q + 3 * i * N;
    const double own = fit(q, mean, align, M);
    for (size_t start = 0; start < (c->closed ? N : 1); start++)
        for (int back = 0; back < 2; back++) {
            const bool near = start < NEAR || start > N - NEAR;
            if (!back && (near || !c->closed)) continue;
            reorder(q, c->closed, start, back, x);
            const double other = fit(x, mean, align, M);
            apsm_affine_multiply(M, c->M + 16 * i, whole);
            if (other < best && !(kept && angle_of(whole) > same_way)) best = other;
        }
    if (!(best > 0)) return 1; /* a circle, say */
    return own > 0 ? sqrt(best / own) : INFINITY;
}

static void find_rivals(contour_cohort *c, int align)
{
    double mean[3 * N];
    const bool kept = came_in_one_way(c);
    curve_resample(N, c->mean, c->closed, N, mean);
    for (size_t i = 0; i < c->I; i++) c->rival[i] = rival_of(c, i, mean, align, kept);
}

static void place_particles(contour_cohort *c, const contour_options *o)
{
    curve_places(N, c->mean, c->closed, o->adaptivity, c->J, c->t);
    for (size_t i = 0; i < c->I; i++)
        for (size_t j = 0; j < c->J; j++) {
            const double *gamma = c->gamma + i * N, t = c->t[j];
            const size_t a = t < N - 1 ? (size_t)t : N - 1;
            const double from = gamma[a], to = a + 1 < N   ? gamma[a + 1]
                                               : c->closed ? (double)N
                                                           : gamma[a];
            curve_at(N, c->Q + 3 * i * N, c->closed, from + (t - (double)a) * (to - from),
                     c->P + 3 * (i * c->J + j));
        }
}

static apsm_status make(const size_t *n, const double *const *P, const contour_options *o,
                        contour_cohort *c, double *work)
{
    const size_t t = o->template_index;
    for (size_t i = 0; i < c->I; i++) {
        if (!(curve_resample(n[i], P[i], c->closed, N, c->Q + 3 * i * N) > 0))
            return APSM_ERR_GEOMETRY;
        apsm_affine_identity(c->M + 16 * i);
    }
    double target[3 * N];
    memcpy(target, c->Q + 3 * t * N, sizeof target);
    if (o->align != APSM_ALIGN_NONE) { /* the world's origin is the template's centre */
        double centre[3] = { 0 };
        for (size_t k = 0; k < N; k++) vec3_add_scaled(centre, 1.0 / N, target + 3 * k);
        for (size_t k = 0; k < 3 * N; k++) target[k] -= centre[k % 3];
    }
    for (size_t i = 0; i < c->I; i++) {
        lay(target, c->closed, o->align, c->Q + 3 * i * N, c->M + 16 * i);
        for (size_t k = 0; k < N; k++) c->gamma[i * N + k] = (double)k;
    }
    find_mean(c);
    for (int r = 0; r < ROUNDS; r++) match_all(c, o, work);
    find_rivals(c, o->align);
    place_particles(c, o);
    return APSM_OK;
}

apsm_status contour_cohort_make(size_t I, const size_t *n, const double *const *P, bool closed,
                                const contour_options *o, contour_cohort *c)
{
    *c = (contour_cohort){ .I = I, .J = o->J, .closed = closed };
    c->M = malloc(16 * I * sizeof *c->M);
    c->Q = malloc(3 * I * N * sizeof *c->Q);
    c->gamma = malloc(I * N * sizeof *c->gamma);
    c->mean = malloc(3 * N * sizeof *c->mean);
    c->t = malloc(o->J * sizeof *c->t);
    c->P = malloc(3 * I * o->J * sizeof *c->P);
    c->rival = malloc(I * sizeof *c->rival);
    double *work = malloc(curve_match_size(N) * sizeof *work);
    apsm_status status = c->M && c->Q && c->gamma && c->mean && c->t && c->P && c->rival && work
                             ? make(n, P, o, c, work)
                             : APSM_ERR_MEMORY;
    free(work);
    if (status != APSM_OK) contour_cohort_free(c);
    return status;
}

void contour_cohort_free(contour_cohort *c)
{
    free(c->M);
    free(c->Q);
    free(c->gamma);
    free(c->mean);
    free(c->t);
    free(c->P);
    free(c->rival);
    *c = (contour_cohort){ 0 };
}

/* d <- where particle j is, less where the mean has it. */
static void displacement(const contour_cohort *c, const double *p, size_t j, double d[3])
{
    double x[3];
    curve_at(N, c->mean, c->closed, c->t[j], x);
    vec3_sub(p + 3 * j, x, d);
}

void contour_rebuild(const contour_cohort *c, const double *p, double *X)
{
    size_t j = 0;
    for (size_t k = 0; k < N; k++) {
        double a[3], b[3], t = (double)k;
        while (j + 1 < c->J && c->t[j + 1] <= t) j++;
        const size_t next = j + 1 < c->J ? j + 1 : c->closed ? 0 : j;
        const double end = next == 0 ? (double)N + c->t[0] : c->t[next], width = end - c->t[j];
        const double u = width > 0 ? (t - c->t[j]) / width : 0;
        displacement(c, p, j, a);
        displacement(c, p, next, b);
        for (size_t x = 0; x < 3; x++)
            X[3 * k + x] = c->mean[3 * k + x] + (1 - u) * a[x] + u * b[x];
    }
}
