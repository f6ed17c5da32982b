#include "statistics/particle_files.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/particles.h"
#include "files/files.h"

void particle_files_free(particle_files *files)
{
    for (size_t k = 0; files->name && k < files->n; k++) free(files->name[k]);
    free(files->name);
    free(files->P);
    *files = (particle_files){ 0 };
}

static const char *base_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* Of the file, without extension and "_world": the name of its shape. */
static char *name_of(const char *path)
{
    static const char world[] = "_world";
    char *name = strdup(base_of(path));
    const char *extension = apsm_points_extension(path);
    size_t n = name ? strlen(name) : 0;
    if (!name) return NULL;
    if (extension && strlen(extension) < n) name[n -= strlen(extension)] = '\0';
    if (n > sizeof world - 1 && strcmp(name + n - (sizeof world - 1), world) == 0)
        name[n - (sizeof world - 1)] = '\0';
    return name;
}

static apsm_status add_file(apsm_context *ctx, const char *path, size_t J, particle_files *files)
{
    size_t n = 0;
    double *P = NULL;
    char **names = realloc(files->name, (files->n + 1) * sizeof *names);
    if (!names) return APSM_ERR_MEMORY;
    files->name = names;
    double *all = realloc(files->P, (files->n + 1) * 3 * J * sizeof *all);
    if (!all) return APSM_ERR_MEMORY;
    files->P = all;
    char *name = name_of(path);
    if (!name) return APSM_ERR_MEMORY;
    names[files->n++] = name;
    for (size_t k = 0; k + 1 < files->n; k++)
        if (strcmp(names[k], name) == 0)
            return apsm_fail(ctx, APSM_ERR_ARG, "%s: a second shape of the name '%s'; rename it",
                             path, name);
    APSM_TRY(apsm_points_read(ctx, path, &n, &P));
    if (n == J) memcpy(all + (files->n - 1) * 3 * J, P, 3 * J * sizeof *P);
    free(P);
    if (n == J) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "%s: has %zu particles, the model %zu; give world particles of a fit to this "
                     "model",
                     path, n, J);
}

static bool ends_with(const char *text, const char *end)
{
    const size_t n = strlen(text), m = strlen(end);
    return n >= m && strcmp(text + n - m, end) == 0;
}

static apsm_status add_folder(apsm_context *ctx, const char *folder, size_t J,
                              particle_files *files)
{
    apsm_file_list list;
    const size_t before = files->n;
    char *inner = apsm_path_join(folder, "particles");
    if (!inner) return APSM_ERR_MEMORY;
    const char *from = apsm_is_folder(inner) ? inner : folder;
    apsm_status status = apsm_list_files(ctx, from, false, &list);
    for (size_t k = 0; status == APSM_OK && k < list.n; k++) {
        if (!ends_with(list.path[k], "_world.particles")) continue;
        char *path = apsm_path_join(from, list.path[k]);
        status = path ? add_file(ctx, path, J, files) : APSM_ERR_MEMORY;
        free(path);
    }
    apsm_file_list_free(&list);
    free(inner);
    if (status == APSM_OK && files->n == before)
        status = apsm_fail(ctx, APSM_ERR_ARG,
                           "%s: holds no ..._world.particles; give a folder that apsm fit has made",
                           folder);
    return status;
}

apsm_status particle_files_read(apsm_context *ctx, size_t n, const char *const *paths, size_t J,
                                particle_files *files)
{
    apsm_status status = APSM_OK;
    *files = (particle_files){ 0 };
    for (size_t k = 0; k < n && status == APSM_OK; k++)
        status = apsm_is_folder(paths[k]) ? add_folder(ctx, paths[k], J, files)
                                          : add_file(ctx, paths[k], J, files);
    if (status != APSM_OK) particle_files_free(files);
    return status;
}
