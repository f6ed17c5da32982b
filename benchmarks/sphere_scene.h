/* sphere_scene.h -- J particles on a unit sphere with 16 J near-surface points in the band of the
 * default options. */
#ifndef APSM_BENCHMARKS_SPHERE_SCENE_H
#define APSM_BENCHMARKS_SPHERE_SCENE_H

#include "bench.h"

typedef struct sphere_scene {
    size_t J, R;
    double h, s;              /* spacing, dipoles' length */
    double *P, *N, *P2;       /* J x 3: particles, normals, particles moved by up to 0.15 h */
    double *B, *g, *f, *grad; /* R x 3, R, R, J x 3 */
    char size[64];            /* for bench_report */
} sphere_scene;

static inline sphere_scene sphere_scene_new(size_t J)
{
    const size_t R = 16 * J;
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, J, 0);
    sphere_scene b = { .J = J, .R = R };
    b.h = sqrt(4.0 * 3.141592653589793 / (double)J * 1.155);
    b.s = b.h / 4.0;
    b.P = bench_doubles(3 * J);
    b.N = bench_doubles(3 * J);
    b.P2 = bench_doubles(3 * J);
    b.B = bench_doubles(3 * R);
    b.g = bench_doubles(R);
    b.f = bench_doubles(R);
    b.grad = bench_doubles(3 * J);
    snprintf(b.size, sizeof b.size, "\"J\": %zu, \"R\": %zu", J, R);
    for (size_t j = 0; j < J; j++) { /* Fibonacci points */
        const double z = 1.0 - (2.0 * (double)j + 1.0) / (double)J, r = sqrt(1.0 - z * z);
        const double angle = 2.399963229728653 * (double)j;
        const double n[3] = { r * cos(angle), r * sin(angle), z };
        for (size_t a = 0; a < 3; a++) {
            b.P[3 * j + a] = b.N[3 * j + a] = n[a];
            b.P2[3 * j + a] = n[a] + 0.15 * b.h * (2.0 * apsm_random_uniform(&rng) - 1.0);
        }
    }
    for (size_t r = 0; r < R; r++) {
        double v[3], size2 = 0.0;
        for (size_t a = 0; a < 3; a++) {
            v[a] = apsm_random_normal(&rng);
            size2 += v[a] * v[a];
        }
        const double radius = 1.0 + b.s * (2.0 * apsm_random_uniform(&rng) - 1.0);
        for (size_t a = 0; a < 3; a++) b.B[3 * r + a] = radius * v[a] / sqrt(size2);
        b.g[r] = 1.0;
    }
    return b;
}

static inline void sphere_scene_free(sphere_scene *b)
{
    double *all[] = { b->P, b->N, b->P2, b->B, b->g, b->f, b->grad };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
}

#endif
