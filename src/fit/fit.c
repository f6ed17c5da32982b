/* A new shape meets the model: apsm/fit.h. */
#include "apsm/fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"
#include "core/sized.h"
#include "evaluate/surface_distance.h"
#include "fit/landmarks.h"
#include "fit/part.h"
#include "fit/tail.h"
#include "geometry/affine.h"
#include "geometry/topology.h"
#include "geometry/vec3.h"
#include "groom/groom.h"
#include "optimize/fidelity_shape.h"

static void free_fit(apsm_fit *fit)
{
    free(fit->local);
    free(fit->world);
    free(fit->original);
    free(fit->score);
    free(fit->variance);
    free(fit->sd);
    free(fit->sd_normal);
    free(fit->observed);
    free(fit->mesh_sd);
    free(fit->mesh_observed);
    apsm_mesh_free(&fit->mesh);
    apsm_mesh_free(&fit->cropped);
    *fit = (apsm_fit){ 0 };
}

void apsm_fit_free_sized(apsm_fit *fit, size_t size)
{
    apsm_fit known = { 0 };
    if (!apsm_take_sized(fit, size, &known, sizeof known)) return;
    free_fit(&known);
    memset(fit, 0, size);
}

apsm_status fit_alloc(const apsm_fit_model *m, apsm_fit *out)
{
    const size_t J = m->model.J, D = 3 * J, K = m->model.modes;
    const apsm_mesh *mesh = &m->cohort.shape[0].mesh;
    out->J = J;
    out->modes = K;
    out->h = m->h;
    out->local = malloc(D * sizeof *out->local);
    out->world = malloc(D * sizeof *out->world);
    out->original = malloc(D * sizeof *out->original);
    out->score = malloc(K * sizeof *out->score);
    out->variance = malloc(K * sizeof *out->variance);
    out->sd = malloc(J * sizeof *out->sd);
    out->sd_normal = malloc(J * sizeof *out->sd_normal);
    out->observed = malloc(J * sizeof *out->observed);
    out->mesh_sd = malloc(mesh->nv * sizeof *out->mesh_sd);
    out->mesh_observed = malloc(mesh->nv * sizeof *out->mesh_observed);
    const bool ok = out->local && out->world && out->original && out->score && out->variance &&
                    out->sd_normal && out->sd && out->observed && out->mesh_sd &&
                    out->mesh_observed;
    if (!ok) return APSM_ERR_MEMORY;
    memcpy(out->variance, m->model.variance, K * sizeof *out->variance);
    return apsm_mesh_copy(mesh, &out->mesh);
}

/* ---- what follows from the particles ---- */

void fit_set_deviation(apsm_fit *out, size_t j, const double block[9], const double n[3],
                       double factor)
{
    double along = 0;
    for (size_t a = 0; a < 9; a++) along += n[a / 3] * block[a] * n[a % 3];
    out->sd[j] = factor * sqrt((block[0] + block[4] + block[8]) / 3);
    out->sd_normal[j] = factor * sqrt(fmax(along, 0));
}

/* Vertices take their deviation and flag from the particles that move them. */
static void carry_to_vertices(const apsm_warp *warp, apsm_fit *out)
{
    for (size_t v = 0; v < warp->nv; v++) {
        double sum = 0, all = 0, seen = 0;
        for (size_t j = 0; j < warp->J; j++) {
            const double w = fabs(warp->W[v * warp->J + j]);
            all += w;
            sum += w * out->sd_normal[j];
            seen += out->observed[j] ? w : 0;
        }
        out->mesh_sd[v] = sum / all;
        out->mesh_observed[v] = 2 * seen > all;
    }
}

static apsm_status find_reflection(const fit_job *job, double R[16])
{
    apsm_mesh copy;
    apsm_affine_identity(R);
    if (!job->pose.mirrored || !job->mesh) return APSM_OK;
    APSM_TRY(apsm_mesh_copy(job->mesh, &copy));
    apsm_reflect(&copy, R);
    apsm_mesh_free(&copy);
    return APSM_OK;
}

