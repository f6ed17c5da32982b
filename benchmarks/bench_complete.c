/* What is missing, completed: shapes that a model has not seen, from a part of their surface or
 * from a few landmarks, beside other ways to complete them.
 *
 *     bench_complete parts MODEL_DIR [FOLDS [STEP]]      20, 50, 80 % missing: beyond a plane, in
 *                                                        patches, or all but one fragment
 *     bench_complete landmarks MODEL_DIR [FOLDS [STEP]]  4, 6, 10 particles of the joint model are
 *                                                        known
 *
 * STEP: of a fold's shapes only every so many-th is fitted.
 * Folds of the shapes are left out of mean, modes and calibration.  A row for each way:
 *
 *   fit      as `apsm fit` does, the pose searched (parts in any pose; the hand is known)
 *   mean     the mean shape, registered by the same robust rounds from the true pose
 *   least    all modes, no prior: plain least squares, by the same rounds from the true pose
 *   process  a Gaussian process about the mean whose reach and variance suit the cohort best, no
 *            modes; by the same rounds from the true pose
 *   placed   fit from the true pose: what the search for it costs
 *
 * Errors are of the particles that are not seen, in h of the joint model: their distance from the
 * true surface, and from the joint model's particles.  Inside: share of them within the 90 % band
 * along the normal; by region the least and largest share of eight regions of the mean.  All ways
 * are judged on the particles that no way sees. */
#include "fit_world.h"

enum { REGIONS = 8, WAYS = 5, AMOUNTS = 3 };
static const char *const way_names[WAYS] = { "fit", "mean", "least", "process", "placed" };

/* Sums over the hidden particles of one setting. */
typedef struct sums {
    double surface[WAYS], particle[WAYS], inside, region_inside[REGIONS], seconds;
    double *z; /* |distance| / deviation of those of fit */
    size_t n, region_n[REGIONS], shapes, refused, lost, room;
} sums;

typedef struct fold {
    const left_out *b;
    apsm_fit_model *m;
    apsm_fit_model way[WAYS]; /* shallow copies of m with other posteriors */
    double *store[WAYS];
    unsigned char *region; /* J */
} fold;

/* ---- other ways: other posteriors of the same pipeline ---- */

static void make_mean_way(fold *f, size_t k)
{
    posterior_model *q = &f->way[k].posterior;
    q->M = 1;
    q->variance = f->store[k];
    f->store[k][0] = 1e-12 * f->m->h * f->m->h;
}

static void make_least_way(fold *f, size_t k)
{
    const apsm_shape_model *s = &f->m->model;
    posterior_model *q = &f->way[k].posterior;
    for (size_t j = 0; j < s->modes; j++) f->store[k][j] = 1e6 * s->variance[0];
    *q = (posterior_model){
        q->D, s->modes, s->mean, s->mode, f->store[k], 0.01 * f->m->h * f->m->h
    };
}

/* Log likelihood of the cohort's shapes under the process. */
static double likelihood(const left_out *b, const posterior_model *q, size_t I, const double *P)
{
    const size_t J = q->D / 3;
    double *error = bench_doubles(J), *bb = bench_doubles(q->M + q->M * q->M), sum = 0;
    double *work = bench_doubles(posterior_particles_work_size(q));
    posterior_scores s = { .b = bb, .B = bb + q->M };
    for (size_t i = 0; i < I; i++) {
        must_fit(b, posterior_of_particles(q, P + i * q->D, error, &s, NULL, NULL, work));
        sum += s.log_likelihood;
    }
    free(error);
    free(bb);
    free(work);
    return sum;
}

static void make_process_way(fold *f, size_t k)
{
    static const double reaches[] = { 1, 1.5, 2.25, 3.4, 5, 7.6 }, shares[] = { 0.8, 0.95, 0.99 };
    const apsm_shape_model *s = &f->m->model;
    const size_t D = 3 * s->J, size = fit_posterior_size(s->J, 0);
    double *P = bench_doubles(s->I * D), *store = bench_doubles(size), best = -INFINITY, total = 0;
    const fit_modes mean_alone = { s->J, 0, s->mean, s->mode, s->variance };
    fit_model_particles(s, P);
    for (size_t j = 0; j < s->modes; j++) total += s->variance[j] / (double)D;
    for (size_t r = 0; r < 6; r++)
        for (size_t t = 0; t < 3; t++) {
            double *const at = r + t == 0 ? f->store[k] : store;
            const fit_process process = { shares[t] * total, reaches[r] * f->m->h,
                                          (1 - shares[t]) * total };
            const posterior_model q = fit_posterior_make(&mean_alone, &process, at);
            const double found = likelihood(f->b, &q, s->I, P);
            if (!(found > best)) continue;
            best = found;
            f->way[k].posterior = fit_posterior_make(&mean_alone, &process, f->store[k]);
        }
    free(store);
    free(P);
}

