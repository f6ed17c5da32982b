#include "folder/model_json.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "folder/names.h"

/* ---- model.json ---- */

/* An array that misses entries, for want of memory or because one was not finite, is none: then its
 * file is refused. */
static json_t *json_modes(const apsm_shape_model *m)
{
    json_t *modes = json_array();
    for (size_t k = 0; k < m->modes; k++)
        json_array_append_new(modes, apsm_json_matrix(m->J, 3, m->mode + k * m->J * 3));
    if (json_array_size(modes) == m->modes) return modes;
    json_decref(modes);
    return NULL;
}

apsm_status model_json_write(apsm_context *ctx, const char *path, const apsm_shape_model *m)
{
    json_t *root = json_pack("{s:s, s:i, s:I, s:I, s:o, s:o, s:o}", "format", FORMAT_MODEL,
                             "version", MODEL_VERSION, "shapes", (json_int_t)m->I, "particles",
                             (json_int_t)m->J, "variances", apsm_json_vector(m->modes, m->variance),
                             "mean", apsm_json_matrix(m->J, 3, m->mean), "modes", json_modes(m));
    const apsm_status status = apsm_json_write(ctx, path, root);
    json_decref(root);
    return status;
}

static size_t get_size(const json_t *object, const char *key)
{
    const json_int_t n = json_integer_value(json_object_get(object, key));
    return n > 0 ? (size_t)n : 0;
}

static bool get_modes(const json_t *modes, apsm_shape_model *m)
{
    for (size_t k = 0; k < m->modes; k++)
        if (!apsm_json_get_matrix(json_array_get(modes, k), m->J, 3, m->mode + k * m->J * 3))
            return false;
    return true;
}

static bool get_variances(const json_t *variances, apsm_shape_model *m)
{
    if (!apsm_json_get_matrix(variances, m->modes, 0, m->variance)) return false;
    for (size_t k = 0; k < m->modes; k++)
        if (!(m->variance[k] > 0) || (k > 0 && m->variance[k] > m->variance[k - 1])) return false;
    return true;
}

static apsm_status take_model(apsm_context *ctx, const char *path, const json_t *root,
                              apsm_shape_model *m)
{
    const json_t *modes = json_object_get(root, "modes"), *mean = json_object_get(root, "mean");
    m->I = get_size(root, "shapes");
    m->J = get_size(root, "particles");
    m->modes = json_array_size(modes);
    const bool fits = m->I > 0 && m->J > 0 && json_array_size(mean) == m->J && m->modes < m->I;
    if (fits) {
        m->mean = malloc(m->J * 3 * sizeof *m->mean);
        m->mode = calloc(m->modes * 3 + 1, m->J * sizeof *m->mode);
        m->variance = malloc((m->modes + 1) * sizeof *m->variance);
        if (!m->mean || !m->mode || !m->variance)
            return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    }
    if (fits && apsm_json_get_matrix(mean, m->J, 3, m->mean) && get_modes(modes, m) &&
        get_variances(json_object_get(root, "variances"), m))
        return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: mean, modes and variances do not fit each other; run `apsm evaluate` "
                     "again",
                     path);
}

apsm_status model_json_read(apsm_context *ctx, const char *path, apsm_shape_model *model)
{
    json_t *root = NULL;
    *model = (apsm_shape_model){ 0 };
    apsm_status status = apsm_json_read(ctx, path, &root);
    if (status == APSM_OK) status = apsm_json_check(ctx, path, root, FORMAT_MODEL, MODEL_VERSION);
    if (status == APSM_OK) status = take_model(ctx, path, root, model);
    if (status != APSM_OK) apsm_shape_model_free(model);
    json_decref(root);
    return status;
}

/* ---- scores.csv ---- */

