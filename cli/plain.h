/* plain.h -- text of others (names, paths, values of files) on its way to a terminal. */
#ifndef APSM_CLI_PLAIN_H
#define APSM_CLI_PLAIN_H

#include <stdio.h>

/* Writes prefix, text and a line end.  In text, control characters (a line end is one), bytes that
 * are no UTF-8 and signs that turn the direction of writing become ?: no name can move the cursor,
 * colour the screen, or make a second line.  Everything that the program says goes through here. */
void cli_put_plain(FILE *out, const char *prefix, const char *text);

#endif
