/* context.h -- what a call needs beside its data: threads, seed, where messages go, whether
 * to stop.  There are no globals: everything that would be one lives here. */
#ifndef APSM_CONTEXT_H
#define APSM_CONTEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "apsm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_context apsm_context;

typedef enum apsm_log_level { APSM_LOG_INFO, APSM_LOG_WARNING } apsm_log_level;

/* Receives one line without newline.  Called from the thread that called the library only. */
typedef void (*apsm_log_fn)(void *user, apsm_log_level level, const char *text);

/* How far a long step is. */
typedef struct apsm_progress {
    const char *stage;  /* "groom", "align", "stage 1", ...; constant string */
    size_t done, total; /* in units of the stage: shapes, epochs */
    double loss[3];     /* sampling, correspondence, eigenshape; NaN where they do not apply */
    double mismatched;  /* mean share of mismatched particles (1.5/2.0); NaN if unknown */
} apsm_progress;
typedef void (*apsm_progress_fn)(void *user, const apsm_progress *progress);

/* A context with 1 thread, seed 0 and silent; NULL if out of memory.  Free with
 * apsm_context_free (NULL is allowed). */
APSM_API apsm_context *apsm_context_new(void);
APSM_API void apsm_context_free(apsm_context *ctx);

/* threads >= 1; results do not depend on it.  seed: every random number derives from it. */
APSM_API void apsm_context_set_threads(apsm_context *ctx, int threads);
APSM_API int apsm_context_threads(const apsm_context *ctx);
APSM_API void apsm_context_set_seed(apsm_context *ctx, uint64_t seed);
APSM_API uint64_t apsm_context_seed(const apsm_context *ctx);

/* Sinks for messages and progress; NULL switches one off.  user is passed through, borrowed. */
APSM_API void apsm_context_set_log(apsm_context *ctx, apsm_log_fn fn, void *user);
APSM_API void apsm_context_set_progress(apsm_context *ctx, apsm_progress_fn fn, void *user);

/* flag (borrowed, may be NULL): long functions return APSM_ERR_INTERRUPTED soon after it is
 * non-zero.  A signal handler may set it. */
APSM_API void apsm_context_set_interrupt(apsm_context *ctx, const volatile int *flag);
APSM_API bool apsm_interrupted(const apsm_context *ctx);

/* fn is called between the tasks of apsm_parallel_for, from any of its threads: a place to keep
 * house (apsm_store_trim), never to decide anything.  NULL switches it off; user is borrowed. */
typedef void (*apsm_between_fn)(void *user);
APSM_API void apsm_context_set_between(apsm_context *ctx, apsm_between_fn fn, void *user);

/* Who keeps finished pieces of long steps over an interruption.  A piece is what one task has
 * worked out, in the kind's fixed layout; the keeper sees to it that a piece comes back only for
 * the inputs and options that it was made from.  Both are called from any thread. */
typedef struct apsm_keeper {
    void *user;
    bool (*recall)(void *user, const char *kind, size_t i, size_t size, void *data);
    apsm_status (*keep)(apsm_context *ctx, void *user, const char *kind, size_t i, size_t size,
                        const void *data);
} apsm_keeper;
/* keeper is borrowed; NULL: nothing is kept. */
APSM_API void apsm_context_set_keeper(apsm_context *ctx, const apsm_keeper *keeper);
/* Whether piece i of that kind had been kept; then its bytes are in data. */
APSM_API bool apsm_recall(const apsm_context *ctx, const char *kind, size_t i, size_t size,
                          void *data);
APSM_API apsm_status apsm_keep(apsm_context *ctx, const char *kind, size_t i, size_t size,
                               const void *data) APSM_NODISCARD;

APSM_API void apsm_log(apsm_context *ctx, apsm_log_level level, const char *format, ...)
    APSM_PRINTF(3, 4);
APSM_API void apsm_report_progress(apsm_context *ctx, const apsm_progress *progress);

/* Records why a call fails, in one line that names the file, the place in it and the remedy,
 * and returns status, so that it can be written `return apsm_fail(ctx, APSM_ERR_IO, ...)`.
 * ctx may be NULL. */
APSM_API apsm_status apsm_fail(apsm_context *ctx, apsm_status status, const char *format, ...)
    APSM_PRINTF(3, 4);

/* The line of the last apsm_fail, or "" ; valid until the next call with ctx. */
APSM_API const char *apsm_error_text(const apsm_context *ctx);

/* Runs fn(task_ctx, i, worker, user) for i = 0..n-1 on the context's threads, in any order.
 * worker (0..threads-1) tells which scratch to use: two tasks never share one at a time.
 * task_ctx is for this task alone (its own error line, its log is kept until the end).
 * All tasks run even if some fail; the status and line of the failing task with the smallest
 * i are returned, whatever the number of threads.  Tasks not yet started when the interrupt
 * flag rises are skipped (APSM_ERR_INTERRUPTED).  If stage is not NULL, progress is reported
 * after each task. */
typedef apsm_status (*apsm_task_fn)(apsm_context *task_ctx, size_t i, int worker, void *user);
APSM_API apsm_status apsm_parallel_for(apsm_context *ctx, size_t n, apsm_task_fn fn, void *user,
                                       const char *stage) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
