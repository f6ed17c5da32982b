/* `run` on contours: read, bring together, match, place particles, model, judge, write. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/contour.h"
#include "contour/contours.h"
#include "evaluate/metrics.h"
#include "files/files.h"
#include "files/particles_file.h"
#include "files/project.h"
#include "files/project_columns.h"
#include "folder/model_json.h"
#include "folder/names.h"
#include "formats/mesh_io.h"
#include "geometry/affine.h"
#include "input/input.h"
#include "options/options.h"
#include "run/source.h"

enum { N = CONTOUR_POINTS, MODES_MOST = 10, VERSION = 1 };

typedef struct contour_job {
    apsm_context *ctx;
    const char *folder;
    apsm_options o;
    const char *template_name, *exclude, *pattern, *ignore;
    bool by_project;
    size_t template_index;
    apsm_input_list list;
    size_t *n;  /* points of each */
    double **P; /* list.n */
    bool closed;
    contour_cohort c;
    const char **names;
    apsm_shape_model model;
    apsm_evaluation e;
    double *mean, *most; /* list.n: distance between the curve and what its particles stand for */
    apsm_project project;
} contour_job;

/* ---- what is asked for ---- */

static apsm_status take_setting(contour_job *j, const char *key, const char *value)
{
    static const char *const known[] = { "particles",  "adaptivity",          "align",
                                         "definition", "specificity_samples", "specificity_modes" };
    if (strcmp(key, "template") == 0) return j->template_name = value, APSM_OK;
    if (strcmp(key, "exclude") == 0) return j->exclude = value, APSM_OK;
    if (strcmp(key, "ignore") == 0) return j->ignore = value, APSM_OK;
    if (strcmp(key, "domain") == 0) return APSM_OK; /* list_project */
    if (strcmp(key, "pattern") == 0) return j->pattern = value, APSM_OK;
    if (strcmp(key, "seed") == 0)
        return apsm_context_set_seed(j->ctx, strtoull(value, NULL, 10)), APSM_OK;
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (strcmp(key, known[k]) == 0) return apsm_options_set(j->ctx, &j->o, key, value);
    return apsm_fail(j->ctx, APSM_ERR_UNSUPPORTED,
                     "%s: the inputs are contours, for which it has no meaning; leave it out", key);
}

static apsm_status take_settings(contour_job *j, const apsm_run_settings *s)
{
    for (size_t k = 0; k < s->n_set; k++) APSM_TRY(take_setting(j, s->set[k][0], s->set[k][1]));
    if (s->resume)
        return apsm_fail(j->ctx, APSM_ERR_UNSUPPORTED,
                         "contours: a job of seconds is not resumed; start it anew");
    if (j->o.optimize.search.particles_auto)
        return apsm_fail(j->ctx, APSM_ERR_UNSUPPORTED, "contours: give a number of particles");
    return APSM_OK;
}

static apsm_status list_inputs(apsm_context *ctx, const apsm_run_settings *s, const char *exclude,
                               const char *pattern, apsm_input_list *list)
{
    const apsm_input_choice choice = {
        .n = s->n_inputs, .inputs = s->inputs, .exclude = exclude, .pattern = pattern
    };
    return apsm_input_choose(ctx, &choice, list);
}

static const char *setting(const apsm_run_settings *s, const char *key)
{
    const char *value = NULL;
    for (size_t k = 0; k < s->n_set; k++)
        if (strcmp(s->set[k][0], key) == 0) value = s->set[k][1];
    return value;
}

/* The contour that the project names for a subject, or NULL; shape_1 may name one as well. */
static const char *contour_of(const apsm_project *p, size_t i)
{
    char key[APSM_KEY_LENGTH];
    const char *text = apsm_subject_column(&p->subjects[i], apsm_project_key(p, "contour_", key));
    return p->subjects[i].shape ? p->subjects[i].shape : text && *text ? text : NULL;
}

