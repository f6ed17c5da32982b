#include "session/settings.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session/manifest.h"

/* ---- texts beside the option table ---- */

static const char *const texts[] = { "labels",    "reflect_match", "exclude",     "pattern",
                                     "ignore",    "domain",        "template",    "seed",
                                     "landmarks", "unit",          "constraints", "features",
                                     "fixed" };
enum { TEXTS = sizeof texts / sizeof texts[0] };

static bool is_one_of(const char *const *words, size_t n, const char *word)
{
    for (size_t k = 0; k < n; k++)
        if (strcmp(words[k], word) == 0) return true;
    return false;
}

static bool is_text(const char *key)
{
    return is_one_of(texts, TEXTS, key);
}

const char *apsm_run_text(const apsm_run *run, const char *name)
{
    const char *text = apsm_project_get(&run->project, "apsm", name);
    return text ? text : "";
}

const apsm_options *apsm_run_options(const apsm_run *run)
{
    return &run->options;
}

/* ---- settling the options ---- */

/* strtoull alone would also take " -1". */
static apsm_status take_seed(apsm_run *run, const char *text)
{
    char *end;
    errno = 0;
    const unsigned long long seed = strtoull(text, &end, 10);
    if (*text < '0' || *text > '9' || *end || errno)
        return apsm_fail(run->ctx, APSM_ERR_ARG, "seed = %s: give a whole number from 0 to %llu",
                         text, (unsigned long long)UINT64_MAX);
    apsm_context_set_seed(run->ctx, seed);
    return APSM_OK;
}

apsm_status apsm_run_check_unit(apsm_context *ctx, const char *text)
{
    enum { LONGEST = 8 };
    bool good = text && *text && strlen(text) <= LONGEST;
    for (const char *c = text; good && *c; c++) good = (*c < 0 || isalpha((unsigned char)*c));
    if (good) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "unit = '%s': give the unit of the inputs' lengths, such as mm, cm or m",
                     text ? text : "");
}

static apsm_status take_pair(apsm_run *run, const char *key, const char *value)
{
    if (strcmp(key, "preset") == 0) return apsm_options_preset(run->ctx, &run->options, value);
    if (!is_text(key)) return apsm_options_set(run->ctx, &run->options, key, value);
    if (strcmp(key, "seed") == 0) APSM_TRY(take_seed(run, value));
    if (strcmp(key, "unit") == 0) APSM_TRY(apsm_run_check_unit(run->ctx, value));
    return apsm_project_set(&run->project, "apsm", key, value);
}

/* Options stored by a run with this folder; what we no longer know is an error, not a guess. */
static apsm_status take_stored(apsm_run *run)
{
    const size_t n = apsm_project_count(&run->project, "apsm");
    for (size_t k = 0; k < n; k++) {
        const char *key, *value;
        apsm_project_pair(&run->project, "apsm", k, &key, &value);
        if (strcmp(key, "version") == 0 || strcmp(key, "template_used") == 0) continue;
        if (strcmp(key, "seed") == 0) APSM_TRY(take_seed(run, value));
        if (!is_text(key)) APSM_TRY(apsm_options_set(run->ctx, &run->options, key, value));
    }
    return APSM_OK;
}

static apsm_status refuse_change(apsm_run *run, const char *key, const char *before,
                                 const char *after)
{
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s: the run that --resume continues has %s = %s, not %s; drop the option, or "
                     "start anew without --resume",
                     run->folder, key, *before ? before : "(none)", *after ? after : "(none)");
}

/* With resume: what was asked for must be what the run began with.  Harmless options may change,
 * and then what depends on them is made again: the checkpoint's particles only written again. */
static apsm_status refuse_changes(apsm_run *run, const apsm_options *before)
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    for (size_t k = 0; k < n; k++) {
        char a[64], b[64];
        APSM_TRY(apsm_options_get(before, table[k].name, a));
        APSM_TRY(apsm_options_get(&run->options, table[k].name, b));
        if (strcmp(a, b) == 0) continue;
        if (!apsm_option_is_harmless(table[k].name)) return refuse_change(run, table[k].name, a, b);
        if (strcmp(table[k].name, "original_frame") == 0)
            APSM_TRY(stage_undo(run, "optimize")); /* particles/ */
        else if (strcmp(table[k].name, "checkpoint_seconds") != 0)
            APSM_TRY(stage_undo(run, "evaluate"));
    }
    return APSM_OK;
}

