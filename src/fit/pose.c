/* As src/align/align.c does for the shapes of a cohort: search with size removed, on a sample;
 * where the cohort came in one orientation, the pose near that if it fits about as well; then
 * registration to rest on all vertices (13). */
#include "fit/pose.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/icp.h"
#include "geometry/affine.h"
#include "geometry/face.h"
#include "geometry/vec3.h"

enum { ROUGH_POINTS = 150, RESTING = 12 };
static const double rough = 1e-3, at_rest = 1e-4;

typedef struct search {
    const apsm_fit_model *m;
    const apsm_mesh *mesh;
    apsm_cloud cloud, dense;
    apsm_surface moving, fixed;
    double *work;
} search;

static apsm_icp_options icp_options(const apsm_fit_model *m)
{
    apsm_icp_options icp = apsm_icp_defaults();
    icp.scale = m->options.align.align == APSM_ALIGN_SIMILARITY;
    icp.points = ROUGH_POINTS;
    icp.tolerance = rough;
    return icp;
}

apsm_status fit_pose_vertices(const apsm_mesh *mesh, const apsm_cloud *sample, apsm_cloud *half)
{
    APSM_TRY(apsm_cloud_of_vertices(mesh, sample, half));
    half->n = (half->n + 1) / 2;
    for (size_t k = 0; k < half->n; k++) {
        memmove(half->x + 3 * k, half->x + 6 * k, 3 * sizeof *half->x);
        half->w[k] = half->w[2 * k];
    }
    return APSM_OK;
}

static apsm_status open_search(const apsm_fit_model *m, const apsm_mesh *mesh, const apsm_bvh *bvh,
                               search *s)
{
    *s = (search){ .m = m, .mesh = mesh };
    APSM_TRY(apsm_cloud_sample(mesh, apsm_align_defaults().points, 0, 0, &s->cloud));
    apsm_cloud_find_cuts(mesh, &s->cloud);
    APSM_TRY(fit_pose_vertices(mesh, &s->cloud, &s->dense));
    const size_t n[] = { s->dense.n, m->dense.n, s->cloud.n, m->cloud.n };
    size_t most = 0; /* a small mesh has fewer vertices than points are drawn on it */
    for (size_t k = 0; k < sizeof n / sizeof *n; k++) most = n[k] > most ? n[k] : most;
    s->work = malloc(apsm_icp_work_size(most) * sizeof *s->work);
    s->moving = (apsm_surface){ bvh, &s->cloud };
    s->fixed = (apsm_surface){ m->cohort.shape[0].bvh, &m->cloud };
    return s->work ? APSM_OK : APSM_ERR_MEMORY;
}

static void close_search(search *s)
{
    apsm_cloud_free(&s->cloud);
    apsm_cloud_free(&s->dense);
    free(s->work);
}

/* U (9, out): the rotation that the cohort's shapes have in common, of those of the other hand
 * after the reflection that turns them to the model's side (x negated, as grooming does). */
static void usual_rotation(const apsm_fit_model *m, bool mirrored, double U[9])
{
    for (size_t k = 0; k < 9; k++) U[k] = mirrored && k % 3 == 0 ? -m->common[k] : m->common[k];
}

/* Whether the rotation in M is within 60 degrees of U. */
static bool hardly_turns(const double U[9], const double M[16])
{
    double trace = 0;
    for (size_t k = 0; k < 9; k++) trace += U[k] * M[4 * (k / 3) + k % 3];
    return trace / vec3_norm(M) > 2;
}

/* Size is removed, unless it would make up for what was cut off. */
static apsm_icp_options search_options(const search *s)
{
    apsm_icp_options icp = icp_options(s->m);
    icp.scale |= s->cloud.cuts + s->m->cloud.cuts == 0;
    return icp;
}

