/* import, certify and evaluate FILE...: verdict and figures of a model from particle files of any
 * program, and its meshes if they are given in the same order and in the frame of the particles; or
 * from a project, with its meshes.  The last two write nothing; the figures are the result.  The
 * shape that is warped to the others is the one that is named, else the project's template, else
 * the one whose particles are nearest to the mean. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/certify.h"
#include "apsm/exchange.h"
#include "apsm/formats.h"
#include "apsm/particles.h"
#include "evaluate/metrics.h"
#include "files/files.h"
#include "geometry/affine.h"
#include "geometry/bvh.h"
#include "options/options.h"
#include "particle_sets.h"
#include "verbs.h"

typedef struct files_work {
    apsm_context *ctx;
    cli_sets in;
    const char *const *mesh_file;
    size_t I, J, n_meshes, t; /* t: the shape in the template's place */
    double *P;                /* I x J x 3 */
    apsm_mesh *meshes;        /* I, or NULL */
    apsm_evaluation evaluation;
} files_work;

static apsm_status out_of_memory(const files_work *w)
{
    return apsm_fail(w->ctx, APSM_ERR_MEMORY, "out of memory");
}

/* Local particles have the pose of each shape in them, and a model of poses looks like a model. */
static apsm_status check_names(const files_work *w)
{
    const cli_frames frames = cli_sets_frames(&w->in);
    if (frames == CLI_FRAMES_MIXED)
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "local and world particles are among the inputs, which lie in different "
                         "frames; give *_world.particles alone");
    if (frames == CLI_FRAMES_LOCAL)
        apsm_log(w->ctx, APSM_LOG_WARNING,
                 "local particles are not aligned: the figures are of poses as well as of shapes; "
                 "world particles are wanted here");
    return APSM_OK;
}

/* Files of VTK may hold particles as well as meshes: those without polygons are particles. */
static bool holds_particles(const char *path)
{
    if (cli_holds_particles(path)) return true;
    if (!cli_may_hold_points(path)) return false;
    size_t n;
    double *P = NULL;
    apsm_context *quiet = apsm_context_new();
    const bool points = quiet && apsm_points_read(quiet, path, &n, &P) == APSM_OK;
    free(P);
    apsm_context_free(quiet);
    return points;
}

/* What holds particles comes first, then as many meshes as shapes, or none. */
static apsm_status read_operands(files_work *w, const cli_args *args)
{
    size_t n = 0;
    while (n < args->n_inputs && holds_particles(args->inputs[n])) n++;
    if (n == 0 && apsm_is_folder(args->inputs[0]))
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "%s: is a folder; give its project.swproj, or files of particles and then "
                         "meshes",
                         args->inputs[0]);
    if (n == 0)
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "%s: holds no particles; they come first, meshes after them",
                         args->inputs[0]);
    w->n_meshes = args->n_inputs - n;
    w->mesh_file = args->inputs + n;
    APSM_TRY(cli_sets_read(w->ctx, n, args->inputs, &w->in));
    w->I = w->in.n;
    if (w->I < 3)
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "particles of %zu shapes make no model; give 3 at least", w->I);
    if (w->n_meshes != 0 && w->n_meshes != w->I)
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "particles of %zu shapes, then %zu meshes; give a mesh for each, or none",
                         w->I, w->n_meshes);
    return check_names(w);
}

static apsm_status gather(files_work *w)
{
    w->J = w->in.sets[0].n;
    w->P = malloc(w->I * w->J * 3 * sizeof *w->P);
    if (!w->P) return out_of_memory(w);
    for (size_t i = 0; i < w->I; i++) {
        const cli_set *set = &w->in.sets[i];
        if (set->n != w->J)
            return apsm_fail(w->ctx, APSM_ERR_FORMAT,
                             "%s: holds %zu particles where %zu are expected; every shape needs "
                             "the same number",
                             set->file, set->n, w->J);
        memcpy(w->P + i * w->J * 3, set->P, w->J * 3 * sizeof *w->P);
    }
    return APSM_OK;
}

/* Of a project, if it has one for every shape. */
static bool has_own_meshes(const files_work *w)
{
    for (size_t i = 0; i < w->I; i++)
        if (!w->in.sets[i].mesh) return false;
    return true;
}

static const char *mesh_of(const files_work *w, size_t i)
{
    return w->n_meshes ? w->mesh_file[i] : w->in.sets[i].mesh;
}

