#include "landmarks/landmark_table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "files/files.h"
#include "geometry/affine.h"

enum { MOST_BYTES = 1 << 28 };

void landmark_table_begin(size_t I, landmark_table *t)
{
    *t = (landmark_table){ .I = I };
}

void landmark_table_free(landmark_table *t)
{
    for (size_t l = 0; l < t->L; l++) free(t->name[l]);
    free(t->name);
    free(t->has);
    free(t->x);
    *t = (landmark_table){ 0 };
}

static size_t find(const landmark_table *t, const char *name)
{
    size_t l = 0;
    while (l < t->L && strcmp(t->name[l], name) != 0) l++;
    return l;
}

/* Room for one name more; rows grow. */
static apsm_status add_name(landmark_table *t, const char *name)
{
    const size_t L = t->L + 1;
    bool *has = calloc(t->I * L + 1, sizeof *has);
    double *x = calloc(3 * t->I * L + 1, sizeof *x);
    char **names = realloc(t->name, L * sizeof *names), *copy = strdup(name);
    if (names) t->name = names;
    if (!has || !x || !names || !copy) {
        free(has);
        free(x);
        free(copy);
        return APSM_ERR_MEMORY;
    }
    for (size_t i = 0; i < t->I && t->L > 0; i++) {
        memcpy(has + i * L, t->has + i * t->L, t->L * sizeof *has);
        memcpy(x + 3 * i * L, t->x + 3 * i * t->L, 3 * t->L * sizeof *x);
    }
    free(t->has);
    free(t->x);
    t->has = has;
    t->x = x;
    t->name[t->L++] = copy;
    return APSM_OK;
}

static apsm_status put(landmark_table *t, size_t i, const char *name, const double x[3])
{
    const size_t l = find(t, name);
    if (l == t->L) APSM_TRY(add_name(t, name));
    t->has[i * t->L + l] = true;
    memcpy(t->x + 3 * (i * t->L + l), x, 3 * sizeof *x);
    return APSM_OK;
}

apsm_status landmark_table_take(landmark_table *t, size_t i, const landmark_list *list)
{
    for (size_t k = 0; k < list->n; k++) APSM_TRY(put(t, i, list->name[k], list->x + 3 * k));
    return APSM_OK;
}

apsm_status landmark_table_list(apsm_context *ctx, const landmark_table *t, size_t i,
                                landmark_list *list)
{
    *list = (landmark_list){ 0 };
    apsm_status status = APSM_OK;
    for (size_t l = 0; l < t->L && status == APSM_OK; l++)
        if (landmark_is_there(t, i, l))
            status = landmark_list_add(ctx, "landmarks", t->name[l], landmark_at(t, i, l), list);
    if (status != APSM_OK) landmark_list_free(list);
    return status;
}

void landmark_table_move(landmark_table *t, size_t i, const double M[16])
{
    for (size_t l = 0; l < t->L; l++) {
        double *x = t->x + 3 * (i * t->L + l);
        if (landmark_is_there(t, i, l)) apsm_affine_apply(M, 1, x, x);
    }
}

/* ---- the file of a cohort ---- */

typedef struct reading {
    apsm_context *ctx;
    const char *path;
    size_t I;
    const char *const *names;
    landmark_table *t;
    size_t others;
} reading;

static size_t find_shape(const reading *r, const char *name)
{
    size_t i = 0;
    while (i < r->I && strcmp(r->names[i], name) != 0) i++;
    return i;
}

static apsm_status take_line(reading *r, size_t number, char *line)
{
    char *field[LANDMARK_FIELDS];
    double x[3];
    if (landmark_cut_fields(line, field) != 5 || !*field[1])
        return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s:%zu: is not shape,name,x,y,z", r->path,
                         number);
    for (size_t c = 0; c < 3; c++)
        if (!apsm_parse_number(field[2 + c], strlen(field[2 + c]), &x[c]))
            return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s:%zu: '%s' is no number", r->path, number,
                             field[2 + c]);
    if (!landmark_is_place(x))
        return apsm_fail(r->ctx, APSM_ERR_NONFINITE,
                         "%s:%zu: '%s' is not at a place where anything is", r->path, number,
                         field[1]);
    const size_t i = find_shape(r, field[0]);
    if (i == r->I) return r->others++, APSM_OK;
    const size_t l = find(r->t, field[1]);
    if (l < r->t->L && landmark_is_there(r->t, i, l))
        return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s:%zu: %s has a second '%s'", r->path, number,
                         field[0], field[1]);
    return put(r->t, i, field[1], x);
}

static apsm_status check_header(const reading *r, char *line)
{
    static const char *const column[] = { "shape", "name", "x", "y", "z" };
    char *field[LANDMARK_FIELDS];
    bool same = landmark_cut_fields(line, field) == 5;
    for (size_t c = 0; c < 5 && same; c++) same = strcasecmp(field[c], column[c]) == 0;
    if (same) return APSM_OK;
    return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                     "%s:1: landmarks of several shapes begin with the line shape,name,x,y,z",
                     r->path);
}

