/* Whether a model folder is still what its manifest says: files, options, inputs.  Everything is
 * read, nothing written; what disagrees is told in one line each. */
#include <jansson.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"
#include "core/sized.h"
#include "folder/manifest_json.h"
#include "run/input_check.h"
#include "run/state.h"
#include "session/manifest.h"
#include "session/outputs.h"
#include "session/session.h"

typedef void (*line_fn)(void *user, const char *line);

typedef struct verifying {
    apsm_context *ctx;
    const char *folder;
    line_fn report, note;
    void *user;
    apsm_verification *result;
    apsm_run *run;
} verifying;

static void say(const verifying *v, line_fn to, const char *format, va_list args)
{
    char line[1024];
    apsm_vprint(line, sizeof line, format, args);
    to(v->user, line);
}

static void disagree(const verifying *v, const char *format, ...) APSM_PRINTF(2, 3);
static void disagree(const verifying *v, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    say(v, v->report, format, args);
    va_end(args);
    v->result->problems++;
}

static void remark(const verifying *v, const char *format, ...) APSM_PRINTF(2, 3);
static void remark(const verifying *v, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    say(v, v->note, format, args);
    va_end(args);
}

/* ---- files of the folder ---- */

static const char *what_happened(output_state state)
{
    static const char *const words[] = { "the same", "changed", "missing", "cannot be read" };
    return words[state];
}

static const output *find_output(const output *list, size_t n, const char *path)
{
    for (size_t lo = 0, hi = n; lo < hi;) {
        const size_t mid = (lo + hi) / 2;
        const int order = strcmp(list[mid].path, path);
        if (order == 0) return &list[mid];
        if (order < 0)
            lo = mid + 1;
        else
            hi = mid;
    }
    return NULL;
}

static bool is_finished(const verifying *v)
{
    for (size_t k = 0; stage_name(k); k++)
        if (!stage_is_done(v->run, stage_name(k))) return false;
    return true;
}

/* Pictures and results of statistics are of verbs of their own, and can be made again at any time.
 */
static bool is_picture(const char *file)
{
    return strncmp(file, "pictures/", 9) == 0 || strncmp(file, "statistics/", 11) == 0;
}

/* Whether the file is one of the run's inputs: people keep them in the model folder, too. */
static bool is_input(const verifying *v, const char *file)
{
    const apsm_project *project = &v->run->project;
    for (size_t i = 0; i < project->n; i++) {
        const char *shape = project->subjects[i].shape;
        const size_t n = shape ? strlen(shape) : 0;
        if (n > 0 && strncmp(shape, file, n) == 0 && (file[n] == '\0' || file[n] == '/'))
            return true;
    }
    return false;
}

static void judge_unknown(const verifying *v, const char *file, bool finished)
{
    if (folder_left_over(file))
        remark(v, "%s: left over from a run that was ended; the next run removes it", file);
    else if (strcmp(file, RUN_JOURNAL) == 0)
        remark(v, "%s: finished shapes of a run that was ended; `apsm run --resume -o %s` goes on",
               file, v->folder);
    else if (finished && strcmp(file, "report.html") == 0)
        remark(v, "%s: may be older than the model; `apsm report %s` makes it anew", file,
               v->folder);
    else if (!folder_is_ours(file))
        disagree(v, "%s: unexpected, not written by apsm", file);
    else if (finished)
        disagree(v, "%s: unexpected, not of this model", file);
}

static apsm_status look_for_others(const verifying *v, const output *list, size_t n)
{
    apsm_file_list files;
    const bool finished = is_finished(v);
    APSM_TRY(apsm_list_files(v->ctx, v->folder, true, &files));
    for (size_t k = 0; k < files.n; k++) {
        const char *file = files.path[k];
        if (strcmp(file, RUN_MANIFEST) == 0 || strcmp(file, ".apsm.lock") == 0) continue;
        if (!find_output(list, n, file) && !is_input(v, file) && !is_picture(file))
            judge_unknown(v, file, finished);
    }
    apsm_file_list_free(&files);
    return APSM_OK;
}

/* A joint of several parts: what it has of its own, then every part's folder. */
static bool is_joint(const verifying *v)
{
    return manifest_is_joint(v->run);
}

/* A model of contours has no stages. */
static bool is_contours(const verifying *v)
{
    return manifest_json_is_contours(v->run->manifest);
}

static apsm_status verify_outputs(const verifying *v)
{
    output *list = NULL;
    size_t n = 0;
    apsm_status status = outputs_compare(v->run, &list, &n);
    for (size_t k = 0; k < n && status == APSM_OK; k++)
        if (list[k].state != OUTPUT_SAME)
            disagree(v, "%s: %s since %s wrote it", list[k].path, what_happened(list[k].state),
                     list[k].stage);
    v->result->outputs = n;
    if (status == APSM_OK && !is_joint(v) && !is_contours(v)) status = look_for_others(v, list, n);
    free(list);
    return status;
}

