/* One run at a time in a folder: flock on a file in it.  The kernel drops the lock when the
 * process ends, so a killed run leaves nothing that has to be cleaned up by hand. */
#include "files/io.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

/* The file may have been removed by its last holder between our open and our flock: then we hold
 * a lock on nothing. */
static bool still_there(int fd, const char *path)
{
    struct stat mine, there;
    return fstat(fd, &mine) == 0 && stat(path, &there) == 0 && mine.st_ino == there.st_ino &&
           mine.st_dev == there.st_dev;
}

/* Locks path; *error is 0, or the errno that stopped us.  Returns the descriptor. */
static int take(const char *path, int *error)
{
    for (;;) {
        const int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
        *error = fd < 0 ? errno : 0;
        if (fd < 0) return -1;
        int result;
        do result = flock(fd, LOCK_EX | LOCK_NB);
        while (result != 0 && errno == EINTR);
        if (result != 0) *error = errno;
        if (*error || still_there(fd, path)) return fd;
        close(fd);
    }
}

static apsm_status refuse(apsm_context *ctx, const char *folder, int fd)
{
    char owner[64] = "";
    const ssize_t n = pread(fd, owner, sizeof owner - 1, 0);
    if (n <= 0) owner[0] = '\0';
    for (char *c = owner; *c; c++)
        if (*c == '\n') *c = '\0';
    return apsm_fail(ctx, APSM_ERR_STATE,
                     "%s: another apsm (process %s) is working in this folder; wait for it or "
                     "choose another folder",
                     folder, *owner ? owner : "unknown");
}

static void sign(int fd)
{
    char text[64];
    const int length = snprintf(text, sizeof text, "%ld\n", (long)getpid());
    /* Only a courtesy to the process that is refused: a failure costs its number in a message. */
    if (ftruncate(fd, 0) != 0 || pwrite(fd, text, (size_t)length, 0) != length) return;
}

apsm_status apsm_lock_folder(apsm_context *ctx, const char *folder, apsm_lock *lock)
{
    *lock = (apsm_lock){ .fd = -1 };
    char *path = apsm_path_join(folder, ".apsm.lock");
    if (!path) return apsm_fail_errno(ctx, folder, "cannot be locked", ENOMEM);
    int error;
    const int fd = take(path, &error);
    apsm_status status = APSM_OK;
    if (!error) {
        sign(fd);
        *lock = (apsm_lock){ .fd = fd, .path = path };
        return APSM_OK;
    }
    if (error == EWOULDBLOCK)
        status = refuse(ctx, folder, fd);
    else if (fd < 0)
        status = apsm_fail_errno(ctx, folder, "cannot be locked", error);
    else
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%s: this file system has no locks; do not run apsm in it twice at a time",
                 folder);
    if (fd >= 0) close(fd);
    free(path);
    return status;
}

void apsm_unlock_folder(apsm_lock *lock)
{
    if (lock->path) {
        unlink(lock->path); /* while it is still locked: see still_there */
        close(lock->fd);
        free(lock->path);
    }
    *lock = (apsm_lock){ .fd = -1 };
}
