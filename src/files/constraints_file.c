#include "files/constraints_file.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "geometry/vec3.h"

typedef struct reading {
    apsm_context *ctx;
    const char *path;
    apsm_region *region;
} reading;

static apsm_status refuse(const reading *r, const char *where, const char *why)
{
    return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: %s %s; correct it or save it again", r->path,
                     where, why);
}

/* Refuses keys of an object that are none of the words. */
static apsm_status check_keys(const reading *r, const json_t *object, const char *const *words,
                              const char *where)
{
    const char *key;
    json_t *value;
    if (!json_is_object(object)) return refuse(r, where, "is no object");
    json_object_foreach((json_t *)object, key, value)
    {
        size_t k = 0;
        while (words[k] && strcmp(words[k], key) != 0) k++;
        if (!words[k])
            return apsm_fail(r->ctx, APSM_ERR_UNSUPPORTED,
                             "%s: %s has \"%s\", which is not known here; take it out to go on "
                             "without",
                             r->path, where, key);
    }
    return APSM_OK;
}

static bool get_point(const json_t *json, double x[3])
{
    return apsm_json_get_matrix(json, 3, 0, x) && isfinite(x[0] + x[1] + x[2]);
}

/* ---- planes ---- */

/* The side that counts is the one from which a, b, c run counter-clockwise. */
static bool plane_of_points(const json_t *points, double n[3], double on[3])
{
    double x[9], e2 = 0.0;
    if (!apsm_json_get_matrix(points, 3, 3, x)) return false;
    vec3_triangle(x, x + 3, x + 6, n);
    for (int k = 0; k < 3; k++) e2 = fmax(e2, vec3_distance2(x + 3 * k, x + 3 * ((k + 1) % 3)));
    memcpy(on, x, 3 * sizeof *on);
    return vec3_norm(n) > 1e-9 * e2;
}

static apsm_status read_plane(const reading *r, const json_t *plane)
{
    static const char *const keys[] = { "points", "normal", "center", "point", NULL };
    double *to = r->region->plane[r->region->planes], n[3], on[3];
    APSM_TRY(check_keys(r, plane, keys, "a plane"));
    const json_t *points = json_object_get(plane, "points");
    const json_t *centre = json_object_get(plane, "center");
    if (!centre) centre = json_object_get(plane, "point");
    const bool ok = points ? plane_of_points(points, n, on)
                           : get_point(json_object_get(plane, "normal"), n) &&
                                 get_point(centre, on) && vec3_norm(n) > 0.0;
    if (!ok)
        return refuse(r, "a plane",
                      "has neither three \"points\" that are not in a line nor a \"normal\" and a "
                      "\"point\"");
    vec3_normalise(n);
    memcpy(to, n, sizeof n);
    to[3] = vec3_dot(n, on);
    r->region->planes++;
    return APSM_OK;
}

static apsm_status read_planes(const reading *r, const json_t *planes)
{
    size_t k;
    json_t *plane;
    if (!json_is_array(planes)) return refuse(r, "\"planes\"", "is no list");
    r->region->plane = calloc(json_array_size(planes) + 1, sizeof *r->region->plane);
    if (!r->region->plane) return APSM_ERR_MEMORY;
    json_array_foreach(planes, k, plane) APSM_TRY(read_plane(r, plane));
    return APSM_OK;
}

/* ---- spheres ---- */

static apsm_status read_spheres(const reading *r, const json_t *spheres)
{
    static const char *const keys[] = { "center", "radius", NULL };
    size_t k;
    json_t *sphere;
    if (!json_is_array(spheres)) return refuse(r, "\"spheres\"", "is no list");
    r->region->sphere = calloc(json_array_size(spheres) + 1, sizeof *r->region->sphere);
    if (!r->region->sphere) return APSM_ERR_MEMORY;
    json_array_foreach(spheres, k, sphere)
    {
        double *to = r->region->sphere[r->region->spheres];
        APSM_TRY(check_keys(r, sphere, keys, "a sphere"));
        to[3] = json_number_value(json_object_get(sphere, "radius"));
        if (!get_point(json_object_get(sphere, "center"), to) || !(to[3] > 0.0) || isinf(to[3]))
            return refuse(r, "a sphere", "has no \"center\", or no \"radius\" above 0");
        r->region->spheres++;
    }
    return APSM_OK;
}

