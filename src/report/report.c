/* What the page gets: one JSON object, in which arrays are given by their place among the packed
 * bytes.  All of it is compressed and base64, so that no name of a shape can break out of it; the
 * viewer puts texts into the page as text only. */
#include "apsm/report.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "folder/features_csv.h"
#include "folder/manifest_json.h"
#include "folder/model_folder.h"
#include "folder/names.h"
#include "report/answers.h"
#include "report/colours.h"
#include "report/display.h"
#include "report/pack.h"
#include "report/page.h"
#include "report/selection.h"

enum { DATA_VERSION = 1 };

/* Steps in which numbers are told: a shape's length in 16,384, far below what a screen resolves. */
static const double position_levels = 16383, mode_levels = 8191;

typedef struct composing {
    const model_folder *m;
    const display *d;
    size_t all; /* shapes of the cohort, of which m has those that are shown */
    pack bytes;
    double lo[3], step; /* positions: lo + step * integer of 16 bits */
    double largest_distance;
    double mode_step; /* displacements, counted from -8192 */
} composing;

/* ---- quantisation ---- */

static void widen(double lo[3], double hi[3], size_t n, const double *x)
{
    for (size_t k = 0; k < 3 * n; k++) {
        if (x[k] < lo[k % 3]) lo[k % 3] = x[k];
        if (x[k] > hi[k % 3]) hi[k % 3] = x[k];
    }
}

static double largest(double so_far, size_t n, const double *x)
{
    for (size_t k = 0; k < n; k++)
        if (fabs(x[k]) > so_far) so_far = fabs(x[k]);
    return so_far;
}

static double step_of(double range, double levels)
{
    return range > 0 ? range / levels : 1;
}

static void choose_steps(composing *c)
{
    const model_folder *m = c->m;
    const display *d = c->d;
    const size_t nv = d->template_mesh.nv;
    double hi[3] = { -INFINITY, -INFINITY, -INFINITY }, distance = 0;
    for (int k = 0; k < 3; k++) c->lo[k] = INFINITY;
    if (d->joint.n > 0) {
        widen(c->lo, hi, nv, d->joint.surface);
        widen(c->lo, hi, m->J, d->joint.particles);
    }
    widen(c->lo, hi, m->I * m->J, m->P);
    widen(c->lo, hi, m->J, m->model.mean);
    widen(c->lo, hi, nv, d->mean);
    for (size_t i = 0; i < d->I; i++) {
        const display_shape *s = &d->shape[i];
        widen(c->lo, hi, s->mesh.nv, s->mesh.V);
        widen(c->lo, hi, nv, s->warped);
        distance = largest(distance, s->mesh.nv, s->distance);
        distance = largest(distance, nv, s->warped_distance);
    }
    c->step =
        step_of(fmax(hi[0] - c->lo[0], fmax(hi[1] - c->lo[1], hi[2] - c->lo[2])), position_levels);
    c->largest_distance = step_of(distance, 1);
    double mode = largest(0, d->modes * nv * 3, d->mode);
    for (size_t k = 0; d->joint.n > 0 && k < d->joint.shapes; k++) {
        mode = largest(mode, nv * 3, d->joint.mode + k * nv * 3);
        mode = largest(mode, m->J * 3, d->joint.mode_particles + k * m->J * 3);
    }
    for (size_t k = 0; k < d->modes; k++)
        mode = fmax(mode, sqrt(m->model.variance[k])); /* bounds the particles' displacements */
    c->mode_step = step_of(mode, mode_levels);
}

/* ---- arrays ---- */

static json_t *positions(composing *c, size_t n, const double *x)
{
    return pack_points(&c->bytes, n, c->lo, c->step, NULL, x);
}

/* As differences to the warped mean, which are smooth. */
static json_t *warped_positions(composing *c, const double *x)
{
    return pack_points(&c->bytes, c->d->template_mesh.nv, c->lo, c->step, c->d->mean, x);
}

static json_t *distances(composing *c, size_t n, const double *x)
{
    return pack_distances(&c->bytes, n, c->largest_distance, x);
}

static json_t *displacements(composing *c, size_t n, const double *x)
{
    const double zero = -(mode_levels + 1) * c->mode_step, lo[3] = { zero, zero, zero };
    return pack_points(&c->bytes, n, lo, c->mode_step, NULL, x);
}

static json_t *faces(composing *c, const apsm_mesh *mesh)
{
    return pack_integers(&c->bytes, 3 * mesh->nf, 3, mesh->nv > 65535 ? 4 : 2, mesh->F);
}

