/* presets.h -- options that decide over others. */
#ifndef APSM_OPTIONS_PRESETS_H
#define APSM_OPTIONS_PRESETS_H

#include "apsm/options.h"

/* One option from text, nothing else. */
apsm_status options_set_one(apsm_context *ctx, apsm_options *options, const char *key,
                            const char *value) APSM_NODISCARD;

#endif
