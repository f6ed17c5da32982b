#include "folder/model_folder.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "files/files.h"
#include "files/particles_file.h"
#include "files/project_columns.h"
#include "folder/model_json.h"
#include "folder/names.h"
#include "geometry/affine.h"

static const double changed_model = 1e-6; /* of the extent */
static const double file_rounding = 1e-8; /* of a coordinate: nine digits are written */

static apsm_status stale(apsm_context *ctx, const model_folder *m, const char *what)
{
    return apsm_fail(ctx, APSM_ERR_STATE, "%s: %s; run `apsm evaluate %s` first", m->path, what,
                     m->path);
}

static apsm_status out_of_memory(apsm_context *ctx, const model_folder *m)
{
    return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", m->path);
}

char *model_folder_path(const model_folder *m, const char *name)
{
    return apsm_path_join(m->path, name);
}

/* ---- the files ---- */

static apsm_status read_project(apsm_context *ctx, model_folder *m)
{
    APSM_TRY(apsm_require_folder(ctx, m->path));
    char *path = model_folder_path(m, FOLDER_PROJECT);
    if (!path) return out_of_memory(ctx, m);
    const apsm_status status =
        apsm_file_exists(path)
            ? apsm_project_read(ctx, path, &m->project)
            : apsm_fail(ctx, APSM_ERR_STATE,
                        "%s: no " FOLDER_PROJECT " in this folder; give a folder made by "
                        "`apsm run`",
                        m->path);
    free(path);
    APSM_TRY(status);
    m->names = calloc(m->project.n + 1, sizeof *m->names);
    if (!m->names) return out_of_memory(ctx, m);
    for (size_t i = 0; i < m->project.n; i++) m->names[i] = m->project.subjects[i].name;
    return APSM_OK;
}

static apsm_status read_model(apsm_context *ctx, model_folder *m)
{
    char *path = model_folder_path(m, FOLDER_MODEL);
    if (!path) return out_of_memory(ctx, m);
    const apsm_status status = apsm_file_exists(path) ? model_json_read(ctx, path, &m->model)
                                                      : stale(ctx, m, "there is no model yet");
    free(path);
    APSM_TRY(status);
    m->I = m->model.I;
    m->J = m->model.J;
    return m->I == m->project.n ? APSM_OK : stale(ctx, m, FOLDER_MODEL " is of other shapes");
}

static apsm_status read_scores(apsm_context *ctx, model_folder *m)
{
    char *path = model_folder_path(m, FOLDER_SCORES_CSV);
    if (!path) return out_of_memory(ctx, m);
    const apsm_status status = apsm_file_exists(path)
                                   ? scores_csv_read(ctx, path, m->names, &m->model)
                                   : stale(ctx, m, "there is no " FOLDER_SCORES_CSV);
    free(path);
    return status;
}

static apsm_status read_json(apsm_context *ctx, const model_folder *m, const char *name,
                             const char *format, int version, json_t **root)
{
    char *path = model_folder_path(m, name);
    if (!path) return out_of_memory(ctx, m);
    apsm_status status = apsm_file_exists(path) ? apsm_json_read(ctx, path, root)
                                                : stale(ctx, m, "there is no model yet");
    if (status == APSM_OK) status = apsm_json_check(ctx, path, *root, format, version);
    free(path);
    return status;
}

/* That of the figures, if they are read: a project of another program names none. */
static apsm_status find_template(apsm_context *ctx, model_folder *m)
{
    const char *name = m->evaluation ? json_string_value(json_object_get(m->evaluation, "template"))
                                     : apsm_project_get(&m->project, "apsm", "template_used");
    m->template_index = name ? apsm_project_find(&m->project, name) : m->I;
    return m->template_index < m->I ? APSM_OK : stale(ctx, m, "its files name no template");
}

/* ---- parts ---- */

/* Several parts are listed in model.json; without a list all particles are the one part's. */
static apsm_status take_part(apsm_context *ctx, const model_folder *m, const json_t *json,
                             size_t first, model_part *part)
{
    const char *name = json_string_value(json_object_get(json, "name"));
    const char *like = json_string_value(json_object_get(json, "template"));
    const json_int_t J = json_integer_value(json_object_get(json, "particles"));
    if (!name || !like || J < 1 || (size_t)J > m->J - first)
        return stale(ctx, m, FOLDER_MODEL " has parts that do not fit it");
    *part = (model_part){ strdup(name), first, (size_t)J, apsm_project_find(&m->project, like) };
    if (!part->name) return out_of_memory(ctx, m);
    return part->template_index < m->I ? APSM_OK : stale(ctx, m, "a part names no template");
}

static apsm_status take_parts(apsm_context *ctx, model_folder *m, const json_t *list)
{
    size_t first = 0;
    const size_t n = json_array_size(list) > 0 ? json_array_size(list) : 1;
    m->part = calloc(n, sizeof *m->part);
    if (!m->part) return out_of_memory(ctx, m);
    m->parts = n;
    if (json_array_size(list) == 0) {
        m->part[0] = (model_part){ NULL, 0, m->J, m->template_index };
        return APSM_OK;
    }
    for (size_t d = 0; d < n; d++) {
        APSM_TRY(take_part(ctx, m, json_array_get(list, d), first, &m->part[d]));
        first += m->part[d].J;
    }
    return first == m->J ? APSM_OK : stale(ctx, m, FOLDER_MODEL " has parts that do not fit it");
}

