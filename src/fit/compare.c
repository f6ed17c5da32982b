/* The same anatomy in two models: B is laid on A by their mean surfaces, both models' modes are
 * read at the same places of these, and the shapes that both have are rebuilt by either, left out.
 */
#include "apsm/compare.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "core/sized.h"
#include "evaluate/surface_distance.h"
#include "files/files.h"
#include "fit/compare.h"
#include "fit/model_file.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "model/subspaces.h"

enum { POINTS = 1000, FOLDS = 10 };
static const double another_unit = 1.5; /* sizes of the means that differ by this are refused */

void compare_side_free(compare_side *s)
{
    model_folder_free(&s->folder);
    apsm_fit_model_free(s->file);
    apsm_mesh_free(&s->mean);
    apsm_mesh_free(&s->template_mesh);
    apsm_warp_free(&s->warp);
    *s = (compare_side){ 0 };
}

/* ---- one model ---- */

static apsm_status open_file(apsm_context *ctx, const char *path, compare_side *s)
{
    APSM_TRY(apsm_fit_model_load(ctx, path, &s->file));
    s->model = &s->file->model;
    s->T = s->file->T;
    return apsm_mesh_copy(apsm_fit_model_mesh(s->file), &s->template_mesh);
}

static apsm_status open_folder(apsm_context *ctx, const char *path, compare_side *s)
{
    const unsigned parts = FOLDER_PARTICLES | FOLDER_SCORES | FOLDER_EVALUATED;
    APSM_TRY(model_folder_read(ctx, path, parts, &s->folder));
    if (s->folder.parts > 1)
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: is a model of %zu parts a subject; compare those of its parts, which "
                         "are in its folder parts/",
                         path, s->folder.parts);
    s->model = &s->folder.model;
    s->T = s->folder.P + s->folder.template_index * 3 * s->folder.J;
    return model_folder_mesh(ctx, &s->folder, s->folder.template_index, &s->template_mesh);
}

apsm_status compare_side_open(apsm_context *ctx, const char *path, compare_side *s)
{
    *s = (compare_side){ .path = path };
    APSM_TRY(apsm_is_folder(path) ? open_folder(ctx, path, s) : open_file(ctx, path, s));
    if (s->model->modes == 0)
        return apsm_fail(ctx, APSM_ERR_STATE, "%s: has no modes of variation to compare", path);
    APSM_TRY(apsm_warp_build(ctx, APSM_PHI_R, s->template_mesh.nv, s->template_mesh.V, s->model->J,
                             s->T, &s->warp));
    APSM_TRY(apsm_mesh_copy(&s->template_mesh, &s->mean));
    apsm_warp_apply(&s->warp, s->model->mean, s->mean.V);
    return APSM_OK;
}

/* ---- B on A ---- */

typedef struct laid {
    apsm_bvh *tree[2];
    apsm_cloud cloud[2];
    double *work;
} laid;

static void laid_free(laid *l)
{
    for (int k = 0; k < 2; k++) {
        apsm_bvh_free(l->tree[k]);
        apsm_cloud_free(&l->cloud[k]);
    }
    free(l->work);
}

static apsm_status search(apsm_context *ctx, const compare_side side[2], laid *l,
                          apsm_comparison *c)
{
    apsm_icp_options icp = apsm_icp_defaults();
    apsm_pose same, other;
    l->work = malloc(apsm_icp_work_size(POINTS) * sizeof *l->work);
    if (!l->work) return APSM_ERR_MEMORY;
    for (int k = 0; k < 2; k++) {
        APSM_TRY(apsm_bvh_build_unsigned(&side[k].mean, &l->tree[k]));
        APSM_TRY(apsm_cloud_sample(&side[k].mean, POINTS, 0, 0, &l->cloud[k]));
    }
    c->size_ratio = l->cloud[1].radius / l->cloud[0].radius;
    if (c->size_ratio > another_unit || c->size_ratio < 1 / another_unit)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "%s: its mean is %.3g times as large as that of %s; another unit, or "
                         "another anatomy",
                         side[1].path, c->size_ratio, side[0].path);
    const apsm_surface a = { l->tree[0], &l->cloud[0] }, b = { l->tree[1], &l->cloud[1] };
    apsm_pose_search(&b, &a, false, &icp, &same, l->work);
    apsm_pose_search(&b, &a, true, &icp, &other, l->work);
    c->mirrored = other.residual < APSM_MIRROR_RATIO * same.residual;
    memcpy(c->M, c->mirrored ? other.M : same.M, sizeof c->M);
    return APSM_OK;
}

/* ---- modes at the same places ---- */

/* field (modes x 3 POINTS, out): how the surface of s moves at its points S by each mode times its
 * standard deviation, turned by the rotation in M.  V: scratch of 2 x 3 nv. */
