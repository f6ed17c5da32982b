/* Which labels of a segmentation are the shape. */
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "files/files.h"
#include "geometry/volume.h"
#include "input/input.h"

void apsm_labels_free(apsm_labels *labels)
{
    for (size_t k = 0; k < labels->names; k++) free(labels->name[k]);
    free(labels->name);
    free(labels->label);
    *labels = (apsm_labels){ 0 };
}

/* ---- from text ---- */

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

/* One integer that fills text[0..length). */
static bool parse_label(const char *text, size_t length, int32_t *label)
{
    char *end;
    errno = 0;
    const long value = strtol(text, &end, 10);
    if (end != text + length || errno || value == 0 || value < INT32_MIN || value > INT32_MAX)
        return false;
    *label = (int32_t)value;
    return true;
}

/* Begins like a number, or like nothing. */
static bool is_name(const char *text, size_t length)
{
    return length > 0 && !strchr("0123456789+-<> ", text[0]) && !iscntrl((unsigned char)text[0]);
}

static apsm_status take_part(apsm_context *ctx, const char *text, const char *part, size_t length,
                             apsm_labels *labels)
{
    if (is_name(part, length)) {
        char *const name = strndup(part, length);
        if (!name) return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for labels");
        labels->name[labels->names++] = name;
        return APSM_OK;
    }
    if (parse_label(part, length, &labels->label[labels->n++])) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "--label '%s': give non-zero integers or names of segments with commas, "
                     "'all', or a bound such as '>0.5'",
                     text);
}

static apsm_status parse_bound(apsm_context *ctx, const char *text, apsm_labels *labels)
{
    labels->side = text[0];
    if (apsm_parse_number(text + 1, strlen(text + 1), &labels->level)) return APSM_OK;
    labels->side = 0;
    return apsm_fail(ctx, APSM_ERR_ARG, "--label '%s': give a number after the sign, '>0.5'", text);
}

apsm_status apsm_labels_parse(apsm_context *ctx, const char *text, apsm_labels *labels)
{
    *labels = (apsm_labels){ .all = text && strcmp(text, "all") == 0 };
    if (!text || !*text || labels->all) return APSM_OK;
    if (*text == '<' || *text == '>') return parse_bound(ctx, text, labels);
    const size_t most = strlen(text) + 1;
    labels->label = malloc(most * sizeof *labels->label);
    labels->name = malloc(most * sizeof *labels->name);
    apsm_status status = labels->label && labels->name
                             ? APSM_OK
                             : apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for labels");
    for (const char *part = text; status == APSM_OK && part;) {
        const size_t length = strcspn(part, ",");
        status = take_part(ctx, text, part, length, labels);
        part = part[length] ? part + length + 1 : NULL;
    }
    if (status == APSM_OK)
        labels->n = sort_unique(labels->n, labels->label);
    else
        apsm_labels_free(labels);
    return status;
}

/* ---- what is there ---- */

enum { LISTED = 16, NAME_SHOWN = 40 };

/* A label in one layer. */
typedef struct place {
    int32_t label;
    size_t layer;
} place;

/* In the first layer. */
static void put(apsm_volume *v, size_t i, bool in)
{
    if (v->small)
        v->small[i] = in;
    else
        v->label[i] = in;
}

static int compare(place a, place b)
{
    if (a.label != b.label) return a.label < b.label ? -1 : 1;
    return (a.layer > b.layer) - (a.layer < b.layer);
}

/* The labels that occur, up to LISTED of them, ascending; 0 does not count. */
static size_t find_labels(const apsm_volume *v, size_t voxels, size_t layers, place found[LISTED])
{
    size_t n = 0;
    place last = { 0, 0 };
    for (size_t i = 0; i < layers * voxels && n < LISTED; i++) {
        const place p = { volume_label(v, i), i / voxels };
        if (p.label == 0 || (p.label == last.label && p.layer == last.layer)) continue;
        last = p;
        size_t k = 0;
        while (k < n && compare(found[k], p) < 0) k++;
        if (k < n && compare(found[k], p) == 0) continue;
        memmove(found + k + 1, found + k, (n - k) * sizeof *found);
        found[k] = p;
        n++;
    }
    return n;
}

static const char *name_of(const apsm_volume *v, place p)
{
    for (size_t k = 0; k < v->segments; k++)
        if (v->segment[k].label == p.label && v->segment[k].layer == p.layer)
            return v->segment[k].name;
    return NULL;
}

