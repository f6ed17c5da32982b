#define _DEFAULT_SOURCE /* flock */
#include "files/journal.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "files/io.h"

enum { VERSION = 1, BYTE_ORDER_MARK = 0x01020304 };
static const char magic[8] = { 'A', 'P', 'S', 'M', '\r', '\n', 'J', 'O' };
static const char piece_magic[8] = { 'p', 'i', 'e', 'c', 'e', '\r', '\n', 0 };

typedef struct header {
    char magic[8];
    uint32_t version, byte_order;
} header;

typedef struct piece_head {
    char magic[8];
    journal_key key;
    uint64_t size;
    unsigned char sha256[32]; /* of key, size and content */
} piece_head;

typedef struct entry {
    journal_key key;
    uint64_t at; /* of the content in the file */
    uint64_t size;
} entry;

struct journal {
    char *path;
    int fd;
    entry *entries; /* sorted by key, equal ones by place */
    size_t n, room;
    pthread_mutex_t lock;
    uint64_t end; /* of the file; under the lock */
};

static uint64_t padded(uint64_t size)
{
    return (size + 7) / 8 * 8;
}

static void digest(const piece_head *head, const void *data, unsigned char sha256[32])
{
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add(&sha, &head->key, sizeof head->key);
    apsm_sha256_add(&sha, &head->size, sizeof head->size);
    apsm_sha256_add(&sha, data, (size_t)head->size);
    apsm_sha256_end(&sha, sha256);
}

journal_key journal_key_of(const char *word)
{
    journal_key key;
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add_text(&sha, word);
    apsm_sha256_end(&sha, key.byte);
    return key;
}

/* ---- all of a buffer, in spite of signals; 0 or an errno (EIO: the file has ended) ---- */

static int read_at(int fd, void *data, size_t size, uint64_t at)
{
    for (size_t done = 0; done < size;) {
        const ssize_t n = pread(fd, (char *)data + done, size - done, (off_t)(at + done));
        if (n == 0) return EIO;
        if (n < 0 && errno != EINTR) return errno;
        if (n > 0) done += (size_t)n;
    }
    return 0;
}

static int write_all(int fd, const void *data, size_t size)
{
    for (size_t done = 0; done < size;) {
        const ssize_t n = write(fd, (const char *)data + done, size - done);
        if (n < 0 && errno != EINTR) return errno;
        if (n > 0) done += (size_t)n;
    }
    return 0;
}

/* The file ends at j->end again, and there is where the next piece will be. */
static int cut(const journal *j)
{
    if (ftruncate(j->fd, (off_t)j->end) != 0) return errno;
    return lseek(j->fd, (off_t)j->end, SEEK_SET) < 0 ? errno : 0;
}

/* ---- opening ---- */

static int remember(journal *j, const entry *e)
{
    if (j->n == j->room) {
        const size_t room = 2 * j->room + 64;
        entry *grown = realloc(j->entries, room * sizeof *grown);
        if (!grown) return ENOMEM;
        j->entries = grown;
        j->room = room;
    }
    j->entries[j->n++] = *e;
    return 0;
}

static int by_key(const void *a, const void *b)
{
    const entry *x = a, *y = b;
    const int order = memcmp(&x->key, &y->key, sizeof x->key);
    return order ? order : (x->at > y->at) - (x->at < y->at);
}

static bool is_ours(const journal *j, uint64_t size)
{
    header h;
    return size >= sizeof h && read_at(j->fd, &h, sizeof h, 0) == 0 &&
           memcmp(h.magic, magic, sizeof magic) == 0 && h.version == VERSION &&
           h.byte_order == BYTE_ORDER_MARK;
}

