#include "statistics/table.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "apsm/options.h"
#include "files/files.h"

static void column_free(apsm_column *c, size_t I)
{
    for (size_t k = 0; k < c->levels; k++) free(c->level[k]);
    for (size_t i = 0; c->text && i < I; i++) free(c->text[i]);
    free(c->level);
    free(c->shapes);
    free(c->text);
    free(c->value);
    free(c->name);
    *c = (apsm_column){ 0 };
}

void apsm_table_free(apsm_table *table)
{
    for (size_t k = 0; k < table->n; k++) column_free(&table->column[k], table->I);
    free(table->column);
    *table = (apsm_table){ 0 };
}

const apsm_column *apsm_table_find(const apsm_table *table, const char *name)
{
    for (size_t k = 0; k < table->n; k++)
        if (strcmp(table->column[k].name, name) == 0) return &table->column[k];
    return NULL;
}

/* A place for a column of that name: the old one's, emptied, or a new one. */
static apsm_column *place_for(apsm_table *table, const char *name)
{
    for (size_t k = 0; k < table->n; k++)
        if (strcmp(table->column[k].name, name) == 0) {
            column_free(&table->column[k], table->I);
            return &table->column[k];
        }
    apsm_column *more = realloc(table->column, (table->n + 1) * sizeof *more);
    if (!more) return NULL;
    table->column = more;
    more[table->n] = (apsm_column){ 0 };
    return &more[table->n++];
}

static apsm_status begin_column(apsm_table *table, const char *name, apsm_column **column)
{
    *column = place_for(table, name);
    if (!*column) return APSM_ERR_MEMORY;
    (*column)->name = strdup(name);
    (*column)->value = malloc((table->I + 1) * sizeof(double));
    return (*column)->name && (*column)->value ? APSM_OK : APSM_ERR_MEMORY;
}

apsm_status apsm_table_add(apsm_table *table, const char *name, const double *value)
{
    apsm_column *c;
    APSM_TRY(begin_column(table, name, &c));
    memcpy(c->value, value, table->I * sizeof *value);
    return APSM_OK;
}

static apsm_status widen_column(size_t I, size_t more, apsm_column *c)
{
    double *value = realloc(c->value, (more + 1) * sizeof *value);
    if (!value) return APSM_ERR_MEMORY;
    c->value = value;
    for (size_t i = I; i < more; i++) value[i] = NAN;
    if (!c->text) return APSM_OK;
    char **text = realloc(c->text, (more + 1) * sizeof *text);
    if (!text) return APSM_ERR_MEMORY;
    c->text = text;
    for (size_t i = I; i < more; i++) text[i] = NULL;
    return APSM_OK;
}

apsm_status apsm_table_widen(apsm_table *table, size_t I)
{
    for (size_t k = 0; k < table->n; k++) APSM_TRY(widen_column(table->I, I, &table->column[k]));
    table->I = I;
    return APSM_OK;
}

/* ---- from texts ---- */

static bool is_unknown(const char *text)
{
    return !text || !*text || strcmp(text, "NA") == 0 || strcasecmp(text, "nan") == 0;
}

static bool all_numbers(size_t I, char *const *text, double *value)
{
    for (size_t i = 0; i < I; i++) {
        value[i] = NAN;
        if (!is_unknown(text[i]) && !apsm_parse_number(text[i], strlen(text[i]), &value[i]))
            return false;
    }
    return true;
}

static int by_text(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* The texts that differ, sorted. */
static apsm_status list_levels(size_t I, char *const *text, apsm_column *c)
{
    const char **sorted = malloc((I + 1) * sizeof *sorted);
    size_t n = 0;
    c->level = calloc(I + 1, sizeof *c->level);
    if (!sorted || !c->level) {
        free(sorted);
        return APSM_ERR_MEMORY;
    }
    for (size_t i = 0; i < I; i++)
        if (!is_unknown(text[i])) sorted[n++] = text[i];
    qsort(sorted, n, sizeof *sorted, by_text);
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < n && status == APSM_OK; k++) {
        if (k > 0 && strcmp(sorted[k - 1], sorted[k]) == 0) continue;
        c->level[c->levels] = strdup(sorted[k]);
        status = c->level[c->levels++] ? APSM_OK : APSM_ERR_MEMORY;
    }
    free(sorted);
    return status;
}

