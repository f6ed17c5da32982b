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

static int to_writer(const char *text, size_t size, void *user)
{
    apsm_writer_write(user, text, size);
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

static bool dump_flat(apsm_writer *w, const json_t *json)
{
    return json_dump_callback(json, to_writer, w, JSON_ENCODE_ANY | JSON_REAL_PRECISION(17)) == 0;
}

static void new_line(apsm_writer *w, int depth)
{
    apsm_writer_printf(w, "\n%*s", INDENT * depth, "");
}

static bool dump(apsm_writer *w, const json_t *json, int depth)
{
    const bool object = json_is_object(json);
    const size_t n = object ? json_object_size(json) : json_array_size(json);
    if (is_row(json) || n == 0) return dump_flat(w, json);
    void *at = object ? json_object_iter((json_t *)json) : NULL;
    apsm_writer_write(w, object ? "{" : "[", 1);
    for (size_t i = 0; i < n; i++) {
        const json_t *value = object ? json_object_iter_value(at) : json_array_get(json, i);
        if (i > 0) apsm_writer_write(w, ",", 1);
        new_line(w, depth + 1);
        if (object) {
            json_t *key = json_string(json_object_iter_key(at));
            const bool written = key && dump_flat(w, key);
            json_decref(key);
            if (!written) return false;
            apsm_writer_write(w, ": ", 2);
            at = json_object_iter_next((json_t *)json, at);
        }
        if (!dump(w, value, depth + 1)) return false;
    }
    new_line(w, depth);
    apsm_writer_write(w, object ? "}" : "]", 1);
    return true;
}

apsm_status apsm_json_write(apsm_context *ctx, const char *path, const struct json_t *root)
{
    if (!root)
        return apsm_fail(ctx, APSM_ERR_NONFINITE,
                         "%s: not written, a value of it is not a finite number", path);
    apsm_writer *w;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    if (!dump(w, root, 0)) {
        apsm_writer_abort(w);
        return apsm_fail_errno(ctx, path, "cannot be written", ENOMEM);
    }
    apsm_writer_write(w, "\n", 1);
    return apsm_writer_commit(w);
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
