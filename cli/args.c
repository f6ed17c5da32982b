/* From argv to cli_args: getopt_long over the list of options_table.h, then everything that an
 * option alone cannot tell: what belongs to the verb, what contradicts what. */
#define _DEFAULT_SOURCE /* getopt_long, _SC_NPROCESSORS_ONLN */
#include "args.h"

#include <errno.h>
#include <getopt.h>
#include <regex.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "apsm/files.h"
#include "config.h"
#include "options_table.h"

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

/* ---- Verbs ---- */

static const cli_verb_info verbs[] = {
    { CLI_RUN, "run", "INPUT... -o MODEL_DIR",
      "the whole job: groom, initialize, optimize, evaluate",
      "Makes a shape model of the inputs: segmentations (NRRD, NIfTI, MetaImage, DICOM folders), "
      "meshes (PLY, STL, OBJ, VTK, VTP), folders of them, or a project (.swproj). An interrupted "
      "run goes on with --resume, and every step can be repeated on its own." },
    { CLI_GROOM, "groom", "INPUT... -o MODEL_DIR", "inputs to clean, aligned meshes",
      "Reads the inputs, makes one closed mesh of each, chooses the template and aligns all to it. "
      "Without INPUT the inputs named in the folder's project are groomed again." },
    { CLI_INITIALIZE, "initialize", "MODEL_DIR", "first particles on groomed meshes",
      "Places the first particles on every groomed mesh." },
    { CLI_OPTIMIZE, "optimize", "MODEL_DIR", "particles to correspondence",
      "Moves the particles to correspondence in two stages. With --resume from the last "
      "checkpoint, else from the first particles." },
    { CLI_EVALUATE, "evaluate", "MODEL_DIR", "the model, its quality, reconstructed meshes",
      "Makes mean and modes of variation, scores, surface distances, compactness, generalization, "
      "specificity, the certificate of correspondence, and meshes." },
    { CLI_CHECK, "check", "INPUT...|MODEL_DIR", "what is wrong with inputs or a project",
      "Reads everything and tells every problem in one line; writes nothing. The exit code is 0 if "
      "there is none." },
    { CLI_INFO, "info", "MODEL_DIR|FILE", "what a model folder or file holds",
      "Tells in a few lines what a model folder or one of its files holds." },
};
enum { VERBS = sizeof verbs / sizeof *verbs };

const cli_verb_info *cli_verbs(size_t *n)
{
    *n = VERBS;
    return verbs;
}

const cli_verb_info *cli_find_verb(const char *name)
{
    for (size_t i = 0; i < VERBS; i++)
        if (strcmp(verbs[i].name, name) == 0) return &verbs[i];
    return NULL;
}

static apsm_status unknown_verb(const parsing *p, const char *word)
{
    size_t best = 0, least = SIZE_MAX;
    for (size_t i = 0; i < VERBS; i++) {
        const size_t d = apsm_edit_distance(word, verbs[i].name);
        if (d < least) least = d, best = i;
    }
    return apsm_fail(p->ctx, APSM_ERR_ARG, "unknown verb '%s'; the nearest is '%s'", word,
                     verbs[best].name);
}

/* ---- Pairs ---- */

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

static apsm_status check_expression(const parsing *p, const char *key, const char *value)
{
    regex_t regex;
    char why[128];
    const int error = regcomp(&regex, value, REG_EXTENDED | REG_NOSUB);
    if (error == 0) {
        regfree(&regex);
        return APSM_OK;
    }
    regerror(error, &regex, why, sizeof why);
    return apsm_fail(p->ctx, APSM_ERR_ARG, "%s = %s: %s; give a POSIX extended regular expression",
                     key, value, why);
}

static apsm_status check_seed(const parsing *p, const char *value)
{
    char *end;
    errno = 0;
    strtoull(value, &end, 10);
    if (*value >= '0' && *value <= '9' && !*end && !errno) return APSM_OK;
    return apsm_fail(p->ctx, APSM_ERR_ARG, "seed = %s: give a whole number from 0 to %llu", value,
                     (unsigned long long)UINT64_MAX);
}

