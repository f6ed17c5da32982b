/* Does a verdict mean anything?  Judges a finished model after planting faults in its particles,
 * one JSON line a shape:
 *
 *   bench_trust MODEL_DIR [TRUTH_DIR|-] [FAULT SIZE EVERY SEED]
 *
 * TRUTH_DIR as for bench_truth; told is then the share of a shape's particles that are more than
 * two spacings from where at least half of the other shapes say.  FAULT is planted in every
 * EVERY-th shape: smooth, patch (a region moved along the surface by SIZE spacings, all at once or
 * fading), turn (by 180 degrees about principal axis SIZE), mirror (through the plane across it),
 * other (a particle on the other side of a sheet). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "apsm/particles.h"
#include "core/random.h"
#include "files/particles_file.h"
#include "folder/model_folder.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "judge/verdict.h"
#include "optimize/correspondence_loss.h"
#include "synthetic.h"

static void check(apsm_context *ctx, apsm_status status)
{
    if (status == APSM_OK) return;
    fprintf(stderr, "bench_trust: %s %s\n", apsm_status_text(status), apsm_error_text(ctx));
    exit(1);
}

static void *room(size_t n, size_t size)
{
    void *p = calloc(n ? n : 1, size);
    if (!p) exit(1);
    return p;
}

typedef struct bench {
    apsm_context *ctx;
    model_folder m;
    apsm_cohort cohort;
    double h;
    double *wrong; /* I: share of particles that are lost, or NaN */
    bool *planted; /* I */
} bench;

static void load(bench *b, const char *folder)
{
    check(b->ctx, model_folder_read(b->ctx, folder, FOLDER_PARTICLES, &b->m));
    const size_t I = b->m.I;
    apsm_mesh *mesh = room(I, sizeof *mesh);
    double *M = room(16 * I, sizeof *M);
    for (size_t i = 0; i < I; i++) {
        check(b->ctx, model_folder_mesh(b->ctx, &b->m, i, &mesh[i]));
        apsm_affine_identity(M + 16 * i);
    }
    check(b->ctx,
          apsm_cohort_build(b->ctx, I, b->m.names, mesh, M, b->m.template_index, 0, 0, &b->cohort));
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
    free(mesh);
    free(M);
    uint32_t *N6 = room(6 * b->m.J, sizeof *N6);
    const double *T = b->m.P + 3 * b->m.J * b->m.template_index;
    check(b->ctx, apsm_neighbours6(b->m.J, T, N6));
    b->h = apsm_spacing(b->m.J, T, N6, NULL);
    free(N6);
    b->wrong = room(I, sizeof *b->wrong);
    b->planted = room(I, sizeof *b->planted);
    for (size_t i = 0; i < I; i++) b->wrong[i] = NAN;
}

/* ---- truth ---- */

typedef struct true_shape {
    apsm_mesh mesh;
    apsm_bvh *bvh;
    double *P;
} true_shape;

