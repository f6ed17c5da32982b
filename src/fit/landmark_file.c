#include "fit/landmark_file.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "files/files.h"

enum { MOST_BYTES = 1 << 26, FIELDS = 16 };

static bool ends_in(const char *path, const char *extension)
{
    const size_t n = strlen(path), m = strlen(extension);
    return n > m && strcasecmp(path + n - m, extension) == 0;
}

bool fit_is_landmark_file(const char *path)
{
    return ends_in(path, ".mrk.json") || ends_in(path, ".fcsv") || ends_in(path, ".csv");
}

void fit_landmarks_free(fit_landmarks *l)
{
    for (size_t k = 0; k < l->n; k++) free(l->name[k]);
    free(l->name);
    free(l->x);
    *l = (fit_landmarks){ 0 };
}

size_t fit_landmarks_find(const fit_landmarks *l, const char *name)
{
    size_t k = 0;
    while (k < l->n && strcmp(l->name[k], name) != 0) k++;
    return k;
}

static apsm_status add(apsm_context *ctx, const char *path, const char *name, const double x[3],
                       fit_landmarks *l)
{
    if (!*name)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: point %zu has no name; give it one", path,
                         l->n + 1);
    if (fit_landmarks_find(l, name) < l->n)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: two points are called '%s'; rename one", path,
                         name);
    for (size_t c = 0; c < 3; c++)
        if (!isfinite(x[c]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE, "%s: '%s' is not at a finite place", path,
                             name);
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

/* ---- .mrk.json ---- */

static apsm_status add_point(apsm_context *ctx, const char *path, const json_t *point, bool ras,
                             fit_landmarks *l)
{
    double x[3];
    const char *status = json_string_value(json_object_get(point, "positionStatus"));
    const char *label = json_string_value(json_object_get(point, "label"));
    if (status && strcmp(status, "defined") != 0) return APSM_OK;
    if (!apsm_json_get_matrix(json_object_get(point, "position"), 3, 0, x))
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: point %zu has no position of three numbers",
                         path, l->n + 1);
    for (size_t c = 0; c < 2 && ras; c++) x[c] = -x[c];
    return add(ctx, path, label ? label : "", x, l);
}

static apsm_status read_markups(apsm_context *ctx, const char *path, fit_landmarks *l)
{
    json_t *root = NULL;
    APSM_TRY(apsm_json_read(ctx, path, &root));
    const json_t *list = json_array_get(json_object_get(root, "markups"), 0);
    const json_t *points = json_object_get(list, "controlPoints");
    const char *system = json_string_value(json_object_get(list, "coordinateSystem"));
    const bool ras = system && (strcmp(system, "RAS") == 0 || strcmp(system, "0") == 0);
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < json_array_size(points) && status == APSM_OK; k++)
        status = add_point(ctx, path, json_array_get(points, k), ras, l);
    json_decref(root);
    return status;
}

/* ---- tables ---- */

/* Cuts a line at its commas, in place; returns how many fields. */
static size_t cut_fields(char *line, char *field[FIELDS])
{
    size_t n = 0;
    for (char *at = line; n < FIELDS;) {
        field[n++] = at;
        char *comma = strchr(at, ',');
        if (!comma) break;
        *comma = 0;
        at = comma + 1;
    }
    for (size_t k = 0; k < n; k++) { /* blanks around */
        while (*field[k] == ' ' || *field[k] == '\t') field[k]++;
        char *end = field[k] + strlen(field[k]);
        while (end > field[k] && strchr(" \t\r", end[-1])) *--end = 0;
    }
    return n;
}

/* Where the columns are: name,x,y,z in a .csv, id,x,y,z,...,label (the 12th) in a .fcsv. */
static apsm_status add_line(apsm_context *ctx, const char *path, size_t number, char *line,
                            bool slicer, bool ras, fit_landmarks *l)
{
    char *field[FIELDS];
    double x[3];
    const size_t n = cut_fields(line, field), label = slicer ? 11 : 0;
    if (n < 4 || label >= n)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s:%zu: %s", path, number,
                         slicer ? "is no point of 3D Slicer" : "is not name,x,y,z");
    for (size_t c = 0; c < 3; c++)
        if (!apsm_parse_number(field[1 + c], strlen(field[1 + c]), &x[c]))
            return apsm_fail(ctx, APSM_ERR_FORMAT, "%s:%zu: '%s' is no number", path, number,
                             field[1 + c]);
    for (size_t c = 0; c < 2 && ras; c++) x[c] = -x[c];
    return add(ctx, path, field[label], x, l);
}

/* Comments of a .fcsv say the frame: "# CoordinateSystem = LPS", 0 or RAS. */
static void read_comment(const char *line, bool *ras)
{
    if (!strstr(line, "CoordinateSystem")) return;
    const char *value = strchr(line, '=');
    *ras = value && (strstr(value, "RAS") || strchr(value, '0'));
}

static apsm_status read_table(apsm_context *ctx, const char *path, fit_landmarks *l)
{
    char *text = NULL;
    size_t size, number = 0;
    const bool slicer = ends_in(path, ".fcsv");
    bool ras = slicer;
    APSM_TRY(apsm_read_file(ctx, path, MOST_BYTES, &text, &size));
    apsm_status status = APSM_OK;
    for (char *at = text, *next; at && *at && status == APSM_OK; at = next) {
        next = strchr(at, '\n');
        if (next) *next++ = 0;
        number++;
        if (*at == '#')
            read_comment(at, &ras);
        else if (number == 1 && !slicer && strncasecmp(at, "name,", 5) == 0)
            continue;
        else if (at[strspn(at, " \t\r")])
            status = add_line(ctx, path, number, at, slicer, ras, l);
    }
    free(text);
    return status;
}

apsm_status fit_landmarks_read(apsm_context *ctx, const char *path, fit_landmarks *l)
{
    *l = (fit_landmarks){ 0 };
    apsm_status status =
        ends_in(path, ".mrk.json") ? read_markups(ctx, path, l) : read_table(ctx, path, l);
    if (status == APSM_OK && l->n == 0)
        status = apsm_fail(ctx, APSM_ERR_FORMAT, "%s: holds no points", path);
    if (status != APSM_OK) fit_landmarks_free(l);
    return status;
}
