/* The files of a joint model.  Everything is written under names that joint.json lists; it comes
 * last, and a folder without it, or with other files, is not replaced (assemble.c). */
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "apsm/report.h"
#include "assemble/job.h"
#include "files/constraints_file.h"
#include "files/files.h"
#include "files/particles_file.h"
#include "files/project.h"
#include "files/project_columns.h"
#include "folder/evaluation_json.h"
#include "folder/mode_trust_json.h"
#include "folder/model_json.h"
#include "folder/names.h"
#include "geometry/affine.h"

typedef struct writing {
    const joint_job *job;
    const joint_cohort *c;
    const joint_figures *f;
    json_t *files; /* names written, to be listed with their SHA-256 */
} writing;

/* MODEL_DIR/name, noted as ours; malloc'ed. */
static char *path_of(writing *w, const char *format, ...) APSM_PRINTF(2, 3);
static char *path_of(writing *w, const char *format, ...)
{
    char name[1024];
    va_list args;
    va_start(args, format);
    const int length = vsnprintf(name, sizeof name, format, args);
    va_end(args);
    if (length < 0 || length >= (int)sizeof name) return NULL;
    if (json_array_append_new(w->files, json_string(name)) != 0) return NULL;
    return apsm_path_join(w->job->settings->run.folder, name);
}

static apsm_status write_json(writing *w, const char *name, json_t *root)
{
    char *path = path_of(w, "%s", name);
    const apsm_status status = path ? apsm_json_write(w->job->ctx, path, root) : APSM_ERR_MEMORY;
    json_decref(root);
    free(path);
    return status;
}

static const char *subject_name(const writing *w, size_t i)
{
    return w->job->subject[i].name;
}

static const char *part_name(const writing *w, size_t d)
{
    return w->job->part[d].name;
}

static size_t particles_of(const writing *w, size_t d)
{
    return w->c->first[d + 1] - w->c->first[d];
}

/* ---- particles and project ---- */

static apsm_status write_particles(writing *w, size_t i, size_t d, const char *frame,
                                   const double *x, char **stored)
{
    char *path =
        path_of(w, "particles/%s_%s_%s.particles", subject_name(w, i), part_name(w, d), frame);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_particles_write(w->job->ctx, path, particles_of(w, d), x);
    *stored = status == APSM_OK ? apsm_path_relative(w->job->settings->run.folder, path) : NULL;
    free(path);
    return status == APSM_OK && !*stored ? APSM_ERR_MEMORY : status;
}

static apsm_status set_column(apsm_subject *s, const char *prefix, const char *part,
                              const char *value)
{
    char key[128];
    snprintf(key, sizeof key, "%s_%s", prefix, part);
    return apsm_subject_set_column(s, key, value);
}

static apsm_status set_matrix(apsm_subject *s, const char *prefix, const char *part,
                              const double M[16])
{
    char text[16 * APSM_NUMBER_LENGTH];
    apsm_transform_text(M, text);
    return set_column(s, prefix, part, text);
}

/* Local particles of part d are those on its groomed mesh. */
static apsm_status part_particles(writing *w, size_t i, size_t d, double *x, char *stored[2])
{
    double back[16];
    const size_t at = 3 * (i * w->c->J + w->c->first[d]);
    APSM_TRY(apsm_affine_invert(w->c->place + 16 * (i * w->c->n + d), back));
    apsm_affine_apply(back, particles_of(w, d), w->c->P + at, x);
    APSM_TRY(write_particles(w, i, d, "local", x, &stored[0]));
    return write_particles(w, i, d, "world", w->c->Q + at, &stored[1]);
}

