#include "statistics/measurement.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/options.h"
#include "files/files.h"
#include "geometry/bvh.h"
#include "geometry/vec3.h"
#include "statistics/primitive.h"

static const double degrees = 57.295779513082320877;

static const struct {
    const char *word;
    size_t least, most;
    int power;
} kinds[] = {
#define MEASURE_ROW(name, word, least, most, power) { word, least, most, power },
    MEASURE_KINDS(MEASURE_ROW)
};

const char *measure_word(measure_kind kind)
{
    return kinds[kind].word;
}

int measure_power(measure_kind kind)
{
    return kinds[kind].power;
}

void measurement_list_free(measurement_list *list)
{
    for (size_t k = 0; list->of && k < list->n; k++) {
        free(list->of[k].name);
        free(list->of[k].vertex);
    }
    free(list->of);
    free(list->point);
    *list = (measurement_list){ 0 };
}

/* ---- reading ---- */

typedef struct reading {
    apsm_context *ctx;
    const char *path;
    const model_folder *m;
    measurement_list *list;
} reading;

static apsm_status take_kind(const reading *r, const char *word, measurement *one)
{
    size_t best = 0;
    for (size_t k = 0; k < MEASURE_KIND_COUNT; k++) {
        if (strcmp(word, kinds[k].word) == 0) {
            one->kind = (measure_kind)k;
            return APSM_OK;
        }
        if (apsm_edit_distance(word, kinds[k].word) < apsm_edit_distance(word, kinds[best].word))
            best = k;
    }
    return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: '%s': no kind '%s'; did you mean '%s'?", r->path,
                     one->name, word, kinds[best].word);
}

static apsm_status check_keys(const reading *r, const json_t *row, const char *name)
{
    static const char *const known[] = {
        "name", "kind", "points", "radius", "part", "whole", "note"
    };
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)(uintptr_t)row, key, value)
    {
        bool is_known = false;
        for (size_t k = 0; k < sizeof known / sizeof *known; k++)
            is_known = is_known || strcmp(key, known[k]) == 0;
        if (!is_known)
            return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                             "%s: '%s': unknown key '%s'; there are name, kind, points, radius, "
                             "part, whole, note",
                             r->path, name, key);
    }
    return APSM_OK;
}

/* [x, y, z] in the world frame, or the number of a particle. */
static apsm_status take_point(const reading *r, const json_t *json, const char *name, double x[3])
{
    const model_folder *m = r->m;
    if (json_is_integer(json)) {
        const json_int_t j = json_integer_value(json);
        if (j < 0 || (size_t)j >= m->J)
            return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                             "%s: '%s': particle %lld: the model has 0 to %zu", r->path, name,
                             (long long)j, m->J - 1);
        memcpy(x, m->P + 3 * (m->template_index * m->J + (size_t)j), 3 * sizeof *x);
        return APSM_OK;
    }
    if (apsm_json_get_matrix(json, 1, 3, x)) return APSM_OK;
    for (size_t c = 0; c < 3; c++) {
        const json_t *number = json_array_get(json, c);
        if (json_array_size(json) != 3 || !json_is_number(number))
            return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                             "%s: '%s': a point is [x, y, z] or the number of a particle", r->path,
                             name);
        x[c] = json_number_value(number);
    }
    return APSM_OK;
}

/* Points that span a plane must do so on the template. */
static apsm_status check_plane(const reading *r, const measurement *one)
{
    double centre[3], normal[3];
    const size_t before = one->kind == MEASURE_PLANE_DISTANCE ? 1 : 0;
    const double *p = r->list->point + 3 * (one->first_point + before);
    if (one->kind != MEASURE_SECTION && one->kind != MEASURE_PLANE_DISTANCE) return APSM_OK;
    if (primitive_plane(one->points - before, p, centre, normal) == APSM_OK) return APSM_OK;
    return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                     "%s: '%s': the points of the plane lie on a line; move one", r->path,
                     one->name);
}

/* The sides of an angle have a direction. */
static apsm_status check_sides(const reading *r, const measurement *one)
{
    const double *p = r->list->point + 3 * one->first_point;
    if (one->kind != MEASURE_ANGLE) return APSM_OK;
    for (int side = 0; side < 2; side++) {
        const size_t from = one->points == 3 ? 1 : 2 * (size_t)side,
                     to = one->points == 3 ? 2 * (size_t)side : from + 1;
        if (memcmp(p + 3 * from, p + 3 * to, 3 * sizeof *p) == 0)
            return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                             "%s: '%s': two points of a side of the angle are one; move one",
                             r->path, one->name);
    }
    return APSM_OK;
}

