/* Inputs to groomed meshes and transforms: groomed/NAME.ply and the project file. */
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "apsm/formats.h"
#include "files/constraints_file.h"
#include "files/project_columns.h"
#include "geometry/affine.h"
#include "model/template_choice.h"
#include "run/compare_inputs.h"
#include "run/crop_ends.h"
#include "run/features.h"
#include "run/fixed.h"
#include "run/groom_inputs.h"
#include "run/groomed.h"
#include "run/landmarks.h"
#include "run/regions.h"
#include "run/results.h"
#include "run/shapes.h"
#include "run/source.h"
#include "run/turned.h"
#include "session/guard.h"
#include "session/kept.h"
#include "session/manifest.h"
#include "session/notes.h"
#include "session/session.h"

/* Parts are aligned by themselves if their mean residual is less than this share of that in the
 * poses of the whole surfaces. */
static const double better_alone = 0.67;

/* Of the surfaces before constraints cut them. */
#define WHOLE "groomed/whole/%s.ply"

typedef struct groom_work {
    apsm_run *run;
    groom_inputs in;
    apsm_project own; /* what the run's project was, if its shapes are groomed anew */
    apsm_alignment alignment;
} groom_work;

static void tell_recalled(const groom_work *w)
{
    size_t recalled = 0;
    for (size_t i = 0; i < w->in.list.n; i++) recalled += w->in.recalled[i];
    if (recalled > 0)
        apsm_log(w->run->ctx, APSM_LOG_INFO, "%zu of %zu shapes were groomed before", recalled,
                 w->in.list.n);
}

static void warn(void *ctx, const char *line)
{
    apsm_log(ctx, APSM_LOG_WARNING, "%s", line);
}

/* Each is kept as soon as it is groomed; then so are the poses. */
static apsm_status read_inputs(groom_work *w)
{
    APSM_TRY(kept_compare_shapes(w->run, &w->in.list));
    APSM_TRY(kept_begin(w->run));
    kept_deal(w->run);
    APSM_TRY(kept_add_job(w->run, &w->in.list));
    APSM_TRY(groom_inputs_read(w->run, &w->in));
    APSM_TRY(groom_inputs_refuse_bad(w->run, &w->in));
    APSM_TRY(compare_inputs(&w->in, warn, w->run->ctx));
    tell_recalled(w);
    APSM_TRY(turned_find(w->run, &w->in));
    kept_pieces_of_inputs(w->run, &w->in.list, w->in.sha256, w->in.turn);
    return APSM_OK;
}

/* ---- the cohort ---- */

/* A transform that mirrors belongs into the groomed mesh: the common frame is reached by
 * rotation, and so the mesh is mirrored in its own frame instead. */
static apsm_status move_mirror_to_mesh(groom_work *w, size_t i)
{
    double *M = w->alignment.M + 16 * i, *sized = w->alignment.sized + 16 * i, inverse[16];
    if (apsm_affine_det(M) > 0) return APSM_OK;
    APSM_TRY(groom_inputs_reflect(w->run->ctx, &w->in, i));
    APSM_TRY(apsm_affine_invert(w->in.reflection[i], inverse));
    apsm_affine_multiply(M, inverse, M);
    apsm_affine_multiply(sized, inverse, sized);
    return APSM_OK;
}

/* A shape with more handles than another must not be the template: what it has too much of, all
 * would get. */
static void avoid_handles(groom_work *w)
{
    long least = LONG_MAX;
    for (size_t i = 0; i < w->in.list.n; i++)
        if (w->in.report[i].genus < least) least = w->in.report[i].genus;
    for (size_t i = 0; i < w->in.list.n; i++)
        if (w->in.report[i].genus > least) w->alignment.unfit[i] = true;
}

/* To the manifest. */
static apsm_status describe_grooming(const groom_work *w, json_t *notes)
{
    json_t *groomed = groomed_json(&w->in);
    if (!notes || !groomed || groomed_add_notes(&w->in, notes)) {
        json_decref(groomed);
        return APSM_ERR_MEMORY;
    }
    APSM_TRY(manifest_set_groomed(w->run, groomed));
    return manifest_set_notes(w->run, json_incref(notes));
}

/* Each shape to the places that the landmarks have on average, if asked to. */
static apsm_status align_by_landmarks(groom_work *w)
{
    landmarks_mirror(w->run, &w->in);
    landmarks_tell_far(w->run, &w->in);
    return landmarks_align(w->run, &w->in, w->alignment.template_index, w->alignment.M);
}

static double mean_residual(const apsm_alignment *a)
{
    double sum = 0.0;
    for (size_t i = 0; i < a->n; i++) sum += a->residual[i];
    return sum / (double)a->n;
}

