/* results.h -- where results of statistics go, and that nothing of somebody else's is replaced. */
#ifndef APSM_STATISTICS_RESULTS_H
#define APSM_STATISTICS_RESULTS_H

#include <stddef.h>

#include "apsm/context.h"

/* The folder of results: out, or statistics/ in the model folder; malloc'ed, NULL if out of memory.
 */
char *results_folder(const char *model_folder, const char *out);

/* Whether results may be written: json is not there, or holds "format": format (ours, replaced); of
 * the n other names none is there unless json is.  APSM_ERR_STATE, with a line, else.  Call it
 * before the work begins. */
apsm_status results_claim(apsm_context *ctx, const char *folder, const char *json,
                          const char *format, size_t n, const char *const *others) APSM_NODISCARD;

/* text with what a file name should not have (/ : . and spaces) as _, in place. */
void results_plain_name(char *text);

#endif
