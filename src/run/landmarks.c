#include "run/landmarks.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/landmark_pose.h"
#include "files/project_columns.h"
#include "geometry/vec3.h"
#include "initialize/anchors.h"
#include "run/source.h"

/* ---- where they come from ---- */

/* Names that the project's group landmarks gives to the domain's points, in their order. */
static apsm_status list_names(const apsm_project *p, size_t *n, const char ***names)
{
    const json_t *list = json_object_get(p->root, "landmarks");
    *n = 0;
    *names = calloc(json_array_size(list) + 1, sizeof **names);
    if (!*names) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < json_array_size(list); k++) {
        const json_t *one = json_array_get(list, k);
        const char *name = json_string_value(json_object_get(one, "name"));
        const char *domain = json_string_value(json_object_get(one, "domain"));
        if (name && *name && (!domain || strcmp(domain, p->domain) == 0)) (*names)[(*n)++] = name;
    }
    return APSM_OK;
}

static apsm_status read_column(apsm_run *run, const apsm_project *p, const char *path, size_t i)
{
    landmark_list list = { 0 };
    size_t n = 0;
    const char **names = NULL;
    apsm_status status = list_names(p, &n, &names);
    if (status == APSM_OK)
        status = landmark_is_file(path) ? landmark_list_read(run->ctx, path, &list)
                                        : landmark_list_read_plain(run->ctx, path, n, names, &list);
    if (status == APSM_OK) status = landmark_table_take(&run->landmarks, i, &list);
    landmark_list_free(&list);
    free(names);
    return status;
}

static bool is_needed(const apsm_run *run, const apsm_project *p)
{
    const apsm_options *o = &run->options;
    return o->landmarks.landmarks_use > APSM_LANDMARKS_JUDGE ||
           o->landmarks.align_by != APSM_ALIGN_BY_SURFACES ||
           (o->landmarks.landmarks_use == APSM_LANDMARKS_AUTO && p->root &&
            source_wants_landmarks(p));
}

/* Files that are not there: an error where they are needed, else said. */
static apsm_status tell_absent(apsm_run *run, const apsm_project *p, size_t absent,
                               const char *first)
{
    if (absent == 0) return APSM_OK;
    if (is_needed(run, p))
        return apsm_fail(run->ctx, APSM_ERR_IO,
                         "%s: %zu landmark files that the project names are not there; put them "
                         "back, or go on without by --landmarks-use judge --align-by surfaces",
                         first, absent);
    apsm_log(run->ctx, APSM_LOG_WARNING,
             "%zu landmark files that the project names are not there, the first is %s; their "
             "landmarks do not judge",
             absent, first);
    return APSM_OK;
}

/* The project's column landmarks_file_DOMAIN. */
static apsm_status read_columns(apsm_run *run, const groom_inputs *in, const apsm_project *p)
{
    char key[APSM_KEY_LENGTH];
    const char *first = NULL;
    size_t absent = 0;
    apsm_project_key(p, "landmarks_file_", key);
    for (size_t i = 0; i < in->list.n; i++) {
        const size_t s = apsm_project_find(p, in->list.cases[i].name);
        const char *stored = s < p->n ? apsm_subject_column(&p->subjects[s], key) : NULL;
        if (!stored || !*stored) continue;
        char *path = apsm_project_path(p, stored);
        if (!path) return APSM_ERR_MEMORY;
        const bool there = apsm_file_exists(path);
        const apsm_status status = there ? read_column(run, p, path, i) : APSM_OK;
        free(path);
        APSM_TRY(status);
        if (!there && absent++ == 0) first = stored;
    }
    return tell_absent(run, p, absent, first);
}

static apsm_status gather(apsm_run *run, const groom_inputs *in, const char *path)
{
    const size_t n = in->list.n;
    const char **names = calloc(n + 1, sizeof *names);
    if (!names) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < n; i++) names[i] = in->list.cases[i].name;
    apsm_status status = APSM_OK;
    if (*path) {
        landmark_table_free(&run->landmarks);
        status = landmark_table_gather(run->ctx, path, n, names, &run->landmarks);
    }
    if (status == APSM_OK && run->landmarks.L > 0)
        landmark_table_tell(run->ctx, &run->landmarks, names);
    free(names);
    return status;
}

