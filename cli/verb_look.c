/* check, verify and info: look at inputs, a model folder or one file; write nothing. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "apsm/joint.h"
#include "apsm/particles.h"
#include "apsm/run.h"
#include "files/files.h"
#include "files/particles_file.h"
#include "files/project.h"
#include "folder/manifest_json.h"
#include "folder/mode_trust_json.h"
#include "folder/model_folder.h"
#include "folder/names.h"
#include "geometry/topology.h"
#include "input/foreign.h"
#include "input/input.h"
#include "input/search.h"
#include "options/options.h"
#include "verbs.h"

/* ---- check ---- */

static void say_problem(void *ui, const char *line)
{
    cli_say(ui, "%s", line);
}

/* A single folder with a project in it is a model folder. */
static bool is_model_folder(const char *path)
{
    if (!apsm_is_folder(path)) return false;
    char *project = apsm_path_join(path, FOLDER_PROJECT);
    const bool is = project && apsm_file_exists(project);
    free(project);
    return is;
}

static apsm_status open_for_check(apsm_context *ctx, const cli_args *args, apsm_run **run)
{
    const bool model = args->n_inputs == 1 && is_model_folder(args->inputs[0]);
    const apsm_run_settings settings = { .folder = model ? args->inputs[0] : ".",
                                         .n_inputs = model ? 0 : args->n_inputs,
                                         .inputs = args->inputs,
                                         .fresh = !model,
                                         .dry = true };
    return cli_open_run(ctx, args, settings, run);
}

/* Problems told, each once: parts of a joint share some. */
typedef struct telling {
    cli_ui *ui;
    size_t given, problems;
    json_t *lines; /* a set */
} telling;

static void tell_problem(void *user, const char *line)
{
    telling *t = user;
    t->given++;
    if (json_object_get(t->lines, line)) return;
    cli_say(t->ui, "%s", line);
    t->problems++;
    json_object_set_new_nocheck(t->lines, line, json_true()); /* names may hold any bytes */
}

static apsm_status check(apsm_context *ctx, const cli_args *args, telling *t)
{
    apsm_run *run = NULL;
    size_t problems = 0;
    const size_t before = t->given;
    APSM_TRY(open_for_check(ctx, args, &run));
    const apsm_status status = apsm_run_check(run, tell_problem, t, &problems);
    apsm_run_close(run);
    const size_t given = t->given - before;
    if (problems > given) t->problems += problems - given; /* those that the log has told */
    return status;
}

/* Each part of a joint, as `run` takes them: one domain of the project after the other. */
static apsm_status check_domains(apsm_context *ctx, const cli_args *args, telling *t)
{
    apsm_project project = { 0 };
    APSM_TRY(apsm_project_read(ctx, args->inputs[0], &project));
    char key[] = "domain";
    cli_args one = *args;
    one.n_set = args->n_set + 1;
    one.set = calloc(one.n_set, sizeof *one.set);
    apsm_status status = one.set ? APSM_OK : APSM_ERR_MEMORY;
    if (one.set && args->n_set > 0) memcpy(one.set, args->set, args->n_set * sizeof *one.set);
    for (size_t k = 0; status == APSM_OK && k < apsm_project_domains(&project); k++) {
        char *name = strdup(apsm_project_domain_name(&project, k));
        if (!name) status = APSM_ERR_MEMORY;
        if (name) {
            one.set[args->n_set] = (cli_pair){ key, name };
            cli_say(t->ui, "%s:", name);
            status = check(ctx, &one, t);
        }
        free(name);
    }
    free(one.set);
    apsm_project_free(&project);
    return status;
}

/* A finished joint keeps a model folder for each part. */
static bool is_joint_folder(apsm_context *ctx, const cli_args *args)
{
    return args->n_inputs == 1 && is_model_folder(args->inputs[0]) &&
           apsm_joint_is(ctx, args->inputs[0]);
}

