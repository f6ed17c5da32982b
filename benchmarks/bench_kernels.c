/* Times the kernels of one shape: bench_kernels [J ...], by default 128, 512, 1024 particles on
 * a unit sphere with 16 J near-surface points in the band of the default options.  One JSON
 * line a kernel and size: least CPU milliseconds of several runs, nanoseconds a pair, and how many
 * times faster than the same thing written plainly (scalar, all pairs, libm), timed beside it. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "apsm/correspondence_loss.h"
#include "apsm/eigenshape_loss.h"
#include "apsm/linalg.h"
#include "apsm/random.h"
#include "apsm/rbf_shape.h"
#include "apsm/sampling_loss.h"

typedef struct scene {
    size_t J, R, K;
    double h, s;
    double *P, *N, *P2, *B, *g, *f, *grad, *kbar, *h_j, *Y, *L, *scratch;
    uint32_t *N6;
    apsm_rbf_shape shape;
    apsm_polyharmonic factor, factor32;
    double *shape_store, *store, *store32, *rbf_work, *sampling_work;
    size_t iterations;
} scene;

static double *doubles(size_t n)
{
    double *x = calloc(n, sizeof *x);
    if (!x) abort();
    return x;
}

/* A step that cannot fail here would make the figure worthless if it did. */
static void must(apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "bench_kernels: %s\n", apsm_status_text(status));
    exit(1);
}

/* Fibonacci points. */
static void place_particles(scene *b, apsm_random *rng)
{
    for (size_t j = 0; j < b->J; j++) {
        const double z = 1.0 - (2.0 * (double)j + 1.0) / (double)b->J, r = sqrt(1.0 - z * z);
        const double angle = 2.399963229728653 * (double)j;
        const double n[3] = { r * cos(angle), r * sin(angle), z };
        for (size_t a = 0; a < 3; a++) {
            b->P[3 * j + a] = b->N[3 * j + a] = n[a];
            b->P2[3 * j + a] = n[a] + 0.05 * b->h * (2.0 * apsm_random_uniform(rng) - 1.0);
        }
    }
}

static void draw_points(scene *b, apsm_random *rng)
{
    for (size_t r = 0; r < b->R; r++) {
        double v[3], size2 = 0.0;
        for (size_t a = 0; a < 3; a++) {
            v[a] = apsm_random_normal(rng);
            size2 += v[a] * v[a];
        }
        const double radius = 1.0 + b->s * (2.0 * apsm_random_uniform(rng) - 1.0);
        for (size_t a = 0; a < 3; a++) b->B[3 * r + a] = radius * v[a] / sqrt(size2);
        b->g[r] = 1.0;
    }
}

static scene scene_new(size_t J)
{
    const size_t R = 16 * J, K = 32;
    scene b = { .J = J, .R = R, .K = K };
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, J, 0);
    b.h = sqrt(4.0 * 3.141592653589793 / (double)J * 1.155);
    b.s = b.h / 4.0;
    b.P = doubles(3 * J);
    b.N = doubles(3 * J);
    b.P2 = doubles(3 * J);
    b.B = doubles(3 * R);
    b.g = doubles(R);
    b.f = doubles(R);
    b.kbar = doubles(R);
    b.grad = doubles(3 * J);
    b.h_j = doubles(J);
    b.Y = doubles(3 * J * K);
    b.L = doubles(K * K);
    b.scratch = doubles(3 * J + K);
    b.N6 = calloc(6 * J, sizeof *b.N6);
    if (!b.N6) abort();
    b.shape_store = doubles(apsm_rbf_store_size(J));
    b.store = doubles(apsm_polyharmonic_store_size(3 * J, false));
    b.store32 = doubles(apsm_polyharmonic_store_size(3 * J, true));
    b.rbf_work = doubles(apsm_rbf_work_size(J));
    b.sampling_work = doubles(apsm_sampling_work_size(J, R));
    place_particles(&b, &rng);
    draw_points(&b, &rng);
    for (size_t i = 0; i < 3 * J * K; i++) b.Y[i] = apsm_random_normal(&rng);
    apsm_rbf_bind(&b.shape, J, b.shape_store);
    must(apsm_neighbours6(J, b.P, b.N6));
    apsm_spacing(J, b.P, b.N6, b.h_j);
    return b;
}

