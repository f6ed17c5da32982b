#include "run/source.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/project_columns.h"

/* ---- what cannot be done yet ---- */

enum {
    CONSTRAINTS,
    LANDMARKS,
    NORMALS,
    FIELDS,
    GEODESICS,
    FIXED,
    DOMAINS,
    REFLECT,
    SHARED,
    REQUESTS
};
static const struct {
    const char *word, *what;
} requests[REQUESTS] = {
    { "constraints", "constraints, by which only a part of the surface counts" },
    { "landmarks",
      "landmarks that guide the particles (optimize.use_landmarks), of which it has none" },
    { "normals", "normals in the correspondence (optimize.use_normals)" },
    { "fields", "fields of the surface in the correspondence (optimize.field_attributes)" },
    { "geodesics",
      "distances to landmarks in the correspondence (optimize.use_geodesics_to_landmarks)" },
    { "fixed", "fixed shapes, whose particles stay" },
    { "domains", "several domains, modelled together" },
    { "reflect", "shapes reflected about another axis than X, or by a column that no shape has "
                 "(groom.reflect; --reflect-match does it by name)" },
    { "shared", "the boundary that two domains share (groom.shared_boundary; --parts and "
                "--shared-boundary do it with files)" }
};

static size_t find_word(const char *text, size_t length)
{
    size_t k = 0;
    while (k < REQUESTS &&
           (strlen(requests[k].word) != length || strncmp(requests[k].word, text, length) != 0))
        k++;
    return k;
}

apsm_status apsm_run_check_ignore(apsm_context *ctx, const char *text)
{
    for (const char *at = text; *at;) {
        const size_t length = strcspn(at, ",");
        if (find_word(at, length) == REQUESTS)
            return apsm_fail(ctx, APSM_ERR_ARG,
                             "ignore = %s: '%.*s' is none of constraints, landmarks, normals, "
                             "fields, geodesics, fixed, domains, reflect and shared",
                             text, (int)length, at);
        at += length + (at[length] == ',');
    }
    return APSM_OK;
}

static bool is_ignored(const char *text, size_t request)
{
    for (const char *at = text; *at;) {
        const size_t length = strcspn(at, ",");
        if (find_word(at, length) == request) return true;
        at += length + (at[length] == ',');
    }
    return false;
}

bool source_list_has(const char *list, const char *word)
{
    return is_ignored(list, find_word(word, strlen(word)));
}

bool source_ignores(const apsm_run *run, const char *word)
{
    return source_list_has(apsm_run_text(run, "ignore"), word);
}

static bool begins(const char *key, const char *prefix)
{
    return strncmp(key, prefix, strlen(prefix)) == 0;
}

static bool is_other_input(const apsm_project *p, const char *key)
{
    static const char *const prefixes[] = { "shape_", "segmentation_", "mesh_", "contour_" };
    for (size_t k = 0; k < sizeof prefixes / sizeof *prefixes; k++)
        if (begins(key, prefixes[k])) return strcmp(key + strlen(prefixes[k]), p->domain) != 0;
    return false;
}

/* Adds what one row asks for to the counts. */
static void count_row(const apsm_project *p, const apsm_subject *s, size_t count[REQUESTS])
{
    bool constrained = false, other = false;
    const char *key;
    json_t *value;
    json_object_foreach(s->row, key, value)
    {
        const char *text = json_string_value(value);
        if (!text || !*text) continue;
        constrained = constrained || begins(key, "constraints_");
        other = other || is_other_input(p, key);
    }
    count[CONSTRAINTS] += constrained;
    count[DOMAINS] += other;
    count[FIXED] += source_is_fixed(p, s);
}

static bool says(const json_t *pairs, const char *key)
{
    const json_t *value = json_object_get(pairs, key);
    return json_is_true(value) || json_integer_value(value) != 0 ||
           apsm_says_yes(json_string_value(value));
}

/* The value of a key of a group, or of the group's part for the domain. */
static bool group_says(const apsm_project *p, const char *group, const char *key)
{
    const json_t *pairs = json_object_get(p->root, group);
    return says(json_object_get(pairs, key) ? pairs : json_object_get(pairs, p->domain), key);
}

/* ---- rows that are chosen by a column ---- */

/* Whether the row has the choice in the column that these keys name. */
static bool is_chosen(const json_t *pairs, const char *column, const char *choice,
                      const apsm_subject *s)
{
    const char *key = json_string_value(json_object_get(pairs, column)),
               *want = json_string_value(json_object_get(pairs, choice));
    const char *has = key && *key ? apsm_subject_column(s, key) : NULL;
    return has && want && strcmp(has, want) == 0;
}

