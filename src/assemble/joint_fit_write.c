/* Files of fits to a joint model: docs/formats.md, "Fits of joints". */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "assemble/joint_fit.h"
#include "files/files.h"
#include "files/particles_file.h"
#include "geometry/affine.h"

/* ---- one subject ---- */

static char *place(const char *folder, const char *kind, const char *subject, const char *part,
                   const char *rest)
{
    char relative[600];
    if (snprintf(relative, sizeof relative, "%s/%s_%s%s", kind, subject, part, rest) >=
        (int)sizeof relative)
        return NULL;
    return apsm_path_join(folder, relative);
}

static apsm_status write_particles(apsm_context *ctx, const char *folder, const joint_model *m,
                                   const joint_subject_fit *s, size_t d)
{
    static const char *const rest[] = { "_world.particles", "_original.particles" };
    const model_part *p = &m->folder.part[d];
    const double *const x[] = { s->world, s->original };
    for (int k = 0; k < 2; k++) {
        char *path = place(folder, "particles", s->name, p->name, rest[k]);
        if (!path) return APSM_ERR_MEMORY;
        const apsm_status status = apsm_particles_write(ctx, path, p->J, x[k] + 3 * p->first);
        free(path);
        APSM_TRY(status);
    }
    return APSM_OK;
}

/* Deviations of vertices: those of the particles that move them. */
static void carry(const apsm_warp *warp, const double *sd, double *value)
{
    for (size_t v = 0; v < warp->nv; v++) {
        double sum = 0, all = 0;
        for (size_t j = 0; j < warp->J; j++) {
            const double w = fabs(warp->W[v * warp->J + j]);
            all += w;
            sum += w * sd[j];
        }
        value[v] = sum / all;
    }
}

/* In the frame of the input. */
static apsm_status write_mesh(apsm_context *ctx, const char *folder, const joint_model *m,
                              const joint_subject_fit *s, size_t d)
{
    const model_part *p = &m->folder.part[d];
    apsm_mesh mesh = { 0 };
    double back[16], *value = malloc((m->mean[d].nv + 1) * sizeof *value);
    char *path = place(folder, "meshes", s->name, p->name, "_fit.ply");
    const apsm_mesh_field field = { "deviation", value };
    apsm_status status = path && value ? apsm_affine_invert(s->M + 16 * d, back) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_mesh_copy(&m->mean[d], &mesh);
    if (status == APSM_OK) {
        apsm_warp_apply(&m->warp[d], s->world + 3 * p->first, mesh.V);
        apsm_mesh_transform(&mesh, back);
        carry(&m->warp[d], s->sd + p->first, value);
        status = apsm_write_mesh_fields(ctx, path, &mesh, 1, &field);
    }
    apsm_mesh_free(&mesh);
    free(value);
    free(path);
    return status;
}

apsm_status joint_fit_write_subject(apsm_context *ctx, const char *folder, const joint_model *m,
                                    const joint_subject_fit *s)
{
    for (size_t d = 0; d < m->n; d++) {
        APSM_TRY(write_particles(ctx, folder, m, s, d));
        APSM_TRY(write_mesh(ctx, folder, m, s, d));
    }
    return APSM_OK;
}

/* ---- tables ---- */

static const char *verdict_of(const joint_subject_fit *s)
{
    return s->failed ? "failed" : apsm_fit_verdict_text(s->verdict);
}

static bool is_whole(const joint_subject_fit *s)
{
    return !s->failed && s->verdict != APSM_FIT_REFUSED;
}

static json_t *json_part(const joint_model *m, const joint_subject_fit *s, size_t d)
{
    const apsm_fit *f = &s->part[d];
    if (!s->path || !s->path[d])
        return json_pack("{s:s, s:s}", "name", m->folder.part[d].name, "verdict", "missing");
    return json_pack("{s:s, s:s, s:s, s:s, s:s, s:b, s:o, s:o}", "name", m->folder.part[d].name,
                     "verdict", apsm_fit_verdict_text(f->verdict), "reason", f->reason, "input",
                     s->path[d], "sha256", s->sha256[d], "mirrored", f->mirrored, "mahalanobis",
                     apsm_json_number_or_null(f->mahalanobis), "surface_distance",
                     f->has_distance ? json_real(f->distance.two_way.mean) : json_null());
}

static json_t *json_contacts(const joint_model *m, const joint_subject_fit *s)
{
    json_t *list = json_array();
    for (size_t a = 0, k = 0; a < m->n && s->given == m->n; a++)
        for (size_t b = a + 1; b < m->n; b++, k++)
            json_array_append_new(list,
                                  json_pack("{s:[s, s], s:f, s:f}", "parts", m->folder.part[a].name,
                                            m->folder.part[b].name, "gap", s->contact[k].gap,
                                            "depth", s->contact[k].depth));
    return list;
}