static void scene_free(scene *b)
{
    double *all[] = { b->P,
                      b->N,
                      b->P2,
                      b->B,
                      b->g,
                      b->f,
                      b->kbar,
                      b->grad,
                      b->h_j,
                      b->Y,
                      b->L,
                      b->scratch,
                      b->shape_store,
                      b->store,
                      b->store32,
                      b->rbf_work,
                      b->sampling_work };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
    free(b->N6);
}

/* ---- the kernels ---- */

static void sampling(scene *b)
{
    apsm_sampling_options opt = apsm_sampling_defaults();
    double loss;
    opt.tau = b->h / 8.0;
    must(apsm_sampling_loss(b->J, b->P, b->R, b->B, b->g, &opt, &loss, b->grad, b->kbar, NULL,
                            b->sampling_work));
}

static void fit(scene *b)
{
    must(apsm_rbf_fit(APSM_PHI_R, b->P, b->N, b->s, false, b->store, &b->factor, &b->shape,
                      b->rbf_work));
}

static void fit32(scene *b)
{
    must(apsm_rbf_fit(APSM_PHI_R, b->P, b->N, b->s, true, b->store32, &b->factor32, &b->shape,
                      b->rbf_work));
}

static void refit(scene *b)
{
    must(apsm_rbf_refit(&b->factor, b->P2, b->N, b->s, false, 1e-4, 50, &b->shape, &b->iterations,
                        b->rbf_work));
}

static void refit32(scene *b)
{
    must(apsm_rbf_refit(&b->factor32, b->P2, b->N, b->s, true, 1e-4, 50, &b->shape, &b->iterations,
                        b->rbf_work));
}

static void eval(scene *b)
{
    apsm_rbf_eval(&b->shape, b->R, b->B, b->f, NULL);
}

static void eval32(scene *b)
{
    apsm_rbf_eval_f32(&b->shape, b->R, b->B, b->f, b->rbf_work);
}

static void adjoint(scene *b)
{
    apsm_rbf_adjoint(&b->shape, &b->factor, b->R, b->B, b->g, b->grad, b->rbf_work);
}

static void correspondence(scene *b)
{
    const apsm_correspondence_options opt = apsm_correspondence_defaults();
    const apsm_correspondence_target target = { b->J, b->P, b->N, b->N6, b->h_j };
    double loss;
    must(apsm_correspondence_loss(&target, b->P2, b->N, &opt, &loss, b->grad, NULL));
}

static void neighbours(scene *b)
{
    must(apsm_neighbours6(b->J, b->P, b->N6));
}

/* The whole cohort of K shapes. */
static void eigenshape(scene *b)
{
    const apsm_eigenshape_options opt = apsm_eigenshape_defaults();
    double loss;
    must(apsm_eigenshape_loss(b->K, b->J, b->Y, &opt, &loss, b->L, NULL));
    for (size_t k = 0; k < b->K; k++)
        apsm_eigenshape_gradient(b->K, b->J, b->Y, b->L, &opt, k, b->scratch,
                                 b->scratch + 3 * b->J);
}

/* ---- the same, plainly ---- */

static void plain_sampling(scene *b)
{
    const double tau = b->h / 8.0;
    double *k = b->scratch, *w = b->scratch + b->J;
    memset(b->grad, 0, 3 * b->J * sizeof *b->grad);
    for (size_t r = 0; r < b->R; r++) {
        const double *x = b->B + 3 * r;
        double least = INFINITY, sum = 0.0, kbar = 0.0;
        for (size_t j = 0; j < b->J; j++) {
            const double *p = b->P + 3 * j;
            k[j] = sqrt((x[0] - p[0]) * (x[0] - p[0]) + (x[1] - p[1]) * (x[1] - p[1]) +
                        (x[2] - p[2]) * (x[2] - p[2]));
            if (k[j] < least) least = k[j];
        }
        for (size_t j = 0; j < b->J; j++) sum += w[j] = exp((least - k[j]) / tau);
        for (size_t j = 0; j < b->J; j++) kbar += (w[j] /= sum) * k[j];
        for (size_t j = 0; j < b->J; j++)
            for (size_t a = 0; a < 3; a++)
                b->grad[3 * j + a] +=
                    b->g[r] * w[j] * (1.0 - (k[j] - kbar) / tau) * (b->P[3 * j + a] - x[a]) / k[j];
        b->kbar[r] = kbar;
    }
}