/* Values are tried out here, so that a mistake is told before anything is read. */
static apsm_status check_value(const parsing *p, const char *key, const char *value)
{
    apsm_options scratch = apsm_options_defaults();
    if (strcmp(key, "preset") == 0) return apsm_options_preset(p->ctx, &scratch, value);
    if (strcmp(key, "seed") == 0) return check_seed(p, value);
    if (strcmp(key, "exclude") == 0 || strcmp(key, "reflect_match") == 0)
        return check_expression(p, key, value);
    if (strcmp(key, "labels") == 0) return cli_check_labels(p->ctx, value);
    if (strcmp(key, "template") == 0 || strcmp(key, "original_frame") == 0)
        return *value ? APSM_OK : apsm_fail(p->ctx, APSM_ERR_ARG, "%s is empty", key);
    return apsm_options_set(p->ctx, &scratch, key, value);
}

/* Adds a pair of the command line; the same key with another value is a contradiction. */
static apsm_status add_pair(parsing *p, const char *key, const char *value)
{
    APSM_TRY(check_value(p, key, value));
    const char *before = cli_args_get(p->args, key);
    if (before && strcmp(before, value) != 0)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "%s is given twice, as %s and as %s; keep one", key,
                         before, value);
    if (before) return APSM_OK;
    return append_pair(p->args, key, value) ? APSM_OK : out_of_memory(p);
}

static apsm_status add_assignment(parsing *p, const char *text)
{
    char key[64];
    const char *equals = strchr(text, '=');
    if (!equals || equals == text || (size_t)(equals - text) >= sizeof key)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "--set %s: give KEY=VALUE", text);
    snprintf(key, sizeof key, "%.*s", (int)(equals - text), text);
    for (char *c = key; *c; c++)
        if (*c == '-') *c = '_';
    if (!cli_is_key(key))
        return apsm_fail(p->ctx, APSM_ERR_ARG, "--set %s: unknown option '%s'; the nearest is '%s'",
                         text, key, cli_nearest_key(key));
    return add_pair(p, key, equals + 1);
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

static apsm_status take_option(parsing *p, const cli_option *o, const char *text)
{
    cli_args *a = p->args;
    switch (o->action) {
    case CLI_SETS:
        return add_pair(p, o->key, o->argument ? text : o->value);
    case CLI_SET_PAIR:
        return add_assignment(p, text);
    case CLI_OUT:
        return take_path(p, o->name, text, &a->out_dir);
    case CLI_CONFIG:
        return take_path(p, o->name, text, &a->config);
    case CLI_THREADS:
        return take_threads(p, text);
    case CLI_PROGRESS:
        return take_progress(p, text);
    case CLI_FLAG_RESUME:
        return a->resume = true, APSM_OK;
    case CLI_FLAG_OVERWRITE:
        return a->overwrite = true, APSM_OK;
    case CLI_FLAG_DRY_RUN:
        return a->dry_run = true, APSM_OK;
    case CLI_FLAG_QUIET:
        return a->quiet = true, APSM_OK;
    case CLI_FLAG_HELP:
        return a->help = true, APSM_OK;
    case CLI_FLAG_HELP_ALL:
        return a->help = a->help_all = true, APSM_OK;
    case CLI_FLAG_VERSION:
        return a->version = true, APSM_OK;
    }
    return APSM_ERR_ARG;
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

/* getopt takes any unambiguous beginning of a name; a script that relies on that breaks when an
 * option is added.  So names must be whole.  */
static apsm_status check_names(const parsing *p)
{
    for (int i = 1; i < p->argc; i++) {
        const char *word = p->argv[i];
        if (strcmp(word, "--") == 0) break;
        if (strncmp(word, "--", 2) != 0) continue;
        const size_t length = strcspn(word + 2, "=");
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

/* initialize, optimize and evaluate take their folder as operand or by -o. */
static apsm_status settle_folder(parsing *p)
{
    cli_args *a = p->args;
    if (!(a->verb->verb & (CLI_INITIALIZE | CLI_OPTIMIZE | CLI_EVALUATE))) return APSM_OK;
    if (a->n_inputs > 1)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "%s works in one model folder, not in %zu",
                         a->verb->name, a->n_inputs);
    if (a->n_inputs == 1) APSM_TRY(take_path(p, "out", a->inputs[0], &a->out_dir));
    a->n_inputs = 0;
    return APSM_OK;
}

static apsm_status require_operands(const parsing *p)
{
    const cli_args *a = p->args;
    const bool makes = a->verb->verb & (CLI_RUN | CLI_GROOM);
    if (!(a->verb->verb & (CLI_CHECK | CLI_INFO)) && !a->out_dir)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "%s needs a model folder: apsm %s %s", a->verb->name,
                         a->verb->name, a->verb->operands);
    if ((a->verb->verb & (CLI_CHECK | CLI_INFO)) && a->n_inputs == 0)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "%s needs something to look at: apsm %s %s",
                         a->verb->name, a->verb->name, a->verb->operands);
    if (makes && a->n_inputs == 0 && !apsm_is_folder(a->out_dir))
        return apsm_fail(p->ctx, APSM_ERR_ARG, "no inputs: apsm %s %s", a->verb->name,
                         a->verb->operands);
    if (a->verb->verb == CLI_INFO && a->n_inputs > 1)
        return apsm_fail(p->ctx, APSM_ERR_ARG, "info looks at one folder or file, not at %zu",
                         a->n_inputs);
    return APSM_OK;
}