static apsm_status refuse_other_text(apsm_run *run, const char *key, const char *value)
{
    const bool may_change = !is_text(key) || strcmp(key, "unit") == 0;
    if (may_change || strcmp(apsm_run_text(run, key), value) == 0) return APSM_OK;
    return refuse_change(run, key, apsm_run_text(run, key), value);
}

/* Of the project's texts, those that are not in the option table; owned by the caller. */
static apsm_status copy_texts(const apsm_run *run, char *copy[TEXTS + 1])
{
    for (size_t k = 0; k <= TEXTS; k++) {
        const char *key = k < TEXTS ? texts[k] : "template_used";
        APSM_TRY(apsm_text_set(&copy[k], apsm_project_get(&run->project, "apsm", key)));
    }
    return APSM_OK;
}

/* All options in the project, in one order, whichever were given and how. */
static apsm_status store_in_order(apsm_run *run, char *const copy[TEXTS + 1])
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    apsm_project_clear(&run->project, "apsm");
    APSM_TRY(apsm_project_set(&run->project, "apsm", "version", APSM_VERSION));
    for (size_t k = 0; k < n; k++) {
        char text[64];
        APSM_TRY(apsm_options_get(&run->options, table[k].name, text));
        APSM_TRY(apsm_project_set(&run->project, "apsm", table[k].name, text));
    }
    for (size_t k = 0; k < TEXTS; k++)
        if (copy[k] && strcmp(texts[k], "seed") != 0)
            APSM_TRY(apsm_project_set(&run->project, "apsm", texts[k], copy[k]));
    char seed[32]; /* behind them, whether it was given or is the usual one */
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)apsm_context_seed(run->ctx));
    APSM_TRY(apsm_project_set(&run->project, "apsm", "seed", seed));
    return copy[TEXTS] ? apsm_project_set(&run->project, "apsm", "template_used", copy[TEXTS])
                       : APSM_OK;
}

static apsm_status store_options(apsm_run *run)
{
    char *copy[TEXTS + 1] = { NULL };
    apsm_status status = copy_texts(run, copy);
    if (status == APSM_OK) status = store_in_order(run, copy);
    for (size_t k = 0; k <= TEXTS; k++) free(copy[k]);
    return status;
}

apsm_status settings_settle(apsm_run *run, const apsm_run_settings *s)
{
    run->options = apsm_options_defaults();
    /* A model made anew from inputs owes nothing to the one that it replaces. */
    if (run->overwrite && run->n_inputs > 0) apsm_project_clear(&run->project, "apsm");
    APSM_TRY(take_stored(run));
    const apsm_options before = run->options;
    const bool goes_on = run->resume && apsm_project_get(&run->project, "apsm", "version");
    for (size_t k = 0; k < s->n_set; k++) {
        const char *key = s->set[k][0], *value = s->set[k][1];
        if (goes_on) APSM_TRY(refuse_other_text(run, key, value));
        APSM_TRY(take_pair(run, key, value));
    }
    if (goes_on) APSM_TRY(refuse_changes(run, &before));
    APSM_TRY(apsm_options_check(run->ctx, &run->options));
    return store_options(run);
}

/* Before a folder is made for them. */
apsm_status settings_try(apsm_run *run, const apsm_run_settings *s)
{
    run->options = apsm_options_defaults();
    for (size_t k = 0; k < s->n_set; k++) {
        const char *key = s->set[k][0], *value = s->set[k][1];
        if (strcmp(key, "seed") == 0) APSM_TRY(take_seed(run, value));
        if (!is_text(key)) APSM_TRY(take_pair(run, key, value));
    }
    return apsm_options_check(run->ctx, &run->options);
}

void settings_hash(const apsm_run *run, apsm_sha256 *sha)
{
    size_t n;
    const apsm_option_info *table = apsm_options_table(&n);
    for (size_t k = 0; k < n; k++) {
        char text[64];
        if (apsm_option_is_harmless(table[k].name)) continue;
        if (apsm_options_get(&run->options, table[k].name, text) != APSM_OK) continue;
        apsm_sha256_add_text(sha, table[k].name);
        apsm_sha256_add_text(sha, text);
    }
    const uint64_t seed = apsm_context_seed(run->ctx), record = sizeof(apsm_epoch_record);
    apsm_sha256_add(sha, &seed, sizeof seed);
    /* Another version would go on differently, and may keep other records. */
    apsm_sha256_add_text(sha, APSM_VERSION);
    apsm_sha256_add(sha, &record, sizeof record);
}