/* From head to head; the contents are looked at when they are asked for. */
static int list_pieces(journal *j, uint64_t size)
{
    piece_head head;
    j->end = sizeof(header);
    while (size - j->end >= sizeof head) {
        const int error = read_at(j->fd, &head, sizeof head, j->end);
        if (error) return error;
        const uint64_t at = j->end + sizeof head, rest = size - at;
        if (memcmp(head.magic, piece_magic, sizeof piece_magic) != 0 || head.size > rest ||
            padded(head.size) > rest)
            break;
        const entry e = { head.key, at, head.size };
        if (remember(j, &e) != 0) return ENOMEM;
        j->end = at + padded(head.size);
    }
    if (j->n > 0) qsort(j->entries, j->n, sizeof *j->entries, by_key);
    return 0;
}

static int begin(journal *j)
{
    header h = { .version = VERSION, .byte_order = BYTE_ORDER_MARK };
    memcpy(h.magic, magic, sizeof magic);
    j->end = 0;
    int error = cut(j);
    if (!error) error = write_all(j->fd, &h, sizeof h);
    if (!error) j->end = sizeof h;
    return error;
}

bool journal_is_there(const journal *j)
{
    struct stat own, other;
    return fstat(j->fd, &own) == 0 && stat(j->path, &other) == 0 && own.st_dev == other.st_dev &&
           own.st_ino == other.st_ino;
}

/* A file that begins otherwise is another's, and is not written to. */
static bool begins_as_ours(const journal *j, uint64_t size)
{
    char head[sizeof magic];
    const size_t n =
        size < sizeof head ? (size_t)size : sizeof head; /* killed while it was begun */
    return read_at(j->fd, head, n, 0) == 0 && memcmp(head, magic, n) == 0;
}