static apsm_status check_part(apsm_context *ctx, const cli_args *args, const char *name, telling *t)
{
    cli_args one = *args;
    char *parts = apsm_path_join(args->inputs[0], "parts");
    char *folder = parts ? apsm_path_join(parts, name) : NULL;
    const char *given = folder;
    one.inputs = &given;
    cli_say(t->ui, "%s:", name);
    const apsm_status status = folder ? check(ctx, &one, t) : APSM_ERR_MEMORY;
    free(folder);
    free(parts);
    return status;
}

static apsm_status check_parts(apsm_context *ctx, const cli_args *args, telling *t)
{
    apsm_project project = { 0 };
    char *path = apsm_path_join(args->inputs[0], FOLDER_PROJECT);
    apsm_status status = path ? apsm_project_read(ctx, path, &project) : APSM_ERR_MEMORY;
    free(path);
    for (size_t k = 0; status == APSM_OK && k < apsm_project_domains(&project); k++)
        status = check_part(ctx, args, apsm_project_domain_name(&project, k), t);
    apsm_project_free(&project);
    return status;
}

static apsm_status is_joint(apsm_context *ctx, const cli_args *args, bool *joint)
{
    const char *(*pairs)[2] = malloc((args->n_set + 1) * sizeof *pairs);
    if (!pairs) return APSM_ERR_MEMORY;
    const apsm_run_settings settings = { .folder = ".",
                                         .n_inputs = args->n_inputs,
                                         .inputs = args->inputs,
                                         .n_set = args->n_set,
                                         .set = cli_pairs(args, pairs) };
    const apsm_joint_settings parts = { 0 };
    const apsm_status status = apsm_joint_wanted(ctx, &settings, &parts, joint);
    free(pairs);
    return status;
}

apsm_status apsm_cli_check(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    bool joint = false;
    telling t = { .ui = ui, .lines = json_object() };
    apsm_status status = t.lines ? is_joint(ctx, args, &joint) : APSM_ERR_MEMORY;
    if (status == APSM_OK)
        status = (joint                        ? check_domains
                  : is_joint_folder(ctx, args) ? check_parts
                                               : check)(ctx, args, &t);
    json_decref(t.lines);
    if (status != APSM_OK) return status;
    if (t.problems == 0) cli_say(ui, "no problems found");
    return t.problems == 0 ? APSM_OK
                           : apsm_fail(ctx, APSM_ERR_GEOMETRY, "%zu problem%s", t.problems,
                                       t.problems == 1 ? "" : "s");
}

/* ---- verify ---- */

static void say_remark(void *ui, const char *line)
{
    cli_say(ui, "(%s)", line);
}

apsm_status apsm_cli_verify(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    apsm_verification result = { 0 };
    APSM_TRY(apsm_run_verify(ctx, args->out_dir, say_problem, say_remark, ui, &result));
    if (result.problems > 0)
        return apsm_fail(ctx, APSM_ERR_STATE, "%s: %zu disagreement%s", args->out_dir,
                         result.problems, result.problems == 1 ? "" : "s");
    cli_say(ui, "%zu files and %zu inputs agree with %s/manifest.json", result.outputs,
            result.inputs, args->out_dir);
    return APSM_OK;
}

/* ---- info ---- */

static void say_mesh(cli_ui *ui, const apsm_mesh *mesh, const apsm_mesh_defects *d)
{
    double lo[3], hi[3];
    apsm_mesh_bounds(mesh, lo, hi);
    cli_say(ui, "mesh: %zu vertices, %zu faces", mesh->nv, mesh->nf);
    cli_say(ui, "bounds: %.6g %.6g %.6g to %.6g %.6g %.6g", lo[0], lo[1], lo[2], hi[0], hi[1],
            hi[2]);
    cli_say(ui, "area %.6g, volume %.6g", apsm_mesh_area(mesh), apsm_mesh_volume(mesh));
    cli_say(ui,
            "components %zu, border edges %zu, non-manifold edges %zu and vertices %zu, "
            "degenerate faces %zu%s",
            d->components, d->border_edges, d->nonmanifold_edges, d->nonmanifold_vertices,
            d->degenerate_faces, apsm_mesh_is_closed_manifold(d) ? " (closed surface)" : "");
}