/* Mean squared distance of shape i's particles to its mesh, relative to their own variance. */
static apsm_status misfit(const files_work *w, size_t i, double *relative)
{
    const double *p = w->P + i * w->J * 3;
    double mean[3] = { 0 }, off = 0.0, spread = 0.0;
    apsm_bvh *bvh = NULL;
    APSM_TRY(apsm_bvh_build(&w->meshes[i], &bvh));
    for (size_t j = 0; j < w->J; j++)
        for (size_t c = 0; c < 3; c++) mean[c] += p[3 * j + c] / (double)w->J;
    for (size_t j = 0; j < w->J; j++) {
        apsm_closest at;
        apsm_bvh_closest(bvh, p + 3 * j, INFINITY, &at);
        off += at.distance2;
        for (size_t c = 0; c < 3; c++)
            spread += (p[3 * j + c] - mean[c]) * (p[3 * j + c] - mean[c]);
    }
    apsm_bvh_free(bvh);
    *relative = off / spread;
    return APSM_OK;
}

/* Meshes in another frame give figures that look like figures.  Particles of a poor model are a
 * hundredth of the shape's size off its surface; a tenth is another frame or another shape. */
static apsm_status read_mesh(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const files_work *w = user;
    double relative;
    APSM_TRY(apsm_read_mesh(ctx, mesh_of(w, i), &w->meshes[i]));
    if (w->n_meshes == 0) apsm_mesh_transform(&w->meshes[i], w->in.sets[i].to_world);
    APSM_TRY(misfit(w, i, &relative));
    if (relative <= 0.01) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                     "%s: its particles (%s) are not on it; give meshes in the same order and "
                     "frame as the particles",
                     mesh_of(w, i), w->in.sets[i].file);
}

static apsm_status read_meshes(files_work *w)
{
    if (w->n_meshes == 0 && !has_own_meshes(w)) return APSM_OK;
    w->meshes = calloc(w->I, sizeof *w->meshes);
    if (!w->meshes) return out_of_memory(w);
    return apsm_parallel_for(w->ctx, w->I, read_mesh, w, "meshes");
}

static double distance2(size_t n, const double *x, const double *y)
{
    double sum = 0.0;
    for (size_t k = 0; k < n; k++) sum += (x[k] - y[k]) * (x[k] - y[k]);
    return sum;
}

static size_t nearest_to_mean(const files_work *w, const double *mean)
{
    const size_t n = w->J * 3;
    size_t best = 0;
    double least = INFINITY;
    for (size_t i = 0; i < w->I; i++) {
        const double d = distance2(n, w->P + i * n, mean);
        if (d < least) least = d, best = i;
    }
    return best;
}

/* The shape of this name (NULL: none), or I. */
static size_t find_shape(const files_work *w, const char *name)
{
    size_t i = name ? 0 : w->I;
    while (i < w->I && strcmp(w->in.sets[i].name, name) != 0) i++;
    return i;
}

static apsm_status choose_template(files_work *w, const char *wanted, const double *mean)
{
    const bool named = wanted && strcmp(wanted, "auto") != 0;
    w->t = find_shape(w, named ? wanted : w->in.template_used);
    if (w->t < w->I) return APSM_OK;
    if (named)
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "--template %s: no such shape; the first is called %s", wanted,
                         w->in.sets[0].name);
    w->t = nearest_to_mean(w, mean);
    return APSM_OK;
}

static apsm_status take_options(apsm_context *ctx, const cli_args *args, apsm_options *options)
{
    *options = apsm_options_defaults();
    static const char *const keys[] = { "definition", "specificity_samples", "specificity_modes",
                                        "other_templates" };
    for (size_t k = 0; k < sizeof keys / sizeof *keys; k++) {
        const char *value = cli_args_get(args, keys[k]);
        if (value) APSM_TRY(apsm_options_set(ctx, options, keys[k], value));
    }
    return APSM_OK;
}

static apsm_status compute(files_work *w, const char *template_name, const apsm_options *options)
{
    apsm_shape_model model = { 0 };
    apsm_status status = apsm_shape_model_fit(w->ctx, w->I, w->J, w->P, &model);
    if (status == APSM_OK) status = choose_template(w, template_name, model.mean);
    apsm_shape_model_free(&model);
    APSM_TRY(status);
    const apsm_mesh_source shapes = apsm_mesh_source_array(w->meshes);
    const apsm_evaluate_input input = { .I = w->I,
                                        .J = w->J,
                                        .P = w->P,
                                        .options = options->evaluate,
                                        .shape = w->meshes ? &shapes : NULL,
                                        .template_mesh = w->meshes ? &w->meshes[w->t] : NULL,
                                        .template_index = w->t };
    return apsm_evaluate(w->ctx, &input, &w->evaluation);
}

