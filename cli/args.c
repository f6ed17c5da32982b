/* From argv to cli_args: getopt_long over the list of options_table.h, then everything that an
 * option alone cannot tell: what belongs to the verb, what contradicts what. */
#define _DEFAULT_SOURCE /* getopt_long, _SC_NPROCESSORS_ONLN */
#include "args.h"

#include <ctype.h>
#include <errno.h>
#include <getopt.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "apsm/particles.h"
#include "files/files.h"
#include "files/project.h"
#include "input/input.h"
#include "options_table.h"
#include "pairs.h"

/* What the steps of parsing share. */
typedef struct parsing {
    apsm_context *ctx;
    int argc;
    char **argv;
    cli_args *args;
    cli_option *options;
    size_t n_options;
    bool progress_given;
} parsing;

static apsm_status out_of_memory(const parsing *p)
{
    return apsm_fail(p->ctx, APSM_ERR_MEMORY, "out of memory");
}

/* ---- Single options ---- */

static apsm_status take_threads(parsing *p, const char *text)
{
    char *end;
    errno = 0;
    const long n = strtol(text, &end, 10);
    if (end == text || *end || errno || n < 1 || n > 4096)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "--threads %s: give a whole number from 1 to 4096",
                         text);
    p->args->threads = (int)n;
    return APSM_OK;
}

/* What may follow the unit's letter: 2G, 2GB and 2GiB are the same. */
static bool ends_unit(const char *text)
{
    return !*text || strcasecmp(text, "B") == 0 || strcasecmp(text, "iB") == 0;
}

/* 2G, 500M, 1.5T, 2GB, 2GiB: units of 1024. */
static apsm_status take_memory(parsing *p, const char *text)
{
    static const char units[] = "KMGT";
    char *end;
    const double n = strtod(text, &end);
    const char *unit = *end ? strchr(units, toupper((unsigned char)*end)) : NULL;
    double bytes = n;
    for (const char *u = units; unit && u <= unit; u++) bytes *= 1024;
    if (end == text || !unit || !ends_unit(end + 1) || !(bytes >= 0x1p26) || !(bytes < 0x1p60))
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "--memory %s: give a number with a unit, like 2G or 500M; 64M at least",
                         text);
    p->args->memory = (size_t)bytes;
    return APSM_OK;
}

static apsm_status take_shard(parsing *p, const char *text)
{
    size_t shard = 0, shards = 0;
    int end = -1;
    const bool digits = strspn(text, "0123456789/") == strlen(text) && strlen(text) <= 11;
    if (!digits || sscanf(text, "%zu/%zu%n", &shard, &shards, &end) != 2 || text[end] ||
        shard < 1 || shard > shards)
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "--shard %s: give which part of how many, from 1/7 to 7/7 of 7", text);
    p->args->shard = shard - 1;
    p->args->shards = shards;
    return APSM_OK;
}

static apsm_status take_progress(parsing *p, const char *text)
{
    static const char *const modes[] = { "auto", "plain", "json" };
    for (int i = 0; i < 3; i++)
        if (strcmp(text, modes[i]) == 0) {
            p->args->progress = (cli_progress_mode)i;
            p->progress_given = true;
            return APSM_OK;
        }
    return apsm_fail(p->ctx, APSM_ERR_ARG, "--progress %s: give auto, plain or json", text);
}

static apsm_status take_path(const parsing *p, const char *name, const char *text,
                             const char **slot)
{
    if (!*text) return apsm_fail(p->ctx, APSM_ERR_ARG, "--%s is empty: give a path", name);
    if (*slot && strcmp(*slot, text) != 0)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "--%s is given twice, as %s and as %s; keep one",
                         name, *slot, text);
    *slot = text;
    return APSM_OK;
}

