/* A finished model loses shapes, or gains some that are fitted to it; what is there stays as it is,
 * byte for byte, and mean, modes, figures and report are made anew. */
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/fit.h"
#include "apsm/formats.h"
#include "files/project_columns.h"
#include "geometry/affine.h"
#include "run/features.h"
#include "run/groom_inputs.h"
#include "run/groomed.h"
#include "run/particles.h"
#include "run/shapes.h"
#include "session/guard.h"
#include "session/manifest.h"
#include "session/outputs.h"

enum { LEAST_SHAPES = 3 };

/* The manifest knows nothing of the file any more; it is removed with all that are gone. */
static apsm_status drop_file(apsm_run *run, json_t *gone, const char *name)
{
    json_object_del(json_object_get(run->manifest, "outputs"), name);
    return json_array_append_new(gone, json_string(name)) ? APSM_ERR_MEMORY : APSM_OK;
}

/* Checkpoints are of another set of shapes from now on. */
static apsm_status drop_states(apsm_run *run, json_t *gone)
{
    APSM_TRY(drop_file(run, gone, RUN_INITIAL));
    return drop_file(run, gone, RUN_CHECKPOINT);
}

/* Project and manifest come first: who is stopped in between leaves files that are one's own, but
 * none that is missed. */
static apsm_status settle(apsm_run *run, const json_t *gone)
{
    size_t k;
    const json_t *name;
    APSM_TRY(run_write_project(run));
    APSM_TRY(manifest_write(run));
    json_array_foreach(gone, k, name)
    {
        APSM_TRY(run_remove(run, run_path(run, json_string_value(name))));
    }
    return APSM_OK;
}

static apsm_status evaluate_and_report(apsm_run *run)
{
    run_unload(run);
    APSM_TRY(apsm_run_evaluate(run));
    return apsm_run_report(run);
}

static apsm_status require_model(apsm_run *run)
{
    if (run_is_in_memory(run))
        return apsm_fail(run->ctx, APSM_ERR_STATE, "a job without a folder cannot grow");
    APSM_TRY(manifest_refuse_joint(run));
    if (!stage_is_done(run, "evaluate"))
        return apsm_fail(run->ctx, APSM_ERR_STATE,
                         "%s: is no finished model; run `apsm evaluate %s`", run->folder,
                         run->folder);
    APSM_TRY(manifest_check_seal(run));
    APSM_TRY(guard_files(run, "evaluate", NULL));
    return guard_files(run, "report", NULL);
}

/* ---- exclude ---- */

static apsm_status check_excluded(apsm_run *run, size_t n, const char *const *names)
{
    const size_t t = run_template_index(run);
    for (size_t k = 0; k < n; k++) {
        const size_t i = apsm_project_find(&run->project, names[k]);
        if (i == run->project.n)
            return apsm_fail(run->ctx, APSM_ERR_ARG,
                             "%s: has no shape '%s'; the first is called '%s'", run->folder,
                             names[k], run->project.subjects[0].name);
        if (i == t)
            return apsm_fail(run->ctx, APSM_ERR_ARG,
                             "%s: '%s' is the template, from which all others take their "
                             "particles; make a new model without it (`apsm run --exclude`)",
                             run->folder, names[k]);
        for (size_t l = 0; l < k; l++)
            if (strcmp(names[k], names[l]) == 0)
                return apsm_fail(run->ctx, APSM_ERR_ARG, "'%s' is given twice", names[k]);
    }
    if (run->project.n < n + LEAST_SHAPES)
        return apsm_fail(run->ctx, APSM_ERR_ARG,
                         "%s: without them %zu shapes are left; %d make a model", run->folder,
                         run->project.n - n, LEAST_SHAPES);
    return APSM_OK;
}

static void forget_entry(json_t *list, const char *key, const char *name)
{
    for (size_t k = json_array_size(list); k-- > 0;) {
        const char *of = json_string_value(json_object_get(json_array_get(list, k), key));
        if (of && strcmp(of, name) == 0) json_array_remove(list, k);
    }
}