/* Parts have the poses of the whole surfaces, which know more, moved to rest.  Whole surfaces that
 * do not say how they are turned (balls) are worse than the parts alone: these are searched for,
 * too, and taken if they fit clearly better. */
static apsm_status align_parts(groom_work *w, const apsm_mesh *const *meshes,
                               const char *const *names, const apsm_align_options *opt)
{
    apsm_context *ctx = w->run->ctx;
    const size_t n = w->in.list.n;
    apsm_alignment alone = { 0 };
    apsm_align_options ao = *opt;
    kept_pieces_of_parts(w->run, n, meshes);
    APSM_TRY(apsm_align_cropped(ctx, n, meshes, names, opt, &w->alignment));
    if (opt->align == APSM_ALIGN_NONE || n < 2) return APSM_OK;
    ao.template_index = w->alignment.template_index;
    ao.mirror_check = APSM_MIRROR_OFF;
    ao.borders = NULL;
    APSM_TRY(apsm_align_cohort(ctx, n, meshes, names, &ao, &alone));
    if (mean_residual(&alone) < better_alone * mean_residual(&w->alignment)) {
        const apsm_alignment whole = w->alignment;
        apsm_log(ctx, APSM_LOG_INFO,
                 "what the constraints leave says better than the whole "
                 "surfaces how shapes are turned, and is aligned by itself");
        w->alignment = alone;
        alone = whole;
    }
    apsm_alignment_free(&alone);
    return APSM_OK;
}

static apsm_status align(groom_work *w)
{
    apsm_run *run = w->run;
    const size_t n = w->in.list.n;
    groomed_cohort c = { 0 };
    bool cropped = false, cut = false;
    apsm_status status = groomed_align(run, &w->in, &c, &w->alignment);
    if (status == APSM_OK) fixed_trust(&w->in, &w->alignment);
    json_t *notes =
        status == APSM_OK ? notes_of_alignment(&w->alignment, c.names, &c.options) : NULL;
    for (size_t i = 0; i < n && status == APSM_OK; i++) status = move_mirror_to_mesh(w, i);
    if (status == APSM_OK) status = groom_cut_regions(run, &w->in, &w->alignment, &cut);
    if (status == APSM_OK && cut) status = align_parts(w, c.meshes, c.names, &c.options);
    if (status == APSM_OK) status = groom_crop_ends(run, &w->in, &w->alignment, &cropped);
    if (status == APSM_OK && cropped)
        status = apsm_align_cropped(run->ctx, n, c.meshes, c.names, &c.options, &w->alignment);
    if (status == APSM_OK) status = align_by_landmarks(w);
    if (status == APSM_OK) {
        avoid_handles(w);
        fixed_prefer(&w->in, w->alignment.unfit);
    }
    if (status == APSM_OK && c.options.template_index == APSM_TEMPLATE_AUTO)
        status = apsm_choose_template(run->ctx, n, c.meshes, w->alignment.M, w->alignment.residual,
                                      w->alignment.unfit, w->alignment.template_index,
                                      &w->alignment.template_index);
    if (status == APSM_OK) status = fixed_settle(run, &w->in, cropped, &w->alignment);
    if (status == APSM_OK) status = describe_grooming(w, notes);
    json_decref(notes);
    groomed_cohort_free(&c);
    return status;
}

/* ---- results to the folder ---- */

static apsm_status write_as(apsm_context *ctx, const groom_work *w, const char *format, size_t i,
                            const apsm_mesh *mesh)
{
    char *path = run_pathf(w->run, format, w->in.list.cases[i].name);
    const apsm_status status = path ? apsm_write_mesh(ctx, path, mesh) : APSM_ERR_MEMORY;
    free(path);
    return status;
}

static apsm_status write_mesh(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const groom_work *w = user;
    char *path = run_pathf(w->run, "groomed/%s.ply", w->in.list.cases[i].name);
    const apsm_status status =
        path ? features_write_mesh(ctx, w->run, &w->in, i, path) : APSM_ERR_MEMORY;
    free(path);
    APSM_TRY(status);
    return w->in.whole ? write_as(ctx, w, WHOLE, i, &w->in.whole[i]) : APSM_OK;
}

static apsm_status make_folder(const apsm_run *run, const char *name)
{
    char *folder = run_path(run, name);
    if (!folder) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_make_folder(run->ctx, folder);
    free(folder);
    return status;
}

static apsm_status describe_reflection(const groom_work *w, size_t i, apsm_subject *s)
{
    char text[16 * APSM_NUMBER_LENGTH];
    if (!w->in.reflected[i]) return apsm_subject_set_column(s, "reflection", NULL);
    apsm_transform_text(w->in.reflection[i], text);
    return apsm_subject_set_column(s, "reflection", text);
}