static double lost(const true_shape *a, const true_shape *b, size_t J, double h)
{
    size_t n = 0;
    for (size_t j = 0; j < J; j++)
        n += synthetic_truth_error(a->bvh, &b->mesh, 1, a->P + 3 * j, b->P + 3 * j) > 2 * h;
    return (double)n / (double)J;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void find_truth(bench *b, const char *truth)
{
    const size_t I = b->m.I;
    true_shape *s = room(I, sizeof *s);
    double *share = room(I, sizeof *share);
    char path[2048];
    for (size_t i = 0; i < I; i++) {
        size_t J;
        snprintf(path, sizeof path, "%s/%s.ply", truth, b->m.names[i]);
        check(b->ctx, apsm_read_mesh(b->ctx, path, &s[i].mesh));
        check(b->ctx, apsm_bvh_build(&s[i].mesh, &s[i].bvh));
        snprintf(path, sizeof path, "%s/particles/%s_original.particles", b->m.path, b->m.names[i]);
        check(b->ctx, apsm_points_read(b->ctx, path, &J, &s[i].P));
    }
    for (size_t i = 0; i < I; i++) {
        size_t n = 0;
        for (size_t k = 0; k < I; k++)
            if (k != i) share[n++] = lost(&s[i], &s[k], b->m.J, b->h);
        qsort(share, n, sizeof *share, ascending);
        b->wrong[i] = share[n / 2];
    }
    for (size_t i = 0; i < I; i++) {
        apsm_mesh_free(&s[i].mesh);
        apsm_bvh_free(s[i].bvh);
        free(s[i].P);
    }
    free(s);
    free(share);
}

/* ---- faults ---- */

/* Moves x along the surface by v (its length is kept), in small steps. */
static void walk(const apsm_shape *shape, double v[3], double x[3])
{
    enum { STEPS = 12 };
    const double length = vec3_norm(v) / STEPS;
    for (int step = 0; step < STEPS && length > 0; step++) {
        apsm_surface_point S;
        double n[3], y[3];
        apsm_shape_look_up(shape, 1, x, &S, NULL, n);
        vec3_add_scaled(v, -vec3_dot(v, n), n);
        vec3_normalise(v);
        for (int c = 0; c < 3; c++) y[c] = x[c] + length * v[c];
        apsm_shape_look_up(shape, 1, y, &S, x, n);
    }
}

static void plant_slip(const bench *b, size_t i, apsm_random *rng, bool patch, double size)
{
    const size_t J = b->m.J, j = (size_t)apsm_random_below(rng, J);
    const apsm_shape *shape = &b->cohort.shape[i];
    double *P = b->m.P + 3 * J * i, *N = room(3 * J, sizeof *N), e[3], at[3];
    apsm_surface_point *S = room(J, sizeof *S);
    const double R = (patch ? 2.2 : 4.5) * b->h;
    apsm_shape_look_up(shape, J, P, S, NULL, N);
    for (int c = 0; c < 3; c++) e[c] = apsm_random_normal(rng), at[c] = P[3 * j + (size_t)c];
    vec3_add_scaled(e, -vec3_dot(e, N + 3 * j), N + 3 * j);
    vec3_normalise(e);
    for (size_t k = 0; k < J; k++) {
        const double r = sqrt(vec3_distance2(P + 3 * k, at)), fade = cos(fmin(r / R, 1) * M_PI / 2);
        double v[3];
        if (r >= R || vec3_dot(N + 3 * k, N + 3 * j) <= 0) continue;
        vec3_add_scaled(memcpy(v, e, sizeof v), -vec3_dot(e, N + 3 * k), N + 3 * k);
        vec3_normalise(v);
        for (int c = 0; c < 3; c++) v[c] *= size * b->h * (patch ? 1 : fade * fade);
        walk(shape, v, P + 3 * k);
    }
    free(N);
    free(S);
}

/* The particles where those of the turned or mirrored shape would be. */
static void plant_turn(const bench *b, size_t i, size_t axis, bool mirror)
{
    const size_t J = b->m.J;
    double *P = b->m.P + 3 * J * i, c[3] = { 0 }, C[9] = { 0 }, U[9], s[3], V[9], u[3];
    apsm_surface_point *S = room(J, sizeof *S);
    for (size_t k = 0; k < 3 * J; k++) c[k % 3] += P[k] / (double)J;
    for (size_t j = 0; j < J; j++)
        for (size_t a = 0; a < 9; a++)
            C[a] += (P[3 * j + a / 3] - c[a / 3]) * (P[3 * j + a % 3] - c[a % 3]);
    apsm_svd3(C, U, s, V);
    for (size_t a = 0; a < 3; a++) u[a] = V[3 * a + axis % 3];
    for (size_t j = 0; j < J; j++) {
        double d[3];
        vec3_sub(P + 3 * j, c, d);
        const double along = vec3_dot(d, u);
        for (size_t a = 0; a < 3; a++)
            P[3 * j + a] = c[a] + (mirror ? d[a] - 2 * along * u[a] : 2 * along * u[a] - d[a]);
    }
    apsm_shape_look_up(&b->cohort.shape[i], J, P, S, P, NULL);
    free(S);
}

/* A particle where a sheet is thinner than a spacing goes through; false: there is none. */
static bool plant_other_side(const bench *b, size_t i, apsm_random *rng)
{
    const size_t J = b->m.J, first = (size_t)apsm_random_below(rng, J);
    const apsm_shape *shape = &b->cohort.shape[i];
    for (size_t k = 0; k < J; k++) {
        double *p = &b->m.P[3 * (J * i + (first + k) % J)], n[3], x[3], in[3];
        apsm_surface_point S;
        apsm_shape_look_up(shape, 1, p, &S, x, n);
        for (int c = 0; c < 3; c++) in[c] = -n[c];
        const double t = apsm_bvh_ray(shape->bvh, x, in, 1e-6 * b->h, b->h, NULL);
        if (!(t < b->h)) continue;
        for (int c = 0; c < 3; c++) p[c] = x[c] + t * in[c];
        return true;
    }
    return false;
}

static void plant(bench *b, const char *fault, double size, size_t every, uint64_t seed)
{
    for (size_t i = 0; i < b->m.I; i++) {
        apsm_random rng = apsm_random_stream(seed, APSM_STREAM_TEST, i, 0);
        if (i % every != seed % every) continue;
        b->planted[i] = strcmp(fault, "none") != 0;
        if (strcmp(fault, "smooth") == 0) plant_slip(b, i, &rng, false, size);
        if (strcmp(fault, "patch") == 0) plant_slip(b, i, &rng, true, size);
        if (strcmp(fault, "turn") == 0) plant_turn(b, i, (size_t)size, false);
        if (strcmp(fault, "mirror") == 0) plant_turn(b, i, (size_t)size, true);
        if (strcmp(fault, "other") == 0) b->planted[i] = plant_other_side(b, i, &rng);
    }
}

/* ---- what is told ---- */

static void tell(const bench *b, const apsm_judgement *g)
{
    const apsm_verdict_options options = apsm_verdict_defaults();
    for (size_t i = 0; i < b->m.I; i++) {
        const apsm_findings *f = &g->shape[i];
        printf(
            "{\"shape\": \"%s\", \"planted\": %d, \"lost\": %.3f, \"agreement\": %.3f, "
            "\"turned\": %.3f, \"turned_fit\": %.2f, \"mirrored\": %.3f, \"mirrored_fit\": %.2f, "
            "\"fit\": %.2f, \"slip\": %.2f, \"slip_size\": %.2f, \"reach\": %.2f, "
            "\"reach_excess\": %.2f, \"area\": %.3f, \"area_excess\": %.1f, \"size\": %.3f, "
            "\"size_excess\": %.1f, \"long\": %.1f, \"flat\": %.1f, \"off\": %.2f, "
            "\"off_excess\": %.1f, \"opposed\": %zu, \"doubts\": %u}\n",
            b->m.names[i], b->planted[i], isfinite(b->wrong[i]) ? b->wrong[i] : -1.0, f->agreement,
            f->turn[0].agreement, f->turn[0].fit, f->turn[1].agreement, f->turn[1].fit, f->fit,
            f->slip, f->slip_size, f->reach, f->reach_excess, f->area, f->area_excess, f->size,
            f->size_excess, f->long_excess, f->flat_excess, f->off, f->off_excess, f->opposed,
            apsm_verdict_doubts(f, &options));
    }
}

int main(int argc, char **argv)
{
    bench b = { .ctx = apsm_context_new() };
    apsm_judgement g;
    if (argc < 2 || !b.ctx) return 2;
    load(&b, argv[1]);
    if (argc > 2 && strcmp(argv[2], "-") != 0) find_truth(&b, argv[2]);
    if (argc > 6)
        plant(&b, argv[3], atof(argv[4]), strtoul(argv[5], NULL, 10), strtoul(argv[6], NULL, 10));
    check(b.ctx, apsm_judge(b.ctx, &b.cohort, b.m.J, b.m.P, &g));
    tell(&b, &g);
    apsm_judgement_free(&g);
    apsm_cohort_free(&b.cohort);
    model_folder_free(&b.m);
    free(b.wrong);
    free(b.planted);
    apsm_context_free(b.ctx);
    return 0;
}
