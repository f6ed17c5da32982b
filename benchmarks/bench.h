/* bench.h -- what all benchmarks of kernels share: the median of CPU times, limits of the machine
 * measured in the same process, and one line of JSON a figure.
 *
 * A limit is the time that the part of the work which cannot be left out would take at the rate
 * measured here: vector square roots, exponentials, LAPACK's Cholesky, BLAS's product, memory.
 * "ratio" is the median over that time. */
#ifndef APSM_BENCHMARKS_BENCH_H
#define APSM_BENCHMARKS_BENCH_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/exp.h"
#include "core/kernel.h"
#include "core/random.h"
#include "linalg/linalg.h"

/* A step that cannot fail here would make the figure worthless if it did. */
static inline void bench_must(apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "benchmark: %s\n", apsm_status_text(status));
    exit(1);
}

static inline void *bench_alloc(size_t bytes)
{
    void *p = calloc(bytes ? bytes : 1, 1);
    if (!p) abort();
    return p;
}

static inline double *bench_doubles(size_t n)
{
    return bench_alloc(n * sizeof(double));
}

/* Adds as many random modes to the particles P (I x n) as there are shapes, with standard
 * deviations that fall as k^-exponent; mode (n) is scratch. */
static inline void bench_add_modes(size_t I, size_t n, double exponent, double *P, double *mode)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    for (size_t k = 0; k < I; k++) {
        const double sd = pow((double)(k + 1), -exponent);
        for (size_t c = 0; c < n; c++) mode[c] = apsm_random_normal(&rng);
        for (size_t i = 0; i < I; i++) {
            const double b = sd * apsm_random_normal(&rng);
            for (size_t c = 0; c < n; c++) P[i * n + c] += b * mode[c];
        }
    }
}

/* CPU time of this thread. */
static inline double bench_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static inline int bench_by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median seconds of runs that fill about 0.3 s: 5 at least, 101 at most. */
static inline double bench_median(void (*run)(void *), void *user)
{
    enum { MOST = 101 };
    double t[MOST], total = 0.0;
    int n = 0;
    for (; n < 5 || (n < MOST && total < 0.3); n++) {
        const double start = bench_now();
        run(user);
        total += t[n] = bench_now() - start;
    }
    qsort(t, (size_t)n, sizeof *t, bench_by_value);
    return t[n / 2];
}

/* ---- limits: seconds an element ---- */

enum { BENCH_LANES = 4096 }; /* fits the first cache */

typedef struct bench_lanes {
    float f[BENCH_LANES], g[BENCH_LANES];
    double x[BENCH_LANES], y[BENCH_LANES];
} bench_lanes;

APSM_KERNEL static void bench_run_sqrt32(void *user)
{
    bench_lanes *b = user;
    for (size_t i = 0; i < BENCH_LANES; i++) b->g[i] = sqrtf(b->f[i]);
}

APSM_KERNEL static void bench_run_sqrt64(void *user)
{
    bench_lanes *b = user;
    for (size_t i = 0; i < BENCH_LANES; i++) b->y[i] = sqrt(b->x[i]);
}

APSM_KERNEL static void bench_run_exp32(void *user)
{
    bench_lanes *b = user;
#pragma omp simd
    for (size_t i = 0; i < BENCH_LANES; i++) b->g[i] = apsm_expf(-b->f[i]);
}

static inline double bench_lane_limit(void (*run)(void *))
{
    bench_lanes *b = bench_alloc(sizeof *b);
    for (size_t i = 0; i < BENCH_LANES; i++) b->f[i] = (float)(b->x[i] = (double)i / BENCH_LANES);
    const double t = bench_median(run, b) / BENCH_LANES;
    free(b);
    return t;
}

static inline double bench_limit_sqrt32(void)
{
    return bench_lane_limit(bench_run_sqrt32);
}
static inline double bench_limit_sqrt64(void)
{
    return bench_lane_limit(bench_run_sqrt64);
}
static inline double bench_limit_exp32(void)
{
    return bench_lane_limit(bench_run_exp32);
}

