/* The options of the command line.  Those of the method come from the table in apsm/options.h: each
 * is --name-with-dashes, a switch also --no-name. */
#include "options_table.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    STEPS = CLI_RUN | CLI_GROOM | CLI_INITIALIZE | CLI_OPTIMIZE | CLI_EVALUATE,
    GROOMS = CLI_RUN | CLI_GROOM,
    READS = GROOMS | CLI_CHECK | CLI_FIT,
    TESTS = CLI_TEST | CLI_ASYMMETRY,
    STATISTICS = TESTS | CLI_MEASURE | CLI_NORM | CLI_PREDICT,
    ALL = STEPS | CLI_CHECK | CLI_INFO | CLI_REPORT | CLI_CONVERT | CLI_RENDER | CLI_VERIFY |
          CLI_FIT | CLI_EXPORT | CLI_EXCLUDE | CLI_ADD | STATISTICS | CLI_CERTIFY | CLI_COMPARE |
          CLI_LANDMARKS_VERB | CLI_IMPORT | CLI_WARP
};

static const cli_option own[] = {
    { "out", 'o', CLI_OUT, CLI_GROUP_INPUT,
      STEPS | CLI_REPORT | CLI_CONVERT | CLI_RENDER | CLI_VERIFY | CLI_FIT | STATISTICS |
          CLI_CERTIFY | CLI_EXPORT | CLI_COMPARE | CLI_LANDMARKS_VERB | CLI_IMPORT | CLI_WARP,
      "DIR", NULL, NULL,
      "the model folder (convert, render, fit, certify, export: the file or folder to write); made "
      "if it "
      "does not exist",
      NULL },
    { "to", 0, CLI_TO, CLI_GROUP_INPUT, CLI_CONVERT | CLI_EXPORT | CLI_WARP, "EXT", NULL, NULL,
      "convert: write a folder with a file NAME.EXT for each shape: particles, lpts, wpts, csv, "
      "npy, mrk.json, vtk or vtp; export: vtp, ply, stl, obj, monai, slicermorph or csv (into a "
      "folder), gltf, npz, scalismo or statismo (into a file); warp: ply, vtp, stl, obj or vtk "
      "(default "
      "ply)",
      NULL },
    { "modes", 0, CLI_MODES, CLI_GROUP_INPUT, CLI_EXPORT, "N", NULL, NULL,
      "export at most so many modes (default: all; of meshes and gltf those that make up 95 % of "
      "the variance, 10 at most)",
      NULL },
    { "attach", 0, CLI_ATTACH, CLI_GROUP_INPUT, CLI_WARP, "FILE[,FILE]", NULL, NULL,
      "what lies on or in the template and goes along: landmarks (.mrk.json, .fcsv, .csv), and "
      "meshes of triangles or tetrahedra (.vtk), whose labels and other data stay with them",
      NULL },
    { "sd", 0, CLI_SD, CLI_GROUP_INPUT, CLI_EXPORT, "X[,X]", NULL, NULL,
      "where on a mode its meshes are, in standard deviations to both sides (default 2)", NULL },
    { "what", 0, CLI_WHAT, CLI_GROUP_INPUT, CLI_RENDER, "WORD", NULL, NULL,
      "one picture: mean, modes, shape or cohort (default: all four, into a folder)", NULL },
    { "shape", 0, CLI_SHAPE, CLI_GROUP_INPUT, CLI_RENDER, "NAME", NULL, NULL,
      "the shape to draw with its particles (default: the template)", NULL },
    { "view", 0, CLI_VIEW, CLI_GROUP_INPUT, CLI_RENDER, "X,Y,Z", NULL, NULL,
      "direction from the shapes to the viewer, or +x, -x, +y, -y, +z, -z, auto (default auto)",
      NULL },
    { "width", 0, CLI_WIDTH, CLI_GROUP_INPUT, CLI_RENDER, "N", NULL, NULL,
      "width of the picture in pixels, 64 to 8000 (default: as the picture needs)", NULL },
    { "model", 0, CLI_MODEL, CLI_GROUP_INPUT, CLI_EXPORT, "FILE", NULL, NULL,
      "the file to write: all that fit needs of the model", NULL },
    { "hand", 0, CLI_HAND, CLI_GROUP_INPUT, CLI_FIT, "WORD", NULL, NULL,
      "side of the shapes: auto (found out), same (as the model), other (mirror them) (default "
      "auto)",
      NULL },
    { "extent", 0, CLI_EXTENT, CLI_GROUP_INPUT, CLI_FIT, "WORD", NULL, NULL,
      "auto (surfaces with openings, or cut by the image, are parts), whole or part (default auto)",
      NULL },
    { "formula", 0, CLI_FORMULA, CLI_GROUP_INPUT, CLI_TEST | CLI_NORM, "TEXT", NULL, NULL,
      "what the shapes depend on, \"~ group + age + group:age\": columns of the table, of the "
      "project, or centroid_size",
      NULL },
    { "of", 0, CLI_OF, CLI_GROUP_INPUT, TESTS | CLI_PREDICT, "TERM", NULL, NULL,
      "the term that is tested, the others being allowed for (default: the first); predict: the "
      "column; asymmetry: the column of the sides",
      NULL },
    { "at", 0, CLI_AT, CLI_GROUP_INPUT, CLI_PREDICT, "X,Y", NULL, NULL,
      "values of the column for which the shape to be expected is written as a mesh", NULL },
    { "subjects", 0, CLI_SUBJECTS, CLI_GROUP_INPUT, STATISTICS, "FILE", NULL, NULL,
      "table of the subjects (.csv, .tsv): a header, then a line each, first the shape's name",
      NULL },
    { "on", 0, CLI_ON, CLI_GROUP_INPUT, TESTS, "WORD", NULL, NULL,
      "form (shape and size), shape (size taken out), size, modes, or a column of numbers such as "
      "a "
      "measurement (default form)",
      NULL },
    { "within", 0, CLI_WITHIN, CLI_GROUP_INPUT, TESTS, "COLUMN", NULL, NULL,
      "who was measured repeatedly: compares within each of its levels only; asymmetry: the column "
      "of the subjects",
      NULL },
    { "variances", 0, CLI_VARIANCES, CLI_GROUP_INPUT, CLI_TEST, "WORD", NULL, NULL,
      "equal (subjects may change places) or unequal (one group may vary more than another, errors "
      "being symmetric: their signs are drawn) (default equal)",
      NULL },
    { "permutations", 0, CLI_PERMUTATIONS, CLI_GROUP_RUN, TESTS, "N", NULL, NULL,
      "orders of the subjects to go through; all there are, if they are not more (default 10000)",
      NULL },
    { "bootstraps", 0, CLI_BOOTSTRAPS, CLI_GROUP_RUN, TESTS, "N", NULL, NULL,
      "draws for the 95 % bands of effects; 0: no bands (default 1000)", NULL },
    { "stop-risk", 0, CLI_STOP_RISK, CLI_GROUP_RUN, TESTS, "X", NULL, NULL,
      "end early when it is known which p and q are below 5 %, with at most this probability that "
      "more orders would say otherwise of any, such as 0.001 (default 0: go through all)",
      NULL },
    { "landmarks", 0, CLI_LANDMARKS, CLI_GROUP_INPUT, CLI_FIT | GROOMS | CLI_CHECK, "PATH",
      "landmarks", NULL,
      "landmarks of the shapes: a folder with NAME.mrk.json, NAME.fcsv or NAME.csv (name,x,y,z) "
      "for "
      "each, or a .csv of all (shape,name,x,y,z); --landmarks-use says what for. fit: named points "
      "on the mean shape (meshes/mean.ply): inputs that are files of points (.mrk.json, .fcsv, "
      ".csv) "
      "are landmarks of these names; without it they are clouds",
      NULL },
    { "features", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "LIST", "features", NULL,
      "what must correspond beside the form: fields of the vertices (.ply, .vtk, .vtp) or images "
      "that a "
      "project "
      "names (image_NAME), and normals, with weights: thickness:1,normals:0.5; weight 0: only "
      "sampled at the particles",
      NULL },
    { "aligned", 0, CLI_FLAG_ALIGNED, CLI_GROUP_INPUT, CLI_FIT | CLI_LANDMARKS_VERB, NULL, NULL,
      NULL,
      "shapes (landmarks: points, on the mean) are in the world frame of the model: search for no "
      "pose",
      NULL },
    { "force", 0, CLI_FLAG_FORCE, CLI_GROUP_INPUT, CLI_FIT, NULL, NULL, NULL,
      "fit shapes that would be refused, too", NULL },
    { "label", 0, CLI_SETS, CLI_GROUP_INPUT, READS | CLI_ADD, "L[,L]", "labels", NULL,
      "labels of a segmentation that make up the shape, by number or name, or 'all'; needed if "
      "there "
      "are several; '>0.5' or '<0': where the values of an image are so",
      NULL },
    { "reflect-match", 0, CLI_SETS, CLI_GROUP_INPUT, READS | CLI_ADD, "REGEX", "reflect_match",
      NULL, "mirror the inputs whose file name matches (left sides among right ones)", NULL },
    { "parts", 0, CLI_PARTS, CLI_GROUP_INPUT, CLI_RUN | CLI_FIT, "LIST", NULL, NULL,
      "several parts a subject, one model of all: tibia=REGEX,talus=REGEX (what the names of a "
      "part's shapes have; the rest of the name is the subject) or tibia=1,talus=2+3 (labels)",
      NULL },
    { "shared-boundary", 0, CLI_SHARED, CLI_GROUP_INPUT, CLI_RUN, "A,B", NULL, NULL,
      "with --parts: what two parts that touch share becomes a part of its own, A-B, and they keep "
      "the rest; A,B,T: where they are nearer than T spacings (default 0.1)",
      NULL },
    { "align-parts", 0, CLI_ALIGN_PARTS, CLI_GROUP_INPUT, CLI_RUN, "WORD", NULL, NULL,
      "with --parts: global (all parts move together), apart (each for itself), or the part by "
      "which the others are aligned (default global)",
      NULL },
    { "exclude", 0, CLI_SETS, CLI_GROUP_INPUT, READS | CLI_ADD, "REGEX", "exclude", NULL,
      "leave out the inputs whose file name matches", NULL },
    { "pattern", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "GLOB", "pattern", NULL,
      "of folders and all folders below only the shapes whose path matches: '**/liver.nii.gz', "
      "'sub-*/anat/*_dseg.nii.gz'; ** is any number of folders",
      NULL },
    { "fixed", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "NAMES", "fixed", NULL,
      "of a project: shapes (names with commas, or all that it gives particles of) whose particles "
      "stay as they are, beside those of its column fixed; the others are optimised against them",
      NULL },
    { "ignore", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "LIST", "ignore", NULL,
      "go on without what a project asks for and is not done here: constraints, landmarks, "
      "normals, fixed, domains, reflect",
      NULL },
    { "domain", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "NAME", "domain", NULL,
      "of a project with several domains (shape_NAME, ...) the one to model alone; without it they "
      "become one model, as with --parts",
      NULL },
    { "constraints", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "PATH", "constraints", NULL,
      "only a part of the surface counts: a folder with a file NAME.json for each shape, or one "
      "file, of the shape that it is called like or of the one that --template names; shapes "
      "without get the region by registration",
      NULL },
    { "template", 0, CLI_SETS, CLI_GROUP_INPUT,
      GROOMS | CLI_CHECK | CLI_EVALUATE | CLI_CERTIFY | CLI_IMPORT, "NAME", "template", NULL,
      "the shape that neighbours and meshes are taken from; auto: the one that suits the others "
      "best (default auto); evaluate of files and projects: the one to warp to the others",
      NULL },
    { "unit", 0, CLI_SETS, CLI_GROUP_INPUT, STEPS | CLI_IMPORT, "WORD", "unit", NULL,
      "unit of the lengths, for report and scale bars: mm, cm, m (default: mm for images, not "
      "known "
      "for meshes)",
      NULL },
    { "preset", 0, CLI_SETS, CLI_GROUP_MODEL, STEPS, "NAME", "preset", NULL,
      "a named set of options: default, paper-literal-femur, paper-literal-liver or "
      "paper-literal-hip; other options change it",
      NULL },
    { "config", 0, CLI_CONFIG, CLI_GROUP_MODEL, STEPS, "FILE", NULL, NULL,
      "options from a JSON file, {\"particles\": 256, ...}, or from the manifest.json of an "
      "earlier "
      "run",
      NULL },
    { "set", 0, CLI_SET_PAIR, CLI_GROUP_MODEL, STEPS, "KEY=VALUE", NULL, NULL,
      "any option of the method (see --help-all)", NULL },
    { "seed", 0, CLI_SETS, CLI_GROUP_RUN, STEPS | TESTS | CLI_NORM | CLI_PREDICT, "N", "seed", NULL,
      "seed of all random numbers (default 0); the result depends on it, not on the threads",
      NULL },
    { "threads", 0, CLI_THREADS, CLI_GROUP_RUN,
      STEPS | CLI_CHECK | CLI_REPORT | CLI_RENDER | CLI_VERIFY | CLI_IMPORT | CLI_WARP | CLI_FIT |
          CLI_EXPORT | CLI_EXCLUDE | CLI_ADD | STATISTICS | CLI_COMPARE,
      "N", NULL, NULL, "threads to use (default: one for each processor)", NULL },
    { "memory", 0, CLI_MEMORY, CLI_GROUP_RUN, STEPS, "LIMIT", NULL, NULL,
      "keep to about this much memory (2G, 500M): shapes go to a file in state/ that is gone "
      "afterwards; changes the time, never the result (default: no limit)",
      NULL },
    { "shard", 0, CLI_SHARD, CLI_GROUP_RUN, CLI_GROOM | CLI_INITIALIZE, "K/N", NULL, NULL,
      "do only every N-th shape, from the K-th on, keep it in state/, and end: for arrays of jobs "
      "on machines that share the folder; afterwards the same without --shard gathers what all "
      "have kept. The result is the same",
      NULL },
    { "resume", 0, CLI_FLAG_RESUME, CLI_GROUP_RUN, STEPS, NULL, NULL, NULL,
      "go on with an unfinished run in the model folder", NULL },
    { "overwrite", 0, CLI_FLAG_OVERWRITE, CLI_GROUP_RUN,
      GROOMS | CLI_FIT | CLI_EXPORT | CLI_WARP | CLI_COMPARE | CLI_CONVERT | CLI_RENDER |
          CLI_CERTIFY,
      NULL, NULL, NULL, "replace what is in the folder (or the file of -o) already", NULL },
    { "dry-run", 0, CLI_FLAG_DRY_RUN, CLI_GROUP_RUN, GROOMS, NULL, NULL, NULL,
      "tell what would be done, write nothing", NULL },
    { "progress", 0, CLI_PROGRESS, CLI_GROUP_RUN, ALL, "MODE", NULL, NULL,
      "auto (a bar on a terminal, lines elsewhere), plain or json (default auto)", NULL },
    { "quiet", 'q', CLI_FLAG_QUIET, CLI_GROUP_RUN, ALL, NULL, NULL, NULL,
      "only warnings, errors and what was asked for", NULL },
    { "help", 'h', CLI_FLAG_HELP, CLI_GROUP_RUN, ALL, NULL, NULL, NULL, "this text", NULL },
    { "help-all", 0, CLI_FLAG_HELP_ALL, CLI_GROUP_RUN, ALL, NULL, NULL, NULL,
      "this text with all options of the method", NULL },
    { "xml", 0, CLI_FLAG_XML, CLI_GROUP_RUN, ALL, NULL, NULL, NULL,
      "describe the verb as a module of 3D Slicer (Slicer Execution Model)", NULL },
    { "version", 'V', CLI_FLAG_VERSION, CLI_GROUP_RUN, ALL, NULL, NULL, NULL, "print the version",
      NULL },
};
enum { OWN = sizeof own / sizeof *own };

