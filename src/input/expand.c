/* INPUT arguments to cases.  The order of cases is that of their names, so that a folder, its
 * files one by one, and any order of these on the command line are the same study. */
#include "apsm/input.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <regex.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "apsm/files.h"

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
    pattern exclude, reflect;
    size_t others; /* files in folders that hold no shape, as far as is known */
    char **other;  /* their paths */
} expansion;

bool apsm_input_kind_of(const char *path, apsm_input_kind *kind)
{
    static const struct {
        const char *extension;
        apsm_input_kind kind;
    } known[] = { { ".ply", APSM_INPUT_MESH },    { ".stl", APSM_INPUT_MESH },
                  { ".obj", APSM_INPUT_MESH },    { ".vtk", APSM_INPUT_MESH },
                  { ".vtp", APSM_INPUT_MESH },    { ".nrrd", APSM_INPUT_VOLUME },
                  { ".nhdr", APSM_INPUT_VOLUME }, { ".nii", APSM_INPUT_VOLUME },
                  { ".hdr", APSM_INPUT_VOLUME },  { ".nii.gz", APSM_INPUT_VOLUME },
                  { ".mha", APSM_INPUT_VOLUME },  { ".mhd", APSM_INPUT_VOLUME } };
    const size_t length = strlen(path);
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        const size_t end = strlen(known[k].extension);
        if (length > end && strcasecmp(path + length - end, known[k].extension) == 0) {
            *kind = known[k].kind;
            return true;
        }
    }
    return false;
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

/* Appends a case unless it is excluded. */
static apsm_status add_case(expansion *e, const char *path, apsm_input_kind kind)
{
    const char *const file = last_component(path);
    apsm_input_list *const list = e->list;
    if (matches(&e->exclude, file)) {
        list->excluded++;
        return APSM_OK;
    }
    apsm_input_case *const cases = realloc(list->cases, (list->n + 1) * sizeof *cases);
    if (!cases) return out_of_memory(e->ctx);
    list->cases = cases;
    apsm_input_case one = { .name = kind == APSM_INPUT_DICOM ? strdup(file) : apsm_path_stem(path),
                            .path = strdup(path),
                            .kind = kind,
                            .reflect = matches(&e->reflect, file) };
    list->cases[list->n++] = one;
    return one.name && one.path ? APSM_OK : out_of_memory(e->ctx);
}

/* DICOM files have no agreed extension, but "DICM" after 128 bytes. */
static bool is_dicom_file(const char *path)
{
    char head[132];
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0) return false;
    const ssize_t n = read(fd, head, sizeof head);
    close(fd);
    return n == (ssize_t)sizeof head && memcmp(head + 128, "DICM", 4) == 0;
}

typedef enum entry_type { ENTRY_OTHER, ENTRY_SHAPE, ENTRY_FOLDER, ENTRY_DICOM } entry_type;

static entry_type type_of(const char *path, apsm_input_kind *kind)
{
    if (apsm_is_folder(path)) return ENTRY_FOLDER;
    if (apsm_input_kind_of(path, kind)) return ENTRY_SHAPE;
    return is_dicom_file(path) ? ENTRY_DICOM : ENTRY_OTHER;
}

/* Calls visit(e, path, user) for each entry that is not hidden. */
typedef apsm_status (*visit_fn)(expansion *e, const char *path, void *user);
static apsm_status for_each_entry(expansion *e, const char *folder, visit_fn visit, void *user)
{
    DIR *const dir = opendir(folder);
    if (!dir)
        return apsm_fail(e->ctx, APSM_ERR_IO, "%s: %s; check your right to read the folder", folder,
                         strerror(errno));
    apsm_status status = APSM_OK;
    for (const struct dirent *entry; status == APSM_OK && (entry = readdir(dir));) {
        if (entry->d_name[0] == '.') continue;
        char *const path = apsm_path_join(folder, entry->d_name);
        status = path ? visit(e, path, user) : out_of_memory(e->ctx);
        free(path);
    }
    closedir(dir);
    return status;
}

static apsm_status count_dicom(expansion *e, const char *path, void *user)
{
    (void)e;
    apsm_input_kind kind;
    size_t *const count = user;
    *count += type_of(path, &kind) == ENTRY_DICOM;
    return APSM_OK;
}

/* What a folder holds, beside the cases of its shape files. */
typedef struct folder_content {
    size_t shapes, dicom;
} folder_content;

static apsm_status add_other(expansion *e, const char *path)
{
    char **const more = realloc(e->other, (e->others + 1) * sizeof *more);
    if (!more) return out_of_memory(e->ctx);
    e->other = more;
    e->other[e->others] = strdup(path);
    return e->other[e->others++] ? APSM_OK : out_of_memory(e->ctx);
}

static apsm_status visit_shape(expansion *e, const char *path, void *user)
{
    folder_content *const content = user;
    apsm_input_kind kind;
    switch (type_of(path, &kind)) {
    case ENTRY_SHAPE:
        content->shapes++;
        return add_case(e, path, kind);
    case ENTRY_DICOM:
        content->dicom++;
        return APSM_OK;
    case ENTRY_OTHER:
        return add_other(e, path);
    default:
        return APSM_OK;
    }
}

static apsm_status visit_subfolder(expansion *e, const char *path, void *user)
{
    folder_content *const content = user;
    size_t dicom = 0;
    if (!apsm_is_folder(path)) return APSM_OK;
    APSM_TRY(for_each_entry(e, path, count_dicom, &dicom));
    if (dicom == 0) return APSM_OK;
    content->shapes++;
    return add_case(e, path, APSM_INPUT_DICOM);
}

