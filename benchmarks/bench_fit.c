/* Shapes that a model has not seen, against having been in its cohort.
 *
 *     bench_fit whole MODEL_DIR [FOLDS [TRUTH]]
 *                                            folds of the model's shapes are left out of its modes,
 *                                            and fitted from their groomed meshes; TRUTH: of a
 *                                            synthetic kind (make_synthetic), the true shapes
 *     bench_fit poses MODEL_DIR [FOLDS [N]]  N random poses (200), every second one mirrored
 *     bench_fit strangers MODEL_DIR OTHER    shapes that are not of the kind
 *     bench_fit steps MODEL_DIR              where the time goes
 *     bench_fit time MODEL_DIR               CPU time a shape: in any pose, and aligned
 *
 * Correspondence is compared with the particles that the joint model has, in its h. */
#include "fit_world.h"

#include "evaluate/surface_distance.h"
#include "geometry/bvh.h"
#include "synthetic.h"
#include "truth_world.h"

static double joint_distance(const left_out *b, size_t i, const apsm_mesh *mesh)
{
    apsm_surface_distance d;
    apsm_mesh warped;
    must_fit(b, apsm_mesh_copy(apsm_fit_model_mesh(b->joint), &warped));
    apsm_warp warp = { 0 };
    must_fit(b, apsm_warp_build(b->ctx, APSM_PHI_R, warped.nv, warped.V, b->folder.J, b->joint->T,
                                &warp));
    apsm_warp_apply(&warp, b->folder.P + i * 3 * b->folder.J, warped.V);
    must_fit(b, apsm_surface_distance_between(b->ctx, mesh, NULL, &warped, NULL, &d));
    apsm_warp_free(&warp);
    apsm_mesh_free(&warped);
    return d.two_way.mean;
}

/* The figures that verdicts stand on, relative to what the model knows of its own shapes. */
static void tell_form(const apsm_fit_model *m, const char *name, const apsm_fit *fit)
{
    const fit_calibration *c = &m->calibration;
    fprintf(stderr,
            "%s: %s (%s): pose %.2f of the usual, distance %.2f and miss %.2f of the worst, tail "
            "%.3f\n",
            name, apsm_fit_verdict_text(fit->verdict), fit->reason, fit->pose_residual / c->pose,
            fit->distance.two_way.mean / m->h / c->distance_most,
            fit->residual / m->h / c->residual_most, fit->tail);
}

/* The true shapes of a synthetic kind, in the world of the model; NULL: not known. */
typedef struct truth {
    apsm_mesh template_mesh;
    const char *folder;
} truth;

static truth open_truth(const left_out *b, const char *folder)
{
    truth t = { .folder = folder };
    if (folder)
        t.template_mesh =
            read_truth(b->ctx, folder, &b->folder.project.subjects[b->folder.template_index]);
    return t;
}

/* Mean distance of particles, carried to the template by the truth, from the template's. */
static double truth_error(const left_out *b, const truth *t, size_t i, const double *P)
{
    double sum = 0;
    apsm_bvh *bvh;
    if (!t->folder) return 0;
    apsm_mesh mesh = read_truth(b->ctx, t->folder, &b->folder.project.subjects[i]);
    must_fit(b, apsm_bvh_build(&mesh, &bvh));
    for (size_t j = 0; j < b->folder.J; j++) {
        double y[3];
        synthetic_carry(bvh, &t->template_mesh, P + 3 * j, y);
        sum += sqrt(vec3_distance2(y, b->joint->T + 3 * j));
    }
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
    return sum / (double)b->folder.J;
}

/* Sums over the shapes. */
typedef struct whole_sums {
    double slip, worst, in, out, true_in, true_out, seconds;
    size_t n, count[3], wrong, taken; /* far off, and of these good */
} whole_sums;

static const double far_off = 0.5; /* h: particles are elsewhere */

