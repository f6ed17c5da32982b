/* fit, exclude, add: a finished model meets new shapes. */
#include <string.h>

#include "apsm/fit.h"
#include "apsm/joint.h"
#include "apsm/report.h"
#include "files/files.h"
#include "verbs.h"

/* *index of a word in "a|b|c"'s order; NULL: the first. */
static apsm_status take_word(apsm_context *ctx, const char *option, const char *text,
                             const char *const words[3], int *index)
{
    for (*index = 0; text && *index < 3; ++*index)
        if (strcmp(text, words[*index]) == 0) return APSM_OK;
    if (!text) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG, "--%s %s: give %s, %s or %s", option, text, words[0],
                     words[1], words[2]);
}

static apsm_status take_options(apsm_context *ctx, const cli_args *args, apsm_fit_options *o)
{
    static const char *const hand[] = { "auto", "same", "other" };
    static const char *const extent[] = { "auto", "whole", "part" };
    *o = apsm_fit_defaults();
    o->aligned = args->aligned;
    o->force = args->force;
    APSM_TRY(take_word(ctx, "hand", args->hand, hand, &o->hand));
    return take_word(ctx, "extent", args->extent, extent, &o->extent);
}

/* The exit code tells whether all were fitted. */
static apsm_status ended(apsm_context *ctx, const apsm_fit_totals *n, const char *folder,
                         const char *table)
{
    const size_t not_fitted = n->refused + n->failed, all = n->good + n->review + not_fitted;
    if (not_fitted == 0) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                     "%zu of %zu shapes were not fitted; %s/%s has the reasons", not_fitted, all,
                     folder, table);
}

static apsm_status fit_joints(apsm_context *ctx, const cli_args *args,
                              const apsm_fit_settings *settings, cli_ui *ui)
{
    apsm_fit_totals n;
    APSM_TRY(apsm_joint_fit(ctx, settings, args->parts, &n));
    cli_say(ui,
            "fitted: %zu subjects good, %zu to review; refused: %zu; failed: %zu; figures in "
            "%s/joint_fit.csv",
            n.good, n.review, n.refused, n.failed, args->out_dir);
    return ended(ctx, &n, args->out_dir, "joint_fit.csv");
}

apsm_status apsm_cli_fit(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    apsm_fit_totals n;
    apsm_fit_settings settings = { .model = args->inputs[0],
                                   .n_inputs = args->n_inputs - 1,
                                   .inputs = args->inputs + 1,
                                   .landmarks = args->landmarks,
                                   .labels = cli_args_get(args, "labels"),
                                   .reflect_match = cli_args_get(args, "reflect_match"),
                                   .exclude = cli_args_get(args, "exclude"),
                                   .folder = args->out_dir,
                                   .overwrite = args->overwrite,
                                   .shard = args->shard,
                                   .shards = args->shards };
    apsm_fit_options options;
    APSM_TRY(take_options(ctx, args, &options));
    settings.options = &options;
    settings.options_size = sizeof options;
    if (apsm_joint_is(ctx, settings.model)) return fit_joints(ctx, args, &settings, ui);
    if (args->parts)
        return apsm_fail(ctx, APSM_ERR_ARG, "--parts: %s is a model of one part", settings.model);
    APSM_TRY(apsm_fit_run(ctx, &settings, &n));
    if (args->shards > 0) return APSM_OK;
    APSM_TRY(apsm_fit_report_write(ctx, args->out_dir));
    cli_say(ui,
            "fitted: %zu good, %zu to review; refused: %zu; failed: %zu; figures in %s/fit.csv, to "
            "look at: %s/report.html",
            n.good, n.review, n.refused, n.failed, args->out_dir, args->out_dir);
    return ended(ctx, &n, args->out_dir, "fit.csv");
}

/* The folder must be there: a run that is opened makes one. */
static apsm_status open_model(apsm_context *ctx, const cli_args *args, size_t n_inputs,
                              apsm_run **run)
{
    if (!apsm_is_folder(args->inputs[0]))
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: is no model folder", args->inputs[0]);
    const apsm_run_settings settings = { .folder = args->inputs[0],
                                         .n_inputs = n_inputs,
                                         .inputs = args->inputs + 1 };
    return cli_open_run(ctx, args, settings, run);
}

apsm_status apsm_cli_exclude(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    apsm_run *run = NULL;
    APSM_TRY(open_model(ctx, args, 0, &run));
    const apsm_status status = apsm_run_exclude(run, args->n_inputs - 1, args->inputs + 1);
    apsm_run_close(run);
    if (status == APSM_OK)
        cli_say(ui, "excluded: %zu; report: %s/report.html", args->n_inputs - 1, args->inputs[0]);
    return status;
}

apsm_status apsm_cli_add(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    apsm_run *run = NULL;
    APSM_TRY(open_model(ctx, args, args->n_inputs - 1, &run));
    const apsm_status status = apsm_run_add(run);
    apsm_run_close(run);
    if (status == APSM_OK) cli_say(ui, "added; report: %s/report.html", args->inputs[0]);
    return status;
}
