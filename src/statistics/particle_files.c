#include "statistics/particle_files.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/particles.h"
#include "files/files.h"
#include "folder/model_json.h"
#include "folder/names.h"

static const char particles_folder[] = "particles";

void particle_files_free(particle_files *files)
{
    for (size_t k = 0; files->name && k < files->n; k++) free(files->name[k]);
    for (size_t k = 0; files->note && k < files->n; k++) json_decref(files->note[k]);
    free(files->name);
    free(files->note);
    free(files->P);
    *files = (particle_files){ 0 };
}

apsm_status particle_files_note(apsm_context *ctx, particle_files *files, size_t k,
                                const char *format, ...)
{
    va_list words;
    va_start(words, format);
    json_t *const more = apsm_json_vtext(format, words), *const before = files->note[k];
    va_end(words);
    const char *text = json_string_value(more);
    if (!text) return APSM_ERR_MEMORY;
    apsm_log(ctx, APSM_LOG_WARNING, "%s: %s", files->name[k], text);
    files->note[k] =
        before ? json_sprintf("%s; %s", json_string_value(before), text) : json_incref(more);
    json_decref(before);
    json_decref(more);
    return files->note[k] ? APSM_OK : APSM_ERR_MEMORY;
}

const char *particle_files_note_text(const particle_files *files, size_t k)
{
    return files->note[k] ? json_string_value(files->note[k]) : "";
}

/* Of the file, without extension and "_world": the name of its shape. */
static char *name_of(const char *path)
{
    static const char world[] = "_world";
    char *name = strdup(apsm_path_last(path));
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
    json_t **note = realloc(files->note, (files->n + 1) * sizeof *note);
    if (!note) return APSM_ERR_MEMORY;
    files->note = note;
    double *all = realloc(files->P, (files->n + 1) * 3 * J * sizeof *all);
    if (!all) return APSM_ERR_MEMORY;
    files->P = all;
    char *name = name_of(path);
    if (!name) return APSM_ERR_MEMORY;
    note[files->n] = NULL;
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

/* Where the files lie: of a folder of fits, in its particles/. */
static char *folder_of(const char *path)
{
    if (!apsm_is_folder(path)) return apsm_path_folder(path);
    char *inner = apsm_path_join(path, particles_folder);
    if (!inner || apsm_is_folder(inner)) return inner;
    free(inner);
    return strdup(path);
}

static apsm_status add_folder(apsm_context *ctx, const char *folder, size_t J,
                              particle_files *files)
{
    apsm_file_list list;
    const size_t before = files->n;
    char *from = folder_of(folder);
    if (!from) return APSM_ERR_MEMORY;
    apsm_status status = apsm_list_files(ctx, from, false, &list);
    for (size_t k = 0; status == APSM_OK && k < list.n; k++) {
        if (!ends_with(list.path[k], "_world.particles")) continue;
        char *path = apsm_path_join(from, list.path[k]);
        status = path ? add_file(ctx, path, J, files) : APSM_ERR_MEMORY;
        free(path);
    }
    apsm_file_list_free(&list);
    free(from);
    if (status == APSM_OK && files->n == before)
        status = apsm_fail(ctx, APSM_ERR_ARG,
                           "%s: holds no ..._world.particles; give a folder that apsm fit has made",
                           folder);
    return status;
}

/* ---- what the fits say of themselves ---- */

/* What a particles/ lies in, called so or, as "." may be, by its place; other folders themselves.
 * NULL: memory. */
static char *without_particles(const char *folder)
{
    if (strcmp(apsm_path_last(folder), particles_folder) == 0) return apsm_path_folder(folder);
    char *real = realpath(folder, NULL);
    if (!real) return errno == ENOMEM ? NULL : strdup(folder); /* where it is cannot be told */
    const bool inside = strcmp(apsm_path_last(real), particles_folder) == 0;
    free(real);
    return inside ? apsm_path_join(folder, "..") : strdup(folder);
}

/* Path of the fit.json of the fits that are given: above their particles/, or else beside the
 * files.  NULL: memory. */
static char *fit_json_of(const char *path)
{
    char *inner = folder_of(path);
    char *folder = inner ? without_particles(inner) : NULL;
    char *file = folder ? apsm_path_join(folder, "fit.json") : NULL;
    free(folder);
    free(inner);
    return file;
}

/* The fit.json that was asked last, which files that lie together share. */
typedef struct known_fits {
    char model[65]; /* SHA-256; "": not asked yet */
    char *path;     /* NULL: none yet */
    json_t *root;   /* NULL: there is no such file */
} known_fits;

static void known_fits_free(known_fits *fits)
{
    json_decref(fits->root);
    free(fits->path);
    *fits = (known_fits){ 0 };
}

static apsm_status check_model(apsm_context *ctx, const model_folder *m, known_fits *fits)
{
    const json_t *of = json_object_get(fits->root, "model");
    const char *was = json_string_value(json_object_get(of, "sha256"));
    const char *named = json_string_value(json_object_get(of, "path"));
    if (!*fits->model) model_sha256(&m->model, m->P + m->template_index * 3 * m->J, fits->model);
    if (!was || strcmp(was, fits->model) == 0) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "%s: these are fits to another model (%s), or to %s before it changed; fit "
                     "the shapes again",
                     fits->path, named ? named : "unknown", m->path);
}

