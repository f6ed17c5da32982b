#include "fit/outputs.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "files/files.h"
#include "files/particles_file.h"
#include "folder/model_json.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "optimize/fidelity_shape.h"

void fit_origin_of(const apsm_fit_model *m, const char *path, const apsm_fit_options *options,
                   fit_origin *origin)
{
    *origin = (fit_origin){ .model = m, .path = path, .options = options };
    model_sha256(&m->model, m->T, origin->sha256);
}

static char *place(const char *folder, const char *part, const char *name, const char *rest)
{
    char relative[512];
    if (snprintf(relative, sizeof relative, "%s/%s%s", part, name, rest) >= (int)sizeof relative)
        return NULL;
    return apsm_path_join(folder, relative);
}

/* ---- particles ---- */

static apsm_status write_particles(apsm_context *ctx, const char *folder, const char *name,
                                   const apsm_fit *fit)
{
    const struct {
        const char *rest;
        const double *P;
    } frame[] = { { "_local.particles", fit->local },
                  { "_world.particles", fit->world },
                  { "_original.particles", fit->original } };
    for (size_t k = 0; k < 3; k++) {
        char *path = place(folder, "particles", name, frame[k].rest);
        if (!path) return APSM_ERR_MEMORY;
        const apsm_status status = apsm_particles_write(ctx, path, fit->J, frame[k].P);
        free(path);
        APSM_TRY(status);
    }
    return APSM_OK;
}

/* ---- mesh with fields ---- */

/* Signed distance of the fit's vertices from the mean's along the mean's normals. */
static apsm_status differences(const apsm_fit_model *m, const apsm_fit *fit, double *difference)
{
    apsm_mesh mean;
    APSM_TRY(apsm_mesh_copy(&fit->mesh, &mean));
    double *N = malloc(3 * mean.nv * sizeof *N);
    if (N) {
        apsm_warp_apply(&m->fidelity->warp, m->model.mean, mean.V);
        apsm_mesh_vertex_normals(&mean, N);
    }
    for (size_t v = 0; N && v < mean.nv; v++) {
        double d[3];
        vec3_sub(fit->mesh.V + 3 * v, mean.V + 3 * v, d);
        difference[v] = vec3_dot(d, N + 3 * v);
    }
    apsm_mesh_free(&mean);
    const apsm_status status = N ? APSM_OK : APSM_ERR_MEMORY;
    free(N);
    return status;
}

static void put_le(apsm_writer *w, uint32_t x)
{
    const unsigned char bytes[4] = { (unsigned char)x, (unsigned char)(x >> 8),
                                     (unsigned char)(x >> 16), (unsigned char)(x >> 24) };
    apsm_writer_write(w, bytes, sizeof bytes);
}

static void put_float(apsm_writer *w, double x)
{
    const float f = (float)x;
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    put_le(w, bits);
}

/* The mesh in the frame of the input. */
static void put_mesh(apsm_writer *w, const apsm_mesh *mesh, const apsm_fit *fit,
                     const double *difference)
{
    apsm_writer_printf(
        w,
        "ply\nformat binary_little_endian 1.0\ncomment apsm fit\nelement vertex %zu\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property float deviation\nproperty float difference\n"
        "property uchar observed\nelement face %zu\n"
        "property list uchar int vertex_indices\nend_header\n",
        mesh->nv, mesh->nf);
    for (size_t v = 0; v < mesh->nv; v++) {
        const unsigned char seen = fit->mesh_observed[v];
        for (size_t c = 0; c < 3; c++) put_float(w, mesh->V[3 * v + c]);
        put_float(w, fit->mesh_sd[v]);
        put_float(w, difference[v]);
        apsm_writer_write(w, &seen, 1);
    }
    for (size_t f = 0; f < mesh->nf; f++) {
        const unsigned char three = 3;
        apsm_writer_write(w, &three, 1);
        for (size_t c = 0; c < 3; c++) put_le(w, mesh->F[3 * f + c]);
    }
}

static apsm_status write_ply(apsm_context *ctx, const char *path, const apsm_fit_model *m,
                             const apsm_fit *fit)
{
    apsm_writer *w = NULL;
    apsm_mesh mesh;
    double back[16], *difference = malloc(fit->mesh.nv * sizeof *difference);
    if (!difference) return APSM_ERR_MEMORY;
    apsm_status status = differences(m, fit, difference);
    if (status == APSM_OK) status = apsm_affine_invert(fit->M, back);
    if (status == APSM_OK) status = apsm_mesh_copy(&fit->mesh, &mesh);
    if (status == APSM_OK) {
        apsm_mesh_transform(&mesh, back);
        status = apsm_writer_open(ctx, path, &w);
        if (status == APSM_OK) {
            put_mesh(w, &mesh, fit, difference);
            status = apsm_writer_commit(w);
        }
        apsm_mesh_free(&mesh);
    }
    free(difference);
    return status;
}