/* Options that are a text of cli_args, and those that switch something on. */
typedef struct cli_slot {
    cli_action action;
    size_t at; /* in cli_args */
} cli_slot;
static const cli_slot texts[] = {
    { CLI_OUT, offsetof(cli_args, out_dir) },
    { CLI_PARTS, offsetof(cli_args, parts) },
    { CLI_ALIGN_PARTS, offsetof(cli_args, align_parts) },
    { CLI_SHARED, offsetof(cli_args, shared) },
    { CLI_TO, offsetof(cli_args, to) },
    { CLI_WHAT, offsetof(cli_args, what) },
    { CLI_SHAPE, offsetof(cli_args, shape) },
    { CLI_VIEW, offsetof(cli_args, view) },
    { CLI_WIDTH, offsetof(cli_args, width) },
    { CLI_SUBJECTS, offsetof(cli_args, subjects) },
    { CLI_FORMULA, offsetof(cli_args, formula) },
    { CLI_OF, offsetof(cli_args, of) },
    { CLI_AT, offsetof(cli_args, at) },
    { CLI_ON, offsetof(cli_args, on) },
    { CLI_WITHIN, offsetof(cli_args, within) },
    { CLI_STOP_RISK, offsetof(cli_args, stop_risk) },
    { CLI_VARIANCES, offsetof(cli_args, variances) },
    { CLI_PERMUTATIONS, offsetof(cli_args, permutations) },
    { CLI_BOOTSTRAPS, offsetof(cli_args, bootstraps) },
    { CLI_HAND, offsetof(cli_args, hand) },
    { CLI_EXTENT, offsetof(cli_args, extent) },
    { CLI_MODEL, offsetof(cli_args, model) },
    { CLI_MODES, offsetof(cli_args, modes) },
    { CLI_SD, offsetof(cli_args, sd) },
    { CLI_ATTACH, offsetof(cli_args, attach) },
    { CLI_CONFIG, offsetof(cli_args, config) },
};
static const cli_slot flags[] = {
    { CLI_FLAG_RESUME, offsetof(cli_args, resume) },
    { CLI_FLAG_OVERWRITE, offsetof(cli_args, overwrite) },
    { CLI_FLAG_DRY_RUN, offsetof(cli_args, dry_run) },
    { CLI_FLAG_QUIET, offsetof(cli_args, quiet) },
    { CLI_FLAG_ALIGNED, offsetof(cli_args, aligned) },
    { CLI_FLAG_FORCE, offsetof(cli_args, force) },
    { CLI_FLAG_HELP, offsetof(cli_args, help) },
    { CLI_FLAG_VERSION, offsetof(cli_args, version) },
    { CLI_FLAG_XML, offsetof(cli_args, xml) },
};

/* The options that need a word more; APSM_ERR_ARG: no such option. */
static apsm_status take_other(parsing *p, const cli_option *o, const char *text)
{
    cli_args *a = p->args;
    switch (o->action) {
    case CLI_SETS:
        return cli_pairs_add(p->ctx, a, o->key, o->argument ? text : o->value);
    case CLI_LANDMARKS:
        if (a->verb && a->verb->verb == CLI_FIT) return take_path(p, o->name, text, &a->landmarks);
        return cli_pairs_add(p->ctx, a, o->key, text);
    case CLI_SET_PAIR:
        return cli_pairs_assign(p->ctx, a, text);
    case CLI_THREADS:
        return take_threads(p, text);
    case CLI_MEMORY:
        return take_memory(p, text);
    case CLI_SHARD:
        return take_shard(p, text);
    case CLI_PROGRESS:
        return take_progress(p, text);
    case CLI_FLAG_HELP_ALL:
        return a->help = a->help_all = true, APSM_OK;
    default:
        return APSM_ERR_ARG;
    }
}

static apsm_status take_option(parsing *p, const cli_option *o, const char *text)
{
    char *const base = (char *)p->args;
    for (size_t k = 0; k < sizeof texts / sizeof *texts; k++)
        if (texts[k].action == o->action)
            return take_path(p, o->name, text, (const char **)(void *)(base + texts[k].at));
    for (size_t k = 0; k < sizeof flags / sizeof *flags; k++)
        if (flags[k].action == o->action) return *(bool *)(base + flags[k].at) = true, APSM_OK;
    return take_other(p, o, text);
}

/* ---- getopt ---- */

