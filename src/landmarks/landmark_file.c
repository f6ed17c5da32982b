#include "landmarks/landmark_file.h"

#include <ctype.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "files/files.h"

enum { MOST_BYTES = 1 << 26 };

static bool ends_in(const char *path, const char *extension)
{
    const size_t n = strlen(path), m = strlen(extension);
    return n > m && strcasecmp(path + n - m, extension) == 0;
}

bool landmark_is_file(const char *path)
{
    return ends_in(path, ".mrk.json") || ends_in(path, ".fcsv") || ends_in(path, ".csv");
}

void landmark_list_free(landmark_list *l)
{
    for (size_t k = 0; k < l->n; k++) free(l->name[k]);
    free(l->name);
    free(l->x);
    *l = (landmark_list){ 0 };
}

size_t landmark_list_find(const landmark_list *l, const char *name)
{
    size_t k = 0;
    while (k < l->n && strcmp(l->name[k], name) != 0) k++;
    return k;
}

/* No coordinate, in any unit. */
static const double farthest = 1e15;

bool landmark_is_place(const double x[3])
{
    for (size_t c = 0; c < 3; c++)
        if (!(fabs(x[c]) < farthest)) return false;
    return true;
}

apsm_status landmark_list_add(apsm_context *ctx, const char *path, const char *name,
                              const double x[3], landmark_list *l)
{
    if (!*name)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: point %zu has no name; give it one", path,
                         l->n + 1);
    if (landmark_list_find(l, name) < l->n)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: two points are called '%s'; rename one", path,
                         name);
    if (!landmark_is_place(x))
        return apsm_fail(ctx, APSM_ERR_NONFINITE, "%s: '%s' is not at a place where anything is",
                         path, name);
    char **names = realloc(l->name, (l->n + 1) * sizeof *names);
    if (names) l->name = names;
    double *all = realloc(l->x, 3 * (l->n + 1) * sizeof *all);
    if (all) l->x = all;
    char *copy = strdup(name);
    if (!names || !all || !copy) {
        free(copy);
        return APSM_ERR_MEMORY;
    }
    l->name[l->n] = copy;
    memcpy(l->x + 3 * l->n++, x, 3 * sizeof *x);
    return APSM_OK;
}

/* What is known of a file while it is read. */
typedef struct reading {
    apsm_context *ctx;
    const char *path;
    landmark_list *l;
    bool ras;        /* x and y change their signs */
    bool known;      /* the frame is one that is */
    size_t columns;  /* of a .csv, of its header */
    size_t defined;  /* the column that says whether a point has been placed; 0: none */
    size_t unplaced; /* points */
    char first[41];  /* of these */
} reading;

/* As texts and numbers of 3D Slicer call it. */
static void take_frame(reading *r, const char *text)
{
    static const char *const names[] = { "LPS", "1", "RAS", "0" };
    r->known = false;
    for (size_t k = 0; k < 4; k++) {
        if (strcasecmp(text, names[k]) != 0) continue;
        r->known = true;
        r->ras = k > 1;
    }
}

static apsm_status check_frame(const reading *r)
{
    if (r->known) return APSM_OK;
    return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                     "%s: its coordinate system is neither LPS nor RAS; save it as one of them",
                     r->path);
}

static apsm_status add_placed(reading *r, const char *name, double x[3])
{
    for (size_t c = 0; c < 2 && r->ras; c++) x[c] = -x[c];
    return landmark_list_add(r->ctx, r->path, name, x, r->l);
}

static void leave_out(reading *r, const char *name)
{
    if (r->unplaced++ == 0) snprintf(r->first, sizeof r->first, "%s", name);
}

static void tell_unplaced(const reading *r)
{
    if (r->unplaced > 0)
        apsm_log(r->ctx, APSM_LOG_WARNING,
                 "%s: %zu of its points (%s%s) %s not been placed: left out", r->path, r->unplaced,
                 r->first, r->unplaced > 1 ? ", ..." : "", r->unplaced > 1 ? "have" : "has");
}

/* ---- .mrk.json ---- */

static apsm_status add_point(reading *r, const json_t *point)
{
    double x[3];
    const char *status = json_string_value(json_object_get(point, "positionStatus"));
    const char *label = json_string_value(json_object_get(point, "label"));
    if (!label) label = "";
    if (status && strcmp(status, "defined") != 0) {
        leave_out(r, label);
        return APSM_OK;
    }
    if (!apsm_json_get_matrix(json_object_get(point, "position"), 3, 0, x))
        return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: point %zu has no position of three numbers",
                         r->path, r->l->n + 1);
    return add_placed(r, label, x);
}

/* A text, or one for each axis. */
static void tell_unit(const reading *r, const json_t *unit)
{
    const char *const name =
        json_string_value(json_is_array(unit) ? json_array_get(unit, 0) : unit);
    if (name && *name && strcmp(name, "mm") != 0)
        apsm_log(r->ctx, APSM_LOG_WARNING,
                 "%s: is in %.20s; its numbers are taken as they are, as if in the unit of the "
                 "shapes",
                 r->path, name);
}

