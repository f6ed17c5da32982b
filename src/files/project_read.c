/* From a .swproj or .xlsx file to a project.  ShapeWorks keeps every value as a string; people who
 * edit the file write numbers as well, so plain values of any kind are taken and kept as strings.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/io.h"
#include "files/project_columns.h"
#include "files/project_xml.h"
#include "files/sheets.h"

/* What the steps of reading share. */
typedef struct reading {
    apsm_context *ctx;
    const char *path;
    const char *wanted; /* domain; NULL: the project's own choice */
    apsm_project *project;
} reading;

static apsm_status out_of_memory(const reading *r)
{
    return apsm_fail_errno(r->ctx, r->path, "cannot be read", ENOMEM);
}

/* ---- Values ---- */

static json_t *as_text(const json_t *value)
{
    char text[APSM_NUMBER_LENGTH];
    if (json_is_string(value)) return json_string(json_string_value(value));
    if (json_is_boolean(value)) return json_string(json_is_true(value) ? "true" : "false");
    if (json_is_integer(value))
        snprintf(text, sizeof text, "%lld", (long long)json_integer_value(value));
    else
        apsm_format_number(json_real_value(value), text);
    return json_string(text);
}

json_t *apsm_json_as_texts(const json_t *object, const char **bad)
{
    json_t *texts = json_object();
    *bad = NULL;
    for (void *at = json_object_iter((json_t *)object); texts && at;
         at = json_object_iter_next((json_t *)object, at)) {
        const json_t *value = json_object_iter_value(at);
        if (json_is_null(value)) continue;
        if (json_is_object(value) || json_is_array(value)) *bad = json_object_iter_key(at);
        if (*bad || json_object_set_new(texts, json_object_iter_key(at), as_text(value)) != 0) {
            json_decref(texts);
            texts = NULL;
        }
    }
    return texts;
}

static int parse_numbers(const char *text, double x[16])
{
    int n = 0;
    for (const char *at = text; *(at += strspn(at, " \t\r\n"));) {
        const size_t length = strcspn(at, " \t\r\n");
        if (n == 16 || !apsm_parse_number(at, length, &x[n++])) return 0;
        at += length;
    }
    return n;
}

int apsm_transform_parse(const char *text, double M[16], bool *plain)
{
    static const double last_row[4] = { 0, 0, 0, 1 };
    double x[16];
    const int n = parse_numbers(text, x);
    *plain = true;
    if (n == 16) {
        memcpy(M, x, sizeof x);
        return memcmp(x + 12, last_row, sizeof last_row) == 0 ? 16 : 0;
    }
    if (n != 12) return 0;
    /* ShapeWorks takes the translation alone (9..11); the rest was an identity in its day. */
    for (int i = 0; i < 16; i++) M[i] = i % 5 == 0;
    for (int i = 0; i < 9; i++) *plain = *plain && x[i] == (double)(i % 4 == 0);
    for (int i = 0; i < 3; i++) M[4 * i + 3] = x[9 + i];
    return 12;
}

/* ---- One subject ---- */

static const char *column(const reading *r, const json_t *row, const char *prefix)
{
    char key[APSM_KEY_LENGTH];
    const char *text =
        json_string_value(json_object_get(row, apsm_project_key(r->project, prefix, key)));
    return text && *text ? text : NULL;
}

/* Of row i of the data. */
static apsm_status read_transform(const reading *r, size_t i, const json_t *row, const char *prefix,
                                  double M[16], bool *has)
{
    bool plain;
    const char *text = column(r, row, prefix);
    *has = text != NULL;
    if (!text) return APSM_OK;
    if (!apsm_transform_parse(text, M, &plain))
        return apsm_fail(
            r->ctx, APSM_ERR_FORMAT,
            "%s: data[%zu].%s%s: '%.*s' is no transform; give the 16 numbers of a 4 x 4 "
            "matrix row by row, the last four 0 0 0 1",
            r->path, i, prefix, r->project->domain, APSM_SHOWN, text);
    if (!plain)
        apsm_log(
            r->ctx, APSM_LOG_WARNING,
            "%s: data[%zu].%s%s has 12 numbers; only the translation is used, as in ShapeWorks",
            r->path, i, prefix, r->project->domain);
    return APSM_OK;
}

/* Paths of Windows projects have backslashes; ShapeWorks turns them as well. */
static apsm_status read_path(const char *text, char **slot)
{
    APSM_TRY(apsm_text_set(slot, text));
    if (*slot) apsm_path_from_windows(*slot);
    return APSM_OK;
}

static apsm_status read_columns(const reading *r, apsm_subject *s)
{
    char key[APSM_KEY_LENGTH];
    const char *shape = apsm_subject_column(s, apsm_project_input_key(r->project, s->row, key));
    const char *mirrored = apsm_subject_column(s, "mirrored");
    const char *name = apsm_subject_column(s, "name");
    APSM_TRY(apsm_text_set(&s->name, name ? name : ""));
    APSM_TRY(read_path(shape && *shape ? shape : NULL, &s->shape));
    APSM_TRY(read_path(column(r, s->row, "groomed_"), &s->groomed));
    APSM_TRY(read_path(column(r, s->row, "local_particles_"), &s->local_particles));
    APSM_TRY(read_path(column(r, s->row, "world_particles_"), &s->world_particles));
    s->mirrored = apsm_says_yes(mirrored);
    return APSM_OK;
}

