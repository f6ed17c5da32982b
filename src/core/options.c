#include "apsm/options.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"

/* #dflt is the text as it stands in the table: true, not what the macro true stands for. */
#define ROW_INT(name, dflt, lo, hi, doc)  { #name, APSM_OPTION_INT, #dflt, lo, hi, NULL, doc },
#define ROW_REAL(name, dflt, lo, hi, doc) { #name, APSM_OPTION_REAL, #dflt, lo, hi, NULL, doc },
#define ROW_BOOL(name, dflt, doc)         { #name, APSM_OPTION_BOOL, #dflt, 0, 1, NULL, doc },
#define ROW_ENUM(name, words, doc)        { #name, APSM_OPTION_ENUM, NULL, 0, 0, words, doc },
static const apsm_option_info table[] = { APSM_OPTIONS(ROW_INT, ROW_REAL, ROW_BOOL, ROW_ENUM) };
enum { TABLE_LENGTH = sizeof table / sizeof table[0] };

#define OFFSET_INT(name, dflt, lo, hi, doc) offsetof(apsm_options, name),
#define OFFSET_BOOL(name, dflt, doc)        offsetof(apsm_options, name),
#define OFFSET_ENUM(name, words, doc)       offsetof(apsm_options, name),
static const size_t offset[] = { APSM_OPTIONS(OFFSET_INT, OFFSET_INT, OFFSET_BOOL, OFFSET_ENUM) };

#define SET_INT(name, dflt, lo, hi, doc) .name = dflt,
#define SET_BOOL(name, dflt, doc)        .name = dflt,
#define SET_ENUM(name, words, doc)       .name = 0,
apsm_options apsm_options_defaults(void)
{
    return (apsm_options){ APSM_OPTIONS(SET_INT, SET_INT, SET_BOOL, SET_ENUM) };
}

const apsm_option_info *apsm_options_table(size_t *n)
{
    *n = TABLE_LENGTH;
    return table;
}

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

static int find(const char *key)
{
    for (int k = 0; k < TABLE_LENGTH; k++)
        if (strcmp(table[k].name, key) == 0) return k;
    return -1;
}

