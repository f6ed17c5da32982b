/* How far the poses of a groomed cohort are from those of the known correspondence, one line of
 * JSON a shape and one for all:
 *
 *   bench_truth_poses TRUTH_DIR MODEL_DIR
 *
 * TRUTH_DIR as for bench_truth; MODEL_DIR has been groomed.  The true pose of a shape is the rigid
 * fit of its vertices to the template's, of those that were not cut off.  Told are the angle
 * between the two and the root mean square distance of these vertices, relative to that of the
 * template's from their centre. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/bvh.h"
#include "truth_world.h"

/* present (nv): whether the vertex is on the groomed mesh, and not where the shape was cut off. */
static void find_present(apsm_context *ctx, const char *model, const apsm_subject *s,
                         const apsm_mesh *truth, double near, bool *present)
{
    apsm_mesh mesh = read_groomed(ctx, model, s);
    apsm_bvh *bvh;
    must(ctx, apsm_bvh_build(&mesh, &bvh));
    for (size_t v = 0; v < truth->nv; v++) {
        apsm_closest c;
        apsm_bvh_closest(bvh, truth->V + 3 * v, INFINITY, &c);
        present[v] = c.distance2 < near * near;
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
}

static double rms(size_t n, const double *w, const double *x, const double *y)
{
    double sum = 0, weight = 0;
    for (size_t v = 0; v < n; v++) {
        weight += w[v];
        for (size_t c = 3 * v; c < 3 * v + 3; c++) sum += w[v] * (x[c] - y[c]) * (x[c] - y[c]);
    }
    return sqrt(sum / weight);
}

static double radius(const apsm_mesh *mesh)
{
    double c[3] = { 0 }, sum = 0;
    for (size_t k = 0; k < 3 * mesh->nv; k++) c[k % 3] += mesh->V[k] / (double)mesh->nv;
    for (size_t k = 0; k < 3 * mesh->nv; k++)
        sum += (mesh->V[k] - c[k % 3]) * (mesh->V[k] - c[k % 3]);
    return sqrt(sum / (double)mesh->nv);
}

/* Of one shape's pose. */
typedef struct pose_error {
    double degrees, apart;
} pose_error;

static pose_error error_of(const apsm_mesh *mesh, const bool *here, const apsm_mesh *fixed,
                           const bool *there)
{
    const size_t n = mesh->nv;
    double M[16], *V = malloc(4 * n * sizeof *V);
    if (!V || n != fixed->nv) exit(1);
    for (size_t v = 0; v < n; v++) V[3 * n + v] = here[v] && there[v];
    apsm_affine_fit(n, mesh->V, fixed->V, V + 3 * n, 0, M);
    apsm_affine_apply(M, n, mesh->V, V);
    const double cosine = 0.5 * (M[0] + M[5] + M[10] - 1);
    const pose_error e = { acos(fmin(fmax(cosine, -1), 1)) * 180 / M_PI,
                           rms(n, V + 3 * n, mesh->V, V) / radius(fixed) };
    free(V);
    return e;
}

int main(int argc, char **argv)
{
    apsm_context *ctx = apsm_context_new();
    apsm_project project = { 0 };
    char path[2048];
    if (argc != 3 || !ctx) {
        fprintf(stderr, "usage: bench_truth_poses TRUTH_DIR MODEL_DIR\n");
        return 2;
    }
    snprintf(path, sizeof path, "%s/project.swproj", argv[2]);
    must(ctx, apsm_project_read(ctx, path, &project));
    const char *name = apsm_project_get(&project, "apsm", "template_used");
    const size_t t = name ? apsm_project_find(&project, name) : project.n;
    if (t == project.n) return 1;
    apsm_mesh fixed = read_truth(ctx, argv[1], &project.subjects[t]);
    const double near = 0.02 * radius(&fixed);
    double sum = 0, most = 0, widest = 0;
    size_t wrong = 0;
    bool *there = malloc(fixed.nv), *here = malloc(fixed.nv);
    if (!there || !here) return 1;
    find_present(ctx, argv[2], &project.subjects[t], &fixed, near, there);
    for (size_t i = 0; i < project.n; i++) {
        if (i == t) continue;
        apsm_mesh mesh = read_truth(ctx, argv[1], &project.subjects[i]);
        find_present(ctx, argv[2], &project.subjects[i], &mesh, near, here);
        const pose_error e = error_of(&mesh, here, &fixed, there);
        printf("{\"bench\": \"truth_poses\", \"shape\": \"%s\", \"degrees\": %.3g, "
               "\"apart\": %.3g}\n",
               project.subjects[i].name, e.degrees, e.apart);
        sum += e.apart;
        most = fmax(most, e.apart);
        widest = fmax(widest, e.degrees);
        wrong += e.degrees > 45;
        apsm_mesh_free(&mesh);
    }
    printf("{\"bench\": \"truth_poses\", \"shapes\": %zu, \"mean_apart\": %.3g, "
           "\"most_apart\": %.3g, \"most_degrees\": %.3g, \"wrong\": %zu}\n",
           project.n - 1, sum / (double)(project.n - 1), most, widest, wrong);
    free(there);
    free(here);
    apsm_mesh_free(&fixed);
    apsm_project_free(&project);
    apsm_context_free(ctx);
    return 0;
}