/* Another program that grooms the project anew keeps the columns that it does not know. */
static void forget_stale_mirror(const reading *r, apsm_subject *s)
{
    char ours[1024];
    double M[16];
    bool plain;
    const char *reflection = apsm_subject_column(s, "reflection");
    if (!s->mirrored || !s->groomed || !reflection) return;
    if (!apsm_transform_parse(reflection, M, &plain)) return;
    snprintf(ours, sizeof ours, "groomed/%s.ply", s->name);
    const size_t end = strlen(ours), length = strlen(s->groomed);
    if (length >= end && strcmp(s->groomed + length - end, ours) == 0) return;
    s->mirrored = false;
    json_object_del(s->row, "reflection");
    apsm_log(r->ctx, APSM_LOG_WARNING,
             "%s: %s: `mirrored` is of a groomed mesh that apsm wrote, not of %s; taken as no",
             r->path, s->name, s->groomed);
}

static apsm_status read_subject(const reading *r, size_t i, const json_t *value)
{
    const char *bad;
    apsm_subject *s;
    if (!json_is_object(value))
        return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                         "%s: data[%zu] is no object; every shape is {\"name\": ..., \"shape_1\": "
                         "...}",
                         r->path, i);
    json_t *row = apsm_json_as_texts(value, &bad);
    if (!row && bad)
        return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                         "%s: data[%zu].%s is an object or array; write it as a string", r->path, i,
                         bad);
    if (!row || apsm_project_add(r->project, "", NULL, &s) != APSM_OK) {
        json_decref(row);
        return out_of_memory(r);
    }
    json_decref(s->row);
    s->row = row;
    if (read_columns(r, s) != APSM_OK) return out_of_memory(r);
    APSM_TRY(read_transform(r, i, row, "alignment_", s->alignment, &s->has_alignment));
    return read_transform(r, i, row, "procrustes_", s->procrustes, &s->has_procrustes);
}

/* ---- The project ---- */

/* The domain is what follows the prefix in the first row's first matching key. */
static const char *suffix_after(const json_t *row, const char *prefix)
{
    for (void *at = json_object_iter((json_t *)row); at;
         at = json_object_iter_next((json_t *)row, at)) {
        const char *key = json_object_iter_key(at);
        if (strncmp(key, prefix, strlen(prefix)) == 0 && key[strlen(prefix)])
            return key + strlen(prefix);
    }
    return NULL;
}

/* What follows shape_, segmentation_ or mesh_ in a key, or NULL. */
static const char *domain_of_key(const char *key)
{
    static const char *const prefixes[] = { "shape_", "segmentation_", "mesh_" };
    for (size_t k = 0; k < sizeof prefixes / sizeof *prefixes; k++)
        if (strncmp(key, prefixes[k], strlen(prefixes[k])) == 0) return key + strlen(prefixes[k]);
    return NULL;
}

/* The k-th domain of a row, or NULL. */
static const char *domain_of_row(json_t *row, size_t k)
{
    for (void *at = json_object_iter(row); at; at = json_object_iter_next(row, at)) {
        const char *domain = domain_of_key(json_object_iter_key(at));
        if (domain && *domain && k-- == 0) return domain;
    }
    return NULL;
}

static size_t domains_of_row(json_t *row)
{
    size_t n = 0;
    while (domain_of_row(row, n)) n++;
    return n;
}

/* A subject may miss a part: the first of those that have most says which there are. */
static json_t *fullest_row(const apsm_project *project, size_t *domains)
{
    json_t *row = NULL;
    *domains = 0;
    for (size_t i = 0; i < project->n; i++) {
        const size_t n = domains_of_row(project->subjects[i].row);
        if (n > *domains) *domains = n, row = project->subjects[i].row;
    }
    return row;
}

const char *apsm_project_domain_name(const apsm_project *project, size_t k)
{
    size_t n;
    return domain_of_row(fullest_row(project, &n), k);
}

size_t apsm_project_domains(const apsm_project *project)
{
    size_t n;
    (void)fullest_row(project, &n);
    return n;
}

static apsm_status read_domain(const reading *r, const json_t *data)
{
    static const char *const prefixes[] = { "shape_",   "segmentation_",    "mesh_",
                                            "groomed_", "local_particles_", "world_particles_" };
    const json_t *row = json_array_get(data, 0);
    const json_t *own = json_object_get(r->project->root, "apsm");
    const char *chosen = json_string_value(json_object_get(own, "domain"));
    const char *domain = r->wanted ? r->wanted : chosen && *chosen ? chosen : NULL;
    for (size_t i = 0; !domain && i < sizeof prefixes / sizeof *prefixes; i++)
        domain = suffix_after(row, prefixes[i]);
    if (domain && strlen(domain) > APSM_KEY_LENGTH / 2)
        return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: data[0] has a domain name of %zu characters",
                         r->path, strlen(domain));
    if (apsm_text_set(&r->project->domain, domain ? domain : "1") != APSM_OK)
        return out_of_memory(r);
    return APSM_OK;
}