/* The best pose of one hand. */
static void search_hand(search *s, bool mirrored, apsm_pose *best)
{
    double U[9];
    apsm_icp_options icp = search_options(s);
    usual_rotation(s->m, mirrored, U);
    apsm_pose_search(&s->moving, &s->fixed, mirrored, &icp, best, s->work);
    if (!(s->m->oriented > 0) || hardly_turns(U, best->M)) return;
    apsm_pose given;
    icp.usual = U;
    apsm_pose_from(&s->moving, &s->fixed, U, &icp, &given, s->work);
    if (!hardly_turns(U, given.M) || given.residual > APSM_GIVEN_RATIO * best->residual) return;
    given.runner_up = fmin(best->residual, best->runner_up);
    *best = given;
}

static double ratio(double a, double b)
{
    return b > 0 ? a / b : INFINITY;
}

/* Both hands unless it was told, or the one fits as shapes of the cohort do: the other hand would
 * have to fit better by a quarter. */
static void search_hands(search *s, const apsm_fit_options *o, fit_pose *out)
{
    apsm_pose same = { .residual = INFINITY }, other = same;
    if (o->hand != APSM_HAND_OTHER) search_hand(s, false, &same);
    const bool clear = same.residual < s->m->calibration.pose * s->fixed.cloud->radius;
    if (o->hand == APSM_HAND_OTHER || (o->hand == APSM_HAND_AUTO && !clear))
        search_hand(s, true, &other);
    out->mirrored =
        o->hand == APSM_HAND_OTHER ||
        (o->hand == APSM_HAND_AUTO && other.residual < APSM_MIRROR_RATIO * same.residual);
    const apsm_pose *best = out->mirrored ? &other : &same;
    memcpy(out->M, best->M, sizeof out->M);
    out->usual = s->m->oriented > 0 && !out->mirrored && hardly_turns(s->m->common, out->M);
    out->residual = best->residual / s->fixed.cloud->radius;
    out->runner_up = fmax(1, ratio(best->runner_up, best->residual));
    out->mirror_ratio = o->hand == APSM_HAND_AUTO
                            ? ratio(out->mirrored ? same.residual : other.residual, best->residual)
                            : INFINITY;
}

/* (13): as a shape of the cohort, and so with the same result. */
static void register_to_rest(search *s, fit_pose *out)
{
    apsm_icp_options icp = icp_options(s->m);
    double residual, U[9];
    usual_rotation(s->m, out->mirrored, U);
    if (s->m->oriented > 0 && hardly_turns(U, out->M)) icp.usual = U;
    if (!icp.scale) apsm_affine_remove_scale(s->cloud.centre, out->M);
    apsm_icp(&s->moving, &s->fixed, &icp, out->M, &residual, s->work);
    icp.points = 0;
    icp.tolerance = at_rest;
    if (icp.max_iterations > RESTING) icp.max_iterations = RESTING;
    apsm_icp_to_rest(1, &(apsm_surface){ s->moving.bvh, &s->dense },
                     &(apsm_surface){ s->fixed.bvh, &s->m->dense }, &icp, out->M, &residual,
                     s->work);
}

/* The pose that is given, brought to rest. */
static void start_from(search *s, const double start[16], fit_pose *out)
{
    const apsm_icp_options icp = search_options(s);
    double residual;
    memcpy(out->M, start, sizeof out->M);
    apsm_icp(&s->moving, &s->fixed, &icp, out->M, &residual, s->work);
    out->mirrored = apsm_affine_det(out->M) < 0;
    out->residual = residual / s->fixed.cloud->radius;
}

/* Integrals over a face of |x - c|^2 and of x - c, over its area. */
static double face_moments(const apsm_mesh *mesh, size_t f, const double c[3], double mean[3])
{
    double squares = 0;
    memset(mean, 0, 3 * sizeof *mean);
    for (size_t v = 0; v < 3; v++) {
        double x[3];
        vec3_sub(mesh->V + 3 * (size_t)mesh->F[3 * f + v], c, x);
        vec3_add_scaled(mean, 1.0 / 3, x);
        squares += vec3_dot(x, x);
    }
    return (9 * vec3_dot(mean, mean) + squares) / 12;
}

