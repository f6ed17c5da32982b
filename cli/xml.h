/* xml.h -- a verb as 3D Slicer and other hosts of command line modules want it described. */
#ifndef APSM_CLI_XML_H
#define APSM_CLI_XML_H

#include <stdio.h>

#include "args.h"

/* The description that the Slicer Execution Model asks for with --xml. */
void cli_xml(FILE *out, const cli_verb_info *verb);

/* A program called apsm-VERB is `apsm VERB`: such a link is a module of Slicer.  Returns a new
 * argv (free() it) and its length, or NULL: called by its own name, or out of memory. */
char **cli_argv_of_link(int *argc, char **argv);

#endif