static apsm_status add_folder(expansion *e, const char *folder)
{
    folder_content content = { 0 };
    char *const path = strdup(folder);
    if (!path) return out_of_memory(e->ctx);
    for (size_t end = strlen(path); end > 1 && path[end - 1] == '/';) path[--end] = '\0';
    apsm_status status = for_each_entry(e, path, visit_shape, &content);
    if (status == APSM_OK && content.shapes == 0 && content.dicom > 0) {
        content.shapes = 1;
        content.dicom = 0;
        status = add_case(e, path, APSM_INPUT_DICOM);
    } else if (status == APSM_OK && content.shapes == 0) {
        status = for_each_entry(e, path, visit_subfolder, &content);
    }
    free(path);
    e->list->skipped += content.dicom;
    if (status == APSM_OK && content.shapes == 0)
        return apsm_fail(e->ctx, APSM_ERR_IO,
                         "%s: no shapes in this folder; it needs files ending in .ply, .stl, .obj, "
                         ".vtk, .vtp, .nrrd, .nii, .nii.gz, .mha or .mhd, or a DICOM series",
                         folder);
    return status;
}

static apsm_status add_file(expansion *e, const char *path)
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
    if (!apsm_input_kind_of(path, &kind))
        return apsm_fail(e->ctx, APSM_ERR_UNSUPPORTED,
                         "%s: not a shape format; use .ply, .stl, .obj, .vtk, .vtp, .nrrd, .nii, "
                         ".nii.gz, .mha or .mhd",
                         path);
    return add_case(e, path, kind);
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

/* The voxels of headers of their own are files that do hold a shape. */
static apsm_status forget_data_files(expansion *e)
{
    for (size_t i = 0; e->others > 0 && i < e->list->n; i++) {
        char *data;
        APSM_TRY(apsm_input_data_file(e->list->cases[i].path, &data));
        for (size_t k = e->others; data && k-- > 0;)
            if (strcmp(e->other[k], data) == 0) {
                free(e->other[k]);
                e->other[k] = e->other[--e->others];
            }
        free(data);
    }
    return APSM_OK;
}

static apsm_status tell_others(expansion *e)
{
    enum { NAMED = 3 };
    char names[NAMED * 80] = "";
    APSM_TRY(forget_data_files(e));
    e->list->skipped += e->others;
    if (e->list->skipped == 0) return APSM_OK;
    if (e->others > 0) qsort(e->other, e->others, sizeof *e->other, by_text);
    for (size_t k = 0; k < e->others && k < NAMED; k++)
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s%.70s", k ? ", " : ": ",
                 last_component(e->other[k]));
    apsm_log(e->ctx, APSM_LOG_INFO, "%zu file%s skipped that hold%s no shape%s%s", e->list->skipped,
             e->list->skipped == 1 ? "" : "s", e->list->skipped == 1 ? "s" : "", names,
             e->list->skipped > NAMED ? ", ..." : "");
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
    json_t *const text = json_string(one->name); /* NULL: not UTF-8 */
    if (!text) wrong = "its name is not UTF-8";
    json_decref(text);
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

static apsm_status check_names(expansion *e)
{
    const apsm_input_list *const list = e->list;
    qsort(list->cases, list->n, sizeof *list->cases, by_name);
    for (size_t i = 0; i < list->n; i++) APSM_TRY(check_name(e->ctx, &list->cases[i]));
    for (size_t i = 1; i < list->n; i++)
        if (strcmp(list->cases[i - 1].name, list->cases[i].name) == 0)
            return apsm_fail(e->ctx, APSM_ERR_ARG,
                             "%s and %s are both case '%s'; rename one, or leave it out by "
                             "--exclude",
                             list->cases[i - 1].path, list->cases[i].path, list->cases[i].name);
    return APSM_OK;
}

static void warn_unmatched(expansion *e, const pattern *p)
{
    if (p->used && p->matches == 0)
        apsm_log(e->ctx, APSM_LOG_WARNING, "%s '%s' matches none of the input files", p->option,
                 p->text);
}

static apsm_status expand(expansion *e, size_t n, const char *const *inputs)
{
    APSM_TRY(compile(e->ctx, &e->exclude));
    APSM_TRY(compile(e->ctx, &e->reflect));
    if (n == 0) return apsm_fail(e->ctx, APSM_ERR_ARG, "no inputs; give files or folders");
    for (size_t i = 0; i < n; i++)
        APSM_TRY(apsm_is_folder(inputs[i]) ? add_folder(e, inputs[i]) : add_file(e, inputs[i]));
    if (e->list->n == 0)
        return apsm_fail(e->ctx, APSM_ERR_ARG,
                         "--exclude '%s' leaves none of the %zu input files; make it narrower",
                         e->exclude.text, e->list->excluded);
    APSM_TRY(check_names(e));
    warn_unmatched(e, &e->exclude);
    warn_unmatched(e, &e->reflect);
    return tell_others(e);
}

apsm_status apsm_input_expand(apsm_context *ctx, size_t n, const char *const *inputs,
                              const char *exclude, const char *reflect_match, apsm_input_list *list)
{
    *list = (apsm_input_list){ 0 };
    expansion e = { .ctx = ctx,
                    .list = list,
                    .exclude = { .option = "--exclude", .text = exclude },
                    .reflect = { .option = "--reflect-match", .text = reflect_match } };
    const apsm_status status = expand(&e, n, inputs);
    for (size_t k = 0; k < e.others; k++) free(e.other[k]);
    free(e.other);
    if (e.exclude.used) regfree(&e.exclude.regex);
    if (e.reflect.used) regfree(&e.reflect.regex);
    if (status != APSM_OK) apsm_input_list_free(list);
    return status;
}
