/* The fit (2) of the RBF-shape: bench_rbf_fit [J ...].  A fit with a factor of its own, limit
 * LAPACK's Cholesky of that size; and again with the factor of particles up to 0.15 h away, limit
 * the bytes that its iterations must read (the matrix once, the factor twice) and the square roots
 * of the matrix. */
#include "optimize/rbf_shape.h"
#include "sphere_scene.h"

typedef struct bench {
    sphere_scene s;
    bool single;
    apsm_rbf_shape shape;
    apsm_polyharmonic factor;
    double *shape_store, *store, *work;
    size_t iterations;
} bench;

static void fit(void *user)
{
    bench *b = user;
    const apsm_dipoles d = { b->s.P, b->s.N, b->s.s };
    bench_must(apsm_rbf_fit(APSM_PHI_R, &d, b->single, b->store, &b->factor, &b->shape, b->work));
}

static void refit(void *user)
{
    bench *b = user;
    const apsm_dipoles d = { b->s.P2, b->s.N, b->s.s };
    const apsm_resolve_options o = { true, APSM_RBF_TOLERANCE, 50 };
    bench_must(apsm_rbf_refit(&b->factor, &d, &o, &b->shape, &b->iterations, b->work));
}

static void measure(size_t J, double sqrt32, double stream)
{
    bench b = { .s = sphere_scene_new(J) };
    const double n = 3.0 * (double)J;
    b.shape_store = bench_doubles(apsm_rbf_store_size(J));
    b.store = bench_doubles(apsm_polyharmonic_store_size(3 * J, false));
    b.work = bench_doubles(apsm_rbf_work_size(J));
    apsm_rbf_bind(&b.shape, J, b.shape_store);
    bench_report("rbf fit, double", b.s.size, bench_median(fit, &b), n * n, "entry", "dpotrf",
                 bench_limit_cholesky(3 * J - 4, false));
    b.single = true;
    bench_report("rbf fit", b.s.size, bench_median(fit, &b), n * n, "entry", "spotrf",
                 bench_limit_cholesky(3 * J - 4, true));
    char size[128];
    const double seconds = bench_median(refit, &b), bytes = 6.0 * n * n * (double)b.iterations;
    snprintf(size, sizeof size, "%s, \"iterations\": %zu", b.s.size, b.iterations);
    bench_report("rbf fit with an earlier factor", size, seconds, n * n, "entry",
                 "vector sqrtf of the matrix and its stream", n * n / 2 * sqrt32 + bytes * stream);
    free(b.shape_store);
    free(b.store);
    free(b.work);
    sphere_scene_free(&b.s);
}

int main(int argc, char **argv)
{
    size_t sizes[16] = { 128, 512, 1024 };
    const size_t n = bench_sizes(argc, argv, sizes, 3);
    const double sqrt32 = bench_limit_sqrt32(), stream = bench_limit_stream();
    for (size_t i = 0; i < n; i++) measure(sizes[i], sqrt32, stream);
    return 0;
}
