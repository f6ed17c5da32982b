#include "report/model_folder.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/adapters.h"
#include "apsm/affine.h"
#include "apsm/files.h"
#include "apsm/particles_file.h"

/* The newest versions of the files that this room understands (docs/formats.md). */
enum { MODEL_VERSION = 1, EVALUATION_VERSION = 1, CERTIFICATE_VERSION = 1, MANIFEST_VERSION = 1 };

static apsm_status stale(apsm_context *ctx, const model_folder *m, const char *what)
{
    return apsm_fail(ctx, APSM_ERR_STATE, "%s: %s; run `apsm evaluate %s` first", m->path, what,
                     m->path);
}

static apsm_status read_json(apsm_context *ctx, const model_folder *m, const char *name,
                             const char *format, int version, json_t **root)
{
    char *path = apsm_path_join(m->path, name);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_file_exists(path) ? apsm_json_read(ctx, path, root)
                                                : stale(ctx, m, "there is no model yet");
    if (status == APSM_OK) status = apsm_json_check(ctx, path, *root, format, version);
    free(path);
    return status;
}

static apsm_status read_project(apsm_context *ctx, model_folder *m)
{
    char *path = apsm_path_join(m->path, "project.swproj");
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status =
        apsm_file_exists(path)
            ? apsm_project_read(ctx, path, &m->project)
            : apsm_fail(ctx, APSM_ERR_STATE,
                        "%s: no project.swproj in this folder; give a folder made by `apsm run`",
                        m->path);
    free(path);
    return status;
}

static size_t get_size(const json_t *object, const char *key)
{
    const json_int_t n = json_integer_value(json_object_get(object, key));
    return n > 0 ? (size_t)n : 0;
}

static bool get_modes(const json_t *modes, model_folder *m)
{
    for (size_t k = 0; k < m->modes; k++)
        if (!apsm_json_get_matrix(json_array_get(modes, k), m->J, 3, m->mode + k * m->J * 3))
            return false;
    return true;
}

/* Mean, modes and variances of model.json. */
static apsm_status take_model(apsm_context *ctx, const json_t *root, model_folder *m)
{
    const json_t *modes = json_object_get(root, "modes");
    m->I = get_size(root, "shapes");
    m->J = get_size(root, "particles");
    m->modes = json_array_size(modes);
    if (m->I != m->project.n) return stale(ctx, m, "model.json is of other shapes");
    if (m->I == 0 || m->J == 0) return stale(ctx, m, "model.json holds no model");
    m->P = malloc(m->I * m->J * 3 * sizeof *m->P);
    m->mean = malloc(m->J * 3 * sizeof *m->mean);
    m->mode = malloc((m->modes * m->J * 3 + 1) * sizeof *m->mode);
    m->variance = malloc((m->modes + 1) * sizeof *m->variance);
    if (!m->P || !m->mean || !m->mode || !m->variance) return APSM_ERR_MEMORY;
    if (!apsm_json_get_matrix(json_object_get(root, "mean"), m->J, 3, m->mean) ||
        !apsm_json_get_matrix(json_object_get(root, "variances"), m->modes, 0, m->variance) ||
        !get_modes(modes, m))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s/model.json: mean, modes and variances do not fit each other; run "
                         "`apsm evaluate %s`",
                         m->path, m->path);
    return APSM_OK;
}

static apsm_status read_model(apsm_context *ctx, model_folder *m)
{
    json_t *root = NULL;
    apsm_status status = read_json(ctx, m, "model.json", "apsm-model", MODEL_VERSION, &root);
    if (status == APSM_OK) status = take_model(ctx, root, m);
    json_decref(root);
    return status;
}

static apsm_status read_particles(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    model_folder *m = user;
    const char *stored = m->project.subjects[i].world_particles;
    if (!stored) return stale(ctx, m, "a shape has no particles");
    char *path = apsm_project_path(&m->project, stored);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_particles_read_n(ctx, path, m->J, m->P + i * m->J * 3);
    free(path);
    return status;
}

static apsm_status find_template(apsm_context *ctx, model_folder *m)
{
    const char *name = json_string_value(json_object_get(m->evaluation, "template"));
    m->template_index = name ? apsm_project_find(&m->project, name) : m->I;
    return m->template_index < m->I ? APSM_OK : stale(ctx, m, "evaluation.json names no template");
}

apsm_status model_folder_read(apsm_context *ctx, const char *path, model_folder *m)
{
    *m = (model_folder){ .path = path };
    APSM_TRY(read_project(ctx, m));
    APSM_TRY(read_model(ctx, m));
    APSM_TRY(read_json(ctx, m, "evaluation.json", "apsm-evaluation", EVALUATION_VERSION,
                       &m->evaluation));
    APSM_TRY(read_json(ctx, m, "certificate.json", "apsm-certificate", CERTIFICATE_VERSION,
                       &m->certificate));
    APSM_TRY(read_json(ctx, m, "manifest.json", "apsm-manifest", MANIFEST_VERSION, &m->manifest));
    APSM_TRY(find_template(ctx, m));
    return apsm_parallel_for(ctx, m->I, read_particles, m, NULL);
}

void model_folder_free(model_folder *m)
{
    json_decref(m->evaluation);
    json_decref(m->certificate);
    json_decref(m->manifest);
    free(m->P);
    free(m->mean);
    free(m->mode);
    free(m->variance);
    apsm_project_free(&m->project);
    *m = (model_folder){ 0 };
}

apsm_status model_folder_mesh(apsm_context *ctx, const model_folder *m, size_t i, apsm_mesh *mesh)
{
    const apsm_subject *s = &m->project.subjects[i];
    double M[16];
    if (!s->groomed) return stale(ctx, m, "a shape has no groomed mesh");
    char *path = apsm_project_path(&m->project, s->groomed);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_vtk_read_mesh(ctx, path, mesh);
    free(path);
    APSM_TRY(status);
    apsm_affine_multiply(s->procrustes, s->alignment, M);
    apsm_mesh_transform(mesh, M);
    return APSM_OK;
}
