/* Does a verdict mean anything?  Judges a finished model as it is and after planting faults in its
 * particles, one JSON line a shape and fault:
 *
 *   bench_trust MODEL_DIR TRUTH_DIR|- [EVERY SEEDS [FAULT SIZE]...]
 *
 * MODEL_DIR holds project.swproj, ours or ShapeWorks'.  TRUTH_DIR as for bench_truth; "lost" is
 * then the share of a shape's particles that are more than two spacings from where at least half of
 * the other shapes say.  Each fault is planted in every EVERY-th shape (5), once for each of SEEDS
 * draws (1): smooth, patch (a region moved along the surface by SIZE spacings, fading or all at
 * once), flow (all particles slip along the longest axis, most in the middle), turn (the shape was
 * turned by 180 degrees about principal axis SIZE), mirror (its mesh is the mirror image across
 * that axis, and the particles where the others' are), swap (SIZE pairs of neighbours changed
 * places), other (a particle on the other side of a sheet, a spacing or more away along the
 * surface), stranger (another surface; SIZE 0: an ellipsoid of the same axes, 1: a ball, 2: half of
 * it, 3: twice its size), none.  Without faults a list of them is run. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/particles.h"
#include "core/random.h"
#include "geometry/clip.h"
#include "geometry/vec3.h"
#include "groom/groom.h"
#include "judge/certify.h"
#include "optimize/correspondence_loss.h"
#include "shapes.h"
#include "synthetic.h"
#include "truth_world.h"

static void *room(size_t n, size_t size)
{
    void *p = calloc(n ? n : 1, size);
    if (!p) exit(1);
    return p;
}

typedef struct true_shape {
    apsm_mesh mesh;
    apsm_bvh *bvh;
    double *P; /* J x 3: particles there */
} true_shape;

typedef struct bench {
    apsm_context *ctx;
    apsm_project project;
    const char *folder;
    size_t I, J, t;    /* shapes, particles, the template */
    const char **name; /* I */
    double *P;         /* I x J x 3, world */
    apsm_cohort cohort;
    double h;
    double *X;          /* I x J x 3: the particles before a fault */
    uint32_t *N6;       /* J x 6 */
    true_shape *truth;  /* I, or NULL */
    double *undo;       /* I x 16: from where a fault has laid the shape */
    bool *stranger;     /* I */
    double *wrong;      /* I: share of particles that are lost, or NaN */
    double *slipped;    /* I: how far a region is from where the others say, in h, or NaN */
    bool *planted;      /* I */
    apsm_shape *whole;  /* I: what a fault has replaced ... */
    apsm_cohort *other; /* I: ... by this one's only shape */
} bench;

/* Project, particles and meshes of MODEL_DIR, whose template is t. */
static void read_model(bench *b, apsm_mesh *mesh, double *M)
{
    for (size_t i = 0; i < b->I; i++) {
        const apsm_subject *s = &b->project.subjects[i];
        char *path = apsm_project_path(&b->project, s->groomed);
        double *P;
        size_t J;
        must(b->ctx, apsm_read_mesh(b->ctx, path, &mesh[i]));
        free(path);
        path = apsm_project_path(&b->project, s->world_particles);
        must(b->ctx, apsm_points_read(b->ctx, path, &J, &P));
        free(path);
        if (!b->P) b->P = room(3 * b->I * (b->J = J), sizeof *b->P);
        memcpy(b->P + 3 * J * i, P, 3 * J * sizeof *P);
        free(P);
        apsm_affine_multiply(s->procrustes, s->alignment, M + 16 * i);
        b->name[i] = s->name;
    }
}

