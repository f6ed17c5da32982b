/* Checkpoints.  Layout (docs/formats.md): a header of 16 bytes, sections of a 40-byte head, their
 * bytes and zeros up to a multiple of 8, and a last section without a name that holds the SHA-256
 * of all before it.  So a file can be written in one go and no altered byte goes unnoticed. */
#include "files/checkpoint_file.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "files/io.h"

enum { VERSION = 1, BYTE_ORDER_MARK = 0x01020304, DIGEST = 32 };
static const char magic[8] = { 'A', 'P', 'S', 'M', '\r', '\n', 'C', 'K' };

typedef struct header {
    char magic[8];
    uint32_t version, byte_order;
} header;

typedef struct section_head {
    char name[APSM_SECTION_NAME];
    uint64_t size;
} section_head;

static size_t padding(uint64_t size)
{
    return (size_t)(-size & 7);
}

/* ---- Writing ---- */

struct apsm_checkpoint_writer {
    apsm_context *ctx;
    apsm_writer *file;
    apsm_sha256 sha;
    apsm_status status; /* of a section that cannot be written as asked */
};

static void put(apsm_checkpoint_writer *w, const void *data, size_t size)
{
    apsm_sha256_add(&w->sha, data, size);
    apsm_writer_write(w->file, data, size);
}

static void put_section(apsm_checkpoint_writer *w, const char *name, const void *data, size_t size)
{
    static const char zeros[8] = { 0 };
    section_head head = { .size = size };
    memcpy(head.name, name, strlen(name));
    put(w, &head, sizeof head);
    put(w, data, size);
    put(w, zeros, padding(size));
}

apsm_status apsm_checkpoint_open(apsm_context *ctx, const char *path,
                                 apsm_checkpoint_writer **writer)
{
    header h = { .version = VERSION, .byte_order = BYTE_ORDER_MARK };
    *writer = NULL;
    apsm_checkpoint_writer *w = calloc(1, sizeof *w);
    if (!w) return apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
    w->ctx = ctx;
    const apsm_status status = apsm_writer_open(ctx, path, &w->file);
    if (status != APSM_OK) {
        free(w);
        return status;
    }
    memcpy(h.magic, magic, sizeof magic);
    apsm_sha256_begin(&w->sha);
    put(w, &h, sizeof h);
    *writer = w;
    return APSM_OK;
}

void apsm_checkpoint_add(apsm_checkpoint_writer *w, const char *name, const void *data, size_t size)
{
    const size_t length = strlen(name);
    if (length == 0 || length >= APSM_SECTION_NAME)
        w->status =
            apsm_fail(w->ctx, APSM_ERR_ARG, "checkpoint: '%s' is no name of a section", name);
    else
        put_section(w, name, data, size);
}

apsm_status apsm_checkpoint_commit(apsm_checkpoint_writer *w)
{
    unsigned char digest[DIGEST];
    if (!w) return APSM_ERR_ARG;
    if (w->status != APSM_OK) {
        const apsm_status failed = w->status;
        apsm_checkpoint_abort(w);
        return failed;
    }
    const section_head end = { .size = DIGEST };
    put(w, &end, sizeof end);
    apsm_sha256_end(&w->sha, digest);
    apsm_writer_write(w->file, digest, DIGEST);
    const apsm_status status = apsm_writer_commit(w->file);
    free(w);
    return status;
}

void apsm_checkpoint_abort(apsm_checkpoint_writer *w)
{
    if (!w) return;
    apsm_writer_abort(w->file);
    free(w);
}

/* ---- Reading ---- */

struct apsm_checkpoint {
    char *path;
    char *data; /* the whole file; malloc aligns it, the layout its sections */
    size_t size;
};

static apsm_status refuse(apsm_context *ctx, const char *path, const char *why)
{
    return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: %s; remove it and start this step anew", path, why);
}

