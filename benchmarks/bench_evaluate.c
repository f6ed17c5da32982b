/* Times the model metrics: bench_evaluate [shapes particles exponent threads samples].
 * The cohort has all its I - 1 modes, with standard deviations k^-exponent: 1 is like organs, 0
 * (all alike) the worst case of the search for the nearest shape.  One JSON line a step: wall and
 * CPU seconds, and the process's peak memory so far. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <time.h>

#include "apsm/linalg.h"
#include "apsm/metrics.h"
#include "apsm/random.h"

static double *make_cohort(size_t I, size_t J, double exponent)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    const size_t n = 3 * J;
    double *P = calloc(I * n, sizeof *P), *mode = malloc(n * sizeof *mode);
    if (!P || !mode) abort();
    for (size_t k = 0; k < I; k++) {
        const double sd = pow((double)(k + 1), -exponent);
        for (size_t c = 0; c < n; c++) mode[c] = apsm_random_normal(&rng);
        for (size_t i = 0; i < I; i++) {
            const double b = sd * apsm_random_normal(&rng);
            for (size_t c = 0; c < n; c++) P[i * n + c] += b * mode[c];
        }
    }
    free(mode);
    return P;
}

typedef struct stopwatch {
    struct timespec wall;
    clock_t cpu;
} stopwatch;

static stopwatch start(void)
{
    stopwatch s;
    clock_gettime(CLOCK_MONOTONIC, &s.wall);
    s.cpu = clock();
    return s;
}

static void stop(const stopwatch *s, const char *what, apsm_status status, double value)
{
    struct timespec now;
    struct rusage usage;
    clock_gettime(CLOCK_MONOTONIC, &now);
    const double wall =
        (double)(now.tv_sec - s->wall.tv_sec) + 1e-9 * (double)(now.tv_nsec - s->wall.tv_nsec);
    getrusage(RUSAGE_SELF, &usage);
    printf("{\"step\": \"%s\", \"status\": \"%s\", \"wall_s\": %.3f, \"cpu_s\": %.3f, "
           "\"peak_mb\": %.1f, \"last\": %.12g}\n",
           what, apsm_status_text(status), wall, (double)(clock() - s->cpu) / CLOCKS_PER_SEC,
           (double)usage.ru_maxrss / 1024, value);
    fflush(stdout);
}

static size_t argument(int argc, char **argv, int k, size_t otherwise)
{
    return argc > k ? (size_t)strtoul(argv[k], NULL, 10) : otherwise;
}

int main(int argc, char **argv)
{
    const size_t I = argument(argc, argv, 1, 500), J = argument(argc, argv, 2, 1024);
    const double exponent = argc > 3 ? strtod(argv[3], NULL) : 1.0;
    const size_t threads = argument(argc, argv, 4, 2), samples = argument(argc, argv, 5, 1000);
    double *P = make_cohort(I, J, exponent), *value = calloc(I, sizeof *value);
    double *error = calloc(I, sizeof *error);
    apsm_context *ctx = apsm_context_new();
    if (!ctx || !value || !error || I < 3) return 1;
    apsm_linalg_single_thread();
    apsm_context_set_threads(ctx, (int)threads);
    printf("{\"shapes\": %zu, \"particles\": %zu, \"exponent\": %g, \"threads\": %zu, "
           "\"samples\": %zu}\n",
           I, J, exponent, threads, samples);

    apsm_shape_model model;
    stopwatch s = start();
    apsm_status status = apsm_shape_model_fit(ctx, I, J, P, &model);
    stop(&s, "shape model", status, status == APSM_OK ? (double)model.modes : 0.0);
    free(P);
    if (status != APSM_OK) return 1;
    s = start();
    status = apsm_generalization(ctx, &model, value, error);
    stop(&s, "generalization", status, value[I - 3]);
    s = start();
    status = apsm_specificity(ctx, &model, APSM_DEFINITION_STANDARD, samples, I, value, error);
    stop(&s, "specificity", status, value[I - 2]);
    apsm_shape_model_free(&model);
    apsm_context_free(ctx);
    free(value);
    free(error);
    return status == APSM_OK ? 0 : 1;
}