apsm_status fit_frames(fit_job *job)
{
    apsm_fit *out = job->out;
    double back[16];
    memcpy(out->M, job->pose.M, sizeof out->M);
    out->mirrored = job->pose.mirrored;
    APSM_TRY(find_reflection(job, out->reflection));
    APSM_TRY(apsm_affine_invert(out->M, back));
    apsm_affine_apply(back, out->J, out->world, out->original);
    apsm_affine_apply(out->reflection, out->J, out->original, out->local);
    apsm_warp_apply(&job->m->fidelity->warp, out->world, out->mesh.V);
    carry_to_vertices(&job->m->fidelity->warp, out);
    return APSM_OK;
}

apsm_status fit_scores(fit_job *job)
{
    const apsm_shape_model *s = &job->m->model;
    const fit_calibration *c = &job->m->calibration;
    apsm_fit *out = job->out;
    const size_t m = (size_t)c->modes, D = 3 * s->J;
    double *x = malloc(D * sizeof *x), d2 = 0, miss = 0;
    if (!x) return APSM_ERR_MEMORY;
    apsm_shape_model_scores(s, out->world, out->score);
    apsm_shape_model_synthesize(s, m, out->score, x);
    for (size_t k = 0; k < m; k++) d2 += out->score[k] * out->score[k] / s->variance[k];
    for (size_t d = 0; d < D; d++) miss += (out->world[d] - x[d]) * (out->world[d] - x[d]);
    free(x);
    out->mahalanobis = m > 0 ? sqrt(d2) : NAN;
    out->mahalanobis_modes = m;
    out->tail = m > 0 ? fit_tail_mahalanobis(d2 / c->mahalanobis, (double)s->I, (double)m) : NAN;
    out->residual = sqrt(miss / (double)(D - m));
    out->residual_usual = c->residual * job->m->h;
    return APSM_OK;
}

/* ---- whole surfaces ---- */

/* Particles on the rims of a model of open surfaces have no place on a closed one. */
static apsm_status judge_opening(const fit_job *job)
{
    bool open;
    if (job->m->cohort.shape[0].rim.n == 0) return APSM_OK;
    APSM_TRY(apsm_mesh_find_open(job->mesh, &open));
    if (!open)
        fit_object(
            job->out, APSM_FIT_REFUSED,
            "is a closed surface, and the model's shapes are open ones: cut it as they were");
    return APSM_OK;
}

static apsm_status place(apsm_context *ctx, fit_job *job)
{
    apsm_bvh *bvh = NULL;
    apsm_status status = APSM_OK;
    if (fit_pose_searches(job->m, job->options)) status = apsm_bvh_build_unsigned(job->mesh, &bvh);
    if (status == APSM_OK) status = fit_pose_find(job->m, job->mesh, bvh, job->options, &job->pose);
    apsm_bvh_free(bvh);
    APSM_TRY(status);
    APSM_TRY(fit_crop(ctx, job, job->mesh));
    apsm_fit *out = job->out;
    out->pose_residual = job->pose.residual;
    out->runner_up = job->pose.runner_up;
    out->mirror_ratio = job->pose.mirror_ratio;
    out->mirrored = job->pose.mirrored;
    memcpy(out->M, job->pose.M, sizeof out->M);
    apsm_affine_identity(out->reflection);
    APSM_TRY(judge_opening(job));
    fit_judge_pose(job);
    return APSM_OK;
}

static bool is_refused(const fit_job *job)
{
    return job->out->verdict == APSM_FIT_REFUSED && !job->options->force;
}

static apsm_status finish_whole(apsm_context *ctx, fit_job *job)
{
    apsm_fit *out = job->out;
    APSM_TRY(fit_whole_particles(ctx, job));
    APSM_TRY(fit_whole_deviations(job));
    APSM_TRY(fit_frames(job));
    APSM_TRY(fit_scores(job));
    APSM_TRY(apsm_surface_distance_between(ctx, &job->shape.mesh, job->shape.bvh, &out->mesh, NULL,
                                           &out->distance));
    out->has_distance = true;
    fit_judge(job);
    return APSM_OK;
}

