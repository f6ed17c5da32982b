/* What is asked for, where it may go, and which format writes it. */
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "apsm/version.h"
#include "exchange/exporting.h"
#include "folder/names.h"

#define EXPORT_JSON "export.json"

/* How many modes are written where nothing is said. */
typedef enum usual_modes { MAIN_MODES, ALL_MODES } usual_modes;

typedef struct format_row {
    const char *name;
    apsm_status (*write)(exporting *);
    bool folder;
    usual_modes usual;
} format_row;

static const format_row formats[] = {
    { "vtp", export_meshes, true, MAIN_MODES },
    { "ply", export_meshes, true, MAIN_MODES },
    { "stl", export_meshes, true, MAIN_MODES },
    { "obj", export_meshes, true, MAIN_MODES },
    { "gltf", export_gltf, false, MAIN_MODES },
    { "scalismo", export_statismo, false, ALL_MODES },
    { "statismo", export_statismo, false, ALL_MODES },
    { "monai", export_monai, true, ALL_MODES },
    { "slicermorph", export_slicermorph, true, ALL_MODES },
    { "csv", export_tables, true, ALL_MODES },
    { "npz", export_npz, false, ALL_MODES },
};
enum { FORMATS = sizeof formats / sizeof formats[0] };

const char *const *apsm_export_formats(void)
{
    static const char *const names[FORMATS + 1] = { "vtp",         "ply",      "stl",      "obj",
                                                    "gltf",        "scalismo", "statismo", "monai",
                                                    "slicermorph", "csv",      "npz",      NULL };
    return names;
}

static const format_row *find_format(const char *name)
{
    for (size_t k = 0; k < FORMATS; k++)
        if (strcmp(formats[k].name, name) == 0) return &formats[k];
    return NULL;
}

static apsm_status no_memory(const exporting *e)
{
    return apsm_fail(e->ctx, APSM_ERR_MEMORY, "%s: out of memory", e->settings->path);
}

/* ---- the folder ---- */

apsm_status exporting_file(exporting *e, char **path, const char *format, ...)
{
    char name[1024];
    va_list list;
    va_start(list, format);
    const int length = vsnprintf(name, sizeof name, format, list);
    va_end(list);
    if (length < 0 || length >= (int)sizeof name)
        return apsm_fail(e->ctx, APSM_ERR_ARG, "%s: a shape's name is too long for a file",
                         e->settings->path);
    *path = apsm_path_join(e->settings->path, name);
    if (!*path || json_array_append_new(e->files, json_string(name))) return no_memory(e);
    if (apsm_file_exists(*path) || apsm_is_folder(*path))
        return apsm_fail(e->ctx, APSM_ERR_STATE,
                         "%s: is there already and not of this export; name another folder", *path);
    char *folder = apsm_path_folder(*path);
    const apsm_status status = folder ? apsm_make_folder(e->ctx, folder) : no_memory(e);
    free(folder);
    return status;
}

static bool is_listed(const json_t *files, const char *path)
{
    size_t k;
    json_t *name;
    if (strcmp(path, EXPORT_JSON) == 0) return true;
    json_array_foreach(files, k, name)
    {
        if (strcmp(json_string_value(name) ? json_string_value(name) : "", path) == 0) return true;
    }
    return false;
}

/* Nothing that is not of the earlier export may be in its folder; then all of it goes. */
static apsm_status remove_files(exporting *e, const apsm_file_list *there, const json_t *files)
{
    const char *folder = e->settings->path;
    apsm_status status = APSM_OK;
    for (size_t k = 0; k < there->n; k++)
        if (!is_listed(files, there->path[k]))
            return apsm_fail(e->ctx, APSM_ERR_STATE,
                             "%s/%s: is not of the export that is there; move it, or name another "
                             "folder",
                             folder, there->path[k]);
    for (size_t k = 0; k < there->n && status == APSM_OK; k++) {
        char *path = apsm_path_join(folder, there->path[k]);
        if (!path) return no_memory(e);
        if (unlink(path) != 0)
            status = apsm_fail(e->ctx, APSM_ERR_IO, "%s: cannot be replaced; remove it", path);
        free(path);
    }
    return status;
}

static apsm_status remove_earlier(exporting *e, const apsm_file_list *there)
{
    char *list = apsm_path_join(e->settings->path, EXPORT_JSON);
    json_t *root = NULL;
    apsm_status status = list ? APSM_OK : no_memory(e);
    const bool ours = list && apsm_file_exists(list);
    if (status == APSM_OK && !(ours && e->settings->overwrite))
        status = apsm_fail(e->ctx, APSM_ERR_STATE, "%s: holds %s already; %s", e->settings->path,
                           ours ? "an export" : "other files",
                           ours ? "give --overwrite" : "name another folder");
    if (status == APSM_OK) status = apsm_json_read(e->ctx, list, &root);
    if (status == APSM_OK) status = apsm_json_check(e->ctx, list, root, "apsm-export", 1);
    if (status == APSM_OK) status = remove_files(e, there, json_object_get(root, "files"));
    json_decref(root);
    free(list);
    return status;
}

