/* The files of a model of contours. */
#include "assemble/contour_job.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "files/particles_file.h"
#include "folder/model_json.h"
#include "folder/names.h"
#include "geometry/affine.h"

enum { N = CONTOUR_POINTS, MODES_MOST = 10, VERSION = 1 };

char *contour_path(const contour_job *j, const char *name)
{
    return apsm_path_join(j->folder, name);
}

static apsm_status make_folders(const contour_job *j)
{
    static const char *const folders[] = { "particles", "contours" };
    for (size_t k = 0; k < 2; k++) {
        char *path = contour_path(j, folders[k]);
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
    char *path = contour_path(j, name);
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

static size_t modes_written(const contour_job *j)
{
    return j->model.modes < MODES_MOST ? j->model.modes : MODES_MOST;
}

/* Of mode k / 2, below (even k) and above the mean. */
static void name_of_mode(size_t k, char name[64])
{
    snprintf(name, 64, "contours/mode_%02zu_%s2sd.vtk", k / 2 + 1, k % 2 ? "plus" : "minus");
}

static apsm_status write_modes(const contour_job *j)
{
    const apsm_shape_model *m = &j->model;
    const size_t D = 3 * m->J, modes = modes_written(j);
    double X[3 * N], *p = malloc(D * sizeof *p);
    if (!p) return APSM_ERR_MEMORY;
    contour_rebuild(&j->c, m->mean, X);
    apsm_status status = write_curve(j, "contours/mean.vtk", X);
    for (size_t k = 0; k < 2 * modes && status == APSM_OK; k++) {
        char name[64];
        const double b = (k % 2 ? 2 : -2) * sqrt(m->variance[k / 2]);
        for (size_t x = 0; x < D; x++) p[x] = m->mean[x] + b * m->mode[k / 2 * D + x];
        contour_rebuild(&j->c, p, X);
        name_of_mode(k, name);
        status = write_curve(j, name, X);
    }
    free(p);
    return status;
}

enum { NAME_LENGTH = 512 };

static apsm_status name_particles(const contour_job *j, size_t i, const char *frame,
                                  char name[NAME_LENGTH])
{
    const int length = snprintf(name, NAME_LENGTH, "particles/%s_%s.particles", j->names[i], frame);
    return length < NAME_LENGTH ? APSM_OK : APSM_ERR_ARG;
}

static apsm_status write_particles(const contour_job *j, size_t i, const char *frame,
                                   const double *p, char **slot)
{
    char name[NAME_LENGTH];
    APSM_TRY(name_particles(j, i, frame, name));
    char *path = contour_path(j, name);
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
    char *path = contour_path(j, FOLDER_PROJECT);
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
    char *path = contour_path(j, FOLDER_EVALUATION);
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
                      contour_is_certified(j, i) ? "certified" : "needs review", "reasons",
                      contour_reasons(j, i), "rival",
                      apsm_json_number_or_null(isfinite(j->c.rival[i]) ? j->c.rival[i] : NAN),
                      "off", j->most[i] / contour_spacing(j, i)));
    if (json_array_size(shapes) == j->c.I) return shapes;
    json_decref(shapes);
    return NULL;
}

static apsm_status write_certificate(const contour_job *j)
{
    const size_t certified = contour_count_certified(j);
    json_t *root = json_pack(
        "{s:s, s:i, s:s, s:s, s:I, s:I, s:{s:f, s:f}, s:o}", "format", FORMAT_CERTIFICATE,
        "version", CERTIFICATE_VERSION, "kind", j->closed ? "closed contours" : "open contours",
        "verdict", certified == j->c.I ? "certified" : "needs review", "certified",
        (json_int_t)certified, "shapes", (json_int_t)j->c.I, "thresholds", "rival",
        CONTOUR_AS_LIKELY, "off", CONTOUR_OFF, "per_shape", json_verdicts(j));
    char *path = contour_path(j, FOLDER_CERTIFICATE);
    const apsm_status status = root && path ? apsm_json_write(j->ctx, path, root) : APSM_ERR_MEMORY;
    json_decref(root);
    free(path);
    return status;
}

static apsm_status write_table(const contour_job *j)
{
    apsm_writer *w = NULL;
    char *path = contour_path(j, FOLDER_EVALUATION_CSV);
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
        apsm_writer_printf(w, ",%s\n", contour_is_certified(j, i) ? "certified" : "needs review");
    }
    return apsm_writer_commit(w);
}

static apsm_status write_model(const contour_job *j)
{
    char *model = contour_path(j, FOLDER_MODEL), *scores = contour_path(j, FOLDER_SCORES_CSV);
    apsm_status status = model && scores ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = model_json_write(j->ctx, model, &j->model);
    if (status == APSM_OK) status = scores_csv_write(j->ctx, scores, j->names, "mode", &j->model);
    free(model);
    free(scores);
    return status;
}

/* ---- all ---- */

static int add_name(json_t *names, const char *name)
{
    return json_array_append_new(names, json_string(name));
}

static apsm_status add_particles(const contour_job *j, json_t *names)
{
    static const char *const frames[] = { "local", "world" };
    char name[NAME_LENGTH];
    for (size_t k = 0; k < 2 * j->c.I; k++) {
        APSM_TRY(name_particles(j, k / 2, frames[k % 2], name));
        if (add_name(names, name)) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

static const char *const fixed[] = { FOLDER_PROJECT,     FOLDER_MODEL,          FOLDER_SCORES_CSV,
                                     FOLDER_CERTIFICATE, FOLDER_EVALUATION_CSV, FOLDER_EVALUATION,
                                     FOLDER_REPORT,      "contours/mean.vtk" };

/* Whether name is prefix, one part of a path, and suffix. */
static bool is_made_of(const char *name, const char *prefix, const char *suffix)
{
    const size_t n = strlen(name), a = strlen(prefix), b = strlen(suffix);
    return n > a + b && strncmp(name, prefix, a) == 0 && strcmp(name + n - b, suffix) == 0 &&
           !strchr(name + a, '/');
}

bool contour_may_name(const char *name)
{
    for (size_t k = 0; k < sizeof fixed / sizeof *fixed; k++)
        if (strcmp(name, fixed[k]) == 0) return true;
    return is_made_of(name, "contours/mode_", "2sd.vtk") ||
           is_made_of(name, "particles/", "_local.particles") ||
           is_made_of(name, "particles/", "_world.particles");
}

apsm_status contour_names(const contour_job *j, json_t **names)
{
    json_t *list = json_array();
    int failed = !list;
    for (size_t k = 0; k < sizeof fixed / sizeof *fixed; k++)
        failed = failed || add_name(list, fixed[k]);
    for (size_t k = 0; k < 2 * modes_written(j); k++) {
        char name[64];
        name_of_mode(k, name);
        failed = failed || add_name(list, name);
    }
    const apsm_status status = failed ? APSM_ERR_MEMORY : add_particles(j, list);
    if (status != APSM_OK) json_decref(list);
    *names = status == APSM_OK ? list : NULL;
    return status;
}

apsm_status contour_write(contour_job *j)
{
    APSM_TRY(contour_begin_folder(j));
    APSM_TRY(make_folders(j));
    APSM_TRY(write_project(j));
    APSM_TRY(write_model(j));
    APSM_TRY(write_modes(j));
    APSM_TRY(write_table(j));
    APSM_TRY(write_certificate(j));
    APSM_TRY(write_evaluation(j));
    APSM_TRY(contour_write_page(j));
    return contour_end_folder(j);
}
