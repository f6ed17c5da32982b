/* INPUT arguments to cases.  The order of cases is that of their names, so that a folder, its
 * files one by one, and any order of these on the command line are the same study. */
#include "input/input.h"

#include <errno.h>
#include <fcntl.h>
#include <regex.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "files/files.h"
#include "formats/image.h"
#include "formats/mesh_io.h"
#include "formats/vtk_image.h"
#include "input/foreign.h"
#include "input/names.h"
#include "input/picture.h"
#include "input/search.h"

/* An expression and how often it matched. */
typedef struct pattern {
    const char *option, *text;
    bool used; /* text is not empty, and compiled to regex */
    regex_t regex;
    size_t matches;
} pattern;

typedef struct expansion {
    apsm_context *ctx;
    apsm_input_list *list;
    const apsm_input_choice *choice;
    pattern exclude, reflect;
    search found; /* in folders */
} expansion;

bool apsm_input_kind_of(const char *path, apsm_input_kind *kind)
{
    const bool mesh = mesh_is_known(path) && !vtk_is_image(path), volume = volume_is_known(path);
    if (mesh || volume) *kind = mesh ? APSM_INPUT_MESH : APSM_INPUT_VOLUME;
    return mesh || volume;
}

void apsm_input_list_free(apsm_input_list *list)
{
    for (size_t i = 0; i < list->n; i++) {
        free(list->cases[i].name);
        free(list->cases[i].path);
    }
    free(list->cases);
    *list = (apsm_input_list){ 0 };
}

static apsm_status compile(apsm_context *ctx, pattern *p)
{
    if (!p->text || !*p->text) return APSM_OK;
    const int error = regcomp(&p->regex, p->text, REG_EXTENDED | REG_NOSUB);
    p->used = error == 0;
    if (p->used) return APSM_OK;
    char why[160];
    regerror(error, &p->regex, why, sizeof why);
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "%s '%s': %s; give a POSIX extended regular expression such as '_L_'",
                     p->option, p->text, why);
}

static bool matches(pattern *p, const char *file)
{
    if (!p->used || regexec(&p->regex, file, 0, NULL, 0) != 0) return false;
    p->matches++;
    return true;
}

