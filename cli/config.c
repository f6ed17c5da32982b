/* Configuration files: {"particles": 256, "align": "similarity", "resample": false}. */
#include "config.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "input/input.h"
#include "options_table.h"

/* What the manifest notes beside options. */
static bool is_note(const char *key)
{
    return strcmp(key, "version") == 0 || strcmp(key, "template_used") == 0;
}

/* Value as the text that --set would take; malloc'ed, NULL: no plain value or out of memory. */
static char *text_of(const json_t *value)
{
    char text[APSM_NUMBER_LENGTH];
    if (json_is_string(value)) return strdup(json_string_value(value));
    if (json_is_boolean(value)) return strdup(json_is_true(value) ? "true" : "false");
    if (json_is_integer(value))
        snprintf(text, sizeof text, "%lld", (long long)json_integer_value(value));
    else if (json_is_real(value))
        apsm_format_number(json_real_value(value), text);
    else
        return NULL;
    return strdup(text);
}

static apsm_status read_pair(apsm_context *ctx, const char *path, const char *key,
                             const json_t *value, cli_pair *pair)
{
    if (!cli_is_key(key))
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: unknown option '%s'; the nearest is '%s'", path,
                         key, cli_nearest_key(key));
    if (json_is_object(value) || json_is_array(value) || json_is_null(value))
        return apsm_fail(ctx, APSM_ERR_ARG, "%s: %s must be a string, a number, true or false",
                         path, key);
    *pair = (cli_pair){ strdup(key), text_of(value) };
    if (pair->key && pair->value) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory");
}

static apsm_status read_pairs(apsm_context *ctx, const char *path, json_t *options, cli_pair *pairs,
                              size_t *n)
{
    const char *key;
    json_t *value;
    json_object_foreach(options, key, value)
    {
        if (is_note(key)) continue;
        ++*n; /* also a failed pair: the caller frees it */
        APSM_TRY(read_pair(ctx, path, key, value, &pairs[*n - 1]));
    }
    return APSM_OK;
}

apsm_status cli_config_read(apsm_context *ctx, const char *path, cli_pair **pairs, size_t *n)
{
    json_t *root;
    *n = 0;
    *pairs = NULL;
    APSM_TRY(apsm_json_read(ctx, path, &root));
    const char *format = json_string_value(json_object_get(root, "format"));
    json_t *options =
        format && strcmp(format, "apsm-manifest") == 0 ? json_object_get(root, "options") : root;
    apsm_status status = APSM_OK;
    if (!json_is_object(options))
        status = apsm_fail(ctx, APSM_ERR_ARG,
                           "%s: holds no options; write {\"particles\": 256, ...}", path);
    else if (!(*pairs = calloc(json_object_size(options) + 1, sizeof **pairs)))
        status = apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory");
    else
        status = read_pairs(ctx, path, options, *pairs, n);
    json_decref(root);
    return status;
}

apsm_status cli_check_labels(apsm_context *ctx, const char *text)
{
    apsm_labels labels = { 0 };
    const apsm_status status = apsm_labels_parse(ctx, text, &labels);
    apsm_labels_free(&labels);
    return status;
}