/* ---- the object ---- */

/* Of the modes shown. */
static json_t *json_scores(const composing *c, size_t i)
{
    const model_folder *m = c->m;
    json_t *row = json_array();
    for (size_t k = 0; k < c->d->modes; k++) {
        double b = 0;
        for (size_t x = 0; x < 3 * m->J; x++)
            b += (m->P[i * m->J * 3 + x] - m->model.mean[x]) * m->model.mode[k * m->J * 3 + x];
        json_array_append_new(row, json_real(b));
    }
    return row;
}

/* Scores of the modes that are not shown by themselves, in standard deviations: the page makes such
 * a mode from the shapes.  Steps of 8 / 32,768. */
static json_t *json_more_scores(composing *c)
{
    const apsm_shape_model *m = &c->m->model;
    const size_t first = c->d->modes, more = m->modes - first, n = m->I * more;
    uint32_t *code = malloc((n + 1) * sizeof *code);
    if (!code) return NULL;
    for (size_t k = 0; k < n; k++) {
        const size_t i = k / more, l = first + k % more;
        double b = 0;
        for (size_t x = 0; x < 3 * m->J; x++)
            b += (c->m->P[i * m->J * 3 + x] - m->mean[x]) * m->mode[l * m->J * 3 + x];
        b = fmin(fmax(b / sqrt(m->variance[l]), -7.9), 7.9);
        code[k] = (uint32_t)(b * 4096 + 32768.5);
    }
    json_t *scores = pack_integers(&c->bytes, n, more ? more : 1, 2, code);
    free(code);
    return scores;
}

static json_t *json_sizes(size_t n, const size_t *x)
{
    json_t *list = json_array();
    for (size_t k = 0; k < n; k++) json_array_append_new(list, json_integer((json_int_t)x[k]));
    return list;
}

static json_t *json_shape(composing *c, size_t i)
{
    const model_folder *m = c->m;
    const display_shape *s = &c->d->shape[i];
    const apsm_subject *subject = &m->project.subjects[i];
    const size_t nv = c->d->template_mesh.nv;
    json_t *shape = json_pack(
        "{s:s, s:b, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "name", subject->name, "mirrored",
        subject->mirrored, "scores", json_scores(c, i), "particles",
        positions(c, m->J, m->P + i * m->J * 3), "vertices", positions(c, s->mesh.nv, s->mesh.V),
        "faces", faces(c, &s->mesh), "distance", distances(c, s->mesh.nv, s->distance), "warped",
        warped_positions(c, s->warped), "warped_distance", distances(c, nv, s->warped_distance));
    if (shape && s->rest > 0) json_object_set_new(shape, "rest", json_integer((json_int_t)s->rest));
    if (shape && m->parts > 1)
        json_object_set_new(shape, "parts", json_sizes(m->parts + 1, s->first_vertex));
    return shape;
}

static json_t *json_modes(composing *c)
{
    const model_folder *m = c->m;
    const display *d = c->d;
    const size_t nv = d->template_mesh.nv, J3 = 3 * m->J;
    double *p = malloc(J3 * sizeof *p);
    json_t *modes = p ? json_array() : NULL;
    for (size_t k = 0; modes && k < d->modes; k++) {
        for (size_t x = 0; x < J3; x++)
            p[x] = sqrt(m->model.variance[k]) * m->model.mode[k * J3 + x];
        json_array_append_new(modes, json_pack("{s:o, s:o}", "vertices",
                                               displacements(c, nv, d->mode + k * nv * 3),
                                               "particles", displacements(c, m->J, p)));
    }
    free(p);
    return modes;
}

static json_t *json_mean(composing *c)
{
    const apsm_mesh *mesh = &c->d->template_mesh;
    return json_pack("{s:o, s:o, s:o, s:o}", "vertices", positions(c, mesh->nv, c->d->mean),
                     "faces", faces(c, mesh), "particles", positions(c, c->m->J, c->m->model.mean),
                     "modes", json_modes(c));
}

/* ---- joints ---- */

static json_t *json_shape_modes(composing *c)
{
    const joint_view *v = &c->d->joint;
    const size_t J = c->m->J, nv = c->d->template_mesh.nv;
    json_t *modes = json_array();
    for (size_t k = 0; k < v->shapes; k++)
        json_array_append_new(
            modes, json_pack("{s:o, s:o}", "vertices", displacements(c, nv, v->mode + 3 * nv * k),
                             "particles", displacements(c, J, v->mode_particles + 3 * J * k)));
    return modes;
}

