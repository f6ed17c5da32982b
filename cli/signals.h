/* signals.h -- Ctrl-C as a request to stop. */
#ifndef APSM_CLI_SIGNALS_H
#define APSM_CLI_SIGNALS_H

/* From now on the first SIGINT, SIGTERM or SIGHUP sets the flag that is returned, and a second
 * one ends the process as usual.  A closed pipe or a limit on file sizes becomes an error of
 * writing instead of a death. */
const volatile int *cli_catch_signals(void);

#endif
