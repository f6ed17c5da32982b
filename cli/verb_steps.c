/* run, groom, initialize, optimize, evaluate: open the model folder, do the step; report. */
#include <stdlib.h>

#include "apsm/contour.h"
#include "apsm/joint.h"
#include "apsm/report.h"
#include "files/files.h"
#include "ranks.h"
#include "verbs.h"

typedef apsm_status (*step_fn)(apsm_run *);

const char *const (*cli_pairs(const cli_args *args, const char *(*pairs)[2]))[2]
{
    for (size_t k = 0; k < args->n_set; k++) {
        pairs[k][0] = args->set[k].key;
        pairs[k][1] = args->set[k].value;
    }
    return (const char *const(*)[2])pairs;
}

apsm_status cli_open_run(apsm_context *ctx, const cli_args *args, apsm_run_settings settings,
                         apsm_run **run)
{
    const char *(*pairs)[2] = malloc((args->n_set + 1) * sizeof *pairs);
    if (!pairs) return APSM_ERR_MEMORY;
    settings.n_set = args->n_set;
    settings.set = cli_pairs(args, pairs);
    const apsm_status status = apsm_run_open(ctx, &settings, run);
    free(pairs);
    return status;
}

static apsm_run_settings settings_of(const cli_args *args)
{
    return (apsm_run_settings){ .folder = args->out_dir,
                                .shard = args->shard,
                                .shards = args->shards,
                                .n_inputs = args->n_inputs,
                                .inputs = args->inputs,
                                .memory = args->memory,
                                .resume = args->resume,
                                .overwrite = args->overwrite,
                                .dry = args->dry_run };
}

static apsm_status do_step(apsm_context *ctx, const cli_args *args, step_fn step)
{
    apsm_run *run = NULL;
    APSM_TRY(cli_open_run(ctx, args, settings_of(args), &run));
    const apsm_status status = args->dry_run ? apsm_run_dry(run) : step(run);
    apsm_run_close(run);
    return status;
}

/* One of several processes joins the others. */
static void join_company(apsm_context *ctx, apsm_run_settings *s, const cli_ranks *ranks)
{
    if (ranks->size < 2 || s->dry) return;
    s->shard = ranks->rank;
    s->shards = ranks->size;
    s->company = cli_ranks_company();
    if (ranks->rank > 0) apsm_context_set_log(ctx, NULL, NULL); /* the first tells all there is */
}

static apsm_status run_together(apsm_context *ctx, const apsm_run_settings *s)
{
    apsm_run *run;
    if (s->shard > 0) return apsm_run_help(ctx, s);
    APSM_TRY(apsm_run_open(ctx, s, &run));
    const apsm_status status = apsm_run_all(run);
    apsm_run_close(run);
    return status;
}

/* Several parts a subject, or one. */
static apsm_status run_job(apsm_context *ctx, const cli_args *args, const char *(*pairs)[2])
{
    bool joint;
    const apsm_joint_settings parts = { args->parts, args->align_parts, args->shared };
    apsm_run_settings settings = settings_of(args);
    settings.set = cli_pairs(args, pairs);
    settings.n_set = args->n_set;
    bool contours;
    APSM_TRY(apsm_contours_wanted(ctx, &settings, &contours));
    if (contours && args->parts)
        return apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                         "--parts: the inputs are contours, of which each is a shape of its own");
    if (contours && cli_ranks_get().rank > 0) return APSM_OK; /* the first makes them alone */
    if (contours) return apsm_contours_run(ctx, &settings);
    APSM_TRY(apsm_joint_wanted(ctx, &settings, &parts, &joint));
    const cli_ranks ranks = cli_ranks_get();
    if (args->shards > 0 && (ranks.size > 1 || !joint))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         ranks.size > 1
                             ? "--shard: ranks share the job by themselves; leave it out"
                             : "--shard: run shares the grooming of joints alone; of one part "
                               "share groom, initialize and evaluate");
    if (!joint && (args->align_parts || args->shared))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "%s: is for subjects of several parts, and these have one; give --parts, "
                         "or leave it out",
                         args->align_parts ? "--align-parts" : "--shared-boundary");
    if (ranks.rank > 0 && args->dry_run) return APSM_OK;
    join_company(ctx, &settings, &ranks);
    if (settings.company && !joint) return run_together(ctx, &settings);
    return joint ? apsm_joint_run(ctx, &settings, &parts) : do_step(ctx, args, apsm_run_all);
}

static apsm_status say_where(apsm_context *ctx, const char *folder)
{
    char *report = apsm_path_join(folder, "report.html");
    if (!report) return APSM_ERR_MEMORY;
    if (apsm_file_exists(report))
        apsm_log(ctx, APSM_LOG_INFO, "model in %s; look at it: %s", folder, report);
    else
        apsm_log(ctx, APSM_LOG_INFO, "model in %s", folder);
    free(report);
    return APSM_OK;
}

apsm_status apsm_cli_run(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    const char *(*pairs)[2] = malloc((args->n_set + 1) * sizeof *pairs);
    if (!pairs) return APSM_ERR_MEMORY;
    const apsm_status status = run_job(ctx, args, pairs);
    free(pairs);
    APSM_TRY(status);
    if (!args->dry_run && args->shards == 0 && cli_ranks_get().rank == 0)
        return say_where(ctx, args->out_dir);
    return APSM_OK;
}

apsm_status apsm_cli_groom(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    return do_step(ctx, args, apsm_run_groom);
}

apsm_status apsm_cli_initialize(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    return do_step(ctx, args, apsm_run_initialize);
}

apsm_status apsm_cli_optimize(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    return do_step(ctx, args, apsm_run_optimize);
}

apsm_status apsm_cli_evaluate(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    if (args->n_inputs > 0 && args->shards > 0)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "--shard: is for a model folder; files are evaluated at once");
    if (args->n_inputs > 0) return apsm_cli_evaluate_files(ctx, args, ui);
    if (cli_args_get(args, "template"))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "--template: a model folder is judged by its own template; judge it by "
                         "another with apsm evaluate %s/project.swproj --template NAME",
                         args->out_dir ? args->out_dir : "MODEL_DIR");
    return do_step(ctx, args, apsm_run_evaluate);
}

apsm_status apsm_cli_report(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    bool fits; /* a folder that fit has left */
    APSM_TRY(apsm_folder_holds(args->out_dir, "fit.json", &fits));
    APSM_TRY(fits ? apsm_fit_report_write(ctx, args->out_dir)
                  : do_step(ctx, args, apsm_run_report));
    cli_say(ui, "report: %s/report.html", args->out_dir);
    return APSM_OK;
}