static apsm_status describe_subject(groom_work *w, size_t i)
{
    apsm_run *run = w->run;
    apsm_subject *s;
    const apsm_input_case *c = &w->in.list.cases[i];
    char groomed[1024];
    char *shape = run_is_in_memory(run) ? NULL : apsm_path_relative(run->folder, c->path);
    if (!shape && !run_is_in_memory(run)) return APSM_ERR_MEMORY;
    snprintf(groomed, sizeof groomed, "groomed/%s.ply", c->name);
    apsm_status status = apsm_project_add(&run->project, c->name, shape, &s);
    free(shape);
    const apsm_project *source = w->own.root ? &w->own : &w->in.source;
    if (status == APSM_OK && source->root) status = source_take_row(source, s);
    if (status == APSM_OK && !run_is_in_memory(run))
        status = apsm_constraints_store(run->ctx, &run->project, s);
    if (status != APSM_OK) return status;
    s->mirrored = w->in.reflected[i];
    s->has_alignment = s->has_procrustes = true; /* ShapeWorks expects both columns */
    memcpy(s->alignment, w->alignment.M + 16 * i, sizeof s->alignment);
    APSM_TRY(apsm_text_set(&s->groomed, groomed));
    APSM_TRY(fixed_mark(&w->in, i, s));
    if (w->in.notes[i]) APSM_TRY(apsm_subject_set_column(s, "input_notes", w->in.notes[i]));
    return describe_reflection(w, i, s);
}

static bool is_groomed(const groom_work *w, const char *name)
{
    for (size_t i = 0; i < w->in.list.n; i++)
        if (strcmp(w->in.list.cases[i].name, name) == 0) return true;
    return false;
}

/* What we wrote for shapes of an earlier model that this one does not have: left behind, they
 * would be taken for shapes of this one. */
static apsm_status remove_other_shapes(groom_work *w)
{
    static const char *const files[] = { "groomed/%s.ply",
                                         WHOLE,
                                         "fixed/%s_local.particles",
                                         "fixed/%s_world.particles",
                                         "particles/%s_local.particles",
                                         "particles/%s_world.particles",
                                         "particles/%s_original.particles",
                                         "meshes/%s_reconstructed.ply" };
    apsm_run *run = w->run;
    for (size_t i = 0; i < run->project.n; i++) {
        const char *name = run->project.subjects[i].name;
        if (!w->in.whole) APSM_TRY(run_remove(run, run_pathf(run, WHOLE, name)));
        for (size_t k = 0; k < sizeof files / sizeof files[0] && !is_groomed(w, name); k++)
            APSM_TRY(run_remove(run, run_pathf(run, files[k], name)));
    }
    return APSM_OK;
}

/* The run's own subjects, which are groomed anew, become those of w->own. */
static apsm_status move_own(groom_work *w)
{
    apsm_project *p = &w->run->project;
    w->own = (apsm_project){ .n = p->n, .capacity = p->capacity, .subjects = p->subjects };
    p->subjects = NULL;
    p->n = p->capacity = 0;
    w->own.root = json_incref(p->root);
    return apsm_text_set(&w->own.domain, p->domain);
}

/* The project's shapes are replaced; other groups of the file stay, or are those of the project
 * that the shapes come from. */
static apsm_status describe_project(groom_work *w)
{
    apsm_run *run = w->run;
    if (w->in.own_source) APSM_TRY(move_own(w));
    while (run->project.n > 0) apsm_project_remove(&run->project, run->project.n - 1);
    if (!w->in.own_source) {
        json_decref(run->project.aside);
        run->project.aside = NULL;
    }
    if (w->in.source.root) APSM_TRY(source_begin(run, &w->in.source));
    for (size_t i = 0; i < w->in.list.n; i++) APSM_TRY(describe_subject(w, i));
    return apsm_project_set(&run->project, "apsm", "template_used",
                            w->in.list.cases[w->alignment.template_index].name);
}

static apsm_status list_inputs(groom_work *w)
{
    const size_t n = w->in.list.n;
    const char **names = calloc(n, sizeof *names), **paths = calloc(n, sizeof *paths);
    apsm_status status = names && paths ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; i < n && status == APSM_OK; i++) {
        names[i] = w->in.list.cases[i].name;
        paths[i] = w->in.list.cases[i].path;
    }
    if (status == APSM_OK) status = manifest_set_inputs(w->run, n, names, paths, w->in.sha256);
    free(names);
    free(paths);
    return status;
}

/* The new meshes become the session's. */
static apsm_status hand_over(groom_work *w)
{
    apsm_run *run = w->run;
    const size_t n = w->in.list.n;
    const landmark_table landmarks = run->landmarks;
    run->landmarks = (landmark_table){ 0 };
    run_unload(run);
    run->landmarks = landmarks;
    run->names = calloc(n, sizeof *run->names);
    run->transforms = malloc(n * 16 * sizeof *run->transforms);
    if (!run->names || !run->transforms) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < n; i++) run->names[i] = run->project.subjects[i].name;
    memcpy(run->transforms, w->alignment.M, n * 16 * sizeof *run->transforms);
    run->mesh = w->in.mesh;
    run->mesh_count = n;
    run->meshes_stored = w->in.store != NULL;
    w->in.mesh = NULL;
    return APSM_OK;
}