/* What a row asks for and is not done with contours is refused by name. */
static apsm_status refuse_rows(const contour_job *j, const char *path)
{
    const apsm_project *p = &j->project;
    for (size_t i = 0; i < p->n; i++) {
        char key[APSM_KEY_LENGTH];
        const apsm_subject *subject = &p->subjects[i];
        const char *cut = apsm_subject_column(subject, apsm_project_key(p, "constraints_", key));
        if (!contour_of(p, i))
            return apsm_fail(j->ctx, APSM_ERR_ARG,
                             "%s: %s has no contour where others have one; give it one, or mark it "
                             "as excluded",
                             path, subject->name);
        if (cut && *cut && !source_list_has(j->ignore, "constraints"))
            return apsm_fail(j->ctx, APSM_ERR_UNSUPPORTED,
                             "%s: %s has constraints, which contours are not cut by; cut the "
                             "contour, or keep the column unused with --ignore constraints",
                             path, subject->name);
        if (apsm_says_yes(apsm_subject_column(subject, "fixed")) &&
            !source_list_has(j->ignore, "fixed"))
            return apsm_fail(j->ctx, APSM_ERR_UNSUPPORTED,
                             "%s: %s is fixed, which no contour can be; --ignore fixed keeps the "
                             "column unused",
                             path, subject->name);
    }
    return APSM_OK;
}

/* The contours that a project names; it is kept, for the new one. */
static apsm_status list_project(contour_job *j, const apsm_run_settings *s)
{
    const char *domain = setting(s, "domain");
    apsm_project *p = &j->project;
    APSM_TRY(domain ? apsm_project_read_domain(j->ctx, s->inputs[0], domain, p)
                    : apsm_project_read(j->ctx, s->inputs[0], p));
    APSM_TRY(refuse_rows(j, s->inputs[0]));
    const char **names = calloc(p->n + 1, sizeof *names);
    char **paths = calloc(p->n + 1, sizeof *paths);
    apsm_status status = names && paths ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; i < p->n && status == APSM_OK; i++) {
        names[i] = p->subjects[i].name;
        paths[i] = apsm_project_path(p, contour_of(p, i));
        if (!paths[i]) status = APSM_ERR_MEMORY;
    }
    const apsm_input_choice choice = {
        .n = p->n, .inputs = (const char *const *)paths, .names = names, .exclude = j->exclude
    };
    if (status == APSM_OK) status = apsm_input_choose(j->ctx, &choice, &j->list);
    for (size_t i = 0; paths && i < p->n; i++) free(paths[i]);
    free(paths);
    free(names);
    return status;
}

/* The first file of this name, or of the folder. */
static apsm_status first_is_contour(apsm_context *ctx, const char *input, bool *is)
{
    apsm_file_list files = { 0 };
    *is = false;
    if (!apsm_is_folder(input)) return *is = contour_is_one(input), APSM_OK;
    APSM_TRY(apsm_list_files(ctx, input, false, &files));
    bool looked = false;
    for (size_t k = 0; k < files.n && !looked; k++) {
        const size_t length = strlen(files.path[k]);
        const char *end = files.path[k] + (length > 4 ? length - 4 : 0);
        looked = strcmp(end, ".vtk") == 0 || strcmp(end, ".vtp") == 0;
        char *path = looked ? apsm_path_join(input, files.path[k]) : NULL;
        *is = path && contour_is_one(path);
        free(path);
    }
    apsm_file_list_free(&files);
    return APSM_OK;
}

/* A project whose one domain, or the one that is asked for, has contours and no surfaces. */
static apsm_status project_is_of_contours(apsm_context *ctx, const apsm_run_settings *s, bool *is)
{
    apsm_project p = { 0 };
    const char *domain = setting(s, "domain");
    if (s->n_inputs > 1) return APSM_OK;
    APSM_TRY(domain ? apsm_project_read_domain(ctx, s->inputs[0], domain, &p)
                    : apsm_project_read(ctx, s->inputs[0], &p));
    char *path = p.n > 0 && (domain || apsm_project_domains(&p) < 2)
                     ? apsm_project_path(&p, contour_of(&p, 0))
                     : NULL;
    *is = path && (!p.subjects[0].shape || contour_is_one(path));
    free(path);
    apsm_project_free(&p);
    return APSM_OK;
}

