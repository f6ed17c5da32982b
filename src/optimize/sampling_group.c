/* The inner loops of the sampling loss in single precision; METHOD (3), (7).
 *
 * Weights are wrong by about 2e-6 of the largest, rounding and cut alike; the mean over a
 * particle's points is known to some per cent only (R/J = 16 points, drawn anew every epoch).
 * One particle against all points of the group at a time: its 16 distances are whole registers, and
 * sums over particles need nothing across them. */
#include "optimize/sampling_group.h"

#include <math.h>
#include <string.h>

#include "core/exp.h"
#include "core/kernel.h"

enum { GROUP = SAMPLING_GROUP, HALF = GROUP / 2 };

size_t sampling_group_lay_out(size_t J, sampling_group *s, double *work)
{
    const size_t floats = J * (3 + 4 + 2 * GROUP), bytes = 4 * (floats + J);
    if (work) {
        float *next = (float *)work;
        s->k = (float(*)[GROUP])next;
        s->e = (float(*)[GROUP])(next += J * GROUP);
        s->p = (float(*)[3])(next += J * GROUP);
        s->grad = (float(*)[4])(next += J * 3);
        s->near = (uint32_t *)(next + J * 4);
    }
    return (bytes + sizeof(double) - 1) / sizeof(double);
}

/* Squared distances of all points to particle p, and the least so far for each point. */
KERNEL_INLINE void distances(const float x[restrict 3][GROUP], const float p[restrict 3],
                             float *restrict d2, float *restrict least)
{
#pragma omp simd
    for (size_t q = 0; q < GROUP; q++) {
        const float a = x[0][q] - p[0], b = x[1][q] - p[1], c = x[2][q] - p[2];
        const float d = a * a + b * b + c * c;
        d2[q] = d;
        least[q] = d < least[q] ? d : least[q];
    }
}

/* kmin from the least squared distances, and what a squared distance may be at most to matter. */
KERNEL_INLINE void find_limits(float reach, float kmin[restrict GROUP], float limit[restrict GROUP])
{
#pragma omp simd
    for (size_t q = 0; q < GROUP; q++) {
        kmin[q] = sqrtf(kmin[q]);
        const float far = (kmin[q] + reach) * 1.000001f;
        limit[q] = far * far;
    }
}

/* Notes in near the particles that matter to any of the points; returns their number. */
KERNEL_INLINE size_t keep_near(const sampling_group *s, const float limit[GROUP])
{
    size_t n = 0;
    for (size_t j = 0; j < s->found; j++) {
        const float *restrict d2 = s->k[j];
        float over = INFINITY;
#pragma omp simd reduction(min : over)
        for (size_t q = 0; q < GROUP; q++) {
            const float beyond = d2[q] - limit[q];
            over = beyond < over ? beyond : over;
        }
        s->near[n] = (uint32_t)j;
        n += over <= 0.0f;
    }
    return n;
}

/* k, the weight e of (3) without its denominator, and the points' sums of e and e (k - kmin). */
KERNEL_INLINE void soften(float *restrict k, float *restrict e, const float *restrict kmin,
                          float reach, float sharpness, float *restrict s0, float *restrict s1)
{
#pragma omp simd
    for (size_t q = 0; q < GROUP; q++) {
        const float r = sqrtf(k[q]), beyond = r - kmin[q], w = apsm_expf(-beyond * sharpness);
        const float v = beyond <= reach ? w : 0.0f;
        k[q] = r;
        e[q] = v;
        s0[q] += v;
        s1[q] += v * beyond;
    }
}

/* The second half is added to the first, then as a tree. */
KERNEL_INLINE float sum_points(const float v[GROUP])
{
    float h[HALF];
#pragma omp simd
    for (size_t q = 0; q < HALF; q++) h[q] = v[q] + v[q + HALF];
    return ((h[0] + h[1]) + (h[2] + h[3])) + ((h[4] + h[5]) + (h[6] + h[7]));
}

/* The points' shares in a particle's gradient and mass; share = g / sum of weights. */
KERNEL_INLINE void pull(const float x[restrict 3][GROUP], const float p[restrict 3],
                        const float *restrict k, const float *restrict e,
                        const float *restrict kbar, const float *restrict share, float sharpness,
                        float grad[restrict 4])
{
    float part[4][GROUP];
#pragma omp simd
    for (size_t q = 0; q < GROUP; q++) {
        const float r = k[q], w = share[q] * e[q], t = w * (1.0f - (r - kbar[q]) * sharpness);
        const float f = t / (r > 0.0f ? r : 1.0f); /* at 0 it meets p - x = 0 */
        part[0][q] = f * (p[0] - x[0][q]);
        part[1][q] = f * (p[1] - x[1][q]);
        part[2][q] = f * (p[2] - x[2][q]);
        part[3][q] = w;
    }
    for (size_t a = 0; a < 4; a++) grad[a] = sum_points(part[a]);
}

APSM_KERNEL void sampling_group_run(sampling_group *s)
{
    const float sharpness = 1.0f / s->tau;
    const float(*x)[GROUP] = (const float(*)[GROUP])s->x;
    float kmin[GROUP], limit[GROUP], share[GROUP], s0[GROUP] = { 0 }, s1[GROUP] = { 0 };
    for (size_t q = 0; q < GROUP; q++) kmin[q] = INFINITY;
    for (size_t j = 0; j < s->found; j++) distances(x, s->p[j], s->k[j], kmin);
    find_limits(s->reach, kmin, limit);
    const size_t near = keep_near(s, limit);
    for (size_t n = 0; n < near; n++)
        soften(s->k[s->near[n]], s->e[s->near[n]], kmin, s->reach, sharpness, s0, s1);
    for (size_t q = 0; q < GROUP; q++) {
        s->kbar[q] = kmin[q] + s1[q] / s0[q];
        share[q] = s->g[q] / s0[q];
    }
    memset(s->grad, 0, s->found * sizeof *s->grad);
    for (size_t n = 0; n < near; n++) {
        const size_t j = s->near[n];
        pull(x, s->p[j], s->k[j], s->e[j], s->kbar, share, sharpness, s->grad[j]);
    }
}
