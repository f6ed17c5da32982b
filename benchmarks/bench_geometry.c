/* Closest points, rays and distance fields on one thread: JSON lines, CPU seconds, the best of
 * REPEATS runs.  The brute-force line tries all triangles of a small mesh, as a baseline of the
 * same machine and minute. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "apsm/distance_field.h"
#include "shapes.h"

enum { REPEATS = 5, QUERIES = 100000 };

static double cpu_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void must(apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "bench_geometry: %s\n", apsm_status_text(status));
    exit(1);
}

/* What one measurement works on. */
typedef struct bench {
    apsm_context *ctx;
    apsm_mesh mesh;
    apsm_bvh *bvh;
    apsm_field *field;
    double voxel, sum;
    double *X, *D, *N; /* QUERIES x 3, 1, 3 */
} bench;

static double best_of(void (*run)(bench *), bench *b)
{
    double best = INFINITY;
    for (int r = 0; r < REPEATS; r++) {
        const double start = cpu_seconds();
        run(b);
        best = fmin(best, cpu_seconds() - start);
    }
    return best;
}

static void report(const char *what, const bench *b, double seconds, double per, const char *unit)
{
    printf("{\"bench\":\"%s\",\"faces\":%zu,\"cpu_s\":%.6f,\"%s\":%.4g}\n", what, b->mesh.nf,
           seconds, unit, per);
}

static void build_tree(bench *b)
{
    apsm_bvh_free(b->bvh);
    must(apsm_bvh_build(&b->mesh, &b->bvh));
}

static void closest(bench *b)
{
    apsm_closest c;
    for (size_t i = 0; i < QUERIES; i++) {
        apsm_bvh_closest(b->bvh, b->X + 3 * i, INFINITY, &c);
        b->sum += c.distance2;
    }
}

static void rays(bench *b)
{
    const double d[3] = { 0.3, -0.4, 0.5 };
    for (size_t i = 0; i < QUERIES; i++)
        b->sum += apsm_bvh_ray(b->bvh, b->X + 3 * i, d, 0.0, 1e3, NULL) < 1e3;
}

static void build_field(bench *b)
{
    apsm_field_free(b->field);
    must(apsm_field_build(b->ctx, b->bvh, b->voxel, 3.0 * b->voxel, &b->field));
}

static void sample(bench *b)
{
    apsm_field_sample(b->field, QUERIES, b->X, b->D, b->N);
}

static void draw(bench *b)
{
    apsm_random rng = apsm_random_stream(2, APSM_STREAM_TEST, 0, 0);
    apsm_field_draw(b->field, &rng, 3.0 * b->voxel, QUERIES, b->X, b->D);
}

/* Uniform in the box about the torus, or within `off` of its surface. */
static void scatter(bench *b, double off)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    for (size_t i = 0; i < QUERIES; i++) {
        apsm_surface_point p = { (uint32_t)apsm_random_below(&rng, b->mesh.nf), { 0.3, 0.3, 0.4 } };
        if (off > 0.0) apsm_surface_position(&b->mesh, &p, b->X + 3 * i);
        for (size_t c = 0; c < 3; c++) {
            const double u = 2.0 * apsm_random_uniform(&rng) - 1.0;
            b->X[3 * i + c] = off > 0.0 ? b->X[3 * i + c] + off * u : (c < 2 ? 13.0 : 3.0) * u;
        }
    }
}

static void bench_queries(bench *b)
{
    double s = best_of(build_tree, b);
    report("tree build", b, s, s / (double)b->mesh.nf * 1e6, "us_per_face");
    scatter(b, 0.2);
    s = best_of(closest, b);
    report("closest point near the surface", b, s, s / QUERIES * 1e6, "us_per_query");
    s = best_of(rays, b);
    report("ray from near the surface", b, s, s / QUERIES * 1e6, "us_per_query");
    scatter(b, 0.0);
    s = best_of(closest, b);
    report("closest point in the box", b, s, s / QUERIES * 1e6, "us_per_query");
}