static apsm_status read_points(reading *r, const json_t *list)
{
    const json_t *points = json_object_get(list, "controlPoints");
    const char *const system = json_string_value(json_object_get(list, "coordinateSystem"));
    r->known = true;
    r->ras = false;
    if (system) take_frame(r, system);
    APSM_TRY(check_frame(r));
    tell_unit(r, json_object_get(list, "coordinateUnits"));
    for (size_t k = 0; k < json_array_size(points); k++)
        APSM_TRY(add_point(r, json_array_get(points, k)));
    return APSM_OK;
}

static apsm_status read_markups(reading *r)
{
    json_t *root = NULL;
    APSM_TRY(apsm_json_read(r->ctx, r->path, &root));
    const json_t *lists = json_object_get(root, "markups");
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < json_array_size(lists) && status == APSM_OK; k++)
        status = read_points(r, json_array_get(lists, k));
    json_decref(root);
    return status;
}

/* ---- tables ---- */

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

/* A field in quotes, from behind the first one; two quotes stand for one.  Returns where it ends.
 */
static char *unquote(char *at)
{
    char *to = at;
    while (*at && (*at != '"' || at[1] == '"')) {
        at += *at == '"';
        *to++ = *at++;
    }
    char *end = *at ? at + 1 : at;
    *to = 0;
    return end;
}

size_t landmark_cut_fields(char *line, char *field[LANDMARK_FIELDS])
{
    size_t n = 0;
    for (char *at = line; n < LANDMARK_FIELDS;) {
        while (is_blank(*at)) at++;
        const bool quoted = *at == '"';
        field[n] = at + quoted;
        if (quoted) at = unquote(at + 1);
        char *comma = strchr(at, ','), *end = comma ? comma : at + strlen(at);
        while (!quoted && end > field[n] && is_blank(end[-1])) end--;
        if (!quoted) *end = 0;
        n++;
        if (!comma) break;
        at = comma + 1;
    }
    return n;
}

/* Where the columns are: name,x,y,z in a .csv, and others only if the header has them (decimal
 * commas would be columns, too); id,x,y,z,...,label (the 12th) in a .fcsv, whose columns are 0. */
static apsm_status add_line(reading *r, size_t number, char *line)
{
    char *field[LANDMARK_FIELDS];
    double x[3];
    const bool slicer = r->columns == 0;
    const size_t n = landmark_cut_fields(line, field), label = slicer ? 11 : 0;
    if (n < 4 || label >= n || (!slicer && n > r->columns))
        return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s:%zu: %s", r->path, number,
                         slicer ? "is no point of 3D Slicer"
                                : "is not name,x,y,z, with commas between and points in numbers");
    if (r->defined > 0 && r->defined < n && strcmp(field[r->defined], "0") == 0) {
        leave_out(r, field[label]);
        return APSM_OK;
    }
    for (size_t c = 0; c < 3; c++)
        if (!apsm_parse_number(field[1 + c], strlen(field[1 + c]), &x[c]))
            return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s:%zu: '%s' is no number", r->path, number,
                             field[1 + c]);
    return add_placed(r, field[label], x);
}

/* Comments may say the frame: "# CoordinateSystem = LPS", 0 or RAS; ':' does for '='.  Of a
 * sentence that only has the word nothing is taken, and that is told. */
static apsm_status read_comment(reading *r, size_t number, char *line)
{
    static const char key[] = "CoordinateSystem";
    char *at = strstr(line, key);
    if (!at) return APSM_OK;
    at += strlen(key) + strspn(at + strlen(key), " \t");
    const bool said = *at == '=' || *at == ':';
    char *const value = at + said + strspn(at + said, " \t");
    value[strcspn(value, " ,\t\r")] = 0;
    take_frame(r, value);
    if (said || r->known) return check_frame(r);
    apsm_log(r->ctx, APSM_LOG_WARNING,
             "%s:%zu: a remark on the coordinate system that is not understood; the points are "
             "read as %s (write '# CoordinateSystem = LPS' or RAS)",
             r->path, number, r->ras ? "RAS" : "LPS");
    return APSM_OK;
}

/* Whether the first field is that of a header, in quotes (as statistics programs write all texts)
 * or not. */
static bool is_header(const char *line)
{
    static const char *const names[] = { "name", "label" };
    const char *const first = line + strspn(line, " \t\"");
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        const size_t n = strlen(names[k]);
        if (strncasecmp(first, names[k], n) == 0 && first[n + strspn(first + n, " \t\"")] == ',')
            return true;
    }
    return false;
}

/* Whether the line is the header of a .csv, which names the axes: l,p,s, r,a,s, or x,y,z, which are
 * LPS unless a remark above says RAS. */
