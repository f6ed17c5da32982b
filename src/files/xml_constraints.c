/* Lists of numbers, one after the other for all inputs, and how many of them each input has:
 * `<num_planes_per_input> 1 1 </...>`, `<cutting_planes>` with three points a plane;
 * `<spheres_per_domain>`, `<sphere_radii>`, `<sphere_centers>`; `<ffcs>` with a file each, or as
 * many as `<num_ffcs_per_input>` says. */
#include "files/xml_constraints.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/number.h"
#include "files/files.h"

enum { MOST = 1 << 24, KEY = 64 };
static const char blanks[] = " \t\r\n";

typedef struct reading {
    apsm_context *ctx;
    const char *path; /* of the file that is read: the .xml, or a .ffc */
    const json_t *values;
    size_t n, domains;
    json_t *made; /* n objects */
} reading;

typedef struct numbers {
    size_t n;
    double *x;
} numbers;

static const char *text_of(const reading *r, const char *name)
{
    const char *const text = json_string_value(json_object_get(r->values, name));
    return text ? text : "";
}

static apsm_status no_memory(const reading *r)
{
    return apsm_fail(r->ctx, APSM_ERR_MEMORY, "%s: out of memory", r->path);
}

static size_t count_words(const char *at)
{
    size_t n = 0;
    for (at += strspn(at, blanks); *at; n++) {
        at += strcspn(at, blanks);
        at += strspn(at, blanks);
    }
    return n;
}

/* The word at *at, which moves behind it. */
static size_t next_word(const char **at, const char **word)
{
    *word = *at + strspn(*at, blanks);
    const size_t length = strcspn(*word, blanks);
    *at = *word + length;
    return length;
}

static apsm_status numbers_of(const reading *r, const char *name, numbers *list)
{
    const char *at = text_of(r, name), *word;
    list->n = count_words(at);
    list->x = malloc(list->n * sizeof *list->x + 1);
    if (!list->x) return no_memory(r);
    for (size_t k = 0; k < list->n; k++) {
        const size_t length = next_word(&at, &word);
        if (!apsm_parse_number(word, length, &list->x[k]))
            return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: %s: '%.*s' is no number; correct it",
                             r->path, name, (int)(length < 40 ? length : 40), word);
    }
    return APSM_OK;
}

/* count (n, out): how many each input has by the element; without it `otherwise`.  Of one number a
 * domain the inputs of all shapes have as many. */
static apsm_status counts_of(const reading *r, const char *name, size_t otherwise, size_t *count,
                             size_t *sum)
{
    numbers list = { 0 };
    apsm_status status = numbers_of(r, name, &list);
    bool good = list.n == 0 || list.n == r->n || list.n == r->domains;
    *sum = 0;
    for (size_t k = 0; status == APSM_OK && good && k < r->n; k++) {
        const double x = list.n > 0 ? list.x[k % list.n] : (double)otherwise;
        good = x >= 0 && x < MOST;
        count[k] = good ? (size_t)x : 0;
        *sum += count[k];
    }
    free(list.x);
    if (status != APSM_OK || good) return status;
    return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                     "%s: %s has %zu numbers for %zu inputs; give one an input", r->path, name,
                     list.n, r->n);
}

static apsm_status check_length(const reading *r, const char *name, size_t has, size_t wants,
                                const char *by)
{
    if (has == wants) return APSM_OK;
    return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                     "%s: %s has %zu entries, where %s asks for %zu; correct one of them", r->path,
                     name, has, by, wants);
}

/* Appends to the list `name` of the constraints of input k; takes over item. */
static apsm_status append(const reading *r, size_t k, const char *name, json_t *item)
{
    json_t *const of = json_array_get(r->made, k);
    json_t *list = json_object_get(of, name);
    if (!list && json_object_set_new(of, name, json_array()) == 0) list = json_object_get(of, name);
    return list && item && json_array_append_new(list, item) == 0 ? APSM_OK : no_memory(r);
}

