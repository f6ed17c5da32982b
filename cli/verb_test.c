/* test, measure, landmarks, norm, predict: from a model to answers. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/report.h"
#include "apsm/run.h"
#include "apsm/statistics.h"
#include "files/files.h"
#include "verbs.h"

/* *n <- a whole number from least to most. */
static apsm_status take_count(apsm_context *ctx, const char *option, const char *text, size_t least,
                              size_t most, size_t *n)
{
    size_t value = 0;
    const char *c = text;
    if (!text) return APSM_OK;
    while (*c >= '0' && *c <= '9' && value <= most) value = 10 * value + (size_t)(*c++ - '0');
    if (*text && !*c && value >= least && value <= most) {
        *n = value;
        return APSM_OK;
    }
    return apsm_fail(ctx, APSM_ERR_ARG, "--%s '%s': give a whole number from %zu to %zu", option,
                     text, least, most);
}

static apsm_status take_variances(apsm_context *ctx, const char *word, bool *unequal)
{
    *unequal = word && strcmp(word, "unequal") == 0;
    if (!word || *unequal || strcmp(word, "equal") == 0) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG, "--variances '%s': give equal or unequal", word);
}

static apsm_status take_risk(apsm_context *ctx, const char *text, double *risk)
{
    if (!text) return APSM_OK;
    if (apsm_parse_number(text, strlen(text), risk) && *risk >= 0 && *risk < 0.5) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG, "--stop-risk '%s': give a probability below 0.5, or 0",
                     text);
}

/* What test and asymmetry share. */
static apsm_status take_settings(apsm_context *ctx, const cli_args *args, apsm_test_settings *s)
{
    enum { MOST = 10000000 };
    const char *seed = cli_args_get(args, "seed");
    *s = (apsm_test_settings){ .folder = args->inputs[0],
                               .subjects = args->subjects,
                               .formula = args->formula,
                               .of = args->of,
                               .out = args->out_dir,
                               .on = args->on,
                               .within = args->within };
    APSM_TRY(take_count(ctx, "permutations", args->permutations, 1, MOST, &s->permutations));
    APSM_TRY(take_count(ctx, "bootstraps", args->bootstraps, 0, MOST, &s->bootstraps));
    APSM_TRY(take_variances(ctx, args->variances, &s->unequal));
    APSM_TRY(take_risk(ctx, args->stop_risk, &s->stop_risk));
    if (args->bootstraps && s->bootstraps == 0) s->bootstraps = SIZE_MAX;
    if (seed) apsm_context_set_seed(ctx, strtoull(seed, NULL, 10));
    return APSM_OK;
}

static apsm_status write_report(apsm_context *ctx, const char *folder)
{
    apsm_run *run = NULL;
    const apsm_run_settings settings = { .folder = folder };
    APSM_TRY(apsm_run_open(ctx, &settings, &run));
    const apsm_status status = apsm_run_report(run);
    apsm_run_close(run);
    return status;
}

/* The report of the model shows what is in its own statistics/; one that is there is renewed.  The
 * answers are written already: that another process has the folder does not take them back. */
static apsm_status renew_report(apsm_context *ctx, const cli_args *args)
{
    char *path = apsm_path_join(args->inputs[0], "report.html");
    if (!path) return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory");
    const bool renews = !args->out_dir && apsm_file_exists(path);
    apsm_status status = renews ? write_report(ctx, args->inputs[0]) : APSM_OK;
    if (renews && status == APSM_OK) apsm_log(ctx, APSM_LOG_INFO, "to look at: %s#answers", path);
    if (status == APSM_ERR_STATE) {
        apsm_log(ctx, APSM_LOG_WARNING, "the report does not show it yet: %s",
                 apsm_error_text(ctx));
        status = APSM_OK;
    }
    free(path);
    return status;
}

apsm_status apsm_cli_test(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    apsm_test_settings settings;
    if (!args->formula)
        return apsm_fail(ctx, APSM_ERR_ARG, "test needs a formula: apsm test %s",
                         args->verb->operands);
    APSM_TRY(take_settings(ctx, args, &settings));
    APSM_TRY(apsm_statistics_test(ctx, &settings));
    return renew_report(ctx, args);
}

apsm_status apsm_cli_asymmetry(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    apsm_test_settings settings;
    APSM_TRY(take_settings(ctx, args, &settings));
    APSM_TRY(apsm_statistics_asymmetry(ctx, &settings));
    return renew_report(ctx, args);
}

apsm_status apsm_cli_measure(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    const apsm_measure_settings settings = { .folder = args->inputs[0],
                                             .definition = args->inputs[1],
                                             .n_files = args->n_inputs - 2,
                                             .files = args->inputs + 2,
                                             .subjects = args->subjects,
                                             .out = args->out_dir };
    return apsm_statistics_measure(ctx, &settings);
}

apsm_status apsm_cli_landmarks(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    const apsm_landmark_settings settings = { .folder = args->inputs[0],
                                              .file = args->inputs[1],
                                              .out = args->out_dir,
                                              .aligned = args->aligned };
    APSM_TRY(apsm_statistics_landmarks(ctx, &settings));
    cli_say(ui, "landmarks: %s/landmarks.csv", args->out_dir);
    return APSM_OK;
}

apsm_status apsm_cli_predict(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    (void)ui;
    const char *seed = cli_args_get(args, "seed");
    const apsm_predict_settings settings = { .folder = args->inputs[0],
                                             .of = args->of,
                                             .subjects = args->subjects,
                                             .n_files = args->n_inputs - 1,
                                             .files = args->inputs + 1,
                                             .at = args->at,
                                             .out = args->out_dir };
    if (!args->of)
        return apsm_fail(ctx, APSM_ERR_ARG, "predict needs a column: apsm predict %s",
                         args->verb->operands);
    if (seed) apsm_context_set_seed(ctx, strtoull(seed, NULL, 10));
    APSM_TRY(apsm_statistics_predict(ctx, &settings));
    return renew_report(ctx, args);
}

apsm_status apsm_cli_norm(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    const char *seed = cli_args_get(args, "seed");
    const apsm_norm_settings settings = { .folder = args->inputs[0],
                                          .n_files = args->n_inputs - 1,
                                          .files = args->inputs + 1,
                                          .subjects = args->subjects,
                                          .formula = args->formula,
                                          .out = args->out_dir };
    if (seed) apsm_context_set_seed(ctx, strtoull(seed, NULL, 10));
    APSM_TRY(apsm_statistics_norm(ctx, &settings));
    APSM_TRY(apsm_norm_report_write(ctx, settings.folder, settings.out));
    cli_say(ui, "norm: figures in norm.csv, to look at: %s%s/norm.html",
            settings.out ? settings.out : settings.folder, settings.out ? "" : "/statistics");
    return APSM_OK;
}
