/* The cells of an .xlsx (ECMA-376): a ZIP archive of XML parts.  minizip opens the archive, expat
 * the parts; both are read in pieces, and nothing is allocated by what the archive claims.
 *
 * xl/workbook.xml names the sheets, xl/_rels/workbook.xml.rels tells which part is which, most
 * texts are in xl/sharedStrings.xml. */
#include <errno.h>
#include <expat.h>
#include <minizip/unzip.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "files/io.h"
#include "files/sheets.h"

enum { PART_NAME = 512, PIECE = 1 << 16, LAST_ROW = 1048576, LAST_COLUMN = 16384 };
#define PART_LIMIT ((size_t)1 << 28) /* bytes of a part when unpacked */

/* ---- Texts that grow, lists of texts ---- */

typedef struct growing {
    char *at; /* ends with NUL once something was added */
    size_t length, capacity;
} growing;

static bool growing_add(growing *t, const char *more, size_t n)
{
    if (t->length + n + 1 > t->capacity) {
        const size_t capacity = 2 * (t->length + n) + 64;
        char *at = realloc(t->at, capacity);
        if (!at) return false;
        t->at = at;
        t->capacity = capacity;
    }
    memcpy(t->at + t->length, more, n);
    t->length += n;
    t->at[t->length] = '\0';
    return true;
}

typedef struct cell {
    size_t row, column;
    char *text;
} cell;

typedef struct part {
    char *id, *target;
} part;

/* ---- Reading one part ---- */

typedef enum part_kind { PART_RELATIONS, PART_WORKBOOK, PART_STRINGS, PART_SHEET } part_kind;

typedef struct reading {
    apsm_context *ctx;
    const char *path;
    unzFile archive;
    XML_Parser parser;
    apsm_status status; /* of handlers, which cannot return one */
    part_kind kind;
    const char *sheet; /* its name, for messages */

    part *parts; /* from the relations */
    size_t n_parts;
    char *strings_target;
    part *sheets; /* name instead of target */
    size_t n_sheets;
    char **strings; /* shared */
    size_t n_strings, strings_room;
    cell *cells;
    size_t n_cells, cells_room;

    /* Where the parser is. */
    size_t row, column; /* of the cell, from 0 */
    char type;          /* of the cell: its t, first letters told apart; 'n' if it has none */
    bool in_value, in_phonetic;
    growing value;
} reading;

static void stop(reading *r, apsm_status status)
{
    if (r->status == APSM_OK) r->status = status;
    XML_StopParser(r->parser, XML_FALSE);
}

static void no_memory(reading *r)
{
    stop(r, apsm_fail_errno(r->ctx, r->path, "cannot be read", ENOMEM));
}

/* Names come as NAMESPACE|NAME. */
static const char *local(const char *name)
{
    const char *bar = strrchr(name, '|');
    return bar ? bar + 1 : name;
}

static const char *attribute(const char **attributes, const char *name)
{
    for (; attributes[0]; attributes += 2)
        if (strcmp(local(attributes[0]), name) == 0) return attributes[1];
    return NULL;
}

/* r:id of a sheet: the one with a namespace, since sheetId has none. */
static const char *relation_id(const char **attributes)
{
    for (; attributes[0]; attributes += 2)
        if (strchr(attributes[0], '|') && strcmp(local(attributes[0]), "id") == 0)
            return attributes[1];
    return NULL;
}

static void add_pair(reading *r, part **list, size_t *n, const char *id, const char *target)
{
    part *longer = realloc(*list, (*n + 1) * sizeof **list);
    if (!longer) {
        no_memory(r);
        return;
    }
    *list = longer;
    longer[*n] = (part){ strdup(id), strdup(target) };
    ++*n;
    if (!longer[*n - 1].id || !longer[*n - 1].target) no_memory(r);
}

static bool ends_with(const char *text, const char *end)
{
    const size_t n = strlen(text), m = strlen(end);
    return n >= m && strcmp(text + n - m, end) == 0;
}

static void take_relation(reading *r, const char **attributes)
{
    const char *id = attribute(attributes, "Id"), *target = attribute(attributes, "Target");
    const char *type = attribute(attributes, "Type");
    if (!id || !target || !type) return;
    if (ends_with(type, "/sharedStrings") && !r->strings_target) {
        r->strings_target = strdup(target);
        if (!r->strings_target) no_memory(r);
    }
    add_pair(r, &r->parts, &r->n_parts, id, target);
}

