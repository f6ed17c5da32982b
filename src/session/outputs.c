#include "session/outputs.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "folder/stages.h"
#include "session/manifest.h"

/* ---- records ---- */

static json_t *records(const apsm_run *run)
{
    return json_object_get(run->manifest, "outputs");
}

static const char *stage_of(const json_t *record)
{
    const char *stage = json_string_value(json_array_get(record, 0));
    return stage ? stage : "";
}

bool outputs_are_a_runs(const apsm_run *run, const char *path)
{
    size_t k;
    json_t *stage;
    if (!run->has_manifest) return false;
    if (strcmp(path, RUN_MANIFEST) == 0 || json_object_get(records(run), path)) return true;
    json_array_foreach(json_object_get(run->manifest, "begun"), k, stage)
    {
        const char *name = json_string_value(stage);
        if (name && stage_writes(name, path)) return true;
    }
    return false;
}

bool outputs_has_some_of(const apsm_run *run, const char *stage)
{
    const char *path;
    json_t *record;
    json_object_foreach(records(run), path, record)
    {
        if (strcmp(stage_of(record), stage) == 0) return true;
    }
    return false;
}

static apsm_status no_memory(apsm_run *run)
{
    return apsm_fail(run->ctx, APSM_ERR_MEMORY, "%s: out of memory for the list of its files",
                     run->folder);
}

void outputs_forget(apsm_run *run, const char *stage)
{
    const char *path;
    json_t *record;
    void *next;
    json_object_foreach_safe(records(run), next, path, record)
    {
        const bool later =
            stage_is_known(stage_of(record)) && !stage_is_before(stage_of(record), stage);
        if (later || stage_writes(stage, path)) json_object_del(records(run), path);
    }
}

/* The files that a stage has written, as they are. */
typedef struct hashing {
    const apsm_run *run;
    const char *stage;
    size_t n;
    const char **path; /* borrowed from the list of the folder's files */
    char (*sha256)[65];
    long long *bytes;
} hashing;

static apsm_status hash_file(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    hashing *h = user;
    char *path = run_path(h->run, h->path[i]);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_file_size(ctx, path, &h->bytes[i]);
    if (status == APSM_OK) status = apsm_sha256_file(ctx, path, h->sha256[i]);
    free(path);
    return status;
}

static apsm_status add_records(const hashing *h, json_t *into)
{
    for (size_t i = 0; i < h->n; i++)
        if (json_object_set_new(
                into, h->path[i],
                json_pack("[s, I, s]", h->stage, (json_int_t)h->bytes[i], h->sha256[i])))
            return APSM_ERR_MEMORY;
    return APSM_OK;
}

apsm_status outputs_add(apsm_run *run, const char *stage, const char *path)
{
    char sha256[1][65];
    long long bytes[1];
    hashing h = { run, stage, 1, &path, sha256, bytes };
    APSM_TRY(hash_file(run->ctx, 0, 0, &h));
    return add_records(&h, records(run)) == APSM_OK ? APSM_OK : no_memory(run);
}

static int by_bytes(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Replaces the records by themselves in the order of their paths. */
static apsm_status sort_records(apsm_run *run)
{
    const size_t n = json_object_size(records(run));
    const char **path = calloc(n + 1, sizeof *path), *key;
    json_t *sorted = json_object(), *record;
    size_t k = 0;
    int failed = !path || !sorted;
    json_object_foreach(records(run), key, record) if (!failed) path[k++] = key;
    if (k > 0) qsort(path, k, sizeof *path, by_bytes);
    for (size_t i = 0; i < k && !failed; i++)
        failed = json_object_set(sorted, path[i], json_object_get(records(run), path[i]));
    failed = failed || json_object_set(run->manifest, "outputs", sorted);
    json_decref(sorted);
    free(path);
    return failed ? no_memory(run) : APSM_OK;
}

/* Those of the folder's files that the stage writes. */
static apsm_status list_written(apsm_run *run, const apsm_file_list *files, hashing *h)
{
    h->path = calloc(files->n + 1, sizeof *h->path);
    h->sha256 = calloc(files->n + 1, sizeof *h->sha256);
    h->bytes = calloc(files->n + 1, sizeof *h->bytes);
    if (!h->path || !h->sha256 || !h->bytes) return no_memory(run);
    for (size_t k = 0; k < files->n; k++)
        if (stage_writes(h->stage, files->path[k])) h->path[h->n++] = files->path[k];
    return APSM_OK;
}

/* Adds the files in the model folder's folder `name` ("": its own). */
static apsm_status add_folder(apsm_run *run, const char *name, apsm_file_list *all)
{
    apsm_file_list some = { 0 };
    char *path = *name ? run_path(run, name) : strdup(run->folder);
    apsm_status status = path ? APSM_OK : no_memory(run);
    if (status == APSM_OK && apsm_is_folder(path))
        status = apsm_list_files(run->ctx, path, false, &some);
    free(path);
    char **grown = NULL;
    if (status == APSM_OK) {
        grown = realloc(all->path, (all->n + some.n + 1) * sizeof *grown);
        if (!grown) status = no_memory(run);
    }
    if (grown) all->path = grown;
    for (size_t k = 0; k < some.n && status == APSM_OK; k++) {
        all->path[all->n] = apsm_path_join(name, some.path[k]);
        if (all->path[all->n])
            all->n++;
        else
            status = no_memory(run);
    }
    apsm_file_list_free(&some);
    return status;
}

/* Other folders may be large and are none of ours. */
apsm_status outputs_list(apsm_run *run, apsm_file_list *all)
{
    static const char *const folders[] = { "",      "state",     "groomed", "groomed/whole",
                                           "fixed", "particles", "meshes",  "constraints" };
    *all = (apsm_file_list){ 0 };
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < sizeof folders / sizeof folders[0] && status == APSM_OK; k++)
        status = add_folder(run, folders[k], all);
    if (status != APSM_OK) apsm_file_list_free(all);
    return status;
}