/* What the cohort asked for (groom_inputs.c) becomes the model's: new shapes are groomed alike. */
static apsm_status settle_closing(groom_work *w)
{
    apsm_run *run = w->run;
    char text[64];
    if (w->in.options.closing == run->options.groom.closing) return APSM_OK;
    run->options.groom.closing = w->in.options.closing;
    APSM_TRY(apsm_options_get(&run->options, "closing", text));
    return apsm_project_set(&run->project, "apsm", "closing", text);
}

static apsm_status save(groom_work *w)
{
    apsm_run *run = w->run;
    APSM_TRY(settle_closing(w));
    if (run_is_in_memory(run)) {
        APSM_TRY(describe_project(w));
        return hand_over(w);
    }
    APSM_TRY(stage_start(run, "groom"));
    APSM_TRY(make_folder(run, "groomed"));
    if (w->in.whole) APSM_TRY(make_folder(run, "groomed/whole"));
    /* particles of the shapes before */
    APSM_TRY(run_remove(run, run_path(run, RUN_INITIAL)));
    APSM_TRY(run_remove(run, run_path(run, RUN_CHECKPOINT)));
    APSM_TRY(apsm_parallel_for(run->ctx, w->in.list.n, write_mesh, w, NULL));
    APSM_TRY(remove_other_shapes(w));
    APSM_TRY(fixed_write(run, &w->in, &w->alignment));
    APSM_TRY(describe_project(w));
    APSM_TRY(list_inputs(w));
    APSM_TRY(manifest_set_ignored(run, w->in.ignored));
    APSM_TRY(manifest_set_options(run));
    APSM_TRY(run_write_project(run));
    APSM_TRY(landmarks_write(run));
    return hand_over(w);
}

static void tell(const groom_work *w)
{
    size_t mirrored = 0;
    double sum = 0;
    for (size_t i = 0; i < w->in.list.n; i++) {
        mirrored += w->in.reflected[i];
        sum += w->alignment.residual[i];
    }
    apsm_log(w->run->ctx, APSM_LOG_INFO,
             "%zu shapes groomed, %zu of them mirrored; template %s; mean residual %.4g",
             w->in.list.n, mirrored, w->in.list.cases[w->alignment.template_index].name,
             w->in.list.n > 1 ? sum / (double)(w->in.list.n - 1) : 0.0);
    if (w->in.list.n == 1)
        apsm_log(w->run->ctx, APSM_LOG_WARNING,
                 "one shape has no variation: a model of it says nothing; give more shapes");
}

/* A first run that fails leaves nothing; one that is interrupted can go on. */
static apsm_status give_up(apsm_run *run, apsm_status why)
{
    char *line = strdup(apsm_error_text(run->ctx));
    const bool nothing = run->made_folders > 0 && !run->has_manifest && why != APSM_ERR_INTERRUPTED;
    if (nothing && kept_end(run) != APSM_OK && line) /* its own line is of no use */
        why = apsm_fail(run->ctx, why, "%s", line);
    free(line);
    return why;
}

apsm_status apsm_run_groom(apsm_run *run)
{
    if (!run) return APSM_ERR_ARG;
    APSM_TRY(manifest_refuse_joint(run));
    const stage_clock clock = stage_begin();
    groom_work w = { .run = run };
    APSM_TRY(guard_model(run));
    size_t template_index; /* a name that is none is told before the long part */
    run_forget_results(run);
    apsm_status status = groom_inputs_list(run, &w.in);
    if (status == APSM_OK) status = guard_files(run, "groom", &w.in.list);
    if (status == APSM_OK) status = groom_inputs_template(run, &w.in, &template_index);
    if (status == APSM_OK) status = landmarks_read(run, &w.in);
    if (status == APSM_OK) status = features_check(run, &w.in);
    if (status == APSM_OK) status = run_open_store(run, &w.in.store);
    if (status == APSM_OK) status = read_inputs(&w);
    if (status == APSM_OK) status = align(&w);
    status = kept_end_share(run, status);
    if (!run->helps) {
        if (status == APSM_OK) status = save(&w);
        if (status == APSM_OK) status = stage_end(run, "groom", &clock);
        if (status == APSM_OK) status = kept_end(run);
        if (status == APSM_OK) tell(&w);
        if (status != APSM_OK) status = give_up(run, status);
    }
    apsm_alignment_free(&w.alignment);
    groom_inputs_free(&w.in);
    apsm_project_free(&w.own);
    return status;
}
