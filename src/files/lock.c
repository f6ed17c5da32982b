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

static const char lock_name[] = ".apsm.lock";

/* The file may have been removed by its last holder between our open and our flock: then we hold
 * a lock on nothing. */
static bool still_there(int fd, int folder)
{
    struct stat mine, there;
    return fstat(fd, &mine) == 0 && fstatat(folder, lock_name, &there, AT_SYMLINK_NOFOLLOW) == 0 &&
           mine.st_ino == there.st_ino && mine.st_dev == there.st_dev;
}

/* A file of one name that holds at most the number of a process: nobody's but ours.  Others are
 * neither written to nor removed. */
static bool is_ours(int fd)
{
    struct stat info;
    char text[32];
    if (fstat(fd, &info) != 0 || !S_ISREG(info.st_mode) || info.st_nlink > 1) return false;
    if (info.st_size >= (off_t)sizeof text) return false;
    const ssize_t n = pread(fd, text, sizeof text, 0);
    for (ssize_t k = 0; k < n; k++)
        if (text[k] != '\n' && (text[k] < '0' || text[k] > '9')) return false;
    return n >= 0;
}

/* Locks the file; *error is 0, or the errno that stopped us: EEXIST if it is none of ours.  Returns
 * the descriptor. */
static int take(int folder, int *error)
{
    for (;;) {
        const int fd =
            openat(folder, lock_name, O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
        *error = fd < 0 ? errno : 0;
        if (*error == ELOOP || *error == EISDIR || *error == ENXIO) *error = EEXIST;
        if (fd < 0) return -1;
        if (still_there(fd, folder) && !is_ours(fd)) *error = EEXIST;
        if (*error) return fd;
        int result;
        do result = flock(fd, LOCK_EX | LOCK_NB);
        while (result != 0 && errno == EINTR);
        if (result != 0) *error = errno;
        if (*error || still_there(fd, folder)) return fd;
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

/* What take's error means. */
static apsm_status judge(apsm_context *ctx, const char *folder, int fd, int error)
{
    if (error == EWOULDBLOCK) return refuse(ctx, folder, fd);
    if (error == EEXIST)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s/%s: is a link or a file that apsm did not make; remove it", folder,
                         lock_name);
    if (fd < 0) return apsm_fail_errno(ctx, folder, "cannot be locked", error);
    apsm_log(ctx, APSM_LOG_WARNING,
             "%s: this file system has no locks; do not run apsm in it twice at a time", folder);
    return APSM_OK;
}

apsm_status apsm_lock_folder(apsm_context *ctx, const char *folder, apsm_lock *lock)
{
    *lock = (apsm_lock){ .fd = -1, .folder = -1 };
    const int place = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (place < 0) return apsm_fail_errno(ctx, folder, "cannot be locked", errno);
    int error;
    const int fd = take(place, &error);
    if (!error) {
        sign(fd);
        *lock = (apsm_lock){ .fd = fd, .folder = place };
        return APSM_OK;
    }
    const apsm_status status = judge(ctx, folder, fd, error);
    if (fd >= 0) close(fd);
    close(place);
    return status;
}

apsm_status apsm_make_locked_folder(apsm_context *ctx, const char *folder, size_t *made,
                                    apsm_lock *lock)
{
    *lock = (apsm_lock){ .fd = -1, .folder = -1 };
    APSM_TRY(apsm_missing_folders(ctx, folder, made));
    apsm_status status = apsm_make_folder(ctx, folder);
    if (status == APSM_OK) status = apsm_lock_folder(ctx, folder, lock);
    if (status == APSM_OK) return APSM_OK;
    if (status != APSM_ERR_STATE) apsm_remove_empty_folders(folder, *made);
    *made = 0;
    return status;
}

void apsm_unlock_folder(apsm_lock *lock)
{
    if (lock->fd > 0) {
        unlinkat(lock->folder, lock_name, 0); /* while it is still locked: see still_there */
        close(lock->fd);
        close(lock->folder);
    }
    *lock = (apsm_lock){ .fd = -1, .folder = -1 };
}
