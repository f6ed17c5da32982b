/* What a model is worth where the true correspondence is known, as one line of JSON:
 *
 *   bench_truth TRUTH_DIR MODEL_DIR [groomed]
 *
 * TRUTH_DIR/NAME.ply are the shapes on one triangulation, in the frame of the inputs
 * (make_synthetic writes them); MODEL_DIR is a model.  All is measured in the frame of the aligned
 * shapes, and the template, whose errors are 0, is left out of every mean.
 *
 *   truth      every particle of every shape, carried to the template along the triangulation: its
 *              distance from the template's own particle; `lost` are more than two spacings off;
 * those that lie off the true surface, on the lid of a filled opening, do not count landmark
 * LANDMARKS vertices of the template, spread evenly, which no particle knows of, warped to a shape
 * by the particles: distance from the true place there distance   two-way, of the true surfaces
 * (with `groomed`, of the groomed ones: what was cut off has no particles), with the template
 * warped; `other`: the mean over OTHERS other shapes in the template's place, which no fit knew of
 * model      G(1), S(1), C(1); `own`: those of the template's particles carried to all shapes by
 * the truth */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/particles.h"
#include "evaluate/metrics.h"
#include "geometry/vec3.h"
#include "optimize/correspondence_loss.h"
#include "synthetic.h"
#include "truth_world.h"

enum { LANDMARKS = 64, OTHERS = 4 };

typedef struct judge {
    apsm_context *ctx;
    size_t I, J, t;     /* t: the template */
    apsm_mesh *truth;   /* I */
    apsm_mesh *surface; /* I: what distances are measured to */
    apsm_bvh **bvh;     /* I: of truth */
    double *P;          /* I x J x 3 */
} judge;

static void *have(void *memory)
{
    if (memory) return memory;
    fprintf(stderr, "bench_truth: out of memory\n");
    exit(1);
}

static double *doubles(size_t n)
{
    return have(calloc(n, sizeof(double)));
}

static double *particles(const judge *j, size_t i)
{
    return j->P + i * 3 * j->J;
}

static void read_shape(judge *j, const apsm_project *project, const char *truth, const char *model,
                       bool groomed, size_t i)
{
    const apsm_subject *s = &project->subjects[i];
    char *path = have(apsm_project_path(project, s->world_particles));
    double *P;
    size_t J;
    j->truth[i] = read_truth(j->ctx, truth, s);
    j->surface[i] = groomed ? read_groomed(j->ctx, model, s) : j->truth[i];
    must(j->ctx, apsm_bvh_build(&j->truth[i], &j->bvh[i]));
    must(j->ctx, apsm_points_read(j->ctx, path, &J, &P));
    if (i == 0) {
        j->J = J;
        j->P = doubles(j->I * 3 * J);
    }
    if (J == j->J) memcpy(particles(j, i), P, 3 * J * sizeof *P);
    free(P);
    free(path);
}

static judge read_all(apsm_context *ctx, const char *truth, const char *model, bool groomed)
{
    apsm_project project = { 0 };
    char path[2048];
    snprintf(path, sizeof path, "%s/project.swproj", model);
    must(ctx, apsm_project_read(ctx, path, &project));
    const char *name = apsm_project_get(&project, "apsm", "template_used");
    judge j = { .ctx = ctx, .I = project.n };
    j.t = name ? apsm_project_find(&project, name) : project.n;
    if (j.t == project.n) exit(1);
    j.truth = have(calloc(j.I, sizeof *j.truth));
    j.surface = have(calloc(j.I, sizeof *j.surface));
    j.bvh = have(calloc(j.I, sizeof *j.bvh));
    for (size_t i = 0; i < j.I; i++) read_shape(&j, &project, truth, model, groomed, i);
    apsm_project_free(&project);
    return j;
}

