/* Values (1) of the RBF-shape at the near-surface points: bench_rbf_eval [J ...].  Limit: a square
 * root for every pair of point and centre. */
#include "optimize/rbf_shape.h"
#include "sphere_scene.h"

typedef struct bench {
    sphere_scene s;
    apsm_rbf_shape shape;
    double *work;
} bench;

static void eval(void *user)
{
    bench *b = user;
    apsm_rbf_eval(&b->shape, b->s.R, b->s.B, b->s.f, NULL);
}

static void eval_single(void *user)
{
    bench *b = user;
    apsm_rbf_eval_f32(&b->shape, b->s.R, b->s.B, b->s.f, b->work);
}

static void measure(size_t J, double sqrt32, double sqrt64)
{
    bench b = { .s = sphere_scene_new(J) };
    double *store = bench_doubles(apsm_rbf_store_size(J)),
           *factor_store = bench_doubles(apsm_polyharmonic_store_size(3 * J, true));
    const double pairs = 3.0 * (double)J * (double)b.s.R;
    apsm_polyharmonic factor;
    b.work = bench_doubles(apsm_rbf_work_size(J) + apsm_rbf_eval_f32_work_size(J));
    apsm_rbf_bind(&b.shape, J, store);
    const apsm_dipoles d = { b.s.P, b.s.N, b.s.s };
    bench_must(apsm_rbf_fit(APSM_PHI_R, &d, true, factor_store, &factor, &b.shape, b.work));
    bench_report("rbf evaluation", b.s.size, bench_median(eval_single, &b), pairs, "pair",
                 "vector sqrtf", pairs * sqrt32);
    bench_report("rbf evaluation, double", b.s.size, bench_median(eval, &b), pairs, "pair",
                 "vector sqrt", pairs * sqrt64);
    free(store);
    free(factor_store);
    free(b.work);
    sphere_scene_free(&b.s);
}

int main(int argc, char **argv)
{
    size_t sizes[16] = { 128, 512, 1024 };
    const size_t n = bench_sizes(argc, argv, sizes, 3);
    const double sqrt32 = bench_limit_sqrt32(), sqrt64 = bench_limit_sqrt64();
    for (size_t i = 0; i < n; i++) measure(sizes[i], sqrt32, sqrt64);
    return 0;
}
