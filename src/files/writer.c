/* A file is written under a temporary name beside its place and renamed when it is whole: rename
 * replaces in one step (POSIX), so a reader, a crash or a full disk never leaves half a file.  The
 * first failed write is remembered and told once, at commit. */
#include "files/io.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { BUFFER = 1 << 16 };

struct apsm_writer {
    apsm_context *ctx;
    char *path, *temp;
    int fd;
    int error; /* errno of the first failure, 0 while all is well */
    size_t used;
    char buffer[BUFFER];
};

static void writer_free(apsm_writer *w)
{
    free(w->path);
    free(w->temp);
    free(w);
}

/* path.PID.tmp: two programs never share one, and what a killed one leaves behind is plain to see.
 */
static char *temp_name(const char *path)
{
    const size_t length = strlen(path) + 32;
    char *temp = malloc(length);
    if (temp) snprintf(temp, length, "%s.%ld.tmp", path, (long)getpid());
    return temp;
}

apsm_status apsm_writer_open(apsm_context *ctx, const char *path, apsm_writer **writer)
{
    *writer = NULL;
    apsm_writer *w = calloc(1, sizeof *w);
    if (!w) return apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
    w->ctx = ctx;
    w->path = strdup(path);
    w->temp = temp_name(path);
    w->fd = -1;
    int error = ENOMEM;
    if (w->path && w->temp) {
        w->fd = open(w->temp, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0666);
        error = errno;
    }
    if (w->fd < 0) {
        writer_free(w);
        return apsm_fail_errno(ctx, path, "cannot be written", error);
    }
    *writer = w;
    return APSM_OK;
}

static void put(apsm_writer *w, const char *data, size_t size)
{
    while (size > 0 && !w->error) {
        const ssize_t n = write(w->fd, data, size);
        if (n >= 0) {
            data += n;
            size -= (size_t)n;
        } else if (errno != EINTR) {
            w->error = errno;
        }
    }
}

static void flush(apsm_writer *w)
{
    put(w, w->buffer, w->used);
    w->used = 0;
}

void apsm_writer_write(apsm_writer *w, const void *data, size_t size)
{
    if (size == 0) return;
    if (size > BUFFER - w->used) flush(w);
    if (size >= BUFFER) {
        put(w, data, size);
    } else {
        memcpy(w->buffer + w->used, data, size);
        w->used += size;
    }
}

/* Formats into the free part of the buffer; if that is too small, into memory of its own. */
void apsm_writer_printf(apsm_writer *w, const char *format, ...)
{
    va_list args, again;
    va_start(args, format);
    va_copy(again, args);
    const locale_t before = apsm_numbers_begin();
    const size_t space = BUFFER - w->used;
    const int length = vsnprintf(w->buffer + w->used, space, format, args);
    if (length < 0) {
        w->error = w->error ? w->error : errno;
    } else if ((size_t)length < space) {
        w->used += (size_t)length;
    } else {
        char *text = malloc((size_t)length + 1);
        if (text) {
            vsnprintf(text, (size_t)length + 1, format, again);
            apsm_writer_write(w, text, (size_t)length);
            free(text);
        } else if (!w->error) {
            w->error = ENOMEM;
        }
    }
    apsm_numbers_end(before);
    va_end(again);
    va_end(args);
}

void apsm_writer_number(apsm_writer *w, double x)
{
    char text[APSM_NUMBER_LENGTH];
    apsm_format_number(x, text);
    apsm_writer_write(w, text, strlen(text));
}

void apsm_writer_csv(apsm_writer *w, const char *text)
{
    if (!strpbrk(text, ",\"\r\n")) {
        apsm_writer_write(w, text, strlen(text));
        return;
    }
    apsm_writer_write(w, "\"", 1);
    for (const char *c = text; *c; c++)
        apsm_writer_write(w, *c == '"' ? "\"\"" : c, 1 + (*c == '"'));
    apsm_writer_write(w, "\"", 1);
}

bool apsm_writer_failed(const apsm_writer *w)
{
    return w->error != 0;
}

/* A folder's entry survives a power cut only after an fsync of the folder; some file systems
 * do not offer that, and then need none. */
int apsm_sync_folder_of(const char *path)
{
    char *folder = apsm_path_folder(path);
    if (!folder) return ENOMEM;
    const int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    int error = fd < 0 ? errno : 0;
    free(folder);
    if (fd >= 0 && fsync(fd) != 0) error = errno;
    if (fd >= 0) close(fd);
    return error == EINVAL || error == ENOTSUP || error == EACCES ? 0 : error;
}

static int replace(const char *temp, const char *path)
{
    return rename(temp, path) == 0 ? apsm_sync_folder_of(path) : errno;
}

apsm_status apsm_writer_commit(apsm_writer *w)
{
    if (!w) return APSM_ERR_ARG;
    flush(w);
    if (!w->error && fsync(w->fd) != 0 && errno != EINVAL && errno != ENOTSUP) w->error = errno;
    if (close(w->fd) != 0 && !w->error) w->error = errno;
    if (!w->error) w->error = replace(w->temp, w->path);
    apsm_status status = APSM_OK;
    if (w->error) {
        unlink(w->temp);
        status = apsm_fail_errno(w->ctx, w->path, "cannot be written", w->error);
    }
    writer_free(w);
    return status;
}

void apsm_writer_abort(apsm_writer *w)
{
    if (!w) return;
    close(w->fd);
    unlink(w->temp);
    writer_free(w);
}

apsm_status apsm_replace_file(apsm_context *ctx, const char *temp, const char *path)
{
    const int fd = open(temp, O_RDONLY | O_CLOEXEC);
    int error = fd < 0 ? errno : 0;
    if (fd >= 0 && fsync(fd) != 0 && errno != EINVAL && errno != ENOTSUP) error = errno;
    if (fd >= 0) close(fd);
    if (!error) error = replace(temp, path);
    if (!error) return APSM_OK;
    unlink(temp);
    return apsm_fail_errno(ctx, path, "cannot be written", error);
}
