/* The page of `apsm norm`: a patient's surface coloured by how unusual it is, beside the shape that
 * the norm expects, and how sure all that is.  All figures come from norm.json; surfaces are warps
 * of the template's mesh. */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/report.h"
#include "files/files.h"
#include "folder/model_folder.h"
#include "report/pack.h"
#include "report/page.h"
#include "report/template_surface.h"
#include "statistics/results.h"

enum { DATA_VERSION = 1, MOST_SHOWN = 60, FACES = 10000 };
static const double position_levels = 16383;

typedef struct norms {
    const char *folder; /* of the results */
    model_folder m;
    template_surface surface;
    apsm_mesh mesh;
    json_t *root; /* norm.json */
    size_t n, shown;
    double *particles; /* shown x 2 x J x 3: of the shape, and expected */
    double *vertices;  /* shown x 2 x nv x 3 */
    double lo[3], step;
    pack bytes;
} norms;

static void norms_free(norms *w)
{
    template_surface_free(&w->surface);
    apsm_mesh_free(&w->mesh);
    model_folder_free(&w->m);
    json_decref(w->root);
    free(w->particles);
    free(w->vertices);
    pack_free(&w->bytes);
}

/* ---- reading ---- */

static apsm_status damaged(apsm_context *ctx, const norms *w)
{
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: norm.json is not as apsm norm writes it for this model; run norm again",
                     w->folder);
}

static apsm_status read_root(apsm_context *ctx, norms *w)
{
    char *path = apsm_path_join(w->folder, "norm.json");
    apsm_status status = path ? apsm_json_read(ctx, path, &w->root) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_json_check(ctx, path, w->root, "apsm-norm", 1);
    free(path);
    return status;
}

static json_t *shape_of(const norms *w, size_t k)
{
    return json_array_get(json_object_get(w->root, "new"), k);
}

static apsm_status read_particles(apsm_context *ctx, norms *w)
{
    const size_t J = w->m.J;
    w->n = json_array_size(json_object_get(w->root, "new"));
    w->shown = w->n < MOST_SHOWN ? w->n : MOST_SHOWN;
    w->particles = malloc((6 * w->shown * J + 1) * sizeof *w->particles);
    if (!w->particles) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < w->shown; k++) {
        double *P = w->particles + 6 * k * J;
        if (!apsm_json_get_matrix(json_object_get(shape_of(w, k), "world"), J, 3, P) ||
            !apsm_json_get_matrix(json_object_get(shape_of(w, k), "expected"), J, 3, P + 3 * J))
            return damaged(ctx, w);
    }
    return APSM_OK;
}

static apsm_status make_surfaces(apsm_context *ctx, norms *w)
{
    APSM_TRY(template_surface_make(ctx, &w->m, FACES, &w->surface));
    APSM_TRY(template_surface_mesh(&w->surface, &w->mesh));
    w->vertices = malloc((6 * w->shown * w->mesh.nv + 1) * sizeof *w->vertices);
    if (!w->vertices) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < 2 * w->shown; k++)
        template_surface_warp(&w->surface, w->particles + 3 * k * w->m.J,
                              w->vertices + 3 * k * w->mesh.nv);
    return APSM_OK;
}

/* ---- writing ---- */

static void widen(const double *x, size_t n, double lo[3], double hi[3])
{
    for (size_t k = 0; k < 3 * n; k++) {
        lo[k % 3] = fmin(lo[k % 3], x[k]);
        hi[k % 3] = fmax(hi[k % 3], x[k]);
    }
}

/* Integers of 14 bits span all that is shown. */
static void choose_steps(norms *w)
{
    double hi[3] = { -INFINITY, -INFINITY, -INFINITY };
    for (int c = 0; c < 3; c++) w->lo[c] = INFINITY;
    widen(w->vertices, 2 * w->shown * w->mesh.nv, w->lo, hi);
    widen(w->particles, 2 * w->shown * w->m.J, w->lo, hi);
    for (int c = 0; c < 3; c++) w->step = fmax(w->step, hi[c] - w->lo[c]);
    w->step = w->step > 0 ? w->step / position_levels : 1;
}

/* Its figures without the particles, which are packed. */
static json_t *json_figures(norms *w, size_t k)
{
    json_t *o = json_deep_copy(shape_of(w, k));
    const size_t J = w->m.J, nv = w->mesh.nv;
    json_object_del(o, "world");
    json_object_del(o, "expected");
    if (!o || k >= w->shown) return o;
    const double *P = w->particles + 6 * k * J, *V = w->vertices + 6 * k * nv;
    json_object_set_new(o, "particles", pack_points(&w->bytes, J, w->lo, w->step, NULL, P));
    json_object_set_new(o, "vertices", pack_points(&w->bytes, nv, w->lo, w->step, NULL, V));
    json_object_set_new(o, "mean", pack_points(&w->bytes, nv, w->lo, w->step, NULL, V + 3 * nv));
    return o;
}

static json_t *json_all(norms *w)
{
    json_t *all = json_array();
    for (size_t k = 0; k < w->n && all; k++)
        if (json_array_append_new(all, json_figures(w, k))) {
            json_decref(all);
            all = NULL;
        }
    return all;
}

static json_t *copy_of(const norms *w, const char *key)
{
    json_t *x = json_object_get(w->root, key);
    return x ? json_incref(x) : json_null();
}

static json_t *compose(norms *w, const char *title)
{
    choose_steps(w);
    const apsm_mesh *mesh = &w->mesh;
    return json_pack(
        "{s:s, s:i, s:o, s:s, s:o, s:o, s:o, s:o, s:o, s:o, s:[f, f, f], s:f, s:o, s:o}", "format",
        "apsm-norms", "version", DATA_VERSION, "apsm", copy_of(w, "apsm"), "title", title, "unit",
        copy_of(w, "unit"), "formula", copy_of(w, "formula"), "cohort", copy_of(w, "shapes"),
        "coefficients", copy_of(w, "coefficients"), "not_certified", copy_of(w, "not_certified"),
        "notes", copy_of(w, "notes"), "origin", w->lo[0], w->lo[1], w->lo[2], "step", w->step,
        "faces", pack_integers(&w->bytes, 3 * mesh->nf, 3, mesh->nv > 65535 ? 4 : 2, mesh->F),
        "shapes", json_all(w));
}

static apsm_status write_page(apsm_context *ctx, norms *w)
{
    char *title = page_title(w->m.path), *path = apsm_path_join(w->folder, "norm.html");
    apsm_status status = APSM_ERR_MEMORY;
    if (title && path) {
        json_t *root = compose(w, title);
        if (root) status = page_write(ctx, path, root, &w->bytes);
        json_decref(root);
    }
    free(title);
    free(path);
    return status;
}

apsm_status apsm_norm_report_write(apsm_context *ctx, const char *model, const char *folder)
{
    if (!model) return apsm_fail(ctx, APSM_ERR_ARG, "apsm_norm_report_write: no model");
    char *where = results_folder(model, folder);
    norms w = { .folder = where };
    if (!where) return APSM_ERR_MEMORY;
    apsm_status status =
        model_folder_read(ctx, model, FOLDER_PARTICLES | FOLDER_SCORES | FOLDER_EVALUATED, &w.m);
    if (status == APSM_OK) status = read_root(ctx, &w);
    if (status == APSM_OK) status = read_particles(ctx, &w);
    if (status == APSM_OK) status = make_surfaces(ctx, &w);
    if (status == APSM_OK) status = write_page(ctx, &w);
    norms_free(&w);
    free(where);
    return status;
}