/* Where particles of parts lie, the frame is the joint's, and theirs in no model of a part. */
static apsm_status refuse_joint(apsm_context *ctx, const char *fit_json)
{
    char *folder = apsm_path_folder(fit_json);
    bool joint = false;
    apsm_status status =
        folder ? apsm_folder_holds(folder, FOLDER_JOINT_FITS, &joint) : APSM_ERR_MEMORY;
    if (joint)
        status = apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                           "%s: these are fits of the parts of a joint, which are not taken here; "
                           "fit a part to its own model (parts/PART of the joint's) and give that",
                           folder);
    free(folder);
    return status;
}

/* Particles in the folder of another model, in whose frame they lie: a joint's, another part's. */
static apsm_status refuse_other_model(apsm_context *ctx, const model_folder *m,
                                      const char *fit_json)
{
    char own[65], other[65], *folder = apsm_path_folder(fit_json);
    char *mine = model_folder_path(m, FOLDER_MODEL);
    char *path = folder ? apsm_path_join(folder, FOLDER_MODEL) : NULL;
    bool model = false; /* of ours */
    apsm_status status = mine && path ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_folder_holds(folder, FOLDER_MANIFEST, &model);
    if (model && apsm_file_exists(path) && apsm_file_exists(mine)) {
        status = apsm_sha256_file(ctx, mine, own);
        if (status == APSM_OK) status = apsm_sha256_file(ctx, path, other);
        if (status == APSM_OK && strcmp(own, other) != 0)
            status = apsm_fail(ctx, APSM_ERR_ARG,
                               "%s: is another model, and these are its particles; fit its shapes "
                               "to %s and give those fits",
                               folder, m->path);
    }
    free(path);
    free(mine);
    free(folder);
    return status;
}

/* fits <- those of the fit.json at `path`, which it takes over, if they are not known already. */
static apsm_status know_fits(apsm_context *ctx, char *path, const model_folder *m, known_fits *fits)
{
    if (fits->path && strcmp(fits->path, path) == 0) {
        free(path);
        return APSM_OK;
    }
    free(fits->path);
    json_decref(fits->root);
    fits->path = path;
    fits->root = NULL;
    if (!apsm_file_exists(path)) {
        APSM_TRY(refuse_joint(ctx, path));
        return refuse_other_model(ctx, m, path);
    }
    APSM_TRY(apsm_json_read(ctx, path, &fits->root));
    return check_model(ctx, m, fits);
}

/* The model's shape whose input the hash is of, or NULL. */
static const char *own_shape(const model_folder *m, const char *sha256)
{
    size_t k;
    const json_t *input;
    json_array_foreach(json_object_get(m->manifest, "inputs"), k, input)
    {
        const char *own = json_string_value(json_object_get(input, "sha256"));
        if (own && sha256 && strcmp(own, sha256) == 0)
            return json_string_value(json_object_get(input, "name"));
    }
    return NULL;
}

static apsm_status tell_own(apsm_context *ctx, const char *own, size_t k, particle_files *files)
{
    return particle_files_note(
        ctx, files, k, "is the model's own %s: the model knows it, so this is no test of it", own);
}

