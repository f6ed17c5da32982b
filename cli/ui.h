/* ui.h -- everything the program says: results, messages, progress.
 *
 * Results and messages go to standard output, progress, warnings and errors to standard error.  In
 * JSON mode all of them are objects, one a line, on standard output (docs/formats.md). */
#ifndef APSM_CLI_UI_H
#define APSM_CLI_UI_H

#include <stdio.h>

#include "args.h"

typedef struct cli_ui cli_ui;

/* Seconds of a clock that only goes forward. */
typedef double (*cli_clock_fn)(void);
double cli_clock(void);

/* out and err are borrowed.  A bar is drawn only in mode AUTO if err is a terminal.  NULL if out of
 * memory. */
cli_ui *cli_ui_new(cli_progress_mode mode, bool quiet, FILE *out, FILE *err, cli_clock_fn clock);
void cli_ui_free(cli_ui *ui); /* ends an unfinished bar; NULL is allowed */

/* Makes ui the sink of ctx's messages and progress. */
void cli_ui_attach(cli_ui *ui, apsm_context *ctx);

/* A line of the result that was asked for (check, info): shown even when quiet. */
void cli_say(cli_ui *ui, const char *format, ...) APSM_PRINTF(2, 3);
/* The line of a failure. */
void cli_error(cli_ui *ui, apsm_status status, const char *text);

/* Sinks, also for tests. */
void cli_ui_log(void *ui, apsm_log_level level, const char *text);
void cli_ui_progress(void *ui, const apsm_progress *progress);

#endif
