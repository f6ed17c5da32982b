/* A part of a surface to a fit: the best of several poses, refined; which particles it shows; and
 * the posterior of all given those. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/part.h"
#include "fit/rigid.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"

enum { POSES = 5, FIRST_ROUNDS = 8, LAST_ROUNDS = 14 };
static const double first_reach = 1.5; /* h */
static const double another_pose = 1;  /* h: from so far on */
static const double seen_reach = 0.5;  /* h: a particle is seen if the surface is so near */
static const double at_border = 0.1;   /* h: or so near where the surface ends */

/* ---- the best pose ---- */

/* Refined states of several poses, the best and the cost of the next best that is another pose. */
typedef struct race {
    part_state best, trial; /* each with its scores */
    double M[POSES][16], cost[POSES];
    size_t n;
} race;

static apsm_status try_pose(const apsm_fit_model *m, const part_points *p, const double M[16],
                            race *r, part_work *w)
{
    part_state *s = &r->trial;
    memcpy(s->M, M, sizeof s->M);
    memset(s->b, 0, m->posterior.M * sizeof *s->b);
    APSM_TRY(part_refine(m, p, FIRST_ROUNDS, first_reach, s, w));
    memcpy(r->M[r->n], s->M, sizeof s->M);
    r->cost[r->n++] = s->cost;
    if (!(s->cost < r->best.cost)) return APSM_OK;
    const part_state t = r->best;
    r->best = *s;
    *s = t;
    return APSM_OK;
}

/* Root mean square distance of the points between two poses, in h. */
static double poses_apart(const apsm_fit_model *m, const part_points *p, const double A[16],
                          const double B[16])
{
    double sum = 0, x[3], y[3];
    for (size_t k = 0; k < p->n; k++) {
        apsm_affine_apply(A, 1, p->x + 3 * k, x);
        apsm_affine_apply(B, 1, p->x + 3 * k, y);
        sum += vec3_distance2(x, y) / (double)p->n;
    }
    return sqrt(sum) / m->h;
}

/* By how much the best pose is more likely than the next that is another one, as a logarithm. */
static double evidence_of(const apsm_fit_model *m, const part_points *p, const race *r)
{
    double next = INFINITY;
    for (size_t k = 0; k < r->n; k++)
        if (r->cost[k] < next && poses_apart(m, p, r->M[k], r->best.M) > another_pose)
            next = r->cost[k];
    return 0.5 * (next - r->best.cost);
}

/* Starts where it is, if that is known, else from the search. */
static apsm_status find_state(fit_job *job, const part_points *p, race *r, part_work *w)
{
    double M[POSES][16];
    size_t n = 1;
    apsm_affine_identity(M[0]);
    r->best.cost = INFINITY;
    if (!job->options->aligned) APSM_TRY(part_poses(job->m, p, job->options, POSES, M, &n));
    for (size_t k = 0; k < n; k++) APSM_TRY(try_pose(job->m, p, M[k], r, w));
    job->pose_evidence = evidence_of(job->m, p, r);
    return part_refine(job->m, p, LAST_ROUNDS, first_reach / 2, &r->best, w);
}

/* ---- what is seen ---- */

/* Where the surface, in the world, shows a particle. */
typedef struct sight {
    const apsm_mesh *mesh; /* NULL: a cloud */
    const apsm_bvh *bvh;
    const apsm_topology *topology;
    const part_points *points;
    const double *x; /* points in the world */
    double spacing;  /* of a cloud's points */
} sight;

static bool is_border(const apsm_topology *t, const apsm_closest *c)
{
    for (size_t e = 0; e < 3; e++) { /* edge e has no part of corner e + 2 */
        const bool on_edge = c->on.weight[(e + 2) % 3] == 0;
        if (on_edge && t->twin[3 * (size_t)c->on.face + e] == APSM_NONE) return true;
    }
    return false;
}

static bool sees_on_mesh(const sight *v, double h, const double p[3], double y[3])
{
    apsm_closest c;
    apsm_bvh_closest(v->bvh, p, INFINITY, &c);
    memcpy(y, c.x, sizeof c.x);
    const double most = is_border(v->topology, &c) ? at_border : seen_reach;
    return c.distance2 < most * most * h * h;
}

static bool sees_in_cloud(const sight *v, double h, const double p[3], double y[3])
{
    size_t best = 0;
    double least = INFINITY;
    for (size_t k = 0; k < v->points->n; k++) {
        const double d2 = vec3_distance2(v->x + 3 * k, p);
        if (d2 < least) least = d2, best = k;
    }
    const double most = fmax(0.5 * h, v->spacing);
    memcpy(y, p, 3 * sizeof *y); /* between points the model knows better */
    if (sqrt(least) < 0.1 * h) memcpy(y, v->x + 3 * best, 3 * sizeof *y);
    return least < most * most;
}

static apsm_status open_sight(const fit_job *job, const part_points *p, const double M[16],
                              apsm_mesh *mesh, apsm_topology *t, apsm_bvh **bvh, sight *v)
{
    *v = (sight){ .points = p };
    if (!job->mesh) return APSM_OK;
    APSM_TRY(apsm_mesh_copy(job->mesh, mesh));
    apsm_mesh_transform(mesh, M);
    v->mesh = mesh;
    APSM_TRY(apsm_topology_build(mesh, t));
    v->topology = t;
    APSM_TRY(apsm_bvh_build_unsigned(mesh, bvh));
    v->bvh = *bvh;
    return APSM_OK;
}

/* ---- the posterior given what is seen ---- */

