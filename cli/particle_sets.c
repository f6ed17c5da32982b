#include "particle_sets.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/particles.h"
#include "files/files.h"
#include "files/project.h"
#include "geometry/affine.h"
#include "input/input.h"

static apsm_status out_of_memory(apsm_context *ctx)
{
    return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory while reading particles");
}

static void set_free(cli_set *set)
{
    free(set->name);
    free(set->file);
    free(set->mesh);
    free(set->P);
}

/* Takes the set, also on failure; a NULL in it is a lack of memory. */
static apsm_status add_set(apsm_context *ctx, cli_sets *sets, cli_set set)
{
    const bool whole = set.name && set.file && set.P;
    if (whole && sets->n == sets->capacity) {
        const size_t capacity = 2 * sets->capacity + 16;
        cli_set *more = realloc(sets->sets, capacity * sizeof *more);
        if (more) sets->sets = more, sets->capacity = capacity;
    }
    if (whole && sets->n < sets->capacity) {
        sets->sets[sets->n++] = set;
        return APSM_OK;
    }
    set_free(&set);
    return out_of_memory(ctx);
}

/* ---- Files ---- */

/* Last component without the extension; room for `more` bytes behind it. */
static char *stem_of(const char *path, size_t more)
{
    const char *extension = apsm_points_extension(path), *name = apsm_path_last(path);
    const size_t length = strlen(name) - strlen(extension);
    char *stem = malloc(length + more + 1);
    if (stem) snprintf(stem, length + 1, "%s", name);
    return stem;
}

/* Shape i of I of a file: "hips_07", digits enough that names sort in order. */
static char *name_of_shape(const char *path, size_t i, size_t I)
{
    enum { MORE = 32 };
    char *name = stem_of(path, MORE);
    const int digits = snprintf(NULL, 0, "%zu", I);
    if (name) {
        const size_t length = strlen(name);
        snprintf(name + length, MORE, "_%0*zu", digits, i + 1);
    }
    return name;
}

static apsm_status add_file(apsm_context *ctx, cli_sets *sets, const char *path)
{
    size_t I, n;
    double *P;
    APSM_TRY(apsm_points_read_cohort(ctx, path, &I, &n, &P));
    if (I == 0)
        return add_set(ctx, sets,
                       (cli_set){ .name = stem_of(path, 0), .file = strdup(path), .n = n, .P = P });
    apsm_status status = APSM_OK;
    sets->cohort = true;
    for (size_t i = 0; status == APSM_OK && i < I; i++) {
        double *one = malloc(3 * n * sizeof *one);
        if (one) memcpy(one, P + 3 * n * i, 3 * n * sizeof *one);
        status = add_set(
            ctx, sets,
            (cli_set){ .name = name_of_shape(path, i, I), .file = strdup(path), .n = n, .P = one });
    }
    free(P);
    return status;
}

/* ---- Projects ---- */

static bool is_mesh_file(const char *path)
{
    apsm_input_kind kind;
    return path && apsm_input_kind_of(path, &kind) && kind == APSM_INPUT_MESH;
}

static apsm_status add_subject(apsm_context *ctx, cli_sets *sets, const char *path,
                               const apsm_project *project, const apsm_subject *subject)
{
    if (!subject->world_particles)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s: shape %s has no particles in the common frame; run apsm optimize",
                         path, subject->name);
    cli_set set = { .file = apsm_project_path(project, subject->world_particles) };
    if (!set.file) return out_of_memory(ctx);
    const apsm_status status = apsm_points_read(ctx, set.file, &set.n, &set.P);
    if (status != APSM_OK) {
        free(set.file);
        return status;
    }
    set.name = strdup(subject->name);
    if (is_mesh_file(subject->groomed)) set.mesh = apsm_project_path(project, subject->groomed);
    apsm_affine_multiply(subject->procrustes, subject->alignment, set.to_world);
    return add_set(ctx, sets, set);
}

