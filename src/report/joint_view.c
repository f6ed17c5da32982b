#include "report/joint_view.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "folder/names.h"
#include "joint/pose_shape.h"

/* What is read of the file beside the view: means and modes as they are told apart. */
typedef struct reading {
    const model_folder *m;
    const json_t *pose, *shape;
    apsm_pose_shape told; /* n, J, mean_pose (the view's) and gyration alone */
    apsm_parts parts;
    size_t *first; /* n + 1 */
    double *x;     /* J x 3: mean shapes in the parts' own frames */
    double *y;     /* J x 3: scratch */
} reading;

static void reading_free(reading *r)
{
    free(r->first);
    free(r->told.gyration);
    free(r->x);
    free(r->y);
}

static size_t shown(const json_t *variances, size_t most)
{
    const size_t n = json_array_size(variances);
    return n < most ? n : most;
}

static apsm_status allocate(const template_surface *t, reading *r, joint_view *v)
{
    const size_t n = v->n, J3 = 3 * t->m->J, V3 = 3 * t->first_vertex[n];
    r->first = malloc((n + 1) * sizeof *r->first);
    r->told.gyration = malloc(9 * n * sizeof *r->told.gyration);
    r->x = malloc(J3 * sizeof *r->x);
    r->y = malloc(J3 * sizeof *r->y);
    v->frame = malloc(16 * n * sizeof *v->frame);
    v->motion = malloc((v->poses * n * 6 + 1) * sizeof *v->motion);
    v->particles = malloc(J3 * sizeof *v->particles);
    v->surface = malloc(V3 * sizeof *v->surface);
    v->mode = malloc((v->shapes * V3 + 1) * sizeof *v->mode);
    v->mode_particles = malloc((v->shapes * J3 + 1) * sizeof *v->mode_particles);
    return r->first && r->told.gyration && r->x && r->y && v->frame && v->motion && v->particles &&
                   v->surface && v->mode && v->mode_particles
               ? APSM_OK
               : APSM_ERR_MEMORY;
}

static bool get_parts(const json_t *list, reading *r, joint_view *v)
{
    if (json_array_size(list) != v->n) return false;
    for (size_t d = 0; d < v->n; d++) {
        const json_t *part = json_array_get(list, d);
        r->first[d] = r->m->part[d].first;
        if (!apsm_json_get_matrix(json_object_get(part, "mean_pose"), 4, 4, v->frame + 16 * d) ||
            !apsm_json_get_matrix(json_object_get(part, "moments"), 3, 3, r->told.gyration + 9 * d))
            return false;
    }
    r->first[v->n] = r->m->J;
    r->parts = (apsm_parts){ v->n, r->first };
    r->told.n = v->n;
    r->told.J = r->m->J;
    r->told.mean_pose = v->frame;
    return true;
}

/* Mode k (rows of three, out) and its standard deviation. */
static bool get_mode(const json_t *model, size_t k, size_t rows, double *mode, double *sd)
{
    const double variance =
        json_number_value(json_array_get(json_object_get(model, "variances"), k));
    *sd = sqrt(fmax(variance, 0));
    return apsm_json_get_matrix(json_array_get(json_object_get(model, "modes"), k), rows, 3, mode);
}

static bool get_poses(reading *r, joint_view *v)
{
    for (size_t k = 0; k < v->poses; k++) {
        double sd; /* y is scratch: a part has three particles at least, its pose two rows */
        if (!get_mode(r->pose, k, 2 * v->n, r->y, &sd) ||
            apsm_pose_shape_pose(&r->told, &r->parts, sd, r->y, v->motion + 6 * v->n * k) !=
                APSM_OK)
            return false;
    }
    return true;
}

/* The displacements of mode k, of particles and of the surface. */
static bool get_shape(const template_surface *t, size_t k, reading *r, joint_view *v)
{
    const size_t J3 = 3 * r->m->J, V3 = 3 * t->first_vertex[v->n];
    double sd, *p = v->mode_particles + k * J3, *y = v->mode + k * V3;
    if (!get_mode(r->shape, k, r->m->J, r->y, &sd)) return false;
    for (size_t a = 0; a < J3; a++) r->y[a] = r->x[a] + sd * r->y[a];
    apsm_pose_shape_compose(&r->told, &r->parts, NULL, r->y, p);
    template_surface_warp(t, p, y);
    for (size_t a = 0; a < J3; a++) p[a] -= v->particles[a];
    for (size_t a = 0; a < V3; a++) y[a] -= v->surface[a];
    return true;
}

static bool get_all(const template_surface *t, const json_t *root, reading *r, joint_view *v)
{
    v->not_explained = json_number_value(json_object_get(root, "not_explained"));
    if (!get_parts(json_object_get(root, "parts"), r, v)) return false;
    if (!apsm_json_get_matrix(json_object_get(r->shape, "mean"), r->m->J, 3, r->x)) return false;
    apsm_pose_shape_compose(&r->told, &r->parts, NULL, r->x, v->particles);
    template_surface_warp(t, v->particles, v->surface);
    if (!get_poses(r, v)) return false;
    for (size_t k = 0; k < v->shapes; k++)
        if (!get_shape(t, k, r, v)) return false;
    return true;
}

static apsm_status take(apsm_context *ctx, const template_surface *t, const char *path,
                        const json_t *root, size_t modes, joint_view *v)
{
    reading r = { .m = t->m,
                  .pose = json_object_get(root, "pose"),
                  .shape = json_object_get(root, "shape") };
    v->n = t->m->parts;
    v->pose_variances = json_deep_copy(json_object_get(r.pose, "variances"));
    v->shape_variances = json_deep_copy(json_object_get(r.shape, "variances"));
    v->poses = shown(v->pose_variances, modes);
    v->shapes = shown(v->shape_variances, modes);
    apsm_status status = allocate(t, &r, v);
    if (status == APSM_OK && !get_all(t, root, &r, v))
        status = apsm_fail(ctx, APSM_ERR_FORMAT,
                           "%s: does not belong to the " FOLDER_MODEL " beside it; run anew", path);
    reading_free(&r);
    return status;
}

apsm_status joint_view_make(apsm_context *ctx, const template_surface *t, size_t modes,
                            joint_view *view)
{
    json_t *root = NULL;
    *view = (joint_view){ 0 };
    if (t->m->parts < 2) return APSM_OK;
    char *path = model_folder_path(t->m, FOLDER_POSE_SHAPE);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    if (apsm_file_exists(path)) status = apsm_json_read(ctx, path, &root);
    if (root) status = take(ctx, t, path, root, modes, view);
    json_decref(root);
    free(path);
    if (status != APSM_OK) joint_view_free(view);
    return status;
}

void joint_view_free(joint_view *v)
{
    json_decref(v->pose_variances);
    json_decref(v->shape_variances);
    free(v->frame);
    free(v->motion);
    free(v->particles);
    free(v->surface);
    free(v->mode);
    free(v->mode_particles);
    *v = (joint_view){ 0 };
}
