/* The eigenshape loss (9) and the gradients (10) of all shapes of a batch of 64: bench_eigenshape
 * [J ...].  Limit: its 9 J K^2 operations (half a Gram matrix, a product) at dgemm's rate. */
#include "bench.h"
#include "optimize/eigenshape_loss.h"

enum { K = 64 };

typedef struct bench {
    size_t J;
    double *Y, *L, *grad, *work;
} bench;

static void run(void *user)
{
    bench *b = user;
    const apsm_eigenshape_options o = apsm_eigenshape_defaults();
    double loss;
    bench_must(apsm_eigenshape_loss(K, b->J, b->Y, &o, &loss, b->L, NULL));
    for (size_t k = 0; k < K; k++)
        apsm_eigenshape_gradient(K, b->J, b->Y, b->L, &o, k, b->grad, b->work);
}

static void measure(size_t J, double gemm)
{
    bench b = { J, bench_doubles(3 * J * K), bench_doubles(K * K), bench_doubles(3 * J),
                bench_doubles(K) };
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, J, 0);
    char size[64];
    for (size_t i = 0; i < 3 * J * K; i++) b.Y[i] = apsm_random_normal(&rng);
    snprintf(size, sizeof size, "\"J\": %zu, \"K\": %d", J, K);
    bench_report("eigenshape", size, bench_median(run, &b), 3.0 * (double)J * K, "coordinate",
                 "operations at dgemm's rate", 9.0 * (double)J * K * K * gemm);
    free(b.Y);
    free(b.L);
    free(b.grad);
    free(b.work);
}

int main(int argc, char **argv)
{
    size_t sizes[16] = { 128, 512, 1024 };
    const size_t n = bench_sizes(argc, argv, sizes, 3);
    const double gemm = bench_limit_gemm();
    for (size_t i = 0; i < n; i++) measure(sizes[i], gemm);
    return 0;
}