static apsm_status take_points(const reading *r, const json_t *points, measurement *one)
{
    measurement_list *list = r->list;
    const size_t n = json_array_size(points), least = kinds[one->kind].least,
                 most = kinds[one->kind].most;
    const bool few = one->kind == MEASURE_SPHERE && one->radius == 0 && n < 4;
    if (n < least || n > most || few)
        return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: '%s': kind %s needs %s%zu point%s, not %zu",
                         r->path, one->name, kinds[one->kind].word, most > 4 ? "at least " : "",
                         few ? 4 : least,
                         few          ? "s (or a radius about one)"
                         : least == 1 ? ""
                                      : "s",
                         n);
    double *more = realloc(list->point, (3 * (list->points + n) + 1) * sizeof *more);
    if (!more) return APSM_ERR_MEMORY;
    list->point = more;
    one->first_point = list->points;
    one->points = n;
    for (size_t k = 0; k < n; k++)
        APSM_TRY(take_point(r, json_array_get(points, k), one->name, more + 3 * list->points++));
    APSM_TRY(check_sides(r, one));
    return check_plane(r, one);
}

static apsm_status take_part(const reading *r, const char *part, measurement *one)
{
    one->part = SIZE_MAX;
    for (size_t d = 0; part && d < r->m->parts; d++)
        if (r->m->part[d].name && strcmp(part, r->m->part[d].name) == 0) one->part = d;
    if (!part || one->part != SIZE_MAX) return APSM_OK;
    return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: '%s': the model has no part '%s'", r->path,
                     one->name, part);
}

/* What is given must be of its type and mean something for the kind. */
static apsm_status check_types(const reading *r, const json_t *row, const measurement *one)
{
    const json_t *part = json_object_get(row, "part"), *whole = json_object_get(row, "whole"),
                 *radius = json_object_get(row, "radius");
    const bool fits = one->kind == MEASURE_SPHERE || one->kind == MEASURE_CYLINDER;
    const char *wrong = part && !json_is_string(part)                  ? "part"
                        : whole && !json_is_boolean(whole)             ? "whole"
                        : whole && one->kind != MEASURE_SECTION        ? "whole"
                        : radius && (!json_is_number(radius) || !fits) ? "radius"
                                                                       : NULL;
    if (!wrong) return APSM_OK;
    return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                     "%s: '%s': \"%s\" is of the wrong type or means nothing for kind %s", r->path,
                     one->name, wrong, kinds[one->kind].word);
}

static apsm_status take_measurement(const reading *r, const json_t *row, measurement *one)
{
    const char *name = json_string_value(json_object_get(row, "name"));
    const char *kind = json_string_value(json_object_get(row, "kind"));
    const json_t *radius = json_object_get(row, "radius");
    if (!name || !*name || !kind)
        return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                         "%s: every measurement needs a \"name\" and a \"kind\"", r->path);
    for (size_t k = 0; k + 1 < r->list->n; k++)
        if (strcmp(r->list->of[k].name, name) == 0)
            return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: two measurements are named '%s'",
                             r->path, name);
    one->name = strdup(name);
    if (!one->name) return APSM_ERR_MEMORY;
    APSM_TRY(check_keys(r, row, name));
    APSM_TRY(take_kind(r, kind, one));
    APSM_TRY(check_types(r, row, one));
    one->radius = json_number_value(radius);
    one->whole = json_is_true(json_object_get(row, "whole"));
    if ((radius && !(one->radius > 0 && isfinite(one->radius))) ||
        (one->kind == MEASURE_CYLINDER && !radius))
        return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                         "%s: '%s': give a \"radius\" > 0 around the points, which says what is "
                         "fitted to",
                         r->path, name);
    APSM_TRY(take_part(r, json_string_value(json_object_get(row, "part")), one));
    return take_points(r, json_object_get(row, "points"), one);
}

apsm_status measurement_list_read(apsm_context *ctx, const char *path, const model_folder *m,
                                  measurement_list *list)
{
    json_t *root = NULL;
    *list = (measurement_list){ 0 };
    APSM_TRY(apsm_json_read(ctx, path, &root));
    const reading r = { ctx, path, m, list };
    const json_t *rows = json_object_get(root, "measurements");
    const size_t n = json_array_size(rows);
    apsm_status status = APSM_OK;
    if (n == 0)
        status = apsm_fail(ctx, APSM_ERR_FORMAT,
                           "%s: has no \"measurements\"; docs/statistics.md shows some", path);
    else if (!(list->of = calloc(n, sizeof *list->of)))
        status = APSM_ERR_MEMORY;
    while (status == APSM_OK && list->n < n) {
        list->n++;
        status = take_measurement(&r, json_array_get(rows, list->n - 1), &list->of[list->n - 1]);
    }
    json_decref(root);
    if (status != APSM_OK) measurement_list_free(list);
    return status;
}

/* ---- values ---- */

static double angle_between(const double a[3], const double b[3])
{
    double x[3];
    vec3_cross(a, b, x);
    return degrees * atan2(vec3_norm(x), vec3_dot(a, b));
}

/* Three points: at the second one.  Four: between the lines 0-1 and 2-3. */
static double angle(size_t n, const double *p)
{
    double a[3], b[3];
    vec3_sub(p + (n == 3 ? 0 : 3), p + (n == 3 ? 3 : 0), a);
    vec3_sub(p + (n == 3 ? 6 : 9), p + (n == 3 ? 3 : 6), b);
    return angle_between(a, b);
}

static double plane_distance(size_t n, const double *p)
{
    double centre[3], normal[3], y[3];
    if (primitive_plane(n - 1, p + 3, centre, normal) != APSM_OK) return NAN;
    vec3_sub(p, centre, y);
    return fabs(vec3_dot(y, normal));
}

