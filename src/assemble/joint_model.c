/* A joint model made ready for new subjects. */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "assemble/joint_fit.h"
#include "files/files.h"
#include "folder/manifest_json.h"
#include "folder/names.h"
#include "geometry/vec3.h"

enum { MOST_JUDGED = 12 };

void joint_model_free(joint_model *m)
{
    for (size_t d = 0; d < m->n; d++) {
        if (m->part) apsm_fit_model_free(m->part[d]);
        if (m->mean) apsm_mesh_free(&m->mean[d]);
        if (m->warp) apsm_warp_free(&m->warp[d]);
    }
    free(m->part);
    free(m->mean);
    free(m->warp);
    free(m->band);
    apsm_fit_model_free(m->whole);
    model_folder_free(&m->folder);
    *m = (joint_model){ 0 };
}

/* ---- how it was made ---- */

static const char *option(const joint_model *m, const char *key)
{
    return json_string_value(json_object_get(json_object_get(m->folder.manifest, "options"), key));
}

static apsm_status take_alignment(apsm_context *ctx, joint_model *m)
{
    const char *align = option(m, "align"), *parts = option(m, "align_parts");
    m->aligned = !align || strcmp(align, "none") != 0;
    m->scale = align && strcmp(align, "similarity") == 0;
    m->alignment = APSM_JOINT_GLOBAL;
    if (!parts || strcmp(parts, "global") == 0) return APSM_OK;
    m->alignment = APSM_JOINT_APART;
    if (strcmp(parts, "apart") == 0) return APSM_OK;
    m->alignment = APSM_JOINT_BY;
    for (m->align_by = 0; m->align_by < m->n; m->align_by++)
        if (strcmp(m->folder.part[m->align_by].name, parts) == 0) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: is aligned by a part '%s' that it does not have",
                     m->folder.path, parts);
}

/* ---- the parts ---- */

static apsm_status load_part(apsm_context *ctx, joint_model *m, size_t d)
{
    char *parts = apsm_path_join(m->folder.path, "parts");
    char *path = parts ? apsm_path_join(parts, m->folder.part[d].name) : NULL;
    apsm_status status = path ? apsm_fit_model_load(ctx, path, &m->part[d]) : APSM_ERR_MEMORY;
    free(parts);
    free(path);
    APSM_TRY(status);
    if (apsm_fit_model_particles(m->part[d]) != m->folder.part[d].J)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s: the model of its part %s has other particles; run the job again",
                         m->folder.path, m->folder.part[d].name);
    const model_part *p = &m->folder.part[d];
    APSM_TRY(model_folder_part_mesh(ctx, &m->folder, p->template_index, d, &m->mean[d]));
    const double *T = m->folder.P + 3 * (p->template_index * m->folder.J + p->first);
    APSM_TRY(apsm_warp_build(ctx, APSM_PHI_R, m->mean[d].nv, m->mean[d].V, p->J, T, &m->warp[d]));
    apsm_warp_apply(&m->warp[d], m->whole->model.mean + 3 * p->first, m->mean[d].V);
    return APSM_OK;
}

/* ---- what left-out subjects say ---- */

/* A posterior model of the shape model's leading modes. */
static posterior_model posterior_of_shapes(const apsm_shape_model *s, size_t modes, double noise)
{
    return (posterior_model){ 3 * s->J,    modes < s->modes ? modes : s->modes,
                              s->mean,     s->mode,
                              s->variance, noise };
}

/* Mean squared ratio of miss and deviation of part d, a coordinate, of a subject y without it. */
static apsm_status ratio_by(const joint_model *m, const posterior_model *q, const double *y,
                            size_t d, double *ratio)
{
    double *work =
        malloc((q->D / 3 + 4 * q->D + q->M + q->M * q->M + posterior_particles_work_size(q)) *
               sizeof *work);
    if (!work) return APSM_ERR_MEMORY;
    const model_part *p = &m->folder.part[d];
    const size_t J = q->D / 3;
    double *error = work, *x = error + J, *block = x + q->D, *b = block + 9 * J, *B = b + q->M;
    posterior_scores s = { .b = b, .B = B };
    for (size_t j = 0; j < J; j++) error[j] = j >= p->first && j < p->first + p->J ? INFINITY : 0;
    const apsm_status status = posterior_of_particles(q, y, error, &s, x, block, B + q->M * q->M);
    *ratio = 0;
    for (size_t j = p->first; j < p->first + p->J && status == APSM_OK; j++)
        *ratio += vec3_distance2(x + 3 * j, y + 3 * j) /
                  (block[9 * j] + block[9 * j + 4] + block[9 * j + 8]) / (double)p->J;
    free(work);
    return status;
}

/* The same with the pose as free as it is without the part. */
static apsm_status ratio_of(const joint_model *m, const posterior_model *q, const double *y,
                            size_t d, double *ratio)
{
    joint_posterior p = { 0 };
    bool *there = malloc(m->n * sizeof *there);
    if (!there) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < m->n; k++) there[k] = k != d;
    apsm_status status = joint_with_pose(m, joint_pose_is_free(m, there), q, &p);
    if (status == APSM_OK) status = ratio_by(m, &p.q, y, d, ratio);
    free(p.rows);
    free(there);
    return status;
}

