/* The narrow-band distance field of a torus of 10,080 faces, voxels of 1.5 % of its extent: built
 * with the band that a run needs (2.2 voxels) and with a wider one, limit the exact closest point
 * of every node in it; near-surface points drawn in a band of 2 voxels and D and N looked up, limit
 * the 8 and 32 values that interpolation needs, a cache line for every four. */
#include "bench.h"
#include "geometry/distance_field.h"
#include "shapes.h"

enum { POINTS = 20000 };

typedef struct bench {
    apsm_context *ctx;
    apsm_mesh mesh;
    apsm_bvh *bvh;
    apsm_field *field;
    double voxel, band, sum;
    double *X, *D, *N;
} bench;

static void build(void *user)
{
    bench *b = user;
    apsm_field_free(b->field);
    bench_must(apsm_field_build(b->ctx, b->bvh, b->voxel, b->band, &b->field));
}

static void draw(void *user)
{
    bench *b = user;
    apsm_random rng = apsm_random_stream(2, APSM_STREAM_TEST, 0, 0);
    apsm_field_draw(b->field, &rng, 2.0 * b->voxel, POINTS, b->X, b->D);
}

static void sample(void *user)
{
    bench *b = user;
    apsm_field_sample(b->field, POINTS, b->X, b->D, b->N);
}

static void exact(void *user)
{
    bench *b = user;
    for (size_t i = 0; i < POINTS; i++)
        b->sum += apsm_bvh_signed_distance(b->bvh, b->X + 3 * i, NULL);
}

int main(void)
{
    bench b = { .ctx = apsm_context_new(),
                .mesh = shape_torus(112, 45, 10.0, 3.0),
                .voxel = 0.015 * 26.0 };
    const double area = apsm_mesh_area(&b.mesh), stream = bench_limit_stream();
    char size[64];
    if (!b.ctx) return 1;
    b.X = bench_doubles(7 * POINTS);
    b.D = b.X + 3 * POINTS;
    b.N = b.D + POINTS;
    bench_must(apsm_bvh_build(&b.mesh, &b.bvh));
    const double bands[] = { 4.4, 2.2 }; /* in voxels */
    for (int k = 0; k < 2; k++) {
        b.band = bands[k] * b.voxel;
        const double nodes = 2.0 * (bands[k] + 1.75) * area / (b.voxel * b.voxel);
        const double seconds = bench_median(build, &b);
        draw(&b);
        snprintf(size, sizeof size, "\"faces\": %zu, \"band_voxels\": %g, \"megabytes\": %.2f",
                 b.mesh.nf, bands[k], (double)apsm_field_bytes(b.field) / 1e6);
        bench_report("distance field", size, seconds, nodes, "node",
                     "closest point of each node near the surface",
                     nodes / POINTS * bench_median(exact, &b));
    }
    bench_report("points in the band", size, bench_median(draw, &b), POINTS, "point",
                 "stream of 2 cache lines", POINTS * 128.0 * stream);
    bench_report("D and N", size, bench_median(sample, &b), POINTS, "point",
                 "stream of 8 cache lines", POINTS * 512.0 * stream);
    if (!isfinite(b.sum)) exit(1);
    apsm_field_free(b.field);
    apsm_bvh_free(b.bvh);
    apsm_mesh_free(&b.mesh);
    apsm_context_free(b.ctx);
    free(b.X);
    return 0;
}
