/* Times method psm: bench_psm [J ...], by default 128 and 256 particles on 8 ellipsoids, with
 * 100 iterations a split and 200 in the end.  One JSON line a size: CPU seconds, and microseconds a
 * particle and iteration. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "psm/psm.h"
#include "synthetic.h"

enum { I = 8, LEVEL = 4 };

static void must(apsm_context *ctx, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "bench_psm: %s\n", apsm_error_text(ctx));
    exit(1);
}

/* Moves of particles in a whole run: each iteration moves those that there are. */
static double moves(const apsm_optimize_options *o, size_t J)
{
    double sum = (double)(o->psm.psm_optimization_iterations * (long)J);
    for (size_t now = 1; now < J;) {
        now = 2 * now < J ? 2 * now : J;
        sum += (double)(o->psm.psm_iterations_per_split * (long)now);
    }
    return I * sum;
}

static void time_size(apsm_context *ctx, const apsm_cohort *cohort, size_t J)
{
    apsm_optimize_options o = apsm_optimize_defaults();
    apsm_optimizer_state state;
    o.psm.psm_iterations_per_split = 100;
    o.psm.psm_optimization_iterations = 200;
    must(ctx, apsm_optimizer_state_alloc(I, J, &state));
    apsm_psm_first_particle(cohort, &state);
    const clock_t begin = clock();
    must(ctx, apsm_psm_optimize(ctx, cohort, &o, &state, NULL, NULL));
    const double seconds = (double)(clock() - begin) / CLOCKS_PER_SEC;
    printf("{\"bench\": \"psm\", \"shapes\": %d, \"J\": %zu, \"seconds\": %.3f, "
           "\"us_per_move\": %.3f}\n",
           I, J, seconds, 1e6 * seconds / moves(&o, J));
    apsm_optimizer_state_free(&state);
}

int main(int argc, char **argv)
{
    apsm_context *ctx = apsm_context_new();
    apsm_mesh mesh[I];
    double transforms[I][16];
    const char *names[I];
    apsm_cohort cohort;
    if (!ctx) return 1;
    for (size_t i = 0; i < I; i++) {
        mesh[i] = synthetic_shape(SYNTHETIC_ELLIPSOID, i, I, LEVEL);
        names[i] = "ellipsoid";
        for (size_t a = 0; a < 16; a++) transforms[i][a] = a % 5 == 0;
    }
    const apsm_cohort_input in = { I, names, mesh, transforms[0], 0 };
    must(ctx, apsm_cohort_build(ctx, &in, 0, 0, &cohort));
    if (argc < 2) {
        time_size(ctx, &cohort, 128);
        time_size(ctx, &cohort, 256);
    }
    for (int a = 1; a < argc; a++) time_size(ctx, &cohort, (size_t)strtoul(argv[a], NULL, 10));
    apsm_cohort_free(&cohort);
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
    apsm_context_free(ctx);
    return 0;
}
