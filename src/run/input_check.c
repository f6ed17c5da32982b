#include "run/input_check.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "run/groom_inputs.h"
#include "session/manifest.h"

typedef struct checking {
    const apsm_run *run;
    const apsm_input_list *list; /* or NULL */
    input_check *checks;
} checking;

/* The better of the states that two places give. */
static apsm_status look_at(apsm_context *ctx, const char *path, input_check *c)
{
    char hex[65];
    if (!apsm_file_exists(path) && !apsm_is_folder(path)) return APSM_OK;
    c->state = INPUT_CHANGED;
    APSM_TRY(apsm_input_hash(ctx, path, hex));
    if (strcmp(hex, c->sha256) == 0) c->state = INPUT_SAME;
    return APSM_OK;
}

static apsm_status look_in_both(apsm_context *ctx, const apsm_run *run, input_check *c)
{
    const apsm_project *project = &run->project;
    const size_t at = apsm_project_find(project, c->name);
    const char *shape = at < project->n ? project->subjects[at].shape : NULL;
    char *path = apsm_project_path(project, shape);
    if (shape && !path) return APSM_ERR_MEMORY;
    apsm_status status = path ? look_at(ctx, path, c) : APSM_OK;
    if (c->state != INPUT_SAME && status != APSM_ERR_MEMORY) {
        const bool changed = c->state == INPUT_CHANGED;
        status = look_at(ctx, c->path, c);
        if (c->state != INPUT_SAME && changed) c->state = INPUT_CHANGED;
    }
    free(path);
    return status;
}

static apsm_status look_in_list(apsm_context *ctx, const apsm_input_list *list, input_check *c)
{
    for (size_t i = 0; i < list->n; i++)
        if (strcmp(list->cases[i].name, c->name) == 0) return look_at(ctx, list->cases[i].path, c);
    return APSM_OK;
}

static apsm_status check_input(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const checking *all = user;
    input_check *c = &all->checks[i];
    c->state = INPUT_UNKNOWN;
    if (!c->sha256 || !*c->sha256) return APSM_OK;
    c->state = INPUT_MISSING;
    const apsm_status status =
        all->list ? look_in_list(ctx, all->list, c) : look_in_both(ctx, all->run, c);
    return status == APSM_ERR_MEMORY ? status : APSM_OK; /* unreadable: not what it was */
}

static const char *text_of(const json_t *input, const char *key)
{
    const char *text = json_string_value(json_object_get(input, key));
    return text ? text : "?";
}

apsm_status input_check_all(apsm_run *run, const apsm_input_list *list, input_check **checks,
                            size_t *n)
{
    const json_t *inputs = json_object_get(run->manifest, "inputs");
    checking all = { run, list, calloc(json_array_size(inputs) + 1, sizeof *all.checks) };
    *checks = all.checks;
    *n = all.checks ? json_array_size(inputs) : 0;
    if (!all.checks) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < *n; i++) {
        const json_t *input = json_array_get(inputs, i);
        all.checks[i] =
            (input_check){ .name = text_of(input, "name"),
                           .path = text_of(input, "path"),
                           .sha256 = json_string_value(json_object_get(input, "sha256")) };
    }
    return apsm_parallel_for(run->ctx, *n, check_input, &all, NULL);
}

static apsm_status judge_resume(apsm_run *run, const input_check *checks, size_t n)
{
    size_t missing = 0;
    for (size_t i = 0; i < n; i++) {
        missing += checks[i].state == INPUT_MISSING;
        if (checks[i].state == INPUT_CHANGED)
            return apsm_fail(run->ctx, APSM_ERR_STATE,
                             "%s: input %s: %s has changed since it was groomed; put it back, or "
                             "start anew with --overwrite",
                             run->folder, checks[i].name, checks[i].path);
    }
    if (missing > 0)
        apsm_log(run->ctx, APSM_LOG_WARNING,
                 "%zu of %zu inputs are no longer where they were; whether they have changed "
                 "since they were groomed cannot be told",
                 missing, n);
    return APSM_OK;
}

apsm_status input_check_resume(apsm_run *run, const apsm_input_list *list)
{
    input_check *checks = NULL;
    size_t n = 0;
    apsm_status status = input_check_all(run, list, &checks, &n);
    if (status == APSM_OK) status = judge_resume(run, checks, n);
    free(checks);
    return status;
}