static apsm_status check_header(apsm_context *ctx, const apsm_checkpoint *c)
{
    header h;
    if (c->size < sizeof h || memcmp(c->data, magic, sizeof magic) != 0)
        return refuse(ctx, c->path, "is no checkpoint of apsm");
    memcpy(&h, c->data, sizeof h);
    if (h.byte_order != BYTE_ORDER_MARK)
        return refuse(ctx, c->path, "is a checkpoint of a machine with another byte order");
    if (h.version != VERSION)
        return refuse(ctx, c->path, "is a checkpoint of another version of apsm");
    return APSM_OK;
}

/* The section that starts at *at; moves *at behind it.  False if it does not fit in the file. */
static bool next_section(const apsm_checkpoint *c, size_t *at, section_head *head, char **data)
{
    if (c->size - *at < sizeof *head) return false;
    memcpy(head, c->data + *at, sizeof *head);
    *at += sizeof *head;
    const size_t rest = c->size - *at;
    if (head->size > rest || padding(head->size) > rest - head->size) return false;
    *data = c->data + *at;
    *at += (size_t)head->size + padding(head->size);
    return memchr(head->name, '\0', sizeof head->name) != NULL;
}

/* Finds the end section and checks the digest and that nothing follows. */
static apsm_status check_sections(apsm_context *ctx, const apsm_checkpoint *c)
{
    size_t at = sizeof(header);
    section_head head;
    char *data;
    do
        if (!next_section(c, &at, &head, &data))
            return refuse(ctx, c->path, "is damaged: it ends too early");
    while (head.name[0]);
    unsigned char digest[DIGEST];
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add(&sha, c->data, (size_t)(data - c->data));
    apsm_sha256_end(&sha, digest);
    if (head.size != DIGEST || memcmp(digest, data, DIGEST) != 0)
        return refuse(ctx, c->path, "is damaged: its check sum does not fit its content");
    return at == c->size ? APSM_OK : refuse(ctx, c->path, "is damaged: something follows its end");
}

apsm_status apsm_checkpoint_read(apsm_context *ctx, const char *path, apsm_checkpoint **checkpoint)
{
    *checkpoint = NULL;
    apsm_checkpoint *c = calloc(1, sizeof *c);
    if (!c || !(c->path = strdup(path))) {
        free(c);
        return apsm_fail_errno(ctx, path, "cannot be read", ENOMEM);
    }
    apsm_status status = apsm_read_file(ctx, path, SIZE_MAX / 4, &c->data, &c->size);
    if (status == APSM_OK) status = check_header(ctx, c);
    if (status == APSM_OK) status = check_sections(ctx, c);
    if (status != APSM_OK) {
        apsm_checkpoint_free(c);
        return status;
    }
    *checkpoint = c;
    return APSM_OK;
}

void apsm_checkpoint_free(apsm_checkpoint *c)
{
    if (!c) return;
    free(c->path);
    free(c->data);
    free(c);
}

const void *apsm_checkpoint_find(const apsm_checkpoint *c, const char *name, size_t *size)
{
    size_t at = sizeof(header);
    section_head head;
    char *data;
    *size = 0;
    while (next_section(c, &at, &head, &data) && head.name[0])
        if (strcmp(head.name, name) == 0) {
            *size = (size_t)head.size;
            return data;
        }
    return NULL;
}

apsm_status apsm_checkpoint_get(apsm_context *ctx, const apsm_checkpoint *c, const char *name,
                                void *data, size_t size)
{
    size_t found;
    const void *block = apsm_checkpoint_find(c, name, &found);
    if (!block)
        return apsm_fail(ctx, APSM_ERR_STATE,
                         "%s: holds no '%s'; it belongs to another step, start this one anew",
                         c->path, name);
    if (found != size)
        return apsm_fail(
            ctx, APSM_ERR_STATE,
            "%s: '%s' has %zu bytes where %zu are expected; the options or inputs have "
            "changed, start this step anew",
            c->path, name, found, size);
    if (size) memcpy(data, block, size);
    return APSM_OK;
}