static json_t *json_subject(const joint_model *m, const joint_subject_fit *s)
{
    json_t *parts = json_array(), *to_world = json_array();
    for (size_t d = 0; d < m->n; d++) json_array_append_new(parts, json_part(m, s, d));
    json_t *o = json_pack("{s:s, s:s, s:s, s:o}", "name", s->name, "verdict", verdict_of(s),
                          "reason", s->reason, "parts", parts);
    for (size_t d = 0; is_whole(s) && d < m->n; d++)
        json_array_append_new(to_world, apsm_json_vector(16, s->M + 16 * d));
    if (!o || !is_whole(s)) {
        json_decref(to_world);
        return o;
    }
    json_object_set_new(o, "mirrored", json_boolean(s->mirrored));
    json_object_set_new(o, "to_world", to_world);
    json_object_set_new(o, "mahalanobis", apsm_json_number_or_null(s->mahalanobis));
    json_object_set_new(o, "tail_probability", apsm_json_number_or_null(s->tail));
    json_object_set_new(o, "residual", json_real(s->residual));
    json_object_set_new(o, "scores", apsm_json_vector(m->whole->model.modes, s->score));
    json_object_set_new(o, "contacts", json_contacts(m, s));
    return o;
}

static apsm_status write_json(apsm_context *ctx, const apsm_fit_settings *o, const joint_model *m,
                              size_t n, const joint_subject_fit *s)
{
    const apsm_shape_model *w = &m->whole->model;
    char *path = apsm_path_join(o->folder, JOINT_FIT_JSON);
    json_t *subjects = json_array();
    for (size_t i = 0; i < n; i++) json_array_append_new(subjects, json_subject(m, &s[i]));
    json_t *root =
        json_pack("{s:s, s:i, s:s, s:{s:s, s:I, s:I, s:I}, s:o, s:o, s:o}", "format",
                  FORMAT_JOINT_FIT, "version", JOINT_FIT_VERSION, "apsm", APSM_VERSION, "model",
                  "path", o->model, "subjects", (json_int_t)w->I, "particles", (json_int_t)w->J,
                  "modes", (json_int_t)m->whole->calibration.modes, "variances",
                  apsm_json_vector(w->modes, w->variance), "missing_factors",
                  apsm_json_vector(m->n, m->band), "subjects", subjects);
    const apsm_status status = path ? apsm_json_write(ctx, path, root) : APSM_ERR_MEMORY;
    json_decref(root);
    free(path);
    return status;
}

static void put_cell(apsm_writer *w, bool known, double x)
{
    apsm_writer_printf(w, ",");
    if (known && isfinite(x)) apsm_writer_number(w, x);
}

static void put_head(apsm_writer *w, const joint_model *m)
{
    apsm_writer_printf(w, "name,verdict,reason,mirrored,missing,mahalanobis,tail_probability,"
                          "residual");
    for (size_t a = 0; a < m->n; a++)
        for (size_t b = a + 1; b < m->n; b++)
            for (int k = 0; k < 2; k++)
                apsm_writer_printf(w, ",%s_%s_%s", k ? "depth" : "gap", m->folder.part[a].name,
                                   m->folder.part[b].name);
    for (size_t k = 0; k < m->whole->model.modes; k++) apsm_writer_printf(w, ",mode_%zu", k + 1);
    apsm_writer_printf(w, "\n");
}

static void put_row(apsm_writer *w, const joint_model *m, const joint_subject_fit *s)
{
    char missing[600] = "";
    const bool whole = is_whole(s), all = whole && s->given == m->n;
    for (size_t d = 0; d < m->n; d++)
        if (s->path && !s->path[d])
            snprintf(missing + strlen(missing), sizeof missing - strlen(missing), "%s%.40s",
                     *missing ? " " : "", m->folder.part[d].name);
    apsm_writer_csv(w, s->name);
    apsm_writer_printf(w, ",%s,", verdict_of(s));
    apsm_writer_csv(w, s->reason);
    apsm_writer_printf(w, ",%s,", !whole ? "" : s->mirrored ? "yes" : "no");
    apsm_writer_csv(w, missing);
    put_cell(w, whole, s->mahalanobis);
    put_cell(w, whole, s->tail);
    put_cell(w, whole, s->residual);
    for (size_t k = 0; k < m->n * (m->n - 1) / 2; k++) {
        put_cell(w, all, s->contact ? s->contact[k].gap : NAN);
        put_cell(w, all, s->contact ? s->contact[k].depth : NAN);
    }
    for (size_t k = 0; k < m->whole->model.modes; k++)
        put_cell(w, whole, s->score ? s->score[k] : NAN);
    apsm_writer_printf(w, "\n");
}

static apsm_status write_csv(apsm_context *ctx, const apsm_fit_settings *o, const joint_model *m,
                             size_t n, const joint_subject_fit *s)
{
    apsm_writer *w = NULL;
    char *path = apsm_path_join(o->folder, JOINT_FIT_CSV);
    const apsm_status status = path ? apsm_writer_open(ctx, path, &w) : APSM_ERR_MEMORY;
    free(path);
    APSM_TRY(status);
    put_head(w, m);
    for (size_t i = 0; i < n; i++) put_row(w, m, &s[i]);
    return apsm_writer_commit(w);
}

apsm_status joint_fit_write_tables(apsm_context *ctx, const apsm_fit_settings *o,
                                   const joint_model *m, size_t n, const joint_subject_fit *s)
{
    APSM_TRY(write_csv(ctx, o, m, n, s));
    return write_json(ctx, o, m, n, s);
}