apsm_status apsm_contours_wanted(apsm_context *ctx, const apsm_run_settings *s, bool *wanted)
{
    *wanted = false;
    if (s->n_inputs == 0) return APSM_OK;
    if (apsm_is_project_file(s->inputs[0])) return project_is_of_contours(ctx, s, wanted);
    return first_is_contour(ctx, s->inputs[0], wanted);
}

/* ---- reading ---- */

static apsm_status read_curves(contour_job *j)
{
    j->n = calloc(j->list.n + 1, sizeof *j->n);
    j->P = calloc(j->list.n + 1, sizeof *j->P);
    j->names = calloc(j->list.n + 1, sizeof *j->names);
    if (!j->n || !j->P || !j->names) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < j->list.n; i++) {
        bool closed;
        const apsm_input_case *c = &j->list.cases[i];
        j->names[i] = c->name;
        APSM_TRY(contour_read(j->ctx, c->path, &j->n[i], &j->P[i], &closed));
        if (i > 0 && closed != j->closed)
            return apsm_fail(j->ctx, APSM_ERR_ARG,
                             "%s: is %s where %s is %s; contours of a model are all closed or all "
                             "open",
                             c->path, closed ? "closed" : "open", j->list.cases[0].path,
                             j->closed ? "closed" : "open");
        j->closed = closed;
    }
    return APSM_OK;
}

static double length_of(const contour_job *j, size_t i)
{
    double Q[3 * N];
    return curve_resample(j->n[i], j->P[i], j->closed, N, Q);
}

/* The one that is named, or the one of median length. */
static apsm_status choose_template(const contour_job *j, size_t *t)
{
    const bool any = !j->template_name || strcmp(j->template_name, "auto") == 0;
    for (*t = 0; *t < j->list.n; ++*t) {
        size_t shorter = 0;
        if (!any && strcmp(j->names[*t], j->template_name) == 0) return APSM_OK;
        if (!any) continue;
        const double own = length_of(j, *t);
        for (size_t i = 0; i < j->list.n; i++) {
            const double other = length_of(j, i);
            shorter += other < own || (other == own && i < *t);
        }
        if (shorter == j->list.n / 2) return APSM_OK;
    }
    return apsm_fail(j->ctx, APSM_ERR_ARG, "template '%s' is none of the %zu contours",
                     any ? "auto" : j->template_name, j->list.n);
}

/* ---- what speaks against a curve ---- */

/* Another start or direction that lies within this factor is as likely; a rebuilt curve is off if
 * it leaves its own by this share of the particles' distance. */
static const double as_likely = 1.1, off = 0.5;
enum { LEAST_SHAPES = 3 };

static double spacing_of(const contour_job *j, size_t i)
{
    return length_of(j, i) / (double)j->c.J;
}

/* A new reference: reasons, empty if nothing speaks against it. */
static json_t *reasons_of(const contour_job *j, size_t i)
{
    json_t *list = json_array();
    const double rival = j->c.rival[i], cut = off * spacing_of(j, i);
    if (rival < as_likely)
        json_array_append_new(
            list, json_sprintf("ambiguous: another start or direction fits within %.0f %%",
                               fmax(0, 100 * (rival - 1))));
    if (j->most[i] > cut)
        json_array_append_new(list, json_string("the curve is not reproduced: more particles, or "
                                                "it has what the others have not"));
    if (j->c.I < LEAST_SHAPES)
        json_array_append_new(list, json_string("too few contours to be judged by each other"));
    return list;
}

static bool is_certified(const contour_job *j, size_t i)
{
    json_t *list = reasons_of(j, i);
    const bool none = list && json_array_size(list) == 0;
    json_decref(list);
    return none;
}