static void bench_field(bench *b)
{
    double s = best_of(build_field, b);
    report("field build, voxel 1.5 %, band 3 voxels", b, s,
           (double)apsm_field_bytes(b->field) / 1e6, "megabytes");
    s = best_of(draw, b);
    report("field draw", b, s, s / QUERIES * 1e9, "ns_per_point");
    s = best_of(sample, b);
    report("field sample, D and N", b, s, s / QUERIES * 1e9, "ns_per_point");
}

/* Segment pq, for the baseline. */
static double segment_distance2(const double *x, const double *p, const double *q)
{
    double e2 = 0.0, along = 0.0, d2 = 0.0;
    for (int c = 0; c < 3; c++) {
        e2 += (q[c] - p[c]) * (q[c] - p[c]);
        along += (q[c] - p[c]) * (x[c] - p[c]);
    }
    const double t = along <= 0.0 ? 0.0 : along >= e2 ? 1.0 : along / e2;
    for (int c = 0; c < 3; c++) {
        const double d = x[c] - p[c] - t * (q[c] - p[c]);
        d2 += d * d;
    }
    return d2;
}

/* The foot on the plane if it is inside, else the nearest edge. */
static double triangle_distance2(const double *x, const double *a, const double *b, const double *c)
{
    double u[3], v[3], w[3], n2 = 0.0, beta = 0.0, gamma = 0.0, height = 0.0;
    for (int k = 0; k < 3; k++) {
        u[k] = b[k] - a[k];
        v[k] = c[k] - a[k];
        w[k] = x[k] - a[k];
    }
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double n = u[i] * v[j] - u[j] * v[i];
        n2 += n * n;
        beta += n * (w[i] * v[j] - w[j] * v[i]);
        gamma += n * (u[i] * w[j] - u[j] * w[i]);
        height += n * w[k];
    }
    if (beta >= 0.0 && gamma >= 0.0 && beta + gamma <= n2) return height * height / n2;
    return fmin(segment_distance2(x, a, b),
                fmin(segment_distance2(x, b, c), segment_distance2(x, c, a)));
}

/* Every triangle for every query; must find what the tree finds. */
static void bench_brute_force(bench *b)
{
    enum { FEW = 100 };
    double worst = 0.0;
    const double start = cpu_seconds();
    for (size_t i = 0; i < FEW; i++) {
        const double *x = b->X + 3 * i;
        double nearest = INFINITY;
        apsm_closest c;
        for (size_t f = 0; f < b->mesh.nf; f++) {
            const uint32_t *F = b->mesh.F + 3 * f;
            nearest = fmin(nearest, triangle_distance2(x, b->mesh.V + 3 * (size_t)F[0],
                                                       b->mesh.V + 3 * (size_t)F[1],
                                                       b->mesh.V + 3 * (size_t)F[2]));
        }
        apsm_bvh_closest(b->bvh, x, INFINITY, &c);
        worst = fmax(worst, fabs(sqrt(nearest) - sqrt(c.distance2)));
    }
    const double s = cpu_seconds() - start;
    report("closest point without a tree", b, s, s / FEW * 1e6, "us_per_query");
    if (worst > 1e-12) exit(1);
}

static void run(apsm_context *ctx, size_t around, size_t along, double *scratch)
{
    bench b = { .ctx = ctx, .mesh = shape_torus(around, along, 10.0, 3.0), .voxel = 0.015 * 26.0 };
    b.X = scratch;
    b.D = scratch + 3 * QUERIES;
    b.N = scratch + 4 * QUERIES;
    bench_queries(&b);
    bench_brute_force(&b);
    bench_field(&b);
    if (!isfinite(b.sum)) exit(1); /* and keeps the sums from being optimised away */
    apsm_field_free(b.field);
    apsm_bvh_free(b.bvh);
    apsm_mesh_free(&b.mesh);
}

int main(void)
{
    apsm_context *ctx = apsm_context_new();
    double *scratch = malloc(7 * QUERIES * sizeof *scratch);
    if (!ctx || !scratch) return 1;
    run(ctx, 112, 45, scratch);  /* 10,080 faces */
    run(ctx, 252, 101, scratch); /* 50,904 */
    free(scratch);
    apsm_context_free(ctx);
    return 0;
}
