/* JSON through jansson, with messages that name the place, and laid out for people: structure
 * indented, a row of plain values on one line. */
#include "files/io.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { INDENT = 4 };
#define JSON_LIMIT ((size_t)1 << 31)

apsm_status apsm_json_read(apsm_context *ctx, const char *path, struct json_t **root)
{
    *root = NULL;
    char *data;
    size_t size;
    json_error_t error;
    APSM_TRY(apsm_read_file(ctx, path, JSON_LIMIT, &data, &size));
    /* Editors on Windows like to begin a file with a byte order mark. */
    const size_t bom = size >= 3 && memcmp(data, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
    json_t *json =
        json_loadb(data + bom, size - bom, JSON_REJECT_DUPLICATES | JSON_DECODE_ANY, &error);
    free(data);
    if (!json)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s:%d:%d: %s; correct the file or remove it", path,
                         error.line, error.column, error.text);
    *root = json;
    return APSM_OK;
}

/* Where JSON goes: into a file and, if that is to be sealed, into its digest. */
typedef struct sink {
    apsm_writer *file;
    bool sealed;
    apsm_sha256 sha;
} sink;

static const char seal[] = "sha256"; /* the last key of a sealed file */

static int put(const char *text, size_t size, void *user)
{
    sink *s = user;
    if (s->sealed) apsm_sha256_add(&s->sha, text, size);
    apsm_writer_write(s->file, text, size);
    return 0;
}

static bool is_plain(const json_t *json)
{
    return !json_is_object(json) && !json_is_array(json);
}

static bool is_row(const json_t *json)
{
    size_t i;
    json_t *value;
    if (!json_is_array(json)) return is_plain(json);
    json_array_foreach(json, i, value) if (!is_plain(value)) return false;
    return true;
}

static bool dump_flat(sink *s, const json_t *json)
{
    return json_dump_callback(json, put, s, JSON_ENCODE_ANY | JSON_REAL_PRECISION(17)) == 0;
}

static bool dump_key(sink *s, const char *key)
{
    json_t *text = json_string(key);
    const bool written = text && dump_flat(s, text);
    json_decref(text);
    put(": ", 2, s);
    return written;
}

static void new_line(sink *s, int depth)
{
    put("\n", 1, s);
    for (int k = 0; k < depth; k++) put("    ", INDENT, s);
}

static bool dump(sink *s, const json_t *json, int depth);

static bool dump_members(sink *s, const json_t *json, int depth)
{
    const bool object = json_is_object(json);
    const size_t n = object ? json_object_size(json) : json_array_size(json);
    void *at = object ? json_object_iter((json_t *)json) : NULL;
    for (size_t i = 0; i < n; i++) {
        const json_t *value = object ? json_object_iter_value(at) : json_array_get(json, i);
        if (i > 0) put(",", 1, s);
        new_line(s, depth);
        if (object) {
            if (!dump_key(s, json_object_iter_key(at))) return false;
            at = json_object_iter_next((json_t *)json, at);
        }
        if (!dump(s, value, depth)) return false;
    }
    return true;
}

static bool dump(sink *s, const json_t *json, int depth)
{
    const bool object = json_is_object(json);
    const size_t n = object ? json_object_size(json) : json_array_size(json);
    if (is_row(json) || n == 0) return dump_flat(s, json);
    put(object ? "{" : "[", 1, s);
    if (!dump_members(s, json, depth + 1)) return false;
    new_line(s, depth);
    put(object ? "}" : "]", 1, s);
    return true;
}

/* An object with the digest of everything before the last key as that key's value. */
static bool dump_sealed(sink *s, const json_t *json)
{
    unsigned char digest[32];
    char hex[65];
    s->sealed = true;
    apsm_sha256_begin(&s->sha);
    put("{", 1, s);
    if (!dump_members(s, json, 1)) return false;
    if (json_object_size(json) > 0) put(",", 1, s);
    new_line(s, 1);
    s->sealed = false;
    apsm_sha256_end(&s->sha, digest);
    apsm_sha256_hex(digest, hex);
    if (!dump_key(s, seal)) return false;
    put("\"", 1, s);
    put(hex, 64, s);
    put("\"\n}", 3, s);
    return true;
}

static apsm_status refuse_value(apsm_context *ctx, const char *path)
{
    return apsm_fail(ctx, APSM_ERR_NONFINITE,
                     "%s: not written, a value of it is not a finite number", path);
}

static apsm_status write_json(apsm_context *ctx, const char *path, const json_t *root,
                              bool (*dump_root)(sink *, const json_t *))
{
    if (!root) return refuse_value(ctx, path);
    sink s = { 0 };
    APSM_TRY(apsm_writer_open(ctx, path, &s.file));
    if (!dump_root(&s, root)) {
        apsm_writer_abort(s.file);
        return apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
    }
    put("\n", 1, &s);
    return apsm_writer_commit(s.file);
}

static bool dump_plain(sink *s, const json_t *root)
{
    return dump(s, root, 0);
}

apsm_status apsm_json_write(apsm_context *ctx, const char *path, const struct json_t *root)
{
    return write_json(ctx, path, root, dump_plain);
}

apsm_status apsm_json_write_sealed(apsm_context *ctx, const char *path, struct json_t *root)
{
    json_object_del(root, seal);
    return write_json(ctx, path, root, dump_sealed);
}