static void mode_fields(const compare_side *s, size_t modes, const apsm_surface_point *S,
                        const double M[16], double *particles, double *V, double *field)
{
    const size_t D = 3 * s->model->J;
    const apsm_mesh moved = { .nv = s->mean.nv, .nf = s->mean.nf, .V = V, .F = s->mean.F };
    for (size_t k = 0; k < modes; k++) {
        const double sd = sqrt(s->model->variance[k]);
        for (size_t c = 0; c < D; c++)
            particles[c] = s->model->mean[c] + sd * s->model->mode[k * D + c];
        apsm_warp_apply(&s->warp, particles, V);
        for (size_t p = 0; p < POINTS; p++) {
            double x[3], y[3], d[3], *out = field + 3 * (k * POINTS + p);
            apsm_surface_position(&s->mean, &S[p], x);
            apsm_surface_position(&moved, &S[p], y);
            vec3_sub(y, x, d);
            for (int r = 0; r < 3; r++) out[r] = vec3_dot(M + 4 * r, d);
        }
    }
}

/* S[0] on A's mean, S[1] the nearest of B's, whose surface M takes to A's. */
static apsm_status match(const laid *l, const double M[16], apsm_surface_point *S[2])
{
    double back[16];
    apsm_closest nearest;
    APSM_TRY(apsm_affine_invert(M, back));
    for (size_t p = 0; p < POINTS; p++) {
        double x[3];
        apsm_bvh_closest(l->tree[0], l->cloud[0].x + 3 * p, INFINITY, &nearest);
        S[0][p] = nearest.on;
        apsm_affine_apply(back, 1, nearest.x, x);
        apsm_bvh_closest(l->tree[1], x, INFINITY, &nearest);
        S[1][p] = nearest.on;
    }
    return APSM_OK;
}

static double squares(size_t n, const double *x)
{
    double sum = 0;
    for (size_t k = 0; k < n; k++) sum += x[k] * x[k];
    return sum;
}

/* From fields (modes x 3 POINTS) to the comparison's figures. */
static apsm_status compare_spans(const size_t modes[2], const double *field[2], apsm_comparison *c)
{
    enum { D = 3 * POINTS };
    const size_t least = modes[0] < modes[1] ? modes[0] : modes[1];
    const size_t m = c->angles = least < APSM_COMPARE_MODES ? least : APSM_COMPARE_MODES;
    const size_t most = modes[0] > modes[1] ? modes[0] : modes[1];
    double *share[2] = { c->share_a, c->share_b },
           *explained[2] = { &c->explained_a, &c->explained_b };
    double *work = malloc((apsm_subspaces_work_size(most, m, D) + most) * sizeof *work);
    if (!work) return APSM_ERR_MEMORY;
    double *of = work + apsm_subspaces_work_size(most, m, D);
    apsm_status status = apsm_subspace_cosines(m, m, D, field[0], field[1], c->cosine, work);
    for (int k = 0; k < 2 && status == APSM_OK; k++) {
        double in = 0, all = 0;
        status = apsm_subspace_shares(modes[k], m, D, field[k], field[1 - k], of, work);
        for (size_t l = 0; l < modes[k] && status == APSM_OK; l++) {
            const double variance = squares(D, field[k] + l * D);
            in += of[l] * variance;
            all += variance;
            if (l < m) share[k][l] = of[l];
        }
        *explained[k] = in / all;
        c->variance[k] = all / POINTS;
    }
    free(work);
    return status;
}

static apsm_status compare_modes(const compare_side side[2], const laid *l, apsm_comparison *c)
{
    double I[16], *field[2] = { NULL, NULL }, *particles = NULL, *V = NULL;
    const size_t modes[2] = { side[0].model->modes, side[1].model->modes };
    apsm_surface_point *S = malloc(2 * POINTS * sizeof *S), *at[2] = { S, S ? S + POINTS : S };
    apsm_affine_identity(I);
    apsm_status status = S ? match(l, c->M, at) : APSM_ERR_MEMORY;
    for (int k = 0; k < 2 && status == APSM_OK; k++) {
        free(particles);
        free(V);
        particles = malloc(3 * side[k].model->J * sizeof *particles);
        V = malloc(3 * side[k].mean.nv * sizeof *V);
        field[k] = malloc(3 * POINTS * modes[k] * sizeof *field[k]);
        if (particles && V && field[k])
            mode_fields(&side[k], modes[k], at[k], k ? c->M : I, particles, V, field[k]);
        else
            status = APSM_ERR_MEMORY;
    }
    const double *fields[2] = { field[0], field[1] };
    if (status == APSM_OK) status = compare_spans(modes, fields, c);
    free(S);
    free(particles);
    free(V);
    free(field[0]);
    free(field[1]);
    return status;
}

