/* The inner loops of the sampling loss in single precision; docs/method.md, (3), (7).
 *
 * Weights are wrong by about 2e-6 of the largest, rounding and cut alike; the mean over a
 * particle's points is known to some per cent only (R/J = 16 points, drawn anew every epoch).
 *
 * A group of points lies about m, the farthest of them rho away.  While no kmin is greater than
 * `bound`, every point's nearest particle is within rho + bound of m, which gives kmin; and all
 * that matter to any of the points are within max over points (kmin + |x - m|) + reach of m.  These
 * near ones, eight at a time, meet the group's points one by one: sums over points are then sums of
 * vectors.  What is done to a pair is done in several short loops over all pairs, because in one
 * loop every pair would be a chain of some thirty operations that wait for each other. */
#include "optimize/sampling_patch.h"

#include <math.h>
#include <string.h>

#include "core/exp.h"
#include "core/kernel.h"

enum { LANES = SAMPLING_LANES, GROUP = SAMPLING_GROUP };

static const float LN2 = 0x1.62e430p-1f, SLACK = 1.00001f; /* of bounds, for rounding */

static size_t whole_lanes(size_t n)
{
    return (n + LANES - 1) / LANES * LANES;
}

size_t sampling_patch_lay_out(size_t J, sampling_patch *s, double *work)
{
    const size_t n = whole_lanes(J);
    if (work) {
        float *next = (float *)work;
        s->k = next;
        s->behind = s->k + n * GROUP;
        s->e = s->behind + n * GROUP;
        s->grad = (float(*)[4])(s->e + n * GROUP);
        next = s->e + n * GROUP + 4 * n;
        for (size_t a = 0; a < 3; a++, next += n) s->p[a] = next;
        for (size_t a = 0; a < 3; a++, next += n) s->q[a] = next;
        s->d2 = next;
        s->first = (uint32_t *)(next + n);
        s->near = s->first + n;
    }
    return n * (3 * GROUP + 13) / 2 + 1;
}

/* One group. */
typedef struct group {
    size_t count;
    float x[3][GROUP], away[GROUP]; /* points, their distances from the centre */
    float m[3], rho;                /* centre, the farthest point's distance from it */
    float kmin[GROUP];
    float weight[GROUP], turned[GROUP]; /* of e and of u in the force, see share_out */
    float mass[GROUP];
} group;

/* The centre of the points' box, and their distances from it. */
KERNEL_INLINE void surround(group *restrict g)
{
    for (size_t a = 0; a < 3; a++) {
        float lo = INFINITY, hi = -INFINITY;
#pragma omp simd reduction(min : lo) reduction(max : hi)
        for (size_t q = 0; q < GROUP; q++) {
            lo = g->x[a][q] < lo ? g->x[a][q] : lo;
            hi = g->x[a][q] > hi ? g->x[a][q] : hi;
        }
        g->m[a] = lo + 0.5f * (hi - lo);
    }
    float rho = 0.0f;
#pragma omp simd reduction(max : rho)
    for (size_t q = 0; q < GROUP; q++) {
        const float a = g->x[0][q] - g->m[0], b = g->x[1][q] - g->m[1], c = g->x[2][q] - g->m[2];
        const float r = sqrtf(a * a + b * b + c * c);
        g->away[q] = r;
        rho = r > rho ? r : rho;
    }
    g->rho = rho;
}

/* Squared distances of n particles from m. */
KERNEL_INLINE void measure(size_t n, const float *restrict x, const float *restrict y,
                           const float *restrict z, const float m[3], float *restrict d2)
{
    const float a = m[0], b = m[1], c = m[2];
#pragma omp simd
    for (size_t i = 0; i < n; i++) {
        const float dx = x[i] - a, dy = y[i] - b, dz = z[i] - c;
        d2[i] = dx * dx + dy * dy + dz * dz;
    }
}

/* Which of n are within `limit`; returns their number. */
KERNEL_INLINE size_t pick(size_t n, const float *restrict d2, float limit, uint32_t *restrict to)
{
    const float limit2 = limit * limit;
    size_t picked = 0;
    for (size_t i = 0; i < n; i++) {
        to[picked] = (uint32_t)i;
        picked += d2[i] <= limit2;
    }
    return picked;
}

