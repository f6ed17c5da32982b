#define _GNU_SOURCE /* mkostemp */
#include "files/records.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include "files/io.h"

int apsm_open_unnamed(const char *folder, int *error)
{
    char *path = apsm_path_join(folder, "shapes.XXXXXX");
    int fd = -1;
    *error = ENOMEM;
    if (path) {
        fd = mkostemp(path, O_CLOEXEC);
        *error = fd < 0 ? errno : 0;
        if (fd >= 0) unlink(path);
    }
    free(path);
    return fd;
}

int apsm_write_at(int fd, const unsigned char *data, size_t size, size_t offset)
{
    while (size > 0) {
        const ssize_t n = pwrite(fd, data, size, (off_t)offset);
        if (n < 0 && errno != EINTR) return errno;
        if (n <= 0) continue;
        data += n;
        size -= (size_t)n;
        offset += (size_t)n;
    }
    return 0;
}

/* An end before the record's is an error, too. */
static int read_at(int fd, unsigned char *data, size_t size, size_t offset)
{
    while (size > 0) {
        const ssize_t n = pread(fd, data, size, (off_t)offset);
        if (n == 0) return EIO;
        if (n < 0 && errno != EINTR) return errno;
        if (n < 0) continue;
        data += n;
        size -= (size_t)n;
        offset += (size_t)n;
    }
    return 0;
}

apsm_status records_open(apsm_context *ctx, const char *folder, size_t size, records *r)
{
    int error;
    *r = (records){ folder, size, apsm_open_unnamed(folder, &error) };
    return r->fd >= 0
               ? APSM_OK
               : apsm_fail_errno(ctx, folder, "no file for records can be made there", error);
}

void records_close(records *r)
{
    if (r->fd >= 0) close(r->fd);
    r->fd = -1;
}

apsm_status records_put(apsm_context *ctx, const records *r, size_t i, const void *record)
{
    const int error = apsm_write_at(r->fd, record, r->size, i * r->size);
    return error ? apsm_fail_errno(ctx, r->folder, "records cannot be stored there", error)
                 : APSM_OK;
}

apsm_status records_get(apsm_context *ctx, const records *r, size_t i, void *record)
{
    const int error = read_at(r->fd, record, r->size, i * r->size);
    return error ? apsm_fail_errno(ctx, r->folder, "records cannot be read again", error) : APSM_OK;
}
