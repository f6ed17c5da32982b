/* render: pictures of a model folder. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/render.h"
#include "files/files.h"
#include "verbs.h"

/* ---- Options ---- */

static apsm_status take_what(apsm_context *ctx, const char *text, apsm_picture *what)
{
    for (int k = 0; k < APSM_PICTURE_COUNT; k++)
        if (strcmp(text, apsm_picture_name((apsm_picture)k)) == 0)
            return *what = (apsm_picture)k, APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG, "--what %s: give mean, modes, shape or cohort", text);
}

/* "X,Y,Z"; false if it is anything else. */
static bool parse_direction(const char *text, double view[3])
{
    for (int k = 0; k < 3; k++) {
        const size_t length = strcspn(text, ",");
        if (!apsm_parse_number(text, length, &view[k])) return false;
        text += length;
        if (*text != (k < 2 ? ',' : '\0')) return false;
        text++;
    }
    return view[0] != 0 || view[1] != 0 || view[2] != 0;
}

static apsm_status take_view(apsm_context *ctx, const char *text, double view[3])
{
    static const char *const axes[] = { "+x", "-x", "+y", "-y", "+z", "-z" };
    if (strcmp(text, "auto") == 0) return APSM_OK;
    for (int k = 0; k < 6; k++)
        if (strcmp(text, axes[k]) == 0) return view[k / 2] = k % 2 ? -1 : 1, APSM_OK;
    if (parse_direction(text, view)) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "--view %s: give a direction X,Y,Z that is not 0,0,0, or +x, -x, +y, -y, +z, "
                     "-z or auto",
                     text);
}

static apsm_status take_width(apsm_context *ctx, const char *text, size_t *width)
{
    char *end;
    errno = 0;
    const long n = strtol(text, &end, 10);
    if (end == text || *end || errno || n < APSM_RENDER_LEAST || n > APSM_RENDER_MOST)
        return apsm_fail(ctx, APSM_ERR_ARG, "--width %s: give a whole number from %d to %d", text,
                         APSM_RENDER_LEAST, APSM_RENDER_MOST);
    *width = (size_t)n;
    return APSM_OK;
}

static apsm_status take_options(apsm_context *ctx, const cli_args *args, apsm_render_options *o)
{
    *o = (apsm_render_options){ .shape = args->shape };
    if (args->what) APSM_TRY(take_what(ctx, args->what, &o->what));
    if (args->view) APSM_TRY(take_view(ctx, args->view, o->view));
    if (args->width) APSM_TRY(take_width(ctx, args->width, &o->width));
    if (args->shape && args->what && o->what != APSM_PICTURE_SHAPE)
        return apsm_fail(ctx, APSM_ERR_ARG, "--shape is for --what shape, not for %s", args->what);
    return APSM_OK;
}

/* ---- Pictures ---- */

static apsm_status render_one(apsm_context *ctx, const cli_args *args, const apsm_render_options *o,
                              const char *path, cli_ui *ui)
{
    if (args->out_dir) APSM_TRY(cli_args_check_output(ctx, args, path)); /* else it is our folder */
    APSM_TRY(apsm_render(ctx, args->inputs[0], o, path));
    cli_say(ui, "picture: %s", path);
    return APSM_OK;
}

static bool is_png(const char *path)
{
    const size_t n = strlen(path);
    return n > 4 && strcmp(path + n - 4, ".png") == 0;
}

/* Before anything is drawn. */
static apsm_status check_into(apsm_context *ctx, const cli_args *args, const apsm_render_options *o,
                              const char *folder)
{
    char name[32];
    snprintf(name, sizeof name, "%s.png", apsm_picture_name(o->what));
    char *path = apsm_path_join(folder, name);
    const apsm_status status = path ? cli_args_check_output(ctx, args, path) : APSM_ERR_MEMORY;
    free(path);
    return status;
}

static apsm_status render_into(apsm_context *ctx, const cli_args *args,
                               const apsm_render_options *o, const char *folder, cli_ui *ui)
{
    char name[32];
    snprintf(name, sizeof name, "%s.png", apsm_picture_name(o->what));
    char *path = apsm_path_join(folder, name);
    const apsm_status status = path ? render_one(ctx, args, o, path, ui) : APSM_ERR_MEMORY;
    free(path);
    return status;
}

/* What can be drawn is drawn before a model without modes is told. */
static apsm_status render_all(apsm_context *ctx, const cli_args *args, apsm_render_options o,
                              const char *folder, cli_ui *ui)
{
    static const apsm_picture order[] = { APSM_PICTURE_MEAN, APSM_PICTURE_SHAPE,
                                          APSM_PICTURE_COHORT, APSM_PICTURE_MODES };
    for (size_t k = 0; k < sizeof order / sizeof *order; k++) {
        o.what = order[k];
        APSM_TRY(render_into(ctx, args, &o, folder, ui));
    }
    return APSM_OK;
}

static apsm_status render_folder(apsm_context *ctx, const cli_args *args,
                                 const apsm_render_options *o, const char *folder, cli_ui *ui)
{
    if (is_png(folder))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "-o %s: four pictures need a folder; choose one by --what", folder);
    for (int k = 0; args->out_dir && !args->what && k < APSM_PICTURE_COUNT; k++) {
        const apsm_render_options one = { .what = (apsm_picture)k };
        APSM_TRY(check_into(ctx, args, &one, folder));
    }
    size_t made;
    APSM_TRY(apsm_missing_folders(ctx, folder, &made));
    apsm_status status = apsm_make_folder(ctx, folder);
    if (status == APSM_OK)
        status = args->what ? render_into(ctx, args, o, folder, ui)
                            : render_all(ctx, args, *o, folder, ui);
    if (status != APSM_OK) apsm_remove_empty_folders(folder, made);
    return status;
}

apsm_status apsm_cli_render(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    apsm_render_options o;
    APSM_TRY(take_options(ctx, args, &o));
    if (!apsm_is_folder(args->inputs[0]))
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: is no model folder", args->inputs[0]);
    if (args->what && args->out_dir && is_png(args->out_dir))
        return render_one(ctx, args, &o, args->out_dir, ui);
    if (args->out_dir) return render_folder(ctx, args, &o, args->out_dir, ui);
    char *folder = apsm_path_join(args->inputs[0], "pictures");
    const apsm_status status = folder ? render_folder(ctx, args, &o, folder, ui) : APSM_ERR_MEMORY;
    free(folder);
    return status;
}