static void say_others(cli_ui *ui, const apsm_evaluation *e)
{
    const apsm_surface_aggregate *a = &e->other_templates;
    if (e->others == 0) return;
    cli_say(ui, "with %zu other shapes as template: mean %.6g, mean of max %.6g, max %.6g",
            e->others, a->mean, a->mean_max, a->max);
}

static void say(cli_ui *ui, const files_work *w)
{
    const apsm_evaluation *e = &w->evaluation;
    cli_say(ui, "%zu shapes, %zu particles, definition %s: %s", w->I, w->J,
            apsm_definition_name(e->definition), apsm_definition_text(e->definition));
    if (e->surface) {
        const apsm_surface_aggregate *a = &e->surface_summary.two_way;
        cli_say(ui,
                "surface distance, two-way: mean %.6g, mean of max %.6g, max %.6g (template %s)",
                a->mean, a->mean_max, a->max, w->in.sets[w->t].name);
        say_others(ui, e);
    }
    cli_say(ui, "modes compactness generalization specificity");
    for (size_t m = 0; m < e->n_generalization && m < e->modes; m++)
        if (m < e->n_specificity)
            cli_say(ui, "%zu %.6g %.6g %.6g", m + 1, e->compactness[m], e->generalization[m],
                    e->specificity[m]);
        else
            cli_say(ui, "%zu %.6g %.6g -", m + 1, e->compactness[m], e->generalization[m]);
}

apsm_status apsm_cli_evaluate_files(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    files_work w = { .ctx = ctx };
    apsm_options options;
    apsm_status status = take_options(ctx, args, &options);
    if (status == APSM_OK) status = read_operands(&w, args);
    if (status == APSM_OK) status = gather(&w);
    if (status == APSM_OK) status = read_meshes(&w);
    if (status == APSM_OK) status = compute(&w, cli_args_get(args, "template"), &options);
    if (status == APSM_OK) say(ui, &w);
    apsm_evaluation_free(&w.evaluation);
    for (size_t i = 0; w.meshes && i < w.I; i++) apsm_mesh_free(&w.meshes[i]);
    free(w.meshes);
    free(w.P);
    cli_sets_free(&w.in);
    return status;
}

/* ---- certify ---- */

static apsm_status find_template(files_work *w, const char *template_name)
{
    apsm_shape_model model = { 0 };
    apsm_status status = apsm_shape_model_fit(w->ctx, w->I, w->J, w->P, &model);
    if (status == APSM_OK) status = choose_template(w, template_name, model.mean);
    apsm_shape_model_free(&model);
    return status;
}

static apsm_status certify(files_work *w, const char *path, cli_ui *ui)
{
    size_t certified;
    if (!w->meshes)
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "certify needs a mesh for each shape, after the particles, in the same "
                         "order and frame");
    const char **names = calloc(w->I, sizeof *names);
    if (!names) return out_of_memory(w);
    for (size_t i = 0; i < w->I; i++) names[i] = w->in.sets[i].name;
    const apsm_certify_input input = { w->I, w->J, names, w->P, w->meshes, w->t };
    const apsm_status status = apsm_certify_particles(w->ctx, &input, path, &certified);
    free(names);
    if (status == APSM_OK)
        cli_say(ui, "%zu of %zu shapes are certified (template %s)", certified, w->I,
                w->in.sets[w->t].name);
    return status;
}

apsm_status apsm_cli_certify(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    files_work w = { .ctx = ctx };
    if (args->out_dir) APSM_TRY(cli_args_check_output(ctx, args, args->out_dir));
    apsm_status status = read_operands(&w, args);
    if (status == APSM_OK) status = gather(&w);
    if (status == APSM_OK) status = read_meshes(&w);
    if (status == APSM_OK) status = find_template(&w, cli_args_get(args, "template"));
    if (status == APSM_OK) status = certify(&w, args->out_dir, ui);
    for (size_t i = 0; w.meshes && i < w.I; i++) apsm_mesh_free(&w.meshes[i]);
    free(w.meshes);
    free(w.P);
    cli_sets_free(&w.in);
    return status;
}

/* ---- import ---- */

