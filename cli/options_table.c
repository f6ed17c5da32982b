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
      "DIR", NULL, NULL, "the model folder; made if it does not exist", NULL },
    { "to", 0, CLI_TO, CLI_GROUP_INPUT, CLI_CONVERT | CLI_EXPORT | CLI_WARP, "EXT", NULL, NULL,
      "format of the output: ply, vtp, stl, obj or vtk (default ply)", NULL },
    { "modes", 0, CLI_MODES, CLI_GROUP_INPUT, CLI_EXPORT, "N", NULL, NULL,
      "how many modes to export at most (default: all; for meshes and gltf those that make up 95 % "
      "of the variance, at most 10)",
      NULL },
    { "attach", 0, CLI_ATTACH, CLI_GROUP_INPUT, CLI_WARP, "FILE[,FILE]", NULL, NULL,
      "what lies on or in the template and is to be carried along: landmarks (.mrk.json, .fcsv, "
      ".csv) and meshes of triangles or tetrahedra (.vtk), which keep their labels and other data",
      NULL },
    { "sd", 0, CLI_SD, CLI_GROUP_INPUT, CLI_EXPORT, "X[,X]", NULL, NULL,
      "how far along a mode its meshes lie, in standard deviations to both sides (default 2)",
      NULL },
    { "what", 0, CLI_WHAT, CLI_GROUP_INPUT, CLI_RENDER, "WORD", NULL, NULL,
      "draw one picture only: mean, modes, shape or cohort (default: all four)", NULL },
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
      "side of the shapes: auto (find out), same (as the model) or other (mirror them) (default "
      "auto)",
      NULL },
    { "extent", 0, CLI_EXTENT, CLI_GROUP_INPUT, CLI_FIT, "WORD", NULL, NULL,
      "auto (surfaces with openings, or cut off by the image, are parts), whole or part (default "
      "auto)",
      NULL },
    { "formula", 0, CLI_FORMULA, CLI_GROUP_INPUT, CLI_TEST | CLI_NORM, "TEXT", NULL, NULL,
      "what the shapes depend on, \"~ group + age + group:age\": columns of the table or of the "
      "project, or centroid_size",
      NULL },
    { "of", 0, CLI_OF, CLI_GROUP_INPUT, TESTS | CLI_PREDICT, "TERM", NULL, NULL,
      "the term to test, with the others allowed for (default: the first)", NULL },
    { "at", 0, CLI_AT, CLI_GROUP_INPUT, CLI_PREDICT, "X,Y", NULL, NULL,
      "values of the column; for each the expected shape is written as a mesh", NULL },
    { "subjects", 0, CLI_SUBJECTS, CLI_GROUP_INPUT, STATISTICS, "FILE", NULL, NULL,
      "table of the subjects (.csv, .tsv): a header, then one line per shape, starting with its "
      "name",
      NULL },
    { "on", 0, CLI_ON, CLI_GROUP_INPUT, TESTS, "WORD", NULL, NULL,
      "form (shape and size), shape (size removed), size, modes, or a column of numbers such as a "
      "measurement (default form)",
      NULL },
    { "within", 0, CLI_WITHIN, CLI_GROUP_INPUT, TESTS, "COLUMN", NULL, NULL,
      "column that says who was measured repeatedly: compares only within each of its levels",
      NULL },
    { "variances", 0, CLI_VARIANCES, CLI_GROUP_INPUT, CLI_TEST, "WORD", NULL, NULL,
      "equal (subjects may change places) or unequal (one group may vary more than another; errors "
      "are taken to be symmetric and their signs are drawn) (default equal)",
      NULL },
    { "permutations", 0, CLI_PERMUTATIONS, CLI_GROUP_RUN, TESTS, "N", NULL, NULL,
      "how many reorderings of the subjects to try; all of them if there are not more (default "
      "10000)",
      NULL },
    { "bootstraps", 0, CLI_BOOTSTRAPS, CLI_GROUP_RUN, TESTS, "N", NULL, NULL,
      "draws for the 95 % bands of effects; 0 for no bands (default 1000)", NULL },
    { "stop-risk", 0, CLI_STOP_RISK, CLI_GROUP_RUN, TESTS, "X", NULL, NULL,
      "stop early once it is known which p and q are below 5 %, accepting at most this probability "
      "that more reorderings would have said otherwise, such as 0.001 (default 0: try all)",
      NULL },
    { "landmarks", 0, CLI_LANDMARKS, CLI_GROUP_INPUT, CLI_FIT | GROOMS | CLI_CHECK, "PATH",
      "landmarks", NULL,
      "landmarks of the shapes: a folder with NAME.mrk.json, NAME.fcsv or NAME.csv (name,x,y,z) "
      "for each, or one .csv for all (shape,name,x,y,z); --landmarks-use says what they are for",
      NULL },
    { "features", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "LIST", "features", NULL,
      "what must correspond besides form: fields of the vertices (.ply, .vtk, .vtp), images that a "
      "project names (image_NAME), and normals, each with a weight: thickness:1,normals:0.5; with "
      "weight 0 a field is only sampled at the particles",
      NULL },
    { "aligned", 0, CLI_FLAG_ALIGNED, CLI_GROUP_INPUT, CLI_FIT | CLI_LANDMARKS_VERB, NULL, NULL,
      NULL, "the shapes are already in the world frame of the model: do not search for their pose",
      NULL },
    { "force", 0, CLI_FLAG_FORCE, CLI_GROUP_INPUT, CLI_FIT, NULL, NULL, NULL,
      "also fit shapes that would be refused", NULL },
    { "label", 0, CLI_SETS, CLI_GROUP_INPUT, READS | CLI_ADD, "L[,L]", "labels", NULL,
      "labels of a segmentation that make up the shape, by number or name, or 'all'; needed if "
      "there are several. '>0.5' or '<0': the shape is where the values of the image are so",
      NULL },
    { "reflect-match", 0, CLI_SETS, CLI_GROUP_INPUT, READS | CLI_ADD, "REGEX", "reflect_match",
      NULL, "mirror the inputs whose file names match (the left sides, say)", NULL },
    { "parts", 0, CLI_PARTS, CLI_GROUP_INPUT, CLI_RUN | CLI_FIT, "LIST", NULL, NULL,
      "several parts per subject in one model: tibia=REGEX,talus=REGEX (what the file names of a "
      "part contain; the rest of the name is the subject) or tibia=1,talus=2+3 (labels)",
      NULL },
    { "shared-boundary", 0, CLI_SHARED, CLI_GROUP_INPUT, CLI_RUN, "A,B", NULL, NULL,
      "with --parts: what two touching parts share becomes a part of its own, A-B, and they keep "
      "the rest; A,B,T: where they are closer than T spacings (default 0.1)",
      NULL },
    { "align-parts", 0, CLI_ALIGN_PARTS, CLI_GROUP_INPUT, CLI_RUN, "WORD", NULL, NULL,
      "with --parts: global (all parts move together), apart (each by itself), or the name of the "
      "part by which the others are aligned (default global)",
      NULL },
    { "exclude", 0, CLI_SETS, CLI_GROUP_INPUT, READS | CLI_ADD, "REGEX", "exclude", NULL,
      "leave out the inputs whose file names match", NULL },
    { "pattern", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "GLOB", "pattern", NULL,
      "search all folders below and take only the shapes whose paths match: '**/liver.nii.gz', "
      "'sub-*/anat/*_dseg.nii.gz'; ** stands for any number of folders",
      NULL },
    { "fixed", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "NAMES", "fixed", NULL,
      "of a project: shapes whose particles stay as they are while the others are optimised "
      "against them (names with commas, or all that the project gives particles of), in addition "
      "to those of its column fixed",
      NULL },
    { "ignore", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "LIST", "ignore", NULL,
      "go on without something that a project asks for and apsm does not do: constraints, "
      "landmarks, normals, fields, geodesics, fixed, domains, reflect, shared",
      NULL },
    { "domain", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "NAME", "domain", NULL,
      "of a project with several domains (shape_NAME, ...), the one to model alone; without it "
      "they become one model, as with --parts",
      NULL },
    { "constraints", 0, CLI_SETS, CLI_GROUP_INPUT, GROOMS | CLI_CHECK, "PATH", "constraints", NULL,
      "model only a part of the surface: a folder with NAME.json for each shape, or one file, for "
      "the shape of its name or the one that --template names; shapes without a file get the "
      "region by registration",
      NULL },
    { "template", 0, CLI_SETS, CLI_GROUP_INPUT,
      GROOMS | CLI_CHECK | CLI_EVALUATE | CLI_CERTIFY | CLI_IMPORT, "NAME", "template", NULL,
      "the shape that neighbours and meshes are taken from; auto: the one that suits the others "
      "best (default auto)",
      NULL },
    { "unit", 0, CLI_SETS, CLI_GROUP_INPUT, STEPS | CLI_IMPORT, "WORD", "unit", NULL,
      "unit of length for the report and scale bars: mm, cm, m (default: mm for images, unknown "
      "for meshes)",
      NULL },
    { "preset", 0, CLI_SETS, CLI_GROUP_MODEL, STEPS, "NAME", "preset", NULL,
      "a named set of options: default, paper-literal-femur, paper-literal-liver or "
      "paper-literal-hip; other options override it",
      NULL },
    { "config", 0, CLI_CONFIG, CLI_GROUP_MODEL, STEPS, "FILE", NULL, NULL,
      "options from a JSON file, {\"particles\": 256, ...}, or from the manifest.json of an "
      "earlier run",
      NULL },
    { "set", 0, CLI_SET_PAIR, CLI_GROUP_MODEL, STEPS, "KEY=VALUE", NULL, NULL,
      "any option of the method (see --help-all)", NULL },
    { "seed", 0, CLI_SETS, CLI_GROUP_RUN, STEPS | TESTS | CLI_NORM | CLI_PREDICT, "N", "seed", NULL,
      "seed of all random numbers (default 0); the result depends on it, but not on the number of "
      "threads",
      NULL },
    { "threads", 0, CLI_THREADS, CLI_GROUP_RUN,
      STEPS | CLI_CHECK | CLI_REPORT | CLI_RENDER | CLI_VERIFY | CLI_IMPORT | CLI_WARP | CLI_FIT |
          CLI_EXPORT | CLI_EXCLUDE | CLI_ADD | STATISTICS | CLI_COMPARE,
      "N", NULL, NULL, "number of threads (default: one per processor)", NULL },
    { "memory", 0, CLI_MEMORY, CLI_GROUP_RUN, STEPS, "LIMIT", NULL, NULL,
      "keep to about this much memory (2G, 500M); shapes wait in a file in state/, removed "
      "afterwards. Changes the time, never the result (default: no limit)",
      NULL },
    { "shard", 0, CLI_SHARD, CLI_GROUP_RUN,
      CLI_RUN | CLI_GROOM | CLI_INITIALIZE | CLI_EVALUATE | CLI_FIT, "K/N", NULL, NULL,
      "do only every N-th shape, from the K-th on, keep the results in state/, and stop: for job "
      "arrays on machines that share the folder. Afterwards the same command without --shard "
      "gathers them; the result is the same. run shares the grooming of joints alone: of one "
      "part share groom, initialize and evaluate",
      NULL },
    { "resume", 0, CLI_FLAG_RESUME, CLI_GROUP_RUN, STEPS, NULL, NULL, NULL,
      "continue an unfinished run in the model folder", NULL },
    { "overwrite", 0, CLI_FLAG_OVERWRITE, CLI_GROUP_RUN,
      GROOMS | CLI_FIT | CLI_EXPORT | CLI_WARP | CLI_COMPARE | CLI_CONVERT | CLI_RENDER |
          CLI_CERTIFY,
      NULL, NULL, NULL, "replace what is already there", NULL },
    { "dry-run", 0, CLI_FLAG_DRY_RUN, CLI_GROUP_RUN, GROOMS, NULL, NULL, NULL,
      "say what would be done, and write nothing", NULL },
    { "progress", 0, CLI_PROGRESS, CLI_GROUP_RUN, ALL, "MODE", NULL, NULL,
      "auto (a bar on a terminal, lines elsewhere), plain or json (default auto)", NULL },
    { "quiet", 'q', CLI_FLAG_QUIET, CLI_GROUP_RUN, ALL, NULL, NULL, NULL,
      "print only warnings, errors and what was asked for", NULL },
    { "help", 'h', CLI_FLAG_HELP, CLI_GROUP_RUN, ALL, NULL, NULL, NULL, "this text", NULL },
    { "help-all", 0, CLI_FLAG_HELP_ALL, CLI_GROUP_RUN, ALL, NULL, NULL, NULL,
      "this text with all options of the method", NULL },
    { "xml", 0, CLI_FLAG_XML, CLI_GROUP_RUN, ALL, NULL, NULL, NULL,
      "describe the verb as a module of 3D Slicer (Slicer Execution Model)", NULL },
    { "version", 'V', CLI_FLAG_VERSION, CLI_GROUP_RUN, ALL, NULL, NULL, NULL, "print the version",
      NULL },
};
enum { OWN = sizeof own / sizeof *own };