static bool read_header(reading *r, char *line)
{
    static const char *const axes[] = { "xyz", "lps", "ras" };
    char *field[LANDMARK_FIELDS];
    if (!is_header(line)) return false;
    r->columns = landmark_cut_fields(line, field);
    r->known = false;
    for (size_t k = 0; k < 3; k++) {
        bool same = r->columns >= 4;
        for (size_t c = 0; c < 3 && same; c++)
            same = tolower((unsigned char)*field[1 + c]) == axes[k][c];
        if (same) r->known = true, r->ras = k == 2 || (k == 0 && r->ras);
    }
    for (size_t k = 4; k < r->columns; k++)
        if (strcasecmp(field[k], "defined") == 0) r->defined = k;
    return true;
}

static apsm_status read_line(reading *r, size_t number, char *line)
{
    if (*line == '#') return read_comment(r, number, line);
    const bool begun = r->l->n + r->unplaced > 0;
    if (begun || r->columns == 0 || !read_header(r, line))
        return line[strspn(line, " \t\r")] ? add_line(r, number, line) : APSM_OK;
    if (r->known) return APSM_OK;
    return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                     "%s:%zu: its columns are not name,x,y,z (or name,r,a,s); name them so",
                     r->path, number);
}

static apsm_status read_table(reading *r)
{
    char *text = NULL;
    const bool slicer = ends_in(r->path, ".fcsv");
    size_t size, number = 0;
    r->columns = slicer ? 0 : 4;
    r->ras = slicer;
    APSM_TRY(apsm_read_text(r->ctx, r->path, MOST_BYTES, &text, &size));
    apsm_status status = APSM_OK;
    for (char *at = text, *next; at && *at && status == APSM_OK; at = next) {
        next = strchr(at, '\n');
        if (next) *next++ = 0;
        status = read_line(r, ++number, at);
    }
    free(text);
    return status;
}

/* A list without points is none; nothing is left of one that could not be read. */
static apsm_status finish(apsm_context *ctx, const char *path, apsm_status status, landmark_list *l)
{
    if (status == APSM_OK && l->n == 0)
        status = apsm_fail(ctx, APSM_ERR_FORMAT, "%s: holds no points", path);
    if (status != APSM_OK) landmark_list_free(l);
    return status;
}

apsm_status landmark_list_read(apsm_context *ctx, const char *path, landmark_list *l)
{
    *l = (landmark_list){ 0 };
    reading r = { .ctx = ctx, .path = path, .l = l };
    const apsm_status status = ends_in(path, ".mrk.json") ? read_markups(&r) : read_table(&r);
    if (status == APSM_OK) tell_unplaced(&r);
    return finish(ctx, path, status, l);
}

/* ---- points without names ---- */

static apsm_status add_plain(apsm_context *ctx, const char *path, size_t number, const char *at,
                             const char *name, landmark_list *l)
{
    double x[3];
    for (size_t c = 0; c < 3; c++) {
        at += strspn(at, " \t\r,");
        const size_t length = strcspn(at, " \t\r,");
        if (!apsm_parse_number(at, length, &x[c]))
            return apsm_fail(ctx, APSM_ERR_FORMAT, "%s:%zu: is not three numbers", path, number);
        at += length;
    }
    if (at[strspn(at, " \t\r,")])
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s:%zu: is more than three numbers", path, number);
    return landmark_list_add(ctx, path, name, x, l);
}

apsm_status landmark_list_read_plain(apsm_context *ctx, const char *path, size_t n,
                                     const char *const *names, landmark_list *l)
{
    char *text = NULL, own[32];
    size_t size, number = 0;
    *l = (landmark_list){ 0 };
    APSM_TRY(apsm_read_text(ctx, path, MOST_BYTES, &text, &size));
    apsm_status status = APSM_OK;
    for (char *at = text, *next; at && *at && status == APSM_OK; at = next) {
        next = strchr(at, '\n');
        if (next) *next++ = 0;
        number++;
        if (!at[strspn(at, " \t\r")]) continue;
        snprintf(own, sizeof own, "%zu", l->n + 1);
        status = add_plain(ctx, path, number, at, l->n < n ? names[l->n] : own, l);
    }
    free(text);
    return finish(ctx, path, status, l);
}

/* ---- writing ---- */

static json_t *point_json(const landmark_list *l, size_t k)
{
    char id[32];
    snprintf(id, sizeof id, "%zu", k + 1);
    return json_pack("{s:s, s:s, s:[f, f, f], s:s}", "id", id, "label", l->name[k], "position",
                     l->x[3 * k], l->x[3 * k + 1], l->x[3 * k + 2], "positionStatus", "defined");
}

apsm_status landmark_list_write(apsm_context *ctx, const char *path, const landmark_list *l)
{
    static const char schema[] = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/"
                                 "Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#";
    json_t *points = json_array();
    for (size_t k = 0; k < l->n; k++) json_array_append_new(points, point_json(l, k));
    if (json_array_size(points) != l->n) {
        json_decref(points);
        return APSM_ERR_MEMORY;
    }
    json_t *root = json_pack("{s:s, s:[{s:s, s:s, s:o}]}", "@schema", schema, "markups", "type",
                             "Fiducial", "coordinateSystem", "LPS", "controlPoints", points);
    const apsm_status status = root ? apsm_json_write(ctx, path, root) : APSM_ERR_MEMORY;
    json_decref(root);
    return status;
}
