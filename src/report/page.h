/* page.h -- the viewer (built from report/viewer/, compiled in) with data in its place. */
#ifndef APSM_REPORT_PAGE_H
#define APSM_REPORT_PAGE_H

#include "report/pack.h"

/* Last component of the folder's path, whatever it is called on the command line; malloc'ed. */
char *page_title(const char *folder);

/* The page with root (borrowed; NULL: out of memory) and the packed arrays, atomically. */
apsm_status page_write(apsm_context *ctx, const char *path, const struct json_t *root,
                       pack *bytes) APSM_NODISCARD;

#endif
