/* bench_align.c -- alignment of synthetic cohorts: JSON lines of CPU and wall seconds.  Shapes are
 * ellipsoids with asymmetric bumps, 5,120 faces, in random poses; the number of threads is the
 * first argument (default 1). */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "align/align.h"
#include "core/random.h"
#include "geometry/affine.h"
#include "shapes.h"

static double wall_seconds(void)
{
    struct timespec t;
    timespec_get(&t, TIME_UTC);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void random_pose(apsm_random *rng, double M[16])
{
    double A[9], R[9];
    for (size_t i = 0; i < 9; i++) A[i] = apsm_random_normal(rng);
    apsm_nearest_rotation(A, R);
    apsm_affine_identity(M);
    for (size_t i = 0; i < 9; i++) M[4 * (i / 3) + i % 3] = R[i];
    for (size_t r = 0; r < 3; r++) M[4 * r + 3] = 100.0 * apsm_random_normal(rng);
}

static apsm_mesh individual(size_t i)
{
    apsm_random rng = apsm_random_stream(0, APSM_STREAM_TEST, i, 0);
    apsm_mesh mesh = shape_icosphere(4);
    double M[16], k[3];
    for (size_t c = 0; c < 3; c++) k[c] = 1.0 + 0.1 * apsm_random_normal(&rng);
    for (size_t v = 0; v < mesh.nv; v++) {
        double *x = mesh.V + 3 * v;
        const double r = 1.0 + 0.2 * k[0] * x[0] + 0.15 * k[1] * x[1] + 0.3 * k[2] * x[0] * x[2] +
                         0.5 * x[0] * x[1] * x[2];
        shape_set3(x, 27 * r * x[0], 20 * r * x[1], 14 * r * x[2]);
    }
    random_pose(&rng, M);
    apsm_mesh_transform(&mesh, M);
    return mesh;
}

static int run(size_t n, int threads)
{
    apsm_mesh *mesh = malloc(n * sizeof *mesh);
    const apsm_mesh **list = malloc(n * sizeof *list);
    apsm_context *ctx = apsm_context_new();
    const apsm_align_options opt = apsm_align_defaults();
    apsm_alignment a;
    if (!mesh || !list || !ctx) abort();
    for (size_t i = 0; i < n; i++) {
        mesh[i] = individual(i);
        list[i] = &mesh[i];
    }
    apsm_context_set_threads(ctx, threads);
    const double wall = wall_seconds();
    const clock_t cpu = clock();
    const apsm_status status = apsm_align_cohort(ctx, n, list, NULL, &opt, &a);
    if (status == APSM_OK)
        printf("{\"bench\":\"align_cohort\",\"shapes\":%zu,\"faces\":5120,\"threads\":%d,"
               "\"cpu_s\":%.3f,\"wall_s\":%.3f}\n",
               n, threads, (double)(clock() - cpu) / CLOCKS_PER_SEC, wall_seconds() - wall);
    else
        fprintf(stderr, "%s\n", apsm_error_text(ctx));
    apsm_alignment_free(&a);
    apsm_context_free(ctx);
    for (size_t i = 0; i < n; i++) apsm_mesh_free(&mesh[i]);
    free(mesh);
    free(list);
    return status == APSM_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}

int main(int argc, char **argv)
{
    const int threads = argc > 1 ? atoi(argv[1]) : 1;
    const size_t sizes[] = { 8, 27, 100 };
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++)
        if (run(sizes[k], threads) != EXIT_SUCCESS) return EXIT_FAILURE;
    return EXIT_SUCCESS;
}
