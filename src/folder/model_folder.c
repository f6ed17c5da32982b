#include "folder/model_folder.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/adapters.h"
#include "apsm/affine.h"
#include "apsm/files.h"
#include "apsm/particles_file.h"
#include "folder/model_json.h"
#include "folder/names.h"

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

static apsm_status read_set(apsm_context *ctx, const model_folder *m, const char *stored, double *p)
{
    if (!stored) return stale(ctx, m, "a shape has no particles");
    char *path = apsm_project_path(&m->project, stored);
    if (!path) return out_of_memory(ctx, m);
    const apsm_status status = apsm_particles_read_n(ctx, path, m->J, p);
    free(path);
    return status;
}

static apsm_status read_world(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    model_folder *m = user;
    return read_set(ctx, m, m->project.subjects[i].world_particles, m->P + i * m->J * 3);
}

static apsm_status read_particles(apsm_context *ctx, model_folder *m)
{
    m->P = calloc(m->I * 3, m->J * sizeof *m->P);
    if (!m->P) return out_of_memory(ctx, m);
    return apsm_parallel_for(ctx, m->I, read_world, m, NULL);
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
    if (parts & FOLDER_SCORES) APSM_TRY(read_scores(ctx, m));
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

apsm_status model_folder_mesh(apsm_context *ctx, const model_folder *m, size_t i, apsm_mesh *mesh)
{
    const apsm_subject *s = &m->project.subjects[i];
    double M[16];
    if (!s->groomed) return stale(ctx, m, "a shape has no groomed mesh");
    char *path = apsm_project_path(&m->project, s->groomed);
    if (!path) return out_of_memory(ctx, m);
    const apsm_status status = apsm_vtk_read_mesh(ctx, path, mesh);
    free(path);
    APSM_TRY(status);
    model_folder_to_world(m, i, M);
    apsm_mesh_transform(mesh, M);
    return APSM_OK;
}

apsm_status model_folder_local_particles(apsm_context *ctx, const model_folder *m, size_t i,
                                         double *p)
{
    return read_set(ctx, m, m->project.subjects[i].local_particles, p);
}

apsm_status model_folder_options(apsm_context *ctx, const model_folder *m, apsm_options *options)
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    *options = apsm_options_defaults();
    for (size_t k = 0; k < n; k++) {
        const char *value = apsm_project_get(&m->project, "apsm", table[k].name);
        if (value) APSM_TRY(apsm_options_set(ctx, options, table[k].name, value));
    }
    return APSM_OK;
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
