/* hold.h -- one large thing that takes long to make, that the context holds for the next step that
 * needs the same.  Whether it is still there decides time, not results.  Tasks of parallel loops
 * hold nothing. */
#ifndef APSM_CORE_HOLD_H
#define APSM_CORE_HOLD_H

#include "apsm/context.h"

typedef void (*apsm_release_fn)(void *object);

/* What is held with that release, NULL: nothing. */
void *apsm_held(const apsm_context *ctx, apsm_release_fn release);

/* Releases what was held and holds the object (NULL: nothing).  False in a task: the object stays
 * the caller's. */
bool apsm_hold(apsm_context *ctx, void *object, apsm_release_fn release);

#endif