/* "BC17" to row 16, column 54.  False if it is no cell. */
static bool parse_reference(const char *text, size_t *row, size_t *column)
{
    size_t x = 0, y = 0;
    for (; *text >= 'A' && *text <= 'Z' && x <= LAST_COLUMN; text++)
        x = 26 * x + (size_t)(*text - 'A' + 1);
    for (; *text >= '0' && *text <= '9' && y <= LAST_ROW; text++)
        y = 10 * y + (size_t)(*text - '0');
    if (*text || x == 0 || y == 0 || x > LAST_COLUMN || y > LAST_ROW) return false;
    *row = y - 1;
    *column = x - 1;
    return true;
}

/* The next cell may have no reference: it is right of the one before. */
static void begin_cell(reading *r, const char **attributes)
{
    const char *at = attribute(attributes, "r"), *t = attribute(attributes, "t");
    static const char *const types[] = { "n", "s", "str", "inlineStr", "b", "e", "d" };
    static const char letters[] = "nstibed";
    r->column++;
    if (at && !parse_reference(at, &r->row, &r->column))
        stop(r, apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: sheet %s: '%.*s' is no cell", r->path,
                          r->sheet, APSM_SHOWN, at));
    r->type = t ? '?' : 'n';
    for (size_t k = 0; t && k < sizeof types / sizeof *types; k++)
        if (strcmp(t, types[k]) == 0) r->type = letters[k];
    r->value.length = 0;
}

static void XMLCALL begin_element(void *user, const char *name, const char **attributes)
{
    reading *r = user;
    const char *word = local(name);
    size_t number;
    if (r->kind == PART_RELATIONS && strcmp(word, "Relationship") == 0)
        take_relation(r, attributes);
    if (r->kind == PART_WORKBOOK && strcmp(word, "sheet") == 0) {
        const char *id = relation_id(attributes), *title = attribute(attributes, "name");
        if (id && title) add_pair(r, &r->sheets, &r->n_sheets, id, title);
        return;
    }
    if (strcmp(word, "rPh") == 0) r->in_phonetic = true;
    if (strcmp(word, "si") == 0) r->value.length = 0;
    if (strcmp(word, "t") == 0 || (r->kind == PART_SHEET && strcmp(word, "v") == 0))
        r->in_value = !r->in_phonetic;
    if (r->kind != PART_SHEET) return;
    if (strcmp(word, "row") == 0) {
        char reference[32];
        const char *at = attribute(attributes, "r");
        snprintf(reference, sizeof reference, "A%.20s", at ? at : "");
        r->row = at && parse_reference(reference, &r->row, &number) ? r->row : r->row + 1;
        r->column = (size_t)-1;
    }
    if (strcmp(word, "c") == 0) begin_cell(r, attributes);
}

static void XMLCALL take_characters(void *user, const char *characters, int n)
{
    reading *r = user;
    if (r->in_value && !growing_add(&r->value, characters, (size_t)n)) no_memory(r);
}

static void end_string(reading *r)
{
    if (r->n_strings == r->strings_room) {
        const size_t room = 2 * r->strings_room + 64;
        char **longer = realloc(r->strings, room * sizeof *longer);
        if (!longer) {
            no_memory(r);
            return;
        }
        r->strings = longer;
        r->strings_room = room;
    }
    char *copy = strdup(r->value.length ? r->value.at : "");
    if (!copy) {
        no_memory(r);
        return;
    }
    r->strings[r->n_strings++] = copy;
}

/* A1 and so on, for messages. */
static const char *cell_name(const reading *r, char name[32])
{
    char letters[8];
    size_t n = 0, x = r->column + 1;
    for (; x > 0 && n < sizeof letters; x = (x - 1) / 26) letters[n++] = (char)('A' + (x - 1) % 26);
    size_t k = 0;
    while (n > 0) name[k++] = letters[--n];
    snprintf(name + k, 32 - k, "%zu", r->row + 1);
    return name;
}

