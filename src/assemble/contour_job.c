/* `run` on contours: read, bring together, match, place particles, model, judge, write. */
#include "assemble/contour_job.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/contour.h"
#include "core/sized.h"
#include "files/files.h"
#include "files/project_columns.h"
#include "formats/mesh_io.h"
#include "run/source.h"

enum { N = CONTOUR_POINTS };

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
        if (source_is_fixed(p, subject) && !source_list_has(j->ignore, "fixed"))
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

apsm_status apsm_contours_wanted_sized(apsm_context *ctx, const apsm_run_settings *given,
                                       size_t size, bool *wanted)
{
    apsm_run_settings s = { 0 };
    *wanted = false;
    APSM_TRY(apsm_take_settings(ctx, "apsm_contours_wanted", given, size, &s, sizeof s));
    if (s.n_inputs == 0) {
        bool ours = false;
        if (s.folder) APSM_TRY(contour_folder_is_ours(ctx, s.folder, &ours));
        if (!ours) return APSM_OK;
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: holds a model of contours; give its inputs again",
                         s.folder);
    }
    if (apsm_is_project_file(s.inputs[0])) return project_is_of_contours(ctx, &s, wanted);
    return first_is_contour(ctx, s.inputs[0], wanted);
}

/* ---- reading ---- */

static double length_of(const contour_job *j, size_t i)
{
    double Q[3 * N];
    return curve_resample(j->n[i], j->P[i], j->closed, N, Q);
}

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
        if (!(length_of(j, i) > 0))
            return apsm_fail(j->ctx, APSM_ERR_GEOMETRY,
                             "%s: has no length; leave it out with --exclude", c->path);
    }
    return APSM_OK;
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

enum { LEAST_SHAPES = 3 };

double contour_spacing(const contour_job *j, size_t i)
{
    return length_of(j, i) / (double)j->c.J;
}

/* A new reference: reasons, empty if nothing speaks against it. */
json_t *contour_reasons(const contour_job *j, size_t i)
{
    json_t *list = json_array();
    const double rival = j->c.rival[i], cut = CONTOUR_OFF * contour_spacing(j, i);
    if (rival < CONTOUR_AS_LIKELY)
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

bool contour_is_certified(const contour_job *j, size_t i)
{
    json_t *list = contour_reasons(j, i);
    const bool none = list && json_array_size(list) == 0;
    json_decref(list);
    return none;
}

size_t contour_count_certified(const contour_job *j)
{
    size_t n = 0;
    for (size_t i = 0; i < j->c.I; i++) n += contour_is_certified(j, i);
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
                          .J = (size_t)j->o.optimize.particles,
                          .template_index = j->template_index };
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
        json_t *reasons = contour_reasons(j, i);
        if (json_array_size(reasons) > 0)
            apsm_log(j->ctx, APSM_LOG_WARNING, "%s needs review: %s", j->names[i],
                     json_string_value(json_array_get(reasons, 0)));
        json_decref(reasons);
    }
    apsm_log(j->ctx, APSM_LOG_INFO, "%zu of %zu contours certified", contour_count_certified(j),
             j->c.I);
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
    json_decref(j->files);
    apsm_input_list_free(&j->list);
}

static apsm_status read_all(contour_job *j)
{
    const apsm_run_settings *s = j->settings;
    if (j->folder) APSM_TRY(apsm_refuse_root(j->ctx, j->folder));
    APSM_TRY(take_settings(j, s));
    APSM_TRY(j->by_project ? list_project(j, s)
                           : list_inputs(j->ctx, s, j->exclude, j->pattern, &j->list));
    if (j->folder) APSM_TRY(apsm_input_check_stored(j->ctx, j->folder, &j->list));
    APSM_TRY(read_curves(j));
    return choose_template(j, &j->template_index);
}

/* Nothing is written before all is computed. */
static apsm_status make(contour_job *j)
{
    bool done = false;
    if (!j->settings->dry) APSM_TRY(contour_look_at_folder(j, &done));
    if (done) {
        apsm_log(j->ctx, APSM_LOG_INFO, "nothing to do: the model in %s is whole", j->folder);
        return APSM_OK;
    }
    APSM_TRY(compute(j));
    if (apsm_interrupted(j->ctx)) return APSM_ERR_INTERRUPTED;
    if (!j->settings->dry) APSM_TRY(contour_write(j));
    tell(j);
    return APSM_OK;
}

static apsm_status run_contours(apsm_context *ctx, const apsm_run_settings *s)
{
    if (s->shards > 0)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "--shard: a model of contours is made by one process; leave it out");
    contour_job j = { .ctx = ctx,
                      .settings = s,
                      .folder = s->folder,
                      .o = apsm_options_defaults(),
                      .ignore = "",
                      .by_project = apsm_is_project_file(s->inputs[0]) };
    apsm_status status = read_all(&j);
    if (status == APSM_OK) status = make(&j);
    job_free(&j);
    return status;
}

APSM_BY_SIZE(apsm_contours_run, apsm_run_settings, run_contours)
