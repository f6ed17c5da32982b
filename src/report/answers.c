#include "report/answers.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "folder/names.h"
#include "statistics/table.h"

static json_t *json_column(const apsm_column *c, size_t I)
{
    json_t *levels = json_array(), *values = json_array();
    for (size_t k = 0; k < c->levels; k++) json_array_append_new(levels, json_string(c->level[k]));
    for (size_t i = 0; i < I; i++)
        json_array_append_new(values, apsm_json_number_or_null(c->value[i]));
    return json_pack("{s:s, s:b, s:o, s:o}", "name", c->name, "category", c->category, "levels",
                     levels, "values", values);
}

static apsm_status read_columns(apsm_context *ctx, const model_folder *m, json_t *columns)
{
    apsm_table table = { 0 };
    const apsm_status status = apsm_table_gather(ctx, m->path, NULL, &m->project, m->names, &table);
    for (size_t k = 0; status == APSM_OK && k < table.n; k++)
        json_array_append_new(columns, json_column(&table.column[k], m->I));
    apsm_table_free(&table);
    return status;
}

/* Results of `apsm test`, `apsm predict` and `apsm asymmetry`. */
typedef struct result_lists {
    json_t *tests, *predictions, *asymmetries;
} result_lists;

/* A result joins its list if it is of this model. */
static apsm_status take_result(apsm_context *ctx, const char *path, const char *model,
                               const result_lists *lists)
{
    json_t *root = NULL;
    const apsm_status status = apsm_json_read(ctx, path, &root);
    if (status == APSM_ERR_MEMORY) return status;
    if (status != APSM_OK)
        apsm_log(ctx, APSM_LOG_WARNING, "not in the report: %s", apsm_error_text(ctx));
    const char *format = json_string_value(json_object_get(root, "format"));
    const char *of = json_string_value(json_object_get(root, "model_sha256"));
    json_t *list = !format                                  ? NULL
                   : strcmp(format, "apsm-test") == 0       ? lists->tests
                   : strcmp(format, "apsm-prediction") == 0 ? lists->predictions
                   : strcmp(format, "apsm-asymmetry") == 0  ? lists->asymmetries
                                                            : NULL;
    if (list) {
        if (of && strcmp(of, model) == 0)
            json_array_append(list, root);
        else
            apsm_log(ctx, APSM_LOG_WARNING,
                     "%s: is of another model than the folder's now, and not in the report; run "
                     "apsm test or predict again",
                     path);
    }
    json_decref(root);
    return APSM_OK;
}

static bool is_json(const char *path)
{
    const size_t n = strlen(path);
    return n > 5 && strcmp(path + n - 5, ".json") == 0;
}

static apsm_status read_results(apsm_context *ctx, const model_folder *m, const char *folder,
                                const result_lists *lists)
{
    char model[65];
    apsm_file_list list = { 0 };
    char *path = model_folder_path(m, FOLDER_MODEL);
    apsm_status status = path ? apsm_sha256_file(ctx, path, model) : APSM_ERR_MEMORY;
    free(path);
    if (status == APSM_OK) status = apsm_list_files(ctx, folder, false, &list);
    for (size_t k = 0; status == APSM_OK && k < list.n; k++) {
        if (!is_json(list.path[k])) continue;
        path = apsm_path_join(folder, list.path[k]);
        status = path ? take_result(ctx, path, model, lists) : APSM_ERR_MEMORY;
        free(path);
    }
    apsm_file_list_free(&list);
    return status;
}

apsm_status answers_read(apsm_context *ctx, const model_folder *m, json_t **answers)
{
    *answers = NULL;
    char *folder = model_folder_path(m, "statistics");
    json_t *columns = json_array();
    const result_lists lists = { json_array(), json_array(), json_array() };
    apsm_status status = folder && columns && lists.tests && lists.predictions && lists.asymmetries
                             ? APSM_OK
                             : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = read_columns(ctx, m, columns);
    if (status == APSM_OK && apsm_is_folder(folder)) status = read_results(ctx, m, folder, &lists);
    if (status == APSM_OK && json_array_size(columns) + json_array_size(lists.tests) +
                                     json_array_size(lists.predictions) +
                                     json_array_size(lists.asymmetries) >
                                 0)
        *answers = json_pack("{s:O, s:O, s:O, s:O}", "columns", columns, "tests", lists.tests,
                             "predictions", lists.predictions, "asymmetries", lists.asymmetries);
    json_decref(columns);
    json_decref(lists.tests);
    json_decref(lists.predictions);
    json_decref(lists.asymmetries);
    free(folder);
    return status;
}