static apsm_status add_planes(const reading *r, size_t *count)
{
    static const char by[] = "num_planes_per_input", name[] = "cutting_planes";
    numbers list = { 0 };
    size_t sum, at = 0;
    apsm_status status = numbers_of(r, name, &list);
    if (status == APSM_OK) status = counts_of(r, by, 0, count, &sum);
    if (status == APSM_OK) status = check_length(r, name, list.n, 9 * sum, by);
    for (size_t k = 0; k < r->n && status == APSM_OK; k++)
        for (size_t p = 0; p < count[k] && status == APSM_OK; p++, at += 9)
            status = append(r, k, "planes",
                            json_pack("{s:o}", "points", apsm_json_matrix(3, 3, list.x + at)));
    free(list.x);
    return status;
}

static apsm_status add_spheres(const reading *r, size_t *count)
{
    static const char by[] = "spheres_per_domain";
    numbers radius = { 0 }, centre = { 0 };
    size_t sum, at = 0;
    apsm_status status = numbers_of(r, "sphere_radii", &radius);
    if (status == APSM_OK) status = numbers_of(r, "sphere_centers", &centre);
    if (status == APSM_OK) status = counts_of(r, by, 0, count, &sum);
    if (status == APSM_OK) status = check_length(r, "sphere_radii", radius.n, sum, by);
    if (status == APSM_OK) status = check_length(r, "sphere_centers", centre.n, 3 * sum, by);
    for (size_t k = 0; k < r->n && status == APSM_OK; k++)
        for (size_t p = 0; p < count[k] && status == APSM_OK; p++, at++)
            status =
                append(r, k, "spheres",
                       json_pack("{s:o, s:f}", "center", apsm_json_vector(3, centre.x + 3 * at),
                                 "radius", radius.x[at]));
    free(radius.x);
    free(centre.x);
    return status;
}

/* ---- free forms: "query", a point, and loops after "boundary_pts" each ---- */

static bool is_word(const char *word, size_t length, const char *what)
{
    return length == strlen(what) && strncmp(word, what, length) == 0;
}

static json_t *next_point(const char **at)
{
    double x[3];
    for (int c = 0; c < 3; c++) {
        const char *word;
        const size_t length = next_word(at, &word);
        if (!apsm_parse_number(word, length, &x[c])) return NULL;
    }
    return apsm_json_vector(3, x);
}

/* The whole text of a .ffc into form; false: it is none. */
static bool parse_form(const char *at, json_t *form, json_t *loops)
{
    json_t *points = NULL;
    for (at += strspn(at, blanks); *at; at += strspn(at, blanks)) {
        const char *word, *ahead = at;
        const size_t length = next_word(&ahead, &word);
        if (is_word(word, length, "query")) {
            if (json_object_get(form, "query_point")) return false;
            if (json_object_set_new(form, "query_point", next_point(&ahead))) return false;
        } else if (is_word(word, length, "boundary_pts")) {
            points = json_array();
            if (json_array_append_new(loops, json_pack("{s:o}", "points", points))) return false;
        } else {
            ahead = at;
            if (json_array_append_new(points, next_point(&ahead))) return false;
        }
        at = ahead;
    }
    return true;
}

/* An empty file is the whole surface.  One point says what is meant, so that two forms of an input
 * cannot be told. */
static apsm_status add_form(const reading *r, size_t k, const char *text)
{
    json_t *form = json_object(), *loops = json_array(), *of = json_array_get(r->made, k);
    const bool good = form && loops && json_object_set(form, "boundaries", loops) == 0 &&
                      parse_form(text, form, loops);
    const bool empty = json_array_size(loops) == 0;
    const bool second = !empty && json_object_get(of, "free_form_constraints");
    apsm_status status = APSM_OK;
    if (!good || second)
        status =
            apsm_fail(r->ctx, APSM_ERR_FORMAT,
                      good ? "%s: is the second free form of an input; put its boundaries into "
                             "the first"
                           : "%s: is no free form: \"query\", a point, and \"boundary_pts\", "
                             "three points or more, for every line around it",
                      r->path);
    else if (!empty && json_object_set(of, "free_form_constraints", form))
        status = no_memory(r);
    json_decref(loops);
    json_decref(form);
    return status;
}