static apsm_status make_category(size_t I, char *const *text, apsm_column *c)
{
    c->category = true;
    APSM_TRY(list_levels(I, text, c));
    c->shapes = calloc(c->levels + 1, sizeof *c->shapes);
    if (!c->shapes) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < I; i++) {
        c->value[i] = NAN;
        if (is_unknown(text[i])) continue;
        char **at = bsearch(&text[i], c->level, c->levels, sizeof *c->level, by_text);
        c->value[i] = (double)(at - c->level);
        c->shapes[at - c->level]++;
    }
    return APSM_OK;
}

static apsm_status keep_texts(size_t I, char *const *text, apsm_column *c)
{
    c->text = calloc(I + 1, sizeof *c->text);
    if (!c->text) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < I; i++) {
        if (is_unknown(text[i])) continue;
        c->text[i] = strdup(text[i]);
        if (!c->text[i]) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

static apsm_status fill_column(size_t I, char *const *text, apsm_column *c)
{
    return all_numbers(I, text, c->value) ? keep_texts(I, text, c) : make_category(I, text, c);
}

static apsm_status add_texts(apsm_table *table, const char *name, char *const *text)
{
    apsm_column *c;
    APSM_TRY(begin_column(table, name, &c));
    return fill_column(table->I, text, c);
}

apsm_status apsm_table_categorize(apsm_table *table, const char *name)
{
    for (size_t k = 0; k < table->n; k++) {
        apsm_column *c = &table->column[k];
        if (strcmp(c->name, name) == 0 && c->text && !c->category)
            return make_category(table->I, c->text, c);
    }
    return APSM_OK;
}

/* ---- from a project ---- */

/* Columns that say where files are and how shapes lie, of any domain. */
static bool is_kept_for_programs(const char *key)
{
    static const char *const prefixes[] = { "name",
                                            "shape_",
                                            "segmentation_",
                                            "mesh_",
                                            "groomed_",
                                            "local_particles_",
                                            "world_particles_",
                                            "alignment_",
                                            "procrustes_",
                                            "landmarks_file_",
                                            "constraints_",
                                            "image_",
                                            "reflection",
                                            "notes" };
    for (size_t k = 0; k < sizeof prefixes / sizeof *prefixes; k++)
        if (strncmp(key, prefixes[k], strlen(prefixes[k])) == 0) return true;
    return false;
}

static apsm_status take_key(const apsm_project *project, const char *key, char **text,
                            apsm_table *table)
{
    static const char group[] = "group_";
    bool known = false;
    for (size_t i = 0; i < project->n; i++) {
        const char *value = apsm_subject_column(&project->subjects[i], key);
        if (strcmp(key, "mirrored") == 0) value = project->subjects[i].mirrored ? "yes" : "no";
        text[i] = (char *)(uintptr_t)value; /* borrowed, only read */
        known = known || !is_unknown(value);
    }
    if (!known) return APSM_OK;
    APSM_TRY(add_texts(table, key, text));
    if (strncmp(key, group, sizeof group - 1) != 0) return APSM_OK;
    return add_texts(table, key + sizeof group - 1, text);
}

apsm_status apsm_table_from_project(apsm_context *ctx, const apsm_project *project,
                                    apsm_table *table)
{
    const char *key;
    json_t *value;
    apsm_status status = APSM_OK;
    char **text = calloc(project->n + 1, sizeof *text);
    *table = (apsm_table){ .I = project->n };
    if (!text) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < project->n && status == APSM_OK; i++)
        json_object_foreach(project->subjects[i].row, key, value)
        {
            if (status != APSM_OK || is_kept_for_programs(key) || apsm_table_find(table, key))
                continue;
            status = take_key(project, key, text, table);
        }
    free(text);
    if (status != APSM_OK) apsm_table_free(table);
    return status == APSM_ERR_MEMORY ? apsm_fail(ctx, status, "out of memory for the table")
                                     : status;
}