static void one_whole(const left_out *b, const truth *t, const apsm_fit_model *m, size_t i,
                      whole_sums *s)
{
    apsm_mesh mesh;
    apsm_fit fit;
    const apsm_fit_options o = apsm_fit_defaults();
    const double *P = joint_particles(b, i);
    double M[16], back[16];
    must_fit(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
    const double before = joint_distance(b, i, &mesh);
    model_folder_to_world(&b->folder, i, M);
    from_world(b, i, back);
    apsm_mesh_transform(&mesh, back);
    const double start = bench_now();
    must_fit(b, apsm_fit_surface(b->ctx, m, b->folder.names[i], &mesh, &o, &fit));
    s->seconds += bench_now() - start;
    s->count[fit.verdict]++;
    tell_form(m, b->folder.names[i], &fit);
    if (fit.J > 0) {
        double *world = bench_doubles(3 * fit.J);
        apsm_affine_apply(M, fit.J, fit.local, world);
        const double slip = apart(fit.J, world, P) / b->joint->h;
        s->slip += slip;
        s->wrong += slip > far_off;
        s->taken += slip > far_off && fit.verdict == APSM_FIT_GOOD;
        fprintf(stderr,
                "%s: %.3f h from the joint model's particles; another pose is %.3f times, "
                "the other hand %.3f times as far\n",
                b->folder.names[i], slip, fit.runner_up, fit.mirror_ratio);
        s->worst = fmax(s->worst, slip);
        s->in += before;
        s->out += fit.distance.two_way.mean;
        s->true_in += truth_error(b, t, i, P);
        s->true_out += truth_error(b, t, i, world);
        s->n++;
        free(world);
    }
    apsm_fit_free(&fit);
    apsm_mesh_free(&mesh);
}

static void whole(const left_out *b, const char *folder)
{
    whole_sums s = { 0 };
    truth t = open_truth(b, folder);
    for (size_t fold = 0; fold < b->folds; fold++) {
        apsm_fit_model *m = without_fold(b, fold);
        for (size_t i = fold; i < b->folder.I; i += b->folds)
            if (i != b->folder.template_index) one_whole(b, &t, m, i, &s);
        apsm_fit_model_free(m);
    }
    const double n = (double)s.n, h = b->joint->h;
    printf("{\"shapes\": %zu, \"distance_joint\": %.4f, \"distance_fit\": %.4f, \"slip_h\": "
           "%.4f, \"worst_slip_h\": %.3f, \"truth_joint_h\": %.4f, \"truth_fit_h\": %.4f, "
           "\"seconds\": %.3f, \"good\": %zu, \"review\": %zu, \"refused\": %zu, \"wrong\": %zu, "
           "\"wrong and good\": %zu}\n",
           s.n, s.in / n, s.out / n, s.slip / n, s.worst, s.true_in / n / h, s.true_out / n / h,
           s.seconds / n, s.count[0], s.count[1], s.count[2], s.wrong, s.taken);
    apsm_mesh_free(&t.template_mesh);
}

/* ---- poses ---- */

/* A random rotation about a random shift, every second one mirrored. */
static void random_pose(uint64_t k, double size, double M[16])
{
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_TEST, k, 0);
    double A[9], R[9];
    for (size_t c = 0; c < 9; c++) A[c] = apsm_random_normal(&rng);
    apsm_nearest_rotation(A, R);
    apsm_affine_identity(M);
    for (size_t r = 0; r < 3; r++) {
        for (size_t c = 0; c < 3; c++) M[4 * r + c] = k % 2 && c == 0 ? -R[3 * r] : R[3 * r + c];
        M[4 * r + 3] = 5 * size * apsm_random_normal(&rng);
    }
}