/* Pose and shape apart: where the parts are at the mean, how modes of pose move each, and how modes
 * of shape change them there. */
static json_t *json_apart(composing *c)
{
    const joint_view *v = &c->d->joint;
    json_t *motions = json_array();
    for (size_t k = 0; k < v->poses; k++)
        json_array_append_new(motions, apsm_json_matrix(v->n, 6, v->motion + 6 * v->n * k));
    return json_pack("{s:f, s:O, s:O, s:o, s:o, s:o, s:o, s:o}", "not_explained", v->not_explained,
                     "pose_variances", v->pose_variances, "shape_variances", v->shape_variances,
                     "vertices", positions(c, c->d->template_mesh.nv, v->surface), "particles",
                     positions(c, c->m->J, v->particles), "frames",
                     apsm_json_matrix(v->n, 16, v->frame), "motions", motions, "modes",
                     json_shape_modes(c));
}

/* What was sampled at the particles: a field's values of all shapes in steps of 1 / 65,535 of their
 * range. */
static json_t *json_field(composing *c, const sampled_fields *f, size_t s)
{
    const size_t n = f->I * f->J;
    double lo = INFINITY, hi = -INFINITY;
    for (size_t k = 0; k < n; k++) lo = fmin(lo, f->value[k * f->S + s]);
    for (size_t k = 0; k < n; k++) hi = fmax(hi, f->value[k * f->S + s]);
    const double step = step_of(hi - lo, 65535);
    uint32_t *code = malloc((n + 1) * sizeof *code);
    if (!code) return NULL;
    for (size_t k = 0; k < n; k++)
        code[k] = (uint32_t)fmin(65535, (f->value[k * f->S + s] - lo) / step + 0.5);
    json_t *field = json_pack("{s:s, s:f, s:f, s:o}", "name", f->name[s], "lo", lo, "step", step,
                              "values", pack_integers(&c->bytes, n, 1, 2, code));
    free(code);
    return field;
}

static apsm_status add_fields(apsm_context *ctx, composing *c, json_t *root)
{
    sampled_fields f = { 0 };
    char *path = model_folder_path(c->m, FOLDER_FEATURES);
    json_t *list = json_array();
    apsm_status status = path && list ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK && apsm_file_exists(path))
        status = features_csv_read(ctx, path, c->m->I, c->m->names, c->m->J, &f);
    for (size_t s = 0; s < f.S; s++) json_array_append_new(list, json_field(c, &f, s));
    if (json_array_size(list) < f.S || json_object_set(root, "fields", list) != 0)
        status = status == APSM_OK ? APSM_ERR_MEMORY : status;
    sampled_fields_free(&f);
    json_decref(list);
    free(path);
    return status;
}

/* The parts, with where their vertices and particles begin; null for one part. */
static json_t *json_joint(composing *c)
{
    const model_folder *m = c->m;
    if (m->parts < 2) return json_null();
    json_t *parts = json_array();
    for (size_t d = 0; d < m->parts; d++)
        json_array_append_new(parts, json_pack("{s:s, s:I}", "name", m->part[d].name, "particles",
                                               (json_int_t)m->part[d].first));
    return json_pack("{s:o, s:o, s:o}", "parts", parts, "vertices",
                     json_sizes(m->parts + 1, c->d->first_vertex), "apart",
                     c->d->joint.n > 0 ? json_apart(c) : json_null());
}

static json_t *json_shapes(composing *c)
{
    json_t *shapes = json_array();
    for (size_t i = 0; i < c->m->I; i++) json_array_append_new(shapes, json_shape(c, i));
    return shapes;
}

/* The manifest with names of files instead of paths: who gets the page need not know our disks. */
static json_t *json_manifest(const json_t *manifest)
{
    size_t i;
    json_t *input, *copy = json_deep_copy(manifest);
    json_object_del(copy, "outputs"); /* not for readers, and the page is one of them itself */
    json_object_del(copy, "sha256");
    json_object_del(copy, "begun"); /* whoever writes the page, it is the same */
    json_array_foreach(json_object_get(copy, "inputs"), i, input)
    {
        const char *path = json_string_value(json_object_get(input, "path"));
        if (path) json_object_set_new(input, "path", json_string(apsm_path_last(path)));
    }
    return copy;
}

/* Of the particles, numbers of the viewer's list; the same as in pictures (render.h). */
static json_t *json_colours(composing *c)
{
    const size_t J = c->m->J;
    uint32_t *chosen = malloc((J + 1) * sizeof *chosen);
    if (!chosen) return NULL;
    colours_choose(J, c->m->model.mean, chosen);
    json_t *colours = pack_integers(&c->bytes, J, 1, 1, chosen);
    free(chosen);
    return colours;
}

