/* args.h -- the command line as a struct. */
#ifndef APSM_CLI_ARGS_H
#define APSM_CLI_ARGS_H

#include <stdbool.h>
#include <stddef.h>

#include "apsm/context.h"

/* The verbs: X(bit, function), in the order of their bits. */
#define CLI_VERB_LIST(X)                                                                           \
    X(RUN, run)                                                                                    \
    X(GROOM, groom)                                                                                \
    X(INITIALIZE, initialize)                                                                      \
    X(OPTIMIZE, optimize)                                                                          \
    X(EVALUATE, evaluate)                                                                          \
    X(CERTIFY, certify)                                                                            \
    X(REPORT, report)                                                                              \
    X(RENDER, render)                                                                              \
    X(CHECK, check)                                                                                \
    X(CONVERT, convert)                                                                            \
    X(VERIFY, verify)                                                                              \
    X(INFO, info)                                                                                  \
    X(TEST, test)                                                                                  \
    X(ASYMMETRY, asymmetry)                                                                        \
    X(MEASURE, measure)                                                                            \
    X(PREDICT, predict)                                                                            \
    X(LANDMARKS_VERB, landmarks)                                                                   \
    X(NORM, norm)                                                                                  \
    X(FIT, fit)                                                                                    \
    X(EXCLUDE, exclude)                                                                            \
    X(ADD, add)                                                                                    \
    X(COMPARE, compare)                                                                            \
    X(IMPORT, import)                                                                              \
    X(WARP, warp)                                                                                  \
    X(EXPORT, export)

#define CLI_PLACE(bit, name) CLI_PLACE_##bit,
enum { CLI_VERB_LIST(CLI_PLACE) CLI_VERBS };
#undef CLI_PLACE
/* One bit a verb, for tables that say which verb takes what. */
#define CLI_BIT(bit, name) CLI_##bit = 1 << CLI_PLACE_##bit,
typedef enum cli_verb { CLI_VERB_LIST(CLI_BIT) CLI_NO_VERB = 0 } cli_verb;
#undef CLI_BIT

struct cli_args;
struct cli_ui;

/* A line of the table of verbs: all that the program knows of one. */
typedef struct cli_verb_info {
    cli_verb verb;
    const char *name, *operands, *summary;
    const char *text;     /* a paragraph for --help */
    const char *examples; /* for --help: commands, a line each, indented by two; or NULL */
    const char *first; /* what its first operand is, as "a model folder"; NULL: it may have none */
    const char *more;  /* what follows that, if it must; NULL: nothing must */
    const char *out;   /* what -o must give; NULL: nothing must */
    size_t most;       /* operands; 0: any number */
    apsm_status (*call)(apsm_context *ctx, const struct cli_args *args, struct cli_ui *ui);
} cli_verb_info;

/* By name; NULL if there is none. */
const cli_verb_info *cli_find_verb(const char *name);
const char *cli_nearest_verb(const char *word);
/* What to do instead, for verbs that other programs have; NULL: no word of that. */
const char *cli_verb_hint(const char *word);
/* All, in the order of the work; *n is how many. */
const cli_verb_info *cli_verbs(size_t *n);

typedef enum cli_progress_mode {
    CLI_PROGRESS_AUTO,
    CLI_PROGRESS_PLAIN,
    CLI_PROGRESS_JSON
} cli_progress_mode;

/* A key of apsm/options.h, "preset", or one of the texts "labels", "reflect_match", "exclude",
 * "template", "seed"; both owned. */
typedef struct cli_pair {
    char *key, *value;
} cli_pair;

typedef struct cli_args {
    const cli_verb_info *verb; /* NULL with help or version only */
    bool help, help_all, version, xml;
    size_t n_inputs;
    const char **inputs; /* array owned, texts of argv */
    const char
        *out_dir;   /* MODEL_DIR, however given, or what convert and render write; NULL if not */
    const char *to; /* of convert and export: the format; NULL if not given */
    const char *parts, *align_parts, *shared; /* of run: several parts a subject; NULL: one */
    const char *what, *shape, *view, *width;  /* of render, as given; NULL if not */
    const char *hand, *extent;                /* of fit, as given; NULL if not */
    const char *subjects, *formula, *of, *at, *on, *within, *permutations, *bootstraps, *stop_risk,
        *variances;         /* of test */
    const char *landmarks;  /* of fit: the file; NULL if not */
    const char *model;      /* of export: the file; NULL if not */
    const char *modes, *sd; /* of export, as given; NULL if not */
    const char *attach;     /* of warp: files that go along; NULL if not */
    const char *config;     /* already in set; here for messages */
    /* What was set, in order of rising priority: preset, config file, options.  Every key once. */
    size_t n_set;
    cli_pair *set;
    int threads;          /* >= 1 */
    size_t memory;        /* bytes; 0: no limit */
    size_t shard, shards; /* from 0; shards 0: all shapes */
    cli_progress_mode progress;
    bool resume, overwrite, dry_run, quiet;
    bool aligned, force; /* of fit */
} cli_args;

/* Understands argv (kept, borrowed; its order may change).  args is overwritten.  Anything unknown,
 * incomplete, out of range or contradictory is APSM_ERR_ARG with a line that names the nearest that
 * exists; a configuration file that cannot be read gives its own status. */
apsm_status cli_args_parse(apsm_context *ctx, int argc, char **argv, cli_args *args) APSM_NODISCARD;
/* Refuses inputs that do not exist, before a folder is made for their results. */
apsm_status cli_args_check_inputs(apsm_context *ctx, const cli_args *args) APSM_NODISCARD;
/* Refuses a file that is there already unless --overwrite was given: nobody but the user knows
 * whose it is. */
apsm_status cli_args_check_output(apsm_context *ctx, const cli_args *args,
                                  const char *path) APSM_NODISCARD;
void cli_args_free(cli_args *args);

/* By its extension (apsm/points_file.h); .vtk and .vtp count as meshes. */
bool cli_is_particles_file(const char *path);
/* That, or a project file: what evaluate reads besides model folders. */
bool cli_holds_particles(const char *path);
/* A file whose format is of meshes and of points: only its content tells. */
bool cli_may_hold_points(const char *path);
/* Value of a key in set, or NULL. */
const char *cli_args_get(const cli_args *args, const char *key);

#endif
