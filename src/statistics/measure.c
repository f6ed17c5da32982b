/* `apsm measure`: a definition, evaluated on all shapes, the mean, its modes, and given particles.
 * The template's mesh and the points are carried by the warp of docs/method.md, section 9: points
 * of a part by that part's particles. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/statistics.h"
#include "core/sized.h"
#include "files/files.h"
#include "folder/model_folder.h"
#include "geometry/bvh.h"
#include "model/warp.h"
#include "statistics/measurement.h"
#include "statistics/particle_files.h"
#include "statistics/results.h"
#include "statistics/table.h"

enum { MEASUREMENTS_VERSION = 1, MODES_MOST = 10 };
static const double deviations = 2;

/* A row of the results: a shape, the mean, a mode, or a file. */
typedef struct measured {
    char *name;
    const double *P; /* J x 3, world frame; borrowed */
} measured;

#define FORMAT_MEASUREMENTS "apsm-measurements"
enum { FILES = 4 };
static const char *const file_names[FILES] = { "measurements.json", "measurements.csv",
                                               "measurements_model.csv", "measurements_files.csv" };

typedef struct measuring {
    apsm_context *ctx;
    const apsm_measure_settings *s;
    model_folder m;
    apsm_table table;
    measurement_list list;
    apsm_mesh mesh;                    /* the template's, of all parts */
    size_t *first_vertex, *first_face; /* parts + 1 */
    size_t *part_of;                   /* of every point */
    apsm_warp *warp;                   /* of a part's vertices, then its points */
    particle_files more;               /* particles of the files */
    double *modes;                     /* of the mean and modes: rows x J x 3 */
    size_t shapes, mean_and_modes, files, rows;
    measured *row;
    double *value; /* rows x list.n */
} measuring;

/* ---- the template ---- */

static apsm_status add_part(measuring *w, size_t d)
{
    apsm_mesh part = { 0 };
    APSM_TRY(model_folder_part_mesh(w->ctx, &w->m, w->m.part[d].template_index, d, &part));
    const apsm_status status = apsm_mesh_append(&w->mesh, &part);
    w->first_vertex[d + 1] = w->mesh.nv;
    w->first_face[d + 1] = w->mesh.nf;
    apsm_mesh_free(&part);
    return status;
}

static size_t part_of_face(const measuring *w, uint32_t face)
{
    size_t d = 0;
    while (face >= w->first_face[d + 1]) d++;
    return d;
}

/* Whose surface every point is nearest to. */
static void place_points(measuring *w, const apsm_bvh *bvh)
{
    for (size_t k = 0; k < w->list.n; k++) {
        measurement *one = &w->list.of[k];
        for (size_t i = 0; i < one->points; i++) {
            apsm_closest at;
            const size_t p = one->first_point + i;
            apsm_bvh_closest(bvh, w->list.point + 3 * p, INFINITY, &at);
            w->part_of[p] = part_of_face(w, at.on.face);
            one->on = at.on;
        }
    }
}

/* Vertices of the template that lie in a measurement's region. */
static apsm_status choose_region(const measuring *w, measurement *one)
{
    if (one->radius == 0) return APSM_OK;
    one->vertex = malloc((w->mesh.nv + 1) * sizeof *one->vertex);
    if (!one->vertex) return APSM_ERR_MEMORY;
    const bool all = one->part == SIZE_MAX;
    for (size_t v = all ? 0 : w->first_vertex[one->part];
         v < w->first_vertex[all ? w->m.parts : one->part + 1]; v++) {
        bool inside = false;
        for (size_t i = 0; i < one->points && !inside; i++) {
            const double *p = w->list.point + 3 * (one->first_point + i), *x = w->mesh.V + 3 * v;
            inside = hypot(hypot(x[0] - p[0], x[1] - p[1]), x[2] - p[2]) <= one->radius;
        }
        if (inside) one->vertex[one->vertices++] = (uint32_t)v;
    }
    if (one->vertices >= 12) return APSM_OK;
    return apsm_fail(w->ctx, APSM_ERR_ARG,
                     "%s: '%s': only %zu vertices of the template lie within %g of the points; "
                     "points are in the world frame of the model (particles/..._world.particles)",
                     w->s->definition, one->name, one->vertices, one->radius);
}