/* Eight regions: particles go to the nearest of eight spread ones. */
static void make_regions(fold *f)
{
    size_t centre[REGIONS];
    const double *mean = f->m->model.mean;
    spread_particles(f->m, REGIONS, centre);
    for (size_t j = 0; j < f->m->model.J; j++) {
        double least = INFINITY;
        for (size_t r = 0; r < REGIONS; r++) {
            const double d2 = vec3_distance2(mean + 3 * j, mean + 3 * centre[r]);
            if (d2 < least) least = d2, f->region[j] = (unsigned char)r;
        }
    }
}

static fold open_fold(const left_out *b, size_t number)
{
    fold f = { .b = b, .m = without_fold(b, number) };
    const size_t J = f.m->model.J;
    f.region = bench_alloc(J);
    make_regions(&f);
    for (size_t k = 0; k < WAYS; k++) {
        f.way[k] = *f.m;
        f.store[k] = bench_doubles(fit_posterior_size(J, f.m->model.modes));
    }
    make_mean_way(&f, 1);
    make_least_way(&f, 2);
    make_process_way(&f, 3);
    return f;
}

static void close_fold(fold *f)
{
    for (size_t k = 0; k < WAYS; k++) free(f->store[k]);
    free(f->region);
    apsm_fit_model_free(f->m);
}

/* ---- what a way has found ---- */

static void add_z(sums *s, double z)
{
    if (s->n == s->room) {
        s->room = 2 * s->room + 1024;
        s->z = realloc(s->z, s->room * sizeof *s->z);
        if (!s->z) abort();
    }
    s->z[s->n] = z;
}

/* Particle j of way k: x in the world, P where the joint model has it. */
static void judge_particle(const fold *f, size_t k, const apsm_bvh *truth, const apsm_fit *fit,
                           size_t j, const double x[3], const double P[3], sums *s)
{
    apsm_closest at;
    apsm_bvh_closest(truth, x, INFINITY, &at);
    const double d = sqrt(at.distance2);
    s->surface[k] += d;
    s->particle[k] += sqrt(vec3_distance2(x, P));
    if (k > 0) return;
    const bool inside = d <= 1.645 * fit->sd_normal[j];
    add_z(s, d / fit->sd_normal[j]);
    s->inside += inside;
    s->region_inside[f->region[j]] += inside;
    s->region_n[f->region[j]]++;
    s->n++;
}

/* All ways on the particles that none of them sees; to_world: from the fits' input. */
static void judge(const fold *f, size_t i, const apsm_mesh *whole, const double to_world[16],
                  const apsm_fit *fit, const bool *known, sums *s)
{
    const size_t J = f->m->model.J;
    const double *P = joint_particles(f->b, i);
    apsm_bvh *truth;
    bench_must(apsm_bvh_build_unsigned(whole, &truth));
    for (size_t j = 0; j < J; j++) {
        bool seen = known && known[j];
        for (size_t k = 0; k < WAYS; k++) seen |= fit[k].J > 0 && fit[k].observed[j];
        for (size_t k = 0; !seen && k < WAYS; k++) {
            double x[3];
            if (fit[k].J == 0) {
                s->lost++;
                continue;
            }
            apsm_affine_apply(to_world, 1, fit[k].original + 3 * j, x);
            judge_particle(f, k, truth, &fit[k], j, x, P + 3 * j, s);
        }
    }
    apsm_bvh_free(truth);
}

static void tell(const left_out *b, const char *what, const char *amount, sums *s)
{
    const double n = (double)s->n, h = b->joint->h;
    double least = 1, most = 0;
    for (size_t r = 0; r < REGIONS; r++) {
        if (s->region_n[r] == 0) continue;
        least = fmin(least, s->region_inside[r] / (double)s->region_n[r]);
        most = fmax(most, s->region_inside[r] / (double)s->region_n[r]);
    }
    qsort(s->z, s->n, sizeof *s->z, bench_by_value);
    printf("{\"missing\": \"%s\", \"amount\": \"%s\"", what, amount);
    for (size_t k = 0; k < WAYS; k++)
        printf(", \"%s\": [%.3f, %.3f]", way_names[k], s->surface[k] / n / h,
               s->particle[k] / n / h);
    printf(", \"inside\": %.3f, \"regions\": [%.3f, %.3f], \"factor\": %.2f, \"seconds\": %.3f, "
           "\"refused\": %zu, \"lost\": %zu, \"shapes\": %zu, \"particles\": %zu}\n",
           s->inside / n, least, most, s->n ? s->z[s->n * 9 / 10] / 1.645 : 0.0,
           s->seconds / (double)s->shapes, s->refused, s->lost, s->shapes, s->n);
    fflush(stdout);
    free(s->z);
}