/* The shape's files and what the manifest says of it. */
static apsm_status drop_shape(apsm_run *run, json_t *gone, const char *name)
{
    static const char *const files[] = { "groomed/%s.ply",
                                         "fixed/%s_local.particles",
                                         "fixed/%s_world.particles",
                                         "particles/%s_local.particles",
                                         "particles/%s_world.particles",
                                         "particles/%s_original.particles",
                                         "meshes/%s_reconstructed.ply" };
    char path[1024];
    for (size_t k = 0; k < sizeof files / sizeof files[0]; k++) {
        const char *format = files[k], *hole = strstr(format, "%s");
        snprintf(path, sizeof path, "%.*s%s%s", (int)(hole - format), format, name, hole + 2);
        if (json_object_get(json_object_get(run->manifest, "outputs"), path))
            APSM_TRY(drop_file(run, gone, path));
    }
    forget_entry(json_object_get(run->manifest, "inputs"), "name", name);
    forget_entry(json_object_get(run->manifest, "groomed"), "name", name);
    forget_entry(json_object_get(run->manifest, "notes"), "shape", name);
    return APSM_OK;
}

static apsm_status drop_shapes(apsm_run *run, json_t *gone, size_t n, const char *const *names)
{
    APSM_TRY(drop_states(run, gone));
    for (size_t k = 0; k < n; k++) {
        APSM_TRY(drop_shape(run, gone, names[k]));
        apsm_project_remove(&run->project, apsm_project_find(&run->project, names[k]));
    }
    return settle(run, gone);
}

apsm_status apsm_run_exclude(apsm_run *run, size_t n, const char *const *names)
{
    APSM_TRY(require_model(run));
    APSM_TRY(check_excluded(run, n, names));
    APSM_TRY(stage_start(run, "evaluate"));
    json_t *gone = json_array();
    const apsm_status status = drop_shapes(run, gone, n, names);
    json_decref(gone);
    return status == APSM_OK ? evaluate_and_report(run) : status;
}

/* ---- add ---- */

typedef struct adding {
    apsm_run *run;
    apsm_fit_model *model;
    groom_inputs in;
    apsm_fit *fit; /* in.list.n */
} adding;

static apsm_status check_added(const adding *a)
{
    const apsm_run *run = a->run;
    for (size_t i = 0; i < a->in.list.n; i++)
        if (apsm_project_find(&run->project, a->in.list.cases[i].name) < run->project.n)
            return apsm_fail(run->ctx, APSM_ERR_ARG,
                             "%s: has a shape '%s' already; rename the new one, or exclude the old",
                             run->folder, a->in.list.cases[i].name);
    return APSM_OK;
}

/* What was said of the new files (their sides, labels) is not said of the model's: its options are
 * those of its project again. */
static apsm_status restore_options(apsm_run *run)
{
    apsm_project stored = { 0 };
    char *path = run_path(run, RUN_PROJECT);
    apsm_status status = path ? apsm_project_read(run->ctx, path, &stored) : APSM_ERR_MEMORY;
    const size_t n = status == APSM_OK ? apsm_project_count(&stored, "apsm") : 0;
    if (status == APSM_OK) apsm_project_clear(&run->project, "apsm");
    for (size_t k = 0; k < n && status == APSM_OK; k++) {
        const char *key, *value;
        apsm_project_pair(&stored, "apsm", k, &key, &value);
        status = apsm_project_set(&run->project, "apsm", key, value);
    }
    apsm_project_free(&stored);
    free(path);
    return status;
}

/* The hand is that of the model unless the run was told to look (mirror_check = fix). */
static apsm_status fit_one(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    adding *a = user;
    apsm_fit_options o = apsm_fit_defaults();
    const char *name = a->in.list.cases[i].name;
    if (a->in.status[i] != APSM_OK)
        return apsm_fail(ctx, a->in.status[i], "%s", a->in.problem[i] ? a->in.problem[i] : name);
    if (a->run->options.align.mirror_check != APSM_MIRROR_FIX) o.hand = APSM_HAND_SAME;
    o.extent = APSM_EXTENT_WHOLE;
    APSM_TRY(apsm_fit_surface(ctx, a->model, name, &a->in.mesh[i], &o, &a->fit[i]));
    if (a->fit[i].verdict == APSM_FIT_REFUSED)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY, "%s: is not added: %s", name, a->fit[i].reason);
    return APSM_OK;
}

static apsm_status fit_all(adding *a)
{
    APSM_TRY(groom_inputs_list(a->run, &a->in));
    APSM_TRY(restore_options(a->run));
    APSM_TRY(check_added(a));
    APSM_TRY(features_check_added(a->run, &a->in));
    APSM_TRY(guard_files(a->run, "evaluate", &a->in.list));
    APSM_TRY(apsm_fit_model_load(a->run->ctx, a->run->folder, &a->model));
    APSM_TRY(groom_inputs_read(a->run, &a->in));
    a->fit = calloc(a->in.list.n, sizeof *a->fit);
    if (!a->fit) return APSM_ERR_MEMORY;
    return apsm_parallel_for(a->run->ctx, a->in.list.n, fit_one, a, "fit");
}