static apsm_status unknown_key(apsm_context *ctx, const char *key)
{
    size_t best = 0, best_distance = SIZE_MAX;
    for (size_t k = 0; k < TABLE_LENGTH; k++) {
        const size_t d = apsm_edit_distance(key, table[k].name);
        if (d < best_distance) best = k, best_distance = d;
    }
    return apsm_fail(ctx, APSM_ERR_ARG, "unknown option '%s'; the nearest is '%s'", key,
                     table[best].name);
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

static apsm_status set_one(apsm_context *ctx, apsm_options *options, const char *key,
                           const char *value)
{
    const int k = find(key);
    if (k < 0) return unknown_key(ctx, key);
    void *at = (char *)options + offset[k];
    switch (table[k].kind) {
    case APSM_OPTION_BOOL:
        return set_bool(ctx, &table[k], value, at);
    case APSM_OPTION_ENUM:
        return set_enum(ctx, &table[k], value, at);
    default:
        return set_number(ctx, &table[k], value, at);
    }
}

/* The earlier paper's method; docs/method.md, "Comparison methods".  Its gamma/2 |P_i - mean|^2 has
 * the gradient gamma (P_i - mean): a length, so gamma is the share of the way to the mean made in
 * an epoch. */
static const char *const xu2023[][2] = {
    { "correspondence", "frobenius-squared" },
    { "gamma", "0.1" },
    { "snap", "none" },
    { "geodesic_correspondence", "false" },
    { "fidelity", "0" },
    { "stage1_epochs", "50" },
    { "settle_epochs", "0" },
    { "stage2_epochs", "50" },
    { "alpha", "10" },
    { "stage2_alpha_factor", "0.5" },
    { "beta", "0.02" },
};
enum { XU2023_LENGTH = sizeof xu2023 / sizeof xu2023[0] };

/* The method has just changed from `before`. */
static apsm_status follow_method(apsm_context *ctx, apsm_options *options, int before)
{
    const apsm_options defaults = apsm_options_defaults();
    const bool now = options->method == APSM_METHOD_XU2023;
    if (now == (before == APSM_METHOD_XU2023)) return APSM_OK;
    for (size_t k = 0; k < XU2023_LENGTH; k++) {
        char text[64];
        APSM_TRY(apsm_options_get(&defaults, xu2023[k][0], text));
        APSM_TRY(set_one(ctx, options, xu2023[k][0], now ? xu2023[k][1] : text));
    }
    return APSM_OK;
}

/* A length in the input's unit, which a user may call mm.  Model folders of earlier days have the
 * words of error_scale under this name. */
static apsm_status set_error(apsm_context *ctx, apsm_options *options, const char *value)
{
    if (strcmp(value, "relative") == 0 || strcmp(value, "raw") == 0)
        return set_one(ctx, options, "error_scale", value);
    char number[64];
    const size_t length = strlen(value);
    const bool mm = length > 2 && length < sizeof number && strcmp(value + length - 2, "mm") == 0;
    if (!mm) return set_one(ctx, options, "error", value);
    snprintf(number, sizeof number, "%.*s", (int)length - 2, value);
    return set_one(ctx, options, "error", number);
}

enum { AUTO_START = 32 }; /* particles */

apsm_status apsm_options_set(apsm_context *ctx, apsm_options *options, const char *key,
                             const char *value)
{
    const int before = options->method;
    if (strcmp(key, "particles") == 0 && strcmp(value, "auto") == 0) {
        options->particles = AUTO_START;
        options->particles_auto = true;
        return APSM_OK;
    }
    if (strcmp(key, "error") == 0) return set_error(ctx, options, value);
    APSM_TRY(set_one(ctx, options, key, value));
    return follow_method(ctx, options, before);
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

apsm_status apsm_options_get(const apsm_options *options, const char *key, char text[64])
{
    const int k = find(key);
    if (k < 0) return APSM_ERR_ARG;
    const void *at = (const char *)options + offset[k];
    switch (table[k].kind) {
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
        word_at(table[k].words, *(const int *)at, text);
        break;
    }
    return APSM_OK;
}

/* The paper's readings, all at once.  Its losses are means in input units (mm) and its step is
 * plain descent, which hardly moves the particles: docs/method.md has the measurement. */
static const char *const paper_literal[][2] = {
    { "alpha", "10" },
    { "stage2_alpha_factor", "0.5" },
    { "stage1_epochs", "200" },
    { "settle_epochs", "0" },
    { "stage2_epochs", "200" },
    { "tau_absolute", "1" },
    { "sampling_scale", "mean" },
    { "error_scale", "raw" },
    { "error_gradient", "through-w" },
    { "rotation", "axis" },
    { "neighbour_scale", "none" },
    { "template_gradient", "true" },
    { "eigen_reg_absolute", "0.1" },
    { "eigen_scale", "none" },
    { "step", "literal" },
    { "learning_rate", "1" },
    { "step_clip", "0" },
    { "decay1_at", "1" },
    { "decay2_at", "1" },
    { "burn_in", "1" },
    { "snap", "field" },
    { "initialize", "fps" },
    { "geodesic_interval", "25" },
    { "geodesic_factor", "1.5" },
    { "geodesic_target", "farthest" },
    { "geodesic_walk", "1" },
    { "geodesic_guard", "false" },
    { "definition", "paper" },
    { "fidelity", "0" },
};

static apsm_status set_all(apsm_context *ctx, apsm_options *options, const char *const pairs[][2],
                           size_t n)
{
    for (size_t k = 0; k < n; k++)
        APSM_TRY(apsm_options_set(ctx, options, pairs[k][0], pairs[k][1]));
    return APSM_OK;
}

apsm_status apsm_options_preset(apsm_context *ctx, apsm_options *options, const char *name)
{
    static const struct {
        const char *name, *beta, *gamma;
    } cohorts[] = { { "paper-literal-femur", "0.01", "0.5" },
                    { "paper-literal-liver", "0.05", "5" },
                    { "paper-literal-hip", "0.01", "0.1" } };
    if (strcmp(name, "default") == 0) return *options = apsm_options_defaults(), APSM_OK;
    for (size_t k = 0; k < sizeof cohorts / sizeof cohorts[0]; k++) {
        if (strcmp(name, cohorts[k].name) != 0) continue;
        const char *const weights[][2] = { { "beta", cohorts[k].beta },
                                           { "gamma", cohorts[k].gamma } };
        APSM_TRY(
            set_all(ctx, options, paper_literal, sizeof paper_literal / sizeof paper_literal[0]));
        return set_all(ctx, options, weights, 2);
    }
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "unknown preset '%s': give default, paper-literal-femur, "
                     "paper-literal-liver or paper-literal-hip",
                     name);
}

apsm_status apsm_options_check(apsm_context *ctx, const apsm_options *o)
{
    if (o->particles < 7 && o->method != APSM_METHOD_PSM)
        return apsm_fail(
            ctx, APSM_ERR_ARG,
            "particles = %ld: at least 7 are needed, a particle and its six neighbours",
            o->particles);
    if (o->particles_auto != (o->error > 0))
        return apsm_fail(
            ctx, APSM_ERR_ARG,
            o->particles_auto
                ? "particles = auto: give the error to meet as well, such as error = 0.5"
                : "error = %g: is met by particles = auto only; give that as well",
            o->error);
    if (o->particles_auto && (o->method != APSM_METHOD_ADAPTIVE || !(o->fidelity > 0)))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "particles = auto: needs method = adaptive and fidelity above 0");
    if (o->decay2_at < o->decay1_at)
        return apsm_fail(ctx, APSM_ERR_ARG, "decay2_at = %g comes before decay1_at = %g",
                         o->decay2_at, o->decay1_at);
    if (o->stage1_epochs + o->stage2_epochs == 0 &&
        (o->method != APSM_METHOD_ADAPTIVE || !(o->fidelity > 0)) && o->method != APSM_METHOD_PSM)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "stage1_epochs and stage2_epochs are both 0, and there is no fidelity "
                         "stage: nothing to optimize");
    if (o->step == APSM_STEP_LITERAL && o->error_gradient == APSM_ERROR_THROUGH_W &&
        o->sampling_scale == 0 && o->step_clip == 0)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "error_gradient = through-w with sampling_scale = voronoi diverges "
                         "without a step limit: set step_clip");
    return APSM_OK;
}
