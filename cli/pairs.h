/* pairs.h -- the key = value pairs of cli_args. */
#ifndef APSM_CLI_PAIRS_H
#define APSM_CLI_PAIRS_H

#include "args.h"

/* Adds a pair of the command line.  Refused: a value that the option does not take, the same key
 * with another value.  assign takes "key=value" and refuses unknown keys. */
apsm_status cli_pairs_add(apsm_context *ctx, cli_args *args, const char *key,
                          const char *value) APSM_NODISCARD;
apsm_status cli_pairs_assign(apsm_context *ctx, cli_args *args, const char *text) APSM_NODISCARD;

/* Reads args->config, if any, and puts all in order: preset, file, command line. */
apsm_status cli_pairs_settle(apsm_context *ctx, cli_args *args) APSM_NODISCARD;

void cli_pairs_free(cli_pair *pairs, size_t n);

#endif
