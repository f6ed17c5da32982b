/* Times grooming: bench_groom [FILE.ply ...].  Without files: remeshing of an ellipsoid of 82,000
 * faces, and segmentations of a bone-like body in a 128^3 region, cubic voxels and 1:1:4.  Each
 * file is groomed to 10,000 faces.  One JSON line each: least CPU seconds of five runs. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "apsm/formats.h"
#include "groom/groom.h"
#include "shapes.h"
#include "solids.h"

enum { RUNS = 5 };

static void must(apsm_context *ctx, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "bench_groom: %s: %s\n", apsm_status_text(status), apsm_error_text(ctx));
    exit(1);
}

static double seconds(clock_t from)
{
    return (double)(clock() - from) / CLOCKS_PER_SEC;
}

static void bench_mesh(apsm_context *ctx, const char *name, const apsm_mesh *mesh)
{
    double all = INFINITY, remesh = INFINITY;
    apsm_remesh_report r;
    apsm_bvh *tree;
    must(ctx, apsm_bvh_build(mesh, &tree));
    for (int i = 0; i < RUNS; i++) {
        apsm_mesh out;
        clock_t t = clock();
        must(ctx, apsm_remesh(ctx, mesh, tree, NULL, &out, NULL));
        remesh = fmin(remesh, seconds(t));
        apsm_mesh_free(&out);
        t = clock();
        must(ctx, apsm_groom_mesh(ctx, name, mesh, NULL, &out, NULL));
        all = fmin(all, seconds(t));
        apsm_mesh_free(&out);
    }
    apsm_mesh out;
    must(ctx, apsm_remesh(ctx, mesh, tree, NULL, &out, &r));
    printf("{\"kernel\":\"remesh\",\"shape\":\"%s\",\"faces_before\":%zu,\"faces\":%zu,"
           "\"remesh_s\":%.3f,\"groom_s\":%.3f,\"mean\":%.3g,\"max\":%.3g,\"min_angle\":%.1f}\n",
           name, mesh->nf, out.nf, remesh, all, r.backward_mean, r.backward_max, r.min_angle);
    apsm_mesh_free(&out);
    apsm_bvh_free(tree);
}

static void bench_mask(apsm_context *ctx, double slice)
{

    apsm_volume v = solid_mask(solid_bone, (const double[3]){ 0.4, 0.4, 0.4 * slice }, 0, 3);
    apsm_groom_options opt = apsm_groom_defaults();
    apsm_groom_report r;
    double surface = INFINITY, all = INFINITY;
    for (int i = 0; i < 2 * RUNS; i++) {
        apsm_mesh out;
        opt.remesh = i % 2;
        const clock_t t = clock();
        must(ctx, apsm_groom_segmentation(ctx, "bone", &v, &opt, &out, &r));
        if (opt.remesh)
            all = fmin(all, seconds(t));
        else
            surface = fmin(surface, seconds(t));
        apsm_mesh_free(&out);
    }
    printf("{\"kernel\":\"segmentation\",\"image\":[%zu,%zu,%zu],\"refine\":%d,\"voxels\":%zu,"
           "\"surface_s\":%.3f,\"groom_s\":%.3f,\"volume\":%.4f}\n",
           v.n[0], v.n[1], v.n[2], r.supersampling[2], r.voxels, surface, all, r.smoothing_volume);
    apsm_volume_free(&v);
}

int main(int argc, char **argv)
{
    apsm_context *ctx = apsm_context_new();
    if (!ctx) return 1;
    for (int i = 1; i < argc; i++) {
        apsm_mesh mesh;
        must(ctx, apsm_read_mesh(ctx, argv[i], &mesh));
        bench_mesh(ctx, argv[i], &mesh);
        apsm_mesh_free(&mesh);
    }
    if (argc == 1) {
        apsm_mesh mesh = shape_ellipsoid(6, 40, 20, 15);
        bench_mesh(ctx, "ellipsoid", &mesh);
        apsm_mesh_free(&mesh);
        bench_mask(ctx, 1.0);
        bench_mask(ctx, 4.0);
    }
    apsm_context_free(ctx);
    return 0;
}