/* shape and groomed, as seen from this folder. */
static apsm_status part_paths(const writing *w, size_t i, size_t d, char *relative[2])
{
    const apsm_project *p = &w->c->folder[d].project;
    const apsm_subject *of = &p->subjects[w->c->row[i * w->c->n + d]];
    const char *const stored[] = { of->shape, of->groomed };
    for (int k = 0; k < 2; k++) {
        char *path = apsm_project_path(p, stored[k]);
        relative[k] = path ? apsm_path_relative(w->job->settings->run.folder, path) : NULL;
        free(path);
        if (!relative[k]) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

/* The first part is the project's domain, whose columns the struct holds. */
static apsm_status set_first(apsm_subject *s, const double M[16], char *const text[4])
{
    s->has_alignment = s->has_procrustes = true;
    memcpy(s->alignment, M, 16 * sizeof *M);
    APSM_TRY(apsm_text_set(&s->shape, text[0]));
    APSM_TRY(apsm_text_set(&s->groomed, text[1]));
    APSM_TRY(apsm_text_set(&s->local_particles, text[2]));
    return apsm_text_set(&s->world_particles, text[3]);
}

static apsm_status set_other(apsm_subject *s, const char *part, const double M[16],
                             char *const text[4])
{
    static const char *const prefix[] = { "shape", "groomed", "local_particles",
                                          "world_particles" };
    double identity[16];
    apsm_affine_identity(identity);
    for (int k = 0; k < 4; k++) APSM_TRY(set_column(s, prefix[k], part, text[k]));
    APSM_TRY(set_matrix(s, "alignment", part, M));
    return set_matrix(s, "procrustes", part, identity);
}

/* alignment_PART takes the groomed mesh to the world, as in a project of one part. */
static apsm_status describe_part(writing *w, size_t i, size_t d, double *x, apsm_subject *s)
{
    const size_t k = 16 * (i * w->c->n + d);
    char *text[4] = { NULL, NULL, NULL, NULL };
    double M[16];
    apsm_affine_multiply(w->c->align + k, w->c->place + k, M);
    apsm_status status = part_paths(w, i, d, text);
    if (status == APSM_OK) status = part_particles(w, i, d, x, text + 2);
    if (status == APSM_OK)
        status = d == 0 ? set_first(s, M, text) : set_other(s, part_name(w, d), M, text);
    for (int m = 0; m < 4; m++) free(text[m]);
    return status;
}

static apsm_status describe_subject(writing *w, size_t i, double *x, apsm_project *project)
{
    apsm_subject *s;
    APSM_TRY(apsm_project_add(project, subject_name(w, i), NULL, &s));
    s->mirrored = w->c->mirrored[i];
    for (size_t d = 0; d < w->c->n; d++) APSM_TRY(describe_part(w, i, d, x, s));
    if (w->job->alignment == APSM_JOINT_APART) return APSM_OK;
    return set_matrix(s, "alignment", "global", w->c->align + 16 * i * w->c->n);
}

/* What a run makes, of whatever part. */
static bool is_made(const char *key)
{
    static const char *const prefixes[] = { "shape_",           "segmentation_", "mesh_",
                                            "contour_",         "groomed_",      "local_particles_",
                                            "world_particles_", "alignment_",    "procrustes_" };
    for (size_t k = 0; k < sizeof prefixes / sizeof *prefixes; k++)
        if (strncmp(key, prefixes[k], strlen(prefixes[k])) == 0) return true;
    return strcmp(key, "mirrored") == 0 || strcmp(key, "reflection") == 0 ||
           strcmp(key, "name") == 0;
}

/* Constraints that stood in a column are files of ours. */
static apsm_status store_constraints(const writing *w, const apsm_project *project, size_t i)
{
    static const char key_begins[] = "constraints_", ours[] = "constraints/";
    const char *key;
    json_t *value;
    APSM_TRY(apsm_constraints_store(w->job->ctx, project, &project->subjects[i]));
    json_object_foreach(project->subjects[i].row, key, value)
    {
        const char *text = json_string_value(value);
        if (text && strncmp(key, key_begins, strlen(key_begins)) == 0 &&
            strncmp(text, ours, strlen(ours)) == 0 && json_array_append(w->files, value) != 0)
            return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

static apsm_status keep_row(const apsm_project *source, apsm_subject *s)
{
    const size_t i = apsm_project_find(source, s->name);
    const char *key;
    json_t *value;
    if (i == source->n) return APSM_OK;
    json_object_foreach(source->subjects[i].row, key, value)
    {
        if (!is_made(key) && json_object_set(s->row, key, value) != 0) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

/* What the project that was given says beside the shapes is kept: columns, groups, excluded rows.
 */
static apsm_status keep_source(const writing *w, apsm_project *project)
{
    apsm_project source = { 0 };
    const apsm_run_settings *s = &w->job->settings->run;
    if (!w->job->by_project) return APSM_OK;
    apsm_status status = apsm_project_read(w->job->ctx, s->inputs[0], &source);
    if (status == APSM_OK) status = apsm_project_rebase(&source, s->folder);
    for (size_t i = 0; i < project->n && status == APSM_OK; i++)
        status = keep_row(&source, &project->subjects[i]);
    for (size_t i = 0; i < project->n && status == APSM_OK; i++)
        status = store_constraints(w, project, i);
    if (status == APSM_OK) {
        json_object_del(source.root, "apsm");
        if (json_object_update_missing(project->root, source.root) != 0) status = APSM_ERR_MEMORY;
        json_decref(project->aside);
        project->aside = json_incref(source.aside);
    }
    apsm_project_free(&source);
    return status;
}

static apsm_status write_project(writing *w)
{
    apsm_project project = { 0 };
    char *path = path_of(w, "%s", FOLDER_PROJECT);
    double *x = malloc(w->c->J * 3 * sizeof *x);
    apsm_status status =
        path && x ? apsm_project_init(w->job->ctx, w->job->settings->run.folder, &project)
                  : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_text_set(&project.domain, part_name(w, 0));
    for (size_t i = 0; i < w->c->I && status == APSM_OK; i++)
        status = describe_subject(w, i, x, &project);
    if (status == APSM_OK) status = keep_source(w, &project);
    if (status == APSM_OK) status = apsm_project_write(w->job->ctx, path, &project);
    apsm_project_free(&project);
    free(x);
    free(path);
    return status;
}

/* ---- models ---- */

static json_t *json_parts(const writing *w)
{
    json_t *parts = json_array();
    for (size_t d = 0; d < w->c->n; d++)
        json_array_append_new(parts, json_pack("{s:s, s:I, s:I, s:s}", "name", part_name(w, d),
                                               "first", (json_int_t)w->c->first[d], "particles",
                                               (json_int_t)particles_of(w, d), "template",
                                               subject_name(w, w->f->like[d])));
    return parts;
}

static json_t *json_rows(size_t n, size_t width, const double *x)
{
    json_t *rows = json_array();
    for (size_t k = 0; k < n; k++)
        json_array_append_new(rows, apsm_json_matrix(width / 3, 3, x + k * width));
    if (json_array_size(rows) == n) return rows;
    json_decref(rows);
    return NULL;
}

static json_t *json_model(const apsm_shape_model *m)
{
    return json_pack("{s:o, s:o, s:o}", "variances", apsm_json_vector(m->modes, m->variance),
                     "mean", apsm_json_matrix(m->J, 3, m->mean), "modes",
                     json_rows(m->modes, 3 * m->J, m->mode));
}

static apsm_status write_model(writing *w)
{
    const apsm_shape_model *m = &w->f->model;
    json_t *root = json_pack("{s:s, s:i, s:I, s:I, s:o}", "format", FORMAT_MODEL, "version",
                             MODEL_VERSION, "shapes", (json_int_t)m->I, "particles",
                             (json_int_t)m->J, "parts", json_parts(w));
    json_t *model = json_model(m);
    if (!root || !model || json_object_update(root, model) != 0) {
        json_decref(root);
        root = NULL;
    }
    json_decref(model);
    return write_json(w, FOLDER_MODEL, root);
}

static json_t *json_poses_of_part(const writing *w, size_t d)
{
    const apsm_pose_shape *ps = &w->f->poses;
    return json_pack("{s:s, s:o, s:o}", "name", part_name(w, d), "mean_pose",
                     apsm_json_matrix(4, 4, ps->mean_pose + 16 * d), "moments",
                     apsm_json_matrix(3, 3, ps->gyration + 9 * d));
}

static apsm_status write_pose_shape(writing *w)
{
    const apsm_pose_shape *ps = &w->f->poses;
    json_t *parts = json_array();
    for (size_t d = 0; d < w->c->n; d++) json_array_append_new(parts, json_poses_of_part(w, d));
    json_t *root =
        json_pack("{s:s, s:i, s:o, s:f, s:o, s:o, s:o}", "format", "apsm-pose-shape", "version", 1,
                  "parts", parts, "not_explained", ps->leak, "pose", json_model(&ps->poses),
                  "shape", json_model(&ps->shapes), "both", json_model(&ps->both));
    return write_json(w, FOLDER_POSE_SHAPE, root);
}

/* ---- tables ---- */

static apsm_status open_csv(writing *w, const char *name, apsm_writer **csv)
{
    char *path = path_of(w, "%s", name);
    const apsm_status status = path ? apsm_writer_open(w->job->ctx, path, csv) : APSM_ERR_MEMORY;
    free(path);
    return status;
}

static void cell(apsm_writer *csv, double x)
{
    apsm_writer_printf(csv, ",");
    if (isfinite(x)) apsm_writer_number(csv, x);
}

static apsm_status write_scores(writing *w, const char *name, const char *column,
                                const apsm_shape_model *m)
{
    char *path = path_of(w, "%s", name);
    const char **names = malloc((m->I + 1) * sizeof *names);
    for (size_t i = 0; names && i < m->I; i++) names[i] = subject_name(w, i);
    const apsm_status status =
        path && names ? scores_csv_write(w->job->ctx, path, names, column, m) : APSM_ERR_MEMORY;
    free(names);
    free(path);
    return status;
}

/* Rotations in degrees about the axes of the part's mean frame, translations in the input's unit.
 */
static apsm_status write_poses(writing *w)
{
    static const char *const axis[] = { "rx", "ry", "rz", "tx", "ty", "tz" };
    const double degrees = 180 / acos(-1);
    apsm_writer *csv = NULL;
    APSM_TRY(open_csv(w, "poses.csv", &csv));
    apsm_writer_printf(csv, "name");
    for (size_t d = 0; d < w->c->n; d++)
        for (size_t k = 0; k < 6; k++) apsm_writer_printf(csv, ",%s_%s", part_name(w, d), axis[k]);
    for (size_t i = 0; i < w->c->I; i++) {
        apsm_writer_printf(csv, "\n");
        apsm_writer_csv(csv, subject_name(w, i));
        for (size_t k = 0; k < 6 * w->c->n; k++)
            cell(csv, w->f->poses.pose[6 * i * w->c->n + k] * (k % 6 < 3 ? degrees : 1));
    }
    apsm_writer_printf(csv, "\n");
    return apsm_writer_commit(csv);
}

static void contact_row(apsm_writer *csv, const apsm_contact *own, const apsm_contact *rebuilt)
{
    const apsm_contact none = { NAN, NAN, NAN };
    if (!own) own = &none;
    const double cells[] = { own->gap,     own->depth,     own->overlap,
                             rebuilt->gap, rebuilt->depth, rebuilt->overlap };
    for (size_t k = 0; k < sizeof cells / sizeof *cells; k++) cell(csv, cells[k]);
    apsm_writer_printf(csv, "\n");
}

static apsm_status write_contacts(writing *w)
{
    const size_t n = w->c->n, pairs = w->f->pairs;
    apsm_writer *csv = NULL;
    APSM_TRY(open_csv(w, "contacts.csv", &csv));
    apsm_writer_printf(csv, "name,part,other,gap,depth,overlap,rebuilt_gap,rebuilt_depth,"
                            "rebuilt_overlap\n");
    for (size_t i = 0; i <= w->c->I + 2 * w->f->modes; i++) { /* the mean and modes come last */
        size_t pair = 0;
        for (size_t a = 0; a < n; a++)
            for (size_t b = a + 1; b < n; b++, pair++) {
                const joint_contact *k = i < w->c->I ? &w->f->contact[i * pairs + pair] : NULL;
                const size_t made = k ? 0 : i - w->c->I;
                if (k)
                    apsm_writer_csv(csv, subject_name(w, i));
                else if (made == 0)
                    apsm_writer_printf(csv, "mean of the cohort");
                else
                    apsm_writer_printf(csv, "mode %zu %c2sd", (made + 1) / 2, made % 2 ? '-' : '+');
                apsm_writer_printf(csv, ",%s,%s", part_name(w, a), part_name(w, b));
                contact_row(csv, k ? &k->own : NULL,
                            k ? &k->rebuilt : &w->f->mean[made * pairs + pair]);
            }
    }
    return apsm_writer_commit(csv);
}

/* ---- evaluation.json ---- */

/* Of a part, or of all: the template is left out, since it is its own reconstruction. */
typedef struct average {
    size_t n;
    double mean, worst, max;
} average;

static void add_distance(average *a, const apsm_distance_summary *d)
{
    a->n++;
    a->mean += d->mean;
    a->worst += d->max;
    a->max = fmax(a->max, d->max);
}

static json_t *json_average(const average *a)
{
    const double n = a->n > 0 ? (double)a->n : 1;
    return json_pack("{s:f, s:f, s:f}", "mean", a->mean / n, "max", a->max, "mean_max",
                     a->worst / n);
}

static json_t *json_surface_of_part(const writing *w, size_t d)
{
    average a = { 0 };
    json_t *shapes = json_array();
    for (size_t i = 0; i < w->c->I; i++) {
        const apsm_distance_summary *s = &w->f->surface[i * w->c->n + d].two_way;
        if (i != w->f->like[d]) add_distance(&a, s);
        json_array_append_new(shapes, json_pack("{s:s, s:f, s:f, s:f}", "name", subject_name(w, i),
                                                "mean", s->mean, "p95", s->p95, "max", s->max));
    }
    json_t *part = json_average(&a);
    json_object_set_new(part, "name", json_string(part_name(w, d)));
    json_object_set_new(part, "template", json_string(subject_name(w, w->f->like[d])));
    json_object_set_new(part, "per_shape", shapes);
    return part;
}

static void worse(apsm_distance_summary *sum, const apsm_distance_summary *d, double share)
{
    sum->mean += share * d->mean;
    sum->median += share * d->median;
    sum->p95 = fmax(sum->p95, d->p95);
    sum->p99 = fmax(sum->p99, d->p99);
    sum->max = fmax(sum->max, d->max);
}

/* Of a subject: means are those of its parts, quantiles and maxima those of the worst part. */
static apsm_surface_distance distance_of_subject(const writing *w, size_t i)
{
    const size_t n = w->c->n;
    apsm_surface_distance all = { 0 };
    for (size_t d = 0; d < n; d++) {
        const apsm_surface_distance *s = &w->f->surface[i * n + d];
        worse(&all.two_way, &s->two_way, 1 / (double)n);
        worse(&all.pull, &s->pull, 1 / (double)n);
        worse(&all.push, &s->push, 1 / (double)n);
        worse(&all.disagreement, &s->disagreement, 1 / (double)n);
        all.diagonal = fmax(all.diagonal, s->diagonal);
    }
    return all;
}

static json_t *json_surface(const writing *w)
{
    average a = { 0 };
    json_t *shapes = json_array(), *parts = json_array();
    for (size_t i = 0; i < w->c->I; i++) {
        const apsm_surface_distance s = distance_of_subject(w, i);
        for (size_t d = 0; d < w->c->n; d++)
            if (i != w->f->like[d]) add_distance(&a, &w->f->surface[i * w->c->n + d].two_way);
        json_array_append_new(shapes,
                              json_pack("{s:s, s:f, s:f, s:f, s:f, s:f, s:f, s:o, s:o, s:o}",
                                        "name", subject_name(w, i), "mean", s.two_way.mean,
                                        "median", s.two_way.median, "p95", s.two_way.p95, "p99",
                                        s.two_way.p99, "max", s.two_way.max, "diagonal", s.diagonal,
                                        "pull", evaluation_json_distance(&s.pull), "push",
                                        evaluation_json_distance(&s.push), "disagreement",
                                        evaluation_json_distance(&s.disagreement)));
    }
    for (size_t d = 0; d < w->c->n; d++) json_array_append_new(parts, json_surface_of_part(w, d));
    json_t *surface = json_average(&a);
    json_object_set_new(surface, "parts", parts);
    json_object_set_new(surface, "per_shape", shapes);
    return surface;
}

/* How near the parts a and b of every subject come. */
static json_t *json_space(const writing *w, size_t a, size_t b, size_t pair)
{
    json_t *list = json_array();
    for (size_t i = 0; i < w->c->I; i++) {
        const joint_contact *k = &w->f->contact[i * w->f->pairs + pair];
        json_array_append_new(list,
                              json_pack("{s:s, s:f, s:f, s:f, s:f}", "name", subject_name(w, i),
                                        "gap", k->own.gap, "depth", k->own.depth, "rebuilt_gap",
                                        k->rebuilt.gap, "rebuilt_depth", k->rebuilt.depth));
    }
    return json_pack("{s:[s, s], s:o}", "parts", part_name(w, a), part_name(w, b), "per_shape",
                     list);
}

static json_t *json_spaces(const writing *w)
{
    json_t *spaces = json_array();
    size_t pair = 0;
    for (size_t a = 0; a < w->c->n; a++)
        for (size_t b = a + 1; b < w->c->n; b++)
            json_array_append_new(spaces, json_space(w, a, b, pair++));
    if (json_array_size(spaces) == pair) return spaces;
    json_decref(spaces);
    return NULL;
}

static apsm_status write_evaluation(writing *w)
{
    const apsm_evaluation *e = &w->f->evaluation;
    json_t *root = json_pack(
        "{s:s, s:i, s:I, s:I, s:s, s:s, s:I, s:I, s:s, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, "
        "s:o, s:o}",
        "format", FORMAT_EVALUATION, "version", EVALUATION_VERSION, "particles",
        (json_int_t)e->particles, "shapes", (json_int_t)e->shapes, "definition",
        apsm_definition_name(e->definition), "definition_text", apsm_definition_text(e->definition),
        "specificity_samples", (json_int_t)e->samples, "generalization_shapes",
        (json_int_t)e->left_out, "template", subject_name(w, w->f->like[0]), "surface_distance",
        json_surface(w), "landmarks", joint_landmarks(w->job, w->c), "joint_spaces", json_spaces(w),
        "variances", apsm_json_vector(e->modes, e->variance), "modes",
        mode_trust_json(e->modes, e->trust), "compactness",
        apsm_json_vector(e->n_compactness, e->compactness), "generalization",
        apsm_json_vector(e->n_generalization, e->generalization), "generalization_standard_error",
        apsm_json_vector(e->n_generalization, e->generalization_error), "specificity",
        apsm_json_vector(e->n_specificity, e->specificity), "specificity_standard_error",
        apsm_json_vector(e->n_specificity, e->specificity_error));
    return write_json(w, FOLDER_EVALUATION, root);
}

static apsm_status write_fields(writing *w)
{
    bool wrote;
    char *path = apsm_path_join(w->job->settings->run.folder, FOLDER_FEATURES);
    apsm_status status = path ? joint_write_fields(w->job, w->c, path, &wrote) : APSM_ERR_MEMORY;
    free(path);
    if (status == APSM_OK && wrote && json_array_append_new(w->files, json_string(FOLDER_FEATURES)))
        status = APSM_ERR_MEMORY;
    return status;
}

/* ---- certificate.json ---- */

static apsm_status write_certificate(writing *w)
{
    return write_json(w, FOLDER_CERTIFICATE, joint_certificate(w->job, w->c, w->f));
}

/* ---- meshes/ ---- */

static apsm_status write_warped(writing *w, size_t d, const double *x, const double *M, char *path)
{
    apsm_mesh mesh = { 0 };
    if (!path) return APSM_ERR_MEMORY;
    apsm_status status = apsm_mesh_copy(&w->f->mesh[d], &mesh);
    if (status == APSM_OK) {
        apsm_warp_apply(&w->f->warp[d], x + 3 * w->c->first[d], mesh.V);
        if (M) apsm_mesh_transform(&mesh, M);
        status = apsm_write_mesh(w->job->ctx, path, &mesh);
    }
    apsm_mesh_free(&mesh);
    free(path);
    return status;
}

/* In the frame of the groomed meshes, as for a single part. */
static apsm_status write_rebuilt(writing *w, size_t i)
{
    for (size_t d = 0; d < w->c->n; d++) {
        const size_t k = 16 * (i * w->c->n + d);
        double M[16];
        apsm_affine_multiply(w->c->align + k, w->c->place + k, M);
        APSM_TRY(apsm_affine_invert(M, M));
        APSM_TRY(write_warped(
            w, d, w->c->Q + 3 * i * w->c->J, M,
            path_of(w, "meshes/%s_%s_reconstructed.ply", subject_name(w, i), part_name(w, d))));
    }
    return APSM_OK;
}

static apsm_status write_shown(writing *w, const double *x, const char *label)
{
    for (size_t d = 0; d < w->c->n; d++)
        APSM_TRY(
            write_warped(w, d, x, NULL, path_of(w, "meshes/%s_%s.ply", label, part_name(w, d))));
    return APSM_OK;
}

/* Mode k of the poses (the shapes rest), or of the shapes (the poses rest), at sd deviations. */
static apsm_status write_mode(writing *w, bool of_poses, size_t k, double sd, double *x)
{
    const apsm_pose_shape *ps = &w->f->poses;
    const apsm_shape_model *m = of_poses ? &ps->poses : &ps->shapes;
    const apsm_parts parts = joint_parts(w->c);
    double *s = malloc(ps->J * 3 * sizeof *s), *xi = calloc(6 * ps->n, sizeof *xi);
    char label[64];
    apsm_status status = s && xi ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        const double b = sd * sqrt(m->variance[k]), *mode = m->mode + k * m->J * 3;
        memcpy(s, ps->shapes.mean, ps->J * 3 * sizeof *s);
        if (of_poses)
            status = apsm_pose_shape_pose(ps, &parts, b, mode, xi);
        else
            for (size_t a = 0; a < 3 * ps->J; a++) s[a] += b * mode[a];
    }
    if (status == APSM_OK) {
        apsm_pose_shape_compose(ps, &parts, xi, s, x);
        snprintf(label, sizeof label, "%s_mode_%02zu_%s2sd", of_poses ? "pose" : "shape", k + 1,
                 sd < 0 ? "minus" : "plus");
        status = write_shown(w, x, label);
    }
    free(s);
    free(xi);
    return status;
}

static apsm_status write_modes(writing *w)
{
    enum { SHOWN = 3 };
    double *x = malloc(w->c->J * 3 * sizeof *x);
    if (!x) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    for (int of_poses = 0; of_poses < 2; of_poses++) {
        const size_t modes = of_poses ? w->f->poses.poses.modes : w->f->poses.shapes.modes;
        for (size_t k = 0; k < modes && k < SHOWN && status == APSM_OK; k++) {
            status = write_mode(w, of_poses, k, -2, x);
            if (status == APSM_OK) status = write_mode(w, of_poses, k, 2, x);
        }
    }
    free(x);
    return status;
}

static apsm_status write_meshes(writing *w)
{
    APSM_TRY(write_shown(w, w->f->model.mean, "mean"));
    APSM_TRY(write_modes(w));
    for (size_t i = 0; i < w->c->I; i++) APSM_TRY(write_rebuilt(w, i));
    return APSM_OK;
}

/* ---- manifest.json ---- */

static apsm_status make_folders(const writing *w)
{
    static const char *const names[] = { "particles", "meshes" };
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        char *path = apsm_path_join(w->job->settings->run.folder, names[k]);
        const apsm_status status = path ? apsm_make_folder(w->job->ctx, path) : APSM_ERR_MEMORY;
        free(path);
        APSM_TRY(status);
    }
    return APSM_OK;
}

static json_t *json_incomplete(const writing *w)
{
    json_t *names = json_array();
    for (size_t i = w->job->complete; i < w->job->subjects; i++)
        json_array_append_new(names, json_string(subject_name(w, i)));
    return names;
}

/* Files that were written: their stage, bytes and SHA-256, as in the manifest of a single part. */
static apsm_status list_file(const writing *w, const char *name, json_t *list)
{
    char hex[65], *path = apsm_path_join(w->job->settings->run.folder, name);
    long long bytes = 0;
    apsm_status status = path ? apsm_sha256_file(w->job->ctx, path, hex) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_file_size(w->job->ctx, path, &bytes);
    free(path);
    APSM_TRY(status);
    json_t *entry = json_pack("[s, I, s]", "joint", (json_int_t)bytes, hex);
    return json_object_set_new(list, name, entry) == 0 ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status list_files(const writing *w, json_t *list)
{
    size_t k;
    const json_t *name;
    json_array_foreach(w->files, k, name) APSM_TRY(list_file(w, json_string_value(name), list));
    return APSM_OK;
}

static json_t *json_options(const writing *w)
{
    const apsm_run_settings *s = &w->job->settings->run;
    const char *align = w->job->settings->align;
    const char *parts = w->job->settings->parts;
    json_t *options = json_pack("{s:s, s:s}", "parts", parts ? parts : "domains", "align_parts",
                                align ? align : "global");
    for (size_t k = 0; k < s->n_set; k++)
        json_object_set_new(options, s->set[k][0], json_string(s->set[k][1]));
    return options;
}

/* Their SHA-256 are in the manifests of the parts. */
static json_t *json_inputs(const writing *w)
{
    json_t *inputs = json_array();
    for (size_t k = 0; k < w->job->list.n; k++) {
        const apsm_input_case *c = &w->job->list.cases[k];
        long long bytes = 0;
        if (apsm_is_folder(c->path) || apsm_file_size(NULL, c->path, &bytes) != APSM_OK) bytes = 0;
        json_array_append_new(inputs, json_pack("{s:s, s:s, s:I}", "name", c->name, "path", c->path,
                                                "bytes", (json_int_t)bytes));
    }
    return inputs;
}

static apsm_status write_manifest(writing *w)
{
    json_t *files = json_object();
    char *path = apsm_path_join(w->job->settings->run.folder, FOLDER_MANIFEST);
    apsm_status status = path && files ? list_files(w, files) : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        json_t *root =
            json_pack("{s:s, s:i, s:s, s:o, s:o, s:{}, s:{s:o, s:o}, s:O}", "format",
                      FORMAT_MANIFEST, "version", MANIFEST_VERSION, "apsm", APSM_VERSION, "options",
                      json_options(w), "inputs", json_inputs(w), "stages", "joint", "parts",
                      json_parts(w), "left_out", json_incomplete(w), "outputs", files);
        status = apsm_json_write_sealed(w->job->ctx, path, root);
        json_decref(root);
    }
    json_decref(files);
    free(path);
    return status;
}

/* The report reads the manifest, which then lists the report too. */
static apsm_status write_report(writing *w)
{
    APSM_TRY(write_manifest(w));
    APSM_TRY(apsm_report_write(w->job->ctx, w->job->settings->run.folder));
    if (json_array_append_new(w->files, json_string(FOLDER_REPORT)) != 0) return APSM_ERR_MEMORY;
    return write_manifest(w);
}

static apsm_status write_all(writing *w)
{
    APSM_TRY(make_folders(w));
    APSM_TRY(write_project(w));
    APSM_TRY(write_model(w));
    APSM_TRY(write_pose_shape(w));
    APSM_TRY(write_scores(w, FOLDER_SCORES_CSV, "mode", &w->f->model));
    APSM_TRY(write_scores(w, "pose_scores.csv", "pose_mode", &w->f->poses.poses));
    APSM_TRY(write_scores(w, "shape_scores.csv", "shape_mode", &w->f->poses.shapes));
    APSM_TRY(write_poses(w));
    APSM_TRY(write_contacts(w));
    APSM_TRY(write_evaluation(w));
    APSM_TRY(write_fields(w));
    APSM_TRY(write_certificate(w));
    APSM_TRY(write_meshes(w));
    return write_report(w);
}

apsm_status joint_write(const joint_job *job, const joint_cohort *cohort,
                        const joint_figures *figures)
{
    writing w = { job, cohort, figures, json_array() };
    const apsm_status status = w.files ? write_all(&w) : APSM_ERR_MEMORY;
    json_decref(w.files);
    return status;
}
