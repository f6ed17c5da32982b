/* The cheapest assignment (Hungarian method): bench_assignment [J ...].  Costs are distances
 * between two random samples of a sphere, as when samples are named after particles.  Limit: the
 * matrix read once for every row that is assigned, n^3 entries, at the rate of memory. */
#include "bench.h"
#include "initialize/assignment.h"

typedef struct bench {
    size_t n;
    double *cost, *row, *column_price;
    uint32_t *column;
    void *work;
} bench;

static void run(void *user)
{
    bench *b = user;
    bench_must(apsm_assign(b->n, b->cost, b->column, b->row, b->column_price, b->work));
}

static void measure(size_t n, double stream)
{
    bench b = { n,
                bench_doubles(n * n),
                bench_doubles(n),
                bench_doubles(n),
                bench_alloc(n * sizeof *b.column),
                bench_alloc(apsm_assign_work_size(n)) };
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, n, 0);
    double *X = bench_doubles(6 * n);
    char size[64];
    for (size_t i = 0; i < 2 * n; i++) {
        double *x = X + 3 * i, r2 = 0.0;
        for (int c = 0; c < 3; c++) {
            x[c] = apsm_random_normal(&rng);
            r2 += x[c] * x[c];
        }
        for (int c = 0; c < 3; c++) x[c] /= sqrt(r2);
    }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) {
            const double *x = X + 3 * i, *y = X + 3 * (n + j);
            b.cost[i * n + j] =
                acos(fmax(-1.0, fmin(1.0, x[0] * y[0] + x[1] * y[1] + x[2] * y[2])));
        }
    snprintf(size, sizeof size, "\"n\": %zu", n);
    const double cubed = (double)n * (double)n * (double)n;
    bench_report("assignment", size, bench_median(run, &b), (double)n, "row",
                 "n^3 entries at the stream's rate", cubed * sizeof(double) * stream);
    free(X);
    free(b.cost);
    free(b.row);
    free(b.column_price);
    free(b.column);
    free(b.work);
}

int main(int argc, char **argv)
{
    size_t sizes[16] = { 128, 512, 1024 };
    const size_t n = bench_sizes(argc, argv, sizes, 3);
    const double stream = bench_limit_stream();
    for (size_t i = 0; i < n; i++) measure(sizes[i], stream);
    return 0;
}
