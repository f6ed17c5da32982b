#define _DEFAULT_SOURCE /* getrusage's maxrss */
#include "run/manifest.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "folder/names.h"
#include "run/outputs.h"

/* In their order.  The report is none to be timed: it tells the times of the others. */
static const char *const stages[] = { "groom", "initialize", "optimize", "evaluate", "report" };
enum { STAGES = sizeof stages / sizeof stages[0] };

static apsm_status no_memory(apsm_run *run)
{
    return apsm_fail(run->ctx, APSM_ERR_MEMORY, "%s: out of memory for the manifest",
                     run->folder ? run->folder : "job");
}

static json_t *new_manifest(void)
{
    return json_pack("{s:s, s:i, s:s, s:{}, s:[], s:{}, s:{}}", "format", FORMAT_MANIFEST,
                     "version", MANIFEST_VERSION, "apsm", APSM_VERSION, "options", "inputs",
                     "stages", "outputs");
}

static apsm_status check_shape(apsm_run *run, const char *path)
{
    APSM_TRY(apsm_json_check(run->ctx, path, run->manifest, FORMAT_MANIFEST, MANIFEST_VERSION));
    if (json_is_object(json_object_get(run->manifest, "options")) &&
        json_is_array(json_object_get(run->manifest, "inputs")) &&
        json_is_object(json_object_get(run->manifest, "stages")))
        return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_FORMAT,
                     "%s: lacks options, inputs or stages; remove it and groom again", path);
}

apsm_status manifest_open(apsm_run *run)
{
    run->is_intact = true;
    if (run_is_in_memory(run)) {
        run->manifest = new_manifest();
        return run->manifest ? APSM_OK : no_memory(run);
    }
    char *path = run_path(run, RUN_MANIFEST);
    if (!path) return no_memory(run);
    apsm_status status = APSM_OK;
    if (apsm_file_exists(path)) {
        run->has_manifest = true;
        status = apsm_json_read(run->ctx, path, &run->manifest);
        if (status == APSM_OK) status = check_shape(run, path);
        if (status == APSM_OK) status = apsm_json_is_intact(run->ctx, path, &run->is_intact);
    } else {
        run->manifest = new_manifest();
        if (!run->manifest) status = no_memory(run);
    }
    free(path);
    return status;
}

apsm_status manifest_check_seal(apsm_run *run)
{
    if (run->is_intact) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s/%s: changed since apsm wrote it; put it back, or make the model anew in "
                     "another folder (`apsm verify %s` tells all)",
                     run->folder, RUN_MANIFEST, run->folder);
}

/* Sealed anew, a manifest that somebody has changed would vouch for the change. */
static apsm_status write_to(apsm_run *run, const char *path)
{
    if (run->is_intact) return apsm_json_write_sealed(run->ctx, path, run->manifest);
    json_object_del(run->manifest, "sha256");
    return apsm_json_write(run->ctx, path, run->manifest);
}

apsm_status manifest_write(apsm_run *run)
{
    if (run_is_in_memory(run)) return APSM_OK;
    char *path = run_path(run, RUN_MANIFEST);
    if (!path) return no_memory(run);
    const apsm_status status = write_to(run, path);
    run->has_manifest = run->has_manifest || status == APSM_OK;
    free(path);
    return status;
}

void manifest_close(apsm_run *run)
{
    json_decref(run->manifest);
    run->manifest = NULL;
}

apsm_status manifest_set_options(apsm_run *run)
{
    json_t *options = json_object();
    int failed = !options;
    const size_t n = apsm_project_count(&run->project, "apsm");
    for (size_t k = 0; k < n && !failed; k++) {
        const char *key, *value;
        apsm_project_pair(&run->project, "apsm", k, &key, &value);
        failed = json_object_set_new(options, key, json_string(value));
    }
    failed = failed || json_object_set(run->manifest, "options", options) ||
             json_object_set_new(run->manifest, "apsm", json_string(APSM_VERSION));
    json_decref(options);
    return failed ? no_memory(run) : APSM_OK;
}

apsm_status manifest_set_inputs(apsm_run *run, size_t n, const char *const *names,
                                const char *const *paths, char (*sha256)[65])
{
    json_t *inputs = json_array();
    int failed = !inputs;
    for (size_t i = 0; i < n && !failed; i++) {
        struct stat info;
        const json_int_t bytes = stat(paths[i], &info) == 0 ? (json_int_t)info.st_size : 0;
        failed = json_array_append_new(inputs,
                                       json_pack("{s:s, s:s, s:I, s:s}", "name", names[i], "path",
                                                 paths[i], "bytes", bytes, "sha256", sha256[i]));
    }
    failed = failed || json_object_set(run->manifest, "inputs", inputs);
    json_decref(inputs);
    return failed ? no_memory(run) : APSM_OK;
}

apsm_status manifest_set_cropped(apsm_run *run, json_t *cropped)
{
    json_object_del(run->manifest, "cropped");
    if (!cropped) return APSM_OK;
    return json_object_set_new(run->manifest, "cropped", cropped) ? no_memory(run) : APSM_OK;
}

apsm_status manifest_set_groomed(apsm_run *run, json_t *groomed)
{
    return json_object_set_new(run->manifest, "groomed", groomed) ? no_memory(run) : APSM_OK;
}

apsm_status manifest_set_notes(apsm_run *run, json_t *notes)
{
    return json_object_set_new(run->manifest, "notes", notes) ? no_memory(run) : APSM_OK;
}