/* ---- from a file ---- */

/* A file of lines of fields; the data are cut up in place. */
typedef struct sheet {
    apsm_context *ctx;
    const char *path;
    char *at, separator;
    size_t line, columns;
    bool kept;    /* lines of shapes that have left the model since are passed over */
    char **title; /* columns, borrowed from the data */
    char **cell;  /* columns: of the present line */
} sheet;

/* Where the field at `at` ends: at a separator, the end of the line or that of the file; NULL if a
 * quote is not closed, or something follows that is none of these. */
static char *field_end(char *at, char separator)
{
    const char stops[] = { separator, '\n', '\r', '\0' };
    if (*at != '"') return at + strcspn(at, stops);
    for (at++; *at && (*at != '"' || at[1] == '"'); at++)
        if (*at == '"') at++;
    if (!*at++) return NULL;
    return !*at || strchr(stops, *at) ? at : NULL;
}

/* Without quotes, doubled ones once; ended in place. */
static char *field_text(char *from, const char *end)
{
    char *to = from;
    const char *at = from;
    if (*from == '"')
        for (at++; at + 1 < end; at++) {
            if (*at == '"') at++;
            *to++ = *at;
        }
    else
        to += end - from;
    *to = '\0';
    while (to > from && to[-1] == ' ') *--to = '\0';
    return from + strspn(from, " ");
}

/* How many fields the line has, and where it ends; 0: a quote is wrong. */
static size_t count_fields_to(char *line, char separator, char **end)
{
    for (size_t n = 1;; n++, line++) {
        *end = line = field_end(line, separator);
        if (!line) return 0;
        if (*line != separator) return n;
    }
}

static size_t count_fields(char *line, char separator)
{
    char *end;
    return count_fields_to(line, separator, &end);
}

static void pass_ends_of_lines(sheet *s)
{
    while (*s->at == '\n' || *s->at == '\r') s->line += *s->at++ == '\n';
}

/* The fields of the next line that has any into cell; *there: false, no more. */
static apsm_status next_line(sheet *s, char **cell, bool *there)
{
    pass_ends_of_lines(s);
    *there = *s->at != '\0';
    if (!*there) return APSM_OK;
    s->line++;
    const size_t fields = count_fields(s->at, s->separator);
    if (fields == 0)
        return apsm_fail(s->ctx, APSM_ERR_FORMAT,
                         "%s:%zu: a quote is not closed, or something follows it; quote whole "
                         "fields",
                         s->path, s->line);
    if (fields != s->columns)
        return apsm_fail(s->ctx, APSM_ERR_FORMAT,
                         "%s:%zu: has %zu fields, the header %zu; make all lines alike", s->path,
                         s->line, fields, s->columns);
    for (size_t k = 0; k < fields; k++) {
        char *const end = field_end(s->at, s->separator), *const first = s->at;
        for (const char *c = first; c < end; c++) s->line += *c == '\n';
        const bool last = k + 1 == fields;
        s->at = end + (last ? strspn(end, "\r") : 1);
        if (last) s->at += *s->at == '\n';
        cell[k] = field_text(first, end); /* may end where `end` points to */
    }
    return APSM_OK;
}

static apsm_status check_titles(const sheet *s)
{
    for (size_t k = 1; k < s->columns; k++) {
        if (!*s->title[k])
            return apsm_fail(s->ctx, APSM_ERR_FORMAT, "%s:1: column %zu has no name", s->path,
                             k + 1);
        for (size_t m = 1; m < k; m++)
            if (strcmp(s->title[m], s->title[k]) == 0)
                return apsm_fail(s->ctx, APSM_ERR_FORMAT, "%s:1: two columns are named '%s'",
                                 s->path, s->title[k]);
    }
    return APSM_OK;
}

