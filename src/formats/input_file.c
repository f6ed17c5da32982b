#include "formats/input_file.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

bool path_ends_in(const char *path, const char *extension)
{
    const size_t n = strlen(path), end = strlen(extension);
    return n > end && strcasecmp(path + n - end, extension) == 0;
}

const char *path_extension(const char *path)
{
    const char *const slash = strrchr(path, '/'), *const dot = strrchr(path, '.');
    return dot && (!slash || dot > slash) ? dot : "";
}

static bool begins(const char *bytes, size_t size, const char *text)
{
    return size >= strlen(text) && strncasecmp(bytes, text, strlen(text)) == 0;
}

static apsm_status refuse_stranger(apsm_context *ctx, const char *path, const char *bytes,
                                   size_t size)
{
    if (size == 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: is empty; copy or export it again", path);
    if (begins(bytes, size, "version https://git-lfs.github.com/spec/"))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: is a pointer of Git LFS, not the file itself; run 'git lfs pull' in "
                         "its folder",
                         path);
    if (begins(bytes, size, "<!doctype html") || begins(bytes, size, "<html"))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: is a web page, not the file itself; download it again", path);
    return APSM_OK;
}

apsm_status input_file_read(apsm_context *ctx, const char *path, char **bytes, size_t *size)
{
    APSM_TRY(apsm_read_file(ctx, path, SIZE_MAX / 2, bytes, size));
    const apsm_status status = refuse_stranger(ctx, path, *bytes, *size);
    if (status == APSM_OK) return APSM_OK;
    free(*bytes);
    *bytes = NULL;
    *size = 0;
    return status;
}