/* ---- free forms ---- */

static apsm_status read_points(const reading *r, const json_t *list, const char *where, double *X)
{
    size_t k;
    json_t *point;
    json_array_foreach(list, k, point)
    {
        if (!get_point(point, X + 3 * k)) return refuse(r, where, "has a point that is none");
    }
    return APSM_OK;
}

/* Values of a painted point: inside from a half on. */
static apsm_status read_field(const reading *r, const json_t *field)
{
    static const char *const keys[] = { "points", "scalars", NULL };
    apsm_region *to = r->region;
    size_t k, inside = 0;
    json_t *value;
    APSM_TRY(check_keys(r, field, keys, "\"field\""));
    const json_t *points = json_object_get(field, "points");
    const json_t *scalars = json_object_get(field, "scalars");
    const size_t n = json_array_size(points);
    if (n == 0 || json_array_size(scalars) != n)
        return refuse(r, "\"field\"", "has not as many \"scalars\" as \"points\"");
    to->point = malloc(3 * n * sizeof *to->point);
    to->in = malloc(n * sizeof *to->in);
    if (!to->point || !to->in) return APSM_ERR_MEMORY;
    APSM_TRY(read_points(r, points, "\"field\"", to->point));
    json_array_foreach(scalars, k, value)
    {
        if (!json_is_number(value)) return refuse(r, "\"field\"", "has a scalar that is no number");
        to->in[k] = json_number_value(value) >= 0.5;
        inside += to->in[k];
    }
    to->painted = n;
    return inside > 0 ? APSM_OK : refuse(r, "\"field\"", "leaves no point: all scalars are 0");
}

static apsm_status count_corners(const reading *r, const json_t *loops, size_t *corners)
{
    static const char *const keys[] = { "points", NULL };
    size_t k;
    json_t *loop;
    *corners = 0;
    json_array_foreach(loops, k, loop)
    {
        APSM_TRY(check_keys(r, loop, keys, "a boundary"));
        const size_t n = json_array_size(json_object_get(loop, "points"));
        if (n < 3) return refuse(r, "a boundary", "has fewer than three \"points\"");
        *corners += n;
    }
    return APSM_OK;
}

static apsm_status read_loops(const reading *r, const json_t *loops, const json_t *query)
{
    apsm_region *to = r->region;
    size_t k, corners;
    json_t *loop;
    if (!json_is_array(loops)) return refuse(r, "\"boundaries\"", "is no list");
    APSM_TRY(count_corners(r, loops, &corners));
    to->loop_start = calloc(json_array_size(loops) + 1, sizeof *to->loop_start);
    to->boundary = malloc(3 * corners * sizeof *to->boundary + 1);
    if (!to->loop_start || !to->boundary) return APSM_ERR_MEMORY;
    json_array_foreach(loops, k, loop)
    {
        const json_t *points = json_object_get(loop, "points");
        double *at = to->boundary + 3 * to->loop_start[k];
        APSM_TRY(read_points(r, points, "a boundary", at));
        to->loop_start[k + 1] = to->loop_start[k] + json_array_size(points);
    }
    to->loops = json_array_size(loops);
    if (to->loops > 0 && !get_point(query, to->query))
        return refuse(r, "\"free_form_constraints\"",
                      "has boundaries and no \"query_point\" that says which side counts");
    return APSM_OK;
}

