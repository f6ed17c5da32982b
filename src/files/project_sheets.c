/* Projects as spreadsheets, in the layout of ShapeWorks: what is a member of an object in the
 * .swproj is a cell here. */
#define _DEFAULT_SOURCE /* strcasecmp */
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "files/io.h"
#include "files/project_columns.h"
#include "files/sheets.h"

static const char key_column[] = "key", value_column[] = "value", domain_prefix[] = "value_";
enum { LONGEST_SHEET = 31 };

static const char *at(const sheet *s, size_t row, size_t column)
{
    const char *text = s->cell[row * s->columns + column];
    return text ? text : "";
}

/* ---- From sheets ---- */

static bool is_options(const sheet *s)
{
    return s->rows > 0 && s->columns > 1 && strcmp(at(s, 0, 0), key_column) == 0 &&
           strncmp(at(s, 0, 1), value_column, sizeof value_column - 1) == 0;
}

/* Keys and values of a column; NULL if out of memory. */
static json_t *read_options(const sheet *s, size_t column)
{
    json_t *options = json_object();
    for (size_t row = 1; options && row < s->rows; row++) {
        if (!*at(s, row, 0) || !*at(s, row, column)) continue;
        if (json_object_set_new(options, at(s, row, 0), json_string(at(s, row, column))) == 0)
            continue;
        json_decref(options);
        options = NULL;
    }
    return options;
}

/* One object, or one a domain.  ShapeWorks writes an empty column "value" before those of the
 * domains. */
static json_t *read_groups(const sheet *s)
{
    json_t *domains = NULL;
    for (size_t column = 1; column < s->columns; column++) {
        const char *title = at(s, 0, column);
        if (strncmp(title, domain_prefix, sizeof domain_prefix - 1) != 0) continue;
        if (!domains) domains = json_object();
        json_t *options = read_options(s, column);
        if (json_object_set_new(domains, title + sizeof domain_prefix - 1, options) == 0) continue;
        json_decref(domains);
        return NULL;
    }
    return domains ? domains : read_options(s, 1);
}

static apsm_status check_titles(apsm_context *ctx, const char *path, const sheet *s)
{
    for (size_t a = 0; a < s->columns; a++)
        for (size_t b = 0; b < a; b++)
            if (*at(s, 0, a) && strcmp(at(s, 0, a), at(s, 0, b)) == 0)
                return apsm_fail(ctx, APSM_ERR_FORMAT,
                                 "%s: sheet %s: two columns are called '%.*s'; remove one", path,
                                 s->name, APSM_SHOWN, at(s, 0, a));
    return APSM_OK;
}

static json_t *read_row(const sheet *s, size_t row)
{
    json_t *object = json_object();
    for (size_t column = 0; object && column < s->columns; column++) {
        if (!*at(s, 0, column) || !*at(s, row, column)) continue;
        if (json_object_set_new(object, at(s, 0, column), json_string(at(s, row, column))) == 0)
            continue;
        json_decref(object);
        object = NULL;
    }
    return object;
}

static json_t *read_table(const sheet *s)
{
    json_t *table = json_array();
    for (size_t row = 1; table && row < s->rows; row++) {
        json_t *object = read_row(s, row);
        if (object && json_object_size(object) == 0) {
            json_decref(object);
        } else if (json_array_append_new(table, object) != 0) {
            json_decref(table);
            table = NULL;
        }
    }
    return table;
}

/* Which sheet holds the shapes. */
static size_t find_data(const workbook *w)
{
    for (size_t k = 0; k < w->n; k++)
        if (strcmp(w->sheets[k].name, "data") == 0) return k;
    return 0;
}

static apsm_status add_sheet(apsm_context *ctx, const char *path, const sheet *s, bool data,
                             json_t *root)
{
    if (!data && s->rows == 0) return APSM_OK;
    APSM_TRY(check_titles(ctx, path, s));
    json_t *value = !data && is_options(s) ? read_groups(s) : read_table(s);
    if (json_object_set_new(root, data ? "data" : s->name, value) == 0) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: sheet %s: holds texts that are no UTF-8; save it "
                     "again",
                     path, s->name);
}