/* Of a shape that was longer than the model's, what was fitted is enrolled. */
static apsm_status settle_extent(adding *a, size_t i)
{
    apsm_fit *fit = &a->fit[i];
    if (!(fit->cropped_share > 0)) return APSM_OK;
    a->in.cropped[i] = fit->cropped_share;
    apsm_mesh_free(&a->in.mesh[i]);
    a->in.mesh[i] = fit->cropped;
    fit->cropped = (apsm_mesh){ 0 };
    return APSM_OK;
}

/* Mirrored by the fit: the groomed mesh is the mirror image, as in a run. */
static apsm_status settle_hand(adding *a, size_t i)
{
    apsm_fit *fit = &a->fit[i];
    double inverse[16];
    if (!fit->mirrored) return APSM_OK;
    APSM_TRY(groom_inputs_reflect(a->run->ctx, &a->in, i));
    APSM_TRY(apsm_affine_invert(a->in.reflection[i], inverse));
    apsm_affine_multiply(fit->M, inverse, fit->M);
    return APSM_OK;
}

static apsm_status write_groomed(adding *a, size_t i)
{
    char *path = run_pathf(a->run, "groomed/%s.ply", a->in.list.cases[i].name);
    const apsm_status status =
        path ? features_write_mesh(a->run->ctx, a->run, &a->in, i, path) : APSM_ERR_MEMORY;
    free(path);
    return status;
}

static apsm_status describe_reflection(const adding *a, size_t i, apsm_subject *s)
{
    char text[16 * APSM_NUMBER_LENGTH];
    if (!a->in.reflected[i]) return APSM_OK;
    apsm_transform_text(a->in.reflection[i], text);
    return apsm_subject_set_column(s, "reflection", text);
}

static apsm_status describe_subject(adding *a, size_t i)
{
    apsm_run *run = a->run;
    apsm_subject *s;
    const apsm_input_case *c = &a->in.list.cases[i];
    char groomed[1024], *shape = apsm_path_relative(run->folder, c->path);
    if (!shape) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_project_add(&run->project, c->name, shape, &s);
    free(shape);
    APSM_TRY(status);
    snprintf(groomed, sizeof groomed, "groomed/%s.ply", c->name);
    s->mirrored = a->in.reflected[i];
    s->has_alignment = s->has_procrustes = true;
    memcpy(s->alignment, a->fit[i].M, sizeof s->alignment);
    APSM_TRY(apsm_text_set(&s->groomed, groomed));
    return describe_reflection(a, i, s);
}

/* New shape i is one of the model's, or its fit is doubtful. */
static int note_doubts(const adding *a, size_t i, const json_t *inputs, json_t *notes)
{
    size_t k;
    const json_t *input;
    const char *name = a->in.list.cases[i].name;
    int failed = 0;
    json_array_foreach(inputs, k, input)
    {
        const char *sha256 = json_string_value(json_object_get(input, "sha256"));
        const char *own = json_string_value(json_object_get(input, "name"));
        if (!sha256 || !own || strcmp(sha256, a->in.sha256[i]) != 0) continue;
        apsm_log(a->run->ctx, APSM_LOG_WARNING,
                 "%s: the same file as %s, byte for byte; a shape twice?", name, own);
        failed |= groomed_note_same(notes, name, own);
    }
    if (a->fit[i].verdict != APSM_FIT_REVIEW) return failed;
    apsm_log(a->run->ctx, APSM_LOG_WARNING, "%s: its fit needs review: %s", name, a->fit[i].reason);
    return failed | json_array_append_new(
                        notes, json_pack("{s:s, s:s, s:s+}", "shape", name, "aspect", "input",
                                         "text", "its fit needs review: ", a->fit[i].reason));
}

/* What is said of the new shapes, behind what is said of the others. */
static apsm_status describe_doubts(adding *a)
{
    json_t *notes = json_object_get(a->run->manifest, "notes");
    const json_t *inputs = json_object_get(a->run->manifest, "inputs");
    if (!notes) {
        APSM_TRY(manifest_set_notes(a->run, json_array()));
        notes = json_object_get(a->run->manifest, "notes");
    }
    if (!json_is_array(notes) || groomed_add_notes(&a->in, notes)) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < a->in.list.n; i++)
        if (note_doubts(a, i, inputs, notes)) return APSM_ERR_MEMORY;
    return APSM_OK;
}