static size_t count_certified(const contour_job *j)
{
    size_t n = 0;
    for (size_t i = 0; i < j->c.I; i++) n += is_certified(j, i);
    return n;
}

/* ---- figures ---- */

static void measure(contour_job *j)
{
    double X[3 * N], a, b;
    for (size_t i = 0; i < j->c.I; i++) {
        const double *q = j->c.Q + 3 * i * N;
        contour_rebuild(&j->c, j->c.P + 3 * i * j->c.J, X);
        j->mean[i] = 0.5 * (curve_distance(N, X, N, q, j->closed, &a) +
                            curve_distance(N, q, N, X, j->closed, &b));
        j->most[i] = fmax(a, b);
    }
}

static apsm_status compute(contour_job *j)
{
    contour_options o = { .align = j->o.align.align,
                          .adaptivity = j->o.optimize.schedule.adaptivity,
                          .J = (size_t)j->o.optimize.particles };
    APSM_TRY(choose_template(j, &o.template_index));
    j->template_index = o.template_index;
    const apsm_status made =
        contour_cohort_make(j->list.n, j->n, (const double *const *)j->P, j->closed, &o, &j->c);
    if (made == APSM_ERR_GEOMETRY)
        return apsm_fail(j->ctx, made, "a contour has no length; leave it out with --exclude");
    APSM_TRY(made);
    APSM_TRY(apsm_shape_model_fit(j->ctx, j->c.I, j->c.J, j->c.P, &j->model));
    const apsm_evaluate_input input = {
        .I = j->c.I, .J = j->c.J, .P = j->c.P, .options = j->o.evaluate
    };
    APSM_TRY(apsm_evaluate(j->ctx, &input, &j->e));
    j->mean = malloc((j->c.I + 1) * sizeof *j->mean);
    j->most = malloc((j->c.I + 1) * sizeof *j->most);
    if (!j->mean || !j->most) return APSM_ERR_MEMORY;
    measure(j);
    return APSM_OK;
}

/* ---- files ---- */

static char *path_of(const contour_job *j, const char *name)
{
    return apsm_path_join(j->folder, name);
}

static apsm_status make_folders(const contour_job *j)
{
    static const char *const folders[] = { "particles", "contours" };
    apsm_file_list files = { 0 };
    APSM_TRY(apsm_make_folder(j->ctx, j->folder));
    APSM_TRY(apsm_list_files(j->ctx, j->folder, false, &files));
    const size_t n = files.n;
    apsm_file_list_free(&files);
    if (n > 0)
        return apsm_fail(j->ctx, APSM_ERR_STATE,
                         "%s: is not empty; a model of contours needs a new folder", j->folder);
    for (size_t k = 0; k < 2; k++) {
        char *path = path_of(j, folders[k]);
        const apsm_status status = path ? apsm_make_folder(j->ctx, path) : APSM_ERR_MEMORY;
        free(path);
        APSM_TRY(status);
    }
    return APSM_OK;
}

static apsm_status write_curve(const contour_job *j, const char *name, const double *X)
{
    apsm_writer *w = NULL;
    const size_t cells = j->closed ? N : N - 1;
    char *path = path_of(j, name);
    const apsm_status status = path ? apsm_writer_open(j->ctx, path, &w) : APSM_ERR_MEMORY;
    free(path);
    APSM_TRY(status);
    apsm_writer_printf(w,
                       "# vtk DataFile Version 3.0\napsm\nASCII\nDATASET POLYDATA\nPOINTS %d "
                       "double\n",
                       N);
    for (size_t k = 0; k < 3 * N; k++) {
        apsm_writer_number(w, X[k]);
        apsm_writer_write(w, k % 3 == 2 ? "\n" : " ", 1);
    }
    apsm_writer_printf(w, "LINES %zu %zu\n", cells, 3 * cells);
    for (size_t k = 0; k < cells; k++) apsm_writer_printf(w, "2 %zu %zu\n", k, (k + 1) % N);
    return apsm_writer_commit(w);
}

