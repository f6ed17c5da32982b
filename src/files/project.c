/* Projects in memory. */
#define _DEFAULT_SOURCE /* strcasecmp */
#include "files/project.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "files/io.h"
#include "files/project_columns.h"
#include "files/project_xml.h"
#include "files/sheets.h"

static bool has_extension(const char *path, const char *extension)
{
    const size_t length = strlen(path), end = strlen(extension);
    return length > end && strcasecmp(path + length - end, extension) == 0;
}

bool apsm_is_spreadsheet(const char *path)
{
    return has_extension(path, ".xlsx");
}

bool apsm_is_project_file(const char *path)
{
    return has_extension(path, ".swproj") || apsm_is_spreadsheet(path) ||
           apsm_is_parameter_file(path);
}

bool apsm_says_yes(const char *text)
{
    return text && (strcasecmp(text, "yes") == 0 || strcasecmp(text, "true") == 0 ||
                    strcmp(text, "1") == 0);
}

static void set_identity(double M[16])
{
    for (int i = 0; i < 16; i++) M[i] = i % 5 == 0;
}

apsm_status apsm_text_set(char **slot, const char *value)
{
    char *copy = value ? strdup(value) : NULL;
    if (value && !copy) return APSM_ERR_MEMORY;
    free(*slot);
    *slot = copy;
    return APSM_OK;
}

const char *const apsm_project_columns[APSM_COLUMNS] = { "groomed_", "local_particles_",
                                                         "world_particles_", "alignment_",
                                                         "procrustes_" };

const char *apsm_project_key(const apsm_project *project, const char *prefix,
                             char key[APSM_KEY_LENGTH])
{
    snprintf(key, APSM_KEY_LENGTH, "%s%s", prefix, project->domain);
    return key;
}

const char *apsm_project_input_key(const apsm_project *project, const json_t *row,
                                   char key[APSM_KEY_LENGTH])
{
    static const char *const prefixes[] = { "shape_", "segmentation_", "mesh_" };
    for (size_t i = 0; i < 3; i++)
        if (json_object_get(row, apsm_project_key(project, prefixes[i], key))) return key;
    return apsm_project_key(project, prefixes[0], key);
}

apsm_status apsm_project_init(apsm_context *ctx, const char *folder, apsm_project *project)
{
    *project = (apsm_project){ .folder = strdup(folder), .domain = strdup("1") };
    project->root =
        json_pack("{s:[], s:{}, s:{s:s}}", "data", "optimize", "project", "version", "2");
    if (project->folder && project->domain && project->root) return APSM_OK;
    apsm_project_free(project);
    return apsm_fail_errno(ctx, folder, "no project can be made", ENOMEM);
}

static void subject_free(apsm_subject *s)
{
    free(s->name);
    free(s->shape);
    free(s->groomed);
    free(s->local_particles);
    free(s->world_particles);
    json_decref(s->row);
}

void apsm_project_free(apsm_project *project)
{
    for (size_t i = 0; i < project->n; i++) subject_free(&project->subjects[i]);
    free(project->subjects);
    free(project->folder);
    free(project->domain);
    json_decref(project->root);
    json_decref(project->aside);
    *project = (apsm_project){ 0 };
}

/* A row whose keys stand in ShapeWorks' order; the values come when it is written. */
static json_t *blank_row(const apsm_project *project)
{
    char key[APSM_KEY_LENGTH];
    json_t *row = json_pack("{s:s, s:s}", "name", "", apsm_project_key(project, "shape_", key), "");
    for (size_t i = 0; row && i < APSM_COLUMNS; i++)
        if (json_object_set_new(row, apsm_project_key(project, apsm_project_columns[i], key),
                                json_string("")) != 0) {
            json_decref(row);
            row = NULL;
        }
    return row;
}

static apsm_status make_room(apsm_project *project)
{
    if (project->n < project->capacity) return APSM_OK;
    const size_t capacity = project->capacity ? 2 * project->capacity : 16;
    apsm_subject *larger = realloc(project->subjects, capacity * sizeof *larger);
    if (!larger) return APSM_ERR_MEMORY;
    project->subjects = larger;
    project->capacity = capacity;
    return APSM_OK;
}

