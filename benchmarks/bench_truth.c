/* How far a model's particles are from a known correspondence, as JSON:
 *
 *   bench_truth TRUTH_DIR MODEL_DIR
 *
 * TRUTH_DIR/NAME.ply are the shapes on one triangulation, in the frame of the inputs
 * (make_synthetic writes them); MODEL_DIR is a model made with --original-frame.  Every particle of
 * every shape is carried to the template along the triangulation; its distance from the template's
 * own particle is the error.  Also told: the share of particles that are more than two spacings
 * off.  Groups of the shapes are not told apart: the template is one of them, with error 0, and
 * left out. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/adapters.h"
#include "apsm/points_file.h"
#include "apsm/project.h"
#include "optimize/correspondence_loss.h"
#include "synthetic.h"

static void check(apsm_context *ctx, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "bench_truth: %s %s\n", apsm_status_text(status), apsm_error_text(ctx));
    exit(1);
}

typedef struct shape {
    apsm_mesh mesh;
    size_t J;
    double *P; /* J x 3 */
} shape;

static shape read_shape(apsm_context *ctx, const char *truth, const char *model, const char *name)
{
    char path[2048];
    shape s = { 0 };
    snprintf(path, sizeof path, "%s/%s.ply", truth, name);
    check(ctx, apsm_vtk_read_mesh(ctx, path, &s.mesh));
    snprintf(path, sizeof path, "%s/particles/%s_original.particles", model, name);
    check(ctx, apsm_points_read(ctx, path, &s.J, &s.P));
    return s;
}

static void free_shape(shape *s)
{
    apsm_mesh_free(&s->mesh);
    free(s->P);
}

/* error (J, out): of the particles of one shape. */
static void errors_of(apsm_context *ctx, const shape *t, const shape *s, double *error)
{
    apsm_bvh *bvh;
    check(ctx, apsm_bvh_build(&s->mesh, &bvh));
    for (size_t j = 0; j < s->J; j++)
        error[j] = synthetic_truth_error(bvh, &t->mesh, 1, s->P + 3 * j, t->P + 3 * j);
    apsm_bvh_free(bvh);
}

static double spacing(apsm_context *ctx, const shape *t)
{
    uint32_t *N6 = malloc(t->J * APSM_NEIGHBOURS * sizeof *N6);
    if (!N6) exit(1);
    check(ctx, apsm_neighbours6(t->J, t->P, N6));
    const double h = apsm_spacing(t->J, t->P, N6, NULL);
    free(N6);
    return h;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void tell(size_t n, double *error, double h)
{
    double sum = 0;
    size_t lost = 0;
    qsort(error, n, sizeof *error, ascending);
    for (size_t k = 0; k < n; k++) sum += error[k], lost += error[k] > 2 * h;
    printf(
        "{\"bench\": \"truth\", \"mean\": %.4g, \"median\": %.4g, \"p95\": %.4g, \"lost\": %.4g, "
        "\"h\": %.4g}\n",
        sum / (double)n, error[n / 2], error[n - 1 - n / 20], (double)lost / (double)n, h);
}

int main(int argc, char **argv)
{
    apsm_context *ctx = apsm_context_new();
    apsm_project project = { 0 };
    char path[2048];
    if (argc != 3 || !ctx) {
        fprintf(stderr, "usage: bench_truth TRUTH_DIR MODEL_DIR\n");
        return 2;
    }
    snprintf(path, sizeof path, "%s/project.swproj", argv[2]);
    check(ctx, apsm_project_read(ctx, path, &project));
    const char *name = apsm_project_get(&project, "apsm", "template_used");
    if (!name) return 1;
    shape t = read_shape(ctx, argv[1], argv[2], name);
    double *error = malloc(project.n * t.J * sizeof *error);
    size_t n = 0;
    if (!error) return 1;
    for (size_t i = 0; i < project.n; i++) {
        if (strcmp(project.subjects[i].name, name) == 0) continue;
        shape s = read_shape(ctx, argv[1], argv[2], project.subjects[i].name);
        errors_of(ctx, &t, &s, error + n);
        n += t.J;
        free_shape(&s);
    }
    tell(n, error, spacing(ctx, &t));
    free_shape(&t);
    free(error);
    apsm_project_free(&project);
    apsm_context_free(ctx);
    return 0;
}