bool source_is_fixed(const apsm_project *p, const apsm_subject *s)
{
    const json_t *optimize = json_object_get(p->root, "optimize");
    const char *column = json_string_value(json_object_get(optimize, "fixed_subjects_column"));
    if (!says(optimize, "use_fixed_subjects") || !column || !*column)
        return apsm_says_yes(apsm_subject_column(s, "fixed"));
    return is_chosen(optimize, "fixed_subjects_column", "fixed_subjects_choice", s);
}

/* What of groom speaks of reflection: groom itself for at = 0, then its parts for the domains;
 * NULL: there are no more. */
static const json_t *reflecting(const apsm_project *p, size_t at)
{
    const json_t *groom = json_object_get(p->root, "groom");
    const char *key;
    json_t *value;
    size_t k = 0;
    if (at == 0) return groom;
    json_object_foreach((json_t *)groom, key, value)
    {
        if (json_is_object(value) && ++k == at) return value;
    }
    return NULL;
}

/* A subject that is reflected is so as a whole: in all of its domains if one asks for it. */
static bool is_reflected(const apsm_project *p, const apsm_subject *s)
{
    const json_t *pairs;
    for (size_t k = 0; (pairs = reflecting(p, k)); k++)
        if (says(pairs, "reflect") && is_chosen(pairs, "reflect_column", "reflect_choice", s))
            return true;
    return false;
}

static bool has_column(const apsm_project *p, const char *key)
{
    for (size_t i = 0; key && i < p->n; i++)
        if (apsm_subject_column(&p->subjects[i], key)) return true;
    return false;
}

/* Whether reflections are asked for that differ from ours, or cannot be told. */
static bool reflects_otherwise(const apsm_project *p)
{
    const json_t *pairs;
    for (size_t k = 0; (pairs = reflecting(p, k)); k++) {
        const char *axis = json_string_value(json_object_get(pairs, "reflect_axis"));
        if (!says(pairs, "reflect")) continue;
        if (axis && *axis && strcmp(axis, "X") != 0 && strcmp(axis, "x") != 0) return true;
        if (!has_column(p, json_string_value(json_object_get(pairs, "reflect_column"))))
            return true;
    }
    return false;
}

bool source_wants_landmarks(const apsm_project *source)
{
    return group_says(source, "optimize", "use_landmarks");
}

double source_normals(const apsm_project *source)
{
    static const double usual = 0.5; /* of ShapeWorks */
    double weight;
    const char *text = apsm_project_get(source, "optimize", "normals_strength");
    if (!group_says(source, "optimize", "use_normals")) return 0;
    return text && apsm_parse_number(text, strlen(text), &weight) && weight > 0 ? fmin(weight, 1e3)
                                                                                : usual;
}

const char *source_field(const apsm_project *source, size_t k, size_t *length)
{
    static const char between[] = " ,;";
    const char *at = apsm_project_get(source, "optimize", "field_attributes");
    for (size_t i = 0; at && *(at += strspn(at, between)); i++) {
        *length = strcspn(at, between);
        if (i == k) return at;
        at += *length;
    }
    return NULL;
}

static bool has_landmarks(const apsm_project *p)
{
    char key[APSM_KEY_LENGTH];
    apsm_project_key(p, "landmarks_file_", key);
    for (size_t i = 0; i < p->n; i++) {
        const char *path = apsm_subject_column(&p->subjects[i], key);
        if (path && *path) return true;
    }
    return false;
}

static void count_requests(const apsm_project *p, const char *domain, size_t count[REQUESTS])
{
    for (size_t i = 0; i < p->n; i++) count_row(p, &p->subjects[i], count);
    count[LANDMARKS] += source_wants_landmarks(p) && !has_landmarks(p);
    if (*domain) count[DOMAINS] = 0; /* one was chosen */
    count[REFLECT] += reflects_otherwise(p);
    count[GEODESICS] += group_says(p, "optimize", "use_geodesics_to_landmarks");
    count[SHARED] += group_says(p, "groom", "shared_boundary");
}

/* What is followed unless option ignore names it. */
static void count_ignored(const apsm_project *p, const char *ignore, size_t count[REQUESTS])
{
    size_t length;
    if (is_ignored(ignore, FIELDS)) count[FIELDS] += source_field(p, 0, &length) != NULL;
    for (size_t i = 0; i < p->n && is_ignored(ignore, REFLECT); i++)
        count[REFLECT] += is_reflected(p, &p->subjects[i]);
}

/* text grows by "; words", or by the words alone. */
static void add(char *text, size_t room, const char *between, const char *words)
{
    const size_t used = strlen(text);
    snprintf(text + used, room - used, "%s%s", used ? between : "", words);
}