/* The text of the cell as a person sees it, NULL (and stopped) if it has none. */
static const char *cell_text(reading *r, char number[APSM_NUMBER_LENGTH])
{
    double x;
    char name[32];
    const char *value = r->value.at;
    const bool is_number = apsm_parse_number(value, r->value.length, &x);
    if (r->type == 'b') return strcmp(value, "1") == 0 ? "true" : "false";
    if (r->type == 's') {
        if (is_number && x >= 0 && x < (double)r->n_strings) return r->strings[(size_t)x];
        stop(r,
             apsm_fail(r->ctx, APSM_ERR_FORMAT,
                       "%s: sheet %s, cell %s: has a text that is not in the file; save it again",
                       r->path, r->sheet, cell_name(r, name)));
        return NULL;
    }
    if (r->type == 'e') {
        stop(r, apsm_fail(r->ctx, APSM_ERR_FORMAT,
                          "%s: sheet %s, cell %s: holds the error %.*s; "
                          "correct its formula",
                          r->path, r->sheet, cell_name(r, name), APSM_SHOWN, value));
        return NULL;
    }
    if (r->type != 'n' || !is_number) return value;
    apsm_format_number(x, number);
    return number;
}

static apsm_status too_many(const reading *r)
{
    return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: sheet %s has too many cells for a project",
                     r->path, r->sheet);
}

static void end_cell(reading *r)
{
    char number[APSM_NUMBER_LENGTH];
    if (r->value.length == 0) return;
    if (r->row >= LAST_ROW || r->column >= LAST_COLUMN || r->n_cells >= SHEETS_CELLS) {
        stop(r, too_many(r));
        return;
    }
    if (r->n_cells == r->cells_room) {
        const size_t room = 2 * r->cells_room + 256;
        cell *longer = realloc(r->cells, room * sizeof *longer);
        if (!longer) {
            no_memory(r);
            return;
        }
        r->cells = longer;
        r->cells_room = room;
    }
    const char *value = cell_text(r, number);
    if (!value) return;
    r->cells[r->n_cells] = (cell){ r->row, r->column, strdup(value) };
    if (r->cells[r->n_cells].text)
        r->n_cells++;
    else
        no_memory(r);
}

static void XMLCALL end_element(void *user, const char *name)
{
    reading *r = user;
    const char *word = local(name);
    if (strcmp(word, "rPh") == 0) r->in_phonetic = false;
    if (strcmp(word, "t") == 0 || strcmp(word, "v") == 0) r->in_value = false;
    if (r->kind == PART_STRINGS && strcmp(word, "si") == 0) end_string(r);
    if (r->kind == PART_SHEET && strcmp(word, "c") == 0) end_cell(r);
}

/* Spreadsheets have no document types; entities are how small files grow large. */
static void XMLCALL refuse_doctype(void *user, const char *name, const char *system,
                                   const char *public, int internal)
{
    reading *r = user;
    (void)name, (void)system, (void)public, (void)internal;
    stop(r, apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: is no spreadsheet: it has a document type",
                      r->path));
}

static apsm_status damaged(const reading *r, const char *name, const char *what)
{
    return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                     "%s: %s: %s; is it a damaged or encrypted spreadsheet? save it again", r->path,
                     name, what);
}

static apsm_status parse_pieces(reading *r, const char *name)
{
    size_t total = 0;
    for (;;) {
        void *piece = XML_GetBuffer(r->parser, PIECE);
        if (!piece) return apsm_fail_errno(r->ctx, r->path, "cannot be read", ENOMEM);
        const int n = unzReadCurrentFile(r->archive, piece, PIECE);
        if (n < 0) return damaged(r, name, "cannot be unpacked");
        total += (size_t)n;
        if (total > PART_LIMIT) return damaged(r, name, "is too large");
        const enum XML_Status parsed = XML_ParseBuffer(r->parser, n, n == 0);
        if (r->status != APSM_OK) return r->status;
        if (parsed != XML_STATUS_OK)
            return damaged(r, name, XML_ErrorString(XML_GetErrorCode(r->parser)));
        if (n == 0) break;
    }
    return unzCloseCurrentFile(r->archive) == UNZ_OK ? APSM_OK
                                                     : damaged(r, name, "fails its check sum");
}