static apsm_status unknown_name(const sheet *s, size_t I, const char *const *names)
{
    size_t best = 0;
    for (size_t k = 1; k < s->columns; k++)
        for (size_t i = 0; i < I; i++)
            if (strcmp(s->cell[k], names[i]) == 0)
                return apsm_fail(s->ctx, APSM_ERR_ARG,
                                 "%s:%zu: the first column has to name the shapes, and '%s' is "
                                 "none; put column '%s' first",
                                 s->path, s->line, s->cell[0], s->title[k]);
    for (size_t i = 1; i < I; i++)
        if (apsm_edit_distance(s->cell[0], names[i]) < apsm_edit_distance(s->cell[0], names[best]))
            best = i;
    return apsm_fail(
        s->ctx, APSM_ERR_ARG,
        "%s:%zu: '%s' is no shape of the model; the nearest is '%s'. Names must be the "
        "same, letter by letter",
        s->path, s->line, s->cell[0], names[best]);
}

/* As spreadsheets leave below their last line. */
static bool is_empty_line(const sheet *s)
{
    for (size_t k = 0; k < s->columns; k++)
        if (*s->cell[k]) return false;
    return true;
}

/* text (columns x I) <- the cells of every shape. */
static apsm_status read_rows(sheet *s, size_t I, const char *const *names, char **text)
{
    for (bool there = true;;) {
        size_t i = 0;
        APSM_TRY(next_line(s, s->cell, &there));
        if (!there) return APSM_OK;
        if (is_empty_line(s)) continue;
        while (i < I && strcmp(names[i], s->cell[0]) != 0) i++;
        if (i == I && s->kept) continue;
        if (i == I) return unknown_name(s, I, names);
        if (text[i])
            return apsm_fail(s->ctx, APSM_ERR_FORMAT, "%s:%zu: '%s' stands here a second time",
                             s->path, s->line, s->cell[0]);
        for (size_t k = 0; k < s->columns; k++) text[k * I + i] = s->cell[k];
    }
}

static void tell_absent(const sheet *s, size_t I, const char *const *names, char *const *text)
{
    size_t absent = 0, first = I;
    for (size_t i = 0; i < I; i++)
        if (!text[i]) {
            if (absent++ == 0) first = i;
        }
    if (absent > 0)
        apsm_log(s->ctx, APSM_LOG_WARNING, "%s: has no line for %zu of %zu shapes (%s%s)", s->path,
                 absent, I, names[first], absent > 1 ? ", ..." : "");
}

static apsm_status read_sheet(sheet *s, size_t I, const char *const *names, apsm_table *table)
{
    bool there;
    char **text = calloc(s->columns * I + 1, sizeof *text);
    if (!text) return APSM_ERR_MEMORY;
    apsm_status status = next_line(s, s->title, &there);
    if (status == APSM_OK) status = check_titles(s);
    if (status == APSM_OK) status = read_rows(s, I, names, text);
    for (size_t k = 1; k < s->columns && status == APSM_OK; k++)
        status = add_texts(table, s->title[k], text + k * I);
    if (status == APSM_OK) tell_absent(s, I, names, text);
    free(text);
    return status;
}

/* Whether header and first line have as many fields, two at least. */
static bool separates(char *header, char separator)
{
    char *end;
    const size_t fields = count_fields_to(header, separator, &end);
    if (fields < 2) return false;
    end += strspn(end, "\r\n");
    return !*end || count_fields(end, separator) == fields;
}

/* By header and first line, or by the line "sep=;" that spreadsheets may put above it. */
static void find_separator(sheet *s)
{
    static const char told[] = "sep=";
    pass_ends_of_lines(s);
    const size_t head = strcspn(s->at, "\n"), n = sizeof told - 1;
    s->separator = memchr(s->at, '\t', head) ? '\t' : memchr(s->at, ';', head) ? ';' : ',';
    for (const char *c = ",;\t"; *c; c++)
        if (separates(s->at, *c) && !separates(s->at, s->separator)) s->separator = *c;
    if (strncasecmp(s->at, told, n) != 0 || !s->at[n] || !strchr("\r\n", s->at[n + 1])) return;
    s->separator = s->at[n];
    s->at += n + 1;
    pass_ends_of_lines(s);
}

