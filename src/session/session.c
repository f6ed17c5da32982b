/* What all steps of a run use. */
#include "session/session.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "files/io.h"
#include "files/stored.h"
#include "geometry/stored.h"

char *run_path(const apsm_run *run, const char *name)
{
    if (run_is_in_memory(run)) return NULL;
    return apsm_path_join(run->folder, name);
}

char *run_pathf(const apsm_run *run, const char *format, ...)
{
    va_list args, again;
    va_start(args, format);
    va_copy(again, args);
    const int length = vsnprintf(NULL, 0, format, args);
    va_end(args);
    char *name = length < 0 ? NULL : malloc((size_t)length + 1), *path = NULL;
    if (name) {
        vsnprintf(name, (size_t)length + 1, format, again);
        path = run_path(run, name);
    }
    va_end(again);
    free(name);
    return path;
}

/* ---- the store ---- */

static void keep_house(void *user)
{
    apsm_store_trim(user);
}

/* state/ may be there already; the store's file shows in no folder. */
apsm_status run_open_store(apsm_run *run, apsm_store **store)
{
    *store = run->store;
    if (run->store || run->memory == 0) return APSM_OK;
    char *folder = run_path(run, "state");
    apsm_status status = folder ? apsm_make_folder(run->ctx, folder) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_store_open(run->ctx, folder, run->memory, &run->store);
    if (status == APSM_OK) apsm_context_set_between(run->ctx, keep_house, run->store);
    free(folder);
    *store = run->store;
    return status;
}

void run_free_mesh(apsm_mesh *mesh, bool stored)
{
    array_list arrays = { 0 };
    mesh_arrays(mesh, &arrays);
    if (stored) arrays_forget(&arrays);
    apsm_mesh_free(mesh);
}

/* ---- files ---- */

apsm_status run_remove(apsm_run *run, char *path)
{
    if (run_is_in_memory(run)) return APSM_OK;
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    if (apsm_file_exists(path) && remove(path) != 0)
        status = apsm_fail_errno(run->ctx, path, "cannot be removed", errno);
    free(path);
    return status;
}

apsm_status run_write_project(apsm_run *run)
{
    if (run_is_in_memory(run)) return APSM_OK;
    char *path = run_path(run, RUN_PROJECT);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_project_write(run->ctx, path, &run->project);
    free(path);
    return status;
}

/* ---- several processes ---- */

bool run_is_shared(const apsm_run *run)
{
    const apsm_optimize_options *o = &run->options.optimize;
    return run->company && run->company->gather && o->method != APSM_METHOD_PSM &&
           !o->correspondence.template_gradient;
}

static apsm_status meet_all(apsm_context *ctx, void *user)
{
    (void)ctx;
    const apsm_run *run = user;
    run->company->meet(run->company->user, 0);
    return APSM_OK;
}

static void gather_all(void *user, size_t bytes, const void *own, void *all)
{
    const apsm_run *run = user;
    run->company->gather(run->company->user, bytes, own, all);
}

apsm_status run_shared(apsm_run *run, apsm_status (*part)(apsm_run *, void *), void *user)
{
    if (!run_is_shared(run)) return part(run, user);
    run->deal = (apsm_deal){ run->shard, run->shards, run, meet_all, gather_all };
    apsm_context_set_deal(run->ctx, &run->deal);
    const apsm_status status = part(run, user);
    apsm_context_set_deal(run->ctx, NULL);
    return status;
}