static apsm_status write_modes(const contour_job *j)
{
    const apsm_shape_model *m = &j->model;
    const size_t D = 3 * m->J, modes = m->modes < MODES_MOST ? m->modes : MODES_MOST;
    double X[3 * N], *p = malloc(D * sizeof *p);
    if (!p) return APSM_ERR_MEMORY;
    contour_rebuild(&j->c, m->mean, X);
    apsm_status status = write_curve(j, "contours/mean.vtk", X);
    for (size_t k = 0; k < 2 * modes && status == APSM_OK; k++) {
        char name[64];
        const double b = (k % 2 ? 2 : -2) * sqrt(m->variance[k / 2]);
        for (size_t x = 0; x < D; x++) p[x] = m->mean[x] + b * m->mode[k / 2 * D + x];
        contour_rebuild(&j->c, p, X);
        snprintf(name, sizeof name, "contours/mode_%02zu_%s2sd.vtk", k / 2 + 1,
                 k % 2 ? "plus" : "minus");
        status = write_curve(j, name, X);
    }
    free(p);
    return status;
}

static apsm_status write_particles(const contour_job *j, size_t i, const char *frame,
                                   const double *p, char **slot)
{
    char name[512];
    if (snprintf(name, sizeof name, "particles/%s_%s.particles", j->names[i], frame) >=
        (int)sizeof name)
        return APSM_ERR_ARG;
    char *path = path_of(j, name);
    const apsm_status status =
        path ? apsm_particles_write(j->ctx, path, j->c.J, p) : APSM_ERR_MEMORY;
    free(path);
    return status == APSM_OK ? apsm_text_set(slot, name) : status;
}

static apsm_status write_subject(contour_job *j, size_t i, double *local)
{
    apsm_subject *s;
    double back[16];
    const double *world = j->c.P + 3 * i * j->c.J;
    char *shape = apsm_path_relative(j->folder, j->list.cases[i].path);
    apsm_status status = !shape ? APSM_ERR_MEMORY : APSM_OK;
    if (status == APSM_OK && j->by_project)
        s = &j->project.subjects[apsm_project_find(&j->project, j->names[i])];
    else if (status == APSM_OK)
        status = apsm_project_add(&j->project, j->names[i], shape, &s);
    if (status == APSM_OK) status = apsm_text_set(&s->groomed, shape);
    free(shape);
    APSM_TRY(status);
    s->has_alignment = s->has_procrustes = true;
    memcpy(s->alignment, j->c.M + 16 * i, sizeof s->alignment);
    apsm_affine_identity(s->procrustes);
    APSM_TRY(apsm_affine_invert(s->alignment, back));
    apsm_affine_apply(back, j->c.J, world, local);
    APSM_TRY(write_particles(j, i, "local", local, &s->local_particles));
    return write_particles(j, i, "world", world, &s->world_particles);
}

/* The project that was given, as seen from the folder, its rows those of the list and in its order:
 * without whom --exclude left out. */
static apsm_status keep_project(contour_job *j)
{
    apsm_project *p = &j->project;
    APSM_TRY(apsm_project_rebase(p, j->folder));
    for (size_t i = 0; i < j->list.n; i++) {
        const size_t at = apsm_project_find(p, j->names[i]);
        const apsm_subject moved = p->subjects[at];
        p->subjects[at] = p->subjects[i];
        p->subjects[i] = moved;
    }
    while (p->n > j->list.n) apsm_project_remove(p, p->n - 1);
    return APSM_OK;
}

static apsm_status write_project(contour_job *j)
{
    char number[32];
    double *local = malloc(3 * j->c.J * sizeof *local);
    char *path = path_of(j, FOLDER_PROJECT);
    apsm_status status = !local || !path ? APSM_ERR_MEMORY
                         : j->by_project ? keep_project(j)
                                         : apsm_project_init(j->ctx, j->folder, &j->project);
    for (size_t i = 0; i < j->c.I && status == APSM_OK; i++) status = write_subject(j, i, local);
    snprintf(number, sizeof number, "%zu", j->c.J);
    if (status == APSM_OK)
        status = apsm_project_set(&j->project, "optimize", "number_of_particles", number);
    if (status == APSM_OK)
        status =
            apsm_project_set(&j->project, "apsm", "template_used", j->names[j->template_index]);
    if (status == APSM_OK) status = apsm_project_write(j->ctx, path, &j->project);
    free(local);
    free(path);
    return status;
}