static void load(bench *b, const char *folder)
{
    char path[2048];
    snprintf(path, sizeof path, "%s/project.swproj", folder);
    must(b->ctx, apsm_project_read(b->ctx, path, &b->project));
    const size_t I = b->I = b->project.n;
    const char *used = apsm_project_get(&b->project, "apsm", "template_used");
    apsm_mesh *mesh = room(I, sizeof *mesh);
    double *M = room(16 * I, sizeof *M);
    b->folder = folder;
    b->name = room(I, sizeof *b->name);
    read_model(b, mesh, M);
    for (size_t i = 0; i < I; i++)
        if (used && strcmp(used, b->name[i]) == 0) b->t = i;
    const apsm_cohort_input in = { I, b->name, mesh, M, b->t };
    must(b->ctx, apsm_cohort_build(b->ctx, &in, 0, 0, &b->cohort));
    for (size_t i = 0; i < I; i++) apsm_mesh_free(&mesh[i]);
    free(mesh);
    free(M);
    b->N6 = room(6 * b->J, sizeof *b->N6);
    must(b->ctx, apsm_neighbours6(b->J, b->P + 3 * b->J * b->t, b->N6));
    b->h = apsm_spacing(b->J, b->P + 3 * b->J * b->t, b->N6, NULL);
    b->wrong = room(I, sizeof *b->wrong);
    b->slipped = room(I, sizeof *b->slipped);
    b->planted = room(I, sizeof *b->planted);
    b->stranger = room(I, sizeof *b->stranger);
    b->undo = room(16 * I, sizeof *b->undo);
    for (size_t i = 0; i < I; i++) apsm_affine_identity(b->undo + 16 * i);
    b->whole = room(I, sizeof *b->whole);
    b->other = room(I, sizeof *b->other);
    b->X = room(3 * I * b->J, sizeof *b->X);
    memcpy(b->X, b->P, 3 * I * b->J * sizeof *b->X);
    for (size_t i = 0; i < I; i++) b->wrong[i] = b->slipped[i] = NAN;
}

/* ---- truth ---- */

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

static void read_truths(bench *b, const char *truth)
{
    b->truth = room(b->I, sizeof *b->truth);
    for (size_t i = 0; i < b->I; i++) {
        true_shape *s = &b->truth[i];
        s->mesh = read_truth(b->ctx, truth, &b->project.subjects[i]);
        apsm_mesh_transform(&s->mesh, b->project.subjects[i].procrustes);
        must(b->ctx, apsm_bvh_build(&s->mesh, &s->bvh));
        s->P = room(3 * b->J, sizeof *s->P);
    }
}

static void free_truths(bench *b)
{
    for (size_t i = 0; b->truth && i < b->I; i++) {
        apsm_mesh_free(&b->truth[i].mesh);
        apsm_bvh_free(b->truth[i].bvh);
        free(b->truth[i].P);
    }
    free(b->truth);
}

/* wrong[i] <- the share of particles that are elsewhere than at least half of the others say. */
static void tell_lost(bench *b, size_t i)
{
    double *share = room(b->I, sizeof *share);
    size_t n = 0;
    for (size_t k = 0; k < b->I; k++)
        if (k != i) share[n++] = lost(&b->truth[i], &b->truth[k], b->J, b->h);
    qsort(share, n, sizeof *share, ascending);
    b->wrong[i] = share[n / 2];
    free(share);
}

/* slipped[i] <- the largest mean, over the patch of look 0 around a particle, of how far its
 * particles are from where the median of the others is, all carried to the template by the truth.
 */
static void tell_slipped(bench *b, size_t i)
{
    const size_t J = b->J, I = b->I;
    double *Z = room(3 * I * J, sizeof *Z), *x = room(I, sizeof *x), *d = room(3 * J, sizeof *d);
    const double *at = b->X + 3 * J * b->t;
    for (size_t k = 0; k < I; k++)
        for (size_t j = 0; j < J; j++)
            synthetic_carry(b->truth[k].bvh, &b->truth[b->t].mesh, b->truth[k].P + 3 * j,
                            Z + 3 * (J * k + j));
    for (size_t c = 0; c < 3 * J; c++) {
        size_t n = 0;
        for (size_t k = 0; k < I; k++)
            if (k != i) x[n++] = Z[3 * J * k + c];
        qsort(x, n, sizeof *x, ascending);
        d[c] = Z[3 * J * i + c] - 0.5 * (x[(n - 1) / 2] + x[n / 2]);
    }
    b->slipped[i] = 0;
    for (size_t j = 0; j < J; j++) {
        double sum[3] = { 0 }, n = 0;
        for (size_t k = 0; k < J; k++) {
            if (vec3_distance2(at + 3 * j, at + 3 * k) > 16 * b->h * b->h) continue;
            vec3_add_scaled(sum, 1, d + 3 * k);
            n++;
        }
        b->slipped[i] = fmax(b->slipped[i], vec3_norm(sum) / n / b->h);
    }
    free(Z);
    free(x);
    free(d);
}