/* ---- options ---- */

static void verify_option(const verifying *v, const char *key, const char *in_manifest,
                          const char *in_project)
{
    if (in_manifest && in_project && strcmp(in_manifest, in_project) == 0) return;
    disagree(v, "option %s: %s in %s, %s in %s", key, in_manifest ? in_manifest : "not",
             RUN_MANIFEST, in_project ? in_project : "not", RUN_PROJECT);
}

/* The project as it is in its file; opening a run has filled in what was missing there.  While a
 * step is unfinished, the project may be ahead of the manifest. */
static apsm_status verify_options(const verifying *v)
{
    const json_t *outputs = json_object_get(v->run->manifest, "outputs");
    if (!json_object_get(outputs, RUN_PROJECT)) return APSM_OK;
    json_t *options = json_object_get(v->run->manifest, "options");
    apsm_project project = { 0 };
    const char *key, *value;
    json_t *stored;
    char *path = run_path(v->run, RUN_PROJECT);
    if (!path) return APSM_ERR_MEMORY;
    const bool exists = apsm_file_exists(path);
    const apsm_status status = exists ? apsm_project_read(v->ctx, path, &project) : APSM_OK;
    free(path);
    if (status != APSM_OK || !exists) return status;
    json_object_foreach(options, key, stored)
    {
        verify_option(v, key, json_string_value(stored), apsm_project_get(&project, "apsm", key));
    }
    for (size_t k = 0; k < apsm_project_count(&project, "apsm"); k++) {
        apsm_project_pair(&project, "apsm", k, &key, &value);
        if (!json_object_get(options, key)) verify_option(v, key, NULL, value);
    }
    apsm_project_free(&project);
    return APSM_OK;
}

/* A checkpoint knows which options and groomed shapes it belongs to. */
static apsm_status verify_checkpoint(const verifying *v, const char *name)
{
    apsm_optimizer_state state = { 0 };
    char *path = run_path(v->run, name);
    if (!path) return APSM_ERR_MEMORY;
    const bool exists = apsm_file_exists(path);
    free(path);
    if (!exists) return APSM_OK;
    const apsm_status status = run_load_state(v->run, name, &state, NULL, NULL);
    if (status == APSM_ERR_MEMORY) return status;
    if (status != APSM_OK) disagree(v, "%s", apsm_error_text(v->ctx));
    apsm_optimizer_state_free(&state);
    return APSM_OK;
}

/* If the files are what they were; otherwise the checkpoints would only repeat what has been told.
 * Another version of apsm has other options, and so other checkpoints. */
static apsm_status verify_checkpoints(const verifying *v)
{
    const char *version = json_string_value(json_object_get(v->run->manifest, "apsm"));
    if (v->result->problems > 0) return APSM_OK;
    if (!version || strcmp(version, APSM_VERSION) != 0) {
        remark(v, "made by apsm %s: whether the options fit the checkpoints was not looked at",
               version ? version : "of an unknown version");
        return APSM_OK;
    }
    APSM_TRY(verify_checkpoint(v, RUN_INITIAL));
    return verify_checkpoint(v, RUN_CHECKPOINT);
}

/* ---- inputs ---- */

static void judge_input(const verifying *v, const input_check *c)
{
    if (c->state == INPUT_CHANGED)
        disagree(v, "input %s: %s: changed since it was groomed", c->name, c->path);
    if (c->state == INPUT_MISSING)
        disagree(v, "input %s: %s: missing; removed or moved", c->name, c->path);
    if (c->state == INPUT_UNKNOWN)
        disagree(v, "input %s: no SHA-256 recorded; groom again", c->name);
}

static apsm_status verify_inputs(const verifying *v)
{
    input_check *checks = NULL;
    size_t n = 0;
    const apsm_status status = input_check_all(v->run, NULL, &checks, &n);
    for (size_t i = 0; i < n && status == APSM_OK; i++) judge_input(v, &checks[i]);
    v->result->inputs = n;
    free(checks);
    return status;
}

/* ---- all ---- */

/* *usable: there is a manifest that can be followed; if not, a line has been told. */
static apsm_status verify_manifest(const verifying *v, const char *path, bool *usable)
{
    bool intact = false;
    json_t *root = NULL;
    *usable = false;
    apsm_status status = apsm_json_is_intact(v->ctx, path, &intact);
    if (status == APSM_OK) status = apsm_json_read(v->ctx, path, &root);
    *usable = json_is_object(json_object_get(root, "outputs"));
    json_decref(root);
    if (status == APSM_ERR_MEMORY) return status;
    if (status != APSM_OK)
        disagree(v, "%s", apsm_error_text(v->ctx));
    else if (!*usable)
        disagree(v, "%s: lists no files; the folder was made by an older apsm, or it is damaged",
                 RUN_MANIFEST);
    else if (!intact)
        disagree(v, "%s: changed since apsm wrote it", RUN_MANIFEST);
    return APSM_OK;
}