static apsm_status fit_whole(apsm_context *ctx, fit_job *job)
{
    const char *const names[] = { job->name };
    apsm_cohort one = { 0 };
    APSM_TRY(place(ctx, job));
    if (is_refused(job)) return APSM_OK;
    const apsm_cohort_input in = {
        .I = 1, .names = names, .meshes = job->mesh, .transforms = job->pose.M
    };
    APSM_TRY(apsm_cohort_build(ctx, &in, 0, 0, &one));
    job->shape = one.shape[0];
    const apsm_status status = finish_whole(ctx, job);
    apsm_cohort_free(&one);
    return status;
}

/* ---- parts of surfaces, and points ---- */

static apsm_status fit_points(apsm_context *ctx, fit_job *job, const part_points *p)
{
    apsm_fit *out = job->out;
    out->partial = true;
    APSM_TRY(fit_part_particles(ctx, job, p));
    APSM_TRY(fit_frames(job));
    APSM_TRY(fit_scores(job));
    fit_judge_part(job);
    return APSM_OK;
}

static apsm_status fit_part(apsm_context *ctx, fit_job *job)
{
    part_points p;
    APSM_TRY(part_points_of_mesh(job->mesh, &p));
    const apsm_status status = fit_points(ctx, job, &p);
    part_points_free(&p);
    return status;
}

/* Whether it has openings where the model's shapes have none.  Of a model of open surfaces an open
 * one is whole unless the caller says otherwise. */
static apsm_status find_part(const fit_job *job, bool *part)
{
    *part = job->options->extent == APSM_EXTENT_PART;
    if (job->options->extent != APSM_EXTENT_AUTO || job->m->cohort.shape[0].rim.n > 0)
        return APSM_OK;
    return apsm_mesh_find_open(job->mesh, part);
}

/* What a user can try where a model of open surfaces refuses an open one, taken for whole. */
static apsm_status say_what_helps(const fit_job *job)
{
    bool open;
    apsm_fit *out = job->out;
    const size_t used = strlen(out->reason);
    if (out->verdict != APSM_FIT_REFUSED || job->m->cohort.shape[0].rim.n == 0) return APSM_OK;
    APSM_TRY(apsm_mesh_find_open(job->mesh, &open));
    if (open)
        apsm_print(out->reason + used, APSM_FIT_REASON - used, " (of a part say --extent part)");
    return APSM_OK;
}

static apsm_status fit_surface(apsm_context *ctx, fit_job *job)
{
    bool part;
    APSM_TRY(fit_alloc(job->m, job->out));
    APSM_TRY(find_part(job, &part));
    if (part) return fit_part(ctx, job);
    APSM_TRY(fit_whole(ctx, job));
    return say_what_helps(job);
}

/* ---- the door ---- */

static apsm_status refuse_null(apsm_context *ctx, const char *function)
{
    return apsm_fail(ctx, APSM_ERR_ARG, "%s: an argument is NULL", function);
}

static apsm_status check_mesh(apsm_context *ctx, const char *name, const apsm_mesh *mesh)
{
    if (mesh->nv < 4 || mesh->nf < 4)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY, "%s: a surface of %zu faces cannot be fitted",
                         name, mesh->nf);
    for (size_t k = 0; k < 3 * mesh->nv; k++)
        if (!isfinite(mesh->V[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE, "%s: vertex %zu is not finite", name, k / 3);
    for (size_t k = 0; k < 3 * mesh->nf; k++)
        if (mesh->F[k] >= mesh->nv)
            return apsm_fail(ctx, APSM_ERR_GEOMETRY, "%s: face %zu has a vertex that is not there",
                             name, k / 3);
    const double area = apsm_mesh_area(mesh); /* also of vertices so far that it is not finite */
    if (!(area > 0 && area < INFINITY))
        return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                         "%s: has no area that can be fitted (%g); is it a surface?", name, area);
    return APSM_OK;
}