apsm_status landmarks_read(apsm_run *run, const groom_inputs *in)
{
    const apsm_project *p = in->own_source ? &run->project : &in->source;
    landmark_table_free(&run->landmarks);
    landmark_table_begin(in->list.n, &run->landmarks);
    const bool ignored = source_ignores(run, "landmarks");
    if (p->root && !ignored) APSM_TRY(read_columns(run, in, p));
    APSM_TRY(gather(run, in, apsm_run_text(run, "landmarks")));
    run->use_landmarks = run->landmarks.L > 0 &&
                         run->options.landmarks.landmarks_use == APSM_LANDMARKS_AUTO && p->root &&
                         source_wants_landmarks(p) && !ignored;
    if (run->landmarks.L > 0 && landmarks_use(run) >= APSM_LANDMARKS_ANCHOR &&
        run->options.optimize.method == APSM_METHOD_PSM)
        return apsm_fail(
            run->ctx, APSM_ERR_UNSUPPORTED,
            "method psm draws particles to no landmarks; --landmarks-use judge or align");
    if (run->landmarks.L == 0 && !ignored && is_needed(run, p))
        return apsm_fail(run->ctx, APSM_ERR_ARG,
                         "landmarks are to be used (landmarks_use, align_by) and there are none: "
                         "give --landmarks DIR or FILE, or a project with a column landmarks_file");
    return APSM_OK;
}

void landmarks_mirror(apsm_run *run, const groom_inputs *in)
{
    for (size_t i = 0; i < in->list.n; i++)
        if (in->reflected[i]) landmark_table_move(&run->landmarks, i, in->reflection[i]);
}

/* How far x lies from the box. */
static double outside(const double x[3], const double lo[3], const double hi[3])
{
    double d = 0;
    for (size_t c = 0; c < 3; c++) d = hypot(d, fmax(fmax(lo[c] - x[c], x[c] - hi[c]), 0));
    return d;
}

void landmarks_tell_far(const apsm_run *run, const groom_inputs *in)
{
    const landmark_table *const t = &run->landmarks;
    double lo[3], hi[3], first = 0;
    size_t far = 0, shape = 0, mark = 0;
    for (size_t i = 0; i < in->list.n && t->L > 0; i++) {
        apsm_mesh_bounds(&in->mesh[i], lo, hi);
        const double size = sqrt(vec3_distance2(lo, hi));
        for (size_t l = 0; l < t->L; l++) {
            const double off =
                landmark_is_there(t, i, l) ? outside(landmark_at(t, i, l), lo, hi) : 0;
            if (off > size && far++ == 0) first = off, shape = i, mark = l;
        }
    }
    if (far > 0)
        apsm_log(run->ctx, APSM_LOG_WARNING,
                 "%zu landmark%s farther from the shape than it is long ('%s' is %.3g away from "
                 "%s): given in another frame, or another unit?",
                 far, far == 1 ? " lies" : "s lie", t->name[mark], first,
                 in->list.cases[shape].name);
}

/* ---- pose ---- */

apsm_status landmarks_align(apsm_run *run, const groom_inputs *in, size_t template_index, double *M)
{
    const apsm_options *o = &run->options;
    const bool alone = o->landmarks.landmarks_use == APSM_LANDMARKS_ALIGN;
    const int by = o->landmarks.align_by == APSM_ALIGN_BY_SURFACES && alone
                       ? APSM_ALIGN_BY_LANDMARKS
                       : o->landmarks.align_by;
    if (by == APSM_ALIGN_BY_SURFACES || o->align.align == APSM_ALIGN_NONE) return APSM_OK;
    const size_t n = in->list.n;
    size_t kept = 0;
    const landmark_pose_options po = { .scale = o->align.align == APSM_ALIGN_SIMILARITY,
                                       .surfaces = by == APSM_ALIGN_BY_BOTH,
                                       .template_index = template_index };
    const apsm_mesh **meshes = calloc(n + 1, sizeof *meshes);
    if (!meshes) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < n; i++) meshes[i] = &in->mesh[i];
    const apsm_status status = landmark_pose(run->ctx, &run->landmarks, meshes, &po, M, &kept);
    free(meshes);
    if (status == APSM_OK && kept > 0)
        apsm_log(run->ctx, APSM_LOG_WARNING,
                 "%zu of %zu shapes have fewer than three landmarks, or all in a line: they are "
                 "aligned by their surfaces",
                 kept, n);
    return status;
}