static void tell_fixed(const apsm_run *run, const apsm_project *p)
{
    bool any = !says(json_object_get(p->root, "optimize"), "use_fixed_subjects");
    for (size_t i = 0; i < p->n && !any; i++) any = source_is_fixed(p, &p->subjects[i]);
    if (any || source_ignores(run, "fixed")) return;
    const char *column = apsm_project_get(p, "optimize", "fixed_subjects_column"),
               *choice = apsm_project_get(p, "optimize", "fixed_subjects_choice");
    apsm_log(
        run->ctx, APSM_LOG_WARNING,
        "the project asks for fixed shapes (optimize.use_fixed_subjects), but none has '%s' in "
        "column '%s'; nothing is fixed",
        choice ? choice : "yes", column ? column : "fixed");
}

/* A wish that is not taken over, but said. */
static void tell_particles(const apsm_run *run, const apsm_project *source)
{
    const char *wish = apsm_project_get(source, "optimize", "number_of_particles");
    const bool own = apsm_project_count(source, "apsm") > 0;
    const long J = wish ? strtol(wish, NULL, 10) : 0;
    if (J > 0 && !own && !run->options.optimize.search.particles_auto &&
        J != run->options.optimize.particles)
        apsm_log(run->ctx, APSM_LOG_INFO,
                 "the project's number_of_particles is %ld, here it is %ld: -J %ld takes as many",
                 J, run->options.optimize.particles, J);
}

apsm_status source_check(apsm_run *run, const apsm_project *source, char **ignored)
{
    size_t count[REQUESTS] = { 0 };
    char asked[640] = "", words[96] = "", left[640] = "";
    const char *ignore = apsm_run_text(run, "ignore");
    APSM_TRY(apsm_run_check_ignore(run->ctx, ignore));
    count_ignored(source, ignore, count);
    count_requests(source, apsm_run_text(run, "domain"), count);
    if (*apsm_run_text(run, "landmarks")) count[LANDMARKS] = 0; /* given otherwise */
    for (size_t k = 0; k < REQUESTS; k++) {
        const bool is = is_ignored(ignore, k);
        if (count[k] == 0 || ((k == CONSTRAINTS || k == FIXED) && !is)) continue; /* followed */
        add(is ? left : asked, sizeof left, "; ", requests[k].what);
        if (!is) add(words, sizeof words, ",", requests[k].word);
    }
    *ignored = NULL;
    if (*words)
        return apsm_fail(run->ctx, APSM_ERR_UNSUPPORTED,
                         "the project asks for what is not done here: %s; go on without by "
                         "--ignore %s%s%s",
                         asked, ignore, *ignore ? "," : "", words);
    tell_particles(run, source);
    tell_fixed(run, source);
    if (!*left) return APSM_OK;
    apsm_log(run->ctx, APSM_LOG_WARNING, "ignored, as asked for by --ignore: %s", left);
    *ignored = strdup(left);
    return *ignored ? APSM_OK : APSM_ERR_MEMORY;
}

/* ---- reading ---- */

static apsm_status check_domain(apsm_run *run, const char *domain, apsm_project *source)
{
    const char *name, *first = apsm_project_domain_name(source, 0);
    for (size_t k = 0; (name = apsm_project_domain_name(source, k)); k++)
        if (strcmp(name, domain) == 0) return APSM_OK;
    const apsm_status status =
        apsm_fail(run->ctx, APSM_ERR_ARG, "%s: has no domain '%s'; the first is '%s'",
                  run->inputs[0], domain, first ? first : "");
    apsm_project_free(source);
    return status;
}

apsm_status source_read(apsm_run *run, apsm_project *source, bool *own)
{
    *source = (apsm_project){ 0 };
    *own = run->n_inputs == 0;
    if (*own) return APSM_OK;
    const char *domain = apsm_run_text(run, "domain");
    if (run->n_inputs > 1 || !apsm_is_project_file(run->inputs[0])) {
        if (!*domain) return APSM_OK;
        return apsm_fail(run->ctx, APSM_ERR_ARG,
                         "--domain %s: only a project has domains; give one, or leave the option "
                         "out",
                         domain);
    }
    if (!*domain) return apsm_project_read(run->ctx, run->inputs[0], source);
    APSM_TRY(apsm_project_read_domain(run->ctx, run->inputs[0], domain, source));
    return check_domain(run, domain, source);
}

/* The project as it was given. */
static const char *shown(const apsm_run *run, const apsm_project *p)
{
    return run->n_inputs > 0 ? run->inputs[0] : p->folder;
}

static apsm_status no_shape(apsm_run *run, const apsm_project *p, size_t i)
{
    char key[APSM_KEY_LENGTH];
    const apsm_subject *s = &p->subjects[i];
    const char *contour = apsm_subject_column(s, apsm_project_key(p, "contour_", key));
    if (contour)
        return apsm_fail(run->ctx, APSM_ERR_UNSUPPORTED,
                         "%s: %s is a contour (%s), which `apsm run` alone takes, by itself",
                         shown(run, p), s->name, contour);
    return apsm_fail(run->ctx, APSM_ERR_STATE,
                     "%s: shape %zu (%s) names no input; give it a shape_%s, or take it out",
                     shown(run, p), i + 1, s->name, p->domain);
}