static apsm_status read_free_form(const reading *r, const json_t *form)
{
    static const char *const keys[] = { "field", "boundaries", "query_point", NULL };
    if (json_is_null(form)) return APSM_OK;
    APSM_TRY(check_keys(r, form, keys, "\"free_form_constraints\""));
    const json_t *field = json_object_get(form, "field");
    const json_t *loops = json_object_get(form, "boundaries");
    if (json_object_size(field) > 0) return read_field(r, field); /* boundaries are made of it */
    if (loops) return read_loops(r, loops, json_object_get(form, "query_point"));
    return APSM_OK;
}

static apsm_status read_all(const reading *r, const json_t *root)
{
    static const char *const keys[] = { "planes", "spheres", "free_form_constraints", NULL };
    APSM_TRY(check_keys(r, root, keys, "the file"));
    const json_t *planes = json_object_get(root, "planes");
    const json_t *form = json_object_get(root, "free_form_constraints");
    const json_t *spheres = json_object_get(root, "spheres");
    if (planes && !json_is_null(planes)) APSM_TRY(read_planes(r, planes));
    if (spheres) APSM_TRY(read_spheres(r, spheres));
    return form ? read_free_form(r, form) : APSM_OK;
}

/* Of an open root, which goes. */
static apsm_status read_root(apsm_context *ctx, const char *what, json_t *root, apsm_region *region)
{
    const reading r = { ctx, what, region };
    const apsm_status status = read_all(&r, root);
    json_decref(root);
    if (status != APSM_OK) apsm_region_free(region);
    return status;
}

apsm_status apsm_constraints_read(apsm_context *ctx, const char *path, apsm_region *region)
{
    json_t *root;
    *region = (apsm_region){ 0 };
    APSM_TRY(apsm_json_read(ctx, path, &root));
    return read_root(ctx, path, root, region);
}

/* ---- in a column ---- */

bool apsm_constraints_are_here(const char *column)
{
    return column && column[0] == '{';
}

static json_t *parse(apsm_context *ctx, const char *what, const char *text)
{
    json_error_t error;
    json_t *root = json_loads(text, JSON_REJECT_DUPLICATES, &error);
    if (!root)
        (void)apsm_fail(ctx, APSM_ERR_FORMAT, "%s: %d:%d: %s; correct it, or name a file there",
                        what, error.line, error.column, error.text);
    return root;
}

apsm_status apsm_constraints_parse(apsm_context *ctx, const char *what, const char *text,
                                   apsm_region *region)
{
    *region = (apsm_region){ 0 };
    json_t *root = parse(ctx, what, text);
    return root ? read_root(ctx, what, root, region) : APSM_ERR_FORMAT;
}

void apsm_constraints_name(const char *name, const char *key, char stored[APSM_CONSTRAINTS_NAME])
{
    snprintf(stored, APSM_CONSTRAINTS_NAME, "constraints/%.900s_%.64s.json", name,
             key + strlen("constraints_"));
}

/* One column, whose text it replaces. */
static apsm_status store(apsm_context *ctx, const apsm_project *project, const char *name,
                         const char *key, json_t *column)
{
    char stored[APSM_CONSTRAINTS_NAME];
    apsm_constraints_name(name, key, stored);
    json_t *root = parse(ctx, stored, json_string_value(column));
    char *path = apsm_project_path(project, stored), *folder = path ? apsm_path_folder(path) : NULL;
    apsm_status status = !root ? APSM_ERR_FORMAT : folder ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_make_folder(ctx, folder);
    if (status == APSM_OK) status = apsm_json_write(ctx, path, root);
    if (status == APSM_OK && json_string_set(column, stored)) status = APSM_ERR_MEMORY;
    json_decref(root);
    free(folder);
    free(path);
    return status;
}

apsm_status apsm_constraints_store(apsm_context *ctx, const apsm_project *project,
                                   const apsm_subject *subject)
{
    const char *key;
    json_t *column;
    json_object_foreach(subject->row, key, column)
    {
        if (strncmp(key, "constraints_", strlen("constraints_")) == 0 &&
            apsm_constraints_are_here(json_string_value(column)))
            APSM_TRY(store(ctx, project, subject->name, key, column));
    }
    return APSM_OK;
}