static apsm_status info_mesh(apsm_context *ctx, const char *path, cli_ui *ui)
{
    apsm_mesh mesh = { 0 };
    apsm_mesh_defects defects;
    APSM_TRY(apsm_read_mesh(ctx, path, &mesh));
    apsm_status status = apsm_mesh_inspect(&mesh, &defects);
    if (status == APSM_OK &&
        !(isfinite(apsm_mesh_area(&mesh)) && isfinite(apsm_mesh_volume(&mesh))))
        status = apsm_fail(ctx, APSM_ERR_NONFINITE,
                           "%s: its coordinates are so large that area and volume are no numbers; "
                           "is it damaged?",
                           path);
    if (status == APSM_OK) say_mesh(ui, &mesh, &defects);
    apsm_mesh_free(&mesh);
    return status;
}

/* What the file calls a label, or NULL. */
static const char *name_of(const apsm_volume *v, int32_t label)
{
    for (size_t k = 0; k < v->segments; k++)
        if (v->segment[k].label == label) return v->segment[k].name;
    return NULL;
}

/* Labels with their voxel counts; masks have few, and a map of hundreds is cut short. */
static void say_labels(cli_ui *ui, const apsm_volume *v)
{
    enum { MOST = 32 };
    int32_t label[MOST];
    size_t count[MOST], n = 0, others = 0;
    const size_t layers = v->layers ? v->layers : 1;
    for (size_t k = 0; v->label && k < layers * v->n[0] * v->n[1] * v->n[2]; k++) {
        size_t l = 0;
        if (v->label[k] == 0) continue;
        while (l < n && label[l] != v->label[k]) l++;
        if (l == n && n == MOST) {
            others++;
            continue;
        }
        if (l == n) label[n] = v->label[k], count[n++] = 0;
        count[l]++;
    }
    for (size_t l = 0; l < n; l++) {
        const char *const name = name_of(v, label[l]);
        cli_say(ui, "label %d: %zu voxels%s%s", (int)label[l], count[l], name ? ", " : "",
                name ? name : "");
    }
    if (v->value)
        cli_say(ui, "values are not whole numbers: a distance or a probability, no labels");
    if (others) cli_say(ui, "further labels: %zu voxels", others);
}

static apsm_status info_volume(apsm_context *ctx, const char *path, bool is_dicom, cli_ui *ui)
{
    apsm_volume v = { 0 };
    APSM_TRY(is_dicom ? apsm_read_dicom(ctx, path, &v) : apsm_read_volume(ctx, path, &v));
    cli_say(ui, "segmentation: %zu x %zu x %zu voxels of %.6g x %.6g x %.6g mm", v.n[0], v.n[1],
            v.n[2], v.spacing[0], v.spacing[1], v.spacing[2]);
    cli_say(ui, "origin (LPS): %.6g %.6g %.6g", v.origin[0] + 0.0, v.origin[1] + 0.0,
            v.origin[2] + 0.0); /* no negative zeros */
    say_labels(ui, &v);
    apsm_volume_free(&v);
    return APSM_OK;
}

static apsm_status info_particles(apsm_context *ctx, const char *path, cli_ui *ui)
{
    size_t I, n;
    double *P = NULL;
    APSM_TRY(apsm_points_read_cohort(ctx, path, &I, &n, &P));
    if (I)
        cli_say(ui, "particles: %zu on each of %zu shapes", n, I);
    else
        cli_say(ui, "particles: %zu", n);
    free(P);
    return APSM_OK;
}

/* Formats of meshes that hold points as well: points if there are no polygons. */
static apsm_status info_mesh_or_points(apsm_context *ctx, const char *path, cli_ui *ui)
{
    const bool may_be_points = apsm_points_extension(path) != NULL;
    return may_be_points && info_particles(ctx, path, ui) == APSM_OK ? APSM_OK
                                                                     : info_mesh(ctx, path, ui);
}