/* The region's vertices and their normals, or the points, into work. */
static size_t gather(const measurement *one, const apsm_mesh *mesh, const double *VN,
                     const double *p, double *work)
{
    if (one->radius == 0) {
        memcpy(work, p, 3 * one->points * sizeof *work);
        return one->points;
    }
    for (size_t k = 0; k < one->vertices; k++) {
        memcpy(work + 3 * k, mesh->V + 3 * (size_t)one->vertex[k], 3 * sizeof *work);
        memcpy(work + 3 * (one->vertices + k), VN + 3 * (size_t)one->vertex[k], 3 * sizeof *work);
    }
    return one->vertices;
}

static double diameter(const measurement *one, const apsm_mesh *mesh, const double *VN,
                       const double *p, double *work)
{
    double at[3], axis[3], radius = NAN, residual;
    const size_t n = gather(one, mesh, VN, p, work);
    const apsm_status status =
        one->kind == MEASURE_SPHERE
            ? primitive_sphere(n, work, at, &radius, &residual)
            : primitive_cylinder(n, work, work + 3 * n, at, axis, &radius, &residual);
    return status == APSM_OK ? 2 * radius : NAN;
}

/* The curve whose nearest segment is nearest to the points' centre. */
static size_t nearest_loop(size_t n, const double *segment, const size_t *loop,
                           const double centre[3])
{
    size_t best = 0;
    double least = INFINITY;
    for (size_t k = 0; k < n; k++) {
        const double d = vec3_distance2(segment + 6 * k, centre);
        if (d < least) least = d, best = loop[k];
    }
    return best;
}

static apsm_status section(const measurement *one, const apsm_mesh *mesh, const double *p,
                           const size_t faces[2], double *area)
{
    double centre[3], normal[3];
    if (primitive_plane(one->points, p, centre, normal) != APSM_OK) return APSM_OK;
    const size_t n = primitive_cut(mesh, faces[0], faces[1], centre, normal, NULL);
    double *segment = malloc((6 * n + 1) * sizeof *segment);
    size_t *loop = malloc((n + 1) * sizeof *loop);
    if (segment && loop && n > 0) {
        primitive_cut(mesh, faces[0], faces[1], centre, normal, segment);
        primitive_loops(n, segment, loop);
        const size_t which = one->whole ? SIZE_MAX : nearest_loop(n, segment, loop, centre);
        *area = fabs(primitive_enclosed(n, segment, loop, which, normal));
    }
    const apsm_status status = segment && loop ? APSM_OK : APSM_ERR_MEMORY;
    free(segment);
    free(loop);
    return status;
}

/* From the surface straight inward to the other side. */
static apsm_status thickness(const measurement *one, const apsm_mesh *mesh, const double *VN,
                             double *through)
{
    double x[3], n[3], back[3];
    apsm_bvh *bvh = NULL;
    APSM_TRY(apsm_bvh_build_unsigned(mesh, &bvh));
    apsm_surface_position(mesh, &one->on, x);
    apsm_surface_normal(mesh, VN, &one->on, n);
    for (int c = 0; c < 3; c++) back[c] = -n[c];
    const double t = apsm_bvh_ray(bvh, x, back, 1e-3 * apsm_mesh_mean_edge(mesh), INFINITY, NULL);
    apsm_bvh_free(bvh);
    if (isfinite(t)) *through = t;
    return APSM_OK;
}

/* Of the faces first .. end - 1. */
static double extent(measure_kind kind, const apsm_mesh *mesh, size_t first, size_t end)
{
    const apsm_mesh some = { mesh->nv, end - first, mesh->V, mesh->F + 3 * first };
    return kind == MEASURE_AREA ? apsm_mesh_area(&some) : apsm_mesh_volume(&some);
}

apsm_status measurement_value(const measurement *one, const carried_shape *s, double *value)
{
    const double *p = s->point + 3 * one->first_point;
    const bool all = one->part == SIZE_MAX;
    const size_t faces[2] = { all ? 0 : s->first_face[one->part],
                              s->first_face[all ? s->parts : one->part + 1] };
    *value = NAN;
    switch (one->kind) {
    case MEASURE_DISTANCE:
        *value = sqrt(vec3_distance2(p, p + 3));
        break;
    case MEASURE_ANGLE:
        *value = angle(one->points, p);
        break;
    case MEASURE_PLANE_DISTANCE:
        *value = plane_distance(one->points, p);
        break;
    case MEASURE_SPHERE:
    case MEASURE_CYLINDER:
        *value = diameter(one, &s->mesh, s->VN, p, s->work);
        break;
    case MEASURE_SECTION:
        return section(one, &s->mesh, p, faces, value);
    case MEASURE_THICKNESS:
        return thickness(one, &s->mesh, s->VN, value);
    case MEASURE_AREA:
    case MEASURE_VOLUME:
        *value = extent(one->kind, &s->mesh, faces[0], faces[1]);
        break;
    case MEASURE_KIND_COUNT:
        break;
    }
    return APSM_OK;
}