static void free_all(judge *j)
{
    for (size_t i = 0; i < j->I; i++) {
        if (j->surface[i].V != j->truth[i].V) apsm_mesh_free(&j->surface[i]);
        apsm_bvh_free(j->bvh[i]);
        apsm_mesh_free(&j->truth[i]);
    }
    free(j->truth);
    free(j->surface);
    free(j->bvh);
    free(j->P);
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double spacing(const judge *j)
{
    const double *T = particles(j, j->t);
    uint32_t *N6 = have(malloc(j->J * APSM_NEIGHBOURS * sizeof *N6));
    must(j->ctx, apsm_neighbours6(j->J, T, N6));
    const double h = apsm_spacing(j->J, T, N6, NULL);
    free(N6);
    return h;
}

static bool is_on(const judge *j, size_t i, size_t k, double h)
{
    apsm_closest at;
    apsm_bvh_closest(j->bvh[i], particles(j, i) + 3 * k, INFINITY, &at);
    return at.distance2 < 0.0625 * h * h;
}

static void tell_truth(const judge *j)
{
    const double *T = particles(j, j->t), h = spacing(j);
    double *error = doubles(j->I * j->J), sum = 0;
    size_t n = 0, lost = 0;
    for (size_t i = 0; i < j->I; i++)
        for (size_t k = 0; i != j->t && k < j->J; k++) {
            double y[3];
            if (!is_on(j, j->t, k, h) || !is_on(j, i, k, h)) continue;
            synthetic_carry(j->bvh[i], &j->truth[j->t], particles(j, i) + 3 * k, y);
            error[n] = sqrt(vec3_distance2(y, T + 3 * k));
            sum += error[n];
            lost += error[n++] > 2 * h;
        }
    qsort(error, n, sizeof *error, ascending);
    printf("\"truth\": {\"mean\": %.4g, \"median\": %.4g, \"p95\": %.4g, \"lost\": %.4g, "
           "\"h\": %.4g}, ",
           sum / (double)n, error[n / 2], error[n - 1 - n / 20], (double)lost / (double)n, h);
    free(error);
}

/* Vertices of the template, each the farthest from those before, the first the farthest from the
 * centre. */
static void choose_landmarks(const apsm_mesh *mesh, uint32_t landmark[LANDMARKS])
{
    double *nearest = doubles(mesh->nv), from[3] = { 0 };
    for (size_t k = 0; k < 3 * mesh->nv; k++) from[k % 3] += mesh->V[k] / (double)mesh->nv;
    for (size_t l = 0; l < LANDMARKS; l++) {
        uint32_t best = 0;
        for (uint32_t v = 0; v < mesh->nv; v++) {
            const double d2 = vec3_distance2(mesh->V + 3 * (size_t)v, from);
            nearest[v] = l < 2 ? d2 : fmin(nearest[v], d2);
            if (nearest[v] > nearest[best]) best = v;
        }
        landmark[l] = best;
        memcpy(from, mesh->V + 3 * (size_t)best, sizeof from);
    }
    free(nearest);
}

/* Whether the vertex is still there where its shape was cut off. */
static bool is_here(const judge *j, const apsm_bvh *surface, size_t i, uint32_t v, double near)
{
    apsm_closest c;
    apsm_bvh_closest(surface, j->truth[i].V + 3 * (size_t)v, INFINITY, &c);
    return c.distance2 < near * near;
}

static void tell_landmarks(const judge *j)
{
    uint32_t landmark[LANDMARKS];
    double X[3 * LANDMARKS], Y[3 * LANDMARKS], sum = 0;
    apsm_warp warp = { 0 };
    apsm_bvh *own;
    size_t n = 0;
    const double near = 0.2 * spacing(j);
    choose_landmarks(&j->truth[j->t], landmark);
    for (size_t l = 0; l < LANDMARKS; l++)
        memcpy(X + 3 * l, j->truth[j->t].V + 3 * (size_t)landmark[l], 3 * sizeof *X);
    must(j->ctx,
         apsm_warp_build(j->ctx, APSM_PHI_R, LANDMARKS, X, j->J, particles(j, j->t), &warp));
    must(j->ctx, apsm_bvh_build_unsigned(&j->surface[j->t], &own));
    for (size_t i = 0; i < j->I; i++) {
        apsm_bvh *bvh;
        if (i == j->t) continue;
        must(j->ctx, apsm_bvh_build_unsigned(&j->surface[i], &bvh));
        apsm_warp_apply(&warp, particles(j, i), Y);
        for (size_t l = 0; l < LANDMARKS; l++) {
            if (!is_here(j, own, j->t, landmark[l], near) || !is_here(j, bvh, i, landmark[l], near))
                continue;
            sum += sqrt(vec3_distance2(Y + 3 * l, j->truth[i].V + 3 * (size_t)landmark[l]));
            n++;
        }
        apsm_bvh_free(bvh);
    }
    apsm_bvh_free(own);
    apsm_warp_free(&warp);
    printf("\"landmark\": %.4g, ", sum / (double)n);
}

/* Two-way, with shape t in the template's place; two[0] mean, two[1] mean of the maxima. */
static void measure_distance(const judge *j, size_t t, double two[2])
{
    const apsm_mesh *mesh = &j->surface[t];
    apsm_surface_distance *d = have(calloc(j->I, sizeof *d));
    const apsm_mesh_source source = apsm_mesh_source_array(j->surface);
    apsm_warp warp = { 0 };
    must(j->ctx,
         apsm_warp_build(j->ctx, APSM_PHI_R, mesh->nv, mesh->V, j->J, particles(j, t), &warp));
    must(j->ctx, apsm_surface_distances(j->ctx, &warp, mesh, j->I, j->P, &source, d));
    two[0] = two[1] = 0;
    for (size_t i = 0; i < j->I; i++) {
        if (i == t) continue;
        two[0] += d[i].two_way.mean / (double)(j->I - 1);
        two[1] += d[i].two_way.max / (double)(j->I - 1);
    }
    apsm_warp_free(&warp);
    free(d);
}

static void tell_distances(const judge *j)
{
    double own[2], other[2] = { 0 };
    const size_t others = j->I - 1 < OTHERS ? j->I - 1 : OTHERS;
    measure_distance(j, j->t, own);
    for (size_t k = 0; k < others; k++) {
        double two[2];
        measure_distance(j, (j->t + 1 + k * (j->I - 1) / others) % j->I, two);
        for (size_t c = 0; c < 2; c++) other[c] += two[c] / (double)others;
    }
    printf("\"distance\": {\"mean\": %.4g, \"mean_max\": %.4g}, "
           "\"other\": {\"mean\": %.4g, \"mean_max\": %.4g}, ",
           own[0], own[1], other[0], other[1]);
}

static void tell_model(const judge *j, const char *name, const double *P, const char *end)
{
    const apsm_evaluate_input in = {
        .I = j->I, .J = j->J, .P = P, .options = { .specificity_modes = 1 }
    };
    apsm_evaluation e;
    must(j->ctx, apsm_evaluate(j->ctx, &in, &e));
    printf("\"%s\": {\"G\": %.4g, \"S\": %.4g, \"C\": %.4g}%s", name, e.generalization[0],
           e.specificity[0], e.compactness[0], end);
    apsm_evaluation_free(&e);
}

static void tell_models(const judge *j)
{
    double *P = doubles(j->I * 3 * j->J);
    const double *T = particles(j, j->t);
    for (size_t i = 0; i < j->I; i++)
        for (size_t k = 0; k < j->J; k++)
            synthetic_carry(j->bvh[j->t], &j->truth[i], T + 3 * k, P + 3 * (i * j->J + k));
    tell_model(j, "model", j->P, ", ");
    tell_model(j, "own", P, "}\n");
    free(P);
}

int main(int argc, char **argv)
{
    apsm_context *ctx = apsm_context_new();
    if (argc < 3 || argc > 4 || !ctx) {
        fprintf(stderr, "usage: bench_truth TRUTH_DIR MODEL_DIR [groomed]\n");
        return 2;
    }
    judge j = read_all(ctx, argv[1], argv[2], argc == 4 && strcmp(argv[3], "groomed") == 0);
    printf("{\"bench\": \"truth\", ");
    tell_truth(&j);
    tell_landmarks(&j);
    tell_distances(&j);
    tell_models(&j);
    free_all(&j);
    apsm_context_free(ctx);
    return 0;
}