static apsm_status read_form(const reading *r, size_t k, const char *word, size_t length)
{
    char *name = strndup(word, length), *folder = apsm_path_folder(r->path), *text = NULL;
    char *path = name && folder ? apsm_path_join(folder, name) : NULL;
    size_t size;
    apsm_status status = path ? apsm_read_file(r->ctx, path, MOST, &text, &size) : no_memory(r);
    if (status == APSM_OK) {
        reading of_form = *r;
        of_form.path = path;
        status = add_form(&of_form, k, text);
    }
    free(text);
    free(path);
    free(folder);
    free(name);
    return status;
}

static apsm_status add_forms(const reading *r, size_t *count)
{
    const char *at = text_of(r, "ffcs"), *word;
    size_t sum;
    if (!*at) return APSM_OK;
    APSM_TRY(counts_of(r, "num_ffcs_per_input", 1, count, &sum));
    APSM_TRY(check_length(r, "ffcs", count_words(at), sum, "num_ffcs_per_input (1 an input)"));
    for (size_t k = 0; k < r->n; k++)
        for (size_t p = 0; p < count[k]; p++) {
            const size_t length = next_word(&at, &word);
            APSM_TRY(read_form(r, k, word, length));
        }
    return APSM_OK;
}

/* ---- columns ---- */

static apsm_status add_columns(const reading *r, json_t *data)
{
    for (size_t k = 0; k < r->n; k++) {
        const json_t *of = json_array_get(r->made, k);
        char key[KEY], *text;
        if (json_object_size(of) == 0) continue;
        snprintf(key, sizeof key, "constraints_%zu", k % r->domains + 1);
        text = json_dumps(of, JSON_COMPACT | JSON_REAL_PRECISION(17));
        const int failed = !text || json_object_set_new(json_array_get(data, k / r->domains), key,
                                                        json_string(text));
        free(text);
        if (failed) return no_memory(r);
    }
    return APSM_OK;
}

static const char *const elements[] = { "cutting_planes",    "num_planes_per_input", "sphere_radii",
                                        "sphere_centers",    "spheres_per_domain",   "ffcs",
                                        "num_ffcs_per_input" };

bool xml_is_constraint(const char *name)
{
    for (size_t k = 0; k < sizeof elements / sizeof *elements; k++)
        if (strcmp(name, elements[k]) == 0) return true;
    return false;
}

apsm_status xml_constraints(apsm_context *ctx, const char *path, const json_t *values, size_t n,
                            size_t domains, json_t *data)
{
    reading r = { ctx, path, values, n, domains, json_array() };
    size_t *count = malloc(n * sizeof *count + 1);
    apsm_status status = r.made && count ? APSM_OK : no_memory(&r);
    if (status == APSM_OK && *text_of(&r, "cutting_plane_files"))
        status = apsm_fail(ctx, APSM_ERR_UNSUPPORTED,
                           "%s: its cutting_plane_files are not read; write their points into "
                           "cutting_planes, or take the element out",
                           path);
    for (size_t k = 0; k < n && status == APSM_OK; k++)
        if (json_array_append_new(r.made, json_object())) status = no_memory(&r);
    if (status == APSM_OK) status = add_planes(&r, count);
    if (status == APSM_OK) status = add_spheres(&r, count);
    if (status == APSM_OK) status = add_forms(&r, count);
    if (status == APSM_OK) status = add_columns(&r, data);
    json_decref(r.made);
    free(count);
    return status;
}