apsm_status scores_csv_write(apsm_context *ctx, const char *path, const char *const *names,
                             const char *column, const apsm_shape_model *m)
{
    apsm_writer *csv = NULL;
    APSM_TRY(apsm_writer_open(ctx, path, &csv));
    apsm_writer_printf(csv, "name");
    for (size_t k = 0; k < m->modes; k++) apsm_writer_printf(csv, ",%s_%zu", column, k + 1);
    for (size_t i = 0; i < m->I; i++) {
        apsm_writer_printf(csv, "\n");
        apsm_writer_csv(csv, names[i]);
        for (size_t k = 0; k < m->modes; k++) {
            apsm_writer_printf(csv, ",");
            apsm_writer_number(csv, m->score[i * m->modes + k]);
        }
    }
    apsm_writer_printf(csv, "\n");
    return apsm_writer_commit(csv);
}

/* Takes a field of this text, as apsm_writer_csv writes it; false if it is another. */
static bool take_text(const char **at, const char *text)
{
    const char *p = *at;
    const bool quoted = *p == '"';
    for (p += quoted; *text; text++, p++) {
        if (*p != *text) return false;
        if (quoted && *p == '"' && *++p != '"') return false;
    }
    if (quoted && *p++ != '"') return false;
    if (*p && !strchr(",\r\n", *p)) return false;
    *at = p;
    return true;
}

static bool take_number(const char **at, double *x)
{
    if (**at != ',') return false;
    const size_t length = strcspn(*at + 1, ",\r\n");
    if (!apsm_parse_number(*at + 1, length, x)) return false;
    *at += 1 + length;
    return true;
}

static bool take_line_end(const char **at)
{
    if (**at == '\r') ++*at;
    if (**at != '\n') return false;
    ++*at;
    return true;
}

static bool take_header(const char **at, size_t modes)
{
    const size_t length = strcspn(*at, "\r\n");
    size_t columns = 0;
    if (strncmp(*at, "name", 4) != 0) return false;
    for (size_t k = 4; k < length; k++) columns += (*at)[k] == ',';
    *at += length;
    return columns == modes && take_line_end(at);
}

/* The line at which the file is not what it should be; 0: it is. */
static size_t parse_scores(const char *at, const char *const *names, apsm_shape_model *m)
{
    if (!take_header(&at, m->modes)) return 1;
    for (size_t i = 0; i < m->I; i++) {
        if (!take_text(&at, names[i])) return i + 2;
        for (size_t k = 0; k < m->modes; k++)
            if (!take_number(&at, &m->score[i * m->modes + k])) return i + 2;
        if (!take_line_end(&at)) return i + 2;
    }
    return *at ? m->I + 2 : 0;
}

apsm_status scores_csv_read(apsm_context *ctx, const char *path, const char *const *names,
                            apsm_shape_model *m)
{
    char *data = NULL;
    size_t size, line = 0;
    APSM_TRY(apsm_read_file(ctx, path, (size_t)1 << 32, &data, &size));
    free(m->score);
    m->score = calloc(m->I * m->modes + 1, sizeof *m->score);
    if (m->score) line = parse_scores(data, names, m);
    free(data);
    if (!m->score) return apsm_fail(ctx, APSM_ERR_MEMORY, "%s: out of memory", path);
    if (line == 0) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s:%zu: not the scores of this model's shapes; run `apsm evaluate` again",
                     path, line);
}

void model_sha256(const apsm_shape_model *s, const double *T, char hex[65])
{
    unsigned char digest[32];
    apsm_sha256 sha;
    apsm_sha256_begin(&sha);
    apsm_sha256_add(&sha, s->mean, 3 * s->J * sizeof *s->mean);
    apsm_sha256_add(&sha, s->mode, s->modes * 3 * s->J * sizeof *s->mode);
    apsm_sha256_add(&sha, s->variance, s->modes * sizeof *s->variance);
    apsm_sha256_add(&sha, T, 3 * s->J * sizeof *T);
    apsm_sha256_end(&sha, digest);
    apsm_sha256_hex(digest, hex);
}
