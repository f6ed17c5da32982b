/* convert: particle sets from one format to another.  Everything is read before anything is
 * written, so that a damaged input leaves nothing behind. */
#define _DEFAULT_SOURCE /* strcasecmp, stat */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "apsm/files.h"
#include "apsm/points_file.h"
#include "apsm/project.h"
#include "verbs.h"

typedef struct particle_set {
    char *name; /* of the file to write, without extension; owned */
    size_t n;
    double *P; /* n x 3, owned */
} particle_set;

typedef struct conversion {
    apsm_context *ctx;
    const cli_args *args;
    size_t n, capacity;
    particle_set *sets;
    bool cohort; /* an input stands for a cohort, however many shapes it has */
} conversion;

static apsm_status out_of_memory(const conversion *c)
{
    return apsm_fail(c->ctx, APSM_ERR_MEMORY, "out of memory while converting particles");
}

/* ---- Inputs ---- */

/* Takes name and P, also on failure; NULL for one of them is a lack of memory. */
static apsm_status add_set(conversion *c, char *name, size_t n, double *P)
{
    if (name && P && c->n == c->capacity) {
        const size_t capacity = 2 * c->capacity + 16;
        particle_set *sets = realloc(c->sets, capacity * sizeof *sets);
        if (sets) c->sets = sets, c->capacity = capacity;
    }
    if (name && P && c->n < c->capacity) {
        c->sets[c->n++] = (particle_set){ name, n, P };
        return APSM_OK;
    }
    free(name);
    free(P);
    return out_of_memory(c);
}