/* ---- one shape as JSON ---- */

static json_t *json_flags(size_t n, const bool *x)
{
    json_t *array = json_array();
    for (size_t k = 0; k < n; k++) json_array_append_new(array, json_boolean(x[k]));
    if (json_array_size(array) == n) return array;
    json_decref(array);
    return NULL;
}

static json_t *json_distance(const apsm_fit *f)
{
    const apsm_distance_summary *d = &f->distance.two_way;
    if (!f->has_distance) return json_null();
    return json_pack("{s:f, s:f, s:f}", "mean", d->mean, "p95", d->p95, "max", d->max);
}

static json_t *json_certificate(const apsm_fit *f)
{
    if (!f->has_certificate) return json_null();
    return json_pack("{s:s, s:I, s:I, s:I, s:f}", "verdict",
                     f->certified ? "certified" : "needs review", "lost", (json_int_t)f->lost,
                     "swaps", (json_int_t)f->swaps, "folds", (json_int_t)f->folds,
                     "off_surface_max", f->off_surface);
}

/* What tables and shapes' files share. */
static json_t *json_summary(const fit_row *row)
{
    const apsm_fit *f = &row->figures;
    json_t *o = json_pack("{s:s, s:s, s:s, s:s, s:s}", "name", row->name, "input", row->path,
                          "sha256", row->sha256, "verdict",
                          row->failed ? "failed" : apsm_fit_verdict_text(f->verdict), "reason",
                          row->problem);
    if (!o || row->failed) return o;
    const int bad = json_object_update_new(
        o,
        json_pack(
            "{s:b, s:b, s:f, s:f, s:o, s:o, s:o, s:o, s:I, s:o, s:f, s:f, s:f, s:f, s:o, s:o}",
            "partial", f->partial, "mirrored", f->mirrored, "cropped_share", f->cropped_share,
            "pose_residual", f->pose_residual, "runner_up_ratio",
            apsm_json_number_or_null(f->runner_up), "mirror_ratio",
            apsm_json_number_or_null(f->mirror_ratio), "to_world", apsm_json_vector(16, f->M),
            "mahalanobis", apsm_json_number_or_null(f->mahalanobis), "mahalanobis_modes",
            (json_int_t)f->mahalanobis_modes, "tail_probability", apsm_json_number_or_null(f->tail),
            "residual", f->residual, "residual_usual", f->residual_usual, "observed_share",
            f->observed_share, "counted_share", f->counted_share, "surface_distance",
            json_distance(f), "certificate", json_certificate(f)));
    if (!bad) return o;
    json_decref(o);
    return NULL;
}

static json_t *json_model(const fit_origin *o)
{
    const apsm_shape_model *s = &o->model->model;
    const char *unit = o->model->unit;
    return json_pack("{s:s, s:s, s:I, s:I, s:f, s:o}", "path", o->path, "sha256", o->sha256,
                     "shapes", (json_int_t)s->I, "particles", (json_int_t)s->J, "h", o->model->h,
                     "unit", unit ? json_string(unit) : json_null());
}

static apsm_status write_json(apsm_context *ctx, char *path, json_t *root)
{
    const apsm_status status = path ? apsm_json_write(ctx, path, root) : APSM_ERR_MEMORY;
    json_decref(root);
    free(path);
    return status;
}

static apsm_status write_shape_json(apsm_context *ctx, char *path, const fit_origin *origin,
                                    const fit_row *row, const apsm_fit *fit)
{
    json_t *root = json_pack("{s:s, s:i, s:o, s:o}", "format", FORMAT_FIT_CASE, "version",
                             FIT_VERSION, "model", json_model(origin), "fit", json_summary(row));
    if (root && fit->J > 0 &&
        json_object_update_new(
            root, json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "scores",
                            apsm_json_vector(fit->modes, fit->score), "variances",
                            apsm_json_vector(fit->modes, fit->variance), "world",
                            apsm_json_matrix(fit->J, 3, fit->world), "original",
                            apsm_json_matrix(fit->J, 3, fit->original), "deviation_normal",
                            apsm_json_vector(fit->J, fit->sd_normal), "deviation",
                            apsm_json_vector(fit->J, fit->sd), "observed",
                            json_flags(fit->J, fit->observed)))) {
        json_decref(root);
        root = NULL;
    }
    return write_json(ctx, path, root);
}

apsm_status fit_write_shape(apsm_context *ctx, const char *folder, const fit_origin *origin,
                            const fit_row *row, const apsm_fit *fit)
{
    APSM_TRY(write_shape_json(ctx, place(folder, "shapes", row->name, ".json"), origin, row, fit));
    if (fit->J == 0) return APSM_OK;
    APSM_TRY(write_particles(ctx, folder, row->name, fit));
    char *path = place(folder, "meshes", row->name, "_fit.ply");
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = write_ply(ctx, path, origin->model, fit);
    free(path);
    return status;
}