apsm_status project_from_sheets(apsm_context *ctx, const char *path, const workbook *w,
                                json_t **root)
{
    const size_t data = find_data(w);
    *root = json_object();
    if (!*root) return apsm_fail_errno(ctx, path, "cannot be read", ENOMEM);
    apsm_status status = add_sheet(ctx, path, &w->sheets[data], true, *root);
    for (size_t k = 0; status == APSM_OK && k < w->n; k++)
        if (k != data) status = add_sheet(ctx, path, &w->sheets[k], false, *root);
    if (status == APSM_OK) return APSM_OK;
    json_decref(*root);
    *root = NULL;
    return status;
}

/* ---- To sheets ---- */

typedef struct writing {
    apsm_context *ctx;
    const char *path;
    workbook *w;
} writing;

static apsm_status out_of_memory(const writing *o)
{
    return apsm_fail_errno(o->ctx, o->path, "cannot be written", ENOMEM);
}

static void left_out(const writing *o, const char *name, const char *why)
{
    apsm_log(o->ctx, APSM_LOG_WARNING, "%s: '%s' is left out: %s", o->path, name, why);
}

/* What Excel and LibreOffice take. */
static bool may_be_sheet(const char *name)
{
    return *name && strlen(name) <= LONGEST_SHEET && !strpbrk(name, "[]:*?/\\") &&
           name[0] != '\'' && name[strlen(name) - 1] != '\'';
}

/* Names of sheets are compared without case. */
static bool is_taken(const writing *o, const char *name)
{
    for (size_t k = 0; k < o->w->n; k++)
        if (strcasecmp(o->w->sheets[k].name, name) == 0) return true;
    return false;
}

/* Whether all members of a list or object are objects. */
static bool holds_objects(const json_t *value)
{
    size_t i;
    json_t *item;
    const char *key;
    json_array_foreach(value, i, item)
    {
        if (!json_is_object(item)) return false;
    }
    json_object_foreach((json_t *)value, key, item)
    {
        if (!json_is_object(item)) return false;
    }
    return true;
}

/* Columns of a table, in the order in which its rows bring them: a new object. */
static json_t *titles_of(const json_t *table)
{
    size_t i;
    json_t *row, *titles = json_object(), *value;
    const char *key;
    json_array_foreach(table, i, row)
    {
        json_object_foreach(row, key, value)
        {
            json_object_set_new(titles, key, json_null());
        }
    }
    return titles;
}

static apsm_status put_row(const writing *o, sheet *s, size_t number, const json_t *titles,
                           const json_t *row)
{
    const char *bad, *key;
    size_t column = 0;
    json_t *none, *texts = apsm_json_as_texts(row, &bad);
    if (!texts && bad)
        return apsm_fail(o->ctx, APSM_ERR_FORMAT,
                         "%s: '%s' of sheet %s is a list or an object and fits into no cell; "
                         "write a .swproj",
                         o->path, bad, s->name);
    bool fine = texts != NULL;
    json_object_foreach((json_t *)titles, key, none)
    {
        const char *text = json_string_value(json_object_get(texts, key));
        fine = fine && sheet_set(s, number, column++, text && *text ? text : NULL);
    }
    json_decref(texts);
    return fine ? APSM_OK : out_of_memory(o);
}

static apsm_status put_table(const writing *o, const char *name, const json_t *table)
{
    size_t i, column = 0;
    json_t *row, *none, *titles = titles_of(table);
    const char *key;
    sheet *s = titles
                   ? workbook_add(o->w, name, json_array_size(table) + 1, json_object_size(titles))
                   : NULL;
    apsm_status status = s ? APSM_OK : out_of_memory(o);
    json_object_foreach(titles, key, none)
    {
        if (s && !sheet_set(s, 0, column++, key)) status = out_of_memory(o);
    }
    json_array_foreach(table, i, row)
    {
        if (status == APSM_OK) status = put_row(o, s, i + 1, titles, row);
    }
    json_decref(titles);
    return status;
}

/* All keys of n objects, in the order in which they come: a new object. */
static json_t *keys_of(size_t n, const json_t *const *options)
{
    const char *key;
    json_t *value, *keys = json_object();
    for (size_t k = 0; keys && k < n; k++) {
        json_object_foreach((json_t *)options[k], key, value)
        {
            json_object_set_new(keys, key, json_null());
        }
    }
    return keys;
}