/* One warp carries a part's vertices and the points that lie at it. */
static apsm_status build_warp(measuring *w, size_t d)
{
    const model_part *part = &w->m.part[d];
    const size_t nv = w->first_vertex[d + 1] - w->first_vertex[d];
    size_t n = nv;
    double *X = malloc((3 * (nv + w->list.points) + 1) * sizeof *X);
    if (!X) return APSM_ERR_MEMORY;
    memcpy(X, w->mesh.V + 3 * w->first_vertex[d], 3 * nv * sizeof *X);
    for (size_t p = 0; p < w->list.points; p++)
        if (w->part_of[p] == d) memcpy(X + 3 * n++, w->list.point + 3 * p, 3 * sizeof *X);
    const double *P = w->m.P + 3 * (part->template_index * w->m.J + part->first);
    const apsm_status status = apsm_warp_build(w->ctx, APSM_PHI_R, n, X, part->J, P, &w->warp[d]);
    free(X);
    return status;
}

static apsm_status prepare(measuring *w)
{
    const size_t parts = w->m.parts;
    w->first_vertex = calloc(parts + 1, sizeof *w->first_vertex);
    w->first_face = calloc(parts + 1, sizeof *w->first_face);
    w->part_of = calloc(w->list.points + 1, sizeof *w->part_of);
    w->warp = calloc(parts + 1, sizeof *w->warp);
    if (!w->first_vertex || !w->first_face || !w->part_of || !w->warp) return APSM_ERR_MEMORY;
    for (size_t d = 0; d < parts; d++) APSM_TRY(add_part(w, d));
    apsm_bvh *bvh = NULL;
    APSM_TRY(apsm_bvh_build_unsigned(&w->mesh, &bvh));
    place_points(w, bvh);
    apsm_bvh_free(bvh);
    for (size_t k = 0; k < w->list.n; k++) APSM_TRY(choose_region(w, &w->list.of[k]));
    for (size_t d = 0; d < parts; d++) APSM_TRY(build_warp(w, d));
    return APSM_OK;
}

/* ---- what is measured ---- */

/* The mean, and two standard deviations along each of the first modes. */
static apsm_status add_modes(measuring *w)
{
    const apsm_shape_model *model = &w->m.model;
    const size_t modes = model->modes < MODES_MOST ? model->modes : MODES_MOST, n = 3 * w->m.J;
    w->mean_and_modes = 1 + 2 * modes;
    w->modes = malloc((w->mean_and_modes * n + 1) * sizeof *w->modes);
    if (!w->modes) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < w->mean_and_modes; k++) {
        const size_t mode = k == 0 ? 0 : (k - 1) / 2;
        const double b =
            k == 0 ? 0 : (k % 2 ? -deviations : deviations) * sqrt(model->variance[mode]);
        for (size_t x = 0; x < n; x++)
            w->modes[k * n + x] = model->mean[x] + (k ? b * model->mode[mode * n + x] : 0);
    }
    return APSM_OK;
}

static char *mode_name(size_t k)
{
    char name[64];
    snprintf(name, sizeof name, "mode %zu %s 2 sd", (k + 1) / 2, k % 2 ? "-" : "+");
    return strdup(k == 0 ? "mean" : name);
}