/* Last component without the extension; room for `more` bytes behind it. */
static char *stem_of(const char *path, size_t more)
{
    const char *slash = strrchr(path, '/'), *extension = apsm_points_extension(path);
    const char *name = slash ? slash + 1 : path;
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

static apsm_status add_file(conversion *c, const char *path)
{
    size_t I, n;
    double *P;
    APSM_TRY(apsm_points_read_cohort(c->ctx, path, &I, &n, &P));
    if (I == 0) return add_set(c, stem_of(path, 0), n, P);
    apsm_status status = APSM_OK;
    c->cohort = true;
    for (size_t i = 0; status == APSM_OK && i < I; i++) {
        double *one = malloc(3 * n * sizeof *one);
        if (one) memcpy(one, P + 3 * n * i, 3 * n * sizeof *one);
        status = add_set(c, name_of_shape(path, i, I), n, one);
    }
    free(P);
    return status;
}

static apsm_status add_subject(conversion *c, const char *path, const apsm_project *project,
                               const apsm_subject *subject)
{
    size_t n;
    double *P;
    if (!subject->world_particles)
        return apsm_fail(c->ctx, APSM_ERR_STATE,
                         "%s: shape %s has no particles in the common frame; run apsm optimize",
                         path, subject->name);
    char *file = apsm_project_path(project, subject->world_particles);
    if (!file) return out_of_memory(c);
    const apsm_status status = apsm_points_read(c->ctx, file, &n, &P);
    free(file);
    return status == APSM_OK ? add_set(c, strdup(subject->name), n, P) : status;
}

/* The world particles of all shapes, in the order of the project. */
static apsm_status add_project(conversion *c, const char *path)
{
    apsm_project project = { 0 };
    APSM_TRY(apsm_project_read(c->ctx, path, &project));
    apsm_status status = APSM_OK;
    c->cohort = true;
    for (size_t i = 0; status == APSM_OK && i < project.n; i++)
        status = add_subject(c, path, &project, &project.subjects[i]);
    apsm_project_free(&project);
    return status;
}

static apsm_status add_input(conversion *c, const char *input)
{
    const size_t length = strlen(input);
    if (length > 7 && strcmp(input + length - 7, ".swproj") == 0) return add_project(c, input);
    if (!apsm_is_folder(input)) return add_file(c, input);
    char *project = apsm_path_join(input, "project.swproj");
    if (!project) return out_of_memory(c);
    const apsm_status status = apsm_file_exists(project)
                                   ? add_project(c, project)
                                   : apsm_fail(c->ctx, APSM_ERR_STATE,
                                               "%s: no project.swproj in this folder; give its "
                                               "files one by one",
                                               input);
    free(project);
    return status;
}

/* ---- Output ---- */

/* Whether writing path would replace one of the inputs. */
static bool is_input(const conversion *c, const char *path)
{
    struct stat out, in;
    if (stat(path, &out) != 0) return false;
    for (size_t i = 0; i < c->args->n_inputs; i++)
        if (stat(c->args->inputs[i], &in) == 0 && in.st_dev == out.st_dev &&
            in.st_ino == out.st_ino)
            return true;
    return false;
}

static apsm_status refuse_input(const conversion *c, const char *path)
{
    if (!is_input(c, path)) return APSM_OK;
    return apsm_fail(c->ctx, APSM_ERR_ARG,
                     "%s is an input and would be replaced; give another output", path);
}

static apsm_status write_cohort(const conversion *c, const char *path)
{
    const size_t n = c->sets[0].n;
    for (size_t i = 1; i < c->n; i++)
        if (c->sets[i].n != n)
            return apsm_fail(c->ctx, APSM_ERR_FORMAT,
                             "%s has %zu particles and %s has %zu; one array needs the same number",
                             c->sets[0].name, n, c->sets[i].name, c->sets[i].n);
    double *P = malloc(c->n * n * 3 * sizeof *P);
    if (!P) return out_of_memory(c);
    for (size_t i = 0; i < c->n; i++) memcpy(P + 3 * n * i, c->sets[i].P, 3 * n * sizeof *P);
    const apsm_status status = apsm_points_write_cohort(c->ctx, path, c->n, n, P);
    free(P);
    if (status == APSM_OK)
        apsm_log(c->ctx, APSM_LOG_INFO, "%s: %zu shapes of %zu particles", path, c->n, n);
    return status;
}

static apsm_status write_file(const conversion *c, const char *path)
{
    const char *extension = apsm_points_extension(path);
    if (apsm_is_folder(path))
        return apsm_fail(c->ctx, APSM_ERR_ARG, "%s is a folder; name the format by --to EXT", path);
    if (!extension)
        return apsm_fail(c->ctx, APSM_ERR_ARG,
                         "%s: not a format of particles; end it in .particles, .lpts, .wpts, .csv, "
                         ".npy, .mrk.json, .vtk or .vtp, or name a folder and --to EXT",
                         path);
    APSM_TRY(refuse_input(c, path));
    if (c->n == 1 && !(c->cohort && strcmp(extension, ".npy") == 0)) {
        APSM_TRY(apsm_points_write(c->ctx, path, c->sets[0].n, c->sets[0].P));
        apsm_log(c->ctx, APSM_LOG_INFO, "%s: %zu particles", path, c->sets[0].n);
        return APSM_OK;
    }
    if (strcmp(extension, ".npy") == 0) return write_cohort(c, path);
    return apsm_fail(c->ctx, APSM_ERR_ARG,
                     "%s cannot hold %zu shapes; write a .npy, or a folder by -o FOLDER --to %s",
                     path, c->n, extension + 1);
}

/* FOLDER/NAME.EXT, malloc'ed. */
static char *path_of(const conversion *c, const particle_set *set, const char *extension)
{
    char *file = malloc(strlen(set->name) + strlen(extension) + 1);
    if (!file) return NULL;
    sprintf(file, "%s%s", set->name, extension);
    char *path = apsm_path_join(c->args->out_dir, file);
    free(file);
    return path;
}

static apsm_status for_each_path(const conversion *c, const char *extension,
                                 apsm_status (*visit)(const conversion *, const particle_set *,
                                                      const char *path))
{
    apsm_status status = APSM_OK;
    for (size_t i = 0; status == APSM_OK && i < c->n; i++) {
        char *path = path_of(c, &c->sets[i], extension);
        status = path ? visit(c, &c->sets[i], path) : out_of_memory(c);
        free(path);
    }
    return status;
}

static apsm_status check_path(const conversion *c, const particle_set *set, const char *path)
{
    for (const particle_set *other = c->sets; other < set; other++)
        if (strcmp(other->name, set->name) == 0)
            return apsm_fail(c->ctx, APSM_ERR_ARG,
                             "two inputs would be written to %s; rename one of them", path);
    return refuse_input(c, path);
}

static apsm_status write_set(const conversion *c, const particle_set *set, const char *path)
{
    return apsm_points_write(c->ctx, path, set->n, set->P);
}

static apsm_status write_folder(const conversion *c, const char *extension)
{
    const char *folder = c->args->out_dir;
    APSM_TRY(for_each_path(c, extension, check_path));
    APSM_TRY(apsm_make_folder(c->ctx, folder));
    APSM_TRY(for_each_path(c, extension, write_set));
    apsm_log(c->ctx, APSM_LOG_INFO, "%s: %zu file%s *%s", folder, c->n, c->n == 1 ? "" : "s",
             extension);
    return APSM_OK;
}

/* "csv" or ".csv" to ".csv". */
static apsm_status extension_of(const conversion *c, const char *to, const char **extension)
{
    char text[32];
    snprintf(text, sizeof text, ".%s", to + (to[0] == '.'));
    *extension = apsm_points_extension(text);
    if (*extension && strcasecmp(*extension, text) == 0) return APSM_OK;
    return apsm_fail(c->ctx, APSM_ERR_ARG,
                     "--to %s: give particles, lpts, wpts, csv, npy, mrk.json, vtk or vtp", to);
}

static apsm_status convert(conversion *c)
{
    const char *extension = NULL;
    if (c->args->to) APSM_TRY(extension_of(c, c->args->to, &extension));
    for (size_t i = 0; i < c->args->n_inputs; i++) APSM_TRY(add_input(c, c->args->inputs[i]));
    if (c->n == 0)
        return apsm_fail(c->ctx, APSM_ERR_STATE, "%s: holds no shapes", c->args->inputs[0]);
    return extension ? write_folder(c, extension) : write_file(c, c->args->out_dir);
}

apsm_status apsm_cli_convert(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    conversion c = { .ctx = ctx, .args = args };
    const apsm_status status = convert(&c);
    for (size_t i = 0; i < c.n; i++) {
        free(c.sets[i].name);
        free(c.sets[i].P);
    }
    free(c.sets);
    return status;
}
