#include "session/guard.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "files/journal.h"
#include "session/manifest.h"
#include "session/outputs.h"

/* A file that is there and has the name of one of a run's. */
typedef struct target {
    dev_t device;
    ino_t inode;
    const char *path; /* from the model folder on, borrowed */
} target;

typedef struct guarding {
    apsm_run *run;
    apsm_file_list files; /* of the folder */
    target *list;         /* n, sorted by device and inode */
    size_t n;
} guarding;

static int by_place(const void *a, const void *b)
{
    const target *x = a, *y = b;
    if (x->device != y->device) return x->device < y->device ? -1 : 1;
    return (x->inode > y->inode) - (x->inode < y->inode);
}

static apsm_status no_memory(apsm_run *run)
{
    return apsm_fail(run->ctx, APSM_ERR_MEMORY, "%s: out of memory for the list of its files",
                     run->folder);
}

/* ---- whose it is ---- */

/* Whether there is something in the journal's place, and whether it is one. */
static apsm_status look_at_journal(apsm_run *run, bool *there, bool *is_one)
{
    struct stat info;
    char *path = run_path(run, RUN_JOURNAL);
    if (!path) return no_memory(run);
    *there = lstat(path, &info) == 0;
    *is_one = *there && journal_is_one(path);
    free(path);
    return APSM_OK;
}

apsm_status guard_is_model(apsm_run *run, bool *is)
{
    bool there;
    *is = run->has_manifest;
    return *is ? APSM_OK : look_at_journal(run, &there, is);
}

static apsm_status refuse_foreign(apsm_run *run, const char *path)
{
    if (strcmp(path, RUN_PROJECT) == 0)
        return apsm_fail(run->ctx, APSM_ERR_STATE,
                         "%s/%s: is not of a run of apsm and would be replaced; make the model of "
                         "it in another folder: apsm run %s/%s -o MODEL_DIR",
                         run->folder, path, run->folder, path);
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s/%s: was not written by apsm and would be replaced; move it away, or "
                     "choose another folder",
                     run->folder, path);
}

static apsm_status check_owner(const guarding *g, const char *first)
{
    apsm_run *run = g->run;
    const char *last = run->last ? run->last : first;
    for (size_t k = 0; k < g->files.n; k++) {
        const char *path = g->files.path[k];
        if (stages_write_between(first, last, path) && !outputs_are_a_runs(run, path))
            return refuse_foreign(run, path);
    }
    bool there = false, is_one = false;
    APSM_TRY(look_at_journal(run, &there, &is_one));
    return there && !is_one ? refuse_foreign(run, RUN_JOURNAL) : APSM_OK;
}

/* ---- inputs ---- */

static apsm_status list_targets(guarding *g)
{
    g->list = malloc((g->files.n + 1) * sizeof *g->list);
    if (!g->list) return no_memory(g->run);
    for (size_t k = 0; k < g->files.n; k++) {
        struct stat info;
        char *path = run_path(g->run, g->files.path[k]);
        if (!path) return no_memory(g->run);
        if (folder_is_ours(g->files.path[k]) && stat(path, &info) == 0)
            g->list[g->n++] = (target){ info.st_dev, info.st_ino, g->files.path[k] };
        free(path);
    }
    if (g->n > 0) qsort(g->list, g->n, sizeof *g->list, by_place);
    return APSM_OK;
}

static apsm_status check_file(const guarding *g, const char *path)
{
    struct stat info;
    if (!path || stat(path, &info) != 0) return APSM_OK; /* who reads it tells */
    const target key = { info.st_dev, info.st_ino, NULL };
    const target *found = g->n > 0 ? bsearch(&key, g->list, g->n, sizeof *g->list, by_place) : NULL;
    if (!found) return APSM_OK;
    return apsm_fail(g->run->ctx, APSM_ERR_STATE,
                     "%s: is the file %s/%s, which this run would replace; choose another folder",
                     path, g->run->folder, found->path);
}

static apsm_status check_series(const guarding *g, const char *folder)
{
    apsm_file_list files;
    APSM_TRY(apsm_list_files(g->run->ctx, folder, false, &files));
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < files.n && status == APSM_OK; k++) {
        char *path = apsm_path_join(folder, files.path[k]);
        status = path ? check_file(g, path) : no_memory(g->run);
        free(path);
    }
    apsm_file_list_free(&files);
    return status;
}

static apsm_status check_input(const guarding *g, const char *path)
{
    apsm_file_list data;
    if (apsm_is_folder(path)) return check_series(g, path);
    APSM_TRY(check_file(g, path));
    APSM_TRY(apsm_input_data_files(path, &data));
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < data.n && status == APSM_OK; k++) status = check_file(g, data.path[k]);
    apsm_file_list_free(&data);
    return status;
}

apsm_status guard_files(apsm_run *run, const char *first, const apsm_input_list *list)
{
    guarding g = { .run = run };
    if (run_is_in_memory(run)) return APSM_OK;
    if (strcmp(first, "report") != 0) APSM_TRY(manifest_check_seal(run));
    apsm_status status = outputs_list(run, &g.files);
    if (status == APSM_OK) status = list_targets(&g);
    for (size_t i = 0; list && i < list->n && status == APSM_OK; i++)
        status = check_input(&g, list->cases[i].path);
    for (size_t k = 0; list && k < run->n_inputs && status == APSM_OK; k++)
        if (!apsm_is_folder(run->inputs[k])) status = check_file(&g, run->inputs[k]);
    if (status == APSM_OK) status = check_owner(&g, first);
    free(g.list);
    apsm_file_list_free(&g.files);
    return status;
}

apsm_status guard_model(apsm_run *run)
{
    if (run->overwrite || run->resume || run->project.n == 0) return APSM_OK;
    if (run_is_in_memory(run))
        return apsm_fail(run->ctx, APSM_ERR_STATE, "job in memory: its shapes are groomed already");
    if (run->n_inputs == 0 && !stage_is_done(run, "groom")) return APSM_OK;
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s: holds a model already; continue it with --resume, replace it with "
                     "--overwrite, or choose another folder",
                     run->folder);
}
