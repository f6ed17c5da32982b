#include "folder/stages.h"

#include <string.h>

#include "folder/names.h"

/* In their order.  The report is none to be timed: it tells the times of the others. */
static const char *const stages[] = { "groom", "initialize", "optimize", "evaluate", "report" };
enum { STAGES = sizeof stages / sizeof stages[0] };

bool stage_is_before(const char *stage, const char *other)
{
    for (size_t k = 0; k < STAGES; k++) {
        if (strcmp(stages[k], other) == 0) return false;
        if (strcmp(stages[k], stage) == 0) return true;
    }
    return false;
}

bool stage_is_known(const char *stage)
{
    for (size_t k = 0; k < STAGES; k++)
        if (strcmp(stages[k], stage) == 0) return true;
    return false;
}

const char *stage_name(size_t k)
{
    return k < STAGES - 1 ? stages[k] : NULL;
}

const char *stage_of_all(size_t k)
{
    return k < STAGES ? stages[k] : NULL;
}

/* ---- their files ---- */

/* Files with one name each; stage as in the manifest. */
static const struct {
    const char *path, *stage;
} single[] = { { FOLDER_INITIAL, "initialize" },      { FOLDER_CHECKPOINT, "optimize" },
               { FOLDER_HISTORY, "optimize" },        { FOLDER_MODEL, "evaluate" },
               { FOLDER_SCORES_CSV, "evaluate" },     { FOLDER_EVALUATION, "evaluate" },
               { FOLDER_EVALUATION_CSV, "evaluate" }, { FOLDER_CERTIFICATE, "evaluate" },
               { FOLDER_REPORT, "report" },           { FOLDER_LANDMARKS, "groom" },
               { FOLDER_FEATURES, "evaluate" },       { FOLDER_CALIBRATION, "evaluate" },
               { FOLDER_PROJECT, "groom" },           { FOLDER_PROJECT, "initialize" },
               { FOLDER_PROJECT, "optimize" },        { FOLDER_PROJECT, "evaluate" } };
enum { SINGLE = sizeof single / sizeof single[0] };

/* Folders that hold files of one kind; particles/ is initialize's and then optimize's. */
static const struct {
    const char *folder, *extension, *stage;
} kinds[] = { { "groomed/", ".ply", "groom" },
              { "groomed/whole/", ".ply", "groom" },
              { "fixed/", ".particles", "groom" },
              { "constraints/", ".json", "groom" },
              { "particles/", ".particles", "initialize" },
              { "particles/", ".particles", "optimize" },
              { "meshes/", ".ply", "evaluate" } };
enum { KINDS = sizeof kinds / sizeof kinds[0] };

static bool is_of_kind(const char *path, size_t length, size_t k)
{
    const size_t begin = strlen(kinds[k].folder), end = strlen(kinds[k].extension);
    return length > begin + end && strncmp(path, kinds[k].folder, begin) == 0 &&
           !memchr(path + begin, '/', length - begin) &&
           strncmp(path + length - end, kinds[k].extension, end) == 0;
}

/* Whether the stage (NULL: any) writes files of the name path[0..length). */
static bool writes(const char *stage, const char *path, size_t length)
{
    for (size_t k = 0; k < SINGLE; k++)
        if ((!stage || strcmp(stage, single[k].stage) == 0) && strlen(single[k].path) == length &&
            strncmp(path, single[k].path, length) == 0)
            return true;
    for (size_t k = 0; k < KINDS; k++)
        if ((!stage || strcmp(stage, kinds[k].stage) == 0) && is_of_kind(path, length, k))
            return true;
    return false;
}

static bool is_ours(const char *path, size_t length)
{
    return writes(NULL, path, length) ||
           (length == strlen(FOLDER_MANIFEST) && strncmp(path, FOLDER_MANIFEST, length) == 0);
}

bool stage_writes(const char *stage, const char *path)
{
    return writes(stage, path, strlen(path));
}

bool stages_write_between(const char *first, const char *last, const char *path)
{
    for (size_t k = 0; stage_of_all(k); k++) {
        const char *stage = stage_of_all(k);
        const bool between = !stage_is_before(stage, first) &&
                             (strcmp(stage, last) == 0 || stage_is_before(stage, last));
        if (between && stage_writes(stage, path)) return true;
    }
    return strcmp(path, FOLDER_MANIFEST) == 0;
}

bool folder_is_ours(const char *path)
{
    return is_ours(path, strlen(path)) || strcmp(path, ".apsm.lock") == 0 ||
           strcmp(path, FOLDER_JOURNAL) == 0;
}

size_t folder_left_over(const char *path)
{
    static const char store[] = "state/shapes."; /* of --memory, with six letters more */
    size_t n = strlen(path);
    if (n == sizeof store + 5 && strncmp(path, store, sizeof store - 1) == 0) return n;
    if (n < 4 || strcmp(path + n - 4, ".tmp") != 0) return 0;
    n -= 4;
    const size_t end = n;
    while (n > 0 && path[n - 1] >= '0' && path[n - 1] <= '9') n--;
    if (n == end || n == 0 || path[n - 1] != '.') return 0;
    return is_ours(path, n - 1) ? n - 1 : 0;
}