/* ---- the shapes that both have ---- */

typedef struct rebuilding {
    const compare_side *side; /* 2 */
    size_t *at[2];            /* common: index in either model */
    size_t folds;
    apsm_shape_model *without; /* 2 x folds */
    double *distance;          /* common x 2 x counts */
    const apsm_comparison *c;
} rebuilding;

/* at[k]: where the common shapes are. */
static apsm_status find_common(const compare_side side[2], size_t *at[2], size_t *common)
{
    const model_folder *a = &side[0].folder, *b = &side[1].folder;
    *common = 0;
    if (!a->names || !b->names) return APSM_OK;
    for (int k = 0; k < 2; k++) {
        at[k] = malloc((a->I + 1) * sizeof *at[k]);
        if (!at[k]) return APSM_ERR_MEMORY;
    }
    for (size_t i = 0; i < a->I; i++) {
        const size_t l = apsm_project_find(&b->project, a->names[i]);
        if (l == b->I || i == a->template_index || l == b->template_index) continue;
        at[0][*common] = i;
        at[1][(*common)++] = l;
    }
    return APSM_OK;
}

static bool is_left_out(const rebuilding *r, int k, size_t fold, size_t shape)
{
    for (size_t i = fold; i < r->c->common; i += r->folds)
        if (r->at[k][i] == shape) return true;
    return false;
}

/* Task t: model t / folds without fold t % folds. */
static apsm_status leave_out(apsm_context *ctx, size_t t, int worker, void *user)
{
    (void)worker;
    const rebuilding *r = user;
    const int k = t >= r->folds;
    const size_t fold = t % r->folds, D = 3 * r->side[k].model->J, I = r->side[k].folder.I;
    double *P = malloc(I * D * sizeof *P);
    size_t n = 0;
    if (!P) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < I; i++)
        if (!is_left_out(r, k, fold, i))
            memcpy(P + n++ * D, r->side[k].folder.P + i * D, D * sizeof *P);
    const apsm_status status = apsm_shape_model_fit(ctx, n, r->side[k].model->J, P, &r->without[t]);
    free(P);
    return status;
}

/* Distances of shape i of model k, rebuilt from the leading modes. */
static apsm_status rebuild(apsm_context *ctx, const rebuilding *r, int k, size_t i, double *out)
{
    const compare_side *s = &r->side[k];
    const apsm_shape_model *m = &r->without[(size_t)k * r->folds + i % r->folds];
    const size_t J = s->model->J, shape = r->at[k][i];
    apsm_mesh own = { 0 }, rebuilt = { 0 };
    double *b = malloc((m->modes + 3 * J + 1) * sizeof *b);
    apsm_status status = b ? model_folder_mesh(ctx, &s->folder, shape, &own) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_mesh_copy(&s->template_mesh, &rebuilt);
    if (status == APSM_OK) apsm_shape_model_scores(m, s->folder.P + shape * 3 * J, b);
    for (size_t q = 0; q < r->c->counts && status == APSM_OK; q++) {
        apsm_surface_distance d;
        const size_t modes = r->c->count[q] < m->modes ? r->c->count[q] : m->modes;
        apsm_shape_model_synthesize(m, modes, b, b + m->modes);
        apsm_warp_apply(&s->warp, b + m->modes, rebuilt.V);
        status = apsm_surface_distance_between(ctx, &own, NULL, &rebuilt, NULL, &d);
        out[q] = d.two_way.mean;
    }
    apsm_mesh_free(&own);
    apsm_mesh_free(&rebuilt);
    free(b);
    return status;
}

static apsm_status rebuild_task(apsm_context *ctx, size_t t, int worker, void *user)
{
    (void)worker;
    const rebuilding *r = user;
    return rebuild(ctx, r, (int)(t % 2), t / 2, r->distance + t * r->c->counts);
}

double compare_sign_p(size_t less, size_t n)
{
    const size_t few = less < n - less ? less : n - less;
    const double N = (double)n;
    double sum = 0;
    for (size_t k = 0; k <= few; k++) {
        const double x = (double)k;
        sum += exp(lgamma(N + 1) - lgamma(x + 1) - lgamma(N - x + 1) - N * log(2));
    }
    return fmin(1, 2 * sum);
}

static void summarise(const rebuilding *r, apsm_comparison *c)
{
    for (size_t q = 0; q < c->counts; q++) {
        size_t less = 0, n = 0;
        for (size_t i = 0; i < c->common; i++) {
            const double a = r->distance[2 * i * c->counts + q];
            const double b = r->distance[(2 * i + 1) * c->counts + q];
            c->rebuilt[0][q] += a / (double)c->common;
            c->rebuilt[1][q] += b / (double)c->common;
            less += a < b;
            n += a != b;
        }
        c->p[q] = compare_sign_p(less, n);
    }
}

