/* verbs.h -- one function a verb.  Each says its results through ui; a failure is returned with its
 * line in ctx, main shows it and chooses the exit code. */
#ifndef APSM_CLI_VERBS_H
#define APSM_CLI_VERBS_H

#include "args.h"
#include "ui.h"

#include "apsm/run.h"

apsm_status apsm_cli_run(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_groom(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_initialize(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_optimize(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_evaluate(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_evaluate_files(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_certify(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_report(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_render(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_check(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_convert(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_verify(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_test(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_asymmetry(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_measure(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_predict(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_landmarks(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_norm(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_fit(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_exclude(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_add(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_compare(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_import(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_warp(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_export(apsm_context *ctx, const cli_args *args, cli_ui *ui);
apsm_status apsm_cli_info(apsm_context *ctx, const cli_args *args, cli_ui *ui);

/* apsm_run_open with what the command line set. */
apsm_status cli_open_run(apsm_context *ctx, const cli_args *args, apsm_run_settings settings,
                         apsm_run **run) APSM_NODISCARD;

#endif
