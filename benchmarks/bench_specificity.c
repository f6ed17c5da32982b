/* Specificity (1,000 samples) and generalization of a model: bench_specificity [SHAPES PARTICLES
 * EXPONENT].  The cohort has all its I - 1 modes, with standard deviations k^-EXPONENT: 1 is like
 * organs, 0 (all alike) the worst case of the search for the nearest shape.  Limits: the distances
 * of every sample to every shape, 6 J operations each, for one mode, and the Gram matrix of the
 * shapes, both at dgemm's rate. */
#include "bench.h"
#include "evaluate/metrics.h"

enum { SAMPLES = 1000 };

typedef struct bench {
    apsm_context *ctx;
    apsm_shape_model model;
    size_t I;
    double *value;
} bench;

static double *make_cohort(size_t I, size_t J, double exponent)
{
    const size_t n = 3 * J;
    double *P = bench_doubles(I * n), *mode = bench_doubles(n);
    bench_add_modes(I, n, exponent, P, mode);
    free(mode);
    return P;
}

static void specificity(void *user)
{
    bench *b = user;
    bench_must(apsm_specificity(b->ctx, &b->model, APSM_DEFINITION_STANDARD, SAMPLES, b->I - 1,
                                b->value, NULL));
}

static void generalization(void *user)
{
    bench *b = user;
    bench_must(apsm_generalization(b->ctx, &b->model, b->value, NULL));
}

int main(int argc, char **argv)
{
    const size_t I = argc > 1 ? strtoul(argv[1], NULL, 10) : 64,
                 J = argc > 2 ? strtoul(argv[2], NULL, 10) : 256;
    const double exponent = argc > 3 ? strtod(argv[3], NULL) : 1.0;
    bench b = { .ctx = apsm_context_new(), .I = I, .value = bench_doubles(I) };
    char size[96];
    if (I < 3 || J < 7 || !b.ctx) {
        fprintf(stderr, "bench_specificity: 3 shapes and 7 particles at least\n");
        return 2;
    }
    apsm_context_set_threads(b.ctx, 1);
    double *P = make_cohort(I, J, exponent);
    bench_must(apsm_shape_model_fit(b.ctx, I, J, P, &b.model));
    const double gemm = bench_limit_gemm(), n = (double)I, operations = 6.0 * (double)J;
    snprintf(size, sizeof size, "\"I\": %zu, \"J\": %zu, \"exponent\": %g", I, J, exponent);
    bench_report("specificity of all modes", size, bench_median(specificity, &b),
                 SAMPLES * (n - 1.0), "sample_and_mode", "distances for one mode at dgemm's rate",
                 SAMPLES * n * operations * gemm);
    bench_report("generalization of all modes", size, bench_median(generalization, &b), n, "shape",
                 "Gram matrix at dgemm's rate", 0.5 * n * n * operations * gemm);
    apsm_shape_model_free(&b.model);
    apsm_context_free(b.ctx);
    free(b.value);
    free(P);
    return 0;
}
