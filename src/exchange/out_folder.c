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

/* Itself, or the file under another name that is written before it (files/writer.h). */
static bool is_of(const char *path, const char *name)
{
    const size_t n = strlen(name), length = strlen(path);
    if (n == 0 || strncmp(path, name, n) != 0) return false;
    return length == n ||
           (path[n] == '.' && length > n + 4 && strcmp(path + length - 4, ".tmp") == 0);
}

/* The list of a whole call, or of one that was interrupted. */
static bool is_list(const out_folder *f, const char *path)
{
    const size_t n = strlen(f->list);
    return is_of(path, f->list) ||
           (strncmp(path, f->list, n) == 0 && strcmp(path + n, ".unfinished") == 0);
}

static bool is_listed(const out_folder *f, const json_t *files, const char *path)
{
    size_t k;
    json_t *name;
    if (is_list(f, path)) return true;
    json_array_foreach(files, k, name)
    {
        if (json_is_string(name) && is_of(path, json_string_value(name))) return true;
    }
    return false;
}

static apsm_status remove_file(const out_folder *f, const char *name)
{
    apsm_status status = APSM_OK;
    char *path = apsm_path_join(f->path, name);
    if (!path) return no_memory(f);
    if (unlink(path) != 0)
        status = apsm_fail(f->ctx, APSM_ERR_IO, "%s: cannot be replaced; remove it", path);
    free(path);
    return status;
}

/* Nothing that is not of the earlier call may be in its folder; then all of it goes, its lists
 * last: if this is interrupted, the next call still knows the others. */
static apsm_status remove_files(const out_folder *f, const apsm_file_list *there,
                                const json_t *files)
{
    for (size_t k = 0; k < there->n; k++)
        if (!is_listed(f, files, there->path[k]))
            return apsm_fail(f->ctx, APSM_ERR_STATE,
                             "%s/%s: is not of an earlier call; move it, or name another folder",
                             f->path, there->path[k]);
    for (int lists = 0; lists < 2; lists++)
        for (size_t k = 0; k < there->n; k++)
            if (is_list(f, there->path[k]) == (lists == 1))
                APSM_TRY(remove_file(f, there->path[k]));
    return APSM_OK;
}

/* *files <- the names of an interrupted call, a line each; NULL if there was none. */
static apsm_status read_unfinished(const out_folder *f, json_t **files)
{
    enum { LIMIT = 1 << 26 };
    char *text = NULL, *rest = NULL;
    size_t size;
    *files = NULL;
    if (!apsm_file_exists(f->unfinished)) return APSM_OK;
    APSM_TRY(apsm_read_file(f->ctx, f->unfinished, LIMIT, &text, &size));
    *files = json_array();
    for (char *name = strtok_r(text, "\n", &rest); *files && name;
         name = strtok_r(NULL, "\n", &rest))
        json_array_append_new(*files, json_string(name));
    free(text);
    return *files ? APSM_OK : no_memory(f);
}

static apsm_status read_list(const out_folder *f, const char *list, json_t **root)
{
    const bool ours = apsm_file_exists(list);
    if (!(ours && f->overwrite))
        return apsm_fail(f->ctx, APSM_ERR_STATE, "%s: holds %s already; %s", f->path,
                         ours ? "files of an earlier call" : "other files",
                         ours ? "give --overwrite" : "name another folder");
    APSM_TRY(apsm_json_read(f->ctx, list, root));
    return apsm_json_check(f->ctx, list, *root, f->format, 1);
}

static apsm_status remove_earlier(const out_folder *f, const apsm_file_list *there)
{
    json_t *root = NULL, *files = NULL;
    char *list = apsm_path_join(f->path, f->list);
    apsm_status status = list ? read_unfinished(f, &files) : no_memory(f);
    const bool interrupted = files != NULL;
    if (status == APSM_OK && !interrupted) {
        status = read_list(f, list, &root);
        files = json_incref(json_object_get(root, "files"));
    }
    if (status == APSM_OK && interrupted)
        apsm_log(f->ctx, APSM_LOG_INFO, "%s: files of an interrupted call are replaced", f->path);
    if (status == APSM_OK) status = remove_files(f, there, files);
    json_decref(files);
    json_decref(root);
    free(list);
    return status;
}

/* The name joins the file of names before anything stands under it. */
static apsm_status note(const out_folder *f, const char *name)
{
    FILE *file = fopen(f->unfinished, "ab");
    bool good = file && fprintf(file, "%s\n", name) > 0;
    if (file && fclose(file) != 0) good = false;
    if (good) return APSM_OK;
    return apsm_fail(f->ctx, APSM_ERR_IO, "%s: cannot be written; is the disk full?",
                     f->unfinished);
}

apsm_status out_folder_open(out_folder *f)
{
    apsm_file_list there = { 0 };
    apsm_status status = APSM_OK;
    const size_t length = strlen(f->path) + strlen(f->list) + sizeof "/.unfinished";
    f->files = json_array();
    f->unfinished = malloc(length);
    if (!f->files || !f->unfinished) return no_memory(f);
    snprintf(f->unfinished, length, "%s/%s.unfinished", f->path, f->list);
    if (apsm_file_exists(f->path))
        return apsm_fail(f->ctx, APSM_ERR_ARG, "%s: is a file; name a folder", f->path);
    if (apsm_is_folder(f->path)) status = apsm_list_files(f->ctx, f->path, true, &there);
    if (status == APSM_OK && there.n > 0) status = remove_earlier(f, &there);
    apsm_file_list_free(&there);
    if (status == APSM_OK) status = apsm_make_folder(f->ctx, f->path);
    return status == APSM_OK ? note(f, f->list) : status;
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
    return status == APSM_OK ? note(f, name) : status;
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
    apsm_status status = whole ? apsm_json_write(f->ctx, path, root) : no_memory(f);
    if (status == APSM_OK && unlink(f->unfinished) != 0)
        status = apsm_fail(f->ctx, APSM_ERR_IO, "%s: cannot be removed", f->unfinished);
    json_decref(root);
    free(path);
    return status;
}

void out_folder_free(out_folder *f)
{
    json_decref(f->files);
    free(f->unfinished);
    f->files = NULL;
    f->unfinished = NULL;
}