/* kmin of the points, from the n listed particles. */
KERNEL_INLINE void find_kmin(const sampling_patch *s, size_t n, const float x[restrict 3][GROUP],
                             float *restrict kmin)
{
    for (size_t q = 0; q < GROUP; q++) kmin[q] = INFINITY;
    for (size_t i = 0; i < n; i++) {
        const size_t j = s->first[i];
        const float a = s->p[0][j], b = s->p[1][j], c = s->p[2][j];
#pragma omp simd
        for (size_t q = 0; q < GROUP; q++) {
            const float dx = a - x[0][q], dy = b - x[1][q], dz = c - x[2][q];
            const float d = dx * dx + dy * dy + dz * dz;
            kmin[q] = d < kmin[q] ? d : kmin[q];
        }
    }
    for (size_t q = 0; q < GROUP; q++) kmin[q] = sqrtf(kmin[q]);
}

KERNEL_INLINE float greatest(const float v[GROUP])
{
    float most = v[0];
    for (size_t q = 1; q < GROUP; q++) most = v[q] > most ? v[q] : most;
    return most;
}

/* Lists in s->near, and copies to s->q, the particles that matter; returns their number.  The last
 * lanes are filled up with particles too far away to have a weight. */
KERNEL_INLINE size_t gather(const sampling_patch *s, group *restrict g)
{
    float far[GROUP];
    measure(s->found, s->p[0], s->p[1], s->p[2], g->m, s->d2);
    const size_t few = pick(s->found, s->d2, SLACK * (g->rho + s->bound), s->first);
    find_kmin(s, few, (const float(*)[GROUP])g->x, g->kmin);
    for (size_t q = 0; q < GROUP; q++) far[q] = g->kmin[q] + g->away[q];
    const float limit = SLACK * (greatest(far) + s->reach);
    const size_t near = pick(s->found, s->d2, limit, s->near);
    for (size_t a = 0; a < 3; a++) {
        const float *restrict p = s->p[a], beyond = a == 0 ? g->m[0] + limit + 64.0f : g->m[a];
        float *restrict q = s->q[a];
        for (size_t i = 0; i < near; i++) q[i] = p[s->near[i]];
        for (size_t i = near; i % LANES > 0; i++) q[i] = beyond;
    }
    return near;
}

KERNEL_INLINE float sum_lanes(const float v[LANES])
{
    return ((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7]));
}

/* Distances k of a point from n near particles, never 0, and kmin - k. */
KERNEL_INLINE void find_distances(const sampling_patch *s, size_t n, const group *g, size_t q)
{
    const float *restrict x = s->q[0], *restrict y = s->q[1], *restrict z = s->q[2];
    float *restrict k = s->k + q * n, *restrict behind = s->behind + q * n;
    const float a = g->x[0][q], b = g->x[1][q], c = g->x[2][q], kmin = g->kmin[q];
#pragma omp simd
    for (size_t i = 0; i < n; i++) {
        const float dx = x[i] - a, dy = y[i] - b, dz = z[i] - c;
        const float r = sqrtf(dx * dx + dy * dy + (dz * dz + 1e-30f));
        k[i] = r;
        behind[i] = kmin - r;
    }
}

/* The weights e of (3) without their denominator. */
KERNEL_INLINE void find_weights(size_t n, const float *restrict behind, float *restrict e)
{
#pragma omp simd
    for (size_t i = 0; i < n; i++) e[i] = apsm_exp2f(behind[i]);
}

/* k becomes e / k.  Returns the sum of e; kbar. */
KERNEL_INLINE float add_up(size_t n, const float *restrict behind, const float *restrict e,
                           float *restrict k, float kmin, float *kbar)
{
    float s0[LANES] = { 0 }, s1[LANES] = { 0 };
    for (size_t i = 0; i < n; i += LANES) {
#pragma omp simd
        for (size_t l = 0; l < LANES; l++) {
            const float w = e[i + l];
            k[i + l] = w / k[i + l];
            s0[l] += w;
            s1[l] += w * behind[i + l];
        }
    }
    const float sum = sum_lanes(s0);
    *kbar = kmin - sum_lanes(s1) / sum;
    return sum;
}