/* Method options that everybody needs stand in the short help. */
static const struct {
    const char *name;
    char letter;
    cli_group group;
} core[] = {
    { "particles", 'J', CLI_GROUP_MODEL },   { "adaptivity", 0, CLI_GROUP_MODEL },
    { "alpha", 0, CLI_GROUP_MODEL },         { "beta", 0, CLI_GROUP_MODEL },
    { "gamma", 0, CLI_GROUP_MODEL },         { "stage1_epochs", 0, CLI_GROUP_MODEL },
    { "stage2_epochs", 0, CLI_GROUP_MODEL }, { "align", 0, CLI_GROUP_INPUT },
    { "cuts", 0, CLI_GROUP_INPUT },          { "original_frame", 0, CLI_GROUP_INPUT },
    { "landmarks_use", 0, CLI_GROUP_INPUT }, { "align_by", 0, CLI_GROUP_INPUT },
};

static void dashed(const char *prefix, const char *key, char name[48])
{
    snprintf(name, 48, "%s%s", prefix, key);
    for (char *c = name; *c; c++)
        if (*c == '_') *c = '-';
}

static cli_option method_option(const apsm_option_info *m)
{
    static const char *const arguments[] = { "N", "X", NULL, "WORD" };
    cli_option o = { .action = CLI_SETS,
                     .group = CLI_GROUP_METHOD,
                     .verbs = STEPS,
                     .argument = arguments[m->kind],
                     .key = m->name,
                     .value = "true",
                     .doc = m->doc,
                     .method = m };
    dashed("", m->name, o.name);
    for (size_t i = 0; i < sizeof core / sizeof *core; i++)
        if (strcmp(core[i].name, m->name) == 0) {
            o.letter = core[i].letter;
            o.group = core[i].group;
        }
    return o;
}

