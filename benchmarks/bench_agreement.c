/* Whether two models of one cohort, made with different templates, agree on what corresponds, where
 * the truth is not known:
 *
 *   bench_agreement MODEL_A MODEL_B
 *
 * The particles of B on shape i are carried to shape j by the particles of A and compared with
 * those of B there, over all pairs and both ways round.  Told as JSON: the mean distance, in the
 * unit of the inputs.  What both have wrong in the same way is not seen. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/particles.h"
#include "geometry/vec3.h"
#include "model/warp.h"
#include "truth_world.h"

typedef struct model {
    size_t I, J;
    double *P; /* I x J x 3, local */
} model;

static model read_model(apsm_context *ctx, const char *folder)
{
    apsm_project project = { 0 };
    char path[2048];
    model m = { 0 };
    snprintf(path, sizeof path, "%s/project.swproj", folder);
    must(ctx, apsm_project_read(ctx, path, &project));
    m.I = project.n;
    for (size_t i = 0; i < m.I; i++) {
        double *P;
        size_t J;
        snprintf(path, sizeof path, "%s/%s", folder, project.subjects[i].local_particles);
        must(ctx, apsm_points_read(ctx, path, &J, &P));
        if (i == 0) {
            m.J = J;
            m.P = malloc(m.I * 3 * J * sizeof *m.P);
        }
        if (!m.P || J != m.J) exit(1);
        memcpy(m.P + i * 3 * J, P, 3 * J * sizeof *P);
        free(P);
    }
    apsm_project_free(&project);
    return m;
}

/* Mean distance of b's particles from where a carries them. */
static double disagreement(apsm_context *ctx, const model *a, const model *b)
{
    double sum = 0, *Y = malloc(3 * b->J * sizeof *Y);
    if (!Y) exit(1);
    for (size_t i = 0; i < a->I; i++) {
        apsm_warp warp = { 0 };
        must(ctx, apsm_warp_build(ctx, APSM_PHI_R, b->J, b->P + i * 3 * b->J, a->J,
                                  a->P + i * 3 * a->J, &warp));
        for (size_t j = 0; j < a->I; j++) {
            if (j == i) continue;
            apsm_warp_apply(&warp, a->P + j * 3 * a->J, Y);
            for (size_t k = 0; k < b->J; k++)
                sum += sqrt(vec3_distance2(Y + 3 * k, b->P + 3 * (j * b->J + k)));
        }
        apsm_warp_free(&warp);
    }
    free(Y);
    return sum / (double)(a->I * (a->I - 1) * b->J);
}

int main(int argc, char **argv)
{
    apsm_context *ctx = apsm_context_new();
    if (argc != 3 || !ctx) {
        fprintf(stderr, "usage: bench_agreement MODEL_A MODEL_B\n");
        return 2;
    }
    model a = read_model(ctx, argv[1]), b = read_model(ctx, argv[2]);
    if (a.I != b.I || a.I < 2) return 1;
    printf("{\"bench\": \"agreement\", \"mean\": %.4g}\n",
           0.5 * (disagreement(ctx, &a, &b) + disagreement(ctx, &b, &a)));
    free(a.P);
    free(b.P);
    apsm_context_free(ctx);
    return 0;
}
