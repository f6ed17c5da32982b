/* The correspondence loss (8) and the six nearest of every particle: bench_correspondence [J ...].
 * Limits: three square roots (length, residual, and its share of the template's) for every particle
 * and neighbour; a product of three rows (5 operations a pair) for the nearest. */
#include "optimize/correspondence_loss.h"
#include "sphere_scene.h"

typedef struct bench {
    sphere_scene s;
    uint32_t *N6;
    double *h_j;
} bench;

static void loss(void *user)
{
    bench *b = user;
    const apsm_correspondence_options o = apsm_correspondence_defaults();
    const apsm_correspondence_target target = { b->s.J, b->s.P, b->s.N, b->N6, b->h_j };
    double sum;
    bench_must(apsm_correspondence_loss(&target, b->s.P2, b->s.N, &o, &sum, b->s.grad, NULL));
}

static void nearest(void *user)
{
    bench *b = user;
    bench_must(apsm_neighbours6(b->s.J, b->s.P, b->N6));
}

static void measure(size_t J, double sqrt64, double gemm)
{
    bench b = { .s = sphere_scene_new(J) };
    const double pairs = 6.0 * (double)J, all = (double)J * (double)J;
    b.N6 = bench_alloc(6 * J * sizeof *b.N6);
    b.h_j = bench_doubles(J);
    bench_report("six nearest", b.s.size, bench_median(nearest, &b), all, "pair",
                 "operations at dgemm's rate", 5 * all * gemm);
    apsm_spacing(J, b.s.P, b.N6, b.h_j);
    bench_report("correspondence", b.s.size, bench_median(loss, &b), pairs, "neighbour",
                 "vector sqrt", 3 * pairs * sqrt64);
    free(b.N6);
    free(b.h_j);
    sphere_scene_free(&b.s);
}

int main(int argc, char **argv)
{
    size_t sizes[16] = { 128, 512, 1024 };
    const size_t n = bench_sizes(argc, argv, sizes, 3);
    const double sqrt64 = bench_limit_sqrt64(), gemm = bench_limit_gemm();
    for (size_t i = 0; i < n; i++) measure(sizes[i], sqrt64, gemm);
    return 0;
}