static void list_labels(const apsm_volume *v, size_t n, const place *found, size_t room, char *list)
{
    *list = '\0';
    for (size_t k = 0, at = 0; k < n && at + NAME_SHOWN + 20 < room; k++) {
        const char *const name = name_of(v, found[k]);
        at += (size_t)snprintf(list + at, room - at, "%s%d", k ? ", " : "", found[k].label);
        if (name) at += (size_t)snprintf(list + at, room - at, " (%.*s)", NAME_SHOWN, name);
    }
}

static apsm_status refuse_choice(apsm_context *ctx, const char *path, const apsm_volume *v,
                                 size_t voxels, size_t layers, bool chosen)
{
    place found[LISTED];
    char list[512];
    const size_t n = find_labels(v, voxels, layers, found);
    list_labels(v, n, found, sizeof list, list);
    if (n == 0)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY, "%s: every voxel is 0; segment the shape first",
                         path);
    const bool scan = n > 2 && found[0].label < 0; /* -1000, -999, ... */
    return apsm_fail(
        ctx, APSM_ERR_GEOMETRY, "%s: %s %s%s; choose with --label (or --label all)%s", path,
        chosen ? "none of the chosen labels is in it, but" : "holds several labels:", list,
        n == LISTED ? ", .." : "",
        scan     ? "; of a scan, --label '>100' takes what is above a bound"
        : chosen ? ""
                 : ", or see run's --parts");
}

/* ---- what is chosen ---- */

enum { ANY_LAYER = -1, NO_PICK = -1 };

typedef struct pick {
    int32_t label;
    ptrdiff_t layer; /* or ANY_LAYER */
    bool seen;
} pick;

typedef struct picks {
    bool all;
    ptrdiff_t n;
    pick *pick;
    place last; /* and what it was found to be */
    ptrdiff_t last_pick;
} picks;

/* Neighbours mostly have the same label, so the last answer is remembered. */
static bool is_picked(picks *p, int32_t label, size_t layer)
{
    if (p->all) return label != 0;
    if (label != p->last.label || layer != p->last.layer) {
        p->last = (place){ label, layer };
        p->last_pick = NO_PICK;
        for (ptrdiff_t k = 0; k < p->n && p->last_pick == NO_PICK; k++)
            if (p->pick[k].label == label &&
                (p->pick[k].layer == ANY_LAYER || p->pick[k].layer == (ptrdiff_t)layer))
                p->last_pick = k;
        if (p->last_pick != NO_PICK) p->pick[p->last_pick].seen = true;
    }
    return p->last_pick != NO_PICK;
}

/* A number stands for segments of that label in all layers: they must be the same one. */
static apsm_status check_number(apsm_context *ctx, const char *path, const apsm_volume *v,
                                int32_t label)
{
    const apsm_segment *first = NULL;
    for (size_t k = 0; k < v->segments; k++) {
        const apsm_segment *const s = &v->segment[k];
        if (s->label != label) continue;
        if (first && first->layer != s->layer)
            return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                             "%s: label %d is '%s' in one layer and '%s' in another; choose by "
                             "name, --label '%s'",
                             path, label, first->name ? first->name : "", s->name ? s->name : "",
                             first->name ? first->name : "");
        if (!first) first = s;
    }
    return APSM_OK;
}

static void add_named(apsm_context *ctx, const char *path, const apsm_volume *v, const char *name,
                      picks *p)
{
    for (size_t k = 0; k < v->segments; k++)
        if (v->segment[k].name && strcasecmp(v->segment[k].name, name) == 0) {
            p->pick[p->n++] =
                (pick){ .label = v->segment[k].label, .layer = (ptrdiff_t)v->segment[k].layer };
            return;
        }
    apsm_log(ctx, APSM_LOG_WARNING, "%s: %s '%s'", path,
             v->segments ? "has no segment" : "its labels have no names; there is no", name);
}

static apsm_status choose(apsm_context *ctx, const char *path, const apsm_labels *labels,
                          const apsm_volume *v, picks *p)
{
    *p = (picks){ .all = labels->all, .last_pick = NO_PICK };
    p->pick = calloc(labels->n + labels->names + 1, sizeof *p->pick);
    if (!p->pick) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    for (size_t k = 0; k < labels->n; k++) {
        APSM_TRY(check_number(ctx, path, v, labels->label[k]));
        p->pick[p->n++] = (pick){ .label = labels->label[k], .layer = ANY_LAYER };
    }
    for (size_t k = 0; k < labels->names; k++) add_named(ctx, path, v, labels->name[k], p);
    return APSM_OK;
}