static const cli_option *find_option(const parsing *p, const char *name, size_t length)
{
    for (size_t i = 0; i < p->n_options; i++)
        if (strlen(p->options[i].name) == length && strncmp(p->options[i].name, name, length) == 0)
            return &p->options[i];
    return NULL;
}

static apsm_status refuse_for_verb(const parsing *p, const cli_option *o)
{
    return apsm_fail(p->ctx, APSM_ERR_ARG, "--%s does not belong to '%s'; see apsm %s --help",
                     o->name, p->args->verb->name, p->args->verb->name);
}

/* --reflect_match, as files write it and Slicer's modules must, is --reflect-match. */
static void underscores_are_hyphens(char *name, size_t length)
{
    for (size_t k = 0; k < length; k++)
        if (name[k] == '_') name[k] = '-';
}

/* getopt takes any unambiguous beginning of a name; a script that relies on that breaks when an
 * option is added.  So names must be whole.  */
static apsm_status check_names(const parsing *p)
{
    for (int i = 1; i < p->argc; i++) {
        const char *word = p->argv[i];
        if (strcmp(word, "--") == 0) break;
        if (strncmp(word, "--", 2) != 0) continue;
        const size_t length = strcspn(word + 2, "=");
        underscores_are_hyphens(p->argv[i] + 2, length);
        const cli_option *o = find_option(p, word + 2, length);
        char name[64];
        snprintf(name, sizeof name, "%.*s", (int)length, word + 2);
        if (!o)
            return apsm_fail(p->ctx, APSM_ERR_ARG, "unknown option --%s; the nearest is --%s", name,
                             cli_nearest_option(p->options, p->n_options, name));
        if (!o->argument && word[2 + length] == '=')
            return apsm_fail(p->ctx, APSM_ERR_ARG, "--%s takes no argument", name);
    }
    return APSM_OK;
}

/* A value of getopt for each option: its letter, or a number beyond the letters. */
enum { FIRST_VALUE = 256 };

static int getopt_value(const parsing *p, size_t i)
{
    return p->options[i].letter ? p->options[i].letter : FIRST_VALUE + (int)i;
}

static void fill_getopt(const parsing *p, struct option *longs, char letters[64])
{
    char *at = letters;
    *at++ = ':'; /* tell a missing argument from an unknown letter */
    for (size_t i = 0; i < p->n_options; i++) {
        const cli_option *o = &p->options[i];
        longs[i] = (struct option){ o->name, o->argument ? required_argument : no_argument, NULL,
                                    getopt_value(p, i) };
        if (!o->letter) continue;
        *at++ = o->letter;
        if (o->argument) *at++ = ':';
    }
    longs[p->n_options] = (struct option){ 0 };
    *at = '\0';
}

static const cli_option *option_of_value(const parsing *p, int value)
{
    for (size_t i = 0; i < p->n_options; i++)
        if (getopt_value(p, i) == value) return &p->options[i];
    return NULL;
}

/* "-o --seed 3": getopt would take "--seed" for the folder. */
static bool swallowed_option(const parsing *p)
{
    return optarg && optarg == p->argv[optind - 1] && strncmp(optarg, "--", 2) == 0;
}

static apsm_status one_option(parsing *p, int value)
{
    const cli_option *o = option_of_value(p, value == ':' ? optopt : value);
    if (value == ':')
        return apsm_fail(p->ctx, APSM_ERR_ARG, "--%s needs an argument: %s", o ? o->name : "?",
                         o ? o->argument : "?");
    if (!o) return apsm_fail(p->ctx, APSM_ERR_ARG, "unknown option -%c", optopt);
    if (p->args->verb && !(o->verbs & (unsigned)p->args->verb->verb)) return refuse_for_verb(p, o);
    if (swallowed_option(p))
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "--%s needs an argument, but %s follows; write --%s=%s "
                         "if that is it",
                         o->name, optarg, o->name, optarg);
    return take_option(p, o, optarg);
}

