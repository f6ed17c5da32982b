/* The model that shapes are fitted by: what is derived from its parts. */
#include "fit/fit_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/icp.h"
#include "fit/pose.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "optimize/fidelity_shape.h"

const double fit_placing = 0.1;
const double fit_part_error = 0.0025;
const double fit_band_slip = 1.1;
const double fit_band_missing[FIT_BANDS] = { 0.2, 0.5, 0.8, 1 };

void apsm_fit_model_free(apsm_fit_model *m)
{
    if (!m) return;
    apsm_fidelity_free(m->fidelity);
    apsm_fidelity_prior_free(&m->prior);
    apsm_registration_free(m->registration);
    apsm_cloud_free(&m->cloud);
    apsm_cloud_free(&m->dense);
    apsm_cohort_free(&m->cohort);
    apsm_shape_model_free(&m->model);
    free(m->T);
    free(m->TN);
    free(m->S);
    free(m->store);
    free(m->path);
    free(m->labels);
    free(m->unit);
    free(m);
}

size_t apsm_fit_model_particles(const apsm_fit_model *m)
{
    return m->model.J;
}

size_t apsm_fit_model_shapes(const apsm_fit_model *m)
{
    return m->model.I;
}

const apsm_options *apsm_fit_model_options(const apsm_fit_model *m)
{
    return &m->options;
}

const apsm_mesh *apsm_fit_model_mesh(const apsm_fit_model *m)
{
    return &m->cohort.shape[0].mesh;
}

apsm_groom_options fit_model_groom(const apsm_fit_model *m)
{
    apsm_groom_options groom = m->options.groom;
    groom.open |= m->cohort.shape[0].rim.n > 0;
    return groom;
}

void fit_model_particles(const apsm_shape_model *model, double *P)
{
    for (size_t i = 0; i < model->I; i++)
        apsm_shape_model_synthesize(model, model->modes, model->score + i * model->modes,
                                    P + i * model->J * 3);
}

apsm_status fit_model_take_mesh(apsm_context *ctx, apsm_mesh *mesh, apsm_fit_model *m)
{
    static const char *const name[] = { "template" };
    double M[16];
    apsm_affine_identity(M);
    const apsm_cohort_input in = { .I = 1, .names = name, .meshes = mesh, .transforms = M };
    const apsm_status status = apsm_cohort_build(ctx, &in, 0, 0, &m->cohort);
    apsm_mesh_free(mesh);
    return status;
}

/* ---- the posterior's model ---- */

size_t fit_smooth_columns(size_t J, const double *X, double reach, size_t most, double *column,
                          double *work)
{
    static const double enough = 1e-3; /* of the variance left at the worst point */
    double *left = work;
    size_t n = 0;
    for (size_t j = 0; j < J; j++) left[j] = 1;
    for (; n < most && n < J; n++) {
        size_t pivot = 0;
        for (size_t j = 1; j < J; j++)
            if (left[j] > left[pivot]) pivot = j;
        if (left[pivot] < enough) break;
        double *c = column + n * J;
        const double root = sqrt(left[pivot]);
        for (size_t j = 0; j < J; j++) {
            c[j] = exp(-vec3_distance2(X + 3 * j, X + 3 * pivot) / (2 * reach * reach));
            for (size_t k = 0; k < n; k++) c[j] -= column[k * J + j] * column[k * J + pivot];
            c[j] /= root;
        }
        for (size_t j = 0; j < J; j++) left[j] = fmax(left[j] - c[j] * c[j], 0);
    }
    return n;
}

size_t fit_posterior_size(size_t J, size_t modes)
{
    const size_t M = modes + 3 * FIT_SMOOTH;
    return 3 * J + M * 3 * J + M + FIT_SMOOTH * J + J;
}

posterior_model fit_posterior_make(const fit_modes *m, const fit_process *p, double *store)
{
    const size_t J = m->J, modes = m->modes, D = 3 * J, most = modes + 3 * FIT_SMOOTH;
    double *mu = store, *U = mu + D, *v = U + most * D, *column = v + most;
    memcpy(mu, m->mean, D * sizeof *mu);
    memcpy(U, m->mode, modes * D * sizeof *U);
    memcpy(v, m->variance, modes * sizeof *v);
    size_t M = modes;
    const size_t n = p->smooth > 0 ? fit_smooth_columns(J, m->mean, p->reach, FIT_SMOOTH, column,
                                                        column + FIT_SMOOTH * J)
                                   : 0;
    for (size_t k = 0; k < n; k++)
        for (size_t c = 0; c < 3; c++, M++) {
            memset(U + M * D, 0, D * sizeof *U);
            for (size_t j = 0; j < J; j++) U[M * D + 3 * j + c] = column[k * J + j];
            v[M] = p->smooth;
        }
    return (posterior_model){ D, M, mu, U, v, p->noise };
}