static void poses(left_out *b, size_t wanted)
{
    size_t wrong = 0, told = 0, hands = 0, n = 0;
    for (size_t fold = 0; fold < b->folds; fold++) {
        apsm_fit_model *m = without_fold(b, fold);
        for (size_t k = fold; k < wanted; k += b->folds) {
            const size_t i = k % b->folder.I;
            double M[16], to_world[16];
            apsm_mesh mesh;
            apsm_fit fit;
            const apsm_fit_options o = apsm_fit_defaults();
            if (i == b->folder.template_index) continue;
            must_fit(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
            random_pose(k, m->radius, M);
            apsm_mesh_transform(&mesh, M);
            must_fit(b, apsm_fit_surface(b->ctx, m, b->folder.names[i], &mesh, &o, &fit));
            n++;
            bool right = false;
            if (fit.J > 0) {
                double *x = bench_doubles(3 * fit.J);
                must_fit(b, apsm_affine_invert(M, to_world));
                apsm_affine_apply(to_world, fit.J, fit.original, x);
                right = apart(fit.J, x, b->folder.P + i * 3 * fit.J) < far_off * b->joint->h;
                hands += fit.mirrored != (k % 2 == 1);
                free(x);
            }
            if (!right)
                fprintf(stderr, "%s wrong: %s (%s) %.3f %.3f\n", b->folder.names[i],
                        apsm_fit_verdict_text(fit.verdict), fit.reason, fit.runner_up,
                        fit.mirror_ratio);
            wrong += !right;
            told += !right && fit.verdict != APSM_FIT_GOOD;
            apsm_fit_free(&fit);
            apsm_mesh_free(&mesh);
        }
        apsm_fit_model_free(m);
    }
    printf("{\"poses\": %zu, \"wrong\": %zu, \"of these not good\": %zu, \"wrong hands\": %zu}\n",
           n, wrong, told, hands);
}

/* ---- strangers ---- */

static void count_verdicts(const left_out *b, const apsm_mesh *mesh, const char *name,
                           size_t count[3])
{
    apsm_fit fit;
    const apsm_fit_options o = apsm_fit_defaults();
    must_fit(b, apsm_fit_surface(b->ctx, b->joint, name, mesh, &o, &fit));
    count[fit.verdict]++;
    tell_form(b->joint, name, &fit);
    apsm_fit_free(&fit);
}

static void say_verdicts(const char *what, const size_t count[3])
{
    printf("{\"strangers\": \"%s\", \"good\": %zu, \"review\": %zu, \"refused\": %zu}\n", what,
           count[0], count[1], count[2]);
}

static double size_of(const apsm_mesh *mesh)
{
    return sqrt(apsm_mesh_area(mesh));
}

/* Shapes of another model as they are, and of this model's size; own shapes of half and of twice
 * the size, and with vertices moved at random. */
static void strangers(left_out *b, const char *other)
{
    enum { MOST = 12 };
    model_folder f;
    size_t as_is[3] = { 0 }, sized[3] = { 0 }, half[3] = { 0 }, noise[3] = { 0 };
    must_fit(b, model_folder_read(b->ctx, other, 0, &f));
    const double size = size_of(apsm_fit_model_mesh(b->joint));
    for (size_t i = 0; i < f.I && i < MOST; i++) {
        apsm_mesh mesh;
        must_fit(b, model_folder_mesh(b->ctx, &f, i, &mesh));
        count_verdicts(b, &mesh, f.names[i], as_is);
        const double scale = size / size_of(&mesh);
        for (size_t x = 0; x < 3 * mesh.nv; x++) mesh.V[x] *= scale;
        count_verdicts(b, &mesh, f.names[i], sized);
        apsm_mesh_free(&mesh);
    }
    for (size_t i = 0; i < b->folder.I && i < MOST; i++) {
        apsm_mesh mesh, rough;
        apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, i, 0);
        must_fit(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
        must_fit(b, apsm_mesh_copy(&mesh, &rough));
        for (size_t x = 0; x < 3 * mesh.nv; x++) {
            mesh.V[x] *= i % 2 ? 0.5 : 2;
            rough.V[x] += 0.5 * b->joint->h * apsm_random_normal(&rng);
        }
        count_verdicts(b, &mesh, b->folder.names[i], half);
        count_verdicts(b, &rough, b->folder.names[i], noise);
        apsm_mesh_free(&mesh);
        apsm_mesh_free(&rough);
    }
    say_verdicts("another organ", as_is);
    say_verdicts("another organ of the same size", sized);
    say_verdicts("half or twice the size", half);
    say_verdicts("noise of half a spacing", noise);
    model_folder_free(&f);
}

/* ---- where the time goes ---- */

static void step(const char *what, double *start)
{
    const double now = bench_now();
    printf("{\"step\": \"%s\", \"ms\": %.1f}\n", what, 1e3 * (now - *start));
    *start = bench_now();
}

/* One shape, the last, with the joint model. */
static void steps(left_out *b)
{
    const char *const names[] = { "shape" };
    const size_t i = b->folder.template_index == 0 ? 1 : 0;
    apsm_mesh mesh;
    apsm_fit fit = { 0 };
    apsm_cohort one;
    apsm_bvh *bvh;
    const apsm_fit_options o = apsm_fit_defaults();
    fit_job job = { .m = b->joint, .name = "shape", .mesh = &mesh, .options = &o, .out = &fit };
    must_fit(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
    must_fit(b, fit_alloc(b->joint, &fit));
    for (int turn = 0; turn < 2; turn++) {
        double t = bench_now();
        must_fit(b, apsm_bvh_build_unsigned(&mesh, &bvh));
        step("tree", &t);
        must_fit(b, fit_pose_find(b->joint, &mesh, bvh, &o, &job.pose));
        step("pose", &t);
        const apsm_cohort_input in = { 1, names, &mesh, job.pose.M, 0 };
        must_fit(b, apsm_cohort_build(b->ctx, &in, 0, 0, &one));
        job.shape = one.shape[0];
        step("shape", &t);
        must_fit(b, fit_whole_particles(b->ctx, &job));
        step("particles", &t);
        must_fit(b, fit_whole_deviations(&job));
        step("deviations", &t);
        must_fit(b, fit_frames(&job));
        must_fit(b, fit_scores(&job));
        step("frames and scores", &t);
        must_fit(b, apsm_surface_distance_between(b->ctx, &job.shape.mesh, job.shape.bvh, &fit.mesh,
                                                  NULL, &fit.distance));
        step("distance", &t);
        apsm_cohort_free(&one);
        apsm_bvh_free(bvh);
    }
    apsm_fit_free(&fit);
    apsm_mesh_free(&mesh);
}

/* Medians over the model's shapes, each fitted by the joint model from memory. */
static void time_shapes(left_out *b)
{
    enum { MOST = 12 };
    double t[MOST];
    size_t faces = 0;
    for (int aligned = 0; aligned < 2; aligned++) {
        size_t n = 0;
        for (size_t i = 0; i < b->folder.I && n < MOST; i++) {
            apsm_mesh mesh;
            apsm_fit fit;
            apsm_fit_options o = apsm_fit_defaults();
            o.aligned = aligned;
            if (i == b->folder.template_index) continue;
            must_fit(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
            faces += mesh.nf;
            const double start = bench_now();
            must_fit(b, apsm_fit_surface(b->ctx, b->joint, b->folder.names[i], &mesh, &o, &fit));
            t[n++] = bench_now() - start;
            apsm_fit_free(&fit);
            apsm_mesh_free(&mesh);
        }
        qsort(t, n, sizeof *t, bench_by_value);
        printf("{\"bench\": \"%s\", \"J\": %zu, \"faces\": %zu, \"median_ms\": %.1f, "
               "\"least_ms\": %.1f, \"most_ms\": %.1f}\n",
               aligned ? "aligned" : "any pose", b->folder.J, faces / n, 1e3 * t[n / 2], 1e3 * t[0],
               1e3 * t[n - 1]);
        faces = 0;
    }
}

int main(int argc, char **argv)
{
    left_out b = { 0 };
    const bool strange = argc > 3 && strcmp(argv[1], "strangers") == 0;
    if (argc < 3) {
        fprintf(stderr, "usage: bench_fit whole|poses|steps|time MODEL_DIR [FOLDS [TRUTH|N]], or "
                        "strangers MODEL_DIR OTHER\n");
        return 2;
    }
    open_model(&b, argv[2], argc > 3 && !strange ? (size_t)strtoul(argv[3], NULL, 10) : 10);
    if (b.folds == 0) return 2;
    if (strcmp(argv[1], "whole") == 0) whole(&b, argc > 4 ? argv[4] : NULL);
    if (strcmp(argv[1], "poses") == 0)
        poses(&b, argc > 4 ? (size_t)strtoul(argv[4], NULL, 10) : 200);
    if (strange) strangers(&b, argv[3]);
    if (strcmp(argv[1], "steps") == 0) steps(&b);
    if (strcmp(argv[1], "time") == 0) time_shapes(&b);
    close_model(&b);
    return 0;
}