static apsm_status run_getopt(parsing *p)
{
    char letters[64];
    struct option *longs = calloc(p->n_options + 1, sizeof *longs);
    if (!longs) return out_of_memory(p);
    fill_getopt(p, longs, letters);
    apsm_status status = APSM_OK;
    opterr = 0;
    optind = 0; /* glibc: start anew */
    for (int value; status == APSM_OK;) {
        value = getopt_long(p->argc, p->argv, letters, longs, NULL);
        if (value == -1) break;
        status = one_option(p, value);
    }
    free(longs);
    return status;
}

/* ---- What belongs together ---- */

static apsm_status take_operands(parsing *p)
{
    cli_args *a = p->args;
    a->n_inputs = (size_t)(p->argc - optind);
    a->inputs = calloc(a->n_inputs + 1, sizeof *a->inputs);
    if (!a->inputs) return out_of_memory(p);
    for (size_t i = 0; i < a->n_inputs; i++) a->inputs[i] = p->argv[(size_t)optind + i];
    return APSM_OK;
}

bool cli_is_particles_file(const char *path)
{
    apsm_input_kind kind;
    return apsm_points_extension(path) && !apsm_input_kind_of(path, &kind);
}

bool cli_holds_particles(const char *path)
{
    return apsm_is_project_file(path) || cli_is_particles_file(path);
}

bool cli_may_hold_points(const char *path)
{
    return apsm_points_extension(path) && apsm_file_exists(path) && !cli_is_particles_file(path);
}

/* `evaluate` on particle files, not in a model folder. */
static bool evaluates_files(const cli_args *a)
{
    return a->verb->verb == CLI_EVALUATE && a->n_inputs > 0 &&
           (cli_holds_particles(a->inputs[0]) || cli_may_hold_points(a->inputs[0]));
}

/* initialize, optimize, evaluate, report and verify take their folder as operand or by -o. */
static apsm_status settle_folder(parsing *p)
{
    cli_args *a = p->args;
    if (!(a->verb->verb & (CLI_INITIALIZE | CLI_OPTIMIZE | CLI_EVALUATE | CLI_REPORT | CLI_VERIFY)))
        return APSM_OK;
    if (evaluates_files(a)) {
        if (!a->out_dir) return APSM_OK;
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "evaluate on particle files writes nothing: leave out -o %s", a->out_dir);
    }
    if (a->n_inputs > 1)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "%s works in one model folder, not in %zu",
                         a->verb->name, a->n_inputs);
    if (a->n_inputs == 1) APSM_TRY(take_path(p, "out", a->inputs[0], &a->out_dir));
    a->n_inputs = 0;
    return APSM_OK;
}

static apsm_status refuse_operands(const parsing *p, const char *what)
{
    const cli_verb_info *verb = p->args->verb;
    return apsm_fail(p->ctx, APSM_ERR_ARG, "%s needs %s: apsm %s %s", verb->name, what, verb->name,
                     verb->operands);
}

/* What the line of the verb's table asks for. */
static apsm_status require_operands(const parsing *p)
{
    const cli_args *a = p->args;
    const cli_verb_info *verb = a->verb;
    if (verb->first && a->n_inputs == 0) return refuse_operands(p, verb->first);
    if (verb->more && a->n_inputs < 2) return refuse_operands(p, verb->more);
    if (verb->most && a->n_inputs > verb->most && strncmp(verb->first, "one ", 4) == 0)
        return refuse_operands(p, verb->first);
    if (verb->most && a->n_inputs > verb->most)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "%s takes %zu operand%s, not %zu: apsm %s %s",
                         verb->name, verb->most, verb->most == 1 ? "" : "s", a->n_inputs,
                         verb->name, verb->operands);
    if (verb->out && !a->out_dir) return refuse_operands(p, verb->out);
    return APSM_OK;
}

/* What depends on more than the table says. */
static apsm_status require_inputs(const parsing *p)
{
    const cli_args *a = p->args;
    const bool makes = a->verb->verb & (CLI_RUN | CLI_GROOM);
    if (a->verb->verb == CLI_EVALUATE && !a->out_dir && !evaluates_files(a))
        return refuse_operands(p, "a model folder");
    if (makes && a->n_inputs == 0 && !apsm_is_folder(a->out_dir))
        return apsm_fail(p->ctx, APSM_ERR_ARG, "no inputs: apsm %s %s", a->verb->name,
                         a->verb->operands);
    return APSM_OK;
}