/* ---- parts ---- */

enum { PLANE, PATCHES, FRAGMENT, CUTS };
static const char *const cut_names[CUTS] = { "plane", "patches", "fragment" };

/* What decides which vertices go: those where it is largest. */
static void make_heights(const apsm_mesh *mesh, int kind, size_t i, double *height)
{
    enum { PATCH = 3 };
    apsm_random rng = apsm_random_stream(11, APSM_STREAM_TEST, i, (uint64_t)kind);
    double axis[3], at[PATCH][3];
    for (size_t c = 0; c < 3; c++) axis[c] = apsm_random_normal(&rng);
    for (size_t p = 0; p < PATCH; p++)
        memcpy(at[p], mesh->V + 3 * apsm_random_below(&rng, mesh->nv), sizeof at[p]);
    for (size_t v = 0; v < mesh->nv; v++) {
        const double *x = mesh->V + 3 * v;
        double near = INFINITY;
        for (size_t p = 0; p < PATCH; p++) near = fmin(near, vec3_distance2(x, at[p]));
        height[v] = kind == PLANE     ? vec3_dot(axis, x)
                    : kind == PATCHES ? -near
                                      : vec3_distance2(x, at[0]);
    }
}

static void cut(apsm_mesh *mesh, int kind, size_t i, double missing)
{
    double *height = bench_doubles(mesh->nv), *sorted = bench_doubles(mesh->nv);
    size_t nf = 0;
    make_heights(mesh, kind, i, height);
    memcpy(sorted, height, mesh->nv * sizeof *sorted);
    qsort(sorted, mesh->nv, sizeof *sorted, bench_by_value);
    const double level = sorted[(size_t)((1 - missing) * (double)(mesh->nv - 1))];
    for (size_t f = 0; f < mesh->nf; f++) {
        const uint32_t *c = mesh->F + 3 * f;
        if (height[c[0]] > level || height[c[1]] > level || height[c[2]] > level) continue;
        memmove(mesh->F + 3 * nf++, c, 3 * sizeof *c);
    }
    mesh->nf = nf;
    free(height);
    free(sorted);
}

/* Mean distance of all particles from the joint model's, in h. */
static double apart_of(const left_out *b, size_t i, const apsm_fit *fit)
{
    return fit->J > 0 ? apart(fit->J, fit->original, joint_particles(b, i)) / b->joint->h : NAN;
}

static bool bands_alone; /* of fit, from the true pose */

static void one_part(const fold *f, size_t i, int kind, double missing, sums *s)
{
    const left_out *b = f->b;
    apsm_mesh whole, part;
    apsm_fit fit[WAYS] = { 0 };
    apsm_fit_options o = apsm_fit_defaults();
    double identity[16];
    apsm_affine_identity(identity);
    must_fit(b, model_folder_mesh(b->ctx, &b->folder, i, &whole));
    must_fit(b, apsm_mesh_copy(&whole, &part));
    cut(&part, kind, i, missing);
    o.extent = APSM_EXTENT_PART;
    o.hand = APSM_HAND_SAME;
    o.force = true;
    double own[16], back[16];
    model_folder_to_world(&b->folder, i, own);
    from_world(b, i, back);
    for (size_t k = 0; k < (bands_alone ? 1 : WAYS); k++) {
        apsm_mesh given;
        must_fit(b, apsm_mesh_copy(&part, &given));
        o.aligned = k > 0 || bands_alone;
        if (!o.aligned) apsm_mesh_transform(&given, back);
        const double start = bench_now();
        must_fit(b, apsm_fit_surface(b->ctx, &f->way[k], b->folder.names[i], &given, &o, &fit[k]));
        if (k == 0) s->seconds += bench_now() - start;
        if (!o.aligned) apsm_affine_apply(own, fit[0].J, fit[0].original, fit[0].original);
        apsm_mesh_free(&given);
    }
    s->shapes++;
    if (fit[0].J > 0 && !bands_alone)
        fprintf(stderr,
                "%s %s %.0f %%: %s, %.3f h from the joint model's particles (placed %.3f)\n",
                b->folder.names[i], cut_names[kind], 100 * missing,
                apsm_fit_verdict_text(fit[0].verdict), apart_of(b, i, &fit[0]),
                apart_of(b, i, &fit[WAYS - 1]));
    s->refused += *fit[0].reason && strstr(fit[0].reason, "another") != NULL;
    judge(f, i, &whole, identity, fit, NULL, s);
    for (size_t k = 0; k < WAYS; k++) apsm_fit_free(&fit[k]);
    apsm_mesh_free(&part);
    apsm_mesh_free(&whole);
}