static const char *last_component(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static apsm_status out_of_memory(apsm_context *ctx)
{
    return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory while listing the inputs");
}

/* Appends a case unless it is excluded.  within: its path below the folder that was given, else its
 * file's name; name: NULL, or what it is called. */
static apsm_status add_case(expansion *e, const char *path, const char *within,
                            apsm_input_kind kind, const char *name)
{
    apsm_input_list *const list = e->list;
    if (matches(&e->exclude, within)) {
        list->excluded++;
        return APSM_OK;
    }
    apsm_input_case *const cases = realloc(list->cases, (list->n + 1) * sizeof *cases);
    if (!cases) return out_of_memory(e->ctx);
    list->cases = cases;
    apsm_input_case one = { .name = name ? strdup(name) : NULL,
                            .path = strdup(path),
                            .kind = kind,
                            .reflect = matches(&e->reflect, within) };
    list->cases[list->n++] = one;
    return one.path && (one.name || !name) ? APSM_OK : out_of_memory(e->ctx);
}

/* ---- folders and files ---- */

static apsm_status refuse_empty(const expansion *e, const char *folder, size_t unmatched,
                                bool results)
{
    if (unmatched > 0)
        return apsm_fail(e->ctx, APSM_ERR_ARG,
                         "%s: --pattern '%s' means none of the %zu shapes in this folder; try "
                         "'**/*.nii.gz' or '*/NAME.ply'",
                         folder, e->choice->pattern, unmatched);
    if (results)
        return apsm_fail(e->ctx, APSM_ERR_IO,
                         "%s: holds a model or fits of apsm and no other shapes, and results are "
                         "not taken for inputs; give the folder of the shapes, or name that of "
                         "the meshes that are meant (%s/groomed)",
                         folder, folder);
    return apsm_fail(
        e->ctx, APSM_ERR_IO,
        "%s: no shapes in this folder or below; it needs files ending in .ply, .stl, "
        ".obj, .vtk, .vtp, .off, .gii, .nrrd, .nii, .nii.gz, .mha, .mhd, .mgz or .tif, or a DICOM "
        "series",
        folder);
}

/* Whether one of the hits is no flat picture. */
static bool any_shape(const search *s, size_t first)
{
    for (size_t k = first; k < s->n; k++)
        if (!picture_is_one(s->hit[k].path)) return true;
    return false;
}

static apsm_status add_folder(expansion *e, const char *folder, const char *name)
{
    search *const s = &e->found;
    const size_t first = s->n, unmatched = s->unmatched, results = s->results;
    APSM_TRY(name ? search_series(e->ctx, folder, s)
                  : search_folder(e->ctx, folder, e->choice->pattern, s));
    if (s->n == first)
        return refuse_empty(e, folder, s->unmatched - unmatched, s->results > results);
    const bool any = any_shape(s, first);
    for (size_t k = first; k < s->n; k++) {
        const search_hit *hit = &s->hit[k];
        const char *within = hit->within ? hit->path + hit->within : last_component(hit->path);
        if (any && picture_is_one(hit->path)) {
            apsm_log(e->ctx, APSM_LOG_WARNING,
                     "%s: a flat picture beside shapes; left out (slices of a stack have to be one "
                     "file)",
                     hit->path);
            e->list->skipped++;
            continue;
        }
        APSM_TRY(add_case(e, hit->path, within, hit->kind, name));
    }
    return APSM_OK;
}

static apsm_status add_file(expansion *e, const char *path, const char *name)
{
    apsm_input_kind kind;
    struct stat info;
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return apsm_fail(e->ctx, APSM_ERR_IO, "%s: %s; check the name and your right to read it",
                         path, strerror(errno));
    const bool is_file = fstat(fd, &info) == 0 && S_ISREG(info.st_mode);
    close(fd);
    if (!is_file)
        return apsm_fail(e->ctx, APSM_ERR_IO, "%s: neither a file nor a folder; give one of them",
                         path);
    if (!apsm_input_kind_of(path, &kind)) {
        if (!search_is_dicom(path))
            return apsm_fail(e->ctx, APSM_ERR_UNSUPPORTED, "%s: %s", path, foreign_remedy(path));
        kind = APSM_INPUT_DICOM;
    }
    return add_case(e, path, last_component(path), kind, name);
}

static int by_name(const void *a, const void *b)
{
    return strcmp(((const apsm_input_case *)a)->name, ((const apsm_input_case *)b)->name);
}

/* ---- files that hold no shape ---- */

static int by_text(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* mark[k] <- 1 for the files that hold the voxels of a header. */
static apsm_status mark_data_files(const expansion *e, char *mark)
{
    const search *s = &e->found;
    for (size_t i = 0; s->others > 0 && i < e->list->n; i++) {
        apsm_file_list data;
        APSM_TRY(apsm_input_data_files(e->list->cases[i].path, &data));
        for (size_t k = 0; k < data.n; k++) {
            char **known = bsearch(&data.path[k], s->other, s->others, sizeof *s->other, by_text);
            if (known) mark[known - s->other] = 1;
        }
        apsm_file_list_free(&data);
    }
    return APSM_OK;
}

/* The voxels of headers of their own are files that do hold a shape. */
static apsm_status forget_data_files(expansion *e)
{
    search *s = &e->found;
    char *mark = calloc(s->others + 1, 1);
    if (!mark) return out_of_memory(e->ctx);
    if (s->others > 0) qsort(s->other, s->others, sizeof *s->other, by_text);
    const apsm_status status = mark_data_files(e, mark);
    size_t n = 0;
    for (size_t k = 0; k < s->others; k++)
        if (mark[k])
            free(s->other[k]);
        else
            s->other[n++] = s->other[k];
    s->others = n;
    free(mark);
    return status;
}

static apsm_status tell_others(expansion *e)
{
    enum { NAMED = 3 };
    char names[NAMED * 80] = "";
    const search *s = &e->found;
    APSM_TRY(forget_data_files(e));
    e->list->skipped += s->others + s->slices;
    for (size_t k = 0; k < s->others && k < NAMED; k++)
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s%.70s", k ? ", " : ": ",
                 last_component(s->other[k]));
    if (e->list->skipped > 0)
        apsm_log(e->ctx, APSM_LOG_INFO, "%zu file%s skipped that hold%s no shape%s%s",
                 e->list->skipped, e->list->skipped == 1 ? "" : "s",
                 e->list->skipped == 1 ? "s" : "", names, e->list->skipped > NAMED ? ", ..." : "");
    if (s->unmatched > 0)
        apsm_log(e->ctx, APSM_LOG_INFO, "%zu shape%s not meant by --pattern '%s'", s->unmatched,
                 s->unmatched == 1 ? " is" : "s are", e->choice->pattern);
    return APSM_OK;
}

/* ---- names ---- */

static bool is_control(char c)
{
    return (unsigned char)c < 32 || c == 127;
}

/* Of a case: files of the model are called by it, with endings and for a moment with more. */
static apsm_status check_name(apsm_context *ctx, const apsm_input_case *one)
{
    enum { MOST = 200 };
    const char *wrong = NULL;
    if (!apsm_is_utf8(one->path)) wrong = "its path is not UTF-8";
    if (!apsm_is_utf8(one->name)) wrong = "its name is not UTF-8";
    if (strlen(one->name) > MOST) wrong = "its name is longer than 200 bytes";
    for (const char *c = one->name; *c; c++)
        if (is_control(*c)) wrong = "its name has a control character";
    if (!wrong) return APSM_OK;
    char *const path = strdup(one->path); /* an error is one line */
    for (char *c = path; c && *c; c++)
        if (is_control(*c)) *c = '?';
    const apsm_status status =
        apsm_fail(ctx, APSM_ERR_ARG, "%s: %s; rename it", path ? path : "", wrong);
    free(path);
    return status;
}

apsm_status apsm_input_check_stored(apsm_context *ctx, const char *folder,
                                    const apsm_input_list *list)
{
    for (size_t i = 0; i < list->n; i++) {
        char *const stored = apsm_path_relative(folder, list->cases[i].path);
        const bool good = stored && apsm_is_utf8(stored), missing = !stored;
        free(stored);
        if (missing) return out_of_memory(ctx);
        if (!good)
            return apsm_fail(ctx, APSM_ERR_ARG,
                             "%s: a folder on its way from %s has a name that is not UTF-8; rename "
                             "it",
                             list->cases[i].path, folder);
    }
    return APSM_OK;
}

static int by_name_in_any_case(const void *a, const void *b)
{
    return strcasecmp((*(const apsm_input_case *const *)a)->name,
                      (*(const apsm_input_case *const *)b)->name);
}

/* Names that only capitals tell apart are files of one name on other systems. */
static apsm_status tell_capitals(const expansion *e)
{
    const apsm_input_list *const list = e->list;
    const apsm_input_case **const sorted = malloc((list->n + 1) * sizeof *sorted);
    if (!sorted) return out_of_memory(e->ctx);
    for (size_t i = 0; i < list->n; i++) sorted[i] = &list->cases[i];
    qsort(sorted, list->n, sizeof *sorted, by_name_in_any_case);
    for (size_t i = 1; i < list->n; i++)
        if (strcasecmp(sorted[i - 1]->name, sorted[i]->name) == 0)
            apsm_log(e->ctx, APSM_LOG_WARNING,
                     "'%s' and '%s' differ in capitals alone: on a disk of Windows or macOS the "
                     "files of one would take the place of the other's; rename one",
                     sorted[i - 1]->name, sorted[i]->name);
    free(sorted);
    return APSM_OK;
}

static apsm_status check_names(expansion *e)
{
    const apsm_input_list *const list = e->list;
    APSM_TRY(input_names(e->ctx, e->list));
    qsort(list->cases, list->n, sizeof *list->cases, by_name);
    for (size_t i = 0; i < list->n; i++) APSM_TRY(check_name(e->ctx, &list->cases[i]));
    for (size_t i = 1; i < list->n; i++)
        if (strcmp(list->cases[i - 1].name, list->cases[i].name) == 0)
            return apsm_fail(e->ctx, APSM_ERR_ARG,
                             "%s and %s are both case '%s'; rename one, or leave it out by "
                             "--exclude",
                             list->cases[i - 1].path, list->cases[i].path, list->cases[i].name);
    return tell_capitals(e);
}

static void warn_unmatched(expansion *e, const pattern *p)
{
    if (p->used && p->matches == 0)
        apsm_log(e->ctx, APSM_LOG_WARNING, "%s '%s' matches none of the input files", p->option,
                 p->text);
}

static apsm_status expand(expansion *e)
{
    APSM_TRY(compile(e->ctx, &e->exclude));
    APSM_TRY(compile(e->ctx, &e->reflect));
    const apsm_input_choice *c = e->choice;
    if (c->n == 0) return apsm_fail(e->ctx, APSM_ERR_ARG, "no inputs; give files or folders");
    for (size_t i = 0; i < c->n; i++) {
        const char *name = c->names ? c->names[i] : NULL;
        APSM_TRY(apsm_is_folder(c->inputs[i]) ? add_folder(e, c->inputs[i], name)
                                              : add_file(e, c->inputs[i], name));
    }
    if (e->list->n == 0)
        return apsm_fail(e->ctx, APSM_ERR_ARG,
                         "--exclude '%s' leaves none of the %zu input files; make it narrower",
                         e->exclude.text, e->list->excluded);
    APSM_TRY(check_names(e));
    warn_unmatched(e, &e->exclude);
    warn_unmatched(e, &e->reflect);
    return tell_others(e);
}

apsm_status apsm_input_choose(apsm_context *ctx, const apsm_input_choice *choice,
                              apsm_input_list *list)
{
    *list = (apsm_input_list){ 0 };
    expansion e = { .ctx = ctx,
                    .list = list,
                    .choice = choice,
                    .exclude = { .option = "--exclude", .text = choice->exclude },
                    .reflect = { .option = "--reflect-match", .text = choice->reflect_match } };
    const apsm_status status = expand(&e);
    search_free(&e.found);
    if (e.exclude.used) regfree(&e.exclude.regex);
    if (e.reflect.used) regfree(&e.reflect.regex);
    if (status != APSM_OK) apsm_input_list_free(list);
    return status;
}

apsm_status apsm_input_expand(apsm_context *ctx, size_t n, const char *const *inputs,
                              const char *exclude, const char *reflect_match, apsm_input_list *list)
{
    const apsm_input_choice choice = {
        .n = n, .inputs = inputs, .exclude = exclude, .reflect_match = reflect_match
    };
    return apsm_input_choose(ctx, &choice, list);
}
