/* What is asked for, where it may go, and which format writes it. */
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/version.h"
#include "core/sized.h"
#include "exchange/exporting.h"
#include "folder/names.h"

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

/* ---- the folder ---- */

apsm_status exporting_file(exporting *e, char **path, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    const apsm_status status = out_folder_place(&e->folder, path, format, list);
    va_end(list);
    return status;
}

apsm_status exporting_table(exporting *e, const char *name, apsm_writer **w)
{
    char *path = NULL;
    apsm_status status = exporting_file(e, &path, "%s", name);
    if (status == APSM_OK) status = apsm_writer_open(e->ctx, path, w);
    free(path);
    return status;
}

apsm_status exporting_json(exporting *e, const char *name, json_t *root)
{
    char *path = NULL;
    apsm_status status = exporting_file(e, &path, "%s", name);
    if (status == APSM_OK) status = apsm_json_write(e->ctx, path, root);
    json_decref(root);
    free(path);
    return status;
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
    return json_pack("{s:s, s:i, s:s, s:s, s:I, s:I, s:I, s:I, s:o, s:b, s:s}", "format",
                     "apsm-export", "version", 1, "apsm", apsm_version(), "to", e->settings->format,
                     "shapes", (json_int_t)m->I, "particles", (json_int_t)m->J, "vertices",
                     (json_int_t)e->dense.mean.nv, "modes", (json_int_t)e->modes,
                     "standard_deviations", sd, "certified", (int)model_folder_is_all_certified(m),
                     "frame", "world frame of the model, LPS, unit of the inputs");
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
    APSM_TRY(out_folder_open(&e->folder));
    APSM_TRY(format->write(e));
    return out_folder_close(&e->folder, describe(e));
}

static apsm_status export_model(apsm_context *ctx, const apsm_export_settings *settings)
{
    static const double two = 2;
    APSM_TRY(check_settings(ctx, settings));
    exporting e = { .ctx = ctx,
                    .settings = settings,
                    .n_sd = 1,
                    .sd = &two,
                    .folder = { ctx, settings ? settings->path : NULL, "export.json", "apsm-export",
                                settings && settings->overwrite, NULL, NULL } };
    if (settings->n_sd > 0) e.n_sd = settings->n_sd, e.sd = settings->sd;
    APSM_TRY(dense_model_read(ctx, settings->model, &e.dense));
    const apsm_status status = write_export(&e, find_format(settings->format));
    out_folder_free(&e.folder);
    dense_model_free(&e.dense);
    return status;
}

APSM_BY_SIZE(apsm_export_model, apsm_export_settings, export_model)