/* Far below or above the model's shapes everything is equally far from everything, and a search
 * takes for ever: no unit is so far from another. */
static apsm_status check_size(apsm_context *ctx, const char *name, const apsm_fit_model *m,
                              const apsm_mesh *mesh)
{
    static const double most = 1e4;
    const apsm_mesh *const both[2] = { &m->cohort.shape[0].mesh, mesh };
    double lo[3], hi[3], size[2];
    for (int k = 0; k < 2; k++) {
        apsm_mesh_bounds(both[k], lo, hi);
        size[k] = sqrt(vec3_distance2(lo, hi));
    }
    if (size[1] < most * size[0] && most * size[1] > size[0]) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                     "%s: is %.3g times as large as the model's mean; is it another unit, or "
                     "damaged?",
                     name, size[1] / size[0]);
}

static apsm_status check_start(apsm_context *ctx, const char *name, const apsm_fit_options *o)
{
    double back[16];
    if (!o->start) return APSM_OK;
    for (size_t k = 0; k < 16; k++)
        if (!isfinite(o->start[k]))
            return apsm_fail(ctx, APSM_ERR_ARG, "%s: number %zu of start is not finite", name, k);
    if (apsm_affine_invert(o->start, back) != APSM_OK)
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: start is no pose: its map is singular", name);
    const int hand = apsm_affine_det(o->start) < 0 ? APSM_HAND_OTHER : APSM_HAND_SAME;
    if (o->hand != APSM_HAND_AUTO && o->hand != hand)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "%s: start and hand disagree: the one %s, the other does not; give one of "
                         "them",
                         name, hand == APSM_HAND_OTHER ? "mirrors" : "keeps the side");
    return APSM_OK;
}

/* What a stranger would get is not handed out. */
static void withhold(apsm_fit *fit)
{
    fit->J = 0;
    apsm_mesh_free(&fit->mesh);
    apsm_mesh_free(&fit->cropped);
}

static apsm_status close_job(apsm_context *ctx, fit_job *job, apsm_status status)
{
    if (status == APSM_OK && is_refused(job)) withhold(job->out);
    if (status == APSM_OK && job->options->force && job->out->verdict == APSM_FIT_REFUSED)
        job->out->verdict = APSM_FIT_REVIEW;
    if (status == APSM_OK) return status;
    apsm_fit_free(job->out);
    const char *line = apsm_error_text(ctx);
    return *line ? status : apsm_fail(ctx, status, "%s: %s", job->name, apsm_status_text(status));
}

/* A call, with options and result as we know them. */
typedef struct opened {
    apsm_fit_options options;
    apsm_fit fit;
    fit_job job;
} opened;

/* The caller's result is an empty one until the call is closed. */
static apsm_status open_call(apsm_context *ctx, const char *door, const apsm_fit_model *model,
                             const char *name, const apsm_fit_call *call, opened *o)
{
    *o = (opened){ .fit = { .runner_up = INFINITY, .mirror_ratio = INFINITY } };
    if (!model || !name || !call || !call->fit || !call->options) return refuse_null(ctx, door);
    apsm_give_sized(&o->fit, sizeof o->fit, call->fit, call->fit_size);
    o->job = (fit_job){ .m = model, .name = name, .options = &o->options, .out = &o->fit };
    return apsm_take_settings(ctx, door, call->options, call->options_size, &o->options,
                              sizeof o->options);
}

static apsm_status close_call(apsm_context *ctx, const apsm_fit_call *call, opened *o,
                              apsm_status status)
{
    status = close_job(ctx, &o->job, status);
    apsm_give_sized(&o->fit, sizeof o->fit, call->fit, call->fit_size);
    return status;
}

