/* Particles as CSV: a header x,y,z, then one particle a line.  As strict as the particle files, so
 * that a broken one never passes for a shorter one. */
#include "files/point_formats.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "files/io.h"

#define CSV_LIMIT ((size_t)1 << 30)

/* A field without the blanks around it. */
typedef struct field {
    const char *text;
    size_t length;
} field;

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

/* The fields of the line [text, end): how many there are, of which the first three are kept. */
static size_t split(const char *text, const char *end, field f[3])
{
    for (size_t k = 0;; k++) {
        const char *comma = memchr(text, ',', (size_t)(end - text));
        const char *first = text, *last = comma ? comma : end;
        while (first < last && is_blank(*first)) first++;
        while (first < last && is_blank(last[-1])) last--;
        if (k < 3) f[k] = (field){ first, (size_t)(last - first) };
        if (!comma) return k + 1;
        text = comma + 1;
    }
}

static bool is_header(const field f[3])
{
    for (size_t k = 0; k < 3; k++)
        if (f[k].length != 1 || tolower((unsigned char)f[k].text[0]) != "xyz"[k]) return false;
    return true;
}

static apsm_status parse_line(apsm_context *ctx, const char *path, size_t line, size_t fields,
                              const field f[3], double x[3])
{
    if (fields != 3)
        return apsm_fail(ctx, APSM_ERR_FORMAT,
                         "%s:%zu: %zu field%s; every line must be three numbers x,y,z", path, line,
                         fields, fields == 1 ? "" : "s");
    for (size_t k = 0; k < 3; k++)
        if (!apsm_parse_number(f[k].text, f[k].length, &x[k]))
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s:%zu: '%.*s' is not a finite number; every line must be three "
                             "numbers x,y,z",
                             path, line, f[k].length < APSM_SHOWN ? (int)f[k].length : APSM_SHOWN,
                             f[k].text);
    return APSM_OK;
}

static apsm_status parse(apsm_context *ctx, const char *path, const char *at, const char *end,
                         size_t *n, double *P)
{
    field f[3];
    for (size_t line = 1; at < end; line++) {
        const char *stop = memchr(at, '\n', (size_t)(end - at));
        if (!stop) stop = end;
        const size_t fields = split(at, stop, f);
        at = stop + 1;
        if (line == 1 && (fields != 3 || !is_header(f)))
            return apsm_fail(ctx, APSM_ERR_FORMAT, "%s:1: the first line must be x,y,z", path);
        if (line == 1 || (fields == 1 && f[0].length == 0)) continue; /* blank lines */
        APSM_TRY(parse_line(ctx, path, line, fields, f, P + 3 * *n));
        ++*n;
    }
    return APSM_OK;
}

apsm_status apsm_points_csv_read(apsm_context *ctx, const char *path, size_t *n, double **P)
{
    char *data;
    size_t size, lines = 1;
    *n = 0;
    *P = NULL;
    APSM_TRY(apsm_read_text(ctx, path, CSV_LIMIT, &data, &size));
    for (size_t k = 0; k < size; k++) lines += data[k] == '\n';
    double *points = malloc(3 * lines * sizeof *points);
    const apsm_status status = points ? parse(ctx, path, data, data + size, n, points)
                                      : apsm_fail_errno(ctx, path, "cannot be read", ENOMEM);
    free(data);
    if (status == APSM_OK)
        *P = points;
    else
        free(points);
    return status;
}

apsm_status apsm_points_csv_write(apsm_context *ctx, const char *path, size_t n, const double *P)
{
    apsm_writer *w;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    apsm_writer_printf(w, "x,y,z\n");
    for (size_t k = 0; k < 3 * n; k++) {
        apsm_writer_number(w, P[k]);
        apsm_writer_write(w, k % 3 == 2 ? "\n" : ",", 1);
    }
    return apsm_writer_commit(w);
}
