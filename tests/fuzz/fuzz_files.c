/* Any bytes through the readers of projects, spreadsheets, points, landmarks, tables, definitions,
 * models and checkpoints, for libFuzzer: the first byte chooses one, the rest is the file.  `make
 * fuzz` builds and runs it. */
#include <stdint.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "readers.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A file of this process, in memory where that is possible. */
static const char *path_of(const struct any_reader *r)
{
    static char folder[64], path[128];
    if (!folder[0]) {
        const char *const base = access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp";
        snprintf(folder, sizeof folder, "%s/apsm-fuzz-%ld", base, (long)getpid());
        mkdir(folder, 0700);
    }
    snprintf(path, sizeof path, "%s/%s", folder, r->name);
    return path;
}

static void put(const char *path, const char *bytes, size_t size)
{
    FILE *const f = fopen(path, "wb");
    if (!f || fwrite(bytes, 1, size, f) != size || fclose(f) != 0) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 2) return 0;
    const struct any_reader *const r = &any_reader[data[0] % ANY_READERS];
    const char *const path = path_of(r);
    apsm_context *const ctx = apsm_context_new();
    size_t length = size - 1;
    char *bytes = malloc(length);
    if (!ctx || !bytes) abort();
    memcpy(bytes, data + 1, length);
    if (strstr(r->name, ".xlsx")) {
        char *const zip = reader_workbook(bytes, length, &length);
        free(bytes);
        bytes = zip;
    }
    if (strstr(r->name, ".ckpt") || strstr(r->name, ".apsm")) reader_seal(bytes, length);
    put(path, bytes, length);
    apsm_context_set_threads(ctx, 1);
    if (r->read(ctx, path) != APSM_OK && !apsm_error_text(ctx)[0])
        abort(); /* a failure has a line */
    unlink(path);
    free(bytes);
    apsm_context_free(ctx);
    return 0;
}