/* Seconds a byte of y <- a + b, counting what is read and written. */
enum { BENCH_STREAM = 1 << 22 };

static void bench_run_stream(void *user)
{
    double *y = user;
    const double *a = y + BENCH_STREAM, *b = a + BENCH_STREAM;
    for (size_t i = 0; i < BENCH_STREAM; i++) y[i] = a[i] + b[i];
}

static inline double bench_limit_stream(void)
{
    double *x = bench_doubles(3 * BENCH_STREAM);
    const double t = bench_median(bench_run_stream, x) / (3.0 * BENCH_STREAM * sizeof(double));
    free(x);
    return t;
}

/* Seconds of LAPACK's Cholesky of an n x n matrix. */
typedef struct bench_matrix {
    size_t n;
    double *A, *L;
    float *L32;
} bench_matrix;

static void bench_copy_factor(void *user)
{
    bench_matrix *m = user;
    if (m->L32) {
        for (size_t i = 0; i < m->n * m->n; i++) m->L32[i] = (float)m->A[i];
        bench_must(apsm_cholesky_f32(m->n, m->L32));
    } else {
        memcpy(m->L, m->A, m->n * m->n * sizeof *m->L);
        bench_must(apsm_cholesky(m->n, m->L));
    }
}

static inline double bench_limit_cholesky(size_t n, bool single)
{
    bench_matrix m = { .n = n, .A = bench_doubles(n * n) };
    if (single)
        m.L32 = bench_alloc(n * n * sizeof *m.L32);
    else
        m.L = bench_doubles(n * n);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            m.A[i * n + j] = i == j ? 2.0 : exp(-fabs((double)i - (double)j));
    const double t = bench_median(bench_copy_factor, &m);
    free(m.A);
    free(m.L);
    free(m.L32);
    return t;
}

/* Seconds a floating-point operation of BLAS's product of 256 x 256 matrices. */
static void bench_run_gemm(void *user)
{
    double *A = user;
    apsm_gemm(0, 1, 256, 256, 256, 1.0, A, 256, A + 65536, 256, 0.0, A + 131072, 256);
}

static inline double bench_limit_gemm(void)
{
    double *A = bench_doubles(3 * 65536);
    for (size_t i = 0; i < 2 * 65536; i++) A[i] = (double)(i % 17);
    const double t = bench_median(bench_run_gemm, A) / (2.0 * 256 * 256 * 256);
    free(A);
    return t;
}

/* ---- result ---- */

/* size: members of JSON, like "\"J\": 128".  limit NULL: none is stated. */
static inline void bench_report(const char *kernel, const char *size, double seconds,
                                double elements, const char *element, const char *limit,
                                double limit_seconds)
{
    printf("{\"kernel\": \"%s\", %s, \"median_ms\": %.4g, \"ns_per_%s\": %.4g", kernel, size,
           1e3 * seconds, element, 1e9 * seconds / elements);
    if (limit)
        printf(", \"limit\": \"%s\", \"limit_ms\": %.4g, \"ratio\": %.3g", limit,
               1e3 * limit_seconds, seconds / limit_seconds);
    printf("}\n");
    fflush(stdout);
}

/* The arguments as numbers, or the given ones. */
static inline size_t bench_sizes(int argc, char **argv, size_t *sizes, size_t given)
{
    enum { MOST = 16 };
    for (int i = 1; i < argc && i <= MOST; i++) {
        sizes[i - 1] = strtoul(argv[i], NULL, 10);
        if (sizes[i - 1] >= 7) continue;
        fprintf(stderr, "%s: '%s' is not a number of particles (7 or more)\n", argv[0], argv[i]);
        exit(2);
    }
    return argc > 1 ? (size_t)(argc - 1 < MOST ? argc - 1 : MOST) : given;
}

#endif
