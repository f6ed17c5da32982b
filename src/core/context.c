#include "apsm/context.h"

#include <math.h>
#include <omp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "core/deal.h"
#include "core/hold.h"
#include "core/number.h"

enum { ERROR_LENGTH = 1024 };

/* A line logged inside a parallel task, kept until the tasks have ended. */
typedef struct log_line {
    struct log_line *next;
    apsm_log_level level;
    char text[];
} log_line;

struct apsm_context {
    int threads;
    uint64_t seed;
    apsm_log_fn log;
    void *log_user;
    apsm_progress_fn progress;
    void *progress_user;
    const volatile int *interrupt;
    apsm_between_fn between;
    void *between_user;
    const apsm_keeper *keeper;
    const apsm_deal *deal;
    void *held; /* see hold.h */
    apsm_release_fn release;
    bool is_task;            /* logs go to lines instead of to the sink */
    log_line *first, **last; /* of a task */
    char error[ERROR_LENGTH];
};

apsm_context *apsm_context_new(void)
{
    apsm_context *ctx = calloc(1, sizeof *ctx);
    if (ctx) ctx->threads = 1;
    return ctx;
}

void apsm_context_free(apsm_context *ctx)
{
    if (ctx) apsm_hold(ctx, NULL, NULL);
    free(ctx);
}

void apsm_context_set_threads(apsm_context *ctx, int threads)
{
    ctx->threads = threads > 0 ? threads : 1;
}
int apsm_context_threads(const apsm_context *ctx)
{
    return ctx->threads;
}
void apsm_context_set_seed(apsm_context *ctx, uint64_t seed)
{
    ctx->seed = seed;
}
uint64_t apsm_context_seed(const apsm_context *ctx)
{
    return ctx->seed;
}

void apsm_context_set_log(apsm_context *ctx, apsm_log_fn fn, void *user)
{
    ctx->log = fn;
    ctx->log_user = user;
}

void apsm_context_set_progress(apsm_context *ctx, apsm_progress_fn fn, void *user)
{
    ctx->progress = fn;
    ctx->progress_user = user;
}

void apsm_context_set_between(apsm_context *ctx, apsm_between_fn fn, void *user)
{
    ctx->between = fn;
    ctx->between_user = user;
}

void apsm_context_set_keeper(apsm_context *ctx, const apsm_keeper *keeper)
{
    ctx->keeper = keeper;
}

bool apsm_recall(const apsm_context *ctx, const char *kind, size_t i, size_t size, void *data)
{
    const apsm_keeper *k = ctx->keeper;
    return k && k->recall(k->user, kind, i, size, data);
}

apsm_status apsm_keep(apsm_context *ctx, const char *kind, size_t i, size_t size, const void *data)
{
    const apsm_keeper *k = ctx->keeper;
    return k ? k->keep(ctx, k->user, kind, i, size, data) : APSM_OK;
}

void *apsm_held(const apsm_context *ctx, apsm_release_fn release)
{
    return ctx->release == release ? ctx->held : NULL;
}

bool apsm_hold(apsm_context *ctx, void *object, apsm_release_fn release)
{
    if (ctx->is_task) return false;
    if (ctx->held) ctx->release(ctx->held);
    ctx->held = object;
    ctx->release = release;
    return true;
}

void apsm_context_set_deal(apsm_context *ctx, const apsm_deal *deal)
{
    ctx->deal = deal;
}

void apsm_context_set_interrupt(apsm_context *ctx, const volatile int *flag)
{
    ctx->interrupt = flag;
}

bool apsm_interrupted(const apsm_context *ctx)
{
    return ctx->interrupt && *ctx->interrupt;
}

static void keep_line(apsm_context *task, apsm_log_level level, const char *text)
{
    const size_t length = strlen(text) + 1;
    log_line *line = malloc(sizeof *line + length);
    if (!line) return; /* a message lost for want of memory: the work itself goes on */
    line->next = NULL;
    line->level = level;
    memcpy(line->text, text, length);
    *task->last = line;
    task->last = &line->next;
}

void apsm_log(apsm_context *ctx, apsm_log_level level, const char *format, ...)
{
    if (!ctx || (!ctx->is_task && !ctx->log)) return;
    char text[ERROR_LENGTH];
    va_list args;
    va_start(args, format);
    apsm_vprint(text, sizeof text, format, args);
    va_end(args);
    if (ctx->is_task)
        keep_line(ctx, level, text);
    else
        ctx->log(ctx->log_user, level, text);
}