static apsm_status list_rows(measuring *w)
{
    const size_t n = 3 * w->m.J;
    w->shapes = w->m.I;
    w->files = w->more.n;
    w->rows = w->shapes + w->mean_and_modes + w->files;
    w->row = calloc(w->rows + 1, sizeof *w->row);
    w->value = malloc((w->rows * w->list.n + 1) * sizeof *w->value);
    if (!w->row || !w->value) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < w->rows; i++) {
        const size_t k = i - w->shapes, f = k - w->mean_and_modes;
        measured *r = &w->row[i];
        if (i < w->shapes)
            *r = (measured){ strdup(w->m.names[i]), w->m.P + i * n };
        else if (k < w->mean_and_modes)
            *r = (measured){ mode_name(k), w->modes + k * n };
        else
            *r = (measured){ strdup(w->more.name[f]), w->more.P + f * n };
        if (!r->name) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

/* ---- evaluation ---- */

static void carried_free(carried_shape *c)
{
    apsm_mesh_free(&c->mesh);
    free(c->VN);
    free(c->point);
    free(c->work);
}

static apsm_status carry(const measuring *w, const double *P, carried_shape *c)
{
    const size_t nv = w->mesh.nv, points = w->list.points;
    *c = (carried_shape){ .parts = w->m.parts, .first_face = w->first_face };
    APSM_TRY(apsm_mesh_copy(&w->mesh, &c->mesh));
    c->VN = malloc((3 * nv + 1) * sizeof *c->VN);
    c->point = malloc((3 * points + 1) * sizeof *c->point);
    c->work = malloc((6 * nv + 3 * points + 1) * sizeof *c->work);
    if (!c->VN || !c->point || !c->work) return APSM_ERR_MEMORY;
    for (size_t d = 0; d < w->m.parts; d++) {
        const size_t n = w->first_vertex[d + 1] - w->first_vertex[d];
        const double *carried_point = c->work + 3 * n;
        apsm_warp_apply(&w->warp[d], P + 3 * w->m.part[d].first, c->work);
        memcpy(c->mesh.V + 3 * w->first_vertex[d], c->work, 3 * n * sizeof *c->work);
        for (size_t p = 0; p < points; p++) {
            if (w->part_of[p] != d) continue;
            memcpy(c->point + 3 * p, carried_point, 3 * sizeof *c->point);
            carried_point += 3;
        }
    }
    apsm_mesh_vertex_normals(&c->mesh, c->VN);
    return APSM_OK;
}

static apsm_status measure_row(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    const measuring *w = user;
    carried_shape c;
    apsm_status status = carry(w, w->row[i].P, &c);
    for (size_t k = 0; k < w->list.n && status == APSM_OK; k++)
        status = measurement_value(&w->list.of[k], &c, &w->value[i * w->list.n + k]);
    carried_free(&c);
    return status;
}

static apsm_status measure_all(measuring *w)
{
    APSM_TRY(apsm_parallel_for(w->ctx, w->rows, measure_row, w, "measure"));
    for (size_t k = 0; k < w->list.n; k++) {
        size_t undefined = 0;
        for (size_t i = 0; i < w->rows; i++) undefined += isnan(w->value[i * w->list.n + k]) != 0;
        if (undefined > 0)
            apsm_log(w->ctx, APSM_LOG_WARNING,
                     "'%s' is not defined on %zu of %zu shapes (nothing is cut, hit or fits there)",
                     w->list.of[k].name, undefined, w->rows);
    }
    return APSM_OK;
}

/* ---- results ---- */

/* Mean distance of shape i's reconstruction from its surface: how far a point may be off. */
static double surface_distance(const measuring *w, size_t i)
{
    const json_t *all = json_object_get(w->m.evaluation, "surface_distance");
    const json_t *one = json_array_get(json_object_get(all, "per_shape"), i);
    const json_t *mean = json_object_get(one, "mean");
    return json_is_number(mean) ? json_number_value(mean) : NAN;
}

static void write_cell(apsm_writer *csv, double x)
{
    apsm_writer_printf(csv, ",");
    if (isfinite(x)) apsm_writer_number(csv, x);
}

static bool is_measured_anew(const measuring *w, const char *name)
{
    bool anew = strcmp(name, "surface_distance") == 0;
    for (size_t k = 0; k < w->list.n; k++) anew = anew || strcmp(w->list.of[k].name, name) == 0;
    return anew;
}

/* What is known of shape i beside its measurements, or the names of that. */
static void write_known(const measuring *w, apsm_writer *csv, bool head, size_t i)
{
    if (head)
        apsm_writer_printf(csv, ",surface_distance");
    else
        write_cell(csv, surface_distance(w, i));
    for (size_t k = 0; k < w->table.n; k++) {
        const apsm_column *c = &w->table.column[k];
        if (is_measured_anew(w, c->name)) continue;
        apsm_writer_printf(csv, ",");
        if (head)
            apsm_writer_csv(csv, c->name);
        else
            apsm_column_write(csv, c, i);
    }
}

static void write_rows(const measuring *w, apsm_writer *csv, size_t first, size_t end)
{
    const size_t files = w->shapes + w->mean_and_modes;
    apsm_writer_printf(csv, "name");
    for (size_t k = 0; k < w->list.n; k++) {
        apsm_writer_printf(csv, ",");
        apsm_writer_csv(csv, w->list.of[k].name);
    }
    if (first == 0) write_known(w, csv, true, 0);
    apsm_writer_printf(csv, first == files ? ",note\n" : "\n");
    for (size_t i = first; i < end; i++) {
        apsm_writer_csv(csv, w->row[i].name);
        for (size_t k = 0; k < w->list.n; k++) write_cell(csv, w->value[i * w->list.n + k]);
        if (first == 0) write_known(w, csv, false, i);
        if (first == files) {
            apsm_writer_printf(csv, ",");
            apsm_writer_csv(csv, particle_files_note_text(&w->more, i - files));
        }
        apsm_writer_printf(csv, "\n");
    }
}

static json_t *json_definitions(const measuring *w)
{
    static const char *const units[] = { "degrees", "length", "length^2", "length^3" };
    json_t *list = json_array();
    for (size_t k = 0; k < w->list.n; k++) {
        const measurement *one = &w->list.of[k];
        json_array_append_new(
            list,
            json_pack("{s:s, s:s, s:s, s:o, s:f, s:I}", "name", one->name, "kind",
                      measure_word(one->kind), "unit", units[measure_power(one->kind)], "points",
                      apsm_json_matrix(one->points, 3, w->list.point + 3 * one->first_point),
                      "radius", one->radius, "vertices", (json_int_t)one->vertices));
    }
    return list;
}

static json_t *json_rows(const measuring *w, size_t first, size_t end)
{
    const size_t files = w->shapes + w->mean_and_modes;
    json_t *list = json_array();
    for (size_t i = first; i < end; i++) {
        json_t *values = json_array();
        for (size_t k = 0; k < w->list.n; k++)
            json_array_append_new(values, apsm_json_number_or_null(w->value[i * w->list.n + k]));
        json_t *row = json_pack("{s:s, s:o}", "name", w->row[i].name, "values", values);
        if (i < w->shapes)
            json_object_set_new(row, "surface_distance",
                                apsm_json_number_or_null(surface_distance(w, i)));
        if (i >= files)
            json_object_update_new(row, json_pack("{s:O?}", "note", w->more.note[i - files]));
        json_array_append_new(list, row);
    }
    return list;
}

static json_t *json_result(const measuring *w)
{
    const size_t model = w->shapes, files = model + w->mean_and_modes;
    return json_pack("{s:s, s:i, s:o, s:o, s:o, s:o}", "format", FORMAT_MEASUREMENTS, "version",
                     MEASUREMENTS_VERSION, "measurements", json_definitions(w), "shapes",
                     json_rows(w, 0, model), "model", json_rows(w, model, files), "files",
                     json_rows(w, files, w->rows));
}

static apsm_status write_csv(const measuring *w, const char *path, size_t first, size_t end)
{
    apsm_writer *csv = NULL;
    APSM_TRY(apsm_writer_open(w->ctx, path, &csv));
    write_rows(w, csv, first, end);
    return apsm_writer_commit(csv);
}

static apsm_status write_one(const measuring *w, const char *folder, size_t k)
{
    const size_t ends[] = { 0, w->shapes, w->shapes + w->mean_and_modes, w->rows };
    char *path = apsm_path_join(folder, file_names[k]);
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    if (k == 0) {
        json_t *root = json_result(w);
        status = apsm_json_write(w->ctx, path, root);
        json_decref(root);
    } else
        status = write_csv(w, path, ends[k - 1], ends[k]);
    if (status == APSM_OK) apsm_log(w->ctx, APSM_LOG_INFO, "written: %s", path);
    free(path);
    return status;
}

static apsm_status write_results(const measuring *w)
{
    char *folder = results_folder(w->s->folder, w->s->out);
    apsm_status status = folder ? apsm_make_folder(w->ctx, folder) : APSM_ERR_MEMORY;
    for (size_t k = 0; k < (w->files > 0 ? 4 : 3) && status == APSM_OK; k++)
        status = write_one(w, folder, k);
    free(folder);
    return status;
}

static void tell(const measuring *w)
{
    for (size_t k = 0; k < w->list.n; k++) {
        double sum = 0, squares = 0, n = 0;
        for (size_t i = 0; i < w->shapes; i++) {
            const double x = w->value[i * w->list.n + k];
            if (isfinite(x)) sum += x, n++;
        }
        for (size_t i = 0; i < w->shapes; i++) {
            const double x = w->value[i * w->list.n + k] - sum / n;
            if (isfinite(x)) squares += x * x;
        }
        apsm_log(w->ctx, APSM_LOG_INFO, "%s: %.4g +- %.3g over %.0f shapes, %.4g on the mean",
                 w->list.of[k].name, sum / n, n > 1 ? sqrt(squares / (n - 1)) : 0, n,
                 w->value[w->shapes * w->list.n + k]);
    }
}

/* ---- all ---- */

static apsm_status claim_files(const measuring *w)
{
    char *folder = results_folder(w->s->folder, w->s->out);
    const apsm_status status = folder
                                   ? results_claim(w->ctx, folder, file_names[0],
                                                   FORMAT_MEASUREMENTS, FILES - 1, file_names + 1)
                                   : APSM_ERR_MEMORY;
    free(folder);
    return status;
}

static apsm_status read_all(measuring *w)
{
    const apsm_measure_settings *s = w->s;
    if (!s->folder || !s->definition)
        return apsm_fail(w->ctx, APSM_ERR_ARG, "measure: no model folder or no definition");
    const unsigned parts = FOLDER_PARTICLES | FOLDER_EVALUATED | FOLDER_CERTIFIED;
    APSM_TRY(claim_files(w));
    APSM_TRY(model_folder_read(w->ctx, s->folder, parts | (s->n_files > 0 ? FOLDER_MANIFESTED : 0u),
                               &w->m));
    APSM_TRY(
        apsm_table_gather(w->ctx, s->folder, s->subjects, &w->m.project, w->m.names, &w->table));
    APSM_TRY(measurement_list_read(w->ctx, s->definition, &w->m, &w->list));
    return particle_files_read(w->ctx, s->n_files, s->files, &w->m, &w->more);
}

static void measuring_free(measuring *w)
{
    for (size_t i = 0; w->row && i < w->rows; i++) free(w->row[i].name);
    for (size_t d = 0; w->warp && d < w->m.parts; d++) apsm_warp_free(&w->warp[d]);
    free(w->row);
    free(w->value);
    free(w->modes);
    free(w->first_vertex);
    free(w->first_face);
    free(w->part_of);
    free(w->warp);
    apsm_mesh_free(&w->mesh);
    particle_files_free(&w->more);
    measurement_list_free(&w->list);
    apsm_table_free(&w->table);
    model_folder_free(&w->m);
}

static apsm_status measure(apsm_context *ctx, const apsm_measure_settings *settings)
{
    measuring w = { .ctx = ctx, .s = settings };
    apsm_status status = read_all(&w);
    if (status == APSM_OK) status = prepare(&w);
    if (status == APSM_OK) status = add_modes(&w);
    if (status == APSM_OK) status = list_rows(&w);
    if (status == APSM_OK) status = measure_all(&w);
    if (status == APSM_OK) status = write_results(&w);
    if (status == APSM_OK) tell(&w);
    measuring_free(&w);
    return status;
}

APSM_BY_SIZE(apsm_statistics_measure, apsm_measure_settings, measure)
