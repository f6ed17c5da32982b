/* scratch.h -- a folder of its own for a test that writes files, and what tests of readers say
 * again and again.  Include after <cmocka.h>. */
#ifndef APSM_TEST_SCRATCH_H
#define APSM_TEST_SCRATCH_H

#include <dirent.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "apsm/context.h"

enum { SCRATCH_LENGTH = 512 };

/* Makes an empty folder; removed by scratch_remove. */
static inline void scratch_make(char folder[SCRATCH_LENGTH])
{
    const char *const base = getenv("TMPDIR");
    snprintf(folder, SCRATCH_LENGTH, "%s/apsm-test-XXXXXX", base ? base : "/tmp");
    assert_non_null(mkdtemp(folder));
}

static inline const char *scratch_path(const char *folder, const char *name)
{
    static char path[8][2 * SCRATCH_LENGTH];
    static int next = 0;
    char *const p = path[next++ % 8];
    snprintf(p, sizeof path[0], "%s/%s", folder, name);
    return p;
}

static inline size_t scratch_count(const char *folder)
{
    size_t n = 0;
    DIR *const dir = opendir(folder);
    for (const struct dirent *e; dir && (e = readdir(dir));)
        n += strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0;
    if (dir) closedir(dir);
    return n;
}

static inline int scratch_remove_entry(const char *path, const struct stat *info, int type,
                                       struct FTW *where)
{
    (void)info, (void)type, (void)where;
    return remove(path);
}

static inline void scratch_remove(const char *folder)
{
    nftw(folder, scratch_remove_entry, 8, FTW_DEPTH | FTW_PHYS);
}

static inline void scratch_write(const char *path, const void *bytes, size_t size)
{
    FILE *const f = fopen(path, "wb");
    assert_non_null(f);
    assert_true(fwrite(bytes, 1, size, f) == size);
    assert_int_equal(fclose(f), 0);
}

static inline char *scratch_read(const char *path, size_t *size)
{
    FILE *const f = fopen(path, "rb");
    if (!f) fail_msg("%s cannot be opened", path);
    fseek(f, 0, SEEK_END);
    *size = (size_t)ftell(f);
    rewind(f);
    char *const bytes = malloc(*size + 1);
    assert_non_null(bytes);
    assert_true(fread(bytes, 1, *size, f) == *size);
    bytes[*size] = '\0';
    fclose(f);
    return bytes;
}

/* The call has failed as it should, with one line that holds both words. */
static inline void expect_failure(apsm_context *context, apsm_status got, apsm_status wanted,
                                  const char *words, const char *other)
{
    const char *const line = apsm_error_text(context);
    if (got != wanted) fail_msg("status %d instead of %d: %s", got, wanted, line);
    if (!strstr(line, words)) fail_msg("'%s' is not in: %s", words, line);
    if (!strstr(line, other)) fail_msg("'%s' is not in: %s", other, line);
    if (strchr(line, '\n')) fail_msg("more than one line: %s", line);
}

#endif