static json_t *distances_json(const contour_job *j)
{
    json_t *shapes = json_array();
    double mean = 0, most = 0;
    for (size_t i = 0; i < j->c.I; i++) {
        json_array_append_new(shapes, json_pack("{s:s, s:f, s:f}", "name", j->names[i], "mean",
                                                j->mean[i], "max", j->most[i]));
        mean += j->mean[i] / (double)j->c.I;
        most = fmax(most, j->most[i]);
    }
    return json_pack("{s:f, s:f, s:o}", "mean", mean, "max", most, "per_shape", shapes);
}

static apsm_status write_evaluation(const contour_job *j)
{
    const apsm_evaluation *e = &j->e;
    json_t *root = json_pack(
        "{s:s, s:i, s:s, s:I, s:I, s:s, s:b, s:s, s:n, s:o, s:o, s:o, s:o, s:o}", "format",
        FORMAT_EVALUATION, "version", VERSION, "template", j->names[j->template_index], "particles",
        (json_int_t)j->c.J, "shapes", (json_int_t)j->c.I, "kind",
        j->closed ? "closed contours" : "open contours", "closed", j->closed, "definition",
        apsm_definition_name(e->definition), "surface_distance", "contour_distance",
        distances_json(j), "variances", apsm_json_vector(e->modes, e->variance), "compactness",
        apsm_json_vector(e->n_compactness, e->compactness), "generalization",
        apsm_json_vector(e->n_generalization, e->generalization), "specificity",
        apsm_json_vector(e->n_specificity, e->specificity));
    char *path = path_of(j, FOLDER_EVALUATION);
    const apsm_status status = root && path ? apsm_json_write(j->ctx, path, root) : APSM_ERR_MEMORY;
    json_decref(root);
    free(path);
    return status;
}

static json_t *json_verdicts(const contour_job *j)
{
    json_t *shapes = json_array();
    for (size_t i = 0; i < j->c.I; i++)
        json_array_append_new(
            shapes,
            json_pack("{s:s, s:s, s:o, s:o, s:f}", "name", j->names[i], "verdict",
                      is_certified(j, i) ? "certified" : "needs review", "reasons",
                      reasons_of(j, i), "rival",
                      apsm_json_number_or_null(isfinite(j->c.rival[i]) ? j->c.rival[i] : NAN),
                      "off", j->most[i] / spacing_of(j, i)));
    if (json_array_size(shapes) == j->c.I) return shapes;
    json_decref(shapes);
    return NULL;
}

static apsm_status write_certificate(const contour_job *j)
{
    const size_t certified = count_certified(j);
    json_t *root = json_pack("{s:s, s:i, s:s, s:s, s:I, s:I, s:{s:f, s:f}, s:o}", "format",
                             FORMAT_CERTIFICATE, "version", CERTIFICATE_VERSION, "kind",
                             j->closed ? "closed contours" : "open contours", "verdict",
                             certified == j->c.I ? "certified" : "needs review", "certified",
                             (json_int_t)certified, "shapes", (json_int_t)j->c.I, "thresholds",
                             "rival", as_likely, "off", off, "per_shape", json_verdicts(j));
    char *path = path_of(j, FOLDER_CERTIFICATE);
    const apsm_status status = root && path ? apsm_json_write(j->ctx, path, root) : APSM_ERR_MEMORY;
    json_decref(root);
    free(path);
    return status;
}