/* Of file k, what the fit.json says of it. */
static apsm_status tell_shape(apsm_context *ctx, const json_t *shape, const model_folder *m,
                              size_t k, particle_files *files)
{
    const char *verdict = json_string_value(json_object_get(shape, "verdict"));
    const char *reason = json_string_value(json_object_get(shape, "reason"));
    const char *own = own_shape(m, json_string_value(json_object_get(shape, "sha256")));
    if (!verdict) return APSM_OK;
    if (strcmp(verdict, "needs review") == 0)
        APSM_TRY(
            particle_files_note(ctx, files, k, "its fit needs review: %s", reason ? reason : ""));
    return own ? tell_own(ctx, own, k, files) : APSM_OK;
}

/* Of the shapes of the fit.json that are among those read from file `first` on. */
static apsm_status tell_shapes(apsm_context *ctx, const json_t *root, const model_folder *m,
                               size_t first, particle_files *files)
{
    size_t k;
    const json_t *shape;
    json_array_foreach(json_object_get(root, "shapes"), k, shape)
    {
        const char *name = json_string_value(json_object_get(shape, "name"));
        for (size_t i = first; name && i < files->n; i++)
            if (strcmp(files->name[i], name) == 0) APSM_TRY(tell_shape(ctx, shape, m, i, files));
    }
    return APSM_OK;
}

/* Of files from `first` on, which are the model's own particles. */
static apsm_status tell_own_particles(apsm_context *ctx, const model_folder *m, size_t first,
                                      particle_files *files)
{
    const size_t V = 3 * m->J;
    for (size_t k = first; k < files->n; k++)
        for (size_t i = 0; i < m->I; i++)
            if (memcmp(files->P + k * V, m->P + i * V, V * sizeof *m->P) == 0)
                APSM_TRY(tell_own(ctx, m->names[i], k, files));
    return APSM_OK;
}

static apsm_status look_for_fits(apsm_context *ctx, const char *given, const model_folder *m,
                                 known_fits *fits)
{
    char *path = fit_json_of(given);
    return path ? know_fits(ctx, path, m, fits) : APSM_ERR_MEMORY;
}

static double farthest_of(size_t n, const double *x)
{
    double most = 0;
    for (size_t k = 0; k < n; k++) most = fmax(most, fabs(x[k]));
    return most;
}

/* Of files from `first` on: none lies where no shape of this kind can, and no figure holds. */
static apsm_status refuse_nowhere(apsm_context *ctx, const model_folder *m, size_t first,
                                  const particle_files *files)
{
    static const double beyond = 1e9; /* any unit for any other */
    const size_t V = 3 * m->J;
    const double most = beyond * farthest_of(m->I * V, m->P);
    for (size_t k = first; k < files->n; k++)
        if (farthest_of(V, files->P + k * V) > most)
            return apsm_fail(ctx, APSM_ERR_ARG,
                             "%s: its particles lie %.1g times as far from the origin as those of "
                             "the model; give world particles of a fit to this model",
                             files->name[k], beyond / most * farthest_of(V, files->P + k * V));
    return APSM_OK;
}

apsm_status particle_files_read(apsm_context *ctx, size_t n, const char *const *paths,
                                const model_folder *m, particle_files *files)
{
    apsm_status status = APSM_OK;
    known_fits fits = { 0 };
    *files = (particle_files){ 0 };
    for (size_t k = 0; k < n && status == APSM_OK; k++) {
        const size_t first = files->n;
        status = look_for_fits(ctx, paths[k], m, &fits);
        if (status == APSM_OK)
            status = apsm_is_folder(paths[k]) ? add_folder(ctx, paths[k], m->J, files)
                                              : add_file(ctx, paths[k], m->J, files);
        if (status == APSM_OK) status = tell_shapes(ctx, fits.root, m, first, files);
        if (status == APSM_OK) status = refuse_nowhere(ctx, m, first, files);
        if (status == APSM_OK) status = tell_own_particles(ctx, m, first, files);
    }
    known_fits_free(&fits);
    if (status != APSM_OK) particle_files_free(files);
    return status;
}
