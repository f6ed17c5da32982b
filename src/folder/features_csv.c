#include "folder/features_csv.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"

typedef struct reading {
    apsm_context *ctx;
    const char *path;
    size_t line;
    const char *const *names;
    sampled_fields *to;
    size_t likely; /* the shape of the line before: that of the next, or the next one */
    bool *known;   /* I x J */
} reading;

static apsm_status refuse(const reading *r, const char *why)
{
    return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                     "%s: line %zu: %s; it is not the table that belongs to this model: run apsm "
                     "evaluate",
                     r->path, r->line, why);
}

/* Ends the field that begins at *at (RFC 4180), without its quotes, and moves *at behind the comma;
 * NULL if there is none. */
static char *take_field(char **at)
{
    char *field = *at, *to = field, *from = field;
    if (!field) return NULL;
    const bool quoted = *from == '"';
    if (quoted) from++;
    for (; *from; from++) {
        if (quoted && *from == '"') {
            if (from[1] != '"') break;
            from++;
        } else if (!quoted && *from == ',') {
            break;
        }
        *to++ = *from;
    }
    if (quoted && *from == '"') from++;
    *at = *from == ',' ? from + 1 : NULL;
    *to = 0;
    return field;
}

static size_t count_fields(const char *line)
{
    size_t n = 1;
    bool quoted = false;
    for (; *line; line++) {
        quoted ^= *line == '"';
        n += *line == ',' && !quoted;
    }
    return n;
}

static apsm_status take_head(reading *r, char *line)
{
    sampled_fields *f = r->to;
    const size_t n = count_fields(line), cells = f->I * f->J;
    const char *first = take_field(&line), *second = take_field(&line);
    if (n < 3 || strcmp(first, "name") != 0 || strcmp(second, "particle") != 0)
        return refuse(r, "the head is not name,particle,FIELD...");
    f->name = calloc(n - 2, sizeof *f->name);
    f->value =
        cells < SIZE_MAX / sizeof(double) / n ? malloc(cells * (n - 2) * sizeof(double)) : NULL;
    r->known = calloc(cells + 1, sizeof *r->known);
    if (!f->name || !f->value || !r->known) return APSM_ERR_MEMORY;
    for (; f->S < n - 2; f->S++) {
        f->name[f->S] = strdup(take_field(&line));
        if (!f->name[f->S]) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

/* The shape of that name, or I. */
static size_t find(const reading *r, const char *name)
{
    const size_t I = r->to->I;
    for (size_t k = 0; k < I; k++) {
        const size_t i = (r->likely + k) % I;
        if (strcmp(r->names[i], name) == 0) return i;
    }
    return I;
}

static apsm_status take_line(reading *r, char *line)
{
    sampled_fields *f = r->to;
    double particle, x;
    if (count_fields(line) != f->S + 2) return refuse(r, "has another number of fields");
    const size_t i = find(r, take_field(&line));
    const char *text = take_field(&line);
    if (!apsm_parse_number(text, strlen(text), &particle) || particle < 0 ||
        particle != floor(particle))
        return refuse(r, "has no number of a particle");
    if (i == f->I) return APSM_OK; /* of a shape that is not asked for */
    if (particle >= (double)f->J) return refuse(r, "has a particle that the model has not");
    r->likely = i;
    const size_t at = i * f->J + (size_t)particle;
    r->known[at] = true;
    for (size_t s = 0; s < f->S; s++) {
        text = take_field(&line);
        if (!apsm_parse_number(text, strlen(text), &x))
            return refuse(r, "has no number in a field");
        f->value[at * f->S + s] = x;
    }
    return APSM_OK;
}

static apsm_status check_all_known(reading *r)
{
    for (size_t k = 0; k < r->to->I * r->to->J; k++)
        if (!r->known[k]) return refuse(r, "the file ends before every particle of every shape");
    return APSM_OK;
}

static apsm_status take_lines(reading *r, char *text)
{
    while (*text) {
        char *end = strchr(text, '\n'), *next = end ? end + 1 : text + strlen(text);
        if (end) *end = 0;
        if (end && end > text && end[-1] == '\r') end[-1] = 0;
        r->line++;
        if (*text) APSM_TRY(r->line == 1 ? take_head(r, text) : take_line(r, text));
        text = next;
    }
    return r->known ? check_all_known(r) : refuse(r, "is empty");
}

apsm_status features_csv_read(apsm_context *ctx, const char *path, size_t I,
                              const char *const *names, size_t J, sampled_fields *fields)
{
    char *text = NULL;
    size_t size;
    *fields = (sampled_fields){ .I = I, .J = J };
    reading r = { .ctx = ctx, .path = path, .names = names, .to = fields };
    apsm_status status = apsm_read_file(ctx, path, SIZE_MAX / 4, &text, &size);
    if (status == APSM_OK) status = take_lines(&r, text);
    free(text);
    free(r.known);
    if (status != APSM_OK) sampled_fields_free(fields);
    return status;
}

apsm_status features_csv_write(apsm_context *ctx, const char *path, const char *const *names,
                               const sampled_fields *f)
{
    apsm_writer *w = NULL;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    apsm_writer_printf(w, "name,particle");
    for (size_t s = 0; s < f->S; s++) {
        apsm_writer_printf(w, ",");
        apsm_writer_csv(w, f->name[s]);
    }
    apsm_writer_printf(w, "\n");
    for (size_t k = 0; k < f->I * f->J; k++) {
        apsm_writer_csv(w, names[k / f->J]);
        apsm_writer_printf(w, ",%zu", k % f->J);
        for (size_t s = 0; s < f->S; s++) {
            apsm_writer_printf(w, ",");
            apsm_writer_number(w, f->value[k * f->S + s]);
        }
        apsm_writer_printf(w, "\n");
    }
    return apsm_writer_commit(w);
}

void sampled_fields_free(sampled_fields *f)
{
    for (size_t s = 0; s < f->S; s++) free(f->name[s]);
    free(f->name);
    free(f->value);
    *f = (sampled_fields){ 0 };
}
