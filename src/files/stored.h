/* stored.h -- moves the arrays of an object into a store. */
#ifndef APSM_FILES_STORED_H
#define APSM_FILES_STORED_H

#include "core/arrays.h"
#include "files/store.h"

/* Copies the arrays to the store, frees them, and lets the object's pointers show there.  The
 * copies can only be read, and are aligned to 64 bytes.  On failure nothing has changed.  Any
 * thread. */
apsm_status store_put(apsm_context *ctx, apsm_store *store,
                      const array_list *arrays) APSM_NODISCARD;

#endif
