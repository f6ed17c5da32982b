/* Shapes that a model has not seen, against having been in its cohort.
 *
 *     bench_fit whole MODEL_DIR [FOLDS]      folds of the model's shapes are left out of its modes,
 *                                            and fitted from their groomed meshes
 *     bench_fit parts MODEL_DIR [FOLDS]      the same with 20, 50, 80 % cut away by a plane
 *     bench_fit landmarks MODEL_DIR [FOLDS]  from 4, 6, 10 of the joint model's particles alone
 *     bench_fit poses MODEL_DIR [FOLDS]      200 random poses, every second one mirrored
 *     bench_fit strangers MODEL_DIR OTHER    shapes that are not of the kind
 *     bench_fit steps MODEL_DIR              where the time goes
 *     bench_fit time MODEL_DIR               CPU time a shape: in any pose, and aligned
 *
 * Correspondence is compared with the particles that the joint model has, in its h. */
#include "bench.h"

#include "evaluate/surface_distance.h"
#include "fit/fit_model.h"
#include "fit/parts.h"
#include "folder/model_folder.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

typedef struct left_out {
    apsm_context *ctx;
    model_folder folder;
    apsm_fit_model *joint;
    size_t folds;
} left_out;

static void must(const left_out *b, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "bench_fit: %s\n", apsm_error_text(b->ctx));
    exit(1);
}

static void open_model(left_out *b, const char *path, size_t folds)
{
    b->ctx = apsm_context_new();
    const unsigned parts = FOLDER_PARTICLES | FOLDER_SCORES | FOLDER_EVALUATED;
    must(b, model_folder_read(b->ctx, path, parts, &b->folder));
    must(b, apsm_fit_model_load(b->ctx, path, &b->joint));
    b->folds = folds;
}

static apsm_fit_model *without_fold(const left_out *b, size_t fold)
{
    apsm_fit_model *m;
    bool *out = bench_alloc(b->folder.I * sizeof *out);
    for (size_t i = 0; i < b->folder.I; i++) out[i] = i % b->folds == fold;
    must(b, fit_model_without(b->ctx, b->joint, out, &m));
    free(out);
    return m;
}

/* Mean distance of particles from those of the joint model. */
static double apart(size_t J, const double *p, const double *q)
{
    double sum = 0;
    for (size_t j = 0; j < J; j++) sum += sqrt(vec3_distance2(p + 3 * j, q + 3 * j));
    return sum / (double)J;
}

