/* Options as pairs: tried out when they are met, so that a mistake is told before anything is read,
 * and put in the order of their priority at the end. */
#include "pairs.h"

#include <errno.h>
#include <regex.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/run.h"
#include "config.h"
#include "options/options.h"
#include "options_table.h"

static apsm_status out_of_memory(apsm_context *ctx)
{
    return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory");
}

static bool append_pair(cli_args *args, const char *key, const char *value)
{
    cli_pair *larger = realloc(args->set, (args->n_set + 1) * sizeof *larger);
    if (!larger) return false;
    args->set = larger;
    const cli_pair pair = { strdup(key), strdup(value) };
    args->set[args->n_set] = pair;
    if (pair.key && pair.value) return args->n_set++, true;
    free(pair.key);
    free(pair.value);
    return false;
}

const char *cli_args_get(const cli_args *args, const char *key)
{
    for (size_t i = 0; i < args->n_set; i++)
        if (strcmp(args->set[i].key, key) == 0) return args->set[i].value;
    return NULL;
}

static apsm_status check_expression(apsm_context *ctx, const char *key, const char *value)
{
    regex_t regex;
    char why[128];
    const int error = regcomp(&regex, value, REG_EXTENDED | REG_NOSUB);
    if (error == 0) {
        regfree(&regex);
        return APSM_OK;
    }
    regerror(error, &regex, why, sizeof why);
    return apsm_fail(ctx, APSM_ERR_ARG, "%s = %s: %s; give a POSIX extended regular expression",
                     key, value, why);
}

static apsm_status check_seed(apsm_context *ctx, const char *value)
{
    char *end;
    errno = 0;
    strtoull(value, &end, 10);
    if (*value >= '0' && *value <= '9' && !*end && !errno) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG, "seed = %s: give a whole number from 0 to %llu", value,
                     (unsigned long long)UINT64_MAX);
}

/* Values are tried out here, so that a mistake is told before anything is read. */
static apsm_status check_value(apsm_context *ctx, const char *key, const char *value)
{
    apsm_options scratch = apsm_options_defaults();
    if (strcmp(key, "preset") == 0) return apsm_options_preset(ctx, &scratch, value);
    if (strcmp(key, "seed") == 0) return check_seed(ctx, value);
    if (strcmp(key, "exclude") == 0 || strcmp(key, "reflect_match") == 0)
        return check_expression(ctx, key, value);
    if (strcmp(key, "ignore") == 0) return apsm_run_check_ignore(ctx, value);
    if (strcmp(key, "unit") == 0) return apsm_run_check_unit(ctx, value);
    if (strcmp(key, "labels") == 0) return cli_check_labels(ctx, value);
    if (strcmp(key, "pattern") == 0 || strcmp(key, "template") == 0 || strcmp(key, "domain") == 0 ||
        strcmp(key, "landmarks") == 0 || strcmp(key, "constraints") == 0 ||
        strcmp(key, "features") == 0 || strcmp(key, "fixed") == 0)
        return *value ? APSM_OK : apsm_fail(ctx, APSM_ERR_ARG, "%s is empty", key);
    return apsm_options_set(ctx, &scratch, key, value);
}

/* Adds a pair of the command line; the same key with another value is a contradiction. */
apsm_status cli_pairs_add(apsm_context *ctx, cli_args *args, const char *key, const char *value)
{
    APSM_TRY(check_value(ctx, key, value));
    const char *before = cli_args_get(args, key);
    if (before && strcmp(before, value) != 0)
        return apsm_fail(ctx, APSM_ERR_ARG, "%s is given twice, as %s and as %s; keep one", key,
                         before, value);
    if (before) return APSM_OK;
    return append_pair(args, key, value) ? APSM_OK : out_of_memory(ctx);
}

apsm_status cli_pairs_assign(apsm_context *ctx, cli_args *args, const char *text)
{
    char key[64];
    const char *equals = strchr(text, '=');
    if (!equals || equals == text || (size_t)(equals - text) >= sizeof key)
        return apsm_fail(ctx, APSM_ERR_ARG, "--set %s: give KEY=VALUE", text);
    snprintf(key, sizeof key, "%.*s", (int)(equals - text), text);
    for (char *c = key; *c; c++)
        if (*c == '-') *c = '_';
    if (!cli_is_key(key))
        return apsm_fail(ctx, APSM_ERR_ARG, "--set %s: unknown option '%s'; the nearest is '%s'",
                         text, key, cli_nearest_key(key));
    return cli_pairs_add(ctx, args, key, equals + 1);
}

/* ---- Priorities ---- */

void cli_pairs_free(cli_pair *pairs, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        free(pairs[i].key);
        free(pairs[i].value);
    }
    free(pairs);
}

static const char *value_of(const cli_pair *pairs, size_t n, const char *key)
{
    for (size_t i = 0; i < n; i++)
        if (strcmp(pairs[i].key, key) == 0) return pairs[i].value;
    return NULL;
}

/* Options that set others: they come first, wherever they stand. */
static const char *const leaders[] = { "preset", "method" };
enum { LEADERS = sizeof leaders / sizeof leaders[0] };

static bool leads(const char *key)
{
    for (size_t k = 0; k < LEADERS; k++)
        if (strcmp(key, leaders[k]) == 0) return true;
    return false;
}

/* set <- preset and method, then the file's pairs that the command line does not replace, then its
 * own. */
static apsm_status merge(apsm_context *ctx, cli_args *a, const cli_pair *file, size_t n_file,
                         const cli_pair *given, size_t n_given)
{
    bool done = true;
    for (size_t k = 0; k < LEADERS && done; k++) {
        const char *value = value_of(given, n_given, leaders[k]);
        if (!value) value = value_of(file, n_file, leaders[k]);
        done = !value || append_pair(a, leaders[k], value);
    }
    for (size_t i = 0; i < n_file && done; i++)
        if (!leads(file[i].key) && !value_of(given, n_given, file[i].key))
            done = append_pair(a, file[i].key, file[i].value);
    for (size_t i = 0; i < n_given && done; i++)
        if (!leads(given[i].key)) done = append_pair(a, given[i].key, given[i].value);
    return done ? APSM_OK : out_of_memory(ctx);
}

static apsm_status check_file(apsm_context *ctx, const char *path, const cli_pair *file, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const apsm_status status = check_value(ctx, file[i].key, file[i].value);
        if (status != APSM_OK) return apsm_fail(ctx, status, "%s: %s", path, apsm_error_text(ctx));
    }
    return APSM_OK;
}

apsm_status cli_pairs_settle(apsm_context *ctx, cli_args *a)
{
    cli_pair *given = a->set, *file = NULL;
    const size_t n_given = a->n_set;
    size_t n_file = 0;
    a->set = NULL;
    a->n_set = 0;
    apsm_status status = a->config ? cli_config_read(ctx, a->config, &file, &n_file) : APSM_OK;
    if (status == APSM_OK) status = check_file(ctx, a->config, file, n_file);
    if (status == APSM_OK) status = merge(ctx, a, file, n_file, given, n_given);
    cli_pairs_free(given, n_given);
    cli_pairs_free(file, n_file);
    return status;
}
