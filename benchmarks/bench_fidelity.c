/* The trade-off of the fidelity stage: bench_fidelity MODEL_DIR [key=value ...].
 * Starts from the particles of an optimised model folder (optimised with fidelity = 0), runs the
 * stage with each given setting and prints what the evaluation says, also with other shapes'
 * meshes as the template.  Keys: F, prior, stay, smooth, modes, rounds, iterations, points, floor,
 * ceiling, threads.  A comma makes a list of F. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "apsm/run.h"
#include "evaluate/metrics.h"
#include "files/particles_file.h"
#include "judge/certify.h"
#include "optimize/fidelity.h"
#include "optimize/reseat.h"
#include "run/shapes.h"
#include "session/session.h"

static apsm_status lend(apsm_context *ctx, size_t i, const apsm_mesh **mesh, const apsm_bvh **bvh,
                        void *user)
{
    (void)ctx;
    const apsm_cohort *cohort = user;
    *mesh = &cohort->shape[i].mesh;
    *bvh = cohort->shape[i].bvh;
    return APSM_OK;
}

static void must(apsm_context *ctx, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "%s: %s\n", apsm_status_text(status), apsm_error_text(ctx));
    exit(1);
}

/* Means over the templates other than the fitted one. */
static void other_templates(apsm_context *ctx, apsm_cohort *cohort, size_t J, const double *P,
                            double *mean, double *mean_max)
{
    enum { OTHERS = 3 };
    const apsm_mesh_source shapes = { lend, NULL, cohort };
    apsm_surface_distance *d = calloc(cohort->I, sizeof *d);
    *mean = *mean_max = 0;
    for (size_t k = 1; k <= OTHERS && d; k++) {
        const size_t t = (cohort->template_index + k * cohort->I / (OTHERS + 1)) % cohort->I;
        const apsm_mesh *mesh = &cohort->shape[t].mesh;
        apsm_warp warp;
        apsm_surface_summary s;
        must(ctx, apsm_warp_build(ctx, APSM_PHI_R, mesh->nv, mesh->V, J, P + t * J * 3, &warp));
        must(ctx, apsm_surface_distances(ctx, &warp, mesh, cohort->I, P, &shapes, d));
        apsm_surface_summarize(cohort->I, d, t, &s);
        *mean += s.two_way.mean / OTHERS;
        *mean_max += s.two_way.mean_max / OTHERS;
        apsm_warp_free(&warp);
    }
    free(d);
}

static void judge(apsm_context *ctx, apsm_cohort *cohort, size_t J, const double *P,
                  const char *label, double seconds)
{
    const apsm_mesh_source shapes = { lend, NULL, cohort };
    const apsm_evaluate_input input = { .I = cohort->I,
                                        .J = J,
                                        .P = P,
                                        .shape = &shapes,
                                        .template_mesh =
                                            &cohort->shape[cohort->template_index].mesh,
                                        .template_index = cohort->template_index };
    apsm_evaluation e = { 0 };
    cohort_certificate c = { 0 };
    size_t certified = 0, swaps = 0, folds = 0;
    double other_mean, other_max;
    must(ctx, apsm_evaluate(ctx, &input, &e));
    must(ctx, certify_cohort(ctx, cohort, J, P, NULL, &c));
    other_templates(ctx, cohort, J, P, &other_mean, &other_max);
    for (size_t i = 0; i < cohort->I; i++) {
        certified += c.shape[i].certified && !c.doubts[i];
        swaps += c.shape[i].swaps;
        folds += c.shape[i].folds;
    }
    const apsm_surface_aggregate *a = &e.surface_summary.two_way;
    printf("{\"run\": \"%s\", \"mean\": %.4f, \"mean_max\": %.3f, \"other_mean\": %.4f, "
           "\"other_max\": %.3f, \"gen1\": %.4f, \"gen5\": %.4f, \"spec1\": %.4f, \"spec5\": %.4f, "
           "\"compact1\": %.3f, \"certified\": %zu, \"swaps\": %zu, \"folds\": %zu, "
           "\"cpu_s_per_shape\": %.3f}\n",
           label, a->mean, a->mean_max, other_mean, other_max, e.generalization[0],
           e.generalization[4], e.specificity[0], e.specificity[4], e.compactness[0], certified,
           swaps, folds, seconds / (double)cohort->I);
    fflush(stdout);
    certify_free(&c);
    apsm_evaluation_free(&e);
}

static double *load(apsm_context *ctx, apsm_run *run, size_t *J)
{
    double *P = NULL;
    for (size_t i = 0; i < run->project.n; i++) {
        double *p = NULL;
        char *path = apsm_project_path(&run->project, run->project.subjects[i].world_particles);
        must(ctx, path ? apsm_particles_read(ctx, path, J, &p) : APSM_ERR_STATE);
        if (!P) P = malloc(run->project.n * *J * 3 * sizeof *P);
        if (!P) exit(1);
        memcpy(P + i * *J * 3, p, *J * 3 * sizeof *p);
        free(p);
        free(path);
    }
    return P;
}

