/* store.h -- finished shapes in a file that is mapped into memory, so that a cohort may be larger
 * than the memory a run is allowed.  The file has no name: it goes with the process, however that
 * ends.  What is in memory is the system's choice and ours (apsm_store_trim), never the result's.
 */
#ifndef APSM_STORE_H
#define APSM_STORE_H

#include "apsm/context.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_store apsm_store;

/* In a folder that exists.  limit: bytes of resident memory that the process is to keep to; the
 * store can only give back its own. */
apsm_status apsm_store_open(apsm_context *ctx, const char *folder, size_t limit,
                            apsm_store **store) APSM_NODISCARD;
/* Everything that was moved into it is gone.  NULL is allowed. */
void apsm_store_close(apsm_store *store);

/* Gives the store's pages back if the process has come close to the limit; they are read again
 * when touched.  Any thread, at any time: costs a microsecond if there is nothing to do. */
void apsm_store_trim(apsm_store *store);

size_t apsm_store_bytes(const apsm_store *store); /* of the file */

#ifdef __cplusplus
}
#endif
#endif