static double joint_distance(const left_out *b, size_t i, const apsm_mesh *mesh)
{
    apsm_surface_distance d;
    apsm_mesh warped;
    const struct apsm_fidelity *f = (const void *)b->joint->fidelity;
    (void)f;
    must(b, apsm_mesh_copy(apsm_fit_model_mesh(b->joint), &warped));
    apsm_warp warp = { 0 };
    must(b,
         apsm_warp_build(b->ctx, APSM_PHI_R, warped.nv, warped.V, b->folder.J, b->joint->T, &warp));
    apsm_warp_apply(&warp, b->folder.P + i * 3 * b->folder.J, warped.V);
    must(b, apsm_surface_distance_between(b->ctx, mesh, NULL, &warped, NULL, &d));
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

static void whole(left_out *b)
{
    double slip = 0, in = 0, out = 0, time = 0, worst = 0;
    size_t n = 0, count[3] = { 0 };
    for (size_t fold = 0; fold < b->folds; fold++) {
        apsm_fit_model *m = without_fold(b, fold);
        for (size_t i = fold; i < b->folder.I; i += b->folds) {
            if (i == b->folder.template_index) continue;
            apsm_mesh mesh;
            apsm_fit fit;
            apsm_fit_options o = apsm_fit_defaults();
            double M[16], back[16];
            must(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
            const double before = joint_distance(b, i, &mesh);
            model_folder_to_world(&b->folder, i, M);
            must(b, apsm_affine_invert(M, back));
            apsm_mesh_transform(&mesh, back);
            const double start = bench_now();
            must(b, apsm_fit_surface(b->ctx, m, b->folder.names[i], &mesh, &o, &fit));
            const double t = bench_now() - start;
            count[fit.verdict]++;
            tell_form(m, b->folder.names[i], &fit);
            if (fit.verdict != APSM_FIT_REFUSED) {
                double *world = bench_doubles(3 * fit.J);
                apsm_affine_apply(M, fit.J, fit.local, world);
                const double s = apart(fit.J, world, b->folder.P + i * 3 * fit.J) / b->joint->h;
                printf("{\"shape\": \"%s\", \"slip\": %.3f, \"joint\": %.4f, \"fit\": %.4f, "
                       "\"mahalanobis\": %.2f, \"tail\": %.3f, \"residual\": %.3f, \"usual\": "
                       "%.3f, \"pose\": %.3f, \"seconds\": %.3f}\n",
                       b->folder.names[i], s, before, fit.distance.two_way.mean, fit.mahalanobis,
                       fit.tail, fit.residual / b->joint->h, fit.residual_usual / b->joint->h,
                       fit.pose_residual, t);
                slip += s;
                worst = fmax(worst, s);
                in += before;
                out += fit.distance.two_way.mean;
                time += t;
                n++;
                free(world);
            }
            apsm_fit_free(&fit);
            apsm_mesh_free(&mesh);
        }
        const fit_calibration *c = &m->calibration;
        fprintf(stderr,
                "fold %zu: modes %g noise %.4f smooth %.4f reach %g bands %.2f %.2f %.2f "
                "mahalanobis %.2f residual %.3f most %.3f sizes %.2f %.2f oriented %g\n",
                fold, c->modes, sqrt(c->noise), sqrt(c->smooth), c->reach, c->band[0], c->band[1],
                c->band[2], c->mahalanobis, c->residual, c->residual_most, c->size_least,
                c->size_most, m->oriented);
        apsm_fit_model_free(m);
    }
    printf("{\"shapes\": %zu, \"slip_h\": %.4f, \"worst_slip_h\": %.3f, \"joint_mean\": %.4f, "
           "\"fit_mean\": %.4f, \"seconds\": %.3f, \"good\": %zu, \"review\": %zu, \"refused\": "
           "%zu}\n",
           n, slip / (double)n, worst, in / (double)n, out / (double)n, time / (double)n, count[0],
           count[1], count[2]);
}

/* ---- parts ---- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Faces below the plane across axis that hides this share of the vertices. */
static void cut(apsm_mesh *mesh, const double axis[3], double missing)
{
    double *along = bench_doubles(mesh->nv), *sorted = bench_doubles(mesh->nv);
    size_t nf = 0;
    for (size_t v = 0; v < mesh->nv; v++) sorted[v] = along[v] = dot(axis, mesh->V + 3 * v);
    qsort(sorted, mesh->nv, sizeof *sorted, bench_by_value);
    const double level = sorted[(size_t)((1 - missing) * (double)(mesh->nv - 1))];
    for (size_t f = 0; f < mesh->nf; f++) {
        const uint32_t *c = mesh->F + 3 * f;
        if (along[c[0]] > level || along[c[1]] > level || along[c[2]] > level) continue;
        memmove(mesh->F + 3 * nf++, c, 3 * sizeof *c);
    }
    mesh->nf = nf;
    free(along);
    free(sorted);
}

/* Sums over the hidden particles. */
typedef struct part_sums {
    double particle, surface, mean_surface, mean_particle, seconds, pose, inside, inside_surface;
    size_t n, shapes, refused;
} part_sums;

static void judge_part(left_out *b, size_t i, const apsm_fit_model *m, const apsm_mesh *whole,
                       const apsm_fit *fit, part_sums *s)
{
    apsm_bvh *bvh;
    double M[16], *world = bench_doubles(3 * fit->J);
    const double *P = b->folder.P + i * 3 * fit->J;
    model_folder_to_world(&b->folder, i, M);
    apsm_affine_apply(M, fit->J, fit->original, world);
    double *placed = bench_doubles(3 * fit->J), *weight = bench_doubles(fit->J), A[16];
    for (size_t j = 0; j < fit->J; j++) weight[j] = fit->observed[j] ? 1 : 1e-9;
    apsm_affine_fit(fit->J, m->model.mean, P, weight, 0, A);
    apsm_affine_apply(A, fit->J, m->model.mean, placed);
    bench_must(apsm_bvh_build_unsigned(whole, &bvh));
    for (size_t j = 0; j < fit->J; j++) {
        if (fit->observed[j]) continue;
        apsm_closest at;
        const double *x = world + 3 * j, *mean = placed + 3 * j;
        s->particle += sqrt(vec3_distance2(x, P + 3 * j));
        s->mean_particle += sqrt(vec3_distance2(mean, P + 3 * j));
        apsm_bvh_closest(bvh, x, INFINITY, &at);
        s->surface += sqrt(at.distance2);
        s->inside_surface += sqrt(at.distance2) <= 1.645 * fit->sd_normal[j];
        apsm_bvh_closest(bvh, mean, INFINITY, &at);
        s->mean_surface += sqrt(at.distance2);
        for (size_t c = 0; c < 3; c++)
            s->inside += fabs(x[c] - P[3 * j + c]) <= 1.645 * fit->sd[j] ? 1.0 / 3 : 0;
        s->n++;
    }
    apsm_bvh_free(bvh);
    free(placed);
    free(weight);
    free(world);
}

static void one_part(left_out *b, size_t i, const apsm_fit_model *m, const double axis[3],
                     double missing, part_sums *s)
{
    apsm_mesh whole, part;
    apsm_fit fit;
    apsm_fit_options o = apsm_fit_defaults();
    double M[16], back[16];
    must(b, model_folder_mesh(b->ctx, &b->folder, i, &whole));
    must(b, apsm_mesh_copy(&whole, &part));
    cut(&part, axis, missing);
    model_folder_to_world(&b->folder, i, M);
    must(b, apsm_affine_invert(M, back));
    apsm_mesh_transform(&part, back);
    o.extent = APSM_EXTENT_PART;
    o.hand = APSM_HAND_SAME;
    const double start = bench_now();
    must(b, apsm_fit_surface(b->ctx, m, b->folder.names[i], &part, &o, &fit));
    s->seconds += bench_now() - start;
    s->shapes++;
    if (fit.verdict == APSM_FIT_REFUSED) {
        s->refused++;
        fprintf(stderr, "%s refused: %s\n", b->folder.names[i], fit.reason);
    } else
        judge_part(b, i, m, &whole, &fit, s);
    apsm_fit_free(&fit);
    apsm_mesh_free(&part);
    apsm_mesh_free(&whole);
}

static void parts(left_out *b)
{
    static const double axis[4][3] = {
        { 1, 0.3, 0.2 }, { -0.2, 1, 0.3 }, { 0.3, -0.2, 1 }, { -1, -1, -1 }
    };
    static const double missing[3] = { 0.2, 0.5, 0.8 };
    part_sums s[3] = { 0 };
    for (size_t fold = 0; fold < b->folds; fold++) {
        apsm_fit_model *m = without_fold(b, fold);
        for (size_t i = fold; i < b->folder.I; i += b->folds) {
            if (i == b->folder.template_index) continue;
            for (size_t q = 0; q < 3; q++)
                one_part(b, i, m, axis[i / b->folds % 4], missing[q], &s[q]);
        }
        apsm_fit_model_free(m);
    }
    const double h = b->joint->h;
    for (size_t q = 0; q < 3; q++)
        printf("{\"missing\": %.1f, \"surface_h\": %.4f, \"mean_surface_h\": %.4f, "
               "\"particle_h\": %.4f, \"mean_particle_h\": %.4f, \"inside\": %.3f, "
               "\"inside_surface\": %.3f, \"seconds\": %.3f, \"refused\": %zu, \"shapes\": %zu}\n",
               missing[q], s[q].surface / (double)s[q].n / h,
               s[q].mean_surface / (double)s[q].n / h, s[q].particle / (double)s[q].n / h,
               s[q].mean_particle / (double)s[q].n / h, s[q].inside / (double)s[q].n,
               s[q].inside_surface / (double)s[q].n, s[q].seconds / (double)s[q].shapes,
               s[q].refused, s[q].shapes);
}

/* ---- landmarks ---- */

/* n particles of the mean, each the farthest from those before. */
static void choose(const apsm_fit_model *m, size_t n, size_t *index)
{
    const size_t J = m->model.J;
    double *far = bench_doubles(J);
    for (size_t j = 0; j < J; j++) far[j] = INFINITY;
    index[0] = 0;
    for (size_t k = 1; k < n; k++) {
        index[k] = 0;
        for (size_t j = 0; j < J; j++) {
            far[j] = fmin(far[j],
                          vec3_distance2(m->model.mean + 3 * j, m->model.mean + 3 * index[k - 1]));
            if (far[j] > far[index[k]]) index[k] = j;
        }
    }
    free(far);
}

static void landmarks(left_out *b)
{
    static const size_t counts[3] = { 4, 6, 10 };
    for (size_t q = 0; q < 3; q++) {
        part_sums s = { 0 };
        for (size_t fold = 0; fold < b->folds; fold++) {
            apsm_fit_model *m = without_fold(b, fold);
            size_t index[10];
            choose(m, counts[q], index);
            for (size_t i = fold; i < b->folder.I; i += b->folds) {
                double at[30], x[30], M[16], back[16];
                apsm_fit fit;
                apsm_mesh whole;
                const apsm_fit_options o = apsm_fit_defaults();
                if (i == b->folder.template_index) continue;
                model_folder_to_world(&b->folder, i, M);
                must(b, apsm_affine_invert(M, back));
                for (size_t k = 0; k < counts[q]; k++) {
                    memcpy(at + 3 * k, m->model.mean + 3 * index[k], 3 * sizeof *at);
                    memcpy(x + 3 * k, b->folder.P + 3 * (i * m->model.J + index[k]), 3 * sizeof *x);
                }
                apsm_affine_apply(back, counts[q], x, x);
                must(b,
                     apsm_fit_landmarks(b->ctx, m, b->folder.names[i], counts[q], at, x, &o, &fit));
                for (size_t k = 0; k < counts[q] && fit.J > 0; k++) fit.observed[index[k]] = true;
                must(b, model_folder_mesh(b->ctx, &b->folder, i, &whole));
                s.shapes++;
                s.refused += fit.verdict == APSM_FIT_REFUSED;
                if (fit.J > 0) judge_part(b, i, m, &whole, &fit, &s);
                apsm_mesh_free(&whole);
                apsm_fit_free(&fit);
            }
            apsm_fit_model_free(m);
        }
        const double h = b->joint->h, n = (double)s.n;
        printf("{\"landmarks\": %zu, \"surface_h\": %.4f, \"mean_surface_h\": %.4f, "
               "\"particle_h\": %.4f, \"mean_particle_h\": %.4f, \"inside\": %.3f, "
               "\"inside_surface\": %.3f, \"refused\": %zu, \"shapes\": %zu}\n",
               counts[q], s.surface / n / h, s.mean_surface / n / h, s.particle / n / h,
               s.mean_particle / n / h, s.inside / n, s.inside_surface / n, s.refused, s.shapes);
    }
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

static void poses(left_out *b)
{
    enum { POSES = 200 };
    size_t wrong = 0, told = 0, hands = 0, n = 0;
    for (size_t fold = 0; fold < b->folds; fold++) {
        apsm_fit_model *m = without_fold(b, fold);
        for (size_t k = fold; k < POSES; k += b->folds) {
            const size_t i = k % b->folder.I;
            double M[16], to_world[16];
            apsm_mesh mesh;
            apsm_fit fit;
            const apsm_fit_options o = apsm_fit_defaults();
            if (i == b->folder.template_index) continue;
            must(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
            random_pose(k, m->radius, M);
            apsm_mesh_transform(&mesh, M);
            must(b, apsm_fit_surface(b->ctx, m, b->folder.names[i], &mesh, &o, &fit));
            n++;
            bool right = false;
            if (fit.J > 0) {
                double *x = bench_doubles(3 * fit.J);
                must(b, apsm_affine_invert(M, to_world));
                apsm_affine_apply(to_world, fit.J, fit.original, x);
                right = apart(fit.J, x, b->folder.P + i * 3 * fit.J) < 0.5 * b->joint->h;
                hands += fit.mirrored != (k % 2 == 1);
                free(x);
            }
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
    must(b, apsm_fit_surface(b->ctx, b->joint, name, mesh, &o, &fit));
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
    must(b, model_folder_read(b->ctx, other, 0, &f));
    const double size = size_of(apsm_fit_model_mesh(b->joint));
    for (size_t i = 0; i < f.I && i < MOST; i++) {
        apsm_mesh mesh;
        must(b, model_folder_mesh(b->ctx, &f, i, &mesh));
        count_verdicts(b, &mesh, f.names[i], as_is);
        const double scale = size / size_of(&mesh);
        for (size_t x = 0; x < 3 * mesh.nv; x++) mesh.V[x] *= scale;
        count_verdicts(b, &mesh, f.names[i], sized);
        apsm_mesh_free(&mesh);
    }
    for (size_t i = 0; i < b->folder.I && i < MOST; i++) {
        apsm_mesh mesh, rough;
        apsm_random rng = apsm_random_stream(5, APSM_STREAM_TEST, i, 0);
        must(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
        must(b, apsm_mesh_copy(&mesh, &rough));
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
    must(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
    must(b, fit_alloc(b->joint, &fit));
    for (int turn = 0; turn < 2; turn++) {
        double t = bench_now();
        must(b, apsm_bvh_build_unsigned(&mesh, &bvh));
        step("tree", &t);
        must(b, fit_pose_find(b->joint, &mesh, bvh, &o, &job.pose));
        step("pose", &t);
        must(b, apsm_cohort_build(b->ctx, 1, names, &mesh, job.pose.M, 0, 0, 0, &one));
        job.shape = one.shape[0];
        step("shape", &t);
        must(b, fit_whole_particles(b->ctx, &job));
        step("particles", &t);
        must(b, fit_whole_deviations(&job));
        step("deviations", &t);
        must(b, fit_frames(&job));
        must(b, fit_scores(&job));
        step("frames and scores", &t);
        must(b, apsm_surface_distance_between(b->ctx, &job.shape.mesh, job.shape.bvh, &fit.mesh,
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
            must(b, model_folder_mesh(b->ctx, &b->folder, i, &mesh));
            faces += mesh.nf;
            const double start = bench_now();
            must(b, apsm_fit_surface(b->ctx, b->joint, b->folder.names[i], &mesh, &o, &fit));
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
    if (argc < 3) {
        fprintf(stderr, "usage: bench_fit whole|parts|landmarks|poses|steps MODEL_DIR [FOLDS], or "
                        "strangers MODEL_DIR OTHER\n");
        return 2;
    }
    open_model(&b, argv[2],
               argc > 3 && strcmp(argv[1], "strangers") != 0 ? (size_t)strtoul(argv[3], NULL, 10)
                                                             : 10);
    if (strcmp(argv[1], "whole") == 0) whole(&b);
    if (strcmp(argv[1], "parts") == 0) parts(&b);
    if (strcmp(argv[1], "landmarks") == 0) landmarks(&b);
    if (strcmp(argv[1], "poses") == 0) poses(&b);
    if (strcmp(argv[1], "strangers") == 0 && argc > 3) strangers(&b, argv[3]);
    if (strcmp(argv[1], "steps") == 0) steps(&b);
    if (strcmp(argv[1], "time") == 0) time_shapes(&b);
    apsm_fit_model_free(b.joint);
    model_folder_free(&b.folder);
    apsm_context_free(b.ctx);
    return 0;
}