static void run_stage(apsm_context *ctx, apsm_cohort *cohort, size_t J, const double *P0,
                      const apsm_fidelity_options *o, double adaptivity, bool verbose)
{
    const size_t bytes = cohort->I * J * 3 * sizeof(double);
    double *P = malloc(bytes), *own = malloc(bytes);
    apsm_fidelity *f = NULL;
    char label[160];
    if (!P || !own) exit(1);
    memcpy(P, P0, bytes);
    memcpy(own, P0, bytes);
    const clock_t start = clock();
    must(ctx, apsm_fidelity_new(ctx, cohort, J, P0 + cohort->template_index * J * 3, o, &f));
    size_t modes = 0;
    for (long k = 0; k < o->fidelity_rounds; k++) {
        apsm_fidelity_record r;
        if (adaptivity > 0 && k > 0 && k == o->fidelity_rounds / 2) {
            must(ctx, apsm_reseat(ctx, cohort, J, P, NULL, adaptivity, J, own));
            memcpy(P, own, bytes);
            apsm_fidelity_free(f);
            must(ctx, apsm_fidelity_new(ctx, cohort, J, P + cohort->template_index * J * 3, o, &f));
        }
        must(ctx, apsm_fidelity_round(ctx, f, k, own, P, &r));
        modes = r.modes;
        if (verbose)
            fprintf(stderr,
                    "round %ld: %.4f -> %.4f h, step %.3f h, %zu moved, %zu kept, %zu modes, "
                    "noise %.4f h\n",
                    k, r.before, r.after, r.step, r.moved, r.kept, r.modes, r.noise);
    }
    const double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    snprintf(label, sizeof label, "F %g c %g prior %g smooth %g modes %zu%s %ldx%ld points %zu",
             o->fidelity, adaptivity, o->prior, o->smooth, modes, o->fidelity_modes < 0 ? "*" : "",
             o->fidelity_rounds, o->iterations, o->fidelity_points);
    judge(ctx, cohort, J, P, label, seconds);
    apsm_fidelity_free(f);
    free(own);
    free(P);
}

int main(int argc, char **argv)
{
    apsm_context *ctx = apsm_context_new();
    apsm_run *run = NULL;
    size_t J = 0;
    const char *list = "0.2,0.3,0.5,0.7,1";
    double adaptivity = 0;
    bool verbose = false, start = false;
    apsm_fidelity_options o = apsm_fidelity_defaults();
    if (!ctx || argc < 2) return 2;
    apsm_context_set_threads(ctx, 2);
    for (int k = 2; k < argc; k++) {
        const char *value = strchr(argv[k], '=');
        const double x = value ? strtod(value + 1, NULL) : 0;
        if (!value) return 2;
        if (strncmp(argv[k], "F=", 2) == 0) list = value + 1;
        if (strncmp(argv[k], "prior=", 6) == 0) o.prior = x;
        if (strncmp(argv[k], "adaptivity=", 11) == 0) adaptivity = x;
        if (strncmp(argv[k], "smooth=", 7) == 0) o.smooth = x;
        if (strncmp(argv[k], "order=", 6) == 0) o.order = x;
        if (strncmp(argv[k], "modes=", 6) == 0) o.fidelity_modes = (long)x;
        if (strncmp(argv[k], "rounds=", 7) == 0) o.fidelity_rounds = (long)x;
        if (strncmp(argv[k], "iterations=", 11) == 0) o.iterations = (long)x;
        if (strncmp(argv[k], "points=", 7) == 0) o.fidelity_points = (long)x;
        if (strncmp(argv[k], "floor=", 6) == 0) o.floor = x;
        if (strncmp(argv[k], "ceiling=", 8) == 0) o.ceiling = x;
        if (strncmp(argv[k], "threads=", 8) == 0) apsm_context_set_threads(ctx, (int)x);
        if (strncmp(argv[k], "verbose=", 8) == 0) verbose = x > 0;
        if (strncmp(argv[k], "start=", 6) == 0) start = x > 0;
    }
    const apsm_run_settings settings = { .folder = argv[1], .dry = true };
    must(ctx, apsm_run_open(ctx, &settings, &run));
    must(ctx, run_load_cohort(run, false));
    double *P = load(ctx, run, &J);
    if (start) judge(ctx, &run->cohort, J, P, "start", 0);
    for (const char *at = list; at && *at;) {
        o.fidelity = strtod(at, NULL);
        run_stage(ctx, &run->cohort, J, P, &o, adaptivity, verbose);
        at = strchr(at, ',');
        if (at) at++;
    }
    free(P);
    apsm_run_close(run);
    apsm_context_free(ctx);
    return 0;
}
