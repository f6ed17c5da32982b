/* One unlinked file, written with pwrite (so that a full disk is an error, not a signal) and mapped
 * read-only in chunks.  Pages are dropped from the process, not from the system's cache: when they
 * are touched again, most come back without the disk.  All go at once when the limit is near: the
 * shapes are visited in turns, where to drop the oldest first would be no better. */
#define _DEFAULT_SOURCE /* madvise, mkostemp */
#define _GNU_SOURCE
#include "files/store.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "files/io.h"
#include "files/stored.h"

enum { ALIGNMENT = 64 };
static const size_t least_chunk = (size_t)1 << 28;

typedef struct chunk {
    unsigned char *base;
    size_t size;
} chunk;

struct apsm_store {
    char *folder;
    int fd, statm; /* statm: -1 if this system does not tell a process its size */
    size_t limit, page;
    pthread_mutex_t lock;
    /* under the lock */
    chunk *chunks;
    size_t n, room;
    size_t start; /* of the last chunk in the file */
    size_t used;  /* of it */
    size_t calls; /* of trim, where the size is not known */
};

/* ---- open and close ---- */

apsm_status apsm_store_open(apsm_context *ctx, const char *folder, size_t limit, apsm_store **store)
{
    int error = ENOMEM;
    apsm_store *s = *store = calloc(1, sizeof *s);
    if (!s) return apsm_fail_errno(ctx, folder, "no room for shapes", error);
    pthread_mutex_init(&s->lock, NULL);
    s->fd = s->statm = -1;
    s->limit = limit;
    s->page = (size_t)sysconf(_SC_PAGESIZE);
    s->folder = strdup(folder);
    if (s->folder) s->fd = apsm_open_unnamed(folder, &error);
    if (s->fd >= 0) {
        s->statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
        return APSM_OK;
    }
    apsm_store_close(s);
    *store = NULL;
    return apsm_fail_errno(ctx, folder, "no file for shapes can be made there", error);
}

void apsm_store_close(apsm_store *s)
{
    if (!s) return;
    for (size_t k = 0; k < s->n; k++) munmap(s->chunks[k].base, s->chunks[k].size);
    if (s->fd >= 0) close(s->fd);
    if (s->statm >= 0) close(s->statm);
    pthread_mutex_destroy(&s->lock);
    free(s->chunks);
    free(s->folder);
    free(s);
}

size_t apsm_store_bytes(const apsm_store *s)
{
    return s->start + s->used;
}

/* ---- put ---- */

static size_t padded(size_t bytes, size_t to)
{
    return (bytes + to - 1) / to * to;
}

/* A new chunk with room for that many bytes; the mapping may reach beyond the file's end, the
 * arrays do not.  Returns an errno. */
static int add_chunk(apsm_store *s, size_t bytes)
{
    const size_t size = padded(bytes > least_chunk ? bytes : least_chunk, s->page);
    const size_t start = s->start + (s->n ? s->chunks[s->n - 1].size : 0);
    if (s->n == s->room) {
        chunk *grown = realloc(s->chunks, (2 * s->room + 8) * sizeof *grown);
        if (!grown) return ENOMEM;
        s->chunks = grown;
        s->room = 2 * s->room + 8;
    }
    void *base = mmap(NULL, size, PROT_READ, MAP_SHARED, s->fd, (off_t)start);
    if (base == MAP_FAILED) return errno;
    s->chunks[s->n++] = (chunk){ base, size };
    s->start = start;
    s->used = 0;
    return 0;
}

/* Room for that many bytes: *base in memory, *offset in the file.  Returns an errno. */
static int take_room(apsm_store *s, size_t bytes, unsigned char **base, size_t *offset)
{
    int error = 0;
    pthread_mutex_lock(&s->lock);
    if (s->n == 0 || bytes > s->chunks[s->n - 1].size - s->used) error = add_chunk(s, bytes);
    if (!error) {
        *base = s->chunks[s->n - 1].base + s->used;
        *offset = s->start + s->used;
        s->used += bytes;
    }
    pthread_mutex_unlock(&s->lock);
    return error;
}

apsm_status store_put(apsm_context *ctx, apsm_store *s, const array_list *arrays)
{
    size_t total = 0, offset = 0, at = 0;
    unsigned char *base = NULL;
    for (size_t k = 0; k < arrays->n; k++) total += padded(arrays->at[k].bytes, ALIGNMENT);
    int error = total > 0 ? take_room(s, total, &base, &offset) : 0;
    for (size_t k = 0; k < arrays->n && !error; k++) {
        error = apsm_write_at(s->fd, arrays_get(arrays, k), arrays->at[k].bytes, offset + at);
        at += padded(arrays->at[k].bytes, ALIGNMENT);
    }
    if (error) return apsm_fail_errno(ctx, s->folder, "shapes cannot be stored there", error);
    at = 0;
    for (size_t k = 0; k < arrays->n; k++) {
        free(arrays_get(arrays, k));
        arrays_set(arrays, k, base + at);
        at += padded(arrays->at[k].bytes, ALIGNMENT);
    }
    return APSM_OK;
}

/* ---- trim ---- */

/* Resident bytes of the process, and those of them that are of mapped files; false if unknown. */
static bool measure(const apsm_store *s, size_t *resident, size_t *mapped)
{
    char text[128];
    unsigned long long size, all, shared;
    const ssize_t n = s->statm < 0 ? -1 : pread(s->statm, text, sizeof text - 1, 0);
    if (n <= 0) return false;
    text[n] = '\0';
    if (sscanf(text, "%llu %llu %llu", &size, &all, &shared) != 3) return false;
    *resident = (size_t)all * s->page;
    *mapped = (size_t)shared * s->page;
    return true;
}

/* An eighth is left for what is touched until the next look.  Where others hold nearly all of the
 * limit, there must at least be something to gain. */
static bool is_due(apsm_store *s)
{
    enum { LOOK = 32 };
    size_t resident, mapped;
    if (measure(s, &resident, &mapped))
        return resident > s->limit - s->limit / 8 && mapped > s->limit / 16;
    return s->calls++ % LOOK == 0;
}

void apsm_store_trim(apsm_store *s)
{
    if (pthread_mutex_trylock(&s->lock) != 0) return; /* somebody is at it */
    if (is_due(s)) /* advice: to refuse it costs memory, nothing else */
        for (size_t k = 0; k < s->n; k++)
            madvise(s->chunks[k].base, s->chunks[k].size, MADV_DONTNEED);
    pthread_mutex_unlock(&s->lock);
}