static void say_options(cli_ui *ui, const apsm_project *project)
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    const apsm_options defaults = apsm_options_defaults();
    for (size_t k = 0; k < n; k++) {
        char text[64];
        const char *value = apsm_project_get(project, "apsm", table[k].name);
        if (!value || apsm_options_get(&defaults, table[k].name, text) != APSM_OK) continue;
        if (strcmp(text, value) != 0) cli_say(ui, "%s = %s", table[k].name, value);
    }
}

/* As many as the first shape has: particles = auto finds another number than the option says. */
static void say_particles(apsm_context *ctx, const apsm_project *project, cli_ui *ui)
{
    size_t J = 0;
    double *P = NULL;
    const bool any = project->n > 0 && project->subjects[0].world_particles;
    char *path = any ? apsm_project_path(project, project->subjects[0].world_particles) : NULL;
    if (path && apsm_particles_read(ctx, path, &J, &P) == APSM_OK)
        cli_say(ui, "particles a shape: %zu%s", J,
                apsm_project_domains(project) > 1 ? " (of its first part)" : "");
    free(P);
    free(path);
}

/* Those of all shapes: files that are not there, or of another number than the first. */
static void say_wrong_particles(apsm_context *ctx, const apsm_project *project, cli_ui *ui)
{
    size_t absent = 0, others = 0, first = 0;
    for (size_t i = 0; i < project->n; i++) {
        size_t J = 0;
        double *P = NULL;
        const char *stored = project->subjects[i].world_particles;
        char *path = stored ? apsm_project_path(project, stored) : NULL;
        if (path && apsm_particles_read(ctx, path, &J, &P) != APSM_OK) absent++;
        if (first == 0) first = J;
        others += J > 0 && J != first;
        free(P);
        free(path);
    }
    if (absent > 0)
        cli_say(ui, "particle files of %zu shapes are absent or damaged; apsm check names them",
                absent);
    if (others > 0)
        cli_say(ui,
                "%zu shapes have another number of particles than the first: they do not belong "
                "together",
                others);
}

static apsm_status info_project(apsm_context *ctx, const char *path, cli_ui *ui)
{
    apsm_project project = { 0 };
    size_t groomed = 0, with_particles = 0, mirrored = 0;
    APSM_TRY(apsm_project_read(ctx, path, &project));
    for (size_t i = 0; i < project.n; i++) {
        groomed += project.subjects[i].groomed != NULL;
        with_particles += project.subjects[i].world_particles != NULL;
        mirrored += project.subjects[i].mirrored;
    }
    cli_say(ui, "project: %zu shapes, %zu groomed (%zu mirrored), %zu with particles", project.n,
            groomed, mirrored, with_particles);
    const char *template_name = apsm_project_get(&project, "apsm", "template_used");
    say_particles(ctx, &project, ui);
    say_wrong_particles(ctx, &project, ui);
    if (template_name) cli_say(ui, "template: %s", template_name);
    say_options(ui, &project);
    apsm_project_free(&project);
    return APSM_OK;
}

/* The first modes of an evaluated model. */
static apsm_status say_modes(apsm_context *ctx, const char *folder, cli_ui *ui)
{
    enum { SHOWN = 5 };
    char *path = apsm_path_join(folder, FOLDER_EVALUATION), line[256];
    json_t *root = NULL;
    apsm_status status = path ? APSM_OK : APSM_ERR_MEMORY;
    if (path && apsm_file_exists(path)) status = apsm_json_read(ctx, path, &root);
    const json_t *modes = json_object_get(root, "modes");
    for (size_t k = 0; k < SHOWN && mode_trust_line(modes, k, line, sizeof line); k++)
        cli_say(ui, "%s", line);
    json_decref(root);
    free(path);
    return status;
}

