/* folder.h -- a folder of its own for every test that writes files: set up, filled, looked at,
 * removed.  Use folder_set_up and folder_tear_down as cmocka fixtures; *state is the path. */
#ifndef APSM_TEST_FOLDER_H
#define APSM_TEST_FOLDER_H

#include <dirent.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { TEST_PATH = 1024 };

static inline int folder_set_up(void **state)
{
    const char *base = getenv("TMPDIR");
    char *path = malloc(TEST_PATH);
    if (!path) return -1;
    snprintf(path, TEST_PATH, "%s/apsm_test_XXXXXX", base ? base : "/tmp");
    *state = path;
    return mkdtemp(path) ? 0 : -1;
}

static inline int folder_remove_one(const char *path, const struct stat *info, int kind,
                                    struct FTW *where)
{
    (void)info;
    (void)kind;
    (void)where;
    return remove(path);
}

static inline int folder_tear_down(void **state)
{
    nftw(*state, folder_remove_one, 16, FTW_DEPTH | FTW_PHYS);
    free(*state);
    return 0;
}

/* folder/name in path; returns path. */
static inline const char *folder_path(void **state, const char *name, char path[TEST_PATH])
{
    snprintf(path, TEST_PATH, "%s/%s", (const char *)*state, name);
    return path;
}

/* Writes size bytes plainly, without the library. */
static inline void folder_put(void **state, const char *name, const void *data, size_t size)
{
    char path[TEST_PATH];
    FILE *file = fopen(folder_path(state, name, path), "wb");
    if (!file || (size && fwrite(data, 1, size, file) != size) || fclose(file) != 0) abort();
}

/* How many entries the folder has, hidden ones too. */
static inline int folder_count(const char *path)
{
    int n = 0;
    DIR *folder = opendir(path);
    for (struct dirent *e; folder && (e = readdir(folder));)
        n += strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0;
    if (folder) closedir(folder);
    return n;
}

#endif