static apsm_status refuse_contradictions(const parsing *p)
{
    const cli_args *a = p->args;
    if (a->out_dir) APSM_TRY(apsm_refuse_root(p->ctx, a->out_dir));
    if (a->resume && a->overwrite)
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "--resume and --overwrite contradict each other; keep one");
    if (a->quiet && p->progress_given)
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "--quiet and --progress contradict each other; keep one");
    return APSM_OK;
}

/* ---- All ---- */

/* "help VERB" is "VERB --help", "help" is "--help". */
static apsm_status take_verb(parsing *p)
{
    const char *word = p->argc > 1 ? p->argv[1] : NULL;
    if (!word) return apsm_fail(p->ctx, APSM_ERR_ARG, "what shall be done? See apsm --help");
    if (word[0] == '-') return APSM_OK;
    if (strcmp(word, "help") == 0) {
        p->args->help = true;
        if (p->argc == 2) return APSM_OK;
        word = p->argv[2];
    }
    p->args->verb = cli_find_verb(word);
    if (!p->args->verb && strcmp(word, "version") == 0 && p->argc == 2)
        return p->args->version = true, p->argc = 1, APSM_OK;
    if (!p->args->verb && cli_verb_hint(word))
        return apsm_fail(p->ctx, APSM_ERR_ARG, "unknown verb '%s'; %s", word, cli_verb_hint(word));
    if (!p->args->verb)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "unknown verb '%s'; the nearest is '%s'", word,
                         cli_nearest_verb(word));
    const int used = p->args->help ? 2 : 1;
    p->argv += used; /* the verb now stands where the program's name did */
    p->argc -= used;
    return APSM_OK;
}

static apsm_status parse(parsing *p)
{
    cli_args *a = p->args;
    APSM_TRY(take_verb(p));
    APSM_TRY(check_names(p));
    APSM_TRY(run_getopt(p));
    if (a->help || a->version || (a->xml && a->verb)) return APSM_OK;
    if (!a->verb)
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "the verb comes first: apsm VERB ...; see apsm --help");
    APSM_TRY(take_operands(p));
    APSM_TRY(settle_folder(p));
    APSM_TRY(require_operands(p));
    APSM_TRY(require_inputs(p));
    APSM_TRY(refuse_contradictions(p));
    return cli_pairs_settle(p->ctx, a);
}

apsm_status cli_args_parse(apsm_context *ctx, int argc, char **argv, cli_args *args)
{
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);
    *args = (cli_args){ .threads = processors > 1 ? (int)processors : 1 };
    parsing p = { .ctx = ctx, .argc = argc, .argv = argv, .args = args };
    p.options = cli_options_list(&p.n_options);
    const apsm_status status = p.options ? parse(&p) : out_of_memory(&p);
    free(p.options);
    return status;
}

apsm_status cli_args_check_inputs(apsm_context *ctx, const cli_args *args)
{
    const size_t n = args->verb->verb == CLI_EXCLUDE ? 1 : args->n_inputs; /* then names follow */
    for (size_t i = 0; i < n && i < args->n_inputs; i++)
        if (!apsm_file_exists(args->inputs[i]) && !apsm_is_folder(args->inputs[i]))
            return apsm_fail(ctx, APSM_ERR_IO, "%s: no such file or folder; check the name",
                             args->inputs[i]);
    return APSM_OK;
}

apsm_status cli_args_check_output(apsm_context *ctx, const cli_args *args, const char *path)
{
    if (args->overwrite || !apsm_file_exists(path)) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_STATE,
                     "%s: is there already; give another name, or --overwrite to replace it", path);
}

void cli_args_free(cli_args *args)
{
    cli_pairs_free(args->set, args->n_set);
    free(args->inputs);
    *args = (cli_args){ 0 };
}