static json_t *texts_of(const writing *o, const json_t *options)
{
    const char *bad;
    json_t *texts = apsm_json_as_texts(options, &bad);
    if (texts || !bad) return texts;
    left_out(o, bad, "it is a list or an object and fits into no cell");
    json_t *rest = json_copy((json_t *)options);
    if (!rest || json_object_del(rest, bad) != 0) {
        json_decref(rest);
        return NULL;
    }
    texts = texts_of(o, rest);
    json_decref(rest);
    return texts;
}

/* Values of column c of the keys in column 0. */
static bool put_values(const writing *o, sheet *s, size_t c, const char *title, const json_t *keys,
                       const json_t *options)
{
    const char *key;
    json_t *none, *texts = texts_of(o, options);
    size_t row = 1;
    bool fine = texts && sheet_set(s, 0, c, title);
    json_object_foreach((json_t *)keys, key, none)
    {
        const char *text = json_string_value(json_object_get(texts, key));
        fine =
            fine && sheet_set(s, row, 0, key) && sheet_set(s, row, c, text && *text ? text : NULL);
        row++;
    }
    json_decref(texts);
    return fine;
}

/* Objects of plain values: columns of one sheet, each under its title. */
static apsm_status put_options(const writing *o, const char *name, size_t n,
                               const char *const *title, const json_t *const *options)
{
    json_t *keys = keys_of(n, options);
    sheet *s = keys ? workbook_add(o->w, name, json_object_size(keys) + 1, n + 1) : NULL;
    bool fine = s && sheet_set(s, 0, 0, key_column);
    for (size_t k = 0; fine && k < n; k++)
        fine = put_values(o, s, k + 1, title[k], keys, options[k]);
    json_decref(keys);
    return fine ? APSM_OK : out_of_memory(o);
}

static apsm_status put_domains(const writing *o, const char *name, const json_t *domains)
{
    const size_t n = json_object_size(domains);
    const char **title = calloc(n + 1, sizeof *title), *key;
    const json_t **options = calloc(n + 1, sizeof *options);
    char *titles = calloc(n + 1, APSM_KEY_LENGTH);
    json_t *value;
    size_t k = 0;
    apsm_status status = title && options && titles ? APSM_OK : out_of_memory(o);
    json_object_foreach((json_t *)domains, key, value)
    {
        if (status != APSM_OK) break;
        snprintf(titles + k * APSM_KEY_LENGTH, APSM_KEY_LENGTH, "%s%s", domain_prefix, key);
        title[k] = titles + k * APSM_KEY_LENGTH;
        options[k++] = value;
    }
    if (status == APSM_OK) status = put_options(o, name, n, title, options);
    free(title);
    free(options);
    free(titles);
    return status;
}

static apsm_status put_group(const writing *o, const char *name, const json_t *value)
{
    const char *const title[1] = { value_column };
    if (json_is_null(value)) return APSM_OK;
    if (is_taken(o, name)) return left_out(o, name, "another sheet has this name"), APSM_OK;
    if (!may_be_sheet(name)) return left_out(o, name, "a sheet cannot have this name"), APSM_OK;
    if (json_is_array(value) && holds_objects(value)) return put_table(o, name, value);
    if (json_is_object(value) && json_object_size(value) > 0 && holds_objects(value))
        return put_domains(o, name, value);
    if (json_is_object(value)) return put_options(o, name, 1, title, &value);
    return left_out(o, name, "it is neither a table nor a list of options"), APSM_OK;
}

apsm_status sheets_from_project(apsm_context *ctx, const char *path, const json_t *root,
                                workbook *w)
{
    const writing o = { ctx, path, w };
    const char *key;
    json_t *value;
    *w = (workbook){ 0 };
    apsm_status status = put_table(&o, "data", json_object_get(root, "data"));
    json_object_foreach((json_t *)root, key, value)
    {
        if (status == APSM_OK && strcmp(key, "data") != 0) status = put_group(&o, key, value);
    }
    if (status != APSM_OK) workbook_free(w);
    return status;
}