/* Of all shapes, or of those with a fault; a stranger has nothing in common. */
static void find_lost(bench *b, bool all)
{
    for (size_t i = 0; b->truth && i < b->I; i++)
        apsm_affine_apply(b->undo + 16 * i, b->J, b->P + 3 * b->J * i, b->truth[i].P);
    for (size_t i = 0; b->truth && i < b->I; i++)
        if (all || b->planted[i]) tell_lost(b, i), tell_slipped(b, i);
    for (size_t i = 0; i < b->I; i++)
        if (b->stranger[i]) b->wrong[i] = 1;
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
    const size_t J = b->J, j = (size_t)apsm_random_below(rng, J);
    const apsm_shape *shape = &b->cohort.shape[i];
    double *P = b->P + 3 * J * i, *N = room(3 * J, sizeof *N), e[3], at[3];
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

/* All particles slip along the longest axis, by SIZE spacings in the middle and not at the ends. */
static void plant_flow(const bench *b, size_t i, double size)
{
    const size_t J = b->J;
    const apsm_shape *shape = &b->cohort.shape[i];
    double *P = b->P + 3 * J * i, c[3], V[9], *x = room(J, sizeof *x), *N = room(3 * J, sizeof *N);
    double longest = 0;
    apsm_surface_point *S = room(J, sizeof *S);
    apsm_principal_axes(J, P, c, V);
    apsm_shape_look_up(shape, J, P, S, NULL, N);
    for (size_t j = 0; j < J; j++) {
        for (size_t k = 0; k < 3; k++) x[j] += V[3 * k] * (P[3 * j + k] - c[k]);
        longest = fmax(longest, fabs(x[j]));
    }
    for (size_t j = 0; j < J; j++) {
        const double amount = size * b->h * (1 - x[j] * x[j] / (longest * longest));
        double v[3] = { amount * V[0], amount * V[3], amount * V[6] };
        vec3_add_scaled(v, -vec3_dot(v, N + 3 * j), N + 3 * j);
        walk(shape, v, P + 3 * j);
    }
    free(x);
    free(N);
    free(S);
}

/* ---- other surfaces ---- */

/* The shape's surface is that of `mesh`, which is taken over. */
static void replace(bench *b, size_t i, apsm_mesh *mesh)
{
    double M[16];
    apsm_affine_identity(M);
    const apsm_cohort_input in = { 1, &b->name[i], mesh, M, 0 };
    must(b->ctx, apsm_cohort_build(b->ctx, &in, 0, 0, &b->other[i]));
    b->whole[i] = b->cohort.shape[i];
    b->cohort.shape[i] = b->other[i].shape[0]; /* whose parts point to each other there */
    apsm_mesh_free(mesh);
}

static void restore(bench *b)
{
    for (size_t i = 0; i < b->I; i++) {
        b->planted[i] = b->stranger[i] = false;
        apsm_affine_identity(b->undo + 16 * i);
        if (!b->other[i].shape) continue;
        b->cohort.shape[i] = b->whole[i];
        apsm_cohort_free(&b->other[i]);
    }
    memcpy(b->P, b->X, 3 * b->I * b->J * sizeof *b->X);
}

static void project(const bench *b, size_t i)
{
    apsm_surface_point *S = room(b->J, sizeof *S);
    double *P = b->P + 3 * b->J * i;
    apsm_shape_look_up(&b->cohort.shape[i], b->J, P, S, P, NULL);
    free(S);
}

/* M <- the half turn about, or the reflection across, principal axis `axis` of shape i. */
static void half_turn(const bench *b, size_t i, size_t axis, bool mirror, double M[16])
{
    double c[3], V[9], u[3];
    apsm_principal_axes(b->J, b->P + 3 * b->J * i, c, V);
    for (size_t a = 0; a < 3; a++) u[a] = V[3 * a + axis % 3];
    apsm_affine_identity(M);
    for (size_t r = 0; r < 3; r++) {
        for (size_t k = 0; k < 3; k++)
            M[4 * r + k] = (mirror ? -2 : 2) * u[r] * u[k] + (r == k ? (mirror ? 1 : -1) : 0);
        M[4 * r + 3] = c[r] - vec3_dot(M + 4 * r, c);
    }
}

/* The shape was turned, or is the mirror image; particles stay where the others' are. */
static void plant_turn(bench *b, size_t i, size_t axis, bool mirror)
{
    double M[16];
    apsm_mesh mesh;
    half_turn(b, i, axis, mirror, M);
    memcpy(b->undo + 16 * i, M, sizeof M); /* its own inverse */
    must(b->ctx, apsm_mesh_copy(&b->cohort.shape[i].mesh, &mesh));
    apsm_mesh_transform(&mesh, M);
    replace(b, i, &mesh);
    project(b, i);
}

/* x in principal coordinates, each in units of its standard deviation times sqrt(3). */
static void to_ball(const double c[3], const double V[9], const double s[3], bool back, double x[3])
{
    double y[3];
    for (size_t a = 0; a < 3; a++) {
        y[a] = 0;
        for (size_t k = 0; k < 3; k++)
            y[a] += back ? V[3 * a + k] * s[k] * x[k] : V[3 * k + a] * (x[k] - c[k]) / s[a];
    }
    for (size_t a = 0; a < 3; a++) x[a] = y[a] + (back ? c[a] : 0);
}

/* An ellipsoid of the same axes, or a ball; particles where rays from the centre meet it. */
static void plant_ellipsoid(bench *b, size_t i, bool ball)
{
    const size_t J = b->J;
    double *P = b->P + 3 * J * i, c[3], V[9], s[3] = { 0 };
    apsm_principal_axes(J, P, c, V);
    for (size_t j = 0; j < J; j++)
        for (size_t a = 0; a < 3; a++) {
            double along = 0;
            for (size_t k = 0; k < 3; k++) along += V[3 * k + a] * (P[3 * j + k] - c[k]);
            s[a] += 3 * along * along / (double)J;
        }
    const double mean = cbrt(sqrt(s[0] * s[1] * s[2]));
    for (size_t a = 0; a < 3; a++) s[a] = ball ? mean : sqrt(s[a]);
    apsm_mesh mesh = shape_icosphere(4);
    for (size_t v = 0; v < mesh.nv; v++) to_ball(c, V, s, true, mesh.V + 3 * v);
    for (size_t j = 0; j < J; j++) {
        to_ball(c, V, s, false, P + 3 * j);
        vec3_normalise(P + 3 * j);
        to_ball(c, V, s, true, P + 3 * j);
    }
    replace(b, i, &mesh);
    project(b, i);
}

/* What lies below the centre along the longest axis is missing, and the hole is closed. */
static void plant_half(bench *b, size_t i)
{
    const size_t J = b->J;
    const apsm_mesh *from = &b->cohort.shape[i].mesh;
    double *P = b->P + 3 * J * i, c[3], V[9], *field = room(from->nv, sizeof *field);
    apsm_groom_options options = apsm_groom_defaults();
    apsm_groom_report report = { 0 };
    apsm_mesh open, mesh;
    options.max_cap_share = 0.5;
    apsm_principal_axes(J, P, c, V);
    for (size_t v = 0; v < from->nv; v++)
        for (size_t k = 0; k < 3; k++) field[v] += V[3 * k] * (from->V[3 * v + k] - c[k]);
    must(b->ctx, apsm_mesh_clip_field(from, field, &open));
    must(b->ctx, apsm_repair(b->ctx, b->name[i], &open, &options, &mesh, &report));
    for (size_t j = 0; j < J; j++) { /* squeezed into what is left */
        double along = 0;
        for (size_t k = 0; k < 3; k++) along += V[3 * k] * (P[3 * j + k] - c[k]);
        for (size_t k = 0; k < 3; k++) P[3 * j + k] += V[3 * k] * (fabs(along) - along) / 2;
    }
    replace(b, i, &mesh);
    project(b, i);
    apsm_mesh_free(&open);
    free(field);
}

static void plant_twice(bench *b, size_t i)
{
    const size_t J = b->J;
    double M[16] = { 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1 };
    apsm_mesh mesh;
    must(b->ctx, apsm_mesh_copy(&b->cohort.shape[i].mesh, &mesh));
    apsm_mesh_transform(&mesh, M);
    apsm_affine_apply(M, J, b->P + 3 * J * i, b->P + 3 * J * i);
    replace(b, i, &mesh);
}

static void plant_stranger(bench *b, size_t i, int which)
{
    b->stranger[i] = true;
    if (which < 2) plant_ellipsoid(b, i, which == 1);
    if (which == 2) plant_half(b, i);
    if (which == 3) plant_twice(b, i);
}

/* ---- single particles ---- */

static void plant_swaps(const bench *b, size_t i, apsm_random *rng, size_t pairs)
{
    double *P = b->P + 3 * b->J * i;
    for (size_t n = 0; n < pairs; n++) {
        const size_t j = (size_t)apsm_random_below(rng, b->J);
        const size_t k = b->N6[6 * j + (size_t)apsm_random_below(rng, 6)];
        for (size_t c = 0; c < 3; c++) {
            const double t = P[3 * j + c];
            P[3 * j + c] = P[3 * k + c];
            P[3 * k + c] = t;
        }
    }
}

/* How far along the surface from a to where it is nearest to x and looks as n says. */
static double way(const bench *b, const apsm_shape *shape, const double a[3], const double x[3],
                  const double n[3])
{
    apsm_geodesic_work *w;
    apsm_surface_point S;
    double least = INFINITY, far = INFINITY;
    apsm_shape_look_up(shape, 1, a, &S, NULL, NULL);
    must(b->ctx, apsm_geodesic_work_new(shape->geodesic, &w));
    must(b->ctx, apsm_geodesic_from(shape->geodesic, &S, 3 * b->h, w));
    for (uint32_t v = 0; v < shape->mesh.nv; v++) {
        const double d2 = vec3_distance2(shape->mesh.V + 3 * v, x);
        if (!(d2 < least) || !(vec3_dot(shape->VN + 3 * v, n) > 0.5)) continue;
        least = d2;
        far = apsm_geodesic_vertex_distance(w, v);
    }
    apsm_geodesic_work_free(w);
    return far;
}

/* A particle where a sheet is thinner than a spacing goes through, to where it is a spacing or more
 * from along the surface (nearer, it has only gone round an edge); false: there is none. */
static bool plant_other_side(const bench *b, size_t i, apsm_random *rng)
{
    const size_t J = b->J, first = (size_t)apsm_random_below(rng, J);
    const apsm_shape *shape = &b->cohort.shape[i];
    for (size_t k = 0; k < J; k++) {
        double *p = &b->P[3 * (J * i + (first + k) % J)], n[3], x[3], in[3], out[3];
        apsm_surface_point S;
        apsm_shape_look_up(shape, 1, p, &S, x, n);
        for (int c = 0; c < 3; c++) in[c] = -n[c];
        const double t = apsm_bvh_ray(shape->bvh, x, in, 1e-6 * b->h, b->h, NULL);
        if (!(t < b->h)) continue;
        for (int c = 0; c < 3; c++) out[c] = x[c] + t * in[c];
        if (way(b, shape, out, x, n) < b->h) continue;
        memcpy(p, out, sizeof out);
        return true;
    }
    return false;
}

typedef struct fault {
    const char *name;
    double size;
} fault;

static void plant(bench *b, const fault *f, size_t every, uint64_t seed)
{
    for (size_t i = seed % every; i < b->I; i += every) {
        apsm_random rng = apsm_random_stream(seed, APSM_STREAM_TEST, i, 0);
        b->planted[i] = strcmp(f->name, "none") != 0;
        if (strcmp(f->name, "smooth") == 0) plant_slip(b, i, &rng, false, f->size);
        if (strcmp(f->name, "patch") == 0) plant_slip(b, i, &rng, true, f->size);
        if (strcmp(f->name, "flow") == 0) plant_flow(b, i, f->size);
        if (strcmp(f->name, "turn") == 0) plant_turn(b, i, (size_t)f->size, false);
        if (strcmp(f->name, "mirror") == 0) plant_turn(b, i, (size_t)f->size, true);
        if (strcmp(f->name, "swap") == 0) plant_swaps(b, i, &rng, (size_t)f->size);
        if (strcmp(f->name, "other") == 0) b->planted[i] = plant_other_side(b, i, &rng);
        if (strcmp(f->name, "stranger") == 0) plant_stranger(b, i, (int)f->size);
    }
}

/* ---- what is told ---- */

static void tell(const bench *b, const fault *planted, const cohort_certificate *c)
{
    for (size_t i = 0; i < b->I; i++) {
        const apsm_findings *f = &c->judgement.shape[i];
        const apsm_certificate *own = &c->shape[i];
        printf("{\"fault\": \"%s %g\", \"shape\": \"%s\", \"planted\": %d, \"template\": %d, "
               "\"lost\": %.3f, \"agreement\": %.3f, "
               "\"turned\": %.3f, \"turned_fit\": %.3f, \"mirrored\": %.3f, \"mirrored_fit\": "
               "%.3f, \"fit\": %.3f, \"slip\": %.3f, \"slip_size\": %.3f, \"reach\": %.3f, "
               "\"reach_excess\": %.2f, \"farthest\": %.3f, \"area\": %.3f, \"area_excess\": %.1f, "
               "\"size\": %.3f, \"size_excess\": %.1f, \"long\": %.1f, \"flat\": %.1f, \"off\": "
               "%.3f, \"off_excess\": %.2f, \"opposed\": %zu, \"neighbours_lost\": %.4f, "
               "\"mismatched\": %.4f, \"swaps\": %zu, \"folds\": %zu, \"t_evidence\": %.3f, "
               "\"m_evidence\": %.3f, "
               "\"reasons\": %u, \"doubts\": "
               "%u, \"s_evidence\": %.3f, \"true_slip\": %.3f, "
               "\"parts\": [%.3f, %.2f, %.3f, %.3f, %.2f, %.3f, %.3f, %.2f, %.3f]}\n",
               planted->name, planted->size, b->name[i], b->planted[i], i == b->t,
               isfinite(b->wrong[i]) ? b->wrong[i] : -1.0, f->agreement,
               fmax(f->turn[0].agreement, -9), f->turn[0].fit, fmax(f->turn[1].agreement, -9),
               f->turn[1].fit, f->fit, f->slip, f->slip_size, f->reach, f->reach_excess,
               f->farthest, f->area, f->area_excess, f->size, f->size_excess, f->long_excess,
               f->flat_excess, f->off, f->off_excess, f->opposed,
               (double)own->lost / (double)own->J, (double)own->mismatched / (double)own->J,
               own->swaps, own->folds, fmin(f->turn[0].evidence, 99), fmin(f->turn[1].evidence, 99),
               own->reasons, c->doubts[i], fmin(f->turn[1].staying, 99),
               isfinite(b->slipped[i]) ? b->slipped[i] : -1.0, f->part[0].times, f->part[0].excess,
               f->part[0].size, f->part[1].times, f->part[1].excess, f->part[1].size,
               f->part[2].times, f->part[2].excess, f->part[2].size);
    }
}

static void run(bench *b, const fault *f, size_t every, uint64_t seed)
{
    cohort_certificate c;
    double *before = room(2 * b->I, sizeof *before);
    memcpy(before, b->wrong, b->I * sizeof *before);
    memcpy(before + b->I, b->slipped, b->I * sizeof *before);
    plant(b, f, every, seed);
    find_lost(b, false);
    must(b->ctx, certify_cohort(b->ctx, &b->cohort, b->J, b->P, NULL, &c));
    tell(b, f, &c);
    certify_free(&c);
    restore(b);
    memcpy(b->wrong, before, b->I * sizeof *before);
    memcpy(b->slipped, before + b->I, b->I * sizeof *before);
    free(before);
}

int main(int argc, char **argv)
{
    static const fault all[] = { { "none", 0 },     { "turn", 0 },     { "turn", 1 },
                                 { "turn", 2 },     { "mirror", 2 },   { "stranger", 0 },
                                 { "stranger", 1 }, { "stranger", 2 }, { "stranger", 3 },
                                 { "smooth", 0.5 }, { "smooth", 1 },   { "smooth", 2 },
                                 { "smooth", 3 },   { "patch", 1 },    { "swap", 1 },
                                 { "other", 0 } };
    bench b = { .ctx = apsm_context_new() };
    if (argc < 2 || !b.ctx) return 2;
    load(&b, argv[1]);
    if (argc > 2 && strcmp(argv[2], "-") != 0) read_truths(&b, argv[2]);
    find_lost(&b, true);
    const size_t every = argc > 3 ? strtoul(argv[3], NULL, 10) : 5;
    const uint64_t seeds = argc > 4 ? strtoul(argv[4], NULL, 10) : 1;
    const size_t faults = argc > 6 ? (size_t)(argc - 5) / 2 : sizeof all / sizeof *all;
    for (size_t k = 0; k < faults; k++) {
        const fault named = argc > 6 ? (fault){ argv[5 + 2 * k], atof(argv[6 + 2 * k]) } : all[k];
        const uint64_t draws = strcmp(named.name, "none") == 0 ? 1 : seeds;
        for (uint64_t seed = 0; seed < draws; seed++) run(&b, &named, every, 1 + 2 * seed);
    }
    free_truths(&b);
    apsm_cohort_free(&b.cohort);
    apsm_project_free(&b.project);
    free(b.name);
    free(b.P);
    free(b.N6);
    free(b.X);
    free(b.whole);
    free(b.other);
    free(b.wrong);
    free(b.slipped);
    free(b.planted);
    free(b.stranger);
    free(b.undo);
    apsm_context_free(b.ctx);
    return 0;
}
