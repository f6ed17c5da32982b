/* help.h -- the texts of --help and --version, 80 columns wide. */
#ifndef APSM_CLI_HELP_H
#define APSM_CLI_HELP_H

#include <stdio.h>

#include "args.h"

/* verb NULL: the overview.  all: also the options of the method. */
void cli_help(FILE *out, const cli_verb_info *verb, bool all);
void cli_version(FILE *out);

#endif
