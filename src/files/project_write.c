/* From a project to a .swproj or .xlsx file that ShapeWorks reads: every value a string, keys in
 * its order, and whatever we do not know as it was. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/io.h"
#include "files/project_columns.h"
#include "files/project_xml.h"
#include "files/sheets.h"

/* Sets key to text; NULL removes it.  json_string refuses what is not UTF-8. */
static bool set(json_t *row, const char *key, const char *text)
{
    if (!text) {
        json_object_del(row, key);
        return true;
    }
    return json_object_set_new(row, key, json_string(text)) == 0;
}

void apsm_transform_text(const double M[16], char text[16 * APSM_NUMBER_LENGTH])
{
    char *at = text;
    for (int i = 0; i < 16; i++) {
        if (i > 0) *at++ = ' ';
        apsm_format_number(M[i], at);
        at += strlen(at);
    }
}

/* A transform that has not changed keeps its text, digit for digit. */
static bool set_transform(json_t *row, const char *key, bool has, const double M[16])
{
    char text[16 * APSM_NUMBER_LENGTH];
    double old[16];
    bool plain;
    const char *before = json_string_value(json_object_get(row, key));
    if (!has) return set(row, key, NULL);
    if (before && apsm_transform_parse(before, old, &plain) && memcmp(old, M, sizeof old) == 0)
        return true;
    apsm_transform_text(M, text);
    return set(row, key, text);
}

static bool set_mirrored(json_t *row, bool mirrored)
{
    if (mirrored) return set(row, "mirrored", "yes");
    return !json_object_get(row, "mirrored") || set(row, "mirrored", "no");
}

/* ---- order of columns ---- */

static size_t find_key(const char *const *keys, size_t n, const char *key)
{
    size_t k = 0;
    while (k < n && strcmp(keys[k], key) != 0) k++;
    return k;
}

/* Moves keys[from] to stand at index to <= from. */
static void move_key(const char **keys, size_t from, size_t to)
{
    const char *key = keys[from];
    memmove(keys + to + 1, keys + to, (from - to) * sizeof *keys);
    keys[to] = key;
}

/* Columns that the row did not have when it was read stand at its end: each is moved behind the one
 * before it in ShapeWorks' order.  So a project looks the same whether it was read between two
 * steps or not. */
static void order_keys(const apsm_project *p, const json_t *before, const char **keys, size_t n)
{
    char key[APSM_KEY_LENGTH], previous[APSM_KEY_LENGTH];
    snprintf(previous, sizeof previous, "%s", "name");
    const size_t input = find_key(keys, n, apsm_project_input_key(p, before, key));
    if (input < n) snprintf(previous, sizeof previous, "%s", keys[input]);
    for (size_t c = 0; c < APSM_COLUMNS; c++) {
        const size_t at = find_key(keys, n, apsm_project_key(p, apsm_project_columns[c], key));
        const size_t after = find_key(keys, n, previous);
        if (at == n) continue;
        if (!json_object_get(before, key) && after + 1 < at) move_key(keys, at, after + 1);
        snprintf(previous, sizeof previous, "%s", key);
    }
}

/* row, a reference that is taken over, in order; NULL and *error if out of memory. */
static json_t *in_order(const apsm_project *p, const json_t *before, json_t *row, int *error)
{
    const size_t n = json_object_size(row);
    const char **keys = malloc((n + 1) * sizeof *keys), *key;
    json_t *ordered = json_object(), *value;
    size_t k = 0;
    bool ok = keys && ordered;
    if (ok) {
        json_object_foreach(row, key, value) keys[k++] = key;
        order_keys(p, before, keys, n);
    }
    for (k = 0; k < n && ok; k++)
        ok = json_object_set(ordered, keys[k], json_object_get(row, keys[k])) == 0;
    free(keys);
    json_decref(row);
    if (ok) return ordered;
    *error = ENOMEM;
    json_decref(ordered);
    return NULL;
}

/* The row of a subject as it is now; a new reference, NULL if it cannot be made. */
static json_t *make_row(const apsm_project *p, const apsm_subject *s, int *error)
{
    char input[APSM_KEY_LENGTH], groomed[APSM_KEY_LENGTH], local[APSM_KEY_LENGTH],
        world[APSM_KEY_LENGTH], alignment[APSM_KEY_LENGTH], procrustes[APSM_KEY_LENGTH];
    json_t *row = json_copy(s->row);
    if (row && set(row, "name", s->name) &&
        set(row, apsm_project_input_key(p, row, input), s->shape) &&
        set(row, apsm_project_key(p, "groomed_", groomed), s->groomed) &&
        set(row, apsm_project_key(p, "local_particles_", local), s->local_particles) &&
        set(row, apsm_project_key(p, "world_particles_", world), s->world_particles) &&
        set_transform(row, apsm_project_key(p, "alignment_", alignment), s->has_alignment,
                      s->alignment) &&
        set_transform(row, apsm_project_key(p, "procrustes_", procrustes), s->has_procrustes,
                      s->procrustes) &&
        set_mirrored(row, s->mirrored))
        return in_order(p, s->row, row, error);
    json_decref(row);
    return NULL;
}

static apsm_status write_root(apsm_context *ctx, const char *path, const json_t *root)
{
    workbook w;
    if (apsm_is_parameter_file(path))
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "%s: parameter files are read, not written; write a .swproj", path);
    if (!apsm_is_spreadsheet(path)) return apsm_json_write(ctx, path, root);
    APSM_TRY(sheets_from_project(ctx, path, root, &w));
    const apsm_status status = workbook_write(ctx, path, &w);
    workbook_free(&w);
    return status;
}

/* Rows of the shapes that are set aside, each in its place among the n that there are so far; all
 * that are left if n is SIZE_MAX. */
static bool add_aside(const apsm_project *project, json_t *data, size_t n, size_t *next)
{
    for (; *next < json_array_size(project->aside); ++*next) {
        const json_t *pair = json_array_get(project->aside, *next);
        if (n != SIZE_MAX && json_integer_value(json_array_get(pair, 0)) > (json_int_t)n) break;
        if (json_array_append(data, json_array_get(pair, 1)) != 0) return false;
        if (n != SIZE_MAX) n++;
    }
    return true;
}

static apsm_status add_rows(apsm_context *ctx, const char *path, const apsm_project *project,
                            json_t *data)
{
    size_t next = 0;
    for (size_t i = 0; i < project->n; i++) {
        int error = add_aside(project, data, json_array_size(data), &next) ? 0 : ENOMEM;
        if (!error &&
            json_array_append_new(data, make_row(project, &project->subjects[i], &error)) == 0)
            continue;
        if (error) return apsm_fail_errno(ctx, path, "cannot be written", error);
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "%s: not written, a text of shape %zu is not valid UTF-8; rename its "
                         "files",
                         path, i + 1);
    }
    if (add_aside(project, data, SIZE_MAX, &next)) return APSM_OK;
    return apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
}

apsm_status apsm_project_write(apsm_context *ctx, const char *path, const apsm_project *project)
{
    json_t *root = json_copy(project->root), *data = json_array();
    if (!root || !data || json_object_set_new(root, "data", data) != 0) {
        json_decref(root);
        return apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
    }
    apsm_status status = add_rows(ctx, path, project, data);
    if (status == APSM_OK) status = write_root(ctx, path, root);
    json_decref(root);
    return status;
}