static apsm_status read_table(apsm_context *ctx, const char *path, bool kept, size_t I,
                              const char *const *names, apsm_table *table)
{
    enum { LIMIT = 1 << 28 };
    char *data = NULL;
    size_t size;
    APSM_TRY(apsm_read_text(ctx, path, LIMIT, &data, &size));
    if (!apsm_is_utf8(data)) {
        free(data);
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: is no text in UTF-8; save it as UTF-8", path);
    }
    sheet s = { .ctx = ctx, .path = path, .at = data, .kept = kept };
    find_separator(&s);
    s.columns = count_fields(s.at, s.separator);
    s.title = calloc(s.columns + 1, sizeof *s.title);
    s.cell = calloc(s.columns + 1, sizeof *s.cell);
    apsm_status status = s.title && s.cell ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK && (size == 0 || s.columns < 2))
        status = apsm_fail(ctx, APSM_ERR_FORMAT,
                           "%s: needs a header and two columns at least, the first of which names "
                           "the shapes",
                           path);
    if (status == APSM_OK) status = read_sheet(&s, I, names, table);
    free(s.title);
    free(s.cell);
    free(data);
    return status;
}

apsm_status apsm_table_read(apsm_context *ctx, const char *path, size_t I, const char *const *names,
                            apsm_table *table)
{
    return read_table(ctx, path, false, I, names, table);
}

/* ---- kept in a model folder ---- */

static const char kept_name[] = "statistics/subjects.csv";

apsm_status apsm_table_read_kept(apsm_context *ctx, const char *folder, size_t I,
                                 const char *const *names, apsm_table *table)
{
    char *path = apsm_path_join(folder, kept_name);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status =
        apsm_file_exists(path) ? read_table(ctx, path, true, I, names, table) : APSM_OK;
    free(path);
    return status;
}

void apsm_column_write(apsm_writer *csv, const apsm_column *c, size_t i)
{
    if (isnan(c->value[i])) return;
    if (c->text)
        apsm_writer_csv(csv, c->text[i]);
    else if (c->category)
        apsm_writer_csv(csv, c->level[(size_t)c->value[i]]);
    else
        apsm_writer_number(csv, c->value[i]);
}

apsm_status apsm_table_write(apsm_context *ctx, const char *path, const char *const *names,
                             const apsm_table *table)
{
    apsm_writer *csv = NULL;
    APSM_TRY(apsm_writer_open(ctx, path, &csv));
    apsm_writer_printf(csv, "name");
    for (size_t k = 0; k < table->n; k++) {
        apsm_writer_printf(csv, ",");
        apsm_writer_csv(csv, table->column[k].name);
    }
    apsm_writer_printf(csv, "\n");
    for (size_t i = 0; i < table->I; i++) {
        apsm_writer_csv(csv, names[i]);
        for (size_t k = 0; k < table->n; k++) {
            apsm_writer_printf(csv, ",");
            apsm_column_write(csv, &table->column[k], i);
        }
        apsm_writer_printf(csv, "\n");
    }
    return apsm_writer_commit(csv);
}

apsm_status apsm_table_keep(apsm_context *ctx, const char *folder, const char *subjects, size_t I,
                            const char *const *names)
{
    apsm_table table = { .I = I };
    char *path = apsm_path_join(folder, kept_name), *inner = apsm_path_join(folder, "statistics");
    apsm_status status = path && inner ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_make_folder(ctx, inner);
    if (status == APSM_OK) status = apsm_table_read(ctx, subjects, I, names, &table);
    if (status == APSM_OK) status = apsm_table_write(ctx, path, names, &table);
    apsm_table_free(&table);
    free(inner);
    free(path);
    return status;
}

apsm_status apsm_table_gather(apsm_context *ctx, const char *folder, const char *subjects,
                              const apsm_project *project, const char *const *names,
                              apsm_table *table)
{
    APSM_TRY(apsm_table_from_project(ctx, project, table));
    if (subjects) return apsm_table_read(ctx, subjects, project->n, names, table);
    return apsm_table_read_kept(ctx, folder, project->n, names, table);
}
