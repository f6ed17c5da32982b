/* Why a file operation failed, and what to do about it, in one line. */
#include "files/io.h"

#include <errno.h>
#include <string.h>

static const char *remedy(int error)
{
    switch (error) {
    case ENOENT:
        return "check the name and that its folder exists";
    case EACCES:
    case EPERM:
        return "check the permissions or choose another folder";
    case EROFS:
        return "choose a folder on a disk that can be written";
    case ENOSPC:
    case EDQUOT:
        return "free some space or choose another disk";
    case ENOMEM:
        return "close other programs";
    case EFBIG:
        return "raise the limit on file sizes (ulimit -f)";
    case EISDIR:
        return "it is a folder: give the name of a file";
    case ENOTDIR:
        return "a part of the path is a file, not a folder";
    case EMFILE:
    case ENFILE:
        return "raise the limit on open files (ulimit -n)";
    case ENAMETOOLONG:
        return "choose a shorter name";
    default:
        return "check the disk and try again";
    }
}

apsm_status apsm_fail_errno(apsm_context *ctx, const char *path, const char *what, int error)
{
    char reason[128];
    if (strerror_r(error, reason, sizeof reason)) strcpy(reason, "unknown error");
    return apsm_fail(ctx, error == ENOMEM ? APSM_ERR_MEMORY : APSM_ERR_IO, "%s: %s: %s; %s", path,
                     what, reason, remedy(error));
}