static apsm_status info_file(apsm_context *ctx, const char *path, cli_ui *ui)
{
    apsm_input_kind kind;
    if (apsm_is_project_file(path)) return info_project(ctx, path, ui);
    const bool is_shape = apsm_input_kind_of(path, &kind);
    if (!is_shape && apsm_points_extension(path)) return info_particles(ctx, path, ui);
    if (!is_shape && search_is_dicom(path)) return info_volume(ctx, path, true, ui);
    if (!is_shape)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: no model, project or particles, but %s", path,
                         foreign_remedy(path));
    return kind == APSM_INPUT_MESH ? info_mesh_or_points(ctx, path, ui)
                                   : info_volume(ctx, path, false, ui);
}

/* One of the JSON files of a model folder; NULL if it is not there yet. */
static apsm_status read_part(apsm_context *ctx, const char *folder, const char *name, json_t **root)
{
    char *path = apsm_path_join(folder, name);
    *root = NULL;
    const apsm_status status = !path                     ? APSM_ERR_MEMORY
                               : !apsm_file_exists(path) ? APSM_OK
                                                         : apsm_json_read(ctx, path, root);
    free(path);
    return status;
}

/* Of joints. */
static void say_spaces(cli_ui *ui, const json_t *spaces)
{
    static const char *const keys[] = { "rebuilt_closed", "rebuilt",      "made_closed",
                                        "made",           "apart_closed", "apart" };
    long long n[6];
    if (!json_is_object(spaces)) return;
    for (size_t k = 0; k < 6; k++) n[k] = json_integer_value(json_object_get(spaces, keys[k]));
    cli_say(
        ui,
        "joint spaces that close: %lld of %lld rebuilt ones, %lld of %lld of the mean and modes, "
        "%lld of %lld where poses or shapes vary alone",
        n[0], n[1], n[2], n[3], n[4], n[5]);
}

static void say_verdict(cli_ui *ui, const json_t *certificate)
{
    size_t k, told = 0;
    const json_t *shape;
    cli_say(ui, "verdict: %s (%lld of %lld shapes certified)",
            json_string_value(json_object_get(certificate, "verdict")),
            (long long)json_integer_value(json_object_get(certificate, "certified")),
            (long long)json_integer_value(json_object_get(certificate, "shapes")));
    const json_t *expected = json_object_get(certificate, "expected_lost");
    if (expected)
        cli_say(ui, "  expected with over a tenth of their particles lost: %.1f shapes",
                json_number_value(expected));
    json_array_foreach(json_object_get(certificate, "per_shape"), k, shape)
    {
        enum { MOST = 10 };
        const json_t *reason = json_array_get(json_object_get(shape, "reasons"), 0);
        if (!reason || told++ >= MOST) continue;
        cli_say(ui, "  %s: %s", json_string_value(json_object_get(shape, "name")),
                json_string_value(reason));
    }
    if (told > 10) cli_say(ui, "  and %zu more", told - 10);
    say_spaces(ui, json_object_get(certificate, "joint_spaces"));
}

static void say_figures(cli_ui *ui, const json_t *evaluation, const char *unit)
{
    const json_t *distance = json_object_get(evaluation, "surface_distance"),
                 *compact = json_object_get(evaluation, "compactness"), *share;
    size_t k, enough = 0;
    double first = 0;
    if (json_is_object(distance))
        cli_say(ui, "surface distance: mean %.4g%s, max %.4g%s (two-way)",
                json_number_value(json_object_get(distance, "mean")), unit,
                json_number_value(json_object_get(distance, "max")), unit);
    json_array_foreach(compact, k, share)
    {
        if (k == 0) first = json_number_value(share);
        if (enough == 0 && json_number_value(share) >= 0.95) enough = k + 1;
    }
    if (json_array_size(compact) > 0)
        cli_say(ui, "variance: %.1f %% in mode 1, 95 %% in %zu of %zu modes", 100 * first, enough,
                json_array_size(compact));
}