static apsm_status read_parts_of_model(apsm_context *ctx, model_folder *m)
{
    json_t *root = NULL;
    APSM_TRY(read_json(ctx, m, FOLDER_MODEL, FORMAT_MODEL, MODEL_VERSION, &root));
    const apsm_status status = take_parts(ctx, m, json_object_get(root, "parts"));
    json_decref(root);
    return status;
}

/* A column of part d; the struct holds those of the first. */
static const char *part_column(const model_folder *m, size_t i, size_t d, const char *prefix)
{
    char key[256];
    snprintf(key, sizeof key, "%s_%s", prefix, m->part[d].name);
    return apsm_subject_column(&m->project.subjects[i], key);
}

static apsm_status read_set(apsm_context *ctx, const model_folder *m, const char *stored, size_t J,
                            double *p)
{
    if (!stored) return stale(ctx, m, "a shape has no particles");
    char *path = apsm_project_path(&m->project, stored);
    if (!path) return out_of_memory(ctx, m);
    const apsm_status status = apsm_particles_read_n(ctx, path, J, p);
    free(path);
    return status;
}

static apsm_status read_sets(apsm_context *ctx, const model_folder *m, size_t i, bool world,
                             double *p)
{
    const apsm_subject *s = &m->project.subjects[i];
    const char *first = world ? s->world_particles : s->local_particles;
    APSM_TRY(read_set(ctx, m, first, m->part[0].J, p));
    for (size_t d = 1; d < m->parts; d++)
        APSM_TRY(read_set(ctx, m,
                          part_column(m, i, d, world ? "world_particles" : "local_particles"),
                          m->part[d].J, p + 3 * m->part[d].first));
    return APSM_OK;
}

static apsm_status read_world(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    model_folder *m = user;
    return read_sets(ctx, m, i, true, m->P + i * m->J * 3);
}

/* ---- whether the particles are those that the model was made of ---- */

/* How far coordinates may be off by rounding. */
static double rounding_of(const model_folder *m)
{
    double extent = 0.0, far = 0.0;
    for (size_t k = 0; k < 3 * m->J; k++) {
        extent = fmax(extent, fabs(m->model.mean[k] - m->model.mean[k % 3]));
        far = fmax(far, fabs(m->model.mean[k]));
    }
    return changed_model * extent + file_rounding * far;
}

/* sum: 3J, scratch. */
static bool has_mean(const model_folder *m, double rounding, double *sum)
{
    const size_t n = 3 * m->J;
    memset(sum, 0, n * sizeof *sum);
    for (size_t i = 0; i < m->I; i++)
        for (size_t k = 0; k < n; k++) sum[k] += m->P[i * n + k];
    for (size_t k = 0; k < n; k++)
        if (!(fabs(sum[k] / (double)m->I - m->model.mean[k]) <= rounding)) return false;
    return true;
}

/* Along `sum` (3J, scratch), the sum of all modes, every shape lies by the sum of its scores: one
 * product a shape that says whether the particles in a file are that shape's. */
static bool has_scores(const model_folder *m, double rounding, double *sum)
{
    const apsm_shape_model *s = &m->model;
    const size_t n = 3 * m->J;
    memset(sum, 0, n * sizeof *sum);
    for (size_t k = 0; k < s->modes * n; k++) sum[k % n] += s->mode[k];
    for (size_t i = 0; i < m->I; i++) {
        double off = 0.0;
        for (size_t k = 0; k < n; k++) off += sum[k] * (m->P[i * n + k] - s->mean[k]);
        for (size_t k = 0; k < s->modes; k++) off -= s->score[i * s->modes + k];
        if (!(fabs(off) <= sqrt((double)(n * s->modes)) * rounding)) return false;
    }
    return true;
}

static apsm_status check_particles(apsm_context *ctx, const model_folder *m)
{
    const double rounding = rounding_of(m);
    double *sum = malloc((3 * m->J + 1) * sizeof *sum);
    if (!sum) return out_of_memory(ctx, m);
    const bool same = has_mean(m, rounding, sum) && has_scores(m, rounding, sum);
    free(sum);
    return same ? APSM_OK
                : stale(ctx, m,
                        "particles have changed since the model was made of them (`apsm verify` "
                        "tells which)");
}

static apsm_status read_particles(apsm_context *ctx, model_folder *m)
{
    m->P = calloc(m->I * 3, m->J * sizeof *m->P);
    if (!m->P) return out_of_memory(ctx, m);
    APSM_TRY(apsm_parallel_for(ctx, m->I, read_world, m, NULL));
    return check_particles(ctx, m);
}