static void parts(const left_out *b, size_t step)
{
    static const double missing[AMOUNTS] = { 0.2, 0.5, 0.8 };
    static const char *const amount[AMOUNTS] = { "20 %", "50 %", "80 %" };
    sums s[CUTS][AMOUNTS] = { 0 };
    for (size_t n = 0; n < b->folds; n++) {
        fold f = open_fold(b, n);
        for (size_t i = n; i < b->folder.I; i += step * b->folds)
            for (int c = 0; i != b->folder.template_index && c < CUTS; c++)
                for (size_t q = 0; q < AMOUNTS; q++) one_part(&f, i, c, missing[q], &s[c][q]);
        close_fold(&f);
    }
    for (size_t c = 0; c < CUTS; c++)
        for (size_t q = 0; q < AMOUNTS; q++) tell(b, cut_names[c], amount[q], &s[c][q]);
}

/* ---- landmarks ---- */

static void some_landmarks(const fold *f, size_t i, size_t n, sums *s)
{
    enum { MOST = 10 };
    const left_out *b = f->b;
    const size_t J = f->m->model.J;
    size_t index[MOST];
    double at[3 * MOST], x[3 * MOST], back[16], own[16];
    bool *known = bench_alloc(J * sizeof *known);
    apsm_fit fit[WAYS] = { 0 };
    apsm_mesh whole;
    apsm_fit_options o = apsm_fit_defaults();
    o.force = true;
    spread_particles(f->m, n, index);
    for (size_t k = 0; k < n; k++) {
        known[index[k]] = true;
        memcpy(at + 3 * k, f->m->model.mean + 3 * index[k], 3 * sizeof *at);
        memcpy(x + 3 * k, joint_particles(b, i) + 3 * index[k], 3 * sizeof *x);
    }
    from_world(b, i, back);
    apsm_affine_apply(back, n, x, x);
    model_folder_to_world(&b->folder, i, own);
    for (size_t k = 0; k < WAYS; k++)
        must_fit(b,
                 apsm_fit_landmarks(b->ctx, &f->way[k], b->folder.names[i], n, at, x, &o, &fit[k]));
    must_fit(b, model_folder_mesh(b->ctx, &b->folder, i, &whole));
    s->shapes++;
    judge(f, i, &whole, own, fit, known, s);
    for (size_t k = 0; k < WAYS; k++) apsm_fit_free(&fit[k]);
    apsm_mesh_free(&whole);
    free(known);
}

static void landmarks(const left_out *b, size_t step)
{
    static const size_t counts[AMOUNTS] = { 4, 6, 10 };
    static const char *const amount[AMOUNTS] = { "4", "6", "10" };
    sums s[AMOUNTS] = { 0 };
    for (size_t n = 0; n < b->folds; n++) {
        fold f = open_fold(b, n);
        for (size_t i = n; i < b->folder.I; i += step * b->folds)
            for (size_t q = 0; i != b->folder.template_index && q < AMOUNTS; q++)
                some_landmarks(&f, i, counts[q], &s[q]);
        close_fold(&f);
    }
    for (size_t q = 0; q < AMOUNTS; q++) tell(b, "all but landmarks", amount[q], &s[q]);
}

int main(int argc, char **argv)
{
    left_out b = { 0 };
    if (argc < 3) {
        fprintf(stderr, "usage: bench_complete parts|bands|landmarks MODEL_DIR [FOLDS [STEP]]\n");
        return 2;
    }
    open_model(&b, argv[2], argc > 3 ? (size_t)strtoul(argv[3], NULL, 10) : 10);
    const size_t step = argc > 4 ? (size_t)strtoul(argv[4], NULL, 10) : 1;
    if (step == 0 || b.folds == 0) return 2;
    bands_alone = strcmp(argv[1], "bands") == 0;
    if (bands_alone || strcmp(argv[1], "parts") == 0) parts(&b, step);
    if (strcmp(argv[1], "landmarks") == 0) landmarks(&b, step);
    close_model(&b);
    return 0;
}
