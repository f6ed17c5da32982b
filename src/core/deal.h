/* deal.h -- the tasks of a loop dealt to several processes, each of which keeps what it has
 * finished (apsm_keep) where the others can recall it.  No process takes a result that it could not
 * have made itself, so that the number of processes decides nothing. */
#ifndef APSM_CORE_DEAL_H
#define APSM_CORE_DEAL_H

#include "apsm/context.h"

typedef struct apsm_deal {
    size_t rank, size; /* this process does the tasks rank, rank + size, ... */
    void *user;
    /* Called when it has done them.  APSM_OK: the others have kept theirs; go on.  Else the loop
     * ends with that status. */
    apsm_status (*meet)(apsm_context *ctx, void *user);
} apsm_deal;

/* deal is borrowed; NULL: all tasks are this process's. */
void apsm_context_set_deal(apsm_context *ctx, const apsm_deal *deal);

/* apsm_parallel_for for tasks that begin with a recall and end with a keep: first its own, then,
 * after the meeting, all others, which find their results.  Without a deal the same as that. */
apsm_status apsm_dealt_for(apsm_context *ctx, size_t n, apsm_task_fn fn, void *user,
                           const char *stage) APSM_NODISCARD;

#endif
