#define _DEFAULT_SOURCE /* strcasecmp */
#include "input/search.h"

#include <dirent.h>
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "files/files.h"
#include "files/io.h"
#include "input/glob.h"

enum { DEEPEST = 32, MOST_LOOKED_AT_BELOW = 20000 };

/* One walk: where, and what is wanted. */
typedef struct walk {
    apsm_context *ctx;
    const char *pattern; /* NULL: all */
    size_t root;         /* length of the searched folder and its slash */
    size_t budget;       /* entries that may be looked at */
    const json_t *own;   /* within a folder of a model: the model's files, as it calls them */
    size_t model;        /* length of the model's folder and its slash */
    search *s;
} walk;

static apsm_status no_memory(apsm_context *ctx)
{
    return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory while listing the inputs");
}

void search_free(search *s)
{
    for (size_t k = 0; k < s->n; k++) free(s->hit[k].path);
    for (size_t k = 0; k < s->others; k++) free(s->other[k]);
    free(s->hit);
    free(s->other);
    free(s->place);
    *s = (search){ 0 };
}

/* Room for one more of `size` bytes each. */
static bool grow(void **array, size_t n, size_t *room, size_t size)
{
    if (n < *room) return true;
    const size_t more = 2 * *room + 64;
    void *const grown = realloc(*array, more * size);
    if (!grown) return false;
    *array = grown;
    *room = more;
    return true;
}

static apsm_status add_other(const walk *w, const char *path)
{
    search *s = w->s;
    if (w->own) return APSM_OK;
    if (!grow((void **)&s->other, s->others, &s->others_room, sizeof *s->other))
        return no_memory(w->ctx);
    s->other[s->others] = strdup(path);
    return s->other[s->others++] ? APSM_OK : no_memory(w->ctx);
}

static apsm_status add_hit(const walk *w, const char *path, apsm_input_kind kind)
{
    search *s = w->s;
    const size_t within = strlen(path) > w->root ? w->root : 0;
    if (w->own && json_object_get(w->own, path + w->model)) {
        s->results++;
        return APSM_OK;
    }
    if (w->pattern && !glob_matches(w->pattern, path + within)) {
        s->unmatched++;
        return APSM_OK;
    }
    if (!grow((void **)&s->hit, s->n, &s->room, sizeof *s->hit)) return no_memory(w->ctx);
    s->hit[s->n] = (search_hit){ strdup(path), within, kind };
    return s->hit[s->n++].path ? APSM_OK : no_memory(w->ctx);
}

/* ---- what an entry is ---- */

bool search_is_dicom(const char *path)
{
    char head[132];
    int fd;
    if (apsm_open_regular(NULL, path, &fd) != APSM_OK) return false;
    const ssize_t n = read(fd, head, sizeof head);
    close(fd);
    return n == (ssize_t)sizeof head && memcmp(head + 128, "DICM", 4) == 0;
}

/* Left behind by operating systems, or not to be seen. */
static bool is_litter(const char *name)
{
    static const char *const names[] = { "Thumbs.db", "ehthumbs.db",  "desktop.ini",
                                         "__MACOSX",  "$RECYCLE.BIN", "System Volume Information",
                                         "Icon\r" };
    if (name[0] == '.') return true;
    for (size_t k = 0; k < sizeof names / sizeof *names; k++)
        if (strcasecmp(name, names[k]) == 0) return true;
    return false;
}

static bool holds(const char *folder, const char *name)
{
    char *path = apsm_path_join(folder, name);
    const bool is = path && apsm_file_exists(path);
    free(path);
    return is;
}

static bool is_whole_model(const char *folder)
{
    return holds(folder, "manifest.json") && holds(folder, "project.swproj");
}

/* Made by a run or a fit: what is in it are results. */
static bool is_of_results(const char *folder)
{
    return holds(folder, ".apsm.lock") || is_whole_model(folder) ||
           (holds(folder, "fit.json") && holds(folder, "fit.csv"));
}

/* As a model folder, which may be that of the shapes, too, calls those that files are made in. */
static bool is_part_of_model(const char *path)
{
    static const char *const names[] = { "groomed",  "meshes", "particles", "parts",
                                         "pictures", "state",  "statistics" };
    for (size_t k = 0; k < sizeof names / sizeof *names; k++)
        if (strcmp(apsm_path_last(path), names[k]) == 0) return true;
    return false;
}

/* ---- walking ---- */

