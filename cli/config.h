/* config.h -- options from a file. */
#ifndef APSM_CLI_CONFIG_H
#define APSM_CLI_CONFIG_H

#include "args.h"

/* The pairs of a JSON file: one object of options, or the "options" of a manifest.json.  Unknown
 * names are refused with the nearest one.  *pairs (texts too) is the caller's. */
apsm_status cli_config_read(apsm_context *ctx, const char *path, cli_pair **pairs,
                            size_t *n) APSM_NODISCARD;

/* Whether text is "all" or non-zero whole numbers with commas. */
apsm_status cli_check_labels(apsm_context *ctx, const char *text) APSM_NODISCARD;

#endif