/* The world particles of all shapes, in the order of the project. */
static apsm_status add_project(apsm_context *ctx, cli_sets *sets, const char *path)
{
    apsm_project project = { 0 };
    APSM_TRY(apsm_project_read(ctx, path, &project));
    if (apsm_project_domains(&project) > 1)
        apsm_log(ctx, APSM_LOG_WARNING, "%s: has %zu domains; only the particles of '%s' are taken",
                 path, apsm_project_domains(&project), project.domain);
    apsm_status status = APSM_OK;
    sets->cohort = true;
    if (project.n == 0) status = apsm_fail(ctx, APSM_ERR_STATE, "%s: holds no shapes", path);
    for (size_t i = 0; status == APSM_OK && i < project.n; i++)
        status = add_subject(ctx, sets, path, &project, &project.subjects[i]);
    if (status == APSM_OK)
        status = apsm_text_set(&sets->template_used,
                               apsm_project_get(&project, "apsm", "template_used"));
    apsm_project_free(&project);
    return status;
}

static apsm_status add_folder(apsm_context *ctx, cli_sets *sets, const char *folder)
{
    char *project = apsm_path_join(folder, "project.swproj");
    if (!project) return out_of_memory(ctx);
    const apsm_status status =
        apsm_file_exists(project)
            ? add_project(ctx, sets, project)
            : apsm_fail(ctx, APSM_ERR_STATE,
                        "%s: no project.swproj in this folder; give its files one by one", folder);
    free(project);
    return status;
}

apsm_status cli_sets_read(apsm_context *ctx, size_t n, const char *const *inputs, cli_sets *sets)
{
    *sets = (cli_sets){ 0 };
    for (size_t i = 0; i < n; i++) {
        if (apsm_is_project_file(inputs[i]))
            APSM_TRY(add_project(ctx, sets, inputs[i]));
        else if (apsm_is_folder(inputs[i]))
            APSM_TRY(add_folder(ctx, sets, inputs[i]));
        else
            APSM_TRY(add_file(ctx, sets, inputs[i]));
    }
    return APSM_OK;
}

void cli_sets_free(cli_sets *sets)
{
    for (size_t i = 0; i < sets->n; i++) set_free(&sets->sets[i]);
    free(sets->sets);
    free(sets->template_used);
    *sets = (cli_sets){ 0 };
}

/* ---- Frames ---- */

static bool ends_with(const char *text, const char *end)
{
    const size_t n = strlen(text), m = strlen(end);
    return n >= m && strcmp(text + n - m, end) == 0;
}

/* x_local.particles and so on, and the extensions of older versions. */
static cli_frames frame_of(const char *file)
{
    char *stem = stem_of(file, 0);
    const char *extension = apsm_points_extension(file);
    cli_frames frame = CLI_FRAMES_UNKNOWN;
    if (stem && (ends_with(stem, "_local") || strcmp(extension, ".lpts") == 0))
        frame = CLI_FRAMES_LOCAL;
    if (stem && (ends_with(stem, "_world") || strcmp(extension, ".wpts") == 0))
        frame = CLI_FRAMES_WORLD;
    free(stem);
    return frame;
}

cli_frames cli_sets_frames(const cli_sets *sets)
{
    cli_frames all = CLI_FRAMES_UNKNOWN;
    for (size_t i = 0; i < sets->n; i++) {
        const cli_frames frame = frame_of(sets->sets[i].file);
        if (frame == CLI_FRAMES_UNKNOWN || frame == all) continue;
        if (all != CLI_FRAMES_UNKNOWN) return CLI_FRAMES_MIXED;
        all = frame;
    }
    return all;
}

void cli_sets_warn(apsm_context *ctx, const cli_sets *sets)
{
    if (cli_sets_frames(sets) == CLI_FRAMES_MIXED)
        apsm_log(ctx, APSM_LOG_WARNING,
                 "local and world particles are among the inputs: they lie in different frames; "
                 "give *_world.particles, or *_local.particles, alone");
}