static void plain_eval(scene *b)
{
    const size_t n = 3 * b->J;
    for (size_t r = 0; r < b->R; r++) {
        const double *x = b->B + 3 * r, *c = b->shape.c;
        double sum = c[0] + c[1] * x[0] + c[2] * x[1] + c[3] * x[2];
        for (size_t k = 0; k < n; k++) {
            const double *q = b->shape.Q + 3 * k;
            sum +=
                b->shape.w[k] * sqrt((x[0] - q[0]) * (x[0] - q[0]) + (x[1] - q[1]) * (x[1] - q[1]) +
                                     (x[2] - q[2]) * (x[2] - q[2]));
        }
        b->f[r] = sum;
    }
}

/* ---- measure ---- */

typedef void (*kernel)(scene *);

/* Least CPU seconds of runs that fill about a third of a second, at least 3. */
static double least_time(kernel fn, scene *b)
{
    double least = INFINITY, total = 0.0;
    for (int run = 0; run < 3 || (total < 0.3 && run < 1000); run++) {
        const clock_t start = clock();
        fn(b);
        const double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
        least = fmin(least, seconds);
        total += seconds;
    }
    return least;
}

static double report(const char *name, kernel fn, scene *b, double pairs, double reference)
{
    const double seconds = least_time(fn, b);
    printf("{\"kernel\": \"%s\", \"J\": %zu, \"R\": %zu, \"cpu_ms\": %.4f", name, b->J, b->R,
           1e3 * seconds);
    if (pairs > 0.0) printf(", \"ns_per_pair\": %.3f", 1e9 * seconds / pairs);
    if (reference > 0.0) printf(", \"times_faster\": %.2f", reference / seconds);
    if (fn == refit || fn == refit32) printf(", \"iterations\": %zu", b->iterations);
    printf("}\n");
    fflush(stdout);
    return seconds;
}

static void measure(size_t J)
{
    scene b = scene_new(J);
    const double jr = (double)J * (double)b.R, n = 3.0 * (double)J;
    double plain = report("sampling plain", plain_sampling, &b, jr, 0.0);
    report("sampling", sampling, &b, jr, plain);
    plain = report("rbf fit", fit, &b, 0.0, 0.0);
    report("rbf fit single", fit32, &b, 0.0, plain);
    report("rbf refit", refit, &b, 0.0, plain);
    report("rbf refit single", refit32, &b, 0.0, plain);
    fit(&b);
    plain = report("rbf eval plain", plain_eval, &b, 3.0 * jr, 0.0);
    report("rbf eval", eval, &b, 3.0 * jr, plain);
    report("rbf eval single", eval32, &b, 3.0 * jr, plain);
    report("rbf adjoint", adjoint, &b, 6.0 * jr + 2.0 * n * n, 0.0);
    report("correspondence", correspondence, &b, 6.0 * (double)J, 0.0);
    report("neighbours", neighbours, &b, (double)J * (double)J, 0.0);
    report("eigenshape of 32 shapes", eigenshape, &b, 0.0, 0.0);
    scene_free(&b);
}

int main(int argc, char **argv)
{
    static const size_t sizes[] = { 128, 512, 1024 };
    apsm_linalg_single_thread();
    for (size_t i = 0; i < 3 && argc == 1; i++) measure(sizes[i]);
    for (int i = 1; i < argc; i++) {
        const long J = strtol(argv[i], NULL, 10);
        if (J < 7) {
            fprintf(stderr, "bench_kernels: '%s' is not a number of particles (7 or more)\n",
                    argv[i]);
            return 2;
        }
        measure((size_t)J);
    }
    return 0;
}
