/* fault.c -- preloaded into the program under test, to let its file operations fail.
 *
 *   APSM_FAULT=MODE:N   what happens at the N-th operation that changes the disk (N from 1):
 *       kill     the process is killed; if that is a write, after half of it
 *       int      it gets SIGINT and goes on; likewise term and hup
 *       twice    it gets SIGINT twice
 *       full     this and all later operations that need space fail with ENOSPC
 *       once     this one fails with ENOSPC, if it needs space
 *       readonly this and all later operations fail with EROFS
 *       count    nothing; when the program ends, how many there were, which was the last that needs
 *                space, and the milliseconds of CPU time are written to APSM_FAULT_COUNT
 *       slow     every look at a clock finds it N milliseconds later, and an fsync takes a second
 * more; how many checkpoints of optimize were written goes to APSM_FAULT_COUNT none     nothing
 *   APSM_FAULT=cpu-MODE:N   the same after N milliseconds of CPU time, for kill, int, term, hup:
 * unlike a time on the clock it is about the same place however busy the machine is
 *
 * Standard streams are left alone.  In every mode but slow the clocks stand still, and memory is
 * not measured, so that a manifest and a report are the same bytes whenever they were made. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static atomic_long count, last_needing_space, checkpoints, now_ms;
static char mode[16];
static long at;

static int is(const char *word)
{
    return strcmp(mode, word) == 0;
}

static void on_time(int signal)
{
    (void)signal;
    if (is("cpu-kill")) raise(SIGKILL);
    if (is("cpu-int")) raise(SIGINT);
    if (is("cpu-term")) raise(SIGTERM);
    if (is("cpu-hup")) raise(SIGHUP);
}

/* The timer that strikes is also the one that measures: they need not agree with another. */
enum { FOREVER = 1000000 };

static void set_timer(long ms)
{
    const struct sigaction action = { .sa_handler = on_time, .sa_flags = SA_RESTART };
    const struct itimerval after = { .it_value = { ms / 1000, ms % 1000 * 1000 } };
    sigaction(SIGPROF, &action, NULL);
    setitimer(ITIMER_PROF, &after, NULL);
}

static long timer_ms(void)
{
    struct itimerval left;
    getitimer(ITIMER_PROF, &left);
    return FOREVER - left.it_value.tv_sec * 1000 - left.it_value.tv_usec / 1000;
}

__attribute__((constructor)) static void read_mode(void)
{
    const char *text = getenv("APSM_FAULT"), *colon = text ? strchr(text, ':') : NULL;
    if (!colon || (size_t)(colon - text) >= sizeof mode) return;
    memcpy(mode, text, (size_t)(colon - text));
    at = strtol(colon + 1, NULL, 10);
    if (strncmp(mode, "cpu-", 4) == 0) set_timer(at);
    if (strcmp(mode, "count") == 0) set_timer(FOREVER);
}

__attribute__((destructor)) static void tell_count(void)
{
    const char *path = getenv("APSM_FAULT_COUNT");
    FILE *file = path && (is("count") || is("slow")) ? fopen(path, "w") : NULL;
    if (!file) return;
    if (is("slow"))
        fprintf(file, "%ld\n", atomic_load(&checkpoints));
    else
        fprintf(file, "%ld %ld %ld\n", atomic_load(&count), atomic_load(&last_needing_space),
                timer_ms());
    fclose(file);
}

int clock_gettime(clockid_t id, struct timespec *t)
{
    (void)id;
    const long ms = is("slow") ? atomic_fetch_add(&now_ms, at) + at : 0;
    *t = (struct timespec){ ms / 1000, ms % 1000 * 1000000 };
    return 0;
}

/* (Its first parameter has another type in GNU C.) */
int getrusage(__rusage_who_t who, struct rusage *usage)
{
    (void)who;
    *usage = (struct rusage){ 0 };
    return 0;
}

static void send_signals(void)
{
    if (is("int") || is("twice")) raise(SIGINT);
    if (is("twice")) raise(SIGINT);
    if (is("term")) raise(SIGTERM);
    if (is("hup")) raise(SIGHUP);
}

/* Counts an operation; 0 if it may go on, else the errno it fails with.  kill does not return
 * unless the caller wants to be killed half way (*half). */
static int operation(int needs_space, int *half)
{
    const long n = atomic_fetch_add(&count, 1) + 1;
    if (needs_space) atomic_store(&last_needing_space, n); /* by two threads at once: never last */
    if (is("kill") && n == at) {
        if (half)
            *half = 1;
        else
            raise(SIGKILL);
    }
    if (n == at) send_signals();
    if (is("full") && n >= at && needs_space) return ENOSPC;
    if (is("once") && n == at && needs_space) return ENOSPC;
    if (is("readonly") && n >= at) return EROFS;
    return 0;
}

#define NEXT(name)                                                                                 \
    static __typeof__(&name) next;                                                                 \
    if (!next) next = (__typeof__(&name))dlsym(RTLD_NEXT, #name)
#define FAIL_IF(error)                                                                             \
    do {                                                                                           \
        const int e = (error);                                                                     \
        if (e) {                                                                                   \
            errno = e;                                                                             \
            return -1;                                                                             \
        }                                                                                          \
    } while (0)

static int open_any(int (*next)(const char *, int, ...), const char *path, int flags, mode_t bits)
{
    if (flags & O_CREAT) FAIL_IF(operation(1, NULL));
    return next(path, flags, bits);
}

static mode_t bits_of(int flags, va_list args)
{
    return flags & O_CREAT ? va_arg(args, mode_t) : 0;
}

int open(const char *path, int flags, ...)
{
    NEXT(open);
    va_list args;
    va_start(args, flags);
    const mode_t bits = bits_of(flags, args);
    va_end(args);
    return open_any(next, path, flags, bits);
}

int open64(const char *path, int flags, ...)
{
    NEXT(open64);
    va_list args;
    va_start(args, flags);
    const mode_t bits = bits_of(flags, args);
    va_end(args);
    return open_any(next, path, flags, bits);
}

ssize_t write(int fd, const void *data, size_t size)
{
    NEXT(write);
    int half = 0;
    if (fd <= 2) return next(fd, data, size);
    FAIL_IF(operation(1, &half));
    if (!half) return next(fd, data, size);
    const ssize_t written = next(fd, data, size / 2);
    raise(SIGKILL);
    return written;
}

int fsync(int fd)
{
    NEXT(fsync);
    atomic_fetch_add(&now_ms, 1000);
    FAIL_IF(operation(1, NULL));
    return next(fd);
}

int ftruncate(int fd, off_t length)
{
    NEXT(ftruncate);
    FAIL_IF(operation(0, NULL));
    return next(fd, length);
}

int rename(const char *from, const char *to)
{
    NEXT(rename);
    if (strstr(to, "/optimize.ckpt")) atomic_fetch_add(&checkpoints, 1);
    FAIL_IF(operation(1, NULL));
    return next(from, to);
}

int unlink(const char *path)
{
    NEXT(unlink);
    FAIL_IF(operation(0, NULL));
    return next(path);
}

int remove(const char *path)
{
    NEXT(remove);
    FAIL_IF(operation(0, NULL));
    return next(path);
}

int mkdir(const char *path, mode_t bits)
{
    NEXT(mkdir);
    FAIL_IF(operation(1, NULL));
    return next(path, bits);
}
