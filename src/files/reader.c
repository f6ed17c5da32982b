/* Whole files into memory. */
#include "files/io.h"

#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Makes room for at least one more byte than used, up to limit + 1 (so that a file that is too
 * long shows), and a final NUL.  The size that stat tells is a hint: files grow. */
static bool grow(char **data, size_t *capacity, size_t used, size_t limit)
{
    if (used < *capacity) return true;
    size_t wanted = *capacity ? 2 * *capacity : 4096;
    if (wanted > limit) wanted = limit + 1;
    char *larger = realloc(*data, wanted + 1);
    if (!larger) return false;
    *data = larger;
    *capacity = wanted;
    return true;
}

/* Nobody waits for a pipe. */
apsm_status apsm_open_regular(apsm_context *ctx, const char *path, int *fd)
{
    struct stat info = { 0 };
    *fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    const int error = *fd < 0 || fstat(*fd, &info) != 0 ? errno : 0;
    if (!error && S_ISREG(info.st_mode)) return APSM_OK;
    if (*fd >= 0) close(*fd);
    *fd = -1;
    if (error || S_ISDIR(info.st_mode))
        return apsm_fail_errno(ctx, path, "cannot be read", error ? error : EISDIR);
    return apsm_fail(ctx, APSM_ERR_IO, "%s: is a pipe or device, not a file; save it as a file",
                     path);
}

static apsm_status read_all(apsm_context *ctx, const char *path, int fd, size_t limit, char **data,
                            size_t *size)
{
    struct stat info;
    if (fstat(fd, &info) != 0) return apsm_fail_errno(ctx, path, "cannot be read", errno);
    size_t capacity = 0;
    if (info.st_size > 0 && (size_t)info.st_size < limit) {
        *data = malloc((size_t)info.st_size + 2);
        if (!*data) return apsm_fail_errno(ctx, path, "cannot be read", ENOMEM);
        capacity = (size_t)info.st_size + 1;
    }
    for (*size = 0;;) {
        if (!grow(data, &capacity, *size, limit))
            return apsm_fail_errno(ctx, path, "cannot be read", ENOMEM);
        const ssize_t n = read(fd, *data + *size, capacity - *size);
        if (n == 0) break;
        if (n < 0 && errno != EINTR) return apsm_fail_errno(ctx, path, "cannot be read", errno);
        if (n > 0) *size += (size_t)n;
        if (*size > limit)
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s: larger than the %zu bytes such a file may have; is it the right "
                             "file?",
                             path, limit);
    }
    (*data)[*size] = '\0';
    return APSM_OK;
}

apsm_status apsm_read_file(apsm_context *ctx, const char *path, size_t limit, char **data,
                           size_t *size)
{
    *data = NULL;
    *size = 0;
    int fd;
    APSM_TRY(apsm_open_regular(ctx, path, &fd));
    const apsm_status status = read_all(ctx, path, fd, limit, data, size);
    close(fd);
    if (status != APSM_OK) {
        free(*data);
        *data = NULL;
        *size = 0;
    }
    return status;
}

bool apsm_is_utf8(const char *text)
{
    json_t *const string = json_string(text);
    json_decref(string);
    return string != NULL;
}

bool apsm_is_utf16(const char *data, size_t size)
{
    return size > 1 && (memcmp(data, "\xff\xfe", 2) == 0 || memcmp(data, "\xfe\xff", 2) == 0);
}

apsm_status apsm_read_text(apsm_context *ctx, const char *path, size_t limit, char **data,
                           size_t *size)
{
    APSM_TRY(apsm_read_file(ctx, path, limit, data, size));
    char *const text = *data;
    if (apsm_is_utf16(text, *size)) {
        free(text);
        *data = NULL;
        *size = 0;
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: is text in UTF-16; save it as UTF-8", path);
    }
    if (*size >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0) {
        *size -= 3;
        memmove(text, text + 3, *size + 1);
    }
    for (size_t k = 0; k < *size; k++)
        if (text[k] == '\r' && text[k + 1] != '\n') text[k] = '\n';
    return APSM_OK;
}