static int by_text(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* Sorted paths of the folder's entries.  Those of the list are owned by it. */
static apsm_status list_entries(const walk *w, const char *folder, char ***list, size_t *n)
{
    size_t room = 0;
    DIR *const dir = opendir(folder);
    *list = NULL;
    *n = 0;
    if (!dir)
        return apsm_fail(w->ctx, APSM_ERR_IO, "%s: %s; check your right to read the folder", folder,
                         strerror(errno));
    apsm_status status = APSM_OK;
    for (const struct dirent *entry; status == APSM_OK && (entry = readdir(dir));) {
        if (is_litter(entry->d_name)) continue;
        char *path = apsm_path_join(folder, entry->d_name);
        if (path && grow((void **)list, *n, &room, sizeof **list))
            (*list)[(*n)++] = path;
        else
            status = no_memory(w->ctx);
        if (status != APSM_OK) free(path);
    }
    closedir(dir);
    if (*n > 0) qsort(*list, *n, sizeof **list, by_text);
    return status;
}

/* Whether the folder is met for the first time; links may lead to it on many ways, or in circles.
 */
static apsm_status enter(const walk *w, const char *folder, bool *first)
{
    struct stat info;
    search *s = w->s;
    *first = false;
    if (stat(folder, &info) != 0) return APSM_OK;
    const search_place here = { info.st_dev, info.st_ino };
    for (size_t k = 0; k < s->places; k++)
        if (s->place[k].inode == here.inode && s->place[k].device == here.device) return APSM_OK;
    if (!grow((void **)&s->place, s->places, &s->places_room, sizeof *s->place))
        return no_memory(w->ctx);
    s->place[s->places++] = here;
    *first = true;
    return APSM_OK;
}

/* Shapes and slices of one folder, and in *below, which the caller frees, its folders. */
static apsm_status look_in(const walk *w, const char *folder, char **entry, size_t n, size_t *below)
{
    size_t shapes = 0, slices = 0;
    *below = 0;
    for (size_t k = 0; k < n; k++) {
        apsm_input_kind kind;
        w->s->looked_at++;
        if (apsm_is_folder(entry[k])) {
            char *const path = entry[k]; /* folders come first */
            entry[k] = entry[*below];
            entry[(*below)++] = path;
        } else if (apsm_input_kind_of(entry[k], &kind)) {
            shapes++;
            APSM_TRY(add_hit(w, entry[k], kind));
        } else if (search_is_dicom(entry[k])) {
            slices++;
        } else {
            APSM_TRY(add_other(w, entry[k]));
        }
    }
    if (shapes == 0 && slices > 0) return add_hit(w, folder, APSM_INPUT_DICOM);
    w->s->slices += slices;
    return APSM_OK;
}

static apsm_status walk_folder(const walk *w, const char *folder, size_t depth, bool deep);

static apsm_status walk_below(const walk *w, const char *folder, size_t depth)
{
    bool first;
    if (w->s->looked_at > w->budget) return APSM_OK;
    if (is_of_results(folder)) {
        apsm_log(w->ctx, APSM_LOG_INFO, "%s: a model folder, or fits; not searched for shapes",
                 folder);
        w->s->results++;
        return APSM_OK;
    }
    APSM_TRY(enter(w, folder, &first));
    if (!first) {
        apsm_log(w->ctx, APSM_LOG_WARNING,
                 "%s: leads to a folder that was searched already, or to none; left out", folder);
        return APSM_OK;
    }
    if (depth == DEEPEST) {
        apsm_log(w->ctx, APSM_LOG_WARNING, "%s: more than %d folders deep, not searched", folder,
                 DEEPEST);
        return APSM_OK;
    }
    return walk_folder(w, folder, depth, true);
}

/* Whether a step is at work, or was killed: what it has written is not listed yet. */
static bool has_begun(const json_t *manifest)
{
    return json_array_size(json_object_get(manifest, "begun")) > 0;
}

/* Whether nothing says which files of this folder are the model's, or that all are.  Parts of
 * joints are models. */
static bool is_unlisted(const json_t *manifest, const char *name)
{
    static const char *const filled[] = { "groomed", "meshes", "particles" }; /* by steps */
    if (!manifest) return true;
    if (strcmp(name, "parts") == 0) return json_object_get(manifest, "joint") != NULL;
    for (size_t k = 0; k < sizeof filled / sizeof *filled && has_begun(manifest); k++)
        if (strcmp(name, filled[k]) == 0) return true;
    return false;
}

/* *manifest <- what says which files are the model's; NULL if that is not known, which is told. */
static apsm_status read_manifest(const walk *w, const char *folder, json_t **manifest)
{
    char *const path = apsm_path_join(folder, "manifest.json");
    if (!path) return no_memory(w->ctx);
    const apsm_status status = apsm_json_read(w->ctx, path, manifest);
    free(path);
    if (status == APSM_ERR_MEMORY) return no_memory(w->ctx);
    const bool whole = json_is_object(json_object_get(*manifest, "outputs"));
    if (whole && !has_begun(*manifest)) return APSM_OK;
    if (!whole) {
        json_decref(*manifest);
        *manifest = NULL;
    }
    apsm_log(w->ctx, APSM_LOG_WARNING,
             "%s: holds a model that is %s; which of the files in %s are shapes is not known: not "
             "searched",
             folder, whole ? "not finished" : "damaged",
             whole ? "groomed/, meshes/ and particles/" : "groomed/, meshes/, parts/ and so on");
    return APSM_OK;
}

/* A folder of the name of one of a model's, in which there may be shapes beside the model's files,
 * or nothing of the model. */
static apsm_status walk_part(const walk *w, const char *folder, size_t depth,
                             const json_t *manifest)
{
    const char *const name = apsm_path_last(folder);
    walk inside = *w;
    if (is_unlisted(manifest, name)) {
        w->s->results++;
        return APSM_OK;
    }
    inside.own = json_object_get(manifest, "outputs");
    inside.model = (size_t)(name - folder);
    return walk_below(&inside, folder, depth);
}

static apsm_status walk_folder(const walk *w, const char *folder, size_t depth, bool deep)
{
    json_t *manifest = NULL;
    char **entry;
    size_t n, below = 0;
    apsm_status status = list_entries(w, folder, &entry, &n);
    if (status == APSM_OK) status = look_in(w, folder, entry, n, &below);
    if (below > 0) qsort(entry, below, sizeof *entry, by_text);
    const bool is_model = deep && is_whole_model(folder);
    if (status == APSM_OK && is_model) status = read_manifest(w, folder, &manifest);
    for (size_t k = 0; k < below && deep && status == APSM_OK; k++)
        status = is_model && is_part_of_model(entry[k])
                     ? walk_part(w, entry[k], depth + 1, manifest)
                     : walk_below(w, entry[k], depth + 1);
    json_decref(manifest);
    for (size_t k = 0; k < n; k++) free(entry[k]);
    free(entry);
    return status;
}

/* ---- which of them ---- */

/* Shapes in folders below one that has its own. */
static apsm_status tell_left_out(const walk *top, const char *folder)
{
    enum { NAMED = 3 };
    search below = { 0 };
    walk w = *top;
    char names[NAMED * 84] = "";
    w.s = &below;
    w.budget = MOST_LOOKED_AT_BELOW;
    bool first;
    apsm_status status = enter(&w, folder, &first);
    if (status == APSM_OK) status = walk_folder(&w, folder, 0, true);
    size_t n = 0;
    for (size_t k = 0; k < below.n && status == APSM_OK; k++) {
        const char *within = below.hit[k].path + below.hit[k].within;
        const bool direct = below.hit[k].within == 0 || !strchr(within, '/');
        if (direct && below.hit[k].kind != APSM_INPUT_DICOM) continue;
        if (below.hit[k].within == 0) continue; /* the folder itself, as a series */
        if (n++ < NAMED)
            snprintf(names + strlen(names), sizeof names - strlen(names), "%s%.80s",
                     n > 1 ? ", " : "", within);
    }
    if (n > 0)
        apsm_log(
            w.ctx, APSM_LOG_WARNING,
            "%s: %s%zu shape%s in folders below (%s%s) left out, since there are shapes in the "
            "folder itself; take all by --pattern '**/*'",
            folder, below.looked_at > w.budget ? "at least " : "", n, n == 1 ? "" : "s", names,
            n > NAMED ? ", ..." : "");
    search_free(&below);
    return status;
}

static apsm_status search_from(walk *w, const char *folder)
{
    bool first;
    const size_t before = w->s->n;
    w->root = strlen(folder) + (folder[strlen(folder) - 1] != '/');
    if (strcmp(folder, ".") == 0) w->root = 0; /* apsm_path_join leaves it away */
    if (w->pattern) {
        APSM_TRY(enter(w, folder, &first));
        return walk_folder(w, folder, 0, true);
    }
    const size_t others = w->s->others;
    APSM_TRY(walk_folder(w, folder, 0, false));
    if (w->s->n > before) return tell_left_out(w, folder);
    while (w->s->others > others) free(w->s->other[--w->s->others]); /* they are met again */
    APSM_TRY(enter(w, folder, &first));
    return walk_folder(w, folder, 0, true);
}

apsm_status search_folder(apsm_context *ctx, const char *folder, const char *pattern, search *s)
{
    walk w = {
        .ctx = ctx, .pattern = pattern && *pattern ? pattern : NULL, .budget = (size_t)-1, .s = s
    };
    char *const path = strdup(folder);
    if (!path) return no_memory(ctx);
    for (size_t end = strlen(path); end > 1 && path[end - 1] == '/';) path[--end] = '\0';
    const apsm_status status = search_from(&w, path);
    free(path);
    return status;
}

apsm_status search_series(apsm_context *ctx, const char *folder, search *s)
{
    const walk w = { .ctx = ctx, .budget = (size_t)-1, .s = s };
    const size_t before = s->n;
    APSM_TRY(walk_folder(&w, folder, 0, false));
    if (s->n == before + 1 && s->hit[before].kind == APSM_INPUT_DICOM) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_IO,
                     "%s: is a folder, but not of one DICOM series; name the file", folder);
}
