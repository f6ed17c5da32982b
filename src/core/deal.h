/* deal.h -- the tasks of a loop dealt to several processes, in one of two ways.  Each keeps what it
 * has finished (apsm_keep) where the others can recall it; or, where all go through the same loops
 * at the same time, each does its own and gathers the others' results.  No process takes a result
 * that it could not have made itself, so that the number of processes decides nothing. */
#ifndef APSM_CORE_DEAL_H
#define APSM_CORE_DEAL_H

#include "apsm/context.h"

typedef struct apsm_deal {
    size_t rank, size; /* this process does the tasks rank, rank + size, ... */
    void *user;
    /* Called when it has done them.  APSM_OK: the others have kept theirs; go on.  Else the loop
     * ends with that status. */
    apsm_status (*meet)(apsm_context *ctx, void *user);
    /* all (size x bytes) <- own (bytes) of each process, by rank.  NULL: loops are not gathered,
     * and all that are not dealt are done by every process. */
    void (*gather)(void *user, size_t bytes, const void *own, void *all);
} apsm_deal;

/* deal is borrowed; NULL: all tasks are this process's. */
void apsm_context_set_deal(apsm_context *ctx, const apsm_deal *deal);

/* apsm_parallel_for for tasks that begin with a recall and end with a keep: first its own, then,
 * after the meeting, all others, which find their results.  Without a deal the same as that. */
apsm_status apsm_dealt_for(apsm_context *ctx, size_t n, apsm_task_fn fn, void *user,
                           const char *stage) APSM_NODISCARD;

/* apsm_parallel_for over those of n tasks that are this process's, if there is a deal that gathers.
 * Task k is about element[k] (NULL: k), and element e is the process's with the rank e % size. */
apsm_status apsm_own_for(apsm_context *ctx, size_t n, const size_t *element, apsm_task_fn fn,
                         void *user, const char *stage) APSM_NODISCARD;
/* Then: the n elements of an array of elements of `bytes` bytes from the processes whose they are.
 */
apsm_status apsm_gather(apsm_context *ctx, size_t n, const size_t *element, size_t bytes,
                        void *array) APSM_NODISCARD;
bool apsm_is_own(const apsm_context *ctx, size_t element);

#endif