void apsm_report_progress(apsm_context *ctx, const apsm_progress *progress)
{
    if (ctx && ctx->progress) ctx->progress(ctx->progress_user, progress);
}

/* What is quoted from a file may hold anything; an error is one line. */
static void keep_one_line(char *text)
{
    for (; *text; text++)
        if ((unsigned char)*text < ' ' || *text == '\x7f') *text = '?';
}

apsm_status apsm_fail(apsm_context *ctx, apsm_status status, const char *format, ...)
{
    if (ctx) {
        /* The arguments may quote the previous line, so it is replaced last. */
        char text[ERROR_LENGTH];
        va_list args;
        va_start(args, format);
        apsm_vprint(text, sizeof text, format, args);
        va_end(args);
        keep_one_line(text);
        memcpy(ctx->error, text, sizeof text);
    }
    return status;
}

const char *apsm_error_text(const apsm_context *ctx)
{
    return ctx ? ctx->error : "";
}

/* What the tasks of one loop share.  The arrays have one entry a task. */
typedef struct loop {
    apsm_context *parent;
    size_t n, done;
    apsm_task_fn fn;
    void *user;
    const char *stage;
    apsm_context *task;
    apsm_status *status;
} loop;

static void begin_task(loop *l, size_t i)
{
    apsm_context *task = &l->task[i];
    task->threads = 1;
    task->seed = l->parent->seed;
    task->interrupt = l->parent->interrupt;
    task->keeper = l->parent->keeper;
    task->is_task = true;
    task->last = &task->first;
}

static void show_progress(const loop *l, size_t done)
{
    const apsm_progress p = {
        .stage = l->stage, .done = done, .total = l->n, .loss = { NAN, NAN, NAN }, .mismatched = NAN
    };
    if (l->stage) apsm_report_progress(l->parent, &p);
}

/* Only the calling thread talks to the sinks; the others' progress shows at its next task, and
 * the last of all is told after the loop. */
static void count_task(loop *l)
{
    size_t done;
#pragma omp atomic capture
    done = ++l->done;
    if (done < l->n && omp_get_thread_num() == 0) show_progress(l, done);
}

static void run_task(loop *l, size_t i)
{
    begin_task(l, i);
    if (apsm_interrupted(l->parent)) {
        l->status[i] = APSM_ERR_INTERRUPTED;
        return;
    }
    l->status[i] = l->fn(&l->task[i], i, omp_get_thread_num(), l->user);
    if (l->parent->between) l->parent->between(l->parent->between_user);
    count_task(l);
}

/* Tells the parent, in the order of the tasks, what they logged. */
static void end_task(loop *l, size_t i)
{
    log_line *line = l->task[i].first;
    while (line) {
        log_line *next = line->next;
        apsm_log(l->parent, line->level, "%s", line->text);
        free(line);
        line = next;
    }
}

static apsm_status first_failure(loop *l)
{
    for (size_t i = 0; i < l->n; i++)
        if (l->status[i] != APSM_OK && l->status[i] != APSM_ERR_INTERRUPTED)
            return apsm_fail(l->parent, l->status[i], "%s", l->task[i].error);
    for (size_t i = 0; i < l->n; i++)
        if (l->status[i] != APSM_OK) return l->status[i];
    return APSM_OK;
}

apsm_status apsm_parallel_for(apsm_context *ctx, size_t n, apsm_task_fn fn, void *user,
                              const char *stage)
{
    loop l = { .parent = ctx, .n = n, .fn = fn, .user = user, .stage = stage };
    if (n == 0) return APSM_OK;
    l.task = calloc(n, sizeof *l.task);
    l.status = calloc(n, sizeof *l.status);
    apsm_status result = APSM_ERR_MEMORY;
    if (l.task && l.status) {
        const int threads = (size_t)ctx->threads < n ? ctx->threads : (int)n;
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads)
        for (size_t i = 0; i < n; i++) run_task(&l, i);
        if (l.done == n) show_progress(&l, n);
        for (size_t i = 0; i < n; i++) end_task(&l, i);
        result = first_failure(&l);
    }
    free(l.task);
    free(l.status);
    return result;
}

/* ---- dealing ---- */

/* Some of a loop's tasks. */
typedef struct part {
    apsm_task_fn fn;
    void *user;
    size_t rank, size;
    bool own; /* this process's; else the others' */
} part;