/* Inputs and grooming of the new shapes, behind those of the others. */
static apsm_status describe_inputs(adding *a)
{
    json_t *inputs = json_object_get(a->run->manifest, "inputs");
    json_t *groomed = json_object_get(a->run->manifest, "groomed"), *more = groomed_json(&a->in);
    int failed = !json_is_array(inputs) || !more;
    for (size_t i = 0; i < a->in.list.n && !failed; i++) {
        const apsm_input_case *c = &a->in.list.cases[i];
        long long bytes = 0;
        if (!apsm_is_folder(c->path)) APSM_TRY(apsm_file_size(a->run->ctx, c->path, &bytes));
        failed = json_array_append_new(
            inputs, json_pack("{s:s, s:s, s:I, s:s}", "name", c->name, "path", c->path, "bytes",
                              (json_int_t)bytes, "sha256", a->in.sha256[i]));
    }
    if (!failed && json_is_array(groomed)) failed = json_array_extend(groomed, more);
    json_decref(more);
    return failed ? APSM_ERR_MEMORY : APSM_OK;
}

/* Particles of the new shapes, whose subjects are the project's last. */
static apsm_status write_new_particles(adding *a, size_t first)
{
    const size_t J = apsm_fit_model_particles(a->model);
    for (size_t i = 0; i < a->in.list.n; i++)
        APSM_TRY(run_write_particles_of(a->run, first + i, J, a->fit[i].world));
    return APSM_OK;
}

static apsm_status record_files(const adding *a, size_t i)
{
    apsm_run *run = a->run;
    const apsm_subject *s = &run->project.subjects[run->project.n - a->in.list.n + i];
    APSM_TRY(outputs_add(run, "groom", s->groomed));
    APSM_TRY(outputs_add(run, "optimize", s->local_particles));
    APSM_TRY(outputs_add(run, "optimize", s->world_particles));
    if (!run->options.writing.original_frame) return APSM_OK;
    char path[1024];
    snprintf(path, sizeof path, "particles/%s_original.particles", s->name);
    return outputs_add(run, "optimize", path);
}

static apsm_status enrol(adding *a)
{
    apsm_run *run = a->run;
    const size_t first = run->project.n;
    for (size_t i = 0; i < a->in.list.n; i++) {
        APSM_TRY(settle_extent(a, i));
        APSM_TRY(settle_hand(a, i));
    }
    APSM_TRY(stage_start(run, "evaluate"));
    for (size_t i = 0; i < a->in.list.n; i++) {
        APSM_TRY(write_groomed(a, i));
        APSM_TRY(describe_subject(a, i));
    }
    APSM_TRY(write_new_particles(a, first));
    APSM_TRY(describe_doubts(a));
    APSM_TRY(describe_inputs(a));
    for (size_t i = 0; i < a->in.list.n; i++) APSM_TRY(record_files(a, i));
    json_t *gone = json_array();
    apsm_status status = drop_states(run, gone);
    if (status == APSM_OK) status = settle(run, gone);
    json_decref(gone);
    return status == APSM_OK ? evaluate_and_report(run) : status;
}

/* New shapes come whole, and nobody says what of them counts. */
static apsm_status refuse_regions(const apsm_run *run)
{
    char *whole = run_path(run, "groomed/whole");
    if (!whole) return APSM_ERR_MEMORY;
    const bool is = apsm_is_folder(whole);
    free(whole);
    if (!is) return APSM_OK;
    return apsm_fail(
        run->ctx, APSM_ERR_UNSUPPORTED,
        "%s: is a model of what constraints leave of the shapes; to add some, give all "
        "shapes with their constraints to `apsm run`",
        run->folder);
}

apsm_status apsm_run_add(apsm_run *run)
{
    adding a = { .run = run };
    APSM_TRY(require_model(run));
    APSM_TRY(refuse_regions(run));
    if (run->n_inputs == 0)
        return apsm_fail(run->ctx, APSM_ERR_ARG, "no shapes to add: name files or folders");
    apsm_status status = fit_all(&a);
    if (status == APSM_OK) status = enrol(&a);
    for (size_t i = 0; a.fit && i < a.in.list.n; i++) apsm_fit_free(&a.fit[i]);
    free(a.fit);
    apsm_fit_model_free(a.model);
    groom_inputs_free(&a.in);
    return status;
}
