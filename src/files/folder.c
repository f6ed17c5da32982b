/* What is in a folder, in an order that does not depend on the file system. */
#include "files/io.h"

#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static bool add(apsm_file_list *list, char *path)
{
    if (list->n == list->capacity) {
        const size_t capacity = 2 * list->n + 64;
        char **grown = realloc(list->path, capacity * sizeof *grown);
        if (!grown) return false;
        list->path = grown;
        list->capacity = capacity;
    }
    list->path[list->n++] = path;
    return true;
}

/* One walk through the folders below root. */
typedef struct walk {
    const char *root;
    bool deep;
    apsm_file_list *list;
} walk;

/* An entry by its path from the root on, which is taken over. */
static int list_entry(const walk *w, char *relative);

/* 0 or an errno; within: the folder from the root on, "" for the root itself. */
static int list_folder(const walk *w, const char *within)
{
    char *path = *within ? apsm_path_join(w->root, within) : strdup(w->root);
    DIR *dir = path ? opendir(path) : NULL;
    int error = path ? (dir ? 0 : errno) : ENOMEM;
    free(path);
    while (dir && !error) {
        errno = 0;
        const struct dirent *entry = readdir(dir);
        if (!entry) {
            error = errno;
            break;
        }
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0) continue;
        char *relative = apsm_path_join(within, entry->d_name);
        error = relative ? list_entry(w, relative) : ENOMEM;
    }
    if (dir) closedir(dir);
    return error;
}

static int list_entry(const walk *w, char *relative)
{
    struct stat info;
    char *path = apsm_path_join(w->root, relative);
    int error = ENOMEM;
    if (path) error = lstat(path, &info) == 0 ? 0 : errno;
    free(path);
    if (!error && !S_ISDIR(info.st_mode)) {
        if (add(w->list, relative)) return 0;
        error = ENOMEM;
    } else if (!error) {
        error = w->deep ? list_folder(w, relative) : 0;
    } else if (error == ENOENT) {
        error = 0; /* removed meanwhile */
    }
    free(relative);
    return error;
}

static int by_bytes(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

apsm_status apsm_list_files(apsm_context *ctx, const char *folder, bool deep, apsm_file_list *list)
{
    *list = (apsm_file_list){ 0 };
    const walk w = { folder, deep, list };
    const int error = list_folder(&w, "");
    if (error) {
        apsm_file_list_free(list);
        return apsm_fail_errno(ctx, folder, "cannot be read", error);
    }
    if (list->n > 0) qsort(list->path, list->n, sizeof *list->path, by_bytes);
    return APSM_OK;
}

void apsm_file_list_free(apsm_file_list *list)
{
    for (size_t k = 0; k < list->n; k++) free(list->path[k]);
    free(list->path);
    *list = (apsm_file_list){ 0 };
}

static apsm_status add_file(apsm_context *ctx, const char *folder, const char *name,
                            apsm_sha256 *sha)
{
    char hex[65], *path = apsm_path_join(folder, name);
    if (!path) return apsm_fail_errno(ctx, folder, "cannot be read", ENOMEM);
    const apsm_status status = apsm_sha256_file(ctx, path, hex);
    free(path);
    apsm_sha256_add(sha, hex, 64);
    apsm_sha256_add_text(sha, name);
    return status;
}

apsm_status apsm_sha256_folder(apsm_context *ctx, const char *path, char hex[65])
{
    apsm_file_list list;
    apsm_sha256 sha;
    unsigned char digest[32];
    hex[0] = '\0';
    APSM_TRY(apsm_list_files(ctx, path, true, &list));
    apsm_status status = APSM_OK;
    apsm_sha256_begin(&sha);
    for (size_t k = 0; k < list.n && status == APSM_OK; k++)
        status = add_file(ctx, path, list.path[k], &sha);
    apsm_file_list_free(&list);
    if (status != APSM_OK) return status;
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, hex);
    return APSM_OK;
}
