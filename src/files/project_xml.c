/* A list of elements without one around them all: `<inputs> a.nrrd b.nrrd </inputs>`,
 * `<number_of_particles> 128 </number_of_particles>`.  expat gets the missing element, within which
 * no document type can stand. */
#define _DEFAULT_SOURCE /* strcasecmp */
#include "files/project_xml.h"

#include <expat.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "files/files.h"
#include "files/xml_constraints.h"

enum { LONGEST = 1 << 28, NAME = 64 };
static const char blanks[] = " \t\r\n";

typedef struct reading {
    apsm_context *ctx;
    const char *path;
    XML_Parser parser;
    apsm_status status;
    char name[NAME]; /* of the innermost element */
    bool leaf;       /* no other element has begun in it */
    char *text;      /* in it; owned */
    size_t length, room;
    json_t *values; /* name: text */
} reading;

static void stop(reading *r, apsm_status status)
{
    if (r->status == APSM_OK) r->status = status;
    XML_StopParser(r->parser, XML_FALSE);
}

static void no_memory(reading *r)
{
    stop(r, apsm_fail(r->ctx, APSM_ERR_MEMORY, "%s: out of memory", r->path));
}

static void XMLCALL on_start(void *user, const char *name, const char **attributes)
{
    reading *r = user;
    (void)attributes;
    snprintf(r->name, sizeof r->name, "%s", name);
    r->length = 0;
    r->leaf = true;
}

static void XMLCALL on_text(void *user, const char *text, int n)
{
    reading *r = user;
    const size_t more = (size_t)n;
    if (!r->leaf) return;
    if (r->length + more + 1 > r->room) {
        const size_t room = 2 * (r->length + more) + 64;
        char *const longer = realloc(r->text, room);
        if (!longer) {
            no_memory(r);
            return;
        }
        r->text = longer;
        r->room = room;
    }
    memcpy(r->text + r->length, text, more);
    r->length += more;
}

static void XMLCALL on_end(void *user, const char *name)
{
    reading *r = user;
    const bool leaf = r->leaf;
    size_t first = 0;
    r->leaf = false;
    if (!leaf || strcmp(name, r->name) != 0) return;
    while (first < r->length && strchr(blanks, r->text[first])) first++;
    while (r->length > first && strchr(blanks, r->text[r->length - 1])) r->length--;
    json_t *const value = json_stringn(r->text ? r->text + first : "", r->length - first);
    if (!value || json_object_set_new(r->values, name, value) != 0) no_memory(r);
}

static bool feed(reading *r, const char *text, size_t size, bool last)
{
    if (r->status != APSM_OK) return false;
    if (XML_Parse(r->parser, text, (int)size, last) == XML_STATUS_OK) return true;
    if (r->status == APSM_OK)
        r->status = apsm_fail(r->ctx, APSM_ERR_FORMAT,
                              "%s:%lu: %s; correct the file, or give the project as .swproj",
                              r->path, XML_GetCurrentLineNumber(r->parser),
                              XML_ErrorString(XML_GetErrorCode(r->parser)));
    return false;
}

/* What comes before the elements is blanked, so that lines keep their numbers. */
static void blank_declaration(char *text, size_t size)
{
    size_t at = size >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
    memset(text, ' ', at);
    while (at < size && strchr(blanks, text[at])) at++;
    if (size - at < 5 || memcmp(text + at, "<?xml", 5) != 0) return;
    const char *const end = memchr(text + at, '>', size - at);
    for (; end && text + at <= end; at++)
        if (text[at] != '\n') text[at] = ' ';
}

static void parse(reading *r, char *text, size_t size)
{
    static const char begin[] = "<parameters>", end[] = "</parameters>";
    XML_SetUserData(r->parser, r);
    XML_SetElementHandler(r->parser, on_start, on_end);
    XML_SetCharacterDataHandler(r->parser, on_text);
    blank_declaration(text, size);
    if (feed(r, begin, strlen(begin), false) && feed(r, text, size, false))
        feed(r, end, strlen(end), true);
}

