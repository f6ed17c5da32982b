/* Particles as 3D Slicer's markups (.mrk.json): one fiducial list.  Slicer chooses its reader by
 * the address in "@schema".  Its scene is RAS, its files LPS unless they say otherwise. */
#include "files/point_formats.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "files/io.h"

static const char schema[] = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/"
                             "Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#";

static bool is_text(const json_t *json, const char *text)
{
    return json_is_string(json) && strcmp(json_string_value(json), text) == 0;
}

/* The only fiducial list of the file. */
static apsm_status find_list(apsm_context *ctx, const char *path, const json_t *root,
                             const json_t **list)
{
    const json_t *markups = json_object_get(root, "markups");
    const size_t n = json_array_size(markups);
    *list = json_array_get(markups, 0);
    if (n == 1 && is_text(json_object_get(*list, "type"), "Fiducial") &&
        json_is_array(json_object_get(*list, "controlPoints")))
        return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: holds %zu markups where one list of type Fiducial is expected; save the "
                     "point list alone from 3D Slicer",
                     path, n);
}

/* *sign turns x and y into LPS. */
static apsm_status find_sign(apsm_context *ctx, const char *path, const json_t *list, double *sign)
{
    const json_t *system = json_object_get(list, "coordinateSystem");
    const bool ras = is_text(system, "RAS");
    *sign = ras ? -1.0 : 1.0;
    if (ras)
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%s: is in RAS; x and y change their sign, as all else here is in LPS", path);
    if (!system)
        apsm_log(ctx, APSM_LOG_WARNING, "%s: names no \"coordinateSystem\"; taken as LPS", path);
    if (ras || !system || is_text(system, "LPS")) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: its \"coordinateSystem\" is neither LPS nor RAS; save it again", path);
}

static apsm_status read_point(apsm_context *ctx, const char *path, const json_t *point, size_t j,
                              double sign, double x[3])
{
    const json_t *status = json_object_get(point, "positionStatus");
    if (status && !is_text(status, "defined"))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: control point %zu has not been placed; place or remove it", path, j);
    if (!apsm_json_get_matrix(json_object_get(point, "position"), 3, 0, x))
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: control point %zu: its \"position\" is not three numbers", path, j);
    x[0] *= sign;
    x[1] *= sign;
    return APSM_OK;
}

static apsm_status read_points(apsm_context *ctx, const char *path, const json_t *root, size_t *n,
                               double **P)
{
    const json_t *list;
    double sign;
    APSM_TRY(find_list(ctx, path, root, &list));
    APSM_TRY(find_sign(ctx, path, list, &sign));
    const json_t *points = json_object_get(list, "controlPoints");
    *n = json_array_size(points);
    *P = malloc((3 * *n + 1) * sizeof **P);
    if (!*P) return apsm_fail_errno(ctx, path, "cannot be read", ENOMEM);
    for (size_t j = 0; j < *n; j++)
        APSM_TRY(read_point(ctx, path, json_array_get(points, j), j, sign, *P + 3 * j));
    return APSM_OK;
}

apsm_status apsm_markups_read(apsm_context *ctx, const char *path, size_t *n, double **P)
{
    json_t *root;
    *n = 0;
    *P = NULL;
    APSM_TRY(apsm_json_read(ctx, path, &root));
    const apsm_status status = read_points(ctx, path, root, n, P);
    json_decref(root);
    if (status == APSM_OK) return APSM_OK;
    free(*P);
    *P = NULL;
    *n = 0;
    return status;
}

/* JSON's "-0" is a whole number for most readers, and they lose the sign. */
static void put_number(apsm_writer *w, double x)
{
    apsm_writer_number(w, x);
    if (x == 0.0 && signbit(x)) apsm_writer_write(w, ".0", 2);
}

apsm_status apsm_markups_write(apsm_context *ctx, const char *path, size_t n, const double *P)
{
    apsm_writer *w;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    apsm_writer_printf(w, "{\n    \"@schema\": \"%s\",\n    \"markups\": [\n        {\n", schema);
    apsm_writer_printf(w, "            \"type\": \"Fiducial\",\n"
                          "            \"coordinateSystem\": \"LPS\",\n"
                          "            \"controlPoints\": [");
    for (size_t j = 0; j < n; j++) {
        apsm_writer_printf(w, "%s\n                { \"id\": \"%zu\", \"label\": \"%zu\", ",
                           j ? "," : "", j + 1, j);
        apsm_writer_printf(w, "\"position\": [");
        for (size_t k = 0; k < 3; k++) {
            if (k) apsm_writer_printf(w, ", ");
            put_number(w, P[3 * j + k]);
        }
        apsm_writer_printf(w, "], \"positionStatus\": \"defined\" }");
    }
    apsm_writer_printf(w, "\n            ]\n        }\n    ]\n}\n");
    return apsm_writer_commit(w);
}
