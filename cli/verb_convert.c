/* convert: particle sets from one format to another.  Everything is read before anything is
 * written, so that a damaged input leaves nothing behind. */
#define _DEFAULT_SOURCE /* strcasecmp */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "apsm/particles.h"
#include "files/files.h"
#include "files/project.h"
#include "particle_sets.h"
#include "verbs.h"

typedef struct conversion {
    apsm_context *ctx;
    const cli_args *args;
    cli_sets in;
} conversion;

static apsm_status out_of_memory(const conversion *c)
{
    return apsm_fail(c->ctx, APSM_ERR_MEMORY, "out of memory while converting particles");
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

static apsm_status check_output(const conversion *c, const char *path)
{
    if (!is_input(c, path)) return cli_args_check_output(c->ctx, c->args, path);
    return apsm_fail(c->ctx, APSM_ERR_ARG,
                     "%s is an input and would be replaced; give another output", path);
}

static apsm_status write_cohort(const conversion *c, const char *path)
{
    const size_t n = c->in.sets[0].n;
    for (size_t i = 1; i < c->in.n; i++)
        if (c->in.sets[i].n != n)
            return apsm_fail(c->ctx, APSM_ERR_FORMAT,
                             "%s has %zu particles and %s has %zu; one array needs the same number",
                             c->in.sets[0].name, n, c->in.sets[i].name, c->in.sets[i].n);
    double *P = malloc(c->in.n * n * 3 * sizeof *P);
    if (!P) return out_of_memory(c);
    for (size_t i = 0; i < c->in.n; i++) memcpy(P + 3 * n * i, c->in.sets[i].P, 3 * n * sizeof *P);
    const apsm_status status = apsm_points_write_cohort(c->ctx, path, c->in.n, n, P);
    free(P);
    if (status == APSM_OK)
        apsm_log(c->ctx, APSM_LOG_INFO, "%s: %zu shapes of %zu particles", path, c->in.n, n);
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
                         ".npy, .mrk.json, .vtk, .vtp, .swproj or .xlsx, or name a folder and "
                         "--to EXT",
                         path);
    APSM_TRY(check_output(c, path));
    if (c->in.n == 1 && !(c->in.cohort && strcmp(extension, ".npy") == 0)) {
        APSM_TRY(apsm_points_write(c->ctx, path, c->in.sets[0].n, c->in.sets[0].P));
        apsm_log(c->ctx, APSM_LOG_INFO, "%s: %zu particles", path, c->in.sets[0].n);
        return APSM_OK;
    }
    if (strcmp(extension, ".npy") == 0) return write_cohort(c, path);
    return apsm_fail(c->ctx, APSM_ERR_ARG,
                     "%s cannot hold %zu shapes; write a .npy, or a folder by -o FOLDER --to %s",
                     path, c->in.n, extension + 1);
}

/* FOLDER/NAME.EXT, malloc'ed. */
static char *path_of(const conversion *c, const cli_set *set, const char *extension)
{
    char *file = malloc(strlen(set->name) + strlen(extension) + 1);
    if (!file) return NULL;
    sprintf(file, "%s%s", set->name, extension);
    char *path = apsm_path_join(c->args->out_dir, file);
    free(file);
    return path;
}

static apsm_status for_each_path(const conversion *c, const char *extension,
                                 apsm_status (*visit)(const conversion *, const cli_set *,
                                                      const char *path))
{
    apsm_status status = APSM_OK;
    for (size_t i = 0; status == APSM_OK && i < c->in.n; i++) {
        char *path = path_of(c, &c->in.sets[i], extension);
        status = path ? visit(c, &c->in.sets[i], path) : out_of_memory(c);
        free(path);
    }
    return status;
}

static apsm_status check_path(const conversion *c, const cli_set *set, const char *path)
{
    for (const cli_set *other = c->in.sets; other < set; other++)
        if (strcmp(other->name, set->name) == 0)
            return apsm_fail(c->ctx, APSM_ERR_ARG,
                             "two inputs would be written to %s; rename one of them", path);
    return check_output(c, path);
}

static apsm_status write_set(const conversion *c, const cli_set *set, const char *path)
{
    return apsm_points_write(c->ctx, path, set->n, set->P);
}

static apsm_status write_folder(const conversion *c, const char *extension)
{
    const char *folder = c->args->out_dir;
    APSM_TRY(for_each_path(c, extension, check_path));
    APSM_TRY(apsm_make_folder(c->ctx, folder));
    APSM_TRY(for_each_path(c, extension, write_set));
    apsm_log(c->ctx, APSM_LOG_INFO, "%s: %zu file%s *%s", folder, c->in.n, c->in.n == 1 ? "" : "s",
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

/* ---- Projects ---- */

/* From one format of projects to the other; paths are rewritten to reach the same files. */
static apsm_status rewrite_project(const conversion *c, const char *from)
{
    const char *path = c->args->out_dir;
    apsm_project project = { 0 };
    struct stat in, out;
    if (stat(from, &in) == 0 && stat(path, &out) == 0 && in.st_dev == out.st_dev &&
        in.st_ino == out.st_ino)
        return apsm_fail(c->ctx, APSM_ERR_ARG,
                         "%s is an input and would be replaced; give another output", path);
    APSM_TRY(cli_args_check_output(c->ctx, c->args, path));
    APSM_TRY(apsm_project_read(c->ctx, from, &project));
    char *folder = apsm_path_folder(path);
    apsm_status status = folder ? apsm_project_rebase(&project, folder) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_project_write(c->ctx, path, &project);
    if (status == APSM_OK)
        apsm_log(c->ctx, APSM_LOG_INFO, "%s: project of %zu shapes", path, project.n);
    free(folder);
    apsm_project_free(&project);
    return status;
}

static apsm_status convert_project(const conversion *c)
{
    const char *input = c->args->inputs[0];
    if (c->args->n_inputs != 1 || !(apsm_is_folder(input) || apsm_is_project_file(input)))
        return apsm_fail(c->ctx, APSM_ERR_ARG,
                         "%s: a project is made of one project or model folder only",
                         c->args->out_dir);
    char *project = apsm_is_folder(input) ? apsm_path_join(input, "project.swproj") : NULL;
    if (apsm_is_folder(input) && !project) return out_of_memory(c);
    const apsm_status status = rewrite_project(c, project ? project : input);
    free(project);
    return status;
}

static apsm_status convert(conversion *c)
{
    const char *extension = NULL;
    if (c->args->to) APSM_TRY(extension_of(c, c->args->to, &extension));
    if (!extension && apsm_is_project_file(c->args->out_dir)) return convert_project(c);
    APSM_TRY(cli_sets_read(c->ctx, c->args->n_inputs, c->args->inputs, &c->in));
    cli_sets_warn(c->ctx, &c->in);
    return extension ? write_folder(c, extension) : write_file(c, c->args->out_dir);
}

apsm_status apsm_cli_convert(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    conversion c = { .ctx = ctx, .args = args };
    const apsm_status status = convert(&c);
    cli_sets_free(&c.in);
    return status;
}