/* ---- the folder ---- */

apsm_status landmarks_write(apsm_run *run)
{
    if (run_is_in_memory(run)) return APSM_OK;
    if (run->landmarks.L == 0) return run_remove(run, run_path(run, FOLDER_LANDMARKS));
    const char **names = calloc(run->project.n + 1, sizeof *names);
    char *path = run_path(run, FOLDER_LANDMARKS);
    apsm_status status = names && path ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        for (size_t i = 0; i < run->project.n; i++) names[i] = run->project.subjects[i].name;
        status = landmark_table_write(run->ctx, path, names, &run->landmarks);
    }
    free(path);
    free(names);
    return status;
}

apsm_status landmarks_load(apsm_run *run)
{
    if (run->landmarks.I > 0 || run_is_in_memory(run)) return APSM_OK;
    char *path = run_path(run, FOLDER_LANDMARKS);
    if (!path) return APSM_ERR_MEMORY;
    landmark_table_begin(run->project.n, &run->landmarks);
    apsm_status status = APSM_OK;
    if (apsm_file_exists(path))
        status =
            landmark_table_read(run->ctx, path, run->project.n, run->names, &run->landmarks, NULL);
    free(path);
    run->use_landmarks = run->landmarks.L > 0 &&
                         run->options.landmarks.landmarks_use == APSM_LANDMARKS_AUTO &&
                         source_wants_landmarks(&run->project);
    return status;
}

int landmarks_use(const apsm_run *run)
{
    const int use = run->options.landmarks.landmarks_use;
    if (use != APSM_LANDMARKS_AUTO) return use;
    return run->use_landmarks ? APSM_LANDMARKS_ANCHOR : APSM_LANDMARKS_JUDGE;
}

apsm_status landmarks_in_world(const apsm_run *run, landmark_table *world)
{
    landmark_table_begin(run->landmarks.I, world);
    apsm_status status = APSM_OK;
    for (size_t i = 0; i < run->landmarks.I && status == APSM_OK; i++) {
        landmark_list list = { 0 };
        status = landmark_table_list(run->ctx, &run->landmarks, i, &list);
        if (status == APSM_OK) status = landmark_table_take(world, i, &list);
        landmark_list_free(&list);
    }
    for (size_t i = 0; i < world->I && status == APSM_OK; i++)
        landmark_table_move(world, i, run->transforms + 16 * i);
    if (status != APSM_OK) landmark_table_free(world);
    return status;
}

apsm_status landmarks_anchor(apsm_run *run)
{
    APSM_TRY(landmarks_load(run));
    const int use = landmarks_use(run);
    const bool hold = use == APSM_LANDMARKS_HOLD;
    if (run->landmarks.L == 0 || (use != APSM_LANDMARKS_ANCHOR && !hold)) return APSM_OK;
    landmark_table world;
    APSM_TRY(landmarks_in_world(run, &world));
    const apsm_status status = apsm_cohort_anchor(run->ctx, &run->cohort, &world, hold,
                                                  run->options.landmarks.landmark_weight);
    landmark_table_free(&world);
    return status;
}

/* ---- as judge ---- */

apsm_status landmarks_judge(apsm_run *run, size_t J, const double *P, landmark_errors *errors)
{
    landmark_table world;
    APSM_TRY(landmarks_load(run));
    if (run->landmarks.L == 0) return APSM_OK;
    APSM_TRY(landmarks_in_world(run, &world));
    const apsm_status status =
        landmark_errors_of(run->ctx, &world, run->cohort.template_index, J, P, errors);
    landmark_table_free(&world);
    return status;
}

const char *landmarks_use_word(const apsm_run *run)
{
    static const char *const words[] = { "judge", "judge", "align", "anchor", "hold" };
    const int use = landmarks_use(run);
    const bool only = use == APSM_LANDMARKS_JUDGE;
    return only && run->options.landmarks.align_by != APSM_ALIGN_BY_SURFACES ? "align" : words[use];
}

void landmarks_tell(const apsm_run *run, const landmark_errors *e)
{
    if (e->judged == 0) return;
    const bool judge = strcmp(landmarks_use_word(run), "judge") == 0;
    apsm_log(run->ctx, APSM_LOG_INFO, "landmarks: mean distance %.4g over %zu%s", e->mean,
             e->judged, judge ? "" : " (they had a part in the model: no independent judge)");
}