/* ---- Shapes that are excluded ---- */

static bool is_excluded(const json_t *row)
{
    const json_t *value = json_object_get(row, "excluded");
    return json_is_true(value) || json_integer_value(value) == 1 ||
           apsm_says_yes(json_string_value(value));
}

static apsm_status set_aside(const reading *r, size_t i, const json_t *value)
{
    const char *bad;
    json_t *row = apsm_json_as_texts(value, &bad);
    if (!row && bad)
        return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                         "%s: data[%zu].%s is an object or array; write it as a string", r->path, i,
                         bad);
    if (!r->project->aside) r->project->aside = json_array();
    json_t *pair = json_pack("[I, o]", (json_int_t)i, row);
    return pair && json_array_append_new(r->project->aside, pair) == 0 ? APSM_OK : out_of_memory(r);
}

static void tell_aside(const reading *r)
{
    enum { NAMED = 5 };
    char names[NAMED * 64] = "";
    size_t k;
    json_t *pair;
    const size_t n = json_array_size(r->project->aside);
    if (n == 0) return;
    json_array_foreach(r->project->aside, k, pair)
    {
        const char *name = json_string_value(json_object_get(json_array_get(pair, 1), "name"));
        const size_t used = strlen(names);
        if (k < NAMED)
            snprintf(names + used, sizeof names - used, "%s%.60s", k ? ", " : "",
                     name ? name : "?");
    }
    apsm_log(r->ctx, APSM_LOG_INFO, "%s: %zu shape%s excluded: %s%s", r->path, n,
             n == 1 ? " is" : "s are", names, n > NAMED ? ", ..." : "");
}

static apsm_status read_data(const reading *r)
{
    size_t i;
    json_t *value;
    const json_t *data = json_object_get(r->project->root, "data");
    if (!json_is_array(data) && !json_is_null(data))
        return apsm_fail(r->ctx, APSM_ERR_FORMAT,
                         "%s: has no array \"data\"; is it a project of apsm or ShapeWorks?",
                         r->path);
    APSM_TRY(read_domain(r, data));
    json_array_foreach(data, i, value)
    {
        if (is_excluded(value))
            APSM_TRY(set_aside(r, i, value));
        else
            APSM_TRY(read_subject(r, i, value));
    }
    tell_aside(r);
    APSM_TRY(apsm_project_fix_names(r->ctx, r->project));
    for (i = 0; i < r->project->n; i++) forget_stale_mirror(r, &r->project->subjects[i]);
    return APSM_OK;
}

/* Our own options as texts, whoever edited them. */
static apsm_status read_options(const reading *r)
{
    const char *bad;
    const json_t *options = json_object_get(r->project->root, "apsm");
    if (!options) return APSM_OK;
    json_t *texts = apsm_json_as_texts(options, &bad);
    if (!json_is_object(options) || bad) {
        json_decref(texts);
        return apsm_fail(r->ctx, APSM_ERR_FORMAT, "%s: apsm%s%s must be %s; correct or remove it",
                         r->path, bad ? "." : "", bad ? bad : "",
                         bad ? "a string or a number" : "an object of options");
    }
    if (!texts || json_object_set_new(r->project->root, "apsm", texts) != 0)
        return out_of_memory(r);
    return APSM_OK;
}

static apsm_status read_root(apsm_context *ctx, const char *path, json_t **root)
{
    workbook w;
    if (apsm_is_parameter_file(path)) return project_from_xml(ctx, path, root);
    if (!apsm_is_spreadsheet(path)) return apsm_json_read(ctx, path, root);
    APSM_TRY(workbook_read(ctx, path, &w));
    const apsm_status status = project_from_sheets(ctx, path, &w, root);
    workbook_free(&w);
    return status;
}

apsm_status apsm_project_read(apsm_context *ctx, const char *path, apsm_project *project)
{
    return apsm_project_read_domain(ctx, path, NULL, project);
}

apsm_status apsm_project_read_domain(apsm_context *ctx, const char *path, const char *domain,
                                     apsm_project *project)
{
    const reading r = { .ctx = ctx, .path = path, .wanted = domain, .project = project };
    *project = (apsm_project){ 0 };
    json_t *root;
    APSM_TRY(read_root(ctx, path, &root));
    project->root = root;
    project->folder = apsm_path_folder(path);
    apsm_status status = project->folder ? read_data(&r) : out_of_memory(&r);
    if (status == APSM_OK) status = read_options(&r);
    if (status != APSM_OK) apsm_project_free(project);
    return status;
}