apsm_status outputs_record(apsm_run *run, const char *stage)
{
    hashing h = { .run = run, .stage = stage };
    apsm_file_list files;
    if (run_is_in_memory(run)) return APSM_OK;
    outputs_forget(run, stage);
    if (!records(run) && json_object_set_new(run->manifest, "outputs", json_object()))
        return no_memory(run);
    APSM_TRY(outputs_list(run, &files));
    apsm_status status = list_written(run, &files, &h);
    if (status == APSM_OK) status = apsm_parallel_for(run->ctx, h.n, hash_file, &h, NULL);
    if (status == APSM_OK) status = add_records(&h, records(run));
    if (status == APSM_OK) status = sort_records(run);
    free(h.path);
    free(h.sha256);
    free(h.bytes);
    apsm_file_list_free(&files);
    return status;
}

/* ---- comparison ---- */

typedef struct comparing {
    const apsm_run *run;
    output *list;
} comparing;

static apsm_status compare_file(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    comparing *c = user;
    output *o = &c->list[i];
    char hex[65], *path = run_path(c->run, o->path);
    long long bytes;
    if (!path) return APSM_ERR_MEMORY;
    o->state = OUTPUT_SAME;
    if (!apsm_file_exists(path))
        o->state = OUTPUT_MISSING;
    else if (apsm_file_size(ctx, path, &bytes) != APSM_OK)
        o->state = OUTPUT_UNREADABLE;
    else if (bytes != o->bytes)
        o->state = OUTPUT_CHANGED;
    else if (apsm_sha256_file(ctx, path, hex) != APSM_OK)
        o->state = OUTPUT_UNREADABLE;
    else if (!o->sha256 || strcmp(hex, o->sha256) != 0)
        o->state = OUTPUT_CHANGED;
    free(path);
    return APSM_OK;
}

static int by_path(const void *a, const void *b)
{
    return strcmp(((const output *)a)->path, ((const output *)b)->path);
}

apsm_status outputs_compare(apsm_run *run, output **list, size_t *n)
{
    const char *path;
    json_t *record;
    const size_t most = json_object_size(records(run));
    comparing c = { run, calloc(most + 1, sizeof *c.list) };
    *list = c.list;
    *n = 0;
    apsm_status status = c.list ? APSM_OK : no_memory(run);
    json_object_foreach(records(run), path, record)
    {
        if (status != APSM_OK) break;
        c.list[(*n)++] = (output){ .path = path,
                                   .stage = stage_of(record),
                                   .bytes = json_integer_value(json_array_get(record, 1)),
                                   .sha256 = json_string_value(json_array_get(record, 2)) };
    }
    if (status != APSM_OK) return status;
    qsort(c.list, *n, sizeof *c.list, by_path); /* somebody may have moved them */
    return apsm_parallel_for(run->ctx, *n, compare_file, &c, NULL);
}

apsm_status outputs_check(apsm_run *run)
{
    output *list = NULL;
    size_t n;
    apsm_status status = outputs_compare(run, &list, &n);
    for (size_t k = 0; k < n && status == APSM_OK; k++)
        if (list[k].state != OUTPUT_SAME && strcmp(list[k].stage, "report") != 0)
            status = apsm_fail(run->ctx, APSM_ERR_STATE,
                               "%s/%s: %s since %s wrote it; put it back, or start anew with "
                               "--overwrite (`apsm verify %s` tells all)",
                               run->folder, list[k].path,
                               list[k].state == OUTPUT_MISSING ? "removed" : "changed or damaged",
                               list[k].stage, run->folder);
    free(list);
    return status;
}

/* ---- left-overs ---- */

apsm_status outputs_tidy(apsm_run *run)
{
    apsm_file_list files;
    APSM_TRY(outputs_list(run, &files));
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < files.n && status == APSM_OK; k++)
        if (folder_left_over(files.path[k])) status = run_remove(run, run_path(run, files.path[k]));
    apsm_file_list_free(&files);
    return status;
}