/* With share = g / sum of e, the force (7) on a particle is share e (1 + (kbar - k) ln 2) / k along
 * p - x, that is turned u - weight e. */
KERNEL_INLINE void share_out(const sampling_patch *s, size_t near, const float *weight, float *kbar,
                             group *restrict g)
{
    float sum[GROUP];
    for (size_t q = 0; q < GROUP; q++) sum[q] = 1.0f;
    for (size_t q = 0; q < g->count; q++) find_distances(s, near, g, q);
    find_weights(g->count * near, s->behind, s->e);
    for (size_t q = 0; q < g->count; q++)
        sum[q] = add_up(near, s->behind + q * near, s->e + q * near, s->k + q * near, g->kmin[q],
                        kbar + q);
#pragma omp simd
    for (size_t q = 0; q < GROUP; q++) {
        const float share = weight[q] / sum[q];
        g->mass[q] = share;
        g->weight[q] = LN2 * share;
        g->turned[q] = share + share * (LN2 * kbar[q]);
    }
}

/* Forces and masses of LANES particles from all points of the group, n near ones a point. */
KERNEL_INLINE void pull(const sampling_patch *s, size_t n, size_t i, const group *restrict g,
                        float out[restrict LANES][4])
{
    const float *restrict x = s->q[0] + i, *restrict y = s->q[1] + i, *restrict z = s->q[2] + i;
    const float *restrict e = s->e + i, *restrict u = s->k + i;
    float fx[LANES] = { 0 }, fy[LANES] = { 0 }, fz[LANES] = { 0 }, mass[LANES] = { 0 };
    for (size_t q = 0; q < g->count; q++) {
        const float a = g->x[0][q], b = g->x[1][q], c = g->x[2][q];
        const float turned = g->turned[q], weight = g->weight[q], m = g->mass[q];
#pragma omp simd
        for (size_t l = 0; l < LANES; l++) {
            const float f = turned * u[q * n + l] - weight * e[q * n + l];
            fx[l] += f * (x[l] - a);
            fy[l] += f * (y[l] - b);
            fz[l] += f * (z[l] - c);
            mass[l] += m * e[q * n + l];
        }
    }
    for (size_t l = 0; l < LANES; l++) {
        out[l][0] = fx[l];
        out[l][1] = fy[l];
        out[l][2] = fz[l];
        out[l][3] = mass[l];
    }
}

/* Returns the greatest kmin; stops there if that is more than s->bound. */
KERNEL_INLINE float run_group(sampling_patch *s, size_t from)
{
    group g;
    g.count = s->count - from < GROUP ? s->count - from : GROUP;
    for (size_t a = 0; a < 3; a++) memcpy(g.x[a], s->x[a] + from, sizeof g.x[a]);
    surround(&g);
    const size_t near = gather(s, &g), n = whole_lanes(near);
    const float most = greatest(g.kmin);
    if (!(most <= s->bound)) return most;
    share_out(s, n, s->g + from, s->kbar + from, &g);
    for (size_t i = 0; i < n; i += LANES) {
        float out[LANES][4];
        pull(s, n, i, &g, out);
        const size_t here = near - i < LANES ? near - i : LANES;
        for (size_t l = 0; l < here; l++) {
            float *restrict to = s->grad[s->near[i + l]];
            for (size_t a = 0; a < 4; a++) to[a] += out[l][a];
        }
    }
    return most;
}

/* Points of weight 0 that stand where the last one does. */
static void fill_groups(sampling_patch *s)
{
    for (size_t q = s->count; q % GROUP > 0; q++) {
        for (size_t a = 0; a < 3; a++) s->x[a][q] = s->x[a][s->count - 1];
        s->g[q] = 0.0f;
    }
}

APSM_KERNEL bool sampling_patch_run(sampling_patch *s)
{
    fill_groups(s);
    memset(s->grad, 0, s->found * sizeof *s->grad);
    s->most = 0.0f;
    for (size_t from = 0; from < s->count; from += GROUP) {
        const float most = run_group(s, from);
        if (!(most <= s->bound)) return false;
        s->most = most > s->most ? most : s->most;
    }
    return true;
}
