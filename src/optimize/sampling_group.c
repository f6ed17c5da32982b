/* The inner loops of the sampling loss in single precision; METHOD (3), (7).
 *
 * Weights are wrong by about 2e-6 of the largest, rounding and cut alike; the mean over a
 * particle's points is known to some per cent only (R/J = 16 points, drawn anew every epoch).
 * Block by block over all points, so that a block's particles and sums stay in registers. */
#include "optimize/sampling_group.h"

#include <math.h>
#include <string.h>

#include "core/exp.h"
#include "core/kernel.h"

enum { LANES = SAMPLING_LANES, GROUP = SAMPLING_GROUP };

size_t sampling_group_lay_out(size_t blocks, sampling_group *s, double *work)
{
    const size_t pair = (size_t)GROUP * LANES;
    const size_t floats = blocks * (3 * LANES + 4 * LANES + 2 * pair + GROUP);
    const size_t bytes = floats * sizeof(float) + blocks * (GROUP + 1);
    if (work) {
        float *next = (float *)work;
        s->p = (float(*)[3][LANES])next;
        s->grad = (float(*)[4][LANES])(next += blocks * 3 * LANES);
        s->k = (float(*)[LANES])(next += blocks * 4 * LANES);
        s->e = (float(*)[LANES])(next += blocks * pair);
        s->least = (float(*)[GROUP])(next += blocks * pair);
        s->near = (uint8_t(*)[GROUP])(next += blocks * GROUP);
        s->count = (uint8_t *)(s->near + blocks);
    }
    return (bytes + sizeof(double) - 1) / sizeof(double);
}

/* Squared distances of all points to a block's particles, and the least for each point. */
KERNEL_INLINE void block_distances(const sampling_group *s, size_t i)
{
    const float *restrict px = s->p[i][0], *restrict py = s->p[i][1], *restrict pz = s->p[i][2];
    for (size_t q = 0; q < GROUP; q++) {
        const float a = s->x[0][q], b = s->x[1][q], c = s->x[2][q];
        float *restrict d2 = s->k[i * GROUP + q], least = INFINITY;
#pragma omp simd reduction(min : least)
        for (size_t l = 0; l < LANES; l++) {
            const float x = px[l] - a, y = py[l] - b, z = pz[l] - c, d = x * x + y * y + z * z;
            d2[l] = d;
            least = d < least ? d : least;
        }
        s->least[i][q] = least;
    }
}

/* kmin, and what a block's least squared distance may be at most. */
KERNEL_INLINE void nearest_of_points(const sampling_group *s, float kmin[GROUP], float limit[GROUP])
{
    for (size_t q = 0; q < GROUP; q++) kmin[q] = INFINITY;
    for (size_t i = 0; i < s->found; i++)
#pragma omp simd
        for (size_t q = 0; q < GROUP; q++)
            kmin[q] = s->least[i][q] < kmin[q] ? s->least[i][q] : kmin[q];
#pragma omp simd
    for (size_t q = 0; q < GROUP; q++) {
        kmin[q] = sqrtf(kmin[q]);
        const float far = (kmin[q] + s->reach) * 1.000001f;
        limit[q] = far * far;
    }
}

/* k, the weight e of (3) without its denominator, and the lanes' sums of e and e (k - kmin). */
KERNEL_INLINE void soften(float *restrict k, float *restrict e, float kmin, float reach,
                          float sharpness, float *restrict s0, float *restrict s1)
{
#pragma omp simd
    for (size_t l = 0; l < LANES; l++) {
        const float r = sqrtf(k[l]), beyond = r - kmin, w = apsm_expf(-beyond * sharpness);
        const float v = beyond <= reach ? w : 0.0f;
        k[l] = r;
        e[l] = v;
        s0[l] += v;
        s1[l] += v * beyond;
    }
}

KERNEL_INLINE float sum_lanes(const float v[LANES])
{
    return ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
}

/* Adds the share of point x in a block's gradient and mass. */
KERNEL_INLINE void pull(const float p[restrict 3][LANES], const float x[3], const float *restrict k,
                        const float *restrict e, float kbar, float share, float sharpness,
                        float sum[restrict 4][LANES])
{
    const float a = x[0], b = x[1], c = x[2];
#pragma omp simd
    for (size_t l = 0; l < LANES; l++) {
        const float r = k[l], w = share * e[l], t = w * (1.0f - (r - kbar) * sharpness);
        const float f = t / (r > 0.0f ? r : 1.0f); /* at 0 it meets p - x = 0 */
        sum[0][l] += f * (p[0][l] - a);
        sum[1][l] += f * (p[1][l] - b);
        sum[2][l] += f * (p[2][l] - c);
        sum[3][l] += w;
    }
}

/* A block's gradient and mass from the points near it; share = g / sum of weights. */
KERNEL_INLINE void pull_block(const sampling_group *s, size_t i, const float kbar[GROUP],
                              const float share[GROUP], float sharpness)
{
    float p[3][LANES], sum[4][LANES] = { { 0 } };
    memcpy(p, s->p[i], sizeof p);
    for (size_t n = 0; n < s->count[i]; n++) {
        const size_t q = s->near[i][n], at = i * GROUP + q;
        const float x[3] = { s->x[0][q], s->x[1][q], s->x[2][q] };
        pull((const float(*)[LANES])p, x, s->k[at], s->e[at], kbar[q], share[q], sharpness, sum);
    }
    memcpy(s->grad[i], sum, sizeof sum);
}

APSM_KERNEL void sampling_group_run(sampling_group *s)
{
    const float sharpness = 1.0f / s->tau;
    float kmin[GROUP], limit[GROUP], s0[GROUP][LANES] = { 0 }, s1[GROUP][LANES] = { 0 };
    float share[GROUP];
    for (size_t i = 0; i < s->found; i++) block_distances(s, i);
    nearest_of_points(s, kmin, limit);
    for (size_t i = 0; i < s->found; i++) {
        uint8_t n = 0;
        for (size_t q = 0; q < GROUP; q++) {
            s->near[i][n] = (uint8_t)q;
            n = (uint8_t)(n + (s->least[i][q] <= limit[q]));
        }
        s->count[i] = n;
        for (size_t m = 0; m < n; m++) {
            const size_t q = s->near[i][m];
            soften(s->k[i * GROUP + q], s->e[i * GROUP + q], kmin[q], s->reach, sharpness, s0[q],
                   s1[q]);
        }
    }
    for (size_t q = 0; q < GROUP; q++) {
        const float sum = sum_lanes(s0[q]);
        s->kbar[q] = kmin[q] + sum_lanes(s1[q]) / sum;
        share[q] = s->g[q] / sum;
    }
    for (size_t i = 0; i < s->found; i++) pull_block(s, i, s->kbar, share, sharpness);
}
