/* verbs.h -- one function a verb.  Each says its results through ui; a failure is returned with its
 * line in ctx, main shows it and chooses the exit code. */
#ifndef APSM_CLI_VERBS_H
#define APSM_CLI_VERBS_H

#include "args.h"
#include "ui.h"

#include "apsm/run.h"

#define CLI_VERB_FUNCTION(bit, name)                                                               \
    apsm_status apsm_cli_##name(apsm_context *ctx, const cli_args *args, cli_ui *ui);
CLI_VERB_LIST(CLI_VERB_FUNCTION)
#undef CLI_VERB_FUNCTION
/* evaluate, of files and projects. */
apsm_status apsm_cli_evaluate_files(apsm_context *ctx, const cli_args *args, cli_ui *ui);

/* What was set, as the library takes it: in pairs (n_set, borrowing). */
const char *const (*cli_pairs(const cli_args *args, const char *(*pairs)[2]))[2];

/* apsm_run_open with what the command line set. */
apsm_status cli_open_run(apsm_context *ctx, const cli_args *args, apsm_run_settings settings,
                         apsm_run **run) APSM_NODISCARD;

#endif