/* Task k of those. */
static apsm_status run_part(apsm_context *ctx, size_t k, int worker, void *user)
{
    const part *p = user;
    const size_t others = p->size - 1;
    if (p->own) return p->fn(ctx, p->rank + k * p->size, worker, p->user);
    const size_t at = k % others; /* among the others of one round */
    return p->fn(ctx, k / others * p->size + (at < p->rank ? at : at + 1), worker, p->user);
}

static size_t own_count(const apsm_deal *d, size_t n)
{
    return n > d->rank ? (n - d->rank - 1) / d->size + 1 : 0;
}

apsm_status apsm_dealt_for(apsm_context *ctx, size_t n, apsm_task_fn fn, void *user,
                           const char *stage)
{
    const apsm_deal *d = ctx->deal;
    if (!d) return apsm_parallel_for(ctx, n, fn, user, stage);
    part p = { fn, user, d->rank, d->size, true };
    const size_t own = own_count(d, n);
    APSM_TRY(apsm_parallel_for(ctx, own, run_part, &p, stage));
    APSM_TRY(d->meet(ctx, d->user));
    p.own = false;
    return apsm_parallel_for(ctx, n - own, run_part, &p, NULL);
}

static bool gathers(const apsm_context *ctx)
{
    return ctx->deal && ctx->deal->gather;
}

static size_t element_of(const size_t *element, size_t k)
{
    return element ? element[k] : k;
}

bool apsm_is_own(const apsm_context *ctx, size_t element)
{
    return !gathers(ctx) || element % ctx->deal->size == ctx->deal->rank;
}

/* Tasks by a list. */
typedef struct picked {
    apsm_task_fn fn;
    void *user;
    size_t *task;
} picked;

static apsm_status run_picked(apsm_context *ctx, size_t k, int worker, void *user)
{
    const picked *p = user;
    return p->fn(ctx, p->task[k], worker, p->user);
}

apsm_status apsm_own_for(apsm_context *ctx, size_t n, const size_t *element, apsm_task_fn fn,
                         void *user, const char *stage)
{
    if (!gathers(ctx)) return apsm_parallel_for(ctx, n, fn, user, stage);
    picked p = { fn, user, malloc((n + 1) * sizeof *p.task) };
    size_t own = 0;
    if (!p.task) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < n; k++)
        if (apsm_is_own(ctx, element_of(element, k))) p.task[own++] = k;
    const apsm_status status = apsm_parallel_for(ctx, own, run_picked, &p, stage);
    free(p.task);
    return status;
}

/* A gathering: elements go in turns of at most `room` a process. */
typedef struct gathering {
    const apsm_deal *deal;
    size_t n, bytes, room;
    const size_t *element;
    unsigned char *array, *own, *all; /* own: room elements; all: room a process */
} gathering;

/* Copies what the process `rank` has at numbers first..first + room - 1 of its elements from the
 * array to `buffer`, or back. */
static void copy_turn(const gathering *g, size_t rank, size_t first, bool back,
                      unsigned char *buffer)
{
    size_t number = 0;
    for (size_t k = 0; k < g->n && number < first + g->room; k++) {
        const size_t e = element_of(g->element, k);
        if (e % g->deal->size != rank || number++ < first) continue;
        unsigned char *here = g->array + e * g->bytes,
                      *there = buffer + (number - 1 - first) * g->bytes;
        memcpy(back ? here : there, back ? there : here, g->bytes);
    }
}

/* The largest number of elements that a process has. */
static size_t most_of_one(const gathering *g)
{
    size_t most = 0;
    for (size_t rank = 0; rank < g->deal->size; rank++) {
        size_t n = 0;
        for (size_t k = 0; k < g->n; k++) n += element_of(g->element, k) % g->deal->size == rank;
        most = n > most ? n : most;
    }
    return most;
}

apsm_status apsm_gather(apsm_context *ctx, size_t n, const size_t *element, size_t bytes,
                        void *array)
{
    enum { TURN = 1 << 24 }; /* bytes of a process */
    if (!gathers(ctx) || bytes == 0) return APSM_OK;
    gathering g = { .deal = ctx->deal,
                    .n = n,
                    .bytes = bytes,
                    .room = bytes < TURN ? TURN / bytes : 1,
                    .element = element,
                    .array = array };
    const size_t most = most_of_one(&g), size = g.deal->size;
    if (most < g.room) g.room = most;
    g.own = calloc(g.room + 1, bytes);
    g.all = malloc((g.room * size + 1) * bytes);
    const bool enough = g.own && g.all;
    for (size_t first = 0; enough && first < most; first += g.room) {
        copy_turn(&g, g.deal->rank, first, false, g.own);
        g.deal->gather(g.deal->user, g.room * bytes, g.own, g.all);
        for (size_t rank = 0; rank < size; rank++)
            if (rank != g.deal->rank)
                copy_turn(&g, rank, first, true, g.all + rank * g.room * bytes);
    }
    free(g.own);
    free(g.all);
    return enough ? APSM_OK : apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for what others did");
}

