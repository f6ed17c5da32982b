#include "core/option.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"

static size_t min3(size_t a, size_t b, size_t c)
{
    const size_t m = a < b ? a : b;
    return m < c ? m : c;
}

size_t apsm_edit_distance(const char *a, const char *b)
{
    enum { LONGEST = 63 };
    size_t row[LONGEST + 1];
    const size_t na = strlen(a), nb = strlen(b);
    if (nb > LONGEST) return na > nb ? na : nb;
    for (size_t j = 0; j <= nb; j++) row[j] = j;
    for (size_t i = 1; i <= na; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= nb; j++) {
            const size_t above = row[j];
            row[j] = min3(above + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1]));
            diagonal = above;
        }
    }
    return row[nb];
}

static apsm_status out_of_range(apsm_context *ctx, const apsm_option_info *o, const char *value)
{
    if (strcmp(o->name, "particles") == 0)
        return apsm_fail(
            ctx, APSM_ERR_ARG,
            "option particles = %s: give a whole number from 7 (%.10g with method psm) "
            "to %.10g, or auto",
            value, o->least, o->most);
    return apsm_fail(ctx, APSM_ERR_ARG, "option %s = %s: give %s from %.10g to %.10g", o->name,
                     value, o->kind == APSM_OPTION_INT ? "a whole number" : "a number", o->least,
                     o->most);
}

/* strtol alone would also take " 1". */
static bool parse_whole(const char *text, long *x)
{
    char *end = NULL;
    if (!strchr("+-0123456789", *text) || !*text) return false;
    errno = 0;
    *x = strtol(text, &end, 10);
    return end != text && !*end && !errno;
}

static apsm_status set_number(apsm_context *ctx, const apsm_option_info *o, const char *value,
                              void *at)
{
    if (o->kind == APSM_OPTION_INT) {
        long x;
        if (!parse_whole(value, &x) || (double)x < o->least || (double)x > o->most)
            return out_of_range(ctx, o, value);
        *(long *)at = x;
        return APSM_OK;
    }
    double x;
    if (!apsm_parse_number(value, strlen(value), &x) || x < o->least || x > o->most)
        return out_of_range(ctx, o, value);
    *(double *)at = x;
    return APSM_OK;
}

static apsm_status set_bool(apsm_context *ctx, const apsm_option_info *o, const char *value,
                            bool *at)
{
    static const char *const yes[] = { "true", "1", "yes", "on" };
    static const char *const no[] = { "false", "0", "no", "off" };
    for (size_t k = 0; k < sizeof yes / sizeof yes[0]; k++) {
        if (strcmp(value, yes[k]) == 0) return *at = true, APSM_OK;
        if (strcmp(value, no[k]) == 0) return *at = false, APSM_OK;
    }
    return apsm_fail(ctx, APSM_ERR_ARG, "option %s = %s: give true or false", o->name, value);
}

static apsm_status set_enum(apsm_context *ctx, const apsm_option_info *o, const char *value,
                            int *at)
{
    const size_t length = strlen(value);
    const char *word = o->words;
    for (int k = 0; word; k++) {
        const char *bar = strchr(word, '|');
        const size_t n = bar ? (size_t)(bar - word) : strlen(word);
        if (n == length && strncmp(word, value, n) == 0) return *at = k, APSM_OK;
        word = bar ? bar + 1 : NULL;
    }
    return apsm_fail(ctx, APSM_ERR_ARG, "option %s = %s: give one of %s", o->name, value, o->words);
}

apsm_status apsm_option_parse(apsm_context *ctx, const apsm_option_info *row, const char *value,
                              void *at)
{
    switch (row->kind) {
    case APSM_OPTION_BOOL:
        return set_bool(ctx, row, value, at);
    case APSM_OPTION_ENUM:
        return set_enum(ctx, row, value, at);
    default:
        return set_number(ctx, row, value, at);
    }
}

static void word_at(const char *words, int k, char text[64])
{
    while (k-- > 0) words = strchr(words, '|') + 1;
    const char *bar = strchr(words, '|');
    snprintf(text, 64, "%.*s", bar ? (int)(bar - words) : (int)strlen(words), words);
}

static void get_real(double x, char text[64])
{
    const locale_t before = apsm_numbers_begin();
    snprintf(text, 64, "%.17g", x);
    apsm_numbers_end(before);
}

void apsm_option_print(const apsm_option_info *row, const void *at, char text[64])
{
    switch (row->kind) {
    case APSM_OPTION_INT:
        snprintf(text, 64, "%ld", *(const long *)at);
        break;
    case APSM_OPTION_REAL:
        get_real(*(const double *)at, text);
        break;
    case APSM_OPTION_BOOL:
        snprintf(text, 64, "%s", *(const bool *)at ? "true" : "false");
        break;
    case APSM_OPTION_ENUM:
        word_at(row->words, *(const int *)at, text);
        break;
    }
}