static apsm_status read_parts(apsm_context *ctx, unsigned parts, model_folder *m)
{
    APSM_TRY(read_project(ctx, m));
    APSM_TRY(read_model(ctx, m));
    if (parts & FOLDER_EVALUATED)
        APSM_TRY(read_json(ctx, m, FOLDER_EVALUATION, FORMAT_EVALUATION, EVALUATION_VERSION,
                           &m->evaluation));
    if (parts & FOLDER_CERTIFIED)
        APSM_TRY(read_json(ctx, m, FOLDER_CERTIFICATE, FORMAT_CERTIFICATE, CERTIFICATE_VERSION,
                           &m->certificate));
    if (parts & FOLDER_MANIFESTED)
        APSM_TRY(
            read_json(ctx, m, FOLDER_MANIFEST, FORMAT_MANIFEST, MANIFEST_VERSION, &m->manifest));
    APSM_TRY(find_template(ctx, m));
    APSM_TRY(read_parts_of_model(ctx, m));
    if (parts & (FOLDER_SCORES | FOLDER_PARTICLES)) APSM_TRY(read_scores(ctx, m));
    if (parts & FOLDER_PARTICLES) APSM_TRY(read_particles(ctx, m));
    return APSM_OK;
}

apsm_status model_folder_read(apsm_context *ctx, const char *path, unsigned parts, model_folder *m)
{
    *m = (model_folder){ .path = strdup(path) };
    if (!m->path) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    const apsm_status status = read_parts(ctx, parts, m);
    if (status != APSM_OK) model_folder_free(m);
    return status;
}

void model_folder_free(model_folder *m)
{
    json_decref(m->evaluation);
    json_decref(m->certificate);
    json_decref(m->manifest);
    apsm_shape_model_free(&m->model);
    apsm_project_free(&m->project);
    for (size_t d = 0; d < m->parts; d++) free(m->part[d].name);
    free(m->part);
    free(m->names);
    free(m->P);
    free(m->path);
    *m = (model_folder){ 0 };
}

/* ---- what is asked of it ---- */

void model_folder_to_world(const model_folder *m, size_t i, double M[16])
{
    const apsm_subject *s = &m->project.subjects[i];
    apsm_affine_multiply(s->procrustes, s->alignment, M);
}

static apsm_status part_to_world(apsm_context *ctx, const model_folder *m, size_t i, size_t d,
                                 double M[16])
{
    model_folder_to_world(m, i, M);
    if (d == 0) return APSM_OK;
    const char *text = part_column(m, i, d, "alignment");
    bool plain;
    if (!text || apsm_transform_parse(text, M, &plain) != 16)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: %s: alignment_%s is no transform; run again",
                         m->path, m->names[i], m->part[d].name);
    return APSM_OK;
}

apsm_status model_folder_part_mesh(apsm_context *ctx, const model_folder *m, size_t i, size_t d,
                                   apsm_mesh *mesh)
{
    const char *stored = d == 0 ? m->project.subjects[i].groomed : part_column(m, i, d, "groomed");
    double M[16];
    if (!stored) return stale(ctx, m, "a shape has no groomed mesh");
    APSM_TRY(part_to_world(ctx, m, i, d, M));
    char *path = apsm_project_path(&m->project, stored);
    if (!path) return out_of_memory(ctx, m);
    const apsm_status status = apsm_read_mesh(ctx, path, mesh);
    free(path);
    APSM_TRY(status);
    apsm_mesh_transform(mesh, M);
    return APSM_OK;
}

/* mesh <- mesh and more; more is freed. */
static apsm_status join(apsm_context *ctx, const model_folder *m, apsm_mesh *mesh, apsm_mesh *more)
{
    apsm_status status = APSM_OK;
    if (mesh->nv == 0) {
        *mesh = *more;
        *more = (apsm_mesh){ 0 };
    } else if (apsm_mesh_append(mesh, more) != APSM_OK) {
        status = out_of_memory(ctx, m);
    }
    apsm_mesh_free(more);
    return status;
}

apsm_status model_folder_mesh(apsm_context *ctx, const model_folder *m, size_t i, apsm_mesh *mesh)
{
    apsm_status status = APSM_OK;
    *mesh = (apsm_mesh){ 0 };
    for (size_t d = 0; d < m->parts && status == APSM_OK; d++) {
        apsm_mesh part = { 0 };
        status = model_folder_part_mesh(ctx, m, i, d, &part);
        if (status == APSM_OK) status = join(ctx, m, mesh, &part);
    }
    if (status != APSM_OK) apsm_mesh_free(mesh);
    return status;
}

apsm_status model_folder_local_particles(apsm_context *ctx, const model_folder *m, size_t i,
                                         double *p)
{
    return read_sets(ctx, m, i, false, p);
}

static bool says_certified(const json_t *object)
{
    const char *verdict = json_string_value(json_object_get(object, "verdict"));
    return verdict && strcmp(verdict, "certified") == 0;
}

bool model_folder_is_certified(const model_folder *m, size_t i)
{
    size_t k;
    const json_t *shape;
    json_array_foreach(json_object_get(m->certificate, "per_shape"), k, shape)
    {
        const char *name = json_string_value(json_object_get(shape, "name"));
        if (name && strcmp(name, m->names[i]) == 0) return says_certified(shape);
    }
    return false;
}

bool model_folder_is_all_certified(const model_folder *m)
{
    return says_certified(m->certificate);
}