/* Root mean square distance of the surface from its centre. */
static double radius_of(const apsm_mesh *mesh)
{
    const double *first = mesh->V;
    double area = 0, sum = 0, centre[3] = { 0 }, mean[3];
    for (size_t f = 0; f < mesh->nf; f++) {
        const double A = face_area(mesh, f);
        area += A;
        sum += A * face_moments(mesh, f, first, mean);
        vec3_add_scaled(centre, A, mean);
    }
    return sqrt(fmax(sum / area - vec3_dot(centre, centre) / (area * area), 0));
}

bool fit_pose_searches(const apsm_fit_model *m, const apsm_fit_options *options)
{
    return !options->aligned && m->options.align.align != APSM_ALIGN_NONE;
}

apsm_status fit_pose_find(const apsm_fit_model *m, const apsm_mesh *mesh, const apsm_bvh *bvh,
                          const apsm_fit_options *options, fit_pose *pose)
{
    search s;
    *pose = (fit_pose){ .runner_up = INFINITY, .mirror_ratio = INFINITY };
    apsm_affine_identity(pose->M);
    if (!fit_pose_searches(m, options)) {
        pose->size = radius_of(mesh) / radius_of(&m->cohort.shape[0].mesh);
        return APSM_OK;
    }
    apsm_status status = open_search(m, mesh, bvh, &s);
    if (status == APSM_OK) {
        pose->size = s.cloud.radius / m->cloud.radius;
        if (options->start)
            start_from(&s, options->start, pose);
        else
            search_hands(&s, options, pose);
        register_to_rest(&s, pose);
    }
    close_search(&s);
    return status;
}

apsm_status fit_pose_mirror(const apsm_fit_model *m, double *residual)
{
    search s;
    apsm_bvh *bvh = NULL;
    const apsm_mesh *mesh = &m->cohort.shape[0].mesh;
    APSM_TRY(apsm_bvh_build_unsigned(mesh, &bvh));
    const apsm_status status = open_search(m, mesh, bvh, &s);
    if (status == APSM_OK) {
        apsm_pose pose;
        const apsm_icp_options icp = icp_options(m);
        apsm_pose_search(&s.moving, &s.fixed, true, &icp, &pose, s.work);
        *residual = pose.residual / s.fixed.cloud->radius;
    }
    close_search(&s);
    apsm_bvh_free(bvh);
    return status;
}

apsm_status fit_pose_sized(const apsm_fit_model *m, const apsm_mesh *mesh, const apsm_bvh *bvh,
                           const double M[16], double S[16])
{
    search s;
    double residual;
    memcpy(S, M, 16 * sizeof *S);
    const apsm_status status = open_search(m, mesh, bvh, &s);
    if (status == APSM_OK) {
        apsm_icp_options icp = icp_options(m);
        icp.scale = true;
        icp.points = 0;
        apsm_icp(&s.moving, &s.fixed, &icp, S, &residual, s.work);
    }
    close_search(&s);
    return status;
}

apsm_status fit_pose_residual(const apsm_fit_model *m, const apsm_mesh *mesh, double *residual)
{
    search s;
    apsm_bvh *bvh = NULL;
    double M[16];
    apsm_affine_identity(M);
    APSM_TRY(apsm_bvh_build_unsigned(mesh, &bvh));
    const apsm_status status = open_search(m, mesh, bvh, &s);
    if (status == APSM_OK) {
        apsm_icp_options icp = icp_options(m);
        icp.scale = true;
        apsm_icp(&s.moving, &s.fixed, &icp, M, residual, s.work);
        *residual /= s.fixed.cloud->radius;
    }
    close_search(&s);
    apsm_bvh_free(bvh);
    return status;
}