apsm_status apsm_fit_surface_sized(apsm_context *ctx, const apsm_fit_model *model, const char *name,
                                   const apsm_mesh *mesh, const apsm_fit_call *call)
{
    opened o;
    if (!mesh || !mesh->V || !mesh->F) return refuse_null(ctx, "apsm_fit_surface");
    APSM_TRY(open_call(ctx, "apsm_fit_surface", model, name, call, &o));
    APSM_TRY(check_start(ctx, name, &o.options));
    APSM_TRY(check_mesh(ctx, name, mesh));
    APSM_TRY(check_size(ctx, name, model, mesh));
    o.job.mesh = mesh;
    return close_call(ctx, call, &o, fit_surface(ctx, &o.job));
}

apsm_status apsm_fit_points_sized(apsm_context *ctx, const apsm_fit_model *model, const char *name,
                                  size_t n, const double *x, const apsm_fit_call *call)
{
    enum { least_points = 10 };
    opened o;
    part_points p = { 0 };
    if (!x) return refuse_null(ctx, "apsm_fit_points");
    APSM_TRY(open_call(ctx, "apsm_fit_points", model, name, call, &o));
    if (n < least_points)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY, "%s: %zu points are too few; %d at least", name, n,
                         least_points);
    for (size_t k = 0; k < 3 * n; k++)
        if (!isfinite(x[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE, "%s: point %zu is not finite", name, k / 3);
    apsm_status status = fit_alloc(model, &o.fit);
    if (status == APSM_OK) status = part_points_of_cloud(n, x, &p);
    if (status == APSM_OK && p.n < least_points)
        status = apsm_fail(ctx, APSM_ERR_GEOMETRY,
                           "%s: only %zu of %zu points are different; %d at "
                           "least",
                           name, p.n, n, least_points);
    if (status == APSM_OK) status = fit_points(ctx, &o.job, &p);
    part_points_free(&p);
    return close_call(ctx, call, &o, status);
}

static apsm_status check_landmarks(apsm_context *ctx, const char *name,
                                   const fit_landmark_set *given)
{
    enum { MOST = 1000 };
    const size_t n = given->n;
    if (n < 3 || n > MOST)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                         "%s: %zu landmarks; 3 at least, and beyond %d they are a cloud", name, n,
                         MOST);
    for (size_t k = 0; k < 3 * n; k++)
        if (!isfinite(given->x[k]) || !isfinite(given->at[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE, "%s: landmark %zu is not finite", name,
                             k / 3);
    return APSM_OK;
}

apsm_status fit_named_landmarks(apsm_context *ctx, const apsm_fit_model *model, const char *name,
                                const fit_landmark_set *given, const apsm_fit_call *call)
{
    opened o;
    APSM_TRY(open_call(ctx, "apsm_fit_landmarks", model, name, call, &o));
    APSM_TRY(check_landmarks(ctx, name, given));
    o.fit.partial = true;
    apsm_status status = fit_alloc(model, &o.fit);
    if (status == APSM_OK)
        status = fit_landmark_particles(ctx, &o.job, given->n, given->at, given->x);
    if (status == APSM_OK) status = fit_frames(&o.job);
    if (status == APSM_OK) status = fit_scores(&o.job);
    if (status == APSM_OK) {
        o.fit.pose_residual = o.job.pose.residual;
        o.fit.mirror_ratio = o.job.pose.mirror_ratio;
        o.job.landmark.name = given->name;
        fit_judge_landmarks(&o.job);
    }
    return close_call(ctx, call, &o, status);
}

apsm_status apsm_fit_landmarks_sized(apsm_context *ctx, const apsm_fit_model *model,
                                     const char *name, size_t n, const double *on_mean,
                                     const double *x, const apsm_fit_call *call)
{
    if (!on_mean || !x) return refuse_null(ctx, "apsm_fit_landmarks");
    return fit_named_landmarks(ctx, model, name, &(fit_landmark_set){ n, on_mean, x, NULL }, call);
}
