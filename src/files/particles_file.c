/* Particle files: parsed line by line, strictly, so that a broken one never passes for a shorter
 * one (ShapeWorks' reader stops silently at the first thing it cannot read). */
#include "files/particles_file.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/io.h"

#define PARTICLES_LIMIT ((size_t)1 << 30)
static const char *const blank = " \t\r\v\f";

/* Reads the numbers of one line [text, end) into x[3]; *count is how many there are (4 stands for
 * more than 3).  False if a token is no number: *bad points to it. */
static bool parse_line(const char *text, const char *end, double x[3], int *count, const char **bad,
                       int *bad_length)
{
    *count = 0;
    for (;;) {
        while (text < end && *text && strchr(blank, *text)) text++;
        if (text == end) return true;
        const char *token = text;
        while (text < end && (!*text || !strchr(blank, *text))) text++;
        double value;
        if (!apsm_parse_number(token, (size_t)(text - token), &value)) {
            *bad = token;
            *bad_length = text - token < APSM_SHOWN ? (int)(text - token) : APSM_SHOWN;
            return false;
        }
        if (*count < 3) x[*count] = value;
        if (*count < 4) ++*count;
    }
}

static size_t count_lines(const char *data, size_t size)
{
    size_t lines = 1;
    for (const char *c = data; (c = memchr(c, '\n', size - (size_t)(c - data))); c++) lines++;
    return lines;
}

static apsm_status parse(apsm_context *ctx, const char *path, const char *data, size_t size,
                         size_t *n, double *P)
{
    const char *end = data + size, *bad = "";
    size_t line = 0;
    *n = 0;
    for (const char *at = data; at < end; at++) {
        const char *stop = memchr(at, '\n', (size_t)(end - at));
        int count, length = 0;
        if (!stop) stop = end;
        line++;
        if (!parse_line(at, stop, P + 3 * *n, &count, &bad, &length))
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s:%zu:%zu: '%.*s' is not a finite number; every line must be three "
                             "numbers \"x y z\"",
                             path, line, (size_t)(bad - at) + 1, length, bad);
        if (count != 0 && count != 3)
            return apsm_fail(ctx, APSM_ERR_FORMAT,
                             "%s:%zu: %s than three numbers; every line must be \"x y z\"", path,
                             line, count < 3 ? "fewer" : "more");
        *n += count == 3;
        at = stop;
    }
    return *n > 0 ? APSM_OK
                  : apsm_fail(ctx, APSM_ERR_FORMAT, "%s: holds no particles; make it anew", path);
}

/* ---- Traps of other programs ---- */

/* Most digits of a number of the file, from the first that is not 0: "0.0120" has 3, "1200" 4. */
static int most_digits(const char *data, size_t size)
{
    int most = 0, digits = 0;
    bool exponent = false;
    for (size_t k = 0; k < size; k++) {
        const char c = data[k];
        if (c == '\n' || strchr(blank, c)) digits = 0, exponent = false;
        if (c == 'e' || c == 'E') exponent = true;
        if (c >= '0' && c <= '9' && !exponent) digits += digits > 0 || c != '0';
        if (digits > most) most = digits;
    }
    return most;
}

/* C++ writes 6 digits unless told otherwise: far from the origin that is coarse against a shape. */
static void warn_of_digits(apsm_context *ctx, const char *path, const char *data, size_t size,
                           size_t n, const double *P)
{
    enum { DIGITS = 6 };
    double most = 0, lo[3], hi[3], diagonal = 0;
    for (size_t k = 0; k < 3 * n; k++) {
        most = fmax(most, fabs(P[k]));
        lo[k % 3] = k < 3 ? P[k] : fmin(lo[k % 3], P[k]);
        hi[k % 3] = k < 3 ? P[k] : fmax(hi[k % 3], P[k]);
    }
    for (int c = 0; c < 3; c++) diagonal = hypot(diagonal, hi[c] - lo[c]);
    const double step = most > 0 ? pow(10, floor(log10(most)) - DIGITS + 1) : 0;
    if (n > 1 && step > 1e-4 * diagonal && most_digits(data, size) == DIGITS)
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%s: 6 digits are steps of %g at coordinates up to %.6g, and the particles span "
                 "%.3g; write them with 9 digits, or move the shapes towards the origin",
                 path, step, most, diagonal);
}

static void warn_of_traps(apsm_context *ctx, const char *path, const char *data, size_t size,
                          size_t n, const double *P)
{
    const char last = data[size - 1];
    if (last != '\n' && !strchr(blank, last))
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%s: ends without a newline; all %zu particles are read, but ShapeWorks would "
                 "lose the last one: add a newline",
                 path, n);
    warn_of_digits(ctx, path, data, size, n, P);
}

apsm_status apsm_particles_read(apsm_context *ctx, const char *path, size_t *n, double **P)
{
    char *data;
    size_t size;
    *n = 0;
    *P = NULL;
    APSM_TRY(apsm_read_text(ctx, path, PARTICLES_LIMIT, &data, &size));
    double *points = malloc((count_lines(data, size) + 1) * 3 * sizeof *points);
    const apsm_status status = points ? parse(ctx, path, data, size, n, points)
                                      : apsm_fail_errno(ctx, path, "cannot be read", ENOMEM);
    if (status == APSM_OK) warn_of_traps(ctx, path, data, size, *n, points);
    free(data);
    if (status != APSM_OK) {
        free(points);
        *n = 0;
        return status;
    }
    *P = points;
    return APSM_OK;
}

apsm_status apsm_particles_read_n(apsm_context *ctx, const char *path, size_t n, double *P)
{
    size_t found;
    double *points;
    APSM_TRY(apsm_particles_read(ctx, path, &found, &points));
    if (found == n) memcpy(P, points, 3 * n * sizeof *P);
    free(points);
    if (found == n) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_FORMAT,
                     "%s: holds %zu particles where %zu are expected; every shape needs the same "
                     "number",
                     path, found, n);
}

apsm_status apsm_particles_round(apsm_context *ctx, size_t n, double *P)
{
    apsm_status status = APSM_OK;
    const locale_t before = apsm_numbers_begin();
    for (size_t k = 0; k < 3 * n && status == APSM_OK; k++) {
        char text[APSM_NUMBER_LENGTH];
        snprintf(text, sizeof text, "%.9g", P[k]);
        if (isfinite(P[k]))
            P[k] = strtod(text, NULL);
        else
            status = apsm_fail(ctx, APSM_ERR_NONFINITE,
                               "coordinate %zu of particle %zu is not "
                               "finite",
                               k % 3, k / 3);
    }
    apsm_numbers_end(before);
    return status;
}

apsm_status apsm_particles_write(apsm_context *ctx, const char *path, size_t n, const double *P)
{
    for (size_t i = 0; i < 3 * n; i++)
        if (!isfinite(P[i]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE,
                             "%s: not written, coordinate %zu of particle %zu is not finite", path,
                             i % 3, i / 3);
    apsm_writer *w;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    for (size_t j = 0; j < n; j++)
        apsm_writer_printf(w, "%.9g %.9g %.9g\n", P[3 * j], P[3 * j + 1], P[3 * j + 2]);
    return apsm_writer_commit(w);
}