static apsm_status make_posterior(apsm_fit_model *m)
{
    const fit_calibration *c = &m->calibration;
    const double h2 = m->h * m->h;
    const size_t modes = (size_t)c->modes;
    m->store = malloc(fit_posterior_size(m->model.J, modes) * sizeof *m->store);
    if (!m->store) return APSM_ERR_MEMORY;
    const apsm_shape_model *s = &m->model;
    const fit_modes known = { s->J, modes, s->mean, s->mode, s->variance };
    const fit_process beside = { c->smooth * h2, c->reach * m->h, c->noise * h2 };
    m->posterior = fit_posterior_make(&known, &beside, m->store);
    return APSM_OK;
}

/* ---- the prior of (12) ---- */

/* As the cohort's, from all shapes: mean, modes, one variance for the rest of the spectrum. */
static apsm_status make_prior(apsm_fit_model *m)
{
    const apsm_shape_model *s = &m->model;
    const size_t D = 3 * s->J, modes = (size_t)m->calibration.modes;
    apsm_fidelity_prior *p = &m->prior;
    *p = (apsm_fidelity_prior){ .I = s->I, .J = s->J, .modes = modes, .folds = 1 };
    p->noise = malloc(sizeof *p->noise);
    p->mean = malloc(D * sizeof *p->mean);
    p->mode = malloc((modes * D + 1) * sizeof *p->mode);
    p->weight = malloc((modes + 1) * sizeof *p->weight);
    if (!p->noise || !p->mean || !p->mode || !p->weight) return APSM_ERR_MEMORY;
    double rest = 0;
    for (size_t k = modes; k < s->modes; k++) rest += s->variance[k];
    *p->noise = rest / (double)(D - modes) / (m->h * m->h);
    for (size_t d = 0; d < D; d++) p->mean[d] = s->mean[d] / m->h;
    memcpy(p->mode, s->mode, modes * D * sizeof *p->mode);
    for (size_t k = 0; k < modes; k++)
        p->weight[k] = 1 - sqrt(*p->noise / (s->variance[k] / (m->h * m->h)));
    return APSM_OK;
}

/* ---- the template ---- */

/* A finished model has a larger say in one shape's fit than unfinished ones had in the cohort's. */
static apsm_status make_fidelity(apsm_context *ctx, apsm_fit_model *m)
{
    static const double fit_prior = 200, fit_stay = 0.01;
    apsm_fidelity_options o = m->options.optimize.fidelity;
    if (!(o.fidelity > 0)) o.fidelity = apsm_fidelity_defaults().fidelity;
    o.prior = fit_prior;
    o.stay = fit_stay;
    o.recall = 0;
    APSM_TRY(apsm_fidelity_new(ctx, &m->cohort, m->model.J, m->T, &o, &m->fidelity));
    m->h = apsm_fidelity_spacing(m->fidelity);
    return APSM_OK;
}

static apsm_status make_normals(apsm_fit_model *m)
{
    m->S = malloc(m->model.J * sizeof *m->S);
    m->TN = malloc(3 * m->model.J * sizeof *m->TN);
    if (!m->S || !m->TN) return APSM_ERR_MEMORY;
    apsm_shape_look_up(&m->cohort.shape[0], m->model.J, m->T, m->S, NULL, m->TN);
    return APSM_OK;
}

/* What poses and registrations are found with; no seed matters. */
static apsm_status make_clouds(apsm_fit_model *m)
{
    const apsm_mesh *mesh = &m->cohort.shape[0].mesh;
    apsm_cloud spread;
    APSM_TRY(apsm_cloud_sample(mesh, apsm_align_defaults().points, 0, 0, &m->cloud));
    apsm_cloud_find_cuts(mesh, &m->cloud);
    APSM_TRY(fit_pose_vertices(mesh, &m->cloud, &m->dense));
    APSM_TRY(apsm_cloud_spread(mesh, APSM_REGISTRATION_POINTS, &spread));
    const apsm_status status = apsm_registration_new(&spread, &m->registration);
    apsm_cloud_free(&spread);
    return status;
}

static double radius_of(size_t J, const double *P)
{
    double c[3] = { 0 }, sum = 0;
    for (size_t j = 0; j < J; j++) vec3_add_scaled(c, 1 / (double)J, P + 3 * j);
    for (size_t j = 0; j < J; j++) sum += vec3_distance2(P + 3 * j, c);
    return sqrt(sum / (double)J);
}

/* Sizes of the shapes relative to the mean's. */
static void measure_sizes(size_t I, size_t J, const double *P, double radius, fit_calibration *c)
{
    c->size_least = c->size_most = 1;
    for (size_t i = 0; i < I; i++) {
        const double r = radius_of(J, P + i * 3 * J) / radius;
        c->size_least = fmin(c->size_least, r);
        c->size_most = fmax(c->size_most, r);
    }
}

