/* Cases of a part's model are known by the file that they were read from. */
#include <stdlib.h>
#include <string.h>

#include "assemble/job.h"

static int by_path(const void *a, const void *b)
{
    return strcmp(((const joint_path *)a)->path, ((const joint_path *)b)->path);
}

/* Adds path, resolved if it is there; taken. */
static apsm_status add(joint_paths *list, char *path, size_t row)
{
    if (!path) return APSM_ERR_MEMORY;
    char *resolved = realpath(path, NULL);
    list->path[list->n++] = (joint_path){ resolved ? resolved : path, row };
    if (resolved) free(path);
    return APSM_OK;
}

apsm_status joint_paths_of_project(const apsm_project *project, joint_paths *list)
{
    *list = (joint_paths){ 0, calloc(project->n + 1, sizeof *list->path) };
    if (!list->path) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < project->n; i++)
        APSM_TRY(add(list, apsm_project_path(project, project->subjects[i].shape), i));
    qsort(list->path, list->n, sizeof *list->path, by_path);
    return APSM_OK;
}

apsm_status joint_paths_of_subjects(const joint_job *job, size_t d, joint_paths *list)
{
    *list = (joint_paths){ 0, calloc(job->subjects + 1, sizeof *list->path) };
    if (!list->path) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < job->subjects; i++) {
        const size_t k = job->subject[i].input[d];
        if (k != APSM_NO_CASE) APSM_TRY(add(list, strdup(job->list.cases[k].path), i));
    }
    qsort(list->path, list->n, sizeof *list->path, by_path);
    return APSM_OK;
}

size_t joint_paths_find(const joint_paths *list, const char *path)
{
    joint_path key = { realpath(path, NULL), 0 };
    const joint_path *found =
        key.path ? bsearch(&key, list->path, list->n, sizeof *list->path, by_path) : NULL;
    free(key.path);
    return found ? found->row : SIZE_MAX;
}

void joint_paths_free(joint_paths *list)
{
    for (size_t k = 0; k < list->n; k++) free(list->path[k].path);
    free(list->path);
    *list = (joint_paths){ 0 };
}
