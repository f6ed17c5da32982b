/* export: a finished model leaves its folder. */
#include <string.h>

#include "apsm/exchange.h"
#include "apsm/fit.h"
#include "files/files.h"
#include "verbs.h"

/* --model: all that fit needs. */
static apsm_status export_fit_model(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    apsm_fit_model *model = NULL;
    long long bytes = 0;
    if (apsm_file_exists(args->model) && !args->overwrite)
        return apsm_fail(ctx, APSM_ERR_STATE, "%s: is there already; give --overwrite",
                         args->model);
    if (apsm_is_folder(args->model))
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: is a folder; name a file", args->model);
    APSM_TRY(apsm_fit_model_load(ctx, args->inputs[0], &model));
    apsm_status status = apsm_fit_model_write(ctx, model, args->model);
    if (status == APSM_OK) status = apsm_file_size(ctx, args->model, &bytes);
    if (status == APSM_OK)
        cli_say(ui, "%s: %zu particles, %zu shapes, %.1f MB", args->model,
                apsm_fit_model_particles(model), apsm_fit_model_shapes(model),
                (double)bytes / 1048576);
    apsm_fit_model_free(model);
    return status;
}

/* ---- --to ---- */

enum { MOST_SD = 16 };

/* "1,2,3" */
static apsm_status take_sd(apsm_context *ctx, const char *text, double sd[MOST_SD], size_t *n)
{
    *n = 0;
    for (const char *at = text; at;) {
        const size_t length = strcspn(at, ",");
        if (*n == MOST_SD || !apsm_parse_number(at, length, &sd[*n]))
            return apsm_fail(ctx, APSM_ERR_ARG, "--sd %s: give numbers above 0, such as 1,2,3",
                             text);
        ++*n;
        at = at[length] ? at + length + 1 : NULL;
    }
    return APSM_OK;
}

static apsm_status take_modes(apsm_context *ctx, const char *text, size_t *modes)
{
    double x;
    if (apsm_parse_number(text, strlen(text), &x) && x >= 1 && x <= 1e6 && x == (double)(size_t)x)
        return *modes = (size_t)x, APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG, "--modes %s: give a whole number above 0", text);
}

static apsm_status export_to(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    double sd[MOST_SD];
    apsm_export_settings settings = { .model = args->inputs[0],
                                      .format = args->to,
                                      .path = args->out_dir,
                                      .sd = sd,
                                      .overwrite = args->overwrite };
    if (args->sd) APSM_TRY(take_sd(ctx, args->sd, sd, &settings.n_sd));
    if (args->modes) APSM_TRY(take_modes(ctx, args->modes, &settings.modes));
    APSM_TRY(apsm_export_model(ctx, &settings));
    cli_say(ui, "%s: %s of %s", args->out_dir, args->to, args->inputs[0]);
    return APSM_OK;
}

apsm_status apsm_cli_export(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    const bool whole = args->to ? args->out_dir && !args->model : args->model && !args->out_dir;
    if (!whole)
        return apsm_fail(ctx, APSM_ERR_ARG, "export needs %s: apsm export %s",
                         args->to && args->model ? "--to with -o, or --model, not both"
                         : args->to              ? "an output, -o OUT"
                         : args->out_dir         ? "a format, --to FORMAT"
                                                 : "a format and an output",
                         args->verb->operands);
    return args->to ? export_to(ctx, args, ui) : export_fit_model(ctx, args, ui);
}