/* ---- long lists ---- */

/* The members of head and the beginning of the list. */
static bool dump_head(sink *s, const json_t *head, const char *key)
{
    put("{", 1, s);
    if (!dump_members(s, head, 1)) return false;
    if (json_object_size(head) > 0) put(",", 1, s);
    new_line(s, 1);
    if (!dump_key(s, key)) return false;
    put("[", 1, s);
    return true;
}

static apsm_status dump_values(apsm_context *ctx, sink *s, const char *path,
                               const apsm_json_list *list)
{
    for (size_t i = 0; i < list->n; i++) {
        json_t *value = NULL;
        APSM_TRY(list->value(ctx, i, list->user, &value));
        if (!value) return refuse_value(ctx, path);
        if (i > 0) put(",", 1, s);
        new_line(s, 2);
        const bool written = dump(s, value, 2);
        json_decref(value);
        if (!written) return apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
    }
    if (list->n > 0) new_line(s, 1);
    put("]\n}\n", 4, s);
    return APSM_OK;
}

apsm_status apsm_json_write_list(apsm_context *ctx, const char *path, const struct json_t *head,
                                 const apsm_json_list *list)
{
    sink s = { 0 };
    if (!head) return refuse_value(ctx, path);
    APSM_TRY(apsm_writer_open(ctx, path, &s.file));
    apsm_status status = dump_head(&s, head, list->key)
                             ? dump_values(ctx, &s, path, list)
                             : apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
    if (status == APSM_OK) return apsm_writer_commit(s.file);
    apsm_writer_abort(s.file);
    return status;
}

/* What ends a sealed file: `"sha256": "`, 64 digits, `"`, line end, `}`, line end. */
static bool seal_holds(const char *data, size_t size)
{
    static const char begin[] = "\"sha256\": \"", end[] = "\"\n}\n";
    enum { BEGIN = sizeof begin - 1, END = sizeof end - 1, SEAL = BEGIN + 64 + END };
    apsm_sha256 sha;
    unsigned char digest[32];
    char hex[65];
    if (size < SEAL) return false;
    const char *at = data + size - SEAL;
    apsm_sha256_begin(&sha);
    apsm_sha256_add(&sha, data, size - SEAL);
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, hex);
    return memcmp(at, begin, BEGIN) == 0 && memcmp(at + BEGIN, hex, 64) == 0 &&
           memcmp(at + BEGIN + 64, end, END) == 0;
}

apsm_status apsm_json_is_intact(apsm_context *ctx, const char *path, bool *intact)
{
    char *data;
    size_t size;
    *intact = false;
    APSM_TRY(apsm_read_file(ctx, path, JSON_LIMIT, &data, &size));
    *intact = seal_holds(data, size);
    free(data);
    return APSM_OK;
}

apsm_status apsm_json_check(apsm_context *ctx, const char *path, const struct json_t *root,
                            const char *format, int version)
{
    const char *found = json_string_value(json_object_get(root, "format"));
    const json_t *number = json_object_get(root, "version");
    if (!found || strcmp(found, format) != 0)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: its \"format\" is %s%.*s%s, not \"%s\"; give the right file", path,
                         found ? "\"" : "", APSM_SHOWN, found ? found : "missing",
                         found ? "\"" : "", format);
    if (!json_is_integer(number) || json_integer_value(number) < 1)
        return apsm_fail(ctx, APSM_ERR_FORMAT, "%s: its \"version\" is no positive whole number",
                         path);
    if (json_integer_value(number) > version)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s: version %lld of %s is newer than this apsm reads (%d); use a newer "
                         "apsm",
                         path, (long long)json_integer_value(number), format, version);
    return APSM_OK;
}

struct json_t *apsm_json_vector(size_t n, const double *x)
{
    json_t *array = json_array();
    for (size_t i = 0; array && i < n; i++)
        if (json_array_append_new(array, json_real(x[i])) != 0) {
            json_decref(array);
            array = NULL;
        }
    return array;
}

struct json_t *apsm_json_matrix(size_t n, size_t m, const double *x)
{
    json_t *rows = json_array();
    for (size_t i = 0; rows && i < n; i++)
        if (json_array_append_new(rows, apsm_json_vector(m, x + i * m)) != 0) {
            json_decref(rows);
            rows = NULL;
        }
    return rows;
}

struct json_t *apsm_json_vtext(const char *format, va_list args)
{
    const locale_t before = apsm_numbers_begin();
    json_t *const text = json_vsprintf(format, args);
    apsm_numbers_end(before);
    return text;
}

struct json_t *apsm_json_number_or_null(double x)
{
    return isfinite(x) ? json_real(x) : json_null();
}

static bool get_vector(const json_t *json, size_t n, double *x)
{
    if (!json_is_array(json) || json_array_size(json) != n) return false;
    for (size_t i = 0; i < n; i++) {
        const json_t *value = json_array_get(json, i);
        if (!json_is_number(value)) return false;
        x[i] = json_number_value(value);
    }
    return true;
}

bool apsm_json_get_matrix(const struct json_t *json, size_t n, size_t m, double *x)
{
    if (m == 0) return get_vector(json, n, x);
    if (!json_is_array(json) || json_array_size(json) != n) return false;
    for (size_t i = 0; i < n; i++)
        if (!get_vector(json_array_get(json, i), m, x + i * m)) return false;
    return true;
}