/* Another program may have written particles into the folder since.  (A joint's are in parts.) */
static bool say_belonging(apsm_context *ctx, const char *folder, cli_ui *ui)
{
    model_folder m;
    if (apsm_joint_is(ctx, folder)) return true;
    if (model_folder_read(ctx, folder, FOLDER_PARTICLES | FOLDER_EVALUATED, &m) != APSM_OK) {
        cli_say(ui, "model and particles do not belong together: %s", apsm_error_text(ctx));
        return false;
    }
    model_folder_free(&m);
    return true;
}

static void say_landmarks(cli_ui *ui, const json_t *landmarks, const char *unit)
{
    if (!json_is_object(landmarks)) return;
    const char *use = json_string_value(json_object_get(landmarks, "use"));
    cli_say(ui, "landmarks: mean distance %.4g%s over %lld (use: %s)",
            json_number_value(json_object_get(landmarks, "mean")), unit,
            (long long)json_integer_value(json_object_get(landmarks, "judged")), use ? use : "");
}

/* What evaluate has found, and by which version. */
static apsm_status info_results(apsm_context *ctx, const char *folder, cli_ui *ui)
{
    json_t *manifest = NULL, *certificate = NULL, *evaluation = NULL;
    char unit[16] = "";
    apsm_status status = read_part(ctx, folder, "manifest.json", &manifest);
    if (status == APSM_OK) status = read_part(ctx, folder, "certificate.json", &certificate);
    if (status == APSM_OK) status = read_part(ctx, folder, "evaluation.json", &evaluation);
    const char *said = manifest_unit(manifest);
    if (said) snprintf(unit, sizeof unit, " %s", said);
    if (status == APSM_OK && manifest)
        cli_say(ui, "made by: apsm %s", json_string_value(json_object_get(manifest, "apsm")));
    if (status == APSM_OK && evaluation) say_figures(ui, evaluation, unit);
    if (status == APSM_OK && evaluation)
        say_landmarks(ui, json_object_get(evaluation, "landmarks"), unit);
    const bool judged =
        status == APSM_OK && certificate && (!evaluation || say_belonging(ctx, folder, ui));
    if (judged) say_verdict(ui, certificate);
    if (status == APSM_OK && !judged) cli_say(ui, "verdict: not evaluated yet");
    json_decref(manifest);
    json_decref(certificate);
    json_decref(evaluation);
    return status;
}

/* A folder that is no model: its shapes, or the volume of a single series. */
static apsm_status info_inputs(apsm_context *ctx, const char *folder, cli_ui *ui)
{
    enum { SHOWN = 10 };
    apsm_input_list list;
    APSM_TRY(apsm_input_expand(ctx, 1, &folder, NULL, NULL, &list));
    apsm_status status = APSM_OK;
    if (list.n == 1 && list.cases[0].kind == APSM_INPUT_DICOM) {
        status = info_volume(ctx, list.cases[0].path, true, ui);
    } else {
        cli_say(ui, "no model, but %zu shape%s (`apsm check %s` looks at them)", list.n,
                list.n == 1 ? "" : "s", folder);
        for (size_t i = 0; i < list.n && i < SHOWN; i++) cli_say(ui, "  %s", list.cases[i].path);
        if (list.n > SHOWN) cli_say(ui, "  and %zu more", list.n - SHOWN);
    }
    apsm_input_list_free(&list);
    return status;
}

apsm_status apsm_cli_info(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    const char *path = args->inputs[0];
    if (!apsm_is_folder(path)) return info_file(ctx, path, ui);
    if (!is_model_folder(path)) return info_inputs(ctx, path, ui);
    char *project = apsm_path_join(path, FOLDER_PROJECT);
    if (!project) return APSM_ERR_MEMORY;
    apsm_status status = info_project(ctx, project, ui);
    if (status == APSM_OK) status = say_modes(ctx, path, ui);
    free(project);
    return status == APSM_OK ? info_results(ctx, path, ui) : status;
}