/* Where one of several domains was chosen, a subject that has others misses it. */
static bool misses_domain(const apsm_run *run, const apsm_project *p, size_t i)
{
    const char *key;
    json_t *value;
    if (!*apsm_run_text(run, "domain")) return false;
    json_object_foreach(p->subjects[i].row, key, value)
    {
        const char *text = json_string_value(value);
        if (text && *text && is_other_input(p, key)) return true;
    }
    return false;
}

static apsm_status list_paths(apsm_run *run, const apsm_project *p, const char **names,
                              char **paths, size_t *n)
{
    *n = 0;
    for (size_t i = 0; i < p->n; i++) {
        const apsm_subject *s = &p->subjects[i];
        if (!s->shape && misses_domain(run, p, i)) {
            apsm_log(run->ctx, APSM_LOG_WARNING, "%s: has no %s; it is left out", s->name,
                     p->domain);
            continue;
        }
        if (!s->shape) return no_shape(run, p, i);
        names[*n] = s->name;
        paths[*n] = apsm_project_path(p, s->shape);
        if (!paths[(*n)++]) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

static void reflect_rows(const apsm_project *p, apsm_input_list *list)
{
    for (size_t i = 0; i < list->n; i++) {
        const size_t k = apsm_project_find(p, list->cases[i].name);
        if (k < p->n && is_reflected(p, &p->subjects[k])) list->cases[i].reflect = true;
    }
}

apsm_status source_list(apsm_run *run, const apsm_project *p, apsm_input_list *list)
{
    const char **names = calloc(p->n + 1, sizeof *names);
    char **paths = calloc(p->n + 1, sizeof *paths);
    size_t n = 0;
    apsm_status status = names && paths ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK && p->n == 0)
        status =
            run->n_inputs > 0
                ? apsm_fail(run->ctx, APSM_ERR_FORMAT,
                            "%s: names no shapes, or all are excluded; add rows to its data",
                            run->inputs[0])
                : apsm_fail(run->ctx, APSM_ERR_ARG, "no inputs: give a folder, files or a project");
    if (status == APSM_OK) status = list_paths(run, p, names, paths, &n);
    const apsm_input_choice choice = { .n = n,
                                       .inputs = (const char *const *)paths,
                                       .names = names,
                                       .exclude = apsm_run_text(run, "exclude"),
                                       .reflect_match = apsm_run_text(run, "reflect_match") };
    if (status == APSM_OK) status = apsm_input_choose(run->ctx, &choice, list);
    if (status == APSM_OK && !source_ignores(run, "reflect")) reflect_rows(p, list);
    for (size_t i = 0; paths && i < p->n; i++) free(paths[i]);
    free(paths);
    free(names);
    return status;
}

/* ---- keeping ---- */

/* All groups of the source but ours, in its order, and the run's options. */
static json_t *merged_root(const apsm_project *source, const json_t *options)
{
    json_t *root = json_deep_copy(source->root);
    if (root) json_object_del(root, "apsm");
    if (root && options && json_object_set(root, "apsm", (json_t *)options) == 0) return root;
    json_decref(root);
    return NULL;
}

apsm_status source_begin(apsm_run *run, apsm_project *source)
{
    apsm_project *p = &run->project;
    APSM_TRY(apsm_project_rebase(source, run->folder));
    json_t *root = merged_root(source, json_object_get(p->root, "apsm"));
    if (!root) return APSM_ERR_MEMORY;
    json_decref(p->root);
    p->root = root;
    json_decref(p->aside);
    p->aside = json_incref(source->aside);
    return apsm_text_set(&p->domain, source->domain);
}

static bool is_made_by_a_run(const apsm_project *p, const char *key)
{
    char own[APSM_KEY_LENGTH];
    for (size_t k = 0; k < APSM_COLUMNS; k++)
        if (strcmp(key, apsm_project_key(p, apsm_project_columns[k], own)) == 0) return true;
    return strcmp(key, "mirrored") == 0 || strcmp(key, "reflection") == 0 ||
           strcmp(key, "fixed_particles") == 0;
}

apsm_status source_take_row(const apsm_project *source, apsm_subject *subject)
{
    const size_t i = apsm_project_find(source, subject->name);
    if (i == source->n) return APSM_OK;
    json_t *row = json_deep_copy(source->subjects[i].row), *value;
    const char *key;
    void *next;
    if (!row) return APSM_ERR_MEMORY;
    json_object_foreach_safe(row, next, key, value)
    {
        if (is_made_by_a_run(source, key)) json_object_del(row, key);
    }
    json_decref(subject->row);
    subject->row = row;
    return APSM_OK;
}