/* Where left, posterior and superior of the template's image point in the world frame, or null. */
static json_t *json_axes(const model_folder *m)
{
    double M[16], R[9];
    if (!manifest_is_of_images(m->manifest)) return json_null();
    model_folder_to_world(m, m->template_index, M);
    const double scale = sqrt(M[0] * M[0] + M[4] * M[4] + M[8] * M[8]);
    const double side = m->project.subjects[m->template_index].mirrored ? -1 : 1;
    for (size_t k = 0; k < 9; k++) /* row k / 3: the direction of axis k / 3 */
        R[k] = (k < 3 ? side : 1) * M[4 * (k % 3) + k / 3] / scale;
    return apsm_json_matrix(3, 3, R);
}

static json_t *compose(composing *c, const char *title)
{
    const model_folder *m = c->m;
    choose_steps(c);
    json_t *root = json_pack(
        "{s:s, s:i, s:s, s:I, s:I, s:[f, f, f], s:f, s:f, s:f, s:o, s:o, s:o, s:o, s:O, s:O, s:o}",
        "format", "apsm-report", "version", DATA_VERSION, "title", title, "particles",
        (json_int_t)m->J, "template", (json_int_t)m->template_index, "origin", c->lo[0], c->lo[1],
        c->lo[2], "step", c->step, "largest_distance", c->largest_distance, "mode_step",
        c->mode_step, "colours", json_colours(c), "variances",
        apsm_json_vector(m->model.modes, m->model.variance), "mean", json_mean(c), "shapes",
        json_shapes(c), "evaluation", m->evaluation, "certificate", m->certificate, "manifest",
        json_manifest(m->manifest));
    const char *unit = manifest_unit(m->manifest);
    const int failed = json_object_set_new(root, "more_scores", json_more_scores(c)) |
                       json_object_set_new(root, "unit", unit ? json_string(unit) : json_null()) |
                       json_object_set_new(root, "axes", json_axes(m)) |
                       json_object_set_new(root, "joint", json_joint(c));
    if (!failed) return root;
    json_decref(root);
    return NULL;
}

/* ---- the page ---- */

/* Says how many shapes are shown, if not all. */
static char *title_of(const composing *c)
{
    char *name = page_title(c->m->path);
    if (!name || c->all == c->m->I) return name;
    const size_t room = strlen(name) + 64;
    char *title = malloc(room);
    if (title) snprintf(title, room, "%s (%zu of %zu shapes)", name, c->m->I, c->all);
    free(name);
    return title;
}

static apsm_status write_file(apsm_context *ctx, composing *c, const char *path)
{
    char *title = title_of(c);
    if (!title) return APSM_ERR_MEMORY;
    json_t *root = compose(c, title), *answers = NULL;
    free(title);
    apsm_status status = answers_read(ctx, c->m, &answers);
    if (answers && json_object_set_new(root, "answers", answers) != 0) status = APSM_ERR_MEMORY;
    if (status == APSM_OK) status = add_fields(ctx, c, root);
    if (status == APSM_OK) status = page_write(ctx, path, root, &c->bytes);
    json_decref(root);
    return status;
}

enum { SHOWN_PARTS = FOLDER_PARTICLES | FOLDER_EVALUATED | FOLDER_CERTIFIED | FOLDER_MANIFESTED };

apsm_status apsm_report_write(apsm_context *ctx, const char *folder)
{
    model_folder m = { 0 };
    display d = { 0 };
    composing c = { .m = &m, .d = &d };
    if (!folder) return apsm_fail(ctx, APSM_ERR_ARG, "apsm_report_write: no folder");
    char *path = apsm_path_join(folder, FOLDER_REPORT);
    apsm_status status = path ? model_folder_read(ctx, folder, SHOWN_PARTS, &m) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = selection_make(REPORT_MOST_SHAPES, &m, &c.all);
    if (status == APSM_OK && c.all > m.I)
        apsm_log(ctx, APSM_LOG_INFO,
                 "the report shows %zu of %zu shapes: the template, those that need review or lie "
                 "farthest from their surface, the others evenly; figures are those of all",
                 m.I, c.all);
    if (status == APSM_OK) status = display_make(ctx, &m, &d);
    if (status == APSM_OK) status = write_file(ctx, &c, path);
    pack_free(&c.bytes);
    display_free(&d);
    model_folder_free(&m);
    free(path);
    return status;
}