/* ---- loops that are shared, kept or gathered ---- */

static size_t made_count(const apsm_shared_loop *l)
{
    size_t n = 0;
    while (n < APSM_MOST_MADE && l->made[n].array) n++;
    return n;
}

static size_t made_bytes(const apsm_shared_loop *l)
{
    size_t bytes = 0;
    for (size_t k = 0; k < made_count(l); k++) bytes += l->made[k].bytes;
    return bytes;
}

/* Element e of all arrays to the piece, or back. */
static void copy_made(const apsm_shared_loop *l, size_t e, bool back, unsigned char *piece)
{
    for (size_t k = 0; k < made_count(l); piece += l->made[k++].bytes) {
        unsigned char *here = (unsigned char *)l->made[k].array + e * l->made[k].bytes;
        memcpy(back ? here : piece, back ? piece : here, l->made[k].bytes);
    }
}

static bool recall_made(const apsm_context *ctx, const apsm_shared_loop *l, size_t e,
                        unsigned char *piece)
{
    const bool found = apsm_recall(ctx, l->kind, e, made_bytes(l), piece);
    if (found) copy_made(l, e, true, piece);
    return found;
}

/* Recalls element e, or makes and keeps it. */
static apsm_status make_or_recall(apsm_context *ctx, size_t e, int worker, void *user)
{
    const apsm_shared_loop *l = user;
    if (!ctx->keeper || made_count(l) == 0) return l->fn(ctx, e, worker, l->user);
    unsigned char *piece = malloc(made_bytes(l) + 1);
    apsm_status status = piece ? APSM_OK : APSM_ERR_MEMORY;
    if (piece && !recall_made(ctx, l, e, piece)) {
        status = l->fn(ctx, e, worker, l->user);
        if (status == APSM_OK) {
            copy_made(l, e, false, piece);
            status = apsm_keep(ctx, l->kind, e, made_bytes(l), piece);
        }
    }
    free(piece);
    return status;
}

/* What a share finds of the others' elements: zeros, or, where they decide, all of it. */
static apsm_status take_others(apsm_context *ctx, const apsm_shared_loop *l)
{
    const apsm_deal *d = ctx->deal;
    unsigned char *piece = calloc(made_bytes(l) + 1, 1);
    apsm_status status = piece ? APSM_OK : APSM_ERR_MEMORY;
    if (piece && l->decides) status = d->meet(ctx, d->user);
    for (size_t e = 0; e < l->n && status == APSM_OK; e++) {
        if (e % d->size == d->rank) continue;
        if (!l->decides)
            copy_made(l, e, true, piece);
        else if (!recall_made(ctx, l, e, piece))
            status = APSM_ERR_INTERRUPTED;
    }
    free(piece);
    return status;
}

static apsm_status gather_made(apsm_context *ctx, const apsm_shared_loop *l)
{
    APSM_TRY(apsm_own_for(ctx, l->n, NULL, l->fn, l->user, l->stage));
    for (size_t k = 0; k < made_count(l); k++)
        APSM_TRY(apsm_gather(ctx, l->n, NULL, l->made[k].bytes, l->made[k].array));
    return APSM_OK;
}

apsm_status apsm_shared_for(apsm_context *ctx, const apsm_shared_loop *given)
{
    apsm_shared_loop l = *given;
    if (gathers(ctx)) return gather_made(ctx, &l);
    if (!ctx->deal) return apsm_parallel_for(ctx, l.n, make_or_recall, &l, l.stage);
    part own = { make_or_recall, &l, ctx->deal->rank, ctx->deal->size, true };
    const size_t n = own_count(ctx->deal, l.n);
    APSM_TRY(apsm_parallel_for(ctx, n, run_part, &own, l.stage));
    return take_others(ctx, &l);
}

bool apsm_is_share(const apsm_context *ctx)
{
    return ctx->deal && !ctx->deal->gather;
}