apsm_status manifest_set_ignored(apsm_run *run, const char *text)
{
    json_object_del(run->manifest, "ignored");
    if (!text) return APSM_OK;
    return json_object_set_new(run->manifest, "ignored", json_string(text)) ? no_memory(run)
                                                                            : APSM_OK;
}

const char *manifest_input_sha256(const apsm_run *run, const char *name)
{
    size_t i;
    json_t *input;
    json_array_foreach(json_object_get(run->manifest, "inputs"), i, input)
    {
        const char *it = json_string_value(json_object_get(input, "name"));
        if (it && strcmp(it, name) == 0) return json_string_value(json_object_get(input, "sha256"));
    }
    return NULL;
}

bool manifest_is_joint(const apsm_run *run)
{
    return json_object_get(run->manifest, "joint") != NULL;
}

apsm_status manifest_refuse_joint(const apsm_run *run)
{
    if (!manifest_is_joint(run)) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s: holds a joint of several parts; give `apsm run` the inputs and --parts "
                     "again, or work on a part in %s/parts",
                     run->folder, run->folder);
}

stage_clock stage_begin(void)
{
    stage_clock clock;
    clock_gettime(CLOCK_MONOTONIC, &clock.wall);
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &clock.cpu);
    return clock;
}

static double seconds_since(clockid_t id, const struct timespec *begin)
{
    struct timespec now;
    clock_gettime(id, &now);
    return (double)(now.tv_sec - begin->tv_sec) + 1e-9 * (double)(now.tv_nsec - begin->tv_nsec);
}

double stage_wall(const stage_clock *clock)
{
    return seconds_since(CLOCK_MONOTONIC, &clock->wall);
}

static double milliseconds(double seconds)
{
    return (double)(long)(1e3 * seconds + 0.5) / 1e3;
}

/* Largest resident set of the process so far, in MB of 2^20 bytes. */
static double peak_memory(void)
{
    struct rusage usage;
    if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
    return (double)(usage.ru_maxrss / 102) / 10;
}

bool stage_is_before(const char *stage, const char *other)
{
    for (size_t k = 0; k < STAGES; k++) {
        if (strcmp(stages[k], other) == 0) return false;
        if (strcmp(stages[k], stage) == 0) return true;
    }
    return false;
}

const char *stage_name(size_t k)
{
    return k < STAGES - 1 ? stages[k] : NULL;
}

const char *stage_of_all(size_t k)
{
    return k < STAGES ? stages[k] : NULL;
}

/* ---- stages that have begun and not ended: their files are a run's, though not listed ---- */

static bool has_begun(const json_t *begun, const char *stage)
{
    size_t k;
    json_t *one;
    json_array_foreach(begun, k, one) if (json_is_string(one) &&
                                          strcmp(json_string_value(one), stage) == 0) return true;
    return false;
}

/* "begun" <- it with the stage (with), or without, in their order; no key for none. */
static apsm_status set_begun(apsm_run *run, const char *stage, bool with)
{
    const json_t *before = json_object_get(run->manifest, "begun");
    json_t *begun = json_array();
    int failed = !begun;
    for (size_t k = 0; k < STAGES && !failed; k++) {
        const bool it = strcmp(stages[k], stage) == 0;
        if (it ? with : has_begun(before, stages[k]))
            failed = json_array_append_new(begun, json_string(stages[k]));
    }
    if (!failed && json_array_size(begun) == 0)
        json_object_del(run->manifest, "begun");
    else if (!failed)
        failed = json_object_set(run->manifest, "begun", begun);
    json_decref(begun);
    return failed ? no_memory(run) : APSM_OK;
}

apsm_status stage_undo(apsm_run *run, const char *stage)
{
    for (size_t k = 0; k < STAGES; k++) {
        if (stage_is_before(stages[k], stage)) continue;
        json_object_del(json_object_get(run->manifest, "stages"), stages[k]);
        if (outputs_has_some_of(run, stages[k])) APSM_TRY(set_begun(run, stages[k], true));
    }
    outputs_forget(run, stage);
    return APSM_OK;
}

apsm_status stage_start(apsm_run *run, const char *stage)
{
    APSM_TRY(stage_undo(run, stage));
    APSM_TRY(set_begun(run, stage, true));
    return manifest_write(run);
}

apsm_status stage_close(apsm_run *run, const char *stage)
{
    APSM_TRY(outputs_record(run, stage));
    APSM_TRY(set_begun(run, stage, false));
    return manifest_write(run);
}

apsm_status stage_end(apsm_run *run, const char *stage, const stage_clock *clock)
{
    APSM_TRY(stage_undo(run, stage));
    json_t *entry =
        json_pack("{s:f, s:f, s:f, s:i}", "wall_seconds", milliseconds(stage_wall(clock)),
                  "cpu_seconds", milliseconds(seconds_since(CLOCK_PROCESS_CPUTIME_ID, &clock->cpu)),
                  "peak_memory_mb", peak_memory(), "threads", apsm_context_threads(run->ctx));
    if (!entry || json_object_set_new(json_object_get(run->manifest, "stages"), stage, entry))
        return no_memory(run);
    return stage_close(run, stage);
}

bool stage_is_done(const apsm_run *run, const char *stage)
{
    return json_object_get(json_object_get(run->manifest, "stages"), stage) != NULL;
}