apsm_status fit_write_mean(apsm_context *ctx, const char *folder, const apsm_fit_model *m)
{
    apsm_mesh mean = { 0 };
    char *path = apsm_path_join(folder, "meshes/mean.ply");
    apsm_status status = path ? apsm_mesh_copy(apsm_fit_model_mesh(m), &mean) : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        apsm_warp_apply(&m->fidelity->warp, m->model.mean, mean.V);
        status = apsm_write_mesh(ctx, path, &mean);
    }
    apsm_mesh_free(&mean);
    free(path);
    return status;
}

/* ---- tables ---- */

/* One shape of fit.json. */
static apsm_status summary_of(apsm_context *ctx, size_t i, void *user, json_t **summary)
{
    fit_rows *rows = user;
    APSM_TRY(fit_rows_get(ctx, rows, i));
    *summary = json_summary(rows->row);
    return APSM_OK;
}

static apsm_status write_summary(apsm_context *ctx, const char *folder, const fit_origin *origin,
                                 fit_rows *rows)
{
    static const char *const hand[] = { "auto", "same", "other" };
    static const char *const extent[] = { "auto", "whole", "part" };
    const apsm_fit_options *o = origin->options;
    json_t *head = json_pack("{s:s, s:i, s:s, s:o, s:{s:s, s:s, s:b, s:b}}", "format", FORMAT_FIT,
                             "version", FIT_VERSION, "apsm", APSM_VERSION, "model",
                             json_model(origin), "options", "hand", hand[o->hand], "extent",
                             extent[o->extent], "aligned", o->aligned, "force", o->force);
    const apsm_json_list shapes = { "shapes", rows->n, summary_of, rows };
    char *path = apsm_path_join(folder, FIT_JSON);
    const apsm_status status =
        path ? apsm_json_write_list(ctx, path, head, &shapes) : APSM_ERR_MEMORY;
    json_decref(head);
    free(path);
    return status;
}

static void put_cell(apsm_writer *w, double x)
{
    apsm_writer_printf(w, ",");
    if (isfinite(x)) apsm_writer_number(w, x);
}

static void put_row(apsm_writer *w, const fit_row *row, size_t modes)
{
    const apsm_fit *f = &row->figures;
    const bool fitted = !row->failed && f->J > 0;
    const apsm_distance_summary *d = &f->distance.two_way;
    const double cells[] = { f->mahalanobis,
                             f->tail,
                             f->residual,
                             f->has_distance ? d->mean : NAN,
                             f->has_distance ? d->max : NAN,
                             f->observed_share,
                             f->counted_share };
    apsm_writer_csv(w, row->name);
    apsm_writer_printf(w, ",%s,", row->failed ? "failed" : apsm_fit_verdict_text(f->verdict));
    apsm_writer_csv(w, row->problem);
    apsm_writer_printf(w, ",%s", !fitted ? "" : f->mirrored ? "yes" : "no");
    for (size_t k = 0; k < sizeof cells / sizeof *cells; k++) put_cell(w, fitted ? cells[k] : NAN);
    apsm_writer_printf(w, ",%s",
                       !fitted || !f->has_certificate ? ""
                       : f->certified                 ? "certified"
                                                      : "needs review");
    for (size_t k = 0; k < modes; k++) put_cell(w, fitted ? f->score[k] : NAN);
    apsm_writer_printf(w, "\n");
}

static apsm_status write_csv(apsm_context *ctx, const char *folder, fit_rows *rows)
{
    apsm_writer *w = NULL;
    char *path = apsm_path_join(folder, FIT_CSV);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_writer_open(ctx, path, &w);
    free(path);
    APSM_TRY(status);
    apsm_writer_printf(w, "name,verdict,reason,mirrored,mahalanobis,tail_probability,residual,"
                          "surface_mean,surface_max,observed_share,counted_share,certificate");
    for (size_t k = 0; k < rows->modes; k++) apsm_writer_printf(w, ",mode_%zu", k + 1);
    apsm_writer_printf(w, "\n");
    for (size_t k = 0; k < rows->n && status == APSM_OK; k++) {
        status = fit_rows_get(ctx, rows, k);
        if (status == APSM_OK) put_row(w, rows->row, rows->modes);
    }
    if (status == APSM_OK) return apsm_writer_commit(w);
    apsm_writer_abort(w);
    return status;
}

apsm_status fit_write_tables(apsm_context *ctx, const char *folder, const fit_origin *origin,
                             fit_rows *rows)
{
    APSM_TRY(write_csv(ctx, folder, rows));
    return write_summary(ctx, folder, origin, rows);
}