static apsm_status read_part(reading *r, part_kind kind, const char *name)
{
    if (unzLocateFile(r->archive, name, 2) != UNZ_OK || unzOpenCurrentFile(r->archive) != UNZ_OK)
        return damaged(r, name, "is not in the file");
    r->parser = XML_ParserCreateNS(NULL, '|');
    if (!r->parser) return apsm_fail_errno(r->ctx, r->path, "cannot be read", ENOMEM);
    r->kind = kind;
    r->status = APSM_OK;
    r->row = r->column = (size_t)-1;
    r->in_value = r->in_phonetic = false;
    XML_SetUserData(r->parser, r);
    XML_SetElementHandler(r->parser, begin_element, end_element);
    XML_SetCharacterDataHandler(r->parser, take_characters);
    XML_SetStartDoctypeDeclHandler(r->parser, refuse_doctype);
    const apsm_status status = parse_pieces(r, name);
    XML_ParserFree(r->parser);
    r->parser = NULL;
    return status;
}

/* ---- The whole ---- */

/* Targets are relative to xl/ or begin with a slash. */
static void part_name(const char *target, char name[PART_NAME])
{
    if (target[0] == '/')
        snprintf(name, PART_NAME, "%s", target + 1);
    else
        snprintf(name, PART_NAME, "xl/%s", target);
}

static apsm_status fill_sheet(reading *r, workbook *w)
{
    size_t rows = 0, columns = 0;
    for (size_t k = 0; k < r->n_cells; k++) {
        rows = r->cells[k].row >= rows ? r->cells[k].row + 1 : rows;
        columns = r->cells[k].column >= columns ? r->cells[k].column + 1 : columns;
    }
    if (columns > 0 && rows > SHEETS_CELLS / columns) return too_many(r);
    sheet *s = workbook_add(w, r->sheet, rows, columns);
    if (!s) return apsm_fail_errno(r->ctx, r->path, "cannot be read", ENOMEM);
    for (size_t k = 0; k < r->n_cells; k++) {
        char **slot = &s->cell[r->cells[k].row * columns + r->cells[k].column];
        free(*slot);
        *slot = r->cells[k].text;
        r->cells[k].text = NULL;
    }
    r->n_cells = 0;
    return APSM_OK;
}

static apsm_status read_sheet(reading *r, const part *named, workbook *w)
{
    char name[PART_NAME];
    const char *target = NULL;
    for (size_t k = 0; k < r->n_parts && !target; k++)
        if (strcmp(r->parts[k].id, named->id) == 0) target = r->parts[k].target;
    r->sheet = named->target;
    if (!target) return damaged(r, named->target, "the sheet has no part");
    part_name(target, name);
    APSM_TRY(read_part(r, PART_SHEET, name));
    return fill_sheet(r, w);
}

static apsm_status read_all(reading *r, workbook *w)
{
    char name[PART_NAME];
    APSM_TRY(read_part(r, PART_RELATIONS, "xl/_rels/workbook.xml.rels"));
    APSM_TRY(read_part(r, PART_WORKBOOK, "xl/workbook.xml"));
    if (r->strings_target) {
        part_name(r->strings_target, name);
        APSM_TRY(read_part(r, PART_STRINGS, name));
    }
    for (size_t k = 0; k < r->n_sheets; k++) APSM_TRY(read_sheet(r, &r->sheets[k], w));
    return w->n > 0 ? APSM_OK : damaged(r, "xl/workbook.xml", "has no sheets");
}

static void free_parts(part *parts, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        free(parts[k].id);
        free(parts[k].target);
    }
    free(parts);
}

static void reading_free(reading *r)
{
    free_parts(r->parts, r->n_parts);
    free_parts(r->sheets, r->n_sheets);
    free(r->strings_target);
    for (size_t k = 0; k < r->n_strings; k++) free(r->strings[k]);
    free(r->strings);
    for (size_t k = 0; k < r->n_cells; k++) free(r->cells[k].text);
    free(r->cells);
    free(r->value.at);
}

apsm_status workbook_read(apsm_context *ctx, const char *path, workbook *w)
{
    *w = (workbook){ 0 };
    int fd;
    APSM_TRY(apsm_open_regular(ctx, path, &fd)); /* minizip would wait for a pipe */
    close(fd);
    reading r = { .ctx = ctx, .path = path, .archive = unzOpen64(path) };
    if (!r.archive)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: is no .xlsx, or damaged or encrypted; save it again", path);
    const apsm_status status = read_all(&r, w);
    unzCloseCurrentFile(r.archive);
    unzClose(r.archive);
    reading_free(&r);
    if (status != APSM_OK) workbook_free(w);
    return status;
}
