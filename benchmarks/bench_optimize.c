/* How the optimisation scales: bench_optimize [short].  A cohort of synthetic shapes (ellipsoids
 * whose bump slides) is optimised by the default schedule, one of I, J, R/J, V and threads at a
 * time different from I = 8, J = 128, R/J = 16, 10,242 vertices and one thread.  One line of JSON a
 * run: CPU milliseconds of a shape's epoch in either stage (Algorithm 1 included), and wall time.
 */
#include "bench.h"
#include "geometry/affine.h"
#include "optimize/optimizer.h"
#include "options/options.h"
#include "synthetic.h"

typedef struct setting {
    size_t I, J;
    double points;
    int level, threads;
} setting;

/* All threads' CPU time, and wall time. */
typedef struct watch {
    double cpu, wall;
} watch;

static watch look(void)
{
    struct timespec c, w;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &c);
    clock_gettime(CLOCK_MONOTONIC, &w);
    return (watch){ (double)c.tv_sec + 1e-9 * (double)c.tv_nsec,
                    (double)w.tv_sec + 1e-9 * (double)w.tv_nsec };
}

typedef struct times {
    watch last;
    double cpu[3], wall; /* by stage; of all epochs */
    long epochs[3];
} times;

static apsm_status after_epoch(void *user, const apsm_optimizer_state *state,
                               const apsm_epoch_record *r)
{
    (void)state;
    times *t = user;
    const watch now = look();
    t->cpu[r->stage] += now.cpu - t->last.cpu;
    t->wall += now.wall - t->last.wall;
    t->epochs[r->stage]++;
    t->last = now;
    return APSM_OK;
}

static void optimize(const setting *s)
{
    const char **names = bench_alloc(s->I * sizeof *names);
    apsm_mesh *mesh = bench_alloc(s->I * sizeof *mesh);
    double *transforms = bench_doubles(16 * s->I);
    apsm_context *ctx = apsm_context_new();
    apsm_optimize_options o = apsm_optimize_defaults();
    apsm_optimizer_state state;
    apsm_cohort cohort;
    times t = { 0 };
    if (!ctx) abort();
    apsm_context_set_threads(ctx, s->threads);
    o.rbf.points = s->points;
    o.fidelity.fidelity = 0;
    for (size_t i = 0; i < s->I; i++) {
        names[i] = "shape";
        mesh[i] = synthetic_shape(SYNTHETIC_BUMP, i, s->I, s->level);
        apsm_affine_identity(transforms + 16 * i);
    }
    const double h = apsm_expected_spacing(apsm_mesh_area(&mesh[s->I / 2]), s->J);
    const apsm_cohort_input in = { s->I, names, mesh, transforms, s->I / 2 };
    bench_must(apsm_cohort_build(ctx, &in, apsm_options_defaults().field.field_voxel * h,
                                 1.1 * o.rbf.band * o.rbf.dipole * h, &cohort));
    bench_must(apsm_optimizer_state_alloc(s->I, s->J, &state));
    bench_must(apsm_first_particles(ctx, &cohort, &o, s->J, state.P));
    t.last = look();
    bench_must(apsm_optimize(ctx, &cohort, &o, &state, after_epoch, &t));
    printf("{\"kernel\": \"optimize\", \"I\": %zu, \"J\": %zu, \"R\": %.0f, \"V\": %zu, "
           "\"threads\": %d, \"stage1_cpu_ms\": %.3f, \"stage2_cpu_ms\": %.3f, \"wall_s\": %.3f}\n",
           s->I, s->J, s->points * (double)s->J, mesh[0].nv, s->threads,
           1e3 * t.cpu[1] / (double)t.epochs[1] / (double)s->I,
           1e3 * t.cpu[2] / (double)t.epochs[2] / (double)s->I, t.wall);
    fflush(stdout);
    apsm_optimizer_state_free(&state);
    apsm_cohort_free(&cohort);
    for (size_t i = 0; i < s->I; i++) apsm_mesh_free(&mesh[i]);
    apsm_context_free(ctx);
    free(names);
    free(mesh);
    free(transforms);
}

int main(int argc, char **argv)
{
    static const setting settings[] = {
        { 8, 128, 16, 5, 1 }, { 16, 128, 16, 5, 1 }, { 32, 128, 16, 5, 1 }, { 8, 256, 16, 5, 1 },
        { 8, 512, 16, 5, 1 }, { 8, 128, 8, 5, 1 },   { 8, 128, 32, 5, 1 },  { 8, 128, 16, 4, 1 },
        { 8, 128, 16, 6, 1 }, { 8, 128, 16, 5, 2 },  { 32, 128, 16, 5, 2 }, { 8, 1024, 16, 5, 1 },
    };
    const size_t all = sizeof settings / sizeof *settings;
    const size_t n = argc > 1 && strcmp(argv[1], "short") == 0 ? all - 1 : all;
    for (size_t i = 0; i < n; i++) optimize(&settings[i]);
    return 0;
}
