/* The manifest of a model of contours: what was asked for, of which inputs, and all files.  It is
 * there from the beginning, without files as long as the job has not ended. */
#include <stdlib.h>
#include <string.h>

#include "assemble/contour_job.h"
#include "files/files.h"
#include "folder/manifest_json.h"
#include "folder/names.h"

static apsm_status no_memory(const contour_job *j)
{
    return apsm_fail(j->ctx, APSM_ERR_MEMORY, "%s: out of memory", j->folder);
}

static json_t *options_of(const contour_job *j)
{
    json_t *options = json_object();
    for (size_t k = 0; k < j->settings->n_set; k++)
        json_object_set_new(options, j->settings->set[k][0], json_string(j->settings->set[k][1]));
    return options;
}

/* *inputs: a new reference, names, paths and SHA-256. */
static apsm_status inputs_of(const contour_job *j, json_t **inputs)
{
    const size_t n = j->list.n;
    const char **paths = calloc(n + 1, sizeof *paths);
    char(*sha256)[65] = calloc(n + 1, sizeof *sha256);
    apsm_status status = paths && sha256 ? APSM_OK : no_memory(j);
    for (size_t i = 0; i < n && status == APSM_OK; i++) {
        paths[i] = j->list.cases[i].path;
        status = apsm_sha256_file(j->ctx, paths[i], sha256[i]);
    }
    *inputs = status == APSM_OK ? manifest_json_inputs(n, j->names, paths, sha256) : NULL;
    if (status == APSM_OK && !*inputs) status = no_memory(j);
    free(paths);
    free(sha256);
    return status;
}

/* As it is now: with outputs (taken over) the job has ended. */
static apsm_status write_manifest(const contour_job *j, json_t *outputs)
{
    json_t *inputs = NULL, *root = NULL;
    char *path = contour_path(j, FOLDER_MANIFEST);
    apsm_status status = path && outputs ? inputs_of(j, &inputs) : no_memory(j);
    if (status == APSM_OK)
        root = json_pack("{s:s, s:i, s:s, s:o, s:o, s:{}, s:O, s:{s:b}}", "format", FORMAT_MANIFEST,
                         "version", MANIFEST_VERSION, "apsm", APSM_VERSION, "options",
                         options_of(j), "inputs", inputs, "stages", "outputs", outputs, "contours",
                         "finished", json_object_size(outputs) > 0);
    if (status == APSM_OK) status = apsm_json_write_sealed(j->ctx, path, root);
    json_decref(root);
    json_decref(outputs);
    free(path);
    return status;
}

/* ---- the beginning ---- */

static apsm_status read_manifest(apsm_context *ctx, const char *folder, json_t **root)
{
    bool intact;
    char *path = apsm_path_join(folder, FOLDER_MANIFEST);
    *root = NULL;
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status =
        apsm_file_exists(path) ? manifest_json_read(ctx, path, root, &intact) : APSM_OK;
    free(path);
    return status;
}

apsm_status contour_folder_is_ours(apsm_context *ctx, const char *folder, bool *ours)
{
    json_t *root;
    APSM_TRY(read_manifest(ctx, folder, &root));
    *ours = manifest_json_is_contours(root);
    json_decref(root);
    return APSM_OK;
}

/* --resume goes on with the same job only. */
static apsm_status compare(const contour_job *j, const json_t *before)
{
    json_t *options = options_of(j), *inputs = NULL;
    apsm_status status = inputs_of(j, &inputs);
    if (status == APSM_OK && !json_equal(options, json_object_get(before, "options")))
        status = apsm_fail(j->ctx, APSM_ERR_STATE,
                           "%s: was begun with other options; give the same, or start anew with "
                           "--overwrite",
                           j->folder);
    if (status == APSM_OK && !json_equal(inputs, json_object_get(before, "inputs")))
        status = apsm_fail(j->ctx, APSM_ERR_STATE,
                           "%s: was begun with other contours, or they have changed since; start "
                           "anew with --overwrite",
                           j->folder);
    json_decref(options);
    json_decref(inputs);
    return status;
}

/* Whether all files are what they were when the job ended. */
static apsm_status check_outputs(const contour_job *j, json_t *outputs)
{
    const char *name;
    json_t *record;
    json_object_foreach(outputs, name, record)
    {
        const char *was = json_string_value(json_array_get(record, 2));
        char hex[65], *path = contour_path(j, name);
        if (!path) return no_memory(j);
        const bool same =
            was && apsm_sha256_file(j->ctx, path, hex) == APSM_OK && strcmp(hex, was) == 0;
        free(path);
        if (!same)
            return apsm_fail(j->ctx, APSM_ERR_STATE,
                             "%s/%s: removed or changed since it was written; put it back, or "
                             "start anew with --overwrite",
                             j->folder, name);
    }
    return APSM_OK;
}

static apsm_status settle(const contour_job *j, const json_t *before, bool *done)
{
    const apsm_run_settings *s = j->settings;
    const json_t *contours = json_object_get(before, "contours");
    *done = false;
    if (!json_is_object(contours))
        return apsm_fail(j->ctx, APSM_ERR_STATE,
                         "%s: is not empty; a model of contours needs a new folder", j->folder);
    if (s->resume) {
        APSM_TRY(compare(j, before));
        *done = json_is_true(json_object_get(contours, "finished"));
        return *done ? check_outputs(j, json_object_get(before, "outputs")) : APSM_OK;
    }
    if (s->overwrite) return APSM_OK;
    return apsm_fail(j->ctx, APSM_ERR_STATE,
                     "%s: is not empty: it holds a model of contours; continue it with --resume, "
                     "replace it with --overwrite, or choose another folder",
                     j->folder);
}

apsm_status contour_begin_folder(const contour_job *j, bool *done)
{
    apsm_file_list files = { 0 };
    json_t *before = NULL;
    *done = false;
    APSM_TRY(apsm_make_folder(j->ctx, j->folder));
    APSM_TRY(apsm_list_files(j->ctx, j->folder, true, &files));
    const size_t n = files.n;
    apsm_file_list_free(&files);
    if (n > 0) {
        APSM_TRY(read_manifest(j->ctx, j->folder, &before));
        const apsm_status status = settle(j, before, done);
        json_decref(before);
        APSM_TRY(status);
    }
    return *done ? APSM_OK : write_manifest(j, json_object());
}

/* ---- the end ---- */

static apsm_status list_file(const contour_job *j, const char *name, json_t *outputs)
{
    char hex[65], *path = contour_path(j, name);
    long long bytes = 0;
    apsm_status status = path ? apsm_sha256_file(j->ctx, path, hex) : no_memory(j);
    if (status == APSM_OK) status = apsm_file_size(j->ctx, path, &bytes);
    free(path);
    APSM_TRY(status);
    json_t *record = json_pack("[s, I, s]", "contours", (json_int_t)bytes, hex);
    return json_object_set_new(outputs, name, record) == 0 ? APSM_OK : no_memory(j);
}

apsm_status contour_end_folder(const contour_job *j)
{
    json_t *outputs = json_object();
    apsm_file_list files = { 0 };
    apsm_status status = outputs ? apsm_list_files(j->ctx, j->folder, true, &files) : no_memory(j);
    for (size_t k = 0; k < files.n && status == APSM_OK; k++)
        if (strcmp(files.path[k], FOLDER_MANIFEST) != 0)
            status = list_file(j, files.path[k], outputs);
    apsm_file_list_free(&files);
    if (status == APSM_OK) return write_manifest(j, outputs);
    json_decref(outputs);
    return status;
}
