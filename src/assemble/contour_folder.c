/* The folder of a model of contours.  Its manifest says what was asked for, of which inputs, and
 * which files are the job's: while it writes, "files" names those of a model before and those that
 * come, and "outputs" is empty; then "outputs" lists what was written, and the others of a model
 * before are gone.  Nobody else's file is listed, replaced or removed. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

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

/* outputs and files: taken over.  Without outputs the job has not ended. */
static apsm_status write_manifest(const contour_job *j, json_t *outputs, json_t *files)
{
    json_t *inputs = NULL, *root = NULL, *contours = NULL;
    char *path = contour_path(j, FOLDER_MANIFEST);
    apsm_status status = path && outputs && files ? inputs_of(j, &inputs) : no_memory(j);
    if (status == APSM_OK) {
        const bool finished = json_object_size(outputs) > 0;
        contours = finished ? json_pack("{s:b}", "finished", 1)
                            : json_pack("{s:b, s:O}", "finished", 0, "files", files);
        root =
            json_pack("{s:s, s:i, s:s, s:o, s:o, s:{}, s:O, s:o}", "format", FORMAT_MANIFEST,
                      "version", MANIFEST_VERSION, "apsm", APSM_VERSION, "options", options_of(j),
                      "inputs", inputs, "stages", "outputs", outputs, "contours", contours);
    }
    if (status == APSM_OK) status = apsm_json_write_sealed(j->ctx, path, root);
    json_decref(root);
    json_decref(outputs);
    json_decref(files);
    free(path);
    return status;
}

/* ---- the beginning ---- */

static apsm_status read_manifest(apsm_context *ctx, const char *folder, json_t **root, bool *intact)
{
    char *path = apsm_path_join(folder, FOLDER_MANIFEST);
    *root = NULL;
    *intact = true;
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status =
        apsm_file_exists(path) ? manifest_json_read(ctx, path, root, intact) : APSM_OK;
    free(path);
    return status;
}

apsm_status contour_folder_is_ours(apsm_context *ctx, const char *folder, bool *ours)
{
    json_t *root;
    bool intact;
    APSM_TRY(read_manifest(ctx, folder, &root, &intact));
    *ours = manifest_json_is_contours(root);
    json_decref(root);
    return APSM_OK;
}

/* *names: a new array of the files that a manifest says are the job's and that can be: its seal
 * does not tell who wrote it. */
static apsm_status files_of(const contour_job *j, const json_t *before, json_t **names)
{
    const char *name;
    json_t *value, *files = json_object_get(json_object_get(before, "contours"), "files");
    size_t k;
    *names = json_array();
    int failed = !*names;
    json_object_foreach(json_object_get((json_t *)before, "outputs"), name, value)
    {
        if (contour_may_name(name))
            failed = failed || json_array_append_new(*names, json_string(name));
    }
    json_array_foreach(files, k, value)
    {
        if (json_is_string(value) && contour_may_name(json_string_value(value)))
            failed = failed || json_array_append(*names, value);
    }
    return failed ? no_memory(j) : APSM_OK;
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
        if (!contour_may_name(name)) continue;
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

/* Refuses to build on a manifest that was changed: what it lists may be anybody's. */
static apsm_status look_at_model(contour_job *j, bool *done)
{
    json_t *before;
    bool intact;
    APSM_TRY(read_manifest(j->ctx, j->folder, &before, &intact));
    apsm_status status = settle(j, before, done);
    if (status == APSM_OK && !intact)
        status = apsm_fail(j->ctx, APSM_ERR_STATE,
                           "%s/%s: changed since apsm wrote it; put it back, or make the model "
                           "anew in another folder",
                           j->folder, FOLDER_MANIFEST);
    if (status == APSM_OK) status = files_of(j, before, &j->files);
    json_decref(before);
    return status;
}

apsm_status contour_look_at_folder(contour_job *j, bool *done)
{
    apsm_file_list files = { 0 };
    *done = false;
    if (!apsm_is_folder(j->folder)) return APSM_OK;
    APSM_TRY(apsm_list_files(j->ctx, j->folder, true, &files));
    const size_t n = files.n;
    apsm_file_list_free(&files);
    return n > 0 ? look_at_model(j, done) : APSM_OK;
}

static bool is_listed(const json_t *names, const char *name)
{
    size_t k;
    json_t *one;
    json_array_foreach(names, k, one)
    {
        if (strcmp(json_string_value(one), name) == 0) return true;
    }
    return false;
}

/* A file that is there and is not the job's is not replaced. */
static apsm_status check_owner(const contour_job *j, const char *name)
{
    char *path = contour_path(j, name);
    if (!path) return no_memory(j);
    const bool foreign = apsm_file_exists(path) && !is_listed(j->files, name);
    free(path);
    if (!foreign) return APSM_OK;
    return apsm_fail(j->ctx, APSM_ERR_STATE,
                     "%s/%s: was not written by apsm and would be replaced; move it away, or "
                     "choose another folder",
                     j->folder, name);
}

apsm_status contour_begin_folder(contour_job *j)
{
    size_t k;
    json_t *one, *names = NULL;
    if (!j->files) j->files = json_array();
    apsm_status status = j->files ? contour_names(j, &names) : no_memory(j);
    json_array_foreach(names, k, one)
    {
        if (status == APSM_OK) status = check_owner(j, json_string_value(one));
        if (status == APSM_OK && !is_listed(j->files, json_string_value(one)) &&
            json_array_append(j->files, one))
            status = no_memory(j);
    }
    json_decref(names);
    if (status == APSM_OK) status = apsm_make_folder(j->ctx, j->folder);
    return status == APSM_OK ? write_manifest(j, json_object(), json_incref(j->files)) : status;
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

/* Of a model before that had more contours, or more modes. */
static apsm_status remove_file(const contour_job *j, const char *name)
{
    char *path = contour_path(j, name);
    if (!path) return no_memory(j);
    const bool gone = unlink(path) == 0 || errno == ENOENT;
    free(path);
    return gone ? APSM_OK
                : apsm_fail(j->ctx, APSM_ERR_IO, "%s/%s: cannot be removed: %s", j->folder, name,
                            strerror(errno));
}

apsm_status contour_end_folder(const contour_job *j)
{
    size_t k;
    json_t *one, *names = NULL, *outputs = json_object();
    apsm_status status = outputs ? contour_names(j, &names) : no_memory(j);
    json_array_foreach(names, k, one)
    {
        if (status == APSM_OK) status = list_file(j, json_string_value(one), outputs);
    }
    json_array_foreach(j->files, k, one)
    {
        if (status == APSM_OK && !is_listed(names, json_string_value(one)))
            status = remove_file(j, json_string_value(one));
    }
    json_decref(names);
    if (status == APSM_OK) return write_manifest(j, outputs, json_array());
    json_decref(outputs);
    return status;
}