/* Between the shares for which it is known; at 0 it is 1. */
static double band_at(const fit_calibration *c, double missing)
{
    double x0 = 0, y0 = 1;
    for (size_t k = 0; k < FIT_BANDS; k++) {
        const double x1 = fit_band_missing[k], y1 = c->band[k];
        if (missing <= x1) return y0 + (y1 - y0) * (missing - x0) / (x1 - x0);
        x0 = x1;
        y0 = y1;
    }
    return y0;
}

static void set_deviations(const fit_job *job, const double *normal, const double *block)
{
    apsm_fit *out = job->out;
    const double band =
        fit_band_slip * fmax(band_at(&job->m->calibration, 1 - out->observed_share), 1);
    for (size_t j = 0; j < out->J; j++)
        fit_set_deviation(out, j, block + 9 * j, normal + 3 * j, out->observed[j] ? 1 : band);
}

/* Mean of all particles given that y is on the surface where error is finite; normals as at P, near
 * which the pose moves.  The rigid part of it goes to the pose M. */
static apsm_status condition(fit_job *job, const double *P, const double *normal, const double *y,
                             const double *error, double M[16])
{
    const apsm_fit_model *m = job->m;
    const size_t D = m->posterior.D, K = m->posterior.M + FIT_RIGID;
    const posterior_model most = { .D = D, .M = K };
    double *b =
        malloc((K + K * K + 3 * D + fit_rigid_size(&most) + posterior_particles_work_size(&most)) *
               sizeof *b);
    if (!b) return APSM_ERR_MEMORY;
    double *B = b + K, *block = B + K * K, *store = block + 3 * D;
    posterior_scores s = { .b = b, .B = B };
    const posterior_model q = fit_rigid_add(&m->posterior, P, m->radius, store);
    apsm_status status = posterior_along_normals(&q, normal, y, error, &s, job->out->world, block,
                                                 store + fit_rigid_size(&most));
    if (status == APSM_OK) {
        double R[16], back[16], centre[3];
        set_deviations(job, normal, block);
        fit_centre(D, P, centre);
        fit_rigid_motion(centre, m->radius, b, R);
        status = apsm_affine_invert(R, back);
        if (status == APSM_OK) {
            apsm_affine_apply(back, D / 3, job->out->world, job->out->world);
            apsm_affine_multiply(back, M, M);
        }
    }
    free(b);
    return status;
}

/* Distances of the given points from the fit, those that are believed. */
static void measure_points(const fit_job *job, const part_points *p, const part_state *s,
                           part_work *w)
{
    double sum = 0, most = 0;
    size_t n = 0;
    (void)s;
    for (size_t k = 0; k < p->n; k++) {
        if (!(w->w[k] > 0)) continue;
        sum += fabs(w->e[k]);
        most = fmax(most, fabs(w->e[k]));
        n++;
    }
    job->out->has_distance = n > 0;
    job->out->distance.two_way.mean = n > 0 ? sum / (double)n : 0;
    job->out->distance.two_way.max = most;
    job->out->distance.two_way.p95 = most;
}

static apsm_status look_and_condition(fit_job *job, const sight *v, part_state *s, part_work *w)
{
    const apsm_fit_model *m = job->m;
    const size_t J = m->model.J;
    double *y = malloc(7 * J * sizeof *y);
    size_t seen = 0;
    if (!y) return APSM_ERR_MEMORY;
    double *normal = y + 3 * J, *error = normal + 3 * J;
    for (size_t j = 0; j < J; j++) {
        const double *p = w->P + 3 * j;
        job->out->observed[j] =
            v->mesh ? sees_on_mesh(v, m->h, p, y + 3 * j) : sees_in_cloud(v, m->h, p, y + 3 * j);
        error[j] = job->out->observed[j] ? fit_part_error * m->h * m->h : INFINITY;
        apsm_surface_normal(&w->warped, w->normal, &m->S[j], normal + 3 * j);
        seen += job->out->observed[j];
    }
    job->out->observed_share = (double)seen / (double)J;
    const apsm_status status = condition(job, w->P, normal, y, error, s->M);
    free(y);
    return status;
}

static apsm_status finish(fit_job *job, const part_points *p, part_state *s, part_work *w)
{
    apsm_mesh mesh = { 0 };
    apsm_topology t = { 0 };
    apsm_bvh *bvh = NULL;
    sight v;
    apsm_status status = open_sight(job, p, s->M, &mesh, &t, &bvh, &v);
    v.x = w->x;
    v.spacing = job->mesh ? 0 : 2 * vec3_mean_spacing(p->n, w->x);
    measure_points(job, p, s, w);
    job->out->counted_share = s->counted;
    if (status == APSM_OK) status = look_and_condition(job, &v, s, w);
    memcpy(job->pose.M, s->M, sizeof job->pose.M);
    job->pose.mirrored = apsm_affine_det(s->M) < 0;
    apsm_bvh_free(bvh);
    apsm_topology_free(&t);
    apsm_mesh_free(&mesh);
    return status;
}

apsm_status fit_part_particles(apsm_context *ctx, fit_job *job, const part_points *p)
{
    (void)ctx;
    const size_t M = job->m->posterior.M;
    part_work w;
    double *b = malloc(2 * M * sizeof *b);
    race r = { .best = { .b = b }, .trial = { .b = b + M } };
    apsm_status status = part_work_alloc(job->m, p->n, &w);
    if (!b) status = APSM_ERR_MEMORY;
    if (status == APSM_OK) status = find_state(job, p, &r, &w);
    if (status == APSM_OK) status = finish(job, p, &r.best, &w);
    part_work_free(&w);
    free(b);
    return status;
}