apsm_status landmark_table_read(apsm_context *ctx, const char *path, size_t I,
                                const char *const *names, landmark_table *t, size_t *others)
{
    reading r = { .ctx = ctx, .path = path, .I = I, .names = names, .t = t };
    char *text = NULL;
    size_t size, number = 2;
    landmark_table_begin(I, t);
    APSM_TRY(apsm_read_text(ctx, path, MOST_BYTES, &text, &size));
    char *next = strchr(text, '\n');
    if (next) *next++ = 0;
    apsm_status status = check_header(&r, text);
    for (char *at = next; at && *at && status == APSM_OK; at = next) {
        next = strchr(at, '\n');
        if (next) *next++ = 0;
        if (at[strspn(at, " \t\r")]) status = take_line(&r, number, at);
        number++;
    }
    free(text);
    if (others) *others = r.others;
    if (status != APSM_OK) landmark_table_free(t);
    return status;
}

apsm_status landmark_table_write(apsm_context *ctx, const char *path, const char *const *names,
                                 const landmark_table *t)
{
    apsm_writer *w = NULL;
    APSM_TRY(apsm_writer_open(ctx, path, &w));
    apsm_writer_printf(w, "shape,name,x,y,z\n");
    for (size_t i = 0; i < t->I; i++)
        for (size_t l = 0; l < t->L; l++) {
            if (!landmark_is_there(t, i, l)) continue;
            apsm_writer_csv(w, names[i]);
            apsm_writer_printf(w, ",");
            apsm_writer_csv(w, t->name[l]);
            for (size_t c = 0; c < 3; c++) {
                apsm_writer_printf(w, ",");
                apsm_writer_number(w, landmark_at(t, i, l)[c]);
            }
            apsm_writer_printf(w, "\n");
        }
    return apsm_writer_commit(w);
}

/* ---- a folder of files ---- */

static apsm_status take_file(apsm_context *ctx, const char *folder, const char *name, size_t i,
                             landmark_table *t)
{
    static const char *const extensions[] = { "mrk.json", "fcsv", "csv" };
    for (size_t k = 0; k < sizeof extensions / sizeof *extensions; k++) {
        landmark_list list = { 0 };
        const size_t room = strlen(folder) + strlen(name) + 16;
        char *path = malloc(room);
        if (!path) return APSM_ERR_MEMORY;
        snprintf(path, room, "%s/%s.%s", folder, name, extensions[k]);
        const bool there = apsm_file_exists(path);
        apsm_status status = there ? landmark_list_read(ctx, path, &list) : APSM_OK;
        if (status == APSM_OK) status = landmark_table_take(t, i, &list);
        landmark_list_free(&list);
        free(path);
        if (there || status != APSM_OK) return status;
    }
    return APSM_OK;
}

static apsm_status gather_folder(apsm_context *ctx, const char *path, size_t I,
                                 const char *const *names, landmark_table *t)
{
    landmark_table_begin(I, t);
    apsm_status status = APSM_OK;
    for (size_t i = 0; i < I && status == APSM_OK; i++)
        status = take_file(ctx, path, names[i], i, t);
    if (status == APSM_OK && t->L == 0)
        status = apsm_fail(ctx, APSM_ERR_ARG,
                           "%s: holds no landmarks of these shapes; each has a file of its name, "
                           "%s.mrk.json, .fcsv or .csv",
                           path, names[0]);
    if (status != APSM_OK) landmark_table_free(t);
    return status;
}

apsm_status landmark_table_gather(apsm_context *ctx, const char *path, size_t I,
                                  const char *const *names, landmark_table *t)
{
    size_t others = 0;
    *t = (landmark_table){ 0 };
    if (apsm_is_folder(path)) return gather_folder(ctx, path, I, names, t);
    APSM_TRY(landmark_table_read(ctx, path, I, names, t, &others));
    if (others > 0)
        apsm_log(ctx, APSM_LOG_WARNING,
                 "%s: %zu landmarks are of shapes that are not in this model; left out", path,
                 others);
    if (t->L > 0) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG, "%s: holds no landmarks of these shapes; the first is '%s'",
                     path, names[0]);
}

/* ---- what there is ---- */

static void tell_missing(apsm_context *ctx, const landmark_table *t, const char *const *names,
                         size_t l)
{
    enum { MOST_NAMED = 5 };
    char text[512] = "";
    size_t missing = 0, used = 0;
    for (size_t i = 0; i < t->I; i++) {
        if (landmark_is_there(t, i, l)) continue;
        if (missing++ < MOST_NAMED && used < sizeof text)
            used += (size_t)snprintf(text + used, sizeof text - used, "%s%s", used ? ", " : "",
                                     names[i]);
    }
    apsm_log(ctx, APSM_LOG_WARNING, "landmark '%s' is missing on %zu of %zu shapes: %s%s",
             t->name[l], missing, t->I, text, missing > MOST_NAMED ? ", ..." : "");
}

void landmark_table_tell(apsm_context *ctx, const landmark_table *t, const char *const *names)
{
    size_t common = 0;
    for (size_t l = 0; l < t->L; l++) {
        size_t n = 0;
        for (size_t i = 0; i < t->I; i++) n += landmark_is_there(t, i, l);
        common += n == t->I;
        if (n < t->I) tell_missing(ctx, t, names, l);
    }
    apsm_log(ctx, APSM_LOG_INFO, "%zu landmarks, %zu of them on all %zu shapes", t->L, common,
             t->I);
}
