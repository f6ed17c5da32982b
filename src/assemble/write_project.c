/* Particles of a joint, and its project: a row a subject, all parts of it. */
#include "assemble/writing.h"

#include <stdlib.h>
#include <string.h>

#include "files/constraints_file.h"
#include "files/particles_file.h"
#include "files/project_columns.h"
#include "folder/names.h"
#include "geometry/affine.h"
#include "run/fixed.h"

/* A part's file of the particles that a project has given, byte for byte. */
static apsm_status copy_particles(const writing *w, size_t i, size_t d, const char *path)
{
    enum { MOST_BYTES = 1 << 28 };
    const apsm_project *p = &w->c->folder[d].project;
    char *from = apsm_project_path(p, p->subjects[w->c->row[i * w->c->n + d]].local_particles);
    char *bytes = NULL;
    size_t size;
    apsm_writer *file = NULL;
    apsm_status status =
        from ? apsm_read_file(w->job->ctx, from, MOST_BYTES, &bytes, &size) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_writer_open(w->job->ctx, path, &file);
    if (status == APSM_OK) {
        apsm_writer_write(file, bytes, size);
        status = apsm_writer_commit(file);
    }
    free(bytes);
    free(from);
    return status;
}

static apsm_status write_particles(writing *w, size_t i, size_t d, const char *frame,
                                   const double *x, char **stored)
{
    const apsm_subject *of = &w->c->folder[d].project.subjects[w->c->row[i * w->c->n + d]];
    const bool given = strcmp(frame, "local") == 0 && fixed_is(of);
    char *path = writing_path(w, "particles/%s_%s_%s.particles", writing_subject(w, i),
                              writing_part(w, d), frame);
    if (!path) return APSM_ERR_MEMORY;
    const apsm_status status =
        given ? copy_particles(w, i, d, path)
              : apsm_particles_write(w->job->ctx, path, writing_particles(w, d), x);
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
    apsm_affine_apply(back, writing_particles(w, d), w->c->P + at, x);
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
        status = d == 0 ? set_first(s, M, text) : set_other(s, writing_part(w, d), M, text);
    for (int m = 0; m < 4; m++) free(text[m]);
    return status;
}

static apsm_status describe_subject(writing *w, size_t i, double *x, apsm_project *project)
{
    apsm_subject *s;
    APSM_TRY(apsm_project_add(project, writing_subject(w, i), NULL, &s));
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
        json_object_del(source.root, "data");
        if (json_object_update(project->root, source.root) != 0) status = APSM_ERR_MEMORY;
        json_decref(project->aside);
        project->aside = json_incref(source.aside);
    }
    apsm_project_free(&source);
    return status;
}

/* What ShapeWorks' own optimisation goes on with: "32 48", particles of every domain. */
static apsm_status set_optimize(const writing *w, apsm_project *project)
{
    enum { ROOM = 24 };
    char *text = calloc(w->c->n * ROOM + 1, 1), domains[ROOM];
    if (!text) return APSM_ERR_MEMORY;
    for (size_t d = 0, at = 0; d < w->c->n; d++)
        at += (size_t)snprintf(text + at, ROOM, "%s%zu", d ? " " : "", writing_particles(w, d));
    snprintf(domains, sizeof domains, "%zu", w->c->n);
    apsm_status status = apsm_project_set(project, "optimize", "number_of_particles", text);
    if (status == APSM_OK)
        status = apsm_project_set(project, "optimize", "domains_per_shape", domains);
    free(text);
    return status;
}

apsm_status joint_write_project(writing *w)
{
    apsm_project project = { 0 };
    char *path = writing_path(w, "%s", FOLDER_PROJECT);
    double *x = malloc(w->c->J * 3 * sizeof *x);
    apsm_status status =
        path && x ? apsm_project_init(w->job->ctx, w->job->settings->run.folder, &project)
                  : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_text_set(&project.domain, writing_part(w, 0));
    for (size_t i = 0; i < w->c->I && status == APSM_OK; i++)
        status = describe_subject(w, i, x, &project);
    if (status == APSM_OK) status = keep_source(w, &project);
    if (status == APSM_OK) status = set_optimize(w, &project);
    if (status == APSM_OK) status = apsm_project_write(w->job->ctx, path, &project);
    apsm_project_free(&project);
    free(x);
    free(path);
    return status;
}