static apsm_status prepare_folder(exporting *e)
{
    const char *folder = e->settings->path;
    apsm_file_list there = { 0 };
    apsm_status status = APSM_OK;
    if (apsm_file_exists(folder))
        return apsm_fail(e->ctx, APSM_ERR_ARG, "%s: is a file; name a folder", folder);
    if (apsm_is_folder(folder)) status = apsm_list_files(e->ctx, folder, true, &there);
    if (status == APSM_OK && there.n > 0) status = remove_earlier(e, &there);
    apsm_file_list_free(&there);
    return status == APSM_OK ? apsm_make_folder(e->ctx, folder) : status;
}

static apsm_status prepare_file(const exporting *e)
{
    const char *path = e->settings->path;
    if (apsm_is_folder(path))
        return apsm_fail(e->ctx, APSM_ERR_ARG, "%s: is a folder; name a file", path);
    if (apsm_file_exists(path) && !e->settings->overwrite)
        return apsm_fail(e->ctx, APSM_ERR_STATE, "%s: is there already; give --overwrite", path);
    return APSM_OK;
}

/* ---- what is in it ---- */

static json_t *describe(exporting *e)
{
    const model_folder *m = &e->dense.folder;
    json_t *sd = apsm_json_vector(e->n_sd, e->sd);
    return json_pack("{s:s, s:i, s:s, s:s, s:I, s:I, s:I, s:I, s:o, s:b, s:s, s:O}", "format",
                     "apsm-export", "version", 1, "apsm", apsm_version(), "to", e->settings->format,
                     "shapes", (json_int_t)m->I, "particles", (json_int_t)m->J, "vertices",
                     (json_int_t)e->dense.mean.nv, "modes", (json_int_t)e->modes,
                     "standard_deviations", sd, "certified", (int)model_folder_is_all_certified(m),
                     "frame", "world frame of the model, LPS, unit of the inputs", "files",
                     e->files);
}

static apsm_status write_description(exporting *e)
{
    json_t *root = describe(e);
    char *path = apsm_path_join(e->settings->path, EXPORT_JSON);
    const apsm_status status = root && path ? apsm_json_write(e->ctx, path, root) : no_memory(e);
    json_decref(root);
    free(path);
    return status;
}

/* ---- the whole ---- */

static apsm_status check_settings(apsm_context *ctx, const apsm_export_settings *s)
{
    if (!s || !s->model || !s->format || !s->path || (s->n_sd > 0 && !s->sd))
        return apsm_fail(ctx, APSM_ERR_ARG, "apsm_export_model: an argument is NULL");
    if (!find_format(s->format))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "--to %s: give vtp, ply, stl, obj, gltf, scalismo, statismo, monai, "
                         "slicermorph, csv or npz",
                         s->format);
    for (size_t k = 0; k < s->n_sd; k++)
        if (!(s->sd[k] > 0) || !isfinite(s->sd[k]))
            return apsm_fail(ctx, APSM_ERR_ARG,
                             "--sd %g: give numbers above 0; both sides of the mean are written",
                             s->sd[k]);
    return APSM_OK;
}

static void warn_of_doubt(const exporting *e)
{
    if (!model_folder_is_all_certified(&e->dense.folder))
        apsm_log(e->ctx, APSM_LOG_WARNING,
                 "%s: the model is not certified in all its shapes; see its certificate before it "
                 "is used elsewhere",
                 e->settings->model);
}

static apsm_status write_export(exporting *e, const format_row *format)
{
    const size_t there = e->dense.folder.model.modes;
    const size_t usual = format->usual == MAIN_MODES ? dense_model_main_modes(&e->dense) : there;
    e->modes = e->settings->modes == 0 ? usual : e->settings->modes;
    if (e->modes > there) e->modes = there;
    warn_of_doubt(e);
    if (!format->folder) {
        APSM_TRY(prepare_file(e));
        return format->write(e);
    }
    APSM_TRY(prepare_folder(e));
    APSM_TRY(format->write(e));
    return write_description(e);
}

apsm_status apsm_export_model(apsm_context *ctx, const apsm_export_settings *settings)
{
    static const double two = 2;
    APSM_TRY(check_settings(ctx, settings));
    exporting e = { .ctx = ctx, .settings = settings, .n_sd = 1, .sd = &two };
    if (settings->n_sd > 0) e.n_sd = settings->n_sd, e.sd = settings->sd;
    APSM_TRY(dense_model_read(ctx, settings->model, &e.dense));
    e.files = json_array();
    const apsm_status status =
        e.files ? write_export(&e, find_format(settings->format)) : no_memory(&e);
    json_decref(e.files);
    dense_model_free(&e.dense);
    return status;
}
