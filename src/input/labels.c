/* Which labels of a segmentation are the shape. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/input.h"

void apsm_labels_free(apsm_labels *labels)
{
    free(labels->label);
    *labels = (apsm_labels){ 0 };
}

static int by_value(const void *a, const void *b)
{
    const int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

static size_t sort_unique(size_t n, int32_t *label)
{
    size_t kept = 0;
    qsort(label, n, sizeof *label, by_value);
    for (size_t k = 0; k < n; k++)
        if (kept == 0 || label[kept - 1] != label[k]) label[kept++] = label[k];
    return kept;
}

/* One integer that ends at a comma or the end of text. */
static bool parse_label(const char **text, int32_t *label)
{
    char *end;
    errno = 0;
    const long value = strtol(*text, &end, 10);
    if (end == *text || errno || value == 0 || value < INT32_MIN || value > INT32_MAX) return false;
    if (*end == ',' && end[1] != '\0')
        end++;
    else if (*end != '\0')
        return false;
    *text = end;
    *label = (int32_t)value;
    return true;
}

apsm_status apsm_labels_parse(apsm_context *ctx, const char *text, apsm_labels *labels)
{
    *labels = (apsm_labels){ .all = text && strcmp(text, "all") == 0 };
    if (!text || !*text || labels->all) return APSM_OK;
    labels->label = malloc(strlen(text) * sizeof *labels->label);
    if (!labels->label) return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for labels");
    for (const char *rest = text; *rest;)
        if (!parse_label(&rest, &labels->label[labels->n++])) {
            apsm_labels_free(labels);
            return apsm_fail(ctx, APSM_ERR_ARG,
                             "--label '%s': give non-zero integers with commas, or 'all'", text);
        }
    labels->n = sort_unique(labels->n, labels->label);
    return APSM_OK;
}

enum { LISTED = 16 };

/* The labels that occur, up to LISTED of them, ascending; 0 does not count. */
static size_t find_labels(const apsm_volume *v, size_t voxels, int32_t found[LISTED])
{
    size_t n = 0;
    int32_t last = 0;
    for (size_t i = 0; i < voxels && n < LISTED; i++) {
        const int32_t value = v->label[i];
        if (value == last || value == 0) continue;
        last = value;
        size_t k = 0;
        while (k < n && found[k] < value) k++;
        if (k < n && found[k] == value) continue;
        memmove(found + k + 1, found + k, (n - k) * sizeof *found);
        found[k] = value;
        n++;
    }
    return n;
}

static apsm_status refuse_choice(apsm_context *ctx, const char *path, const apsm_volume *v,
                                 size_t voxels, bool chosen)
{
    int32_t found[LISTED];
    char list[LISTED * 13] = "";
    const size_t n = find_labels(v, voxels, found);
    for (size_t k = 0, at = 0; k < n; k++)
        at += (size_t)snprintf(list + at, sizeof list - at, k ? ", %d" : "%d", found[k]);
    if (n == 0)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY, "%s: every voxel is 0; segment the shape first",
                         path);
    return apsm_fail(
        ctx, APSM_ERR_GEOMETRY, "%s: %s %s%s; choose with --label (or --label all)", path,
        chosen ? "none of the chosen labels is in it, but" : "holds several labels:", list,
        n == LISTED ? ", .." : "");
}

/* The chosen labels that occur, as a flag for each. */
static bool is_chosen(const apsm_labels *labels, int32_t value, bool *seen)
{
    if (labels->all) return value != 0;
    size_t lo = 0, hi = labels->n;
    while (lo < hi) {
        const size_t mid = lo + (hi - lo) / 2;
        if (labels->label[mid] < value)
            lo = mid + 1;
        else
            hi = mid;
    }
    if (lo == labels->n || labels->label[lo] != value) return false;
    seen[lo] = true;
    return true;
}

static bool holds_any(const apsm_labels *labels, const apsm_volume *v, size_t voxels, bool *seen)
{
    bool any = false;
    for (size_t i = 0; i < voxels; i++) any |= is_chosen(labels, v->label[i], seen);
    return any;
}

apsm_status apsm_label_union(apsm_context *ctx, const char *path, const apsm_labels *labels,
                             apsm_volume *volume)
{
    const size_t voxels = volume->n[0] * volume->n[1] * volume->n[2];
    const size_t layers = volume->layers ? volume->layers : 1;
    apsm_labels only = { .all = labels->all, .n = labels->n, .label = labels->label };
    int32_t found[LISTED];
    if (!labels->all && labels->n == 0) {
        const size_t n = find_labels(volume, layers * voxels, found);
        if (n != 1) return refuse_choice(ctx, path, volume, layers * voxels, false);
        only.all = true;
    }
    bool *const seen = calloc(only.n + 1, sizeof *seen);
    if (!seen) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    const bool any = holds_any(&only, volume, layers * voxels, seen);
    for (size_t k = 0; any && k < only.n; k++)
        if (!seen[k])
            apsm_log(ctx, APSM_LOG_WARNING, "%s: label %d is not in it", path, only.label[k]);
    for (size_t i = 0; any && i < voxels; i++) {
        bool in = false;
        for (size_t l = 0; l < layers; l++)
            in = in || is_chosen(&only, volume->label[i + l * voxels], seen);
        volume->label[i] = in;
    }
    if (any) volume->layers = 1;
    free(seen);
    return any ? APSM_OK : refuse_choice(ctx, path, volume, layers * voxels, true);
}