typedef struct judging {
    joint_model *m;
    size_t judged;
    double *ratio; /* judged x n */
} judging;

static apsm_status judge_subject(apsm_context *ctx, size_t k, int worker, void *user)
{
    (void)worker;
    const judging *g = user;
    const joint_model *m = g->m;
    const fit_calibration *c = &m->whole->calibration;
    const size_t I = m->folder.I, D = 3 * m->folder.J, i = k * I / g->judged;
    apsm_shape_model without = { 0 };
    double *P = malloc(I * D * sizeof *P);
    if (!P) return APSM_ERR_MEMORY;
    memcpy(P, m->folder.P, i * D * sizeof *P);
    memcpy(P + i * D, m->folder.P + (i + 1) * D, (I - 1 - i) * D * sizeof *P);
    apsm_status status = apsm_shape_model_fit(ctx, I - 1, D / 3, P, &without);
    const posterior_model q =
        posterior_of_shapes(&without, (size_t)c->modes, c->noise * m->whole->h * m->whole->h);
    for (size_t d = 0; d < m->n && status == APSM_OK; d++)
        status = ratio_of(m, &q, m->folder.P + i * D, d, &g->ratio[k * m->n + d]);
    apsm_shape_model_free(&without);
    free(P);
    return status;
}

static apsm_status judge_missing(apsm_context *ctx, joint_model *m)
{
    const size_t I = m->folder.I;
    judging g = { m, I < MOST_JUDGED ? I : MOST_JUDGED, NULL };
    g.ratio = malloc(g.judged * m->n * sizeof *g.ratio);
    if (!g.ratio) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_parallel_for(ctx, g.judged, judge_subject, &g, NULL);
    for (size_t d = 0; d < m->n && status == APSM_OK; d++) {
        double sum = 0;
        for (size_t k = 0; k < g.judged; k++) sum += g.ratio[k * m->n + d] / (double)g.judged;
        m->band[d] = fmax(1, sqrt(sum));
    }
    free(g.ratio);
    return status;
}

static apsm_status make_whole(apsm_context *ctx, joint_model *m)
{
    apsm_fit_model *w = m->whole = calloc(1, sizeof *w);
    if (!w) return APSM_ERR_MEMORY;
    double sum = 0;
    w->options = apsm_options_defaults();
    w->model = m->folder.model; /* taken over */
    m->folder.model = (apsm_shape_model){ 0 };
    for (size_t d = 0; d < m->n; d++) {
        const model_part *p = &m->folder.part[d];
        w->h += vec3_mean_spacing(p->J, w->model.mean + 3 * p->first) / (double)m->n;
    }
    double centre[3] = { 0 };
    const size_t J = w->model.J;
    for (size_t k = 0; k < 3 * J; k++) centre[k % 3] += w->model.mean[k] / (double)J;
    for (size_t k = 0; k < 3 * J; k++)
        sum += (w->model.mean[k] - centre[k % 3]) * (w->model.mean[k] - centre[k % 3]);
    m->radius = sqrt(sum / (double)J);
    return fit_calibrate_scores(ctx, m->folder.P, w);
}

static apsm_status load(apsm_context *ctx, const char *folder, joint_model *m)
{
    const unsigned what = FOLDER_PARTICLES | FOLDER_SCORES | FOLDER_EVALUATED | FOLDER_MANIFESTED;
    APSM_TRY(model_folder_read(ctx, folder, what, &m->folder));
    if (m->folder.I < 4)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s: a joint model of %zu subjects cannot be fitted; it needs 4 at least",
                         folder, m->folder.I);
    m->n = m->folder.parts;
    m->part = calloc(m->n, sizeof(apsm_fit_model *));
    m->mean = calloc(m->n, sizeof *m->mean);
    m->warp = calloc(m->n, sizeof *m->warp);
    m->band = calloc(m->n, sizeof *m->band);
    if (!m->part || !m->mean || !m->warp || !m->band) return APSM_ERR_MEMORY;
    APSM_TRY(take_alignment(ctx, m));
    APSM_TRY(make_whole(ctx, m));
    for (size_t d = 0; d < m->n; d++) APSM_TRY(load_part(ctx, m, d));
    return judge_missing(ctx, m);
}

apsm_status joint_model_load(apsm_context *ctx, const char *folder, joint_model *m)
{
    *m = (joint_model){ 0 };
    const apsm_status status = load(ctx, folder, m);
    if (status != APSM_OK) joint_model_free(m);
    return status;
}

bool apsm_joint_is(apsm_context *ctx, const char *folder)
{
    json_t *root = NULL;
    char *path = apsm_path_join(folder, FOLDER_MANIFEST);
    bool is = false;
    if (path && apsm_is_folder(folder) && apsm_file_exists(path) &&
        apsm_json_read(ctx, path, &root) == APSM_OK)
        is = manifest_json_is_joint(root);
    json_decref(root);
    free(path);
    return is;
}