/* Frames of the meshes: a project tells them, files lie in the world's. */
static apsm_status to_own_frames(files_work *w, double *to_world)
{
    for (size_t i = 0; i < w->I; i++) {
        double inverse[16];
        apsm_affine_identity(to_world + 16 * i);
        if (w->n_meshes > 0) continue;
        memcpy(to_world + 16 * i, w->in.sets[i].to_world, 16 * sizeof *to_world);
        APSM_TRY(apsm_affine_invert(to_world + 16 * i, inverse));
        apsm_mesh_transform(&w->meshes[i], inverse);
    }
    return APSM_OK;
}

static apsm_status run_import(const cli_args *args, const apsm_import *input, apsm_context *ctx)
{
    apsm_run *run = NULL;
    const apsm_run_settings settings = { .folder = args->out_dir };
    APSM_TRY(cli_open_run(ctx, args, settings, &run));
    const apsm_status status = apsm_run_import(run, input);
    apsm_run_close(run);
    return status;
}

static apsm_status import_files(files_work *w, const cli_args *args)
{
    if (!w->meshes)
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "import needs a mesh for each shape: those of the project, or after the "
                         "particles, in the same order and frame");
    const char **names = calloc(2 * w->I, sizeof *names), **paths = names ? names + w->I : NULL;
    double *to_world = malloc(16 * w->I * sizeof *to_world);
    apsm_status status = names && to_world ? to_own_frames(w, to_world) : out_of_memory(w);
    for (size_t i = 0; status == APSM_OK && i < w->I; i++) {
        names[i] = w->in.sets[i].name;
        paths[i] = mesh_of(w, i);
    }
    const apsm_import input = { w->I, w->J, names, w->P, w->meshes, to_world, paths, w->t, false };
    if (status == APSM_OK) status = run_import(args, &input, w->ctx);
    free(to_world);
    free(names);
    return status;
}

/* .h5.json is what Scalismo writes since 1.0. */
static bool is_hdf5(const char *path)
{
    static const char *const ends[] = { ".h5", ".hdf5", ".h5.json", ".hdf5.json" };
    const size_t n = strlen(path);
    for (size_t k = 0; k < sizeof ends / sizeof *ends; k++)
        if (n > strlen(ends[k]) && strcmp(path + n - strlen(ends[k]), ends[k]) == 0) return true;
    return false;
}

static apsm_status import_shapes(const apsm_foreign_model *m, const cli_args *args,
                                 apsm_context *ctx)
{
    const char **names = calloc(2 * m->I, sizeof *names), **paths = names ? names + m->I : NULL;
    double *to_world = malloc(16 * m->I * sizeof *to_world);
    apsm_status status = names && to_world ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; i < m->I && status == APSM_OK; i++) {
        names[i] = m->names[i];
        paths[i] = args->inputs[0];
        apsm_affine_identity(to_world + 16 * i);
    }
    const apsm_import input = { m->I,     m->J,  names, m->P,         m->meshes,
                                to_world, paths, 0,     !m->of_shapes };
    if (status == APSM_OK) status = run_import(args, &input, ctx);
    free(to_world);
    free(names);
    return status;
}

/* A model of Scalismo or Statismo. */
static apsm_status import_model(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    apsm_foreign_model m = { 0 };
    if (args->n_inputs > 1)
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: a model file is imported alone", args->inputs[0]);
    const apsm_options defaults = apsm_options_defaults();
    apsm_status status =
        apsm_read_statismo(ctx, args->inputs[0], (size_t)defaults.optimize.particles, &m);
    if (status == APSM_OK) status = import_shapes(&m, args, ctx);
    if (status == APSM_OK)
        cli_say(ui, "imported: %zu shapes of %zu particles%s; report: %s/report.html", m.I, m.J,
                m.of_shapes ? "" : ", drawn from the model", args->out_dir);
    apsm_foreign_model_free(&m);
    return status;
}

apsm_status apsm_cli_import(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    if (is_hdf5(args->inputs[0])) return import_model(ctx, args, ui);
    files_work w = { .ctx = ctx };
    apsm_status status = read_operands(&w, args);
    if (status == APSM_OK) status = gather(&w);
    if (status == APSM_OK) status = read_meshes(&w);
    if (status == APSM_OK) status = find_template(&w, cli_args_get(args, "template"));
    if (status == APSM_OK) status = import_files(&w, args);
    if (status == APSM_OK)
        cli_say(ui, "imported: %zu shapes of %zu particles; report: %s/report.html", w.I, w.J,
                args->out_dir);
    for (size_t i = 0; w.meshes && i < w.I; i++) apsm_mesh_free(&w.meshes[i]);
    free(w.meshes);
    free(w.P);
    cli_sets_free(&w.in);
    return status;
}