static apsm_status write_table(const contour_job *j)
{
    apsm_writer *w = NULL;
    char *path = path_of(j, FOLDER_EVALUATION_CSV);
    const apsm_status status = path ? apsm_writer_open(j->ctx, path, &w) : APSM_ERR_MEMORY;
    free(path);
    APSM_TRY(status);
    apsm_writer_printf(w, "name,contour_mean,contour_max,verdict\n");
    for (size_t i = 0; i < j->c.I; i++) {
        apsm_writer_csv(w, j->names[i]);
        apsm_writer_printf(w, ",");
        apsm_writer_number(w, j->mean[i]);
        apsm_writer_printf(w, ",");
        apsm_writer_number(w, j->most[i]);
        apsm_writer_printf(w, ",%s\n", is_certified(j, i) ? "certified" : "needs review");
    }
    return apsm_writer_commit(w);
}

static apsm_status write_model(const contour_job *j)
{
    char *model = path_of(j, FOLDER_MODEL), *scores = path_of(j, FOLDER_SCORES_CSV);
    apsm_status status = model && scores ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = model_json_write(j->ctx, model, &j->model);
    if (status == APSM_OK) status = scores_csv_write(j->ctx, scores, j->names, "mode", &j->model);
    free(model);
    free(scores);
    return status;
}

static apsm_status write_all(contour_job *j)
{
    APSM_TRY(make_folders(j));
    APSM_TRY(write_project(j));
    APSM_TRY(write_model(j));
    APSM_TRY(write_modes(j));
    APSM_TRY(write_table(j));
    APSM_TRY(write_certificate(j));
    return write_evaluation(j);
}

static void tell(const contour_job *j)
{
    double mean = 0, most = 0;
    for (size_t i = 0; i < j->c.I; i++) {
        mean += j->mean[i] / (double)j->c.I;
        most = fmax(most, j->most[i]);
    }
    apsm_log(j->ctx, APSM_LOG_INFO,
             "%zu %s contours, %zu particles; distance along them: mean %.4g, "
             "max %.4g",
             j->c.I, j->closed ? "closed" : "open", j->c.J, mean, most);
    if (j->e.n_compactness > 0)
        apsm_log(j->ctx, APSM_LOG_INFO, "one mode: compactness %.3f", j->e.compactness[0]);
    for (size_t i = 0; i < j->c.I; i++) {
        json_t *reasons = reasons_of(j, i);
        if (json_array_size(reasons) > 0)
            apsm_log(j->ctx, APSM_LOG_WARNING, "%s needs review: %s", j->names[i],
                     json_string_value(json_array_get(reasons, 0)));
        json_decref(reasons);
    }
    apsm_log(j->ctx, APSM_LOG_INFO,
             "%zu of %zu contours certified; a model of contours has no report: look at "
             "contours/*.vtk",
             count_certified(j), j->c.I);
}

static void job_free(contour_job *j)
{
    for (size_t i = 0; j->P && i < j->list.n; i++) free(j->P[i]);
    free(j->P);
    free(j->n);
    free(j->names);
    free(j->mean);
    free(j->most);
    contour_cohort_free(&j->c);
    apsm_shape_model_free(&j->model);
    apsm_evaluation_free(&j->e);
    apsm_project_free(&j->project);
    apsm_input_list_free(&j->list);
}

apsm_status apsm_contours_run(apsm_context *ctx, const apsm_run_settings *s)
{
    contour_job j = { .ctx = ctx, .folder = s->folder, .o = apsm_options_defaults(), .ignore = "" };
    apsm_status status = take_settings(&j, s);
    j.by_project = apsm_is_project_file(s->inputs[0]);
    if (status == APSM_OK)
        status =
            j.by_project ? list_project(&j, s) : list_inputs(ctx, s, j.exclude, j.pattern, &j.list);
    if (status == APSM_OK) status = read_curves(&j);
    if (status == APSM_OK) status = compute(&j);
    if (status == APSM_OK && !s->dry) status = write_all(&j);
    if (status == APSM_OK) tell(&j);
    job_free(&j);
    return status;
}
