#include "exchange/out_folder.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "files/files.h"

static apsm_status no_memory(const out_folder *f)
{
    return apsm_fail(f->ctx, APSM_ERR_MEMORY, "%s: out of memory", f->path);
}

static bool is_listed(const out_folder *f, const json_t *files, const char *path)
{
    size_t k;
    json_t *name;
    if (strcmp(path, f->list) == 0) return true;
    json_array_foreach(files, k, name)
    {
        if (strcmp(json_string_value(name) ? json_string_value(name) : "", path) == 0) return true;
    }
    return false;
}

/* Nothing that is not of the earlier export may be in its folder; then all of it goes. */
static apsm_status remove_files(out_folder *f, const apsm_file_list *there, const json_t *files)
{
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < there->n; k++)
        if (!is_listed(f, files, there->path[k]))
            return apsm_fail(f->ctx, APSM_ERR_STATE,
                             "%s/%s: is not of an earlier call; move it, or name another folder",
                             f->path, there->path[k]);
    for (size_t k = 0; k < there->n && status == APSM_OK; k++) {
        char *path = apsm_path_join(f->path, there->path[k]);
        if (!path) return no_memory(f);
        if (unlink(path) != 0)
            status = apsm_fail(f->ctx, APSM_ERR_IO, "%s: cannot be replaced; remove it", path);
        free(path);
    }
    return status;
}

static apsm_status remove_earlier(out_folder *f, const apsm_file_list *there)
{
    char *list = apsm_path_join(f->path, f->list);
    json_t *root = NULL;
    apsm_status status = list ? APSM_OK : no_memory(f);
    const bool ours = list && apsm_file_exists(list);
    if (status == APSM_OK && !(ours && f->overwrite))
        status = apsm_fail(f->ctx, APSM_ERR_STATE, "%s: holds %s already; %s", f->path,
                           ours ? "files of an earlier call" : "other files",
                           ours ? "give --overwrite" : "name another folder");
    if (status == APSM_OK) status = apsm_json_read(f->ctx, list, &root);
    if (status == APSM_OK) status = apsm_json_check(f->ctx, list, root, f->format, 1);
    if (status == APSM_OK) status = remove_files(f, there, json_object_get(root, "files"));
    json_decref(root);
    free(list);
    return status;
}

apsm_status out_folder_open(out_folder *f)
{
    apsm_file_list there = { 0 };
    apsm_status status = APSM_OK;
    f->files = json_array();
    if (!f->files) return no_memory(f);
    if (apsm_file_exists(f->path))
        return apsm_fail(f->ctx, APSM_ERR_ARG, "%s: is a file; name a folder", f->path);
    if (apsm_is_folder(f->path)) status = apsm_list_files(f->ctx, f->path, true, &there);
    if (status == APSM_OK && there.n > 0) status = remove_earlier(f, &there);
    apsm_file_list_free(&there);
    return status == APSM_OK ? apsm_make_folder(f->ctx, f->path) : status;
}

apsm_status out_folder_place(out_folder *f, char **path, const char *format, va_list words)
{
    char name[1024];
    const int length = vsnprintf(name, sizeof name, format, words);
    if (length < 0 || length >= (int)sizeof name)
        return apsm_fail(f->ctx, APSM_ERR_ARG, "%s: a shape's name is too long for a file",
                         f->path);
    *path = apsm_path_join(f->path, name);
    if (!*path || json_array_append_new(f->files, json_string(name))) return no_memory(f);
    if (apsm_file_exists(*path) || apsm_is_folder(*path))
        return apsm_fail(f->ctx, APSM_ERR_STATE,
                         "%s: is there already and would be replaced; name another folder", *path);
    char *folder = apsm_path_folder(*path);
    const apsm_status status = folder ? apsm_make_folder(f->ctx, folder) : no_memory(f);
    free(folder);
    return status;
}

apsm_status out_folder_file(out_folder *f, char **path, const char *format, ...)
{
    va_list words;
    va_start(words, format);
    const apsm_status status = out_folder_place(f, path, format, words);
    va_end(words);
    return status;
}

apsm_status out_folder_close(out_folder *f, json_t *root)
{
    char *path = apsm_path_join(f->path, f->list);
    const bool whole = root && path && json_object_set(root, "files", f->files) == 0;
    const apsm_status status = whole ? apsm_json_write(f->ctx, path, root) : no_memory(f);
    json_decref(root);
    free(path);
    return status;
}

void out_folder_free(out_folder *f)
{
    json_decref(f->files);
    f->files = NULL;
}
