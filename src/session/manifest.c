#define _DEFAULT_SOURCE /* getrusage's maxrss */
#include "session/manifest.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "session/outputs.h"

static apsm_status no_memory(apsm_run *run)
{
    return apsm_fail(run->ctx, APSM_ERR_MEMORY, "%s: out of memory for the manifest",
                     run->folder ? run->folder : "job");
}

apsm_status manifest_open(apsm_run *run)
{
    run->is_intact = true;
    if (run_is_in_memory(run)) {
        run->manifest = manifest_json_new();
        return run->manifest ? APSM_OK : no_memory(run);
    }
    char *path = run_path(run, RUN_MANIFEST);
    if (!path) return no_memory(run);
    apsm_status status = APSM_OK;
    if (apsm_file_exists(path)) {
        run->has_manifest = true;
        status = manifest_json_read(run->ctx, path, &run->manifest, &run->is_intact);
    } else {
        run->manifest = manifest_json_new();
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

apsm_status manifest_write(apsm_run *run)
{
    if (run_is_in_memory(run)) return APSM_OK;
    char *path = run_path(run, RUN_MANIFEST);
    if (!path) return no_memory(run);
    const apsm_status status = manifest_json_write(run->ctx, path, run->manifest, run->is_intact);
    run->has_manifest = run->has_manifest || status == APSM_OK;
    free(path);
    return status;
}

void manifest_close(apsm_run *run)
{
    json_decref(run->manifest);
    run->manifest = NULL;
}

/* Takes the reference over; NULL: there was no memory for it. */
static apsm_status set(apsm_run *run, const char *key, json_t *value)
{
    return json_object_set_new(run->manifest, key, value) ? no_memory(run) : APSM_OK;
}

/* NULL: there is none. */
static apsm_status set_or_remove(apsm_run *run, const char *key, json_t *value)
{
    json_object_del(run->manifest, key);
    return value ? set(run, key, value) : APSM_OK;
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
    return set(run, "inputs", manifest_json_inputs(n, names, paths, sha256));
}

apsm_status manifest_set_cropped(apsm_run *run, json_t *cropped)
{
    return set_or_remove(run, "cropped", cropped);
}

apsm_status manifest_set_groomed(apsm_run *run, json_t *groomed)
{
    return set(run, "groomed", groomed);
}

apsm_status manifest_set_notes(apsm_run *run, json_t *notes)
{
    return set(run, "notes", notes);
}

apsm_status manifest_set_ignored(apsm_run *run, const char *text)
{
    return set_or_remove(run, "ignored", text ? json_string(text) : NULL);
}

const char *manifest_input_sha256(const apsm_run *run, const char *name)
{
    return manifest_json_sha256(run->manifest, name);
}

bool manifest_is_joint(const apsm_run *run)
{
    return manifest_json_is_joint(run->manifest);
}

apsm_status manifest_refuse_contours(const apsm_run *run)
{
    if (!manifest_json_is_contours(run->manifest)) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s: holds a model of contours, which `apsm run` alone makes, with its report",
                     run->folder);
}

apsm_status manifest_refuse_joint(const apsm_run *run)
{
    APSM_TRY(manifest_refuse_contours(run));
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

static apsm_status set_begun(apsm_run *run, const char *stage, bool with)
{
    return manifest_json_set_begun(run->manifest, stage, with) ? no_memory(run) : APSM_OK;
}

apsm_status stage_undo(apsm_run *run, const char *stage)
{
    for (size_t k = 0; stage_of_all(k); k++) {
        const char *one = stage_of_all(k);
        if (stage_is_before(one, stage)) continue;
        json_object_del(json_object_get(run->manifest, "stages"), one);
        if (outputs_has_some_of(run, one)) APSM_TRY(set_begun(run, one, true));
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