apsm_status apsm_project_add(apsm_project *project, const char *name, const char *shape,
                             apsm_subject **added)
{
    APSM_TRY(make_room(project));
    apsm_subject s = { .row = blank_row(project) };
    set_identity(s.alignment);
    set_identity(s.procrustes);
    apsm_status status = s.row ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_text_set(&s.name, name);
    if (status == APSM_OK) status = apsm_text_set(&s.shape, shape);
    if (status != APSM_OK) {
        subject_free(&s);
        return status;
    }
    project->subjects[project->n] = s;
    if (added) *added = &project->subjects[project->n];
    project->n++;
    return APSM_OK;
}

void apsm_project_remove(apsm_project *project, size_t i)
{
    apsm_subject *s = &project->subjects[i];
    subject_free(s);
    memmove(s, s + 1, (--project->n - i) * sizeof *s);
}

size_t apsm_project_find(const apsm_project *project, const char *name)
{
    size_t i = 0;
    while (i < project->n && strcmp(project->subjects[i].name, name) != 0) i++;
    return i;
}

/* ---- Names ---- */

/* In place: what cannot stand in a file name becomes an underscore. */
static void make_safe(char *name)
{
    for (char *c = name; *c; c++)
        if (*c == '/' || *c == '\\' || (unsigned char)*c < ' ' || *c == 127) *c = '_';
    if (name[0] == '.') name[0] = '_';
}

/* A name for a subject without: the stem of the first file it has, or its number. */
static char *derived_name(const apsm_subject *s, size_t i)
{
    const char *path = s->shape ? s->shape : s->groomed ? s->groomed : s->local_particles;
    char text[32];
    snprintf(text, sizeof text, "shape_%zu", i + 1);
    return path ? apsm_path_stem(path) : strdup(text);
}

static bool taken(const apsm_project *project, size_t i, const char *name)
{
    for (size_t k = 0; k < i; k++)
        if (strcmp(project->subjects[k].name, name) == 0) return true;
    return false;
}

/* name or, if an earlier subject has it, name_2, name_3, ...; malloc'ed. */
static char *free_name(const apsm_project *project, size_t i, const char *name)
{
    const size_t length = strlen(name) + 24;
    char *candidate = malloc(length);
    if (!candidate) return NULL;
    snprintf(candidate, length, "%s", name);
    for (size_t k = 2; taken(project, i, candidate); k++)
        snprintf(candidate, length, "%s_%zu", name, k);
    return candidate;
}

static apsm_status fix_name(apsm_context *ctx, apsm_project *project, size_t i)
{
    apsm_subject *s = &project->subjects[i];
    const bool given = s->name && *s->name;
    char *name = given ? strdup(s->name) : derived_name(s, i);
    if (name) make_safe(name);
    char *unique = name ? free_name(project, i, name) : NULL;
    if (unique && given && strcmp(unique, s->name) != 0)
        apsm_log(ctx, APSM_LOG_WARNING, "shape '%s' is now called '%s': %s", s->name, unique,
                 strcmp(name, unique) ? "its name is taken" : "its name cannot be a file name");
    free(name);
    if (!unique) return APSM_ERR_MEMORY;
    free(s->name);
    s->name = unique;
    return APSM_OK;
}

apsm_status apsm_project_fix_names(apsm_context *ctx, apsm_project *project)
{
    for (size_t i = 0; i < project->n; i++) APSM_TRY(fix_name(ctx, project, i));
    return APSM_OK;
}

/* ---- Columns and groups ---- */

const char *apsm_subject_column(const apsm_subject *subject, const char *key)
{
    return json_string_value(json_object_get(subject->row, key));
}

apsm_status apsm_subject_set_column(apsm_subject *subject, const char *key, const char *value)
{
    if (!value) {
        json_object_del(subject->row, key);
        return APSM_OK;
    }
    json_t *text = json_string(value);
    if (!text) return APSM_ERR_ARG; /* not UTF-8, or out of memory */
    return json_object_set_new(subject->row, key, text) == 0 ? APSM_OK : APSM_ERR_MEMORY;
}

