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

/* What a loop's tasks fill, task e the `bytes` bytes at array + e * bytes. */
typedef struct apsm_made {
    void *array;
    size_t bytes;
} apsm_made;

enum { APSM_MOST_MADE = 7 };
typedef struct apsm_shared_loop {
    const char *kind; /* under which the tasks' results are kept: one of its own for all that
                         decides them, beside what the keeper's pieces belong to */
    size_t n;
    apsm_task_fn fn;
    void *user;
    const char *stage;
    bool decides; /* what another loop of the step keeps is made of it */
    apsm_made
        made[APSM_MOST_MADE]; /* up to the first without an array; none: fn recalls and keeps */
} apsm_shared_loop;

/* A loop whose tasks are done once by all processes together.  If the deal gathers, apsm_own_for
 * and apsm_gather of all that is made.  Else what can be recalled is not made, what is made is
 * kept, and a share (a deal that does not gather) does its own tasks alone: what the others make is
 * zero, or, where it decides, what they have kept; APSM_ERR_INTERRUPTED if some of that is not
 * there. */
apsm_status apsm_shared_for(apsm_context *ctx, const apsm_shared_loop *loop) APSM_NODISCARD;
/* Whether the process is such a share: of what is made of all elements it knows only its own. */
bool apsm_is_share(const apsm_context *ctx);

#endif
