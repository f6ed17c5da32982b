/* The gradient of the sampling loss (7): bench_sampling [J ...].  Limit: an exponential for every
 * pair that matters, a point and a particle within 15 tau beyond its nearest. */
#include "optimize/sampling_loss.h"
#include "sphere_scene.h"

typedef struct bench {
    sphere_scene s;
    apsm_sampling_options o;
    double *work;
} bench;

static void run(void *user)
{
    bench *b = user;
    double loss;
    const apsm_sampling_points points = { b->s.J, b->s.R, b->s.P, b->s.B, b->s.g };
    const apsm_sampling_result result = { .loss = &loss, .grad = b->s.grad };
    bench_must(apsm_sampling_loss(&points, &b->o, &result, b->work));
}

static double distance(const double *x, const double *y)
{
    double d2 = 0.0;
    for (int c = 0; c < 3; c++) d2 += (x[c] - y[c]) * (x[c] - y[c]);
    return sqrt(d2);
}

static double pairs_that_matter(const sphere_scene *s, double reach)
{
    double pairs = 0.0;
    for (size_t r = 0; r < s->R; r++) {
        double least = INFINITY;
        for (size_t j = 0; j < s->J; j++) least = fmin(least, distance(s->B + 3 * r, s->P + 3 * j));
        for (size_t j = 0; j < s->J; j++)
            pairs += distance(s->B + 3 * r, s->P + 3 * j) <= least + reach;
    }
    return pairs;
}

static void measure(size_t J, double exp32)
{
    bench b = { .s = sphere_scene_new(J), .o = apsm_sampling_defaults() };
    b.work = bench_doubles(apsm_sampling_work_size(J, b.s.R));
    b.o.h = b.s.h;
    const double pairs = pairs_that_matter(&b.s, b.o.cut_single * b.o.tau * b.o.h);
    char size[128];
    snprintf(size, sizeof size, "%s, \"pairs_per_point\": %.1f", b.s.size, pairs / (double)b.s.R);
    for (int single = 1; single >= 0; single--) {
        b.o.precision = single ? APSM_PRECISION_SINGLE : APSM_PRECISION_DOUBLE;
        bench_report(single ? "sampling gradient" : "sampling gradient, double", size,
                     bench_median(run, &b), (double)b.s.R, "point",
                     "vector expf of the pairs within 15 tau", pairs * exp32);
    }
    free(b.work);
    sphere_scene_free(&b.s);
}

int main(int argc, char **argv)
{
    size_t sizes[16] = { 128, 512, 1024 };
    const size_t n = bench_sizes(argc, argv, sizes, 3);
    const double exp32 = bench_limit_exp32();
    for (size_t i = 0; i < n; i++) measure(sizes[i], exp32);
    return 0;
}
