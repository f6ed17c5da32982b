#define _GNU_SOURCE /* pthread_setattr_default_np */
#include "room.h"

#include <pthread.h>
#include <sys/mman.h>
#include <sys/resource.h>

/* ---- stack ---- */

typedef struct main_job {
    int (*job)(int argc, char **argv);
    int argc, code;
    char **argv;
} main_job;

static void *run(void *user)
{
    main_job *m = user;
    m->code = m->job(m->argc, m->argv);
    return NULL;
}

int cli_with_stack(int (*job)(int argc, char **argv), int argc, char **argv)
{
    enum { LEAST = 1 << 20, GIVEN = 8 << 20 };
    struct rlimit limit;
    pthread_attr_t attributes;
    pthread_t thread;
    main_job m = { job, argc, 0, argv };
    const bool enough = getrlimit(RLIMIT_STACK, &limit) != 0 || limit.rlim_cur >= LEAST;
    if (enough || pthread_attr_init(&attributes) != 0) return job(argc, argv);
    pthread_attr_setstacksize(&attributes, GIVEN);
    pthread_setattr_default_np(&attributes); /* those of OpenMP, too */
    const bool started = pthread_create(&thread, &attributes, run, &m) == 0;
    pthread_attr_destroy(&attributes);
    if (!started) return job(argc, argv);
    pthread_join(thread, NULL);
    return m.code;
}

/* ---- address space ---- */

apsm_status cli_check_room(apsm_context *ctx, int threads)
{
    /* Of a calling thread: a buffer of OpenBLAS; of a thread, its stack and malloc's arena. */
    const size_t megabyte = (size_t)1 << 20, buffer = 130 * megabyte, own = 72 * megabyte;
    struct rlimit limit;
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return APSM_OK;
    const size_t wanted = (size_t)threads * (buffer + own) + buffer + 32 * megabyte;
    void *room = mmap(NULL, wanted, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (room != MAP_FAILED) {
        munmap(room, wanted);
        return APSM_OK;
    }
    return apsm_fail(ctx, APSM_ERR_MEMORY,
                     "the limit of address space (ulimit -v) leaves no room for linear algebra on "
                     "%d threads: %zu MB more are needed; raise it, or use fewer --threads",
                     threads, wanted / megabyte);
}
