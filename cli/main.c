/* The program: understand the command line, set the context up, call the verb, tell how it ended.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "help.h"
#include "kernels.h"
#include "plain.h"
#include "ranks.h"
#include "room.h"
#include "signals.h"
#include "verbs.h"
#include "xml.h"

enum { EXIT_USAGE = 2, EXIT_INTERRUPTED = 130 };

static int exit_code(apsm_status status)
{
    if (status == APSM_ERR_INTERRUPTED) return EXIT_INTERRUPTED;
    if (status == APSM_ERR_ARG) return EXIT_USAGE;
    return status == APSM_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}

static bool has_file(const char *folder, const char *name)
{
    char *path = apsm_path_join(folder, name);
    const bool has = path && apsm_file_exists(path);
    free(path);
    return has;
}

/* Before groom has begun there is nothing to go on with. */
static bool can_resume(const cli_args *args)
{
    const unsigned resuming = CLI_RUN | CLI_GROOM | CLI_INITIALIZE | CLI_OPTIMIZE;
    if (!args->out_dir || !(args->verb->verb & resuming)) return false;
    return has_file(args->out_dir, "state/work.journal") ||
           (!(args->verb->verb & CLI_GROOM) && has_file(args->out_dir, "project.swproj"));
}

static void tell_interrupted(const cli_args *args, cli_ui *ui)
{
    char line[1024];
    const char *verb = args->verb->name;
    if (can_resume(args))
        snprintf(line, sizeof line, "interrupted; go on with: apsm %s --resume -o %s", verb,
                 args->out_dir);
    else
        snprintf(line, sizeof line, "interrupted; %s can be started again", verb);
    cli_error(ui, APSM_ERR_INTERRUPTED, line);
}

static void tell_failure(apsm_context *ctx, apsm_status status, const cli_args *args, cli_ui *ui)
{
    const char *line = apsm_error_text(ctx);
    if (status == APSM_ERR_INTERRUPTED)
        tell_interrupted(args, ui);
    else
        cli_error(ui, status, *line ? line : apsm_status_text(status));
}

static bool computes(const cli_args *args)
{
    return !(args->verb->verb & (CLI_INFO | CLI_VERIFY | CLI_CONVERT | CLI_EXPORT));
}

/* Ends the program at once: OpenBLAS would wait for memory at its end, too. */
static void refuse_small_room(apsm_context *ctx, const cli_args *args, cli_ui *ui)
{
    const apsm_status status = cli_check_room(ctx, args->threads);
    if (status == APSM_OK) return;
    tell_failure(ctx, status, args, ui);
    fflush(NULL);
    _Exit(exit_code(status));
}

static int work(apsm_context *ctx, const cli_args *args)
{
    const bool quiet = args->quiet || cli_ranks_get().rank > 0; /* one of them tells */
    cli_ui *ui = cli_ui_new(args->progress, quiet, stdout, stderr, cli_clock);
    if (!ui) return EXIT_FAILURE;
    cli_ui_attach(ui, ctx);
    apsm_context_set_threads(ctx, args->threads);
    apsm_context_set_interrupt(ctx, cli_catch_signals());
    apsm_status status = cli_args_check_inputs(ctx, args);
    if (status == APSM_OK && computes(args)) refuse_small_room(ctx, args, ui);
    if (status == APSM_OK) status = args->verb->call(ctx, args, ui);
    if (status != APSM_OK) tell_failure(ctx, status, args, ui);
    cli_ui_free(ui);
    return exit_code(status);
}

static int refuse_usage(apsm_context *ctx, apsm_status status, const cli_args *args)
{
    cli_put_plain(stderr, "apsm: ", apsm_error_text(ctx));
    if (args->verb) fprintf(stderr, "Try: apsm %s --help\n", args->verb->name);
    return exit_code(status);
}

/* Output that could not be written (a full disk, a closed pipe) is a failure, whatever else went
 * well. */
static int flush_output(int code)
{
    const bool failed_before = ferror(stdout);
    if (fflush(stdout) == 0 && !failed_before) return code;
    fprintf(stderr, "apsm: standard output could not be written%s%s\n", failed_before ? "" : ": ",
            failed_before ? "" : strerror(errno));
    return code ? code : EXIT_FAILURE;
}

static int run_program(int argc, char **argv)
{
    cli_args args;
    apsm_context *ctx = apsm_context_new();
    if (!ctx) {
        fputs("apsm: out of memory\n", stderr);
        return EXIT_FAILURE;
    }
    int code = EXIT_SUCCESS;
    char **linked = cli_argv_of_link(&argc, argv);
    const apsm_status status = cli_args_parse(ctx, argc, linked ? linked : argv, &args);
    const bool first = cli_ranks_get().rank == 0; /* the others help with run alone */
    if (!first &&
        (status != APSM_OK || args.help || args.version || args.xml || args.verb->verb != CLI_RUN))
        ;
    else if (status != APSM_OK)
        code = refuse_usage(ctx, status, &args);
    else if (args.help)
        cli_help(stdout, args.verb, args.help_all);
    else if (args.version)
        cli_version(stdout);
    else if (args.xml)
        cli_xml(stdout, args.verb);
    else
        code = work(ctx, &args);
    cli_args_free(&args);
    free(linked);
    apsm_context_free(ctx);
    return flush_output(code);
}

int main(int argc, char **argv)
{
    cli_pin_kernels(argv);
    cli_ranks_begin(&argc, &argv);
    return cli_ranks_end(cli_with_stack(run_program, argc, argv));
}