/* What an option means to some of its verbs, where that is not what its row says. */
static const struct {
    const char *name;
    unsigned verbs;
    const char *doc;
} wordings[] = {
    { "out", STATISTICS, "folder for the results (default: statistics/ in the model folder)" },
    { "out", CLI_FIT | CLI_LANDMARKS_VERB | CLI_WARP,
      "folder for the results; made if it does not exist" },
    { "out", CLI_EXPORT | CLI_CONVERT, "the file or folder to write" },
    { "out", CLI_RENDER,
      "folder for the pictures (default: pictures/ in the model folder), or with --what the file" },
    { "out", CLI_CERTIFY, "file to write (.json); without it the verdict is only printed" },
    { "out", CLI_COMPARE,
      "folder for tables and the mesh of differences; without it figures are only printed" },
    { "to", CLI_CONVERT,
      "write a folder with one file NAME.EXT per shape: particles, lpts, wpts, csv, npy, mrk.json, "
      "vtk or vtp" },
    { "to", CLI_EXPORT,
      "format: vtp, ply, stl, obj, monai, slicermorph or csv (a folder), gltf, npz, scalismo or "
      "statismo (a file)" },
    { "of", CLI_PREDICT, "the column to predict" },
    { "of", CLI_ASYMMETRY, "the column that says the side" },
    { "within", CLI_ASYMMETRY, "the column that says the subject" },
    { "landmarks", CLI_FIT,
      "named points on the mean shape (meshes/mean.ply). Inputs that are files of points "
      "(.mrk.json, .fcsv, .csv) are then landmarks of these names; without it they are clouds of "
      "points" },
    { "aligned", CLI_LANDMARKS_VERB,
      "the points were placed on the mean shape (meshes/mean.ply), and all results are in the "
      "world frame" },
    { "template", CLI_EVALUATE | CLI_CERTIFY,
      "of files and projects: the shape to warp to the others; auto: the one that suits them best "
      "(default auto)" },
};

const char *cli_option_doc(const cli_option *o, cli_verb verb)
{
    for (size_t k = 0; k < sizeof wordings / sizeof *wordings; k++)
        if (wordings[k].verbs & (unsigned)verb && strcmp(wordings[k].name, o->name) == 0)
            return wordings[k].doc;
    return o->doc;
}

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
