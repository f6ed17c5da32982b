/* options_table.h -- all options of the command line: our own and those of the method, in one list
 * that parsing, help and suggestions share. */
#ifndef APSM_CLI_OPTIONS_TABLE_H
#define APSM_CLI_OPTIONS_TABLE_H

#include "apsm/options.h"
#include "args.h"

/* What an option does when it is met. */
typedef enum cli_action {
    CLI_SETS,     /* adds the pair key = argument (or = value if it takes none) */
    CLI_SET_PAIR, /* --set key=value */
    CLI_OUT,
    CLI_TO,
    CLI_MODES,
    CLI_SD,
    CLI_ATTACH,
    CLI_PARTS,
    CLI_ALIGN_PARTS,
    CLI_SHARED,
    CLI_WHAT,
    CLI_SHAPE,
    CLI_VIEW,
    CLI_WIDTH,
    CLI_HAND,
    CLI_SUBJECTS,
    CLI_FORMULA,
    CLI_OF,
    CLI_AT,
    CLI_ON,
    CLI_WITHIN,
    CLI_PERMUTATIONS,
    CLI_BOOTSTRAPS,
    CLI_STOP_RISK,
    CLI_VARIANCES,
    CLI_EXTENT,
    CLI_LANDMARKS, /* fit: a text of its own; else as CLI_SETS */
    CLI_MODEL,
    CLI_CONFIG,
    CLI_THREADS,
    CLI_MEMORY,
    CLI_SHARD,
    CLI_PROGRESS,
    CLI_FLAG_RESUME,
    CLI_FLAG_OVERWRITE,
    CLI_FLAG_DRY_RUN,
    CLI_FLAG_QUIET,
    CLI_FLAG_ALIGNED,
    CLI_FLAG_FORCE,
    CLI_FLAG_HELP,
    CLI_FLAG_HELP_ALL,
    CLI_FLAG_VERSION,
    CLI_FLAG_XML
} cli_action;

typedef enum cli_group {
    CLI_GROUP_INPUT,
    CLI_GROUP_MODEL,
    CLI_GROUP_RUN,
    CLI_GROUP_METHOD
} cli_group;

typedef struct cli_option {
    char name[48]; /* as written behind "--" */
    char letter;   /* short form, or 0 */
    cli_action action;
    cli_group group;
    unsigned verbs;       /* bits of the verbs that take it */
    const char *argument; /* "N", "DIR", ...; NULL: takes none */
    const char *key;      /* of CLI_SETS */
    const char *value;    /* of CLI_SETS without argument */
    const char *doc;
    const apsm_option_info *method; /* row of apsm/options.h, or NULL */
} cli_option;

/* A new list of *n options (free() it), NULL if out of memory. */
cli_option *cli_options_list(size_t *n);

/* What it means to that verb. */
const char *cli_option_doc(const cli_option *o, cli_verb verb);

/* Whether key can stand in --set and configuration files. */
bool cli_is_key(const char *key);
/* The option name (or key, or verb) nearest to word: borrowed from the tables. */
const char *cli_nearest_option(const cli_option *options, size_t n, const char *word);
const char *cli_nearest_key(const char *word);

#endif
