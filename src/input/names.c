#include "input/names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"

/* A path as its components, the last without its extension. */
typedef struct parts {
    char *text;        /* owned; its slashes are zeros */
    const char **room; /* owned */
    const char **part; /* in room */
    size_t n;
} parts;

static void parts_free(size_t n, parts *all)
{
    for (size_t i = 0; all && i < n; i++) {
        free(all[i].text);
        free(all[i].room);
    }
    free(all);
}

static bool split(const apsm_input_case *c, parts *p)
{
    const bool series = c->kind == APSM_INPUT_DICOM && apsm_is_folder(c->path);
    char *stem = series ? strdup(c->path) : apsm_path_stem(c->path);
    const char *slash = strrchr(c->path, '/');
    const size_t head = !series && slash ? (size_t)(slash - c->path) + 1 : 0;
    if (stem) p->text = malloc(head + strlen(stem) + 1);
    p->room = p->part = malloc((strlen(c->path) + 1) * sizeof *p->room);
    if (p->text) {
        memcpy(p->text, c->path, head);
        strcpy(p->text + head, stem);
    }
    free(stem);
    if (!p->text || !p->part) return false;
    char *rest = p->text;
    for (char *part = strtok_r(rest, "/", &rest); part; part = strtok_r(NULL, "/", &rest))
        if (strcmp(part, ".") != 0) p->part[p->n++] = part;
    if (p->n == 0) p->part[p->n++] = p->text; /* "/" or "." as a series */
    return true;
}

/* Whether all have the component k, counted from the beginning or from the end, and the same. */
static bool is_common(size_t n, const parts *all, size_t k, bool from_end)
{
    for (size_t i = 0; i < n; i++) {
        if (k + 1 >= all[i].n && !from_end) return false; /* the last one stays */
        if (k >= all[i].n) return false;
        const char *a = all[0].part[from_end ? all[0].n - 1 - k : k];
        const char *b = all[i].part[from_end ? all[i].n - 1 - k : k];
        if (strcmp(a, b) != 0) return false;
    }
    return true;
}

/* What is the same in all is left out: at the beginning, at the end and, if all are as deep, in
 * between. */
static void leave_out_common(size_t n, parts *all)
{
    size_t from = 0, behind = 0, shallow = all[0].n, deep = all[0].n;
    while (is_common(n, all, from, false)) from++;
    for (size_t i = 0; i < n; i++) {
        all[i].part += from;
        all[i].n -= from;
        if (i == 0 || all[i].n < shallow) shallow = all[i].n;
        if (i == 0 || all[i].n > deep) deep = all[i].n;
    }
    while (behind + 1 < shallow && is_common(n, all, behind, true)) behind++;
    for (size_t i = 0; i < n; i++) all[i].n -= behind;
    if (shallow != deep) return;
    for (size_t k = all[0].n - 1; k-- > 1;) { /* first and last differ */
        if (!is_common(n, all, k, false)) continue;
        for (size_t i = 0; i < n; i++) {
            memmove(all[i].part + k, all[i].part + k + 1, (all[i].n - k - 1) * sizeof *all[i].part);
            all[i].n--;
        }
    }
}

static char *joined(const parts *p)
{
    size_t length = 1;
    for (size_t k = 0; k < p->n; k++) length += strlen(p->part[k]) + 1;
    char *name = malloc(length), *at = name;
    for (size_t k = 0; name && k < p->n; k++) at += sprintf(at, "%s%s", k ? "_" : "", p->part[k]);
    return name;
}

static int by_text(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Whether the last components differ from each other. */
static apsm_status are_unique(size_t n, const parts *all, bool *unique)
{
    const char **stem = malloc(n * sizeof *stem);
    if (!stem) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < n; i++) stem[i] = all[i].part[all[i].n - 1];
    qsort(stem, n, sizeof *stem, by_text);
    *unique = true;
    for (size_t i = 1; i < n; i++) *unique = *unique && strcmp(stem[i - 1], stem[i]) != 0;
    free(stem);
    return APSM_OK;
}

static apsm_status name_all(apsm_input_list *list, parts *all)
{
    const size_t n = list->n;
    bool unique;
    for (size_t i = 0; i < n; i++)
        if (!split(&list->cases[i], &all[i])) return APSM_ERR_MEMORY;
    APSM_TRY(are_unique(n, all, &unique));
    for (size_t i = 0; unique && i < n; i++) {
        all[i].part[0] = all[i].part[all[i].n - 1];
        all[i].n = 1;
    }
    if (!unique) leave_out_common(n, all);
    for (size_t i = 0; i < n; i++) {
        if (list->cases[i].name) continue;
        list->cases[i].name = joined(&all[i]);
        if (!list->cases[i].name) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

apsm_status input_names(apsm_context *ctx, apsm_input_list *list)
{
    if (list->n == 0) return APSM_OK;
    parts *all = calloc(list->n, sizeof *all);
    const apsm_status status = all ? name_all(list, all) : APSM_ERR_MEMORY;
    parts_free(list->n, all);
    if (status == APSM_OK) return APSM_OK;
    return apsm_fail(ctx, status, "out of memory while listing the inputs");
}
