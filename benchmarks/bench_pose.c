/* Alignment of real tali from any pose (data/talus): a second talus in 100 random rigid poses, and
 * the mirror image of every talus.  JSON lines.  Usage: bench_pose [FOLDER [POSES]] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "apsm/formats.h"
#include "core/random.h"
#include "geometry/affine.h"
#include "input/input.h"

enum { POINTS = 400 };

/* A mesh with what registration needs. */
typedef struct model {
    apsm_mesh mesh;
    apsm_bvh *bvh;
    apsm_cloud cloud;
    apsm_surface surface;
} model;

static void check(apsm_context *ctx, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "bench_pose: %s %s\n", apsm_status_text(status), apsm_error_text(ctx));
    exit(1);
}

static void prepare(apsm_context *ctx, model *m, uint64_t index)
{
    check(ctx, apsm_bvh_build(&m->mesh, &m->bvh));
    check(ctx, apsm_cloud_sample(&m->mesh, POINTS, 1, index, &m->cloud));
    m->surface = (apsm_surface){ m->bvh, &m->cloud };
}

static void release(model *m)
{
    apsm_cloud_free(&m->cloud);
    apsm_bvh_free(m->bvh);
    apsm_mesh_free(&m->mesh);
}

/* A uniformly random rotation (from a normal quaternion) and a translation of up to 5 sizes. */
static void random_pose(apsm_random *rng, double size, double M[16])
{
    double q[4], n = 0;
    for (int k = 0; k < 4; k++) q[k] = apsm_random_normal(rng), n += q[k] * q[k];
    for (int k = 0; k < 4; k++) q[k] /= sqrt(n);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double R[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
        2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
        2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)
    };
    apsm_affine_identity(M);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) M[4 * r + c] = R[3 * r + c];
        M[4 * r + 3] = 5 * size * (2 * apsm_random_uniform(rng) - 1);
    }
}

static double residual_of(const model *moving, const model *fixed, double *work)
{
    const apsm_icp_options o = apsm_icp_defaults();
    apsm_pose pose;
    apsm_pose_search(&moving->surface, &fixed->surface, false, &o, &pose, work);
    return pose.residual;
}

static void random_poses(apsm_context *ctx, const model *a, const model *b, int poses, double *work)
{
    double best = INFINITY, worst = 0;
    apsm_random rng = apsm_random_stream(2026, APSM_STREAM_TEST, 0, 0);
    for (int k = 0; k < poses; k++) {
        double M[16];
        model moved = { 0 };
        random_pose(&rng, b->cloud.radius, M);
        check(ctx, apsm_mesh_copy(&b->mesh, &moved.mesh));
        apsm_mesh_transform(&moved.mesh, M);
        prepare(ctx, &moved, 1);
        const double r = residual_of(&moved, a, work);
        best = fmin(best, r);
        worst = fmax(worst, r);
        release(&moved);
    }
    printf("{\"bench\": \"random poses\", \"poses\": %d, \"best_residual\": %.6g, "
           "\"worst_residual\": %.6g, \"within_1_percent\": %s}\n",
           poses, best, worst, worst <= 1.01 * best ? "true" : "false");
}

/* The cohort as it comes, left and right: the rarer side must be the one that looks mirrored. */
static void mirrors(apsm_context *ctx, const model *m, const apsm_input_list *list)
{
    const apsm_mesh **meshes = calloc(list->n, sizeof *meshes);
    apsm_align_options o = apsm_align_defaults();
    apsm_alignment a = { 0 };
    if (!meshes) exit(1);
    for (size_t i = 0; i < list->n; i++) meshes[i] = &m[i].mesh;
    check(ctx, apsm_align_cohort(ctx, list->n, meshes, NULL, &o, &a));
    size_t left = 0, agree = 0;
    for (size_t i = 0; i < list->n; i++) left += strstr(list->cases[i].name, "_L_") != NULL;
    for (size_t i = 0; i < list->n; i++) {
        const bool rarer = (strstr(list->cases[i].name, "_L_") != NULL) == (2 * left < list->n);
        agree += a.mirrored[i] == rarer;
    }
    printf("{\"bench\": \"mirror\", \"shapes\": %zu, \"left\": %zu, \"right_verdicts\": %zu}\n",
           list->n, left, agree);
    apsm_alignment_free(&a);
    free(meshes);
}

int main(int argc, char **argv)
{
    const char *folder = argc > 1 ? argv[1] : "data/talus";
    const int poses = argc > 2 ? atoi(argv[2]) : 100;
    apsm_context *ctx = apsm_context_new();
    apsm_input_list list = { 0 };
    if (!ctx) return 1;
    check(ctx, apsm_input_expand(ctx, 1, &folder, NULL, NULL, &list));
    model *m = calloc(list.n, sizeof *m);
    double *work = malloc(apsm_icp_work_size(POINTS) * sizeof *work);
    if (!m || !work || list.n < 3) return 1;
    for (size_t i = 0; i < list.n; i++) {
        check(ctx, apsm_read_mesh(ctx, list.cases[i].path, &m[i].mesh));
        prepare(ctx, &m[i], 1);
    }
    random_poses(ctx, &m[0], &m[1], poses, work);
    mirrors(ctx, m, &list);
    for (size_t i = 0; i < list.n; i++) release(&m[i]);
    free(m);
    free(work);
    apsm_input_list_free(&list);
    apsm_context_free(ctx);
    return 0;
}
