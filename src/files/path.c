/* Folders and paths. */
#include "files/io.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

void apsm_path_from_windows(char *path)
{
    for (; *path; path++)
        if (*path == '\\') *path = '/';
}

bool apsm_is_folder(const char *path)
{
    struct stat info;
    return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

apsm_status apsm_require_folder(apsm_context *ctx, const char *path)
{
    if (apsm_is_folder(path)) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_IO,
                     apsm_file_exists(path) ? "%s: is a file; give a folder made by `apsm run`"
                                            : "%s: no such folder; check the name",
                     path);
}

apsm_status apsm_refuse_root(apsm_context *ctx, const char *path)
{
    struct stat info, root;
    if (stat(path, &info) != 0 || stat("/", &root) != 0 || info.st_dev != root.st_dev ||
        info.st_ino != root.st_ino)
        return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "%s: is the folder of the whole system; name one of its own", path);
}

bool apsm_file_exists(const char *path)
{
    struct stat info;
    return stat(path, &info) == 0 && !S_ISDIR(info.st_mode);
}

apsm_status apsm_folder_holds(const char *folder, const char *name, bool *holds)
{
    char *path = apsm_path_join(folder, name);
    if (!path) return APSM_ERR_MEMORY;
    *holds = apsm_file_exists(path) || apsm_is_folder(path);
    free(path);
    return APSM_OK;
}

apsm_status apsm_file_size(apsm_context *ctx, const char *path, long long *bytes)
{
    struct stat info;
    *bytes = 0;
    if (stat(path, &info) != 0) return apsm_fail_errno(ctx, path, "cannot be read", errno);
    *bytes = (long long)info.st_size;
    return APSM_OK;
}

/* Another process may make the same folder meanwhile: what counts is that it is there. */
static int make_one(const char *path)
{
    if (mkdir(path, 0777) == 0) return apsm_sync_folder_of(path);
    const int error = errno;
    if (apsm_is_folder(path)) return 0;
    return error == EEXIST ? ENOTDIR : error;
}

apsm_status apsm_make_folder(apsm_context *ctx, const char *path)
{
    char *part = strdup(path);
    if (!part) return apsm_fail_errno(ctx, path, "cannot be made", ENOMEM);
    int error = *path ? 0 : ENOENT;
    for (char *slash = part; !error && (slash = strchr(slash + 1, '/'));) {
        *slash = '\0';
        error = make_one(part);
        *slash = '/';
    }
    if (!error) error = make_one(part);
    free(part);
    return error ? apsm_fail_errno(ctx, path, "the folder cannot be made", error) : APSM_OK;
}

apsm_status apsm_missing_folders(apsm_context *ctx, const char *path, size_t *n)
{
    char *at = strdup(path);
    *n = 0;
    while (at && !apsm_is_folder(at) && strcmp(at, ".") != 0) {
        char *above = apsm_path_folder(at);
        free(at);
        at = above;
        ++*n;
    }
    if (!at) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    free(at);
    return APSM_OK;
}

void apsm_remove_empty_folders(const char *path, size_t n)
{
    char *at = n > 0 ? strdup(path) : NULL;
    for (; at && n > 0; n--) {
        char *above = apsm_path_folder(at);
        rmdir(at);
        free(at);
        at = above;
    }
    free(at);
}

static char *copy(const char *text, size_t length)
{
    char *result = malloc(length + 1);
    if (!result) return NULL;
    memcpy(result, text, length);
    result[length] = '\0';
    return result;
}

const char *apsm_path_last(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash && slash[1] ? slash + 1 : path;
}

char *apsm_path_join(const char *folder, const char *name)
{
    const size_t f = strlen(folder), n = strlen(name);
    if (name[0] == '/' || f == 0 || strcmp(folder, ".") == 0) return copy(name, n);
    const bool slash = folder[f - 1] != '/';
    char *path = malloc(f + slash + n + 1);
    if (path) snprintf(path, f + slash + n + 1, "%s%s%s", folder, slash ? "/" : "", name);
    return path;
}

char *apsm_path_folder(const char *path)
{
    const char *slash = strrchr(path, '/');
    if (!slash) return copy(".", 1);
    while (slash > path && slash[-1] == '/') slash--;
    return copy(path, slash == path ? 1 : (size_t)(slash - path));
}

char *apsm_path_stem(const char *path)
{
    const char *slash = strrchr(path, '/'), *base = slash ? slash + 1 : path;
    size_t length = strlen(base);
    if (length > 3 && strcasecmp(base + length - 3, ".gz") == 0) length -= 3;
    for (size_t i = length; i-- > 1;) /* a leading dot starts a name, not an extension */
        if (base[i] == '.') return copy(base, i);
    return copy(base, length);
}

/* The path with symbolic links and ".." resolved as far as it exists: the longest existing
 * beginning by realpath, the rest appended. */
static char *absolute(const char *path)
{
    char *whole = realpath(path, NULL);
    if (whole || strcmp(path, ".") == 0 || strcmp(path, "/") == 0) return whole;
    char *folder = apsm_path_folder(path);
    char *above = folder ? absolute(folder) : NULL;
    free(folder);
    if (!above) return NULL;
    const char *slash = strrchr(path, '/');
    char *result = apsm_path_join(above, slash ? slash + 1 : path);
    free(above);
    return result;
}

char *apsm_path_relative(const char *folder, const char *path)
{
    char *from = absolute(folder), *to = absolute(path), *result = NULL;
    if (!from || !to) goto done;
    size_t common = 0; /* up to and with the last slash that both share */
    for (size_t i = 0;; i++) {
        const bool from_ends = from[i] == '\0' || from[i] == '/';
        const bool to_ends = to[i] == '\0' || to[i] == '/';
        if (from_ends && to_ends) common = i;
        if (from[i] != to[i] || from[i] == '\0') break;
    }
    size_t ups = 0;
    for (const char *c = from + common; *c; c++) ups += *c == '/' && c[1] != '\0';
    const char *rest = to + common;
    while (*rest == '/') rest++;
    result = malloc(3 * ups + strlen(rest) + 2);
    if (!result) goto done;
    result[0] = '\0';
    for (size_t i = 0; i < ups; i++) strcat(result, "../");
    strcat(result, rest);
    if (!*rest) strcpy(result + strlen(result) - (ups > 0), ups ? "" : ".");
done:
    free(from);
    free(to);
    return result;
}
