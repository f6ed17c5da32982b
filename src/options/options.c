#include "options/options.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "options/presets.h"

/* #dflt is the text as it stands in the list: true, not what the macro true stands for. */
#define ROW_INT(S, name, dflt, lo, hi, doc)  { #name, APSM_OPTION_INT, #dflt, lo, hi, NULL, doc },
#define ROW_REAL(S, name, dflt, lo, hi, doc) { #name, APSM_OPTION_REAL, #dflt, lo, hi, NULL, doc },
#define ROW_BOOL(S, name, dflt, doc)         { #name, APSM_OPTION_BOOL, #dflt, 0, 1, NULL, doc },
#define ROW_ENUM(S, name, words, doc)        { #name, APSM_OPTION_ENUM, NULL, 0, 0, words, doc },
#define NONE(S, type, name, dflt, doc)
#define ROWS(LIST, at) LIST(at, ROW_INT, ROW_REAL, ROW_BOOL, ROW_ENUM, NONE)
static const apsm_option_info table[] = { APSM_DECISIVE_STEPS(ROWS) APSM_HARMLESS_STEPS(ROWS) };

#define AT_NUMBER(S, name, dflt, lo, hi, doc) offsetof(apsm_options, S.name),
#define AT_BOOL(S, name, dflt, doc)           offsetof(apsm_options, S.name),
#define AT_ENUM(S, name, words, doc)          offsetof(apsm_options, S.name),
#define PLACES(LIST, at)                      LIST(at, AT_NUMBER, AT_NUMBER, AT_BOOL, AT_ENUM, NONE)
static const size_t decisive[] = { APSM_DECISIVE_STEPS(PLACES) };
static const size_t offset[] = { APSM_DECISIVE_STEPS(PLACES) APSM_HARMLESS_STEPS(PLACES) };
enum {
    TABLE_LENGTH = sizeof table / sizeof table[0],
    DECISIVE = sizeof decisive / sizeof decisive[0]
};

#define SET_NUMBER(S, name, dflt, lo, hi, doc) .S.name = dflt,
#define SET_BOOL(S, name, dflt, doc)           .S.name = dflt,
#define SET_ENUM(S, name, words, doc)          .S.name = 0,
#define SET_FIXED(S, type, name, dflt, doc)    .S.name = dflt,
#define DEFAULTS(LIST, at)                     LIST(at, SET_NUMBER, SET_NUMBER, SET_BOOL, SET_ENUM, SET_FIXED)
apsm_options apsm_options_defaults(void)
{
    return (apsm_options){ APSM_DECISIVE_STEPS(DEFAULTS) APSM_HARMLESS_STEPS(DEFAULTS) };
}

apsm_status apsm_options_new(apsm_context *ctx, apsm_options **options)
{
    *options = malloc(sizeof **options);
    if (!*options) return apsm_fail(ctx, APSM_ERR_MEMORY, "options: out of memory");
    **options = apsm_options_defaults();
    return APSM_OK;
}

void apsm_options_free(apsm_options *options)
{
    free(options);
}

const apsm_option_info *apsm_options_table(size_t *n)
{
    *n = TABLE_LENGTH;
    return table;
}

static int find(const char *key)
{
    for (int k = 0; k < TABLE_LENGTH; k++)
        if (strcmp(table[k].name, key) == 0) return k;
    return -1;
}

bool apsm_option_is_harmless(const char *key)
{
    return find(key) >= DECISIVE;
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

apsm_status options_set_one(apsm_context *ctx, apsm_options *options, const char *key,
                            const char *value)
{
    const int k = find(key);
    if (k < 0) return unknown_key(ctx, key);
    return apsm_option_parse(ctx, &table[k], value, (char *)options + offset[k]);
}

apsm_status apsm_options_get(const apsm_options *options, const char *key, char text[64])
{
    const int k = find(key);
    if (k < 0) return APSM_ERR_ARG;
    apsm_option_print(&table[k], (const char *)options + offset[k], text);
    return APSM_OK;
}