static apsm_status verify_contours(const verifying *v)
{
    const json_t *said = json_object_get(v->run->manifest, "contours");
    if (!json_is_true(json_object_get(said, "finished")))
        remark(v, "unfinished: the model has not been made; run again with --resume");
    return verify_inputs(v);
}

static void tell_unfinished(const verifying *v)
{
    for (size_t k = 0; stage_name(k); k++) {
        if (stage_is_done(v->run, stage_name(k))) continue;
        remark(v, "unfinished: %s has not ended; go on with `apsm run --resume -o %s`",
               stage_name(k), v->folder);
        return;
    }
}

static apsm_status verify_part(const verifying *v, const char *name)
{
    apsm_verification part = { 0 };
    char *parts = apsm_path_join(v->folder, "parts");
    char *folder = parts ? apsm_path_join(parts, name) : NULL;
    const apsm_status status =
        folder ? apsm_run_verify(v->ctx, folder, v->report, v->note, v->user, &part)
               : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        if (part.problems > 0) remark(v, "(%zu of these in %s)", part.problems, folder);
        v->result->outputs += part.outputs;
        v->result->inputs += part.inputs;
        v->result->problems += part.problems;
    }
    free(folder);
    free(parts);
    return status;
}

static apsm_status verify_parts(const verifying *v)
{
    size_t d;
    const json_t *part,
        *parts = json_object_get(json_object_get(v->run->manifest, "joint"), "parts");
    json_array_foreach(parts, d, part)
    {
        const char *name = json_string_value(json_object_get(part, "name"));
        if (name && !strchr(name, '/')) APSM_TRY(verify_part(v, name));
    }
    if (json_array_size(parts) == 0)
        remark(v, "unfinished: the joint has not been made; run again with --resume");
    return APSM_OK;
}

static apsm_status verify_opened(const verifying *v)
{
    APSM_TRY(verify_outputs(v));
    if (is_joint(v)) return verify_parts(v);
    if (is_contours(v)) return verify_contours(v);
    APSM_TRY(verify_options(v));
    APSM_TRY(verify_checkpoints(v));
    APSM_TRY(verify_inputs(v));
    tell_unfinished(v);
    return APSM_OK;
}

/* Files and inputs of a folder whose project cannot be used. */
static apsm_status verify_without_project(verifying *v)
{
    const apsm_run_settings settings = { .folder = v->folder, .dry = true, .fresh = true };
    char *why = strdup(apsm_error_text(v->ctx));
    apsm_status status = why ? apsm_run_open(v->ctx, &settings, &v->run) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = verify_outputs(v);
    if (status == APSM_OK && v->result->problems == 0) disagree(v, "%s", why);
    if (status == APSM_OK) status = verify_inputs(v);
    free(why);
    return status;
}

static apsm_status verify_folder(verifying *v)
{
    const apsm_run_settings settings = { .folder = v->folder, .dry = true };
    apsm_status status = apsm_run_open(v->ctx, &settings, &v->run);
    if (status == APSM_OK)
        status = verify_opened(v);
    else if (status != APSM_ERR_MEMORY)
        status = verify_without_project(v);
    apsm_run_close(v->run);
    v->run = NULL;
    return status;
}

static bool has_begun(const char *folder)
{
    char *path = apsm_path_join(folder, RUN_JOURNAL);
    const bool begun = path && apsm_file_exists(path);
    free(path);
    return begun;
}

apsm_status apsm_run_verify_sized(apsm_context *ctx, const char *folder,
                                  void (*report)(void *user, const char *line),
                                  void (*note)(void *user, const char *line), void *user,
                                  apsm_verification *result, size_t size)
{
    apsm_verification found = { 0 };
    verifying v = { ctx, folder, report, note, user, &found, NULL };
    APSM_TRY(apsm_require_folder(ctx, folder));
    char *path = apsm_path_join(folder, RUN_MANIFEST);
    if (!path) return APSM_ERR_MEMORY;
    bool usable = false;
    apsm_status status = APSM_OK;
    if (!apsm_file_exists(path) && has_begun(folder))
        status = apsm_fail(ctx, APSM_ERR_STATE,
                           "%s: grooming has not ended; go on with `apsm run --resume -o %s`",
                           folder, folder);
    else if (!apsm_file_exists(path))
        status = apsm_fail(ctx, APSM_ERR_STATE,
                           "%s: no %s in this folder; give a folder made by `apsm run`", folder,
                           RUN_MANIFEST);
    else
        status = verify_manifest(&v, path, &usable);
    if (status == APSM_OK && usable) status = verify_folder(&v);
    apsm_give_sized(&found, sizeof found, result, size);
    free(path);
    return status;
}