cli_option *cli_options_list(size_t *n)
{
    size_t n_method;
    const apsm_option_info *method = apsm_options_table(&n_method);
    cli_option *list = malloc((OWN + 2 * n_method) * sizeof *list);
    *n = 0;
    if (!list) return NULL;
    memcpy(list, own, sizeof own);
    *n = OWN;
    for (size_t i = 0; i < n_method; i++) {
        list[(*n)++] = method_option(&method[i]);
        if (method[i].kind != APSM_OPTION_BOOL) continue;
        list[*n] = list[*n - 1];
        list[*n].value = "false";
        dashed("no-", method[i].name, list[(*n)++].name);
    }
    return list;
}

/* ---- Names ---- */

static const char *const texts[] = { "preset",   "labels",    "reflect_match", "exclude",
                                     "pattern",  "ignore",    "domain",        "template",
                                     "seed",     "landmarks", "unit",          "constraints",
                                     "features", "fixed" };
enum { TEXTS = sizeof texts / sizeof *texts };

bool cli_is_key(const char *key)
{
    size_t n;
    const apsm_option_info *method = apsm_options_table(&n);
    for (size_t i = 0; i < n; i++)
        if (strcmp(method[i].name, key) == 0) return true;
    for (size_t i = 0; i < TEXTS; i++)
        if (strcmp(texts[i], key) == 0) return true;
    return false;
}

/* Edits, but the beginning of a name is nearer than any other name. */
static size_t distance(const char *word, const char *name)
{
    const size_t length = strlen(word);
    return length > 0 && strncmp(word, name, length) == 0 ? 0 : apsm_edit_distance(word, name);
}

const char *cli_nearest_option(const cli_option *options, size_t n, const char *word)
{
    const char *best = "help";
    size_t least = SIZE_MAX;
    for (size_t i = 0; i < n; i++) {
        const size_t d = distance(word, options[i].name);
        if (d < least) least = d, best = options[i].name;
    }
    return best;
}

const char *cli_nearest_key(const char *word)
{
    size_t n, least = SIZE_MAX;
    const apsm_option_info *method = apsm_options_table(&n);
    const char *best = "particles";
    for (size_t i = 0; i < n + TEXTS; i++) {
        const char *key = i < n ? method[i].name : texts[i - n];
        const size_t d = distance(word, key);
        if (d < least) least = d, best = key;
    }
    return best;
}