static int open_file(journal *j, bool fresh)
{
    struct stat info;
    if (j->fd >= 0) close(j->fd);
    j->fd = open(j->path, O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
    if (j->fd < 0) return errno;
    if (fstat(j->fd, &info) != 0) return errno;
    if (!S_ISREG(info.st_mode) || !begins_as_ours(j, (uint64_t)info.st_size)) return EEXIST;
    const off_t size = info.st_size;
    if (flock(j->fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) return EBUSY;
    if (!journal_is_there(j)) return ENOENT; /* removed since, by who gathered it */
    if (fresh || !is_ours(j, (uint64_t)size)) return begin(j);
    const int error = list_pieces(j, (uint64_t)size);
    return error ? error : cut(j);
}

apsm_status journal_open(apsm_context *ctx, const char *path, bool fresh, journal **out)
{
    journal *j = *out = calloc(1, sizeof *j);
    if (!j) return apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
    pthread_mutex_init(&j->lock, NULL);
    j->fd = -1;
    j->path = strdup(path);
    int error = j->path ? open_file(j, fresh) : ENOMEM;
    if (error == ENOENT) error = open_file(j, fresh);
    if (!error) return APSM_OK;
    journal_close(j);
    *out = NULL;
    if (error == EEXIST)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s: was not written by apsm and would be replaced; move it away", path);
    if (error == EBUSY)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s: another apsm is writing it; wait until that has ended", path);
    return apsm_fail_errno(ctx, path, "cannot be written", error);
}

/* As above, without a lock or a cut: the writer may be at work. */
static int open_other(journal *j)
{
    struct stat info;
    j->fd = open(j->path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (j->fd < 0) return errno;
    if (fstat(j->fd, &info) != 0) return errno;
    if (!S_ISREG(info.st_mode) || !is_ours(j, (uint64_t)info.st_size)) return ENOENT;
    return list_pieces(j, (uint64_t)info.st_size);
}

apsm_status journal_open_other(apsm_context *ctx, const char *path, journal **out)
{
    journal *j = *out = calloc(1, sizeof *j);
    if (!j) return apsm_fail_errno(ctx, path, "cannot be read", ENOMEM);
    pthread_mutex_init(&j->lock, NULL);
    j->fd = -1;
    j->path = strdup(path);
    const int error = j->path ? open_other(j) : ENOMEM;
    if (!error) return APSM_OK;
    journal_close(j);
    *out = NULL;
    return error == ENOENT ? APSM_OK : apsm_fail_errno(ctx, path, "cannot be read", error);
}

void journal_close(journal *j)
{
    if (!j) return;
    if (j->fd >= 0) close(j->fd);
    pthread_mutex_destroy(&j->lock);
    free(j->entries);
    free(j->path);
    free(j);
}

bool journal_is_one(const char *path)
{
    char head[sizeof magic];
    const int fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    const bool is =
        fd >= 0 && read_at(fd, head, sizeof head, 0) == 0 && memcmp(head, magic, sizeof magic) == 0;
    if (fd >= 0) close(fd);
    return is;
}

apsm_status journal_remove(apsm_context *ctx, const char *path, bool *busy)
{
    if (busy) *busy = false;
    if (!journal_is_one(path)) return APSM_OK;
    const int fd = busy ? open(path, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC) : -1;
    const bool locked = fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    const int error = !locked && unlink(path) != 0 ? errno : 0;
    if (busy) *busy = locked;
    if (fd >= 0) close(fd);
    return error ? apsm_fail_errno(ctx, path, "cannot be removed", error) : APSM_OK;
}

apsm_status journal_flush(apsm_context *ctx, journal *j)
{
    if (fsync(j->fd) == 0) return APSM_OK;
    return apsm_fail_errno(ctx, j->path, "cannot be written", errno);
}

size_t journal_count(const journal *j)
{
    return j->n;
}

/* ---- pieces ---- */

/* The last of that key, or NULL. */
static const entry *look_up(const journal *j, const journal_key *key)
{
    size_t low = 0, high = j->n;
    while (low < high) { /* entries before low are <= key, those from high on are > key */
        const size_t mid = low + (high - low) / 2;
        if (memcmp(&j->entries[mid].key, key, sizeof *key) <= 0)
            low = mid + 1;
        else
            high = mid;
    }
    const entry *e = low > 0 ? &j->entries[low - 1] : NULL;
    return e && memcmp(&e->key, key, sizeof *key) == 0 ? e : NULL;
}

static bool is_whole(const journal *j, const entry *e, const void *data)
{
    piece_head head;
    unsigned char sha256[32];
    if (read_at(j->fd, &head, sizeof head, e->at - sizeof head) != 0) return false;
    digest(&head, data, sha256);
    return memcmp(&head.key, &e->key, sizeof head.key) == 0 && head.size == e->size &&
           memcmp(head.sha256, sha256, sizeof sha256) == 0;
}

apsm_status journal_find(apsm_context *ctx, const journal *j, const journal_key *key, void **data,
                         size_t *size)
{
    const entry *e = look_up(j, key);
    *data = NULL;
    *size = 0;
    if (!e) return APSM_OK;
    void *content = malloc(e->size ? (size_t)e->size : 1);
    if (!content) return apsm_fail_errno(ctx, j->path, "cannot be read", ENOMEM);
    if (read_at(j->fd, content, (size_t)e->size, e->at) != 0 || !is_whole(j, e, content)) {
        free(content); /* to be made again */
        return APSM_OK;
    }
    *data = content;
    *size = (size_t)e->size;
    return APSM_OK;
}

static int append(journal *j, const void *bytes, size_t size)
{
    pthread_mutex_lock(&j->lock);
    int error = write_all(j->fd, bytes, size);
    if (!error)
        j->end += size;
    else
        cut(j); /* if that fails, too, the next to open the file will do it */
    pthread_mutex_unlock(&j->lock);
    return error;
}

apsm_status journal_add(apsm_context *ctx, journal *j, const journal_key *key, const void *data,
                        size_t size)
{
    piece_head head = { .key = *key, .size = size };
    const size_t total = sizeof head + (size_t)padded(size);
    char *bytes = calloc(1, total);
    int error = ENOMEM;
    if (bytes) {
        memcpy(head.magic, piece_magic, sizeof piece_magic);
        digest(&head, data, head.sha256);
        memcpy(bytes, &head, sizeof head);
        if (size) memcpy(bytes + sizeof head, data, size);
        error = append(j, bytes, total);
    }
    free(bytes);
    return error ? apsm_fail_errno(ctx, j->path, "cannot be written", error) : APSM_OK;
}
