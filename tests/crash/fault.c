/* fault.c -- preloaded into the program under test, to let its file operations fail.
 *
 *   APSM_FAULT=MODE:N   what happens at the N-th operation that changes the disk (N from 1):
 *       kill     the process is killed; if that is a write, after half of it
 *       int      it gets SIGINT and goes on
 *       full     this and all later operations that need space fail with ENOSPC
 *       once     this one fails with ENOSPC, if it needs space
 *       readonly this and all later operations fail with EROFS
 *       count    nothing; when the program ends, how many there were is written to APSM_FAULT_COUNT
 *
 * Standard streams are left alone. */
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
#include <sys/stat.h>
#include <unistd.h>

static atomic_long count;
static char mode[16];
static long at;

__attribute__((constructor)) static void read_mode(void)
{
    const char *text = getenv("APSM_FAULT"), *colon = text ? strchr(text, ':') : NULL;
    if (!colon || (size_t)(colon - text) >= sizeof mode) return;
    memcpy(mode, text, (size_t)(colon - text));
    at = strtol(colon + 1, NULL, 10);
}

__attribute__((destructor)) static void tell_count(void)
{
    const char *path = getenv("APSM_FAULT_COUNT");
    FILE *file = path && strcmp(mode, "count") == 0 ? fopen(path, "w") : NULL;
    if (!file) return;
    fprintf(file, "%ld\n", atomic_load(&count));
    fclose(file);
}

static int is(const char *word)
{
    return strcmp(mode, word) == 0;
}

/* Counts an operation; 0 if it may go on, else the errno it fails with.  kill does not return
 * unless the caller wants to be killed half way (*half). */
static int operation(int needs_space, int *half)
{
    const long n = atomic_fetch_add(&count, 1) + 1;
    if (is("kill") && n == at) {
        if (half)
            *half = 1;
        else
            raise(SIGKILL);
    }
    if (is("int") && n == at) raise(SIGINT);
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
    FAIL_IF(operation(1, NULL));
    return next(fd);
}

int rename(const char *from, const char *to)
{
    NEXT(rename);
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