/* Mean pose residual of some of the shapes, as the warped template shows them. */
static apsm_status measure_poses(const double *P, apsm_fit_model *m)
{
    enum { SOME = 8 };
    const size_t I = m->model.I, n = I < SOME ? I : SOME;
    apsm_mesh mesh;
    APSM_TRY(apsm_mesh_copy(&m->cohort.shape[0].mesh, &mesh));
    apsm_status status = APSM_OK;
    m->calibration.pose = 0;
    for (size_t k = 0; k < n && status == APSM_OK; k++) {
        double residual = 0;
        apsm_warp_apply(&m->fidelity->warp, P + (k * I / n) * 3 * m->model.J, mesh.V);
        status = fit_pose_residual(m, &mesh, &residual);
        m->calibration.pose += residual / (double)n;
    }
    apsm_mesh_free(&mesh);
    return status;
}

static apsm_status calibrate(apsm_context *ctx, apsm_fit_model *m)
{
    const apsm_shape_model *s = &m->model;
    double *P = malloc(s->I * s->J * 3 * sizeof *P);
    if (!P) return APSM_ERR_MEMORY;
    fit_model_particles(s, P);
    m->calibration.distance /= m->h;
    m->calibration.distance_most /= m->h;
    measure_sizes(s->I, s->J, P, m->radius, &m->calibration);
    apsm_status status = measure_poses(P, m);
    if (status == APSM_OK) status = fit_calibrate(ctx, P, m);
    free(P);
    return status;
}

/* How much surfaces leave to the prior is, in a cohort, the square of their misfit when they alone
 * have decided over the particles' distance from what the model predicts
 * (apsm_fidelity_doubt).  One shape does not show it, the model does: its shapes' distances, which
 * are larger since the prior has had its say, over left-out shapes' misses.  A
 * sixth of that square keeps new shapes of synthetic kinds as near to the truth as those in the
 * cohort (femora 5 % farther, vertebrae 3 % nearer; a third: a fifth farther). */
static double doubt_of(const fit_calibration *c)
{
    static const double share = 1.0 / 6, usual = 0.08, least = 0.002, most = 0.15;
    const double miss = sqrt(3) * c->residual;
    if (!(c->distance > 0) || !(miss > 0)) return usual;
    return fmin(fmax(share * c->distance * c->distance / (miss * miss), least), most);
}

apsm_status fit_model_prepare(apsm_context *ctx, apsm_fit_model *m)
{
    m->radius = radius_of(m->model.J, m->model.mean);
    APSM_TRY(make_fidelity(ctx, m));
    APSM_TRY(make_normals(m));
    APSM_TRY(make_clouds(m));
    if (!(m->calibration.noise > 0)) APSM_TRY(calibrate(ctx, m));
    apsm_fidelity_set_doubt(m->fidelity, doubt_of(&m->calibration));
    APSM_TRY(fit_pose_mirror(m, &m->mirror));
    APSM_TRY(make_prior(m));
    return make_posterior(m);
}

/* ---- without some of the shapes ---- */

static apsm_status copy_template(apsm_context *ctx, const apsm_fit_model *m, apsm_fit_model *out)
{
    apsm_mesh mesh = { 0 };
    const size_t D = 3 * m->model.J;
    out->path = strdup(m->path);
    out->T = malloc(D * sizeof *out->T);
    if (!out->path || !out->T) return APSM_ERR_MEMORY;
    memcpy(out->T, m->T, D * sizeof *out->T);
    out->options = m->options;
    out->oriented = m->oriented;
    out->cropped = m->cropped;
    memcpy(out->common, m->common, sizeof out->common);
    out->calibration.distance = m->h * m->calibration.distance; /* not yet in h */
    out->calibration.distance_most = m->h * m->calibration.distance_most;
    APSM_TRY(apsm_mesh_copy(&m->cohort.shape[0].mesh, &mesh));
    return fit_model_take_mesh(ctx, &mesh, out);
}

static apsm_status refit(apsm_context *ctx, const apsm_fit_model *m, const bool *left_out,
                         apsm_fit_model *out)
{
    const size_t I = m->model.I, D = 3 * m->model.J;
    size_t n = 0;
    double *P = malloc(I * D * sizeof *P);
    if (!P) return APSM_ERR_MEMORY;
    fit_model_particles(&m->model, P);
    for (size_t i = 0; i < I; i++)
        if (!left_out[i]) memmove(P + n++ * D, P + i * D, D * sizeof *P);
    const apsm_status status =
        n >= 3 ? apsm_shape_model_fit(ctx, n, m->model.J, P, &out->model) : APSM_ERR_ARG;
    free(P);
    return status;
}

apsm_status fit_model_without(apsm_context *ctx, const apsm_fit_model *m, const bool *left_out,
                              apsm_fit_model **without)
{
    apsm_fit_model *out = *without = calloc(1, sizeof *out);
    if (!out) return APSM_ERR_MEMORY;
    apsm_status status = copy_template(ctx, m, out);
    if (status == APSM_OK) status = refit(ctx, m, left_out, out);
    if (status == APSM_OK) status = fit_model_prepare(ctx, out);
    if (status == APSM_OK) return status;
    apsm_fit_model_free(out);
    *without = NULL;
    return status;
}
