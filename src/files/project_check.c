/* What is wrong with a project, one line a problem. */
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"
#include "files/io.h"
#include "files/particles_file.h"
#include "files/project_columns.h"

typedef struct checking {
    apsm_context *ctx;
    const apsm_project *project;
    apsm_problem_fn report;
    void *user;
    size_t problems;
    size_t J, J_of; /* particles of the first shape that has any, and which shape that is */
} checking;

static void tell(checking *c, const char *format, ...) APSM_PRINTF(2, 3);
static void tell(checking *c, const char *format, ...)
{
    char line[1024];
    va_list args;
    va_start(args, format);
    apsm_vprint(line, sizeof line, format, args);
    va_end(args);
    c->problems++;
    c->report(c->user, line);
}

/* The path of a stored text, which is NULL where there is none; not to be looked at is a problem.
 */
static char *path_of(checking *c, const apsm_subject *s, const char *what, const char *stored)
{
    char *path = apsm_project_path(c->project, stored);
    if (stored && !path) tell(c, "%s: out of memory for its %s", s->name, what);
    return path;
}

static void check_file(checking *c, const apsm_subject *s, const char *what, const char *stored)
{
    char *path = path_of(c, s, what, stored);
    if (path && apsm_is_folder(path) && what[0] != 'i') /* an input may be a DICOM folder */
        tell(c, "%s: its %s %s is a folder; give a file", s->name, what, path);
    else if (path && !apsm_is_folder(path) && !apsm_file_exists(path))
        tell(c, "%s: its %s %s does not exist; correct the path or remove the shape", s->name, what,
             path);
    free(path);
}

/* ShapeWorks' option particle_format = vtk; what is in them, convert and evaluate tell. */
static bool is_vtk(const char *stored)
{
    const size_t length = stored ? strlen(stored) : 0;
    return length > 4 &&
           (strcmp(stored + length - 4, ".vtk") == 0 || strcmp(stored + length - 4, ".vtp") == 0);
}

static void check_particles(checking *c, size_t i, const char *what, const char *stored)
{
    const apsm_subject *s = &c->project->subjects[i];
    if (is_vtk(stored)) {
        check_file(c, s, "particle file", stored);
        return;
    }
    char *path = path_of(c, s, what, stored);
    size_t n = 0;
    double *P = NULL;
    if (path && apsm_particles_read(c->ctx, path, &n, &P) != APSM_OK)
        tell(c, "%s: %s particles: %s", s->name, what, apsm_error_text(c->ctx));
    if (n > 0 && c->J == 0) {
        c->J = n;
        c->J_of = i;
    }
    if (n != 0 && n != c->J)
        tell(c, "%s: has %zu %s particles where %s has %zu; optimize them together", s->name, n,
             what, c->project->subjects[c->J_of].name, c->J);
    free(P);
    free(path);
}

/* Columns of a similarity are orthogonal and of one length. */
static void check_transform(checking *c, const apsm_subject *s, const char *what,
                            const double M[16])
{
    enum { X, Y, Z };
    double G[3][3];
    for (int a = X; a <= Z; a++)
        for (int b = X; b <= Z; b++)
            G[a][b] = M[a] * M[b] + M[4 + a] * M[4 + b] + M[8 + a] * M[8 + b];
    const double size = (G[X][X] + G[Y][Y] + G[Z][Z]) / 3, tolerance = 1e-4 * size;
    double worst = fmax(fabs(G[X][Y]), fmax(fabs(G[Y][Z]), fabs(G[Z][X])));
    for (int a = X; a <= Z; a++) worst = fmax(worst, fabs(G[a][a] - size));
    if (!(worst <= tolerance) || size == 0)
        tell(c, "%s: its %s is no rigid motion or similarity; align the shapes anew", s->name,
             what);
}

static void check_subject(checking *c, size_t i)
{
    const apsm_subject *s = &c->project->subjects[i];
    if (!s->shape && !s->groomed && !s->local_particles)
        tell(c, "%s: names no file; give it a shape_%s", s->name, c->project->domain);
    check_file(c, s, "groomed mesh", s->groomed);
    if (s->local_particles && !s->groomed && !s->shape)
        tell(c, "%s: has particles but no surface; surface distances cannot be measured", s->name);
    check_particles(c, i, "local", s->local_particles);
    check_particles(c, i, "world", s->world_particles);
    if (s->has_alignment) check_transform(c, s, "alignment", s->alignment);
    if (s->has_procrustes) check_transform(c, s, "procrustes transform", s->procrustes);
}

/* Particles of some shapes only are the trace of a step that did not end. */
static void check_whole(checking *c)
{
    size_t with = 0;
    for (size_t i = 0; i < c->project->n; i++)
        with += c->project->subjects[i].local_particles != NULL;
    if (with != 0 && with != c->project->n)
        tell(c, "only %zu of %zu shapes have particles; run the optimization again", with,
             c->project->n);
    if (c->project->n == 0) tell(c, "the project holds no shapes; add some to \"data\"");
}

/* One column of a row, and the file that it names. */
static void check_column(checking *c, const apsm_subject *s, const char *key, const char *stored)
{
    char *const text = strdup(stored);
    if (text) apsm_path_from_windows(text);
    char *path = text ? path_of(c, s, key, text) : NULL;
    if (!text) tell(c, "%s: out of memory for its %s", s->name, key);
    if (path && !apsm_is_folder(path) && !apsm_file_exists(path))
        tell(c, "%s: %s: %s does not exist; correct the path or remove it", s->name, key, path);
    free(path);
    free(text);
}

static bool is_made_by_a_run(const char *key)
{
    return strncmp(key, "groomed_", 8) == 0 || strncmp(key, "local_particles_", 16) == 0 ||
           strncmp(key, "world_particles_", 16) == 0;
}

size_t apsm_project_check_inputs(apsm_context *ctx, const apsm_project *project,
                                 apsm_problem_fn report, void *user)
{
    checking c = { .ctx = ctx, .project = project, .report = report, .user = user };
    for (size_t i = 0; i < project->n; i++) {
        const apsm_subject *s = &project->subjects[i];
        const char *key;
        json_t *value;
        json_object_foreach(s->row, key, value)
        {
            const char *stored = json_string_value(value);
            if (stored && *stored && apsm_project_is_path(key, stored) && !is_made_by_a_run(key))
                check_column(&c, s, key, stored);
        }
    }
    return c.problems;
}

size_t apsm_project_check(apsm_context *ctx, const apsm_project *project, apsm_problem_fn report,
                          void *user)
{
    checking c = { .ctx = ctx, .project = project, .report = report, .user = user };
    for (size_t i = 0; i < project->n; i++) check_subject(&c, i);
    check_whole(&c);
    return c.problems + apsm_project_check_inputs(ctx, project, report, user);
}