/* 1, 2, 5, 10 and all modes, as far as both models without a fold have them. */
static void choose_counts(const rebuilding *r, apsm_comparison *c)
{
    static const size_t usual[] = { 1, 2, 5, 10 };
    size_t all = SIZE_MAX;
    for (size_t t = 0; t < 2 * r->folds; t++)
        if (r->without[t].modes < all) all = r->without[t].modes;
    for (size_t k = 0; k < sizeof usual / sizeof *usual; k++)
        if (usual[k] < all) c->count[c->counts++] = usual[k];
    if (all > 0) c->count[c->counts++] = all;
}

static apsm_status compare_shapes(apsm_context *ctx, const compare_side side[2], apsm_comparison *c)
{
    rebuilding r = { .side = side, .c = c };
    apsm_status status = find_common(side, r.at, &c->common);
    r.folds = c->common < FOLDS ? c->common : FOLDS;
    if (status == APSM_OK && c->common > 2) {
        r.without = calloc(2 * r.folds, sizeof *r.without);
        r.distance = calloc(2 * c->common * APSM_COMPARE_COUNTS, sizeof *r.distance);
        status = r.without && r.distance ? APSM_OK : APSM_ERR_MEMORY;
        if (status == APSM_OK)
            status = apsm_parallel_for(ctx, 2 * r.folds, leave_out, &r, "leave shapes out");
        if (status == APSM_OK) choose_counts(&r, c);
        if (status == APSM_OK)
            status = apsm_parallel_for(ctx, 2 * c->common, rebuild_task, &r, "rebuild shapes");
        if (status == APSM_OK) summarise(&r, c);
    }
    for (size_t t = 0; r.without && t < 2 * r.folds; t++) apsm_shape_model_free(&r.without[t]);
    free(r.without);
    free(r.distance);
    free(r.at[0]);
    free(r.at[1]);
    return status;
}

/* ---- all ---- */

static apsm_status compare_means(apsm_context *ctx, compare_side side[2], apsm_comparison *c)
{
    apsm_surface_distance d;
    apsm_mesh moved = { 0 };
    APSM_TRY(apsm_mesh_copy(&side[1].mean, &moved));
    apsm_mesh_transform(&moved, c->M);
    const apsm_status status =
        apsm_surface_distance_between(ctx, &side[0].mean, NULL, &moved, NULL, &d);
    apsm_mesh_free(&moved);
    if (status != APSM_OK) return status;
    c->mean_mean = d.two_way.mean;
    c->mean_max = d.two_way.max;
    return APSM_OK;
}

static apsm_status compare(apsm_context *ctx, const apsm_compare_settings *o, compare_side side[2],
                           apsm_comparison *c)
{
    laid l = { 0 };
    const char *const path[2] = { o->a, o->b };
    for (int k = 0; k < 2; k++) {
        APSM_TRY(compare_side_open(ctx, path[k], &side[k]));
        c->shapes[k] = side[k].model->I;
        c->particles[k] = side[k].model->J;
        c->modes[k] = side[k].model->modes;
    }
    apsm_status status = search(ctx, side, &l, c);
    if (status == APSM_OK) status = compare_means(ctx, side, c);
    if (status == APSM_OK) status = compare_modes(side, &l, c);
    laid_free(&l);
    if (status == APSM_OK) status = compare_shapes(ctx, side, c);
    if (status == APSM_OK && o->folder) status = compare_write(ctx, o, side, c);
    return status;
}

apsm_status apsm_models_compare_sized(apsm_context *ctx, const apsm_compare_settings *given,
                                      size_t size, apsm_comparison *comparison,
                                      size_t comparison_size)
{
    compare_side side[2] = { { 0 }, { 0 } };
    apsm_compare_settings settings = { 0 };
    apsm_comparison result = { 0 };
    APSM_TRY(
        apsm_take_settings(ctx, "apsm_models_compare", given, size, &settings, sizeof settings));
    if (!settings.a || !settings.b || !comparison)
        return apsm_fail(ctx, APSM_ERR_ARG, "apsm_models_compare: an argument is NULL");
    apsm_status status = settings.folder ? compare_check_folder(ctx, &settings) : APSM_OK;
    if (status == APSM_OK) status = compare(ctx, &settings, side, &result);
    apsm_give_sized(&result, sizeof result, comparison, comparison_size);
    compare_side_free(&side[0]);
    compare_side_free(&side[1]);
    if (status == APSM_ERR_MEMORY) return apsm_fail(ctx, status, "compare: out of memory");
    return status;
}