/* *values <- all elements without others in them, by their names. */
static apsm_status read_values(apsm_context *ctx, const char *path, json_t **values)
{
    char *text;
    size_t size;
    APSM_TRY(apsm_read_file(ctx, path, LONGEST, &text, &size));
    reading r = { .ctx = ctx, .path = path, .parser = XML_ParserCreate("UTF-8") };
    r.values = json_object();
    if (!r.parser || !r.values)
        r.status = apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    else
        parse(&r, text, size);
    if (r.parser) XML_ParserFree(r.parser);
    free(r.text);
    free(text);
    if (r.status != APSM_OK) json_decref(r.values);
    *values = r.status == APSM_OK ? r.values : NULL;
    return r.status;
}

/* ---- from parameters to a project ---- */

bool apsm_is_parameter_file(const char *path)
{
    const size_t length = strlen(path);
    return length > 4 && strcasecmp(path + length - 4, ".xml") == 0;
}

static const char *text_of(const json_t *values, const char *name)
{
    const char *const text = json_string_value(json_object_get(values, name));
    return text ? text : "";
}

/* Whether number k, from 0, is in a list of numbers. */
static bool lists(const char *text, size_t k)
{
    for (char *end; *text; text = end) {
        const long number = strtol(text, &end, 10);
        if (end == text) return false;
        if (number >= 0 && (size_t)number == k) return true;
    }
    return false;
}

/* Adds input k of domain d, of `domains`, to the rows of data. */
static int add_input(json_t *data, size_t k, size_t domains, const char *file, size_t length,
                     bool fixed)
{
    char key[NAME];
    const size_t d = k % domains;
    if (d == 0 && json_array_append_new(data, json_object())) return -1;
    json_t *const row = json_array_get(data, json_array_size(data) - 1);
    if (d == 0 && fixed && json_object_set_new(row, "fixed", json_string("yes"))) return -1;
    snprintf(key, sizeof key, "shape_%zu", d + 1);
    return json_object_set_new(row, key, json_stringn(file, length));
}

static size_t domains_of(const json_t *values)
{
    const char *const given = text_of(values, "domains_per_shape");
    const long asked = *given ? strtol(given, NULL, 10) : 1;
    return asked >= 1 && asked < 1000 ? (size_t)asked : 1;
}

static apsm_status add_inputs(apsm_context *ctx, const char *path, const json_t *values,
                              json_t *data)
{
    const char *at = text_of(values, "inputs");
    const size_t domains = domains_of(values);
    size_t n = 0;
    for (at += strspn(at, blanks); *at; n++) {
        const size_t length = strcspn(at, blanks);
        const bool fixed = lists(text_of(values, "fixed_domains"), n);
        if (add_input(data, n, domains, at, length, fixed))
            return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
        at += length;
        at += strspn(at, blanks);
    }
    if (n == 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: names no inputs%s", path,
                         *text_of(values, "point_files")
                             ? "; its point_files are particles: `apsm certify` or `apsm import`"
                             : ", and is no parameter file of ShapeWorks");
    if (n % domains == 0) return xml_constraints(ctx, path, values, n, domains, data);
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: has %zu inputs, which are no whole shapes of %zu domains", path, n,
                     domains);
}

/* Everything else, whether it is used or only kept. */
static int add_parameters(const json_t *values, json_t *optimize)
{
    static const char *const others[] = { "inputs", "domains_per_shape", "fixed_domains",
                                          "output_dir" };
    const char *key;
    json_t *value;
    int failed = 0;
    json_object_foreach((json_t *)values, key, value)
    {
        bool taken = xml_is_constraint(key);
        for (size_t k = 0; k < sizeof others / sizeof *others; k++)
            taken = taken || strcmp(key, others[k]) == 0;
        if (!taken) failed |= json_object_set(optimize, key, value);
    }
    return failed;
}

apsm_status project_from_xml(apsm_context *ctx, const char *path, json_t **root)
{
    json_t *values;
    *root = NULL;
    APSM_TRY(read_values(ctx, path, &values));
    json_t *const made =
        json_pack("{s:[], s:{}, s:{s:s}}", "data", "optimize", "project", "version", "2");
    apsm_status status =
        made ? APSM_OK : apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    if (status == APSM_OK) status = add_inputs(ctx, path, values, json_object_get(made, "data"));
    if (status == APSM_OK && add_parameters(values, json_object_get(made, "optimize")))
        status = apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    json_decref(values);
    if (status == APSM_OK)
        *root = made;
    else
        json_decref(made);
    return status;
}