static apsm_status refuse_contradictions(const parsing *p)
{
    const cli_args *a = p->args;
    if (a->resume && a->overwrite)
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "--resume and --overwrite contradict each other; keep one");
    if (a->quiet && p->progress_given)
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "--quiet and --progress contradict each other; keep one");
    return APSM_OK;
}

/* ---- Priorities ---- */

static void free_pairs(cli_pair *pairs, size_t n)
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

/* set <- preset, then the file's pairs that the command line does not replace, then its own. */
static apsm_status merge_pairs(parsing *p, const cli_pair *file, size_t n_file,
                               const cli_pair *given, size_t n_given)
{
    cli_args *a = p->args;
    const char *preset = value_of(given, n_given, "preset");
    if (!preset) preset = value_of(file, n_file, "preset");
    bool done = !preset || append_pair(a, "preset", preset);
    for (size_t i = 0; i < n_file && done; i++)
        if (strcmp(file[i].key, "preset") != 0 && !value_of(given, n_given, file[i].key))
            done = append_pair(a, file[i].key, file[i].value);
    for (size_t i = 0; i < n_given && done; i++)
        if (strcmp(given[i].key, "preset") != 0)
            done = append_pair(a, given[i].key, given[i].value);
    return done ? APSM_OK : out_of_memory(p);
}

static apsm_status check_file_values(const parsing *p, const cli_pair *file, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const apsm_status status = check_value(p, file[i].key, file[i].value);
        if (status != APSM_OK)
            return apsm_fail(p->ctx, status, "%s: %s", p->args->config, apsm_error_text(p->ctx));
    }
    return APSM_OK;
}

static apsm_status settle_pairs(parsing *p)
{
    cli_args *a = p->args;
    cli_pair *given = a->set, *file = NULL;
    const size_t n_given = a->n_set;
    size_t n_file = 0;
    a->set = NULL;
    a->n_set = 0;
    apsm_status status = a->config ? cli_config_read(p->ctx, a->config, &file, &n_file) : APSM_OK;
    if (status == APSM_OK) status = check_file_values(p, file, n_file);
    if (status == APSM_OK) status = merge_pairs(p, file, n_file, given, n_given);
    free_pairs(given, n_given);
    free_pairs(file, n_file);
    return status;
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
    if (!p->args->verb) return unknown_verb(p, word);
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
    if (a->help || a->version) return APSM_OK;
    if (!a->verb)
        return apsm_fail(p->ctx, APSM_ERR_ARG,
                         "the verb comes first: apsm VERB ...; see apsm --help");
    APSM_TRY(take_operands(p));
    APSM_TRY(settle_folder(p));
    APSM_TRY(require_operands(p));
    APSM_TRY(refuse_contradictions(p));
    return settle_pairs(p);
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

void cli_args_free(cli_args *args)
{
    free_pairs(args->set, args->n_set);
    free(args->inputs);
    *args = (cli_args){ 0 };
}