/* Names of what was taken by number. */
static bool remember_names(const apsm_labels *labels, apsm_volume *v, size_t n, const place *found)
{
    char text[512] = "";
    size_t at = 0;
    for (size_t k = 0; k < n && at + NAME_SHOWN + 20 < sizeof text; k++) {
        const char *const name = name_of(v, found[k]);
        bool taken = labels->all || labels->n + labels->names == 0;
        for (size_t l = 0; l < labels->n; l++) taken = taken || labels->label[l] == found[k].label;
        if (name && taken)
            at += (size_t)snprintf(text + at, sizeof text - at, "%s%d %.*s", at ? ", " : "",
                                   found[k].label, NAME_SHOWN, name);
    }
    if (at) v->picked = strdup(text);
    return !at || v->picked;
}

static void tell_missing(apsm_context *ctx, const char *path, const picks *p)
{
    for (ptrdiff_t k = 0; k < p->n; k++)
        if (!p->pick[k].seen)
            apsm_log(ctx, APSM_LOG_WARNING, "%s: label %d is not in it", path, p->pick[k].label);
}

static apsm_status unite(apsm_context *ctx, const char *path, const apsm_labels *labels, picks *p,
                         apsm_volume *v)
{
    const size_t voxels = v->n[0] * v->n[1] * v->n[2], layers = v->layers ? v->layers : 1;
    place found[LISTED];
    const size_t n = find_labels(v, voxels, layers, found);
    if (!labels->all && labels->n + labels->names == 0) {
        if (n != 1) return refuse_choice(ctx, path, v, voxels, layers, false);
        p->all = true;
    }
    bool any = false;
    for (size_t i = 0; i < layers * voxels; i++)
        any |= is_picked(p, volume_label(v, i), i / voxels);
    if (!any && labels->if_several && n == 1) {
        apsm_log(ctx, APSM_LOG_INFO, "%s: label %d is the only one, and so the shape", path,
                 found[0].label);
        any = p->all = true;
    }
    if (!any) return refuse_choice(ctx, path, v, voxels, layers, true);
    if (!p->all) tell_missing(ctx, path, p);
    if (!remember_names(labels, v, n, found))
        return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    for (size_t i = 0; i < voxels; i++) {
        bool in = false;
        for (size_t l = 0; l < layers; l++) in |= is_picked(p, volume_label(v, i + l * voxels), l);
        put(v, i, in);
    }
    v->layers = 1;
    return APSM_OK;
}

/* Whole numbers above or below a bound. */
static apsm_status bound(apsm_context *ctx, const char *path, const apsm_labels *labels,
                         apsm_volume *v)
{
    const size_t voxels = v->n[0] * v->n[1] * v->n[2];
    bool any = false;
    for (size_t i = 0; i < voxels; i++) {
        const double x = (double)volume_label(v, i);
        const bool in = labels->side == '<' ? x < labels->level : x > labels->level;
        put(v, i, in);
        any |= in;
    }
    v->layers = 1;
    if (any) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_GEOMETRY, "%s: no voxel is %s %g; choose another bound", path,
                     labels->side == '<' ? "below" : "above", labels->level);
}

apsm_status apsm_label_union(apsm_context *ctx, const char *path, const apsm_labels *labels,
                             apsm_volume *volume)
{
    picks p;
    if (labels->side) return bound(ctx, path, labels, volume);
    apsm_status status = choose(ctx, path, labels, volume, &p);
    if (status == APSM_OK) status = unite(ctx, path, labels, &p, volume);
    free(p.pick);
    return status;
}

void apsm_labels_compare(apsm_context *ctx, size_t n, const char *const *names,
                         const char *const *picked)
{
    size_t first = 0;
    while (first < n && !picked[first]) first++;
    for (size_t i = first + 1; i < n; i++)
        if (picked[i] && strcmp(picked[i], picked[first]) != 0) {
            apsm_log(ctx, APSM_LOG_WARNING,
                     "the labels mean different things: %s has %s, %s has %s; choose by name "
                     "(--label NAME)",
                     names[first], picked[first], names[i], picked[i]);
            return;
        }
}