const char *apsm_project_get(const apsm_project *project, const char *group, const char *key)
{
    return json_string_value(json_object_get(json_object_get(project->root, group), key));
}

apsm_status apsm_project_set(apsm_project *project, const char *group, const char *key,
                             const char *value)
{
    json_t *pairs = json_object_get(project->root, group);
    if (!json_is_object(pairs)) {
        pairs = json_object();
        if (!pairs || json_object_set_new(project->root, group, pairs) != 0) return APSM_ERR_MEMORY;
    }
    json_t *text = json_string(value);
    if (!text) return APSM_ERR_ARG;
    return json_object_set_new(pairs, key, text) == 0 ? APSM_OK : APSM_ERR_MEMORY;
}

void apsm_project_clear(apsm_project *project, const char *group)
{
    json_object_del(project->root, group);
}

size_t apsm_project_count(const apsm_project *project, const char *group)
{
    return json_object_size(json_object_get(project->root, group));
}

void apsm_project_pair(const apsm_project *project, const char *group, size_t i, const char **key,
                       const char **value)
{
    json_t *pairs = json_object_get(project->root, group);
    void *at = json_object_iter(pairs);
    while (i-- > 0) at = json_object_iter_next(pairs, at);
    *key = json_object_iter_key(at);
    *value = json_string_value(json_object_iter_value(at));
}

/* ---- Paths ---- */

char *apsm_project_path(const apsm_project *project, const char *stored)
{
    return stored ? apsm_path_join(project->folder, stored) : NULL;
}

/* *moved (malloc'ed) <- the stored path as seen from the new folder; NULL: leave it as it is. */
static apsm_status move_path(const apsm_project *project, const char *folder, const char *stored,
                             char **moved)
{
    *moved = NULL;
    if (!stored || !*stored || stored[0] == '/') return APSM_OK;
    char *path = apsm_project_path(project, stored);
    if (path) *moved = apsm_path_relative(folder, path);
    free(path);
    return *moved ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status move_slot(const apsm_project *project, const char *folder, char **slot)
{
    char *moved;
    APSM_TRY(move_path(project, folder, *slot, &moved));
    if (!moved) return APSM_OK;
    free(*slot);
    *slot = moved;
    return APSM_OK;
}

bool apsm_project_is_path(const char *key, const char *text)
{
    static const char *const prefixes[] = {
        "shape_",   "segmentation_",    "mesh_",           "contour_",
        "groomed_", "landmarks_file_",  "constraints_",    "image_",
        "feature_", "local_particles_", "world_particles_"
    };
    for (size_t i = 0; i < sizeof prefixes / sizeof *prefixes; i++)
        if (strncmp(key, prefixes[i], strlen(prefixes[i])) == 0)
            return key[0] != 'c' || text[0] != '{'; /* constraints that stand here */
    return false;
}

static apsm_status move_row(const apsm_project *project, const char *folder, json_t *row)
{
    const char *key;
    json_t *value;
    json_object_foreach(row, key, value)
    {
        const char *text = json_string_value(value);
        if (!text || !apsm_project_is_path(key, text)) continue;
        char *moved;
        APSM_TRY(move_path(project, folder, text, &moved));
        if (!moved) continue;
        const int failed = json_string_set(value, moved);
        free(moved);
        if (failed) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

apsm_status apsm_project_rebase(apsm_project *project, const char *folder)
{
    for (size_t i = 0; i < project->n; i++) {
        apsm_subject *s = &project->subjects[i];
        APSM_TRY(move_slot(project, folder, &s->shape));
        APSM_TRY(move_slot(project, folder, &s->groomed));
        APSM_TRY(move_slot(project, folder, &s->local_particles));
        APSM_TRY(move_slot(project, folder, &s->world_particles));
        APSM_TRY(move_row(project, folder, s->row));
    }
    size_t k;
    json_t *pair;
    json_array_foreach(project->aside, k, pair)
    {
        APSM_TRY(move_row(project, folder, json_array_get(pair, 1)));
    }
    return apsm_text_set(&project->folder, folder);
}
