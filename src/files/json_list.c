/* Reads a list that apsm_json_write_list has written, value by value.  Where it begins is found by
 * its line, so a file that was laid out anew is refused. */
#define _POSIX_C_SOURCE 200809L /* getline */
#include "files/io.h"

#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static apsm_status not_ours(apsm_context *ctx, const char *path, const char *key)
{
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: its list '%s' is not as apsm writes it; make the file again", path, key);
}

/* Text of the file up to the list, its beginning included.  *text is malloc'ed. */
static apsm_status read_head_text(apsm_context *ctx, const char *path, const char *key, FILE *f,
                                  char **text)
{
    char *line = NULL, begin[64];
    size_t room = 0, size = 0;
    bool found = false, room_left = true;
    snprintf(begin, sizeof begin, "    \"%s\": [", key);
    *text = NULL;
    for (ssize_t n; !found && (n = getline(&line, &room, f)) > 0;) {
        found = strncmp(line, begin, strlen(begin)) == 0;
        const size_t take = found ? strlen(begin) : (size_t)n;
        char *more = realloc(*text, size + take + 3);
        room_left = more != NULL;
        if (!more) break;
        memcpy(more + size, line, take);
        size += take;
        strcpy(more + size, found ? "]}" : "");
        *text = more;
        /* an empty list ends on the line, and the next value is looked for from here on */
        if (found && fseek(f, -(long)((size_t)n - take), SEEK_CUR) != 0) found = false;
    }
    free(line);
    if (found) return APSM_OK;
    free(*text);
    *text = NULL;
    return room_left ? not_ours(ctx, path, key) : APSM_ERR_MEMORY;
}

/* The next character that is not white. */
static int next_mark(FILE *f)
{
    int c;
    do c = fgetc(f);
    while (c == ' ' || c == '\n' || c == '\t' || c == '\r');
    return c;
}

static apsm_status read_values(apsm_context *ctx, const char *path, const char *key, FILE *f,
                               apsm_json_each *each, void *user)
{
    int c = next_mark(f);
    for (size_t i = 0; c != ']'; i++) {
        json_error_t error;
        if (i > 0 ? c != ',' : ungetc(c, f) == EOF) return not_ours(ctx, path, key);
        json_t *value = json_loadf(f, JSON_DISABLE_EOF_CHECK | JSON_REJECT_DUPLICATES, &error);
        if (!value)
            return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: value %zu of '%s': %s; make the file again",
                             path, i + 1, key, error.text);
        const apsm_status status = each(ctx, i, value, user);
        json_decref(value);
        APSM_TRY(status);
        c = next_mark(f);
    }
    return APSM_OK;
}

static apsm_status read_list(apsm_context *ctx, const char *path, const char *key, FILE *f,
                             struct json_t **head)
{
    char *text;
    json_error_t error;
    APSM_TRY(read_head_text(ctx, path, key, f, &text));
    *head = json_loads(text, JSON_REJECT_DUPLICATES, &error);
    free(text);
    if (!*head) return not_ours(ctx, path, key);
    json_object_del(*head, key);
    return APSM_OK;
}

apsm_status apsm_json_read_list(apsm_context *ctx, const char *path, const char *key,
                                struct json_t **head, apsm_json_each *each, void *user)
{
    int fd;
    *head = NULL;
    APSM_TRY(apsm_open_regular(ctx, path, &fd));
    FILE *f = fdopen(fd, "rb");
    if (!f) {
        const int error = errno;
        close(fd);
        return apsm_fail_errno(ctx, path, "cannot be read", error);
    }
    apsm_status status = read_list(ctx, path, key, f, head);
    if (status == APSM_OK) status = read_values(ctx, path, key, f, each, user);
    fclose(f);
    if (status == APSM_OK) return status;
    json_decref(*head);
    *head = NULL;
    return status;
}
