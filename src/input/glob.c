#include "input/glob.h"

#include <fnmatch.h>
#include <stddef.h>
#include <string.h>

enum { MOST_PARTS = 64, MOST_LENGTH = 4096 };

/* text, which is changed, to its components; the number of them, or 0 if they are too many. */
static size_t split(char *text, const char *parts[MOST_PARTS])
{
    size_t n = 0;
    for (char *part = strtok_r(text, "/", &text); part; part = strtok_r(NULL, "/", &text)) {
        if (n == MOST_PARTS) return 0;
        parts[n++] = part;
    }
    return n;
}

static bool is_any(const char *part)
{
    return strcmp(part, "**") == 0;
}

/* reach[k]: the components of the pattern so far mean the first k of the path. */
static bool match_parts(size_t n, const char *const *pattern, size_t m, const char *const *path)
{
    bool reach[MOST_PARTS + 1] = { true };
    for (size_t p = 0; p < n; p++) {
        bool next[MOST_PARTS + 1] = { false };
        for (size_t k = 0; k <= m; k++) {
            if (is_any(pattern[p]))
                next[k] = reach[k] || (k > 0 && next[k - 1]);
            else
                next[k] = k > 0 && reach[k - 1] && fnmatch(pattern[p], path[k - 1], 0) == 0;
        }
        memcpy(reach, next, sizeof reach);
    }
    return reach[m];
}

bool glob_matches(const char *pattern, const char *path)
{
    char words[MOST_LENGTH], text[MOST_LENGTH];
    const char *wanted[MOST_PARTS], *parts[MOST_PARTS];
    if (strlen(pattern) >= sizeof words || strlen(path) >= sizeof text) return false;
    strcpy(words, pattern);
    strcpy(text, path);
    const size_t n = split(words, wanted), m = split(text, parts);
    if (n == 0 || m == 0) return false;
    if (n == 1 && !is_any(wanted[0])) return fnmatch(wanted[0], parts[m - 1], 0) == 0;
    return match_parts(n, wanted, m, parts);
}
