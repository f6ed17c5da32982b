/* Closest points and rays on a torus of 10,080 and of 50,904 faces.  Limit of a query: the bytes of
 * one way down the tree (a node of 128 bytes a level, two leaves of 608) at the rate of memory; for
 * comparison the same by trying all triangles. */
#include "bench.h"
#include "geometry/bvh.h"
#include "shapes.h"

enum { QUERIES = 20000, FEW = 50 };

typedef struct bench {
    apsm_mesh mesh;
    apsm_bvh *bvh;
    double *X, sum; /* QUERIES x 3 */
} bench;

static void build(void *user)
{
    bench *b = user;
    apsm_bvh_free(b->bvh);
    bench_must(apsm_bvh_build(&b->mesh, &b->bvh));
}

static void closest(void *user)
{
    bench *b = user;
    apsm_closest c;
    for (size_t i = 0; i < QUERIES; i++) {
        apsm_bvh_closest(b->bvh, b->X + 3 * i, INFINITY, &c);
        b->sum += c.distance2;
    }
}

static void rays(void *user)
{
    bench *b = user;
    const double d[3] = { 0.3, -0.4, 0.5 };
    for (size_t i = 0; i < QUERIES; i++)
        b->sum += apsm_bvh_ray(b->bvh, b->X + 3 * i, d, 0.0, 1e3, NULL) < 1e3;
}

/* Squared distance of x to the segment pq. */
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
static void all_triangles(void *user)
{
    bench *b = user;
    const double *V = b->mesh.V;
    for (size_t i = 0; i < FEW; i++) {
        const double *x = b->X + 3 * i;
        double nearest = INFINITY;
        apsm_closest c;
        for (const uint32_t *F = b->mesh.F; F < b->mesh.F + 3 * b->mesh.nf; F += 3)
            nearest = fmin(nearest, triangle_distance2(x, V + 3 * (size_t)F[0],
                                                       V + 3 * (size_t)F[1], V + 3 * (size_t)F[2]));
        apsm_bvh_closest(b->bvh, x, INFINITY, &c);
        if (fabs(sqrt(nearest) - sqrt(c.distance2)) > 1e-12) exit(1);
    }
}

/* Uniform in the box about the torus, or within `off` of its surface. */
static void scatter(bench *b, double off)
{
    apsm_random rng = apsm_random_stream(1, APSM_STREAM_TEST, 0, 0);
    for (size_t i = 0; i < QUERIES; i++) {
        const apsm_surface_point p = { (uint32_t)apsm_random_below(&rng, b->mesh.nf),
                                       { 0.3, 0.3, 0.4 } };
        if (off > 0.0) apsm_surface_position(&b->mesh, &p, b->X + 3 * i);
        for (size_t c = 0; c < 3; c++) {
            const double u = 2.0 * apsm_random_uniform(&rng) - 1.0;
            b->X[3 * i + c] = off > 0.0 ? b->X[3 * i + c] + off * u : (c < 2 ? 13.0 : 3.0) * u;
        }
    }
}

static void measure(size_t around, size_t along, double stream)
{
    bench b = { .mesh = shape_torus(around, along, 10.0, 3.0), .X = bench_doubles(3 * QUERIES) };
    const double faces = (double)b.mesh.nf, levels = ceil(log(faces / 8.0) / log(4.0));
    const double way = (128.0 * levels + 1216.0) * stream;
    const char *what = "bytes of one way down";
    char size[64];
    snprintf(size, sizeof size, "\"faces\": %zu", b.mesh.nf);
    bench_report("tree of boxes", size, bench_median(build, &b), faces, "face",
                 "stream of its 140 bytes a face", 140.0 * faces * stream);
    scatter(&b, 0.2);
    bench_report("closest point near the surface", size, bench_median(closest, &b), QUERIES,
                 "query", what, QUERIES * way);
    bench_report("ray from near the surface", size, bench_median(rays, &b), QUERIES, "query", what,
                 QUERIES * way);
    scatter(&b, 0.0);
    bench_report("closest point in the box", size, bench_median(closest, &b), QUERIES, "query",
                 what, QUERIES * way);
    bench_report("closest point by all triangles", size, bench_median(all_triangles, &b), FEW,
                 "query", NULL, 0.0);
    if (!isfinite(b.sum)) exit(1); /* and keeps the sums from being optimised away */
    apsm_bvh_free(b.bvh);
    apsm_mesh_free(&b.mesh);
    free(b.X);
}

int main(void)
{
    const double stream = bench_limit_stream();
    measure(112, 45, stream);
    measure(252, 101, stream);
    return 0;
}
