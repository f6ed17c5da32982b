/* records.h -- records of one size in a file without a name, which goes with the process, however
 * that ends: what many shapes leave for a table need not be in memory. */
#ifndef APSM_FILES_RECORDS_H
#define APSM_FILES_RECORDS_H

#include <stddef.h>

#include "apsm/context.h"

/* Zero-initialise with { .fd = -1 }. */
typedef struct records {
    const char *folder; /* borrowed */
    size_t size;        /* of a record, in bytes */
    int fd;
} records;

/* In a folder that exists. */
apsm_status records_open(apsm_context *ctx, const char *folder, size_t size,
                         records *r) APSM_NODISCARD;
void records_close(records *r);

/* Record i, in any order and by any thread. */
apsm_status records_put(apsm_context *ctx, const records *r, size_t i,
                        const void *record) APSM_NODISCARD;
/* A record that has been put. */
apsm_status records_get(apsm_context *ctx, const records *r, size_t i, void *record) APSM_NODISCARD;

#endif
