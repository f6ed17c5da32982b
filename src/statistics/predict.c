/* `apsm predict`: a column from the shape, and the shape for values of the column. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/formats.h"
#include "apsm/statistics.h"
#include "core/number.h"
#include "core/random.h"
#include "core/sized.h"
#include "files/files.h"
#include "folder/model_folder.h"
#include "folder/names.h"
#include "model/warp.h"
#include "statistics/classify.h"
#include "statistics/particle_files.h"
#include "statistics/results.h"
#include "statistics/ridge.h"
#include "statistics/table.h"

#define FORMAT_PREDICTION "apsm-prediction"
enum { PREDICT_VERSION = 1, FOLDS = 10, LEAST = 10, DRAWS = 1000, VALUES_MOST = 64 };

typedef struct predicting {
    apsm_context *ctx;
    const apsm_predict_settings *s;
    model_folder m;
    apsm_table table;
    particle_files files;
    const apsm_column *of;
    size_t N, V, *row; /* subjects whose value is known */
    double *X, *y;     /* N x V, N */
    double *left_out;  /* N: by models without them */
    ridge model;
    double *pattern; /* V: change of the shape with the column, per unit */
    double r2, r2_low, r2_high, rmse, mae, correlation, auc, half; /* half: of a 95 % interval */
    size_t values;
    double at[VALUES_MOST];
    char name[200], csv[240]; /* of the files */
} predicting;

/* ---- what is given ---- */

static apsm_status find_column(predicting *w)
{
    w->of = apsm_table_find(&w->table, w->s->of);
    if (!w->of)
        return apsm_fail(w->ctx, APSM_ERR_ARG,
                         "--of '%s': the table of subjects has no such column; give --subjects, or "
                         "another name",
                         w->s->of);
    APSM_TRY(apsm_column_check(w->ctx, w->table.I, w->of));
    if (!w->of->category || w->of->levels == 2) return APSM_OK;
    return apsm_fail(w->ctx, APSM_ERR_ARG,
                     "--of '%s': is a column of %zu words; numbers and two groups can be predicted",
                     w->s->of, w->of->levels);
}

/* "40,60.5" */
static apsm_status take_values(predicting *w)
{
    for (const char *at = w->s->at; at && *at;) {
        const size_t length = strcspn(at, ",");
        if (w->values == VALUES_MOST || !apsm_parse_number(at, length, &w->at[w->values]) ||
            !isfinite(w->at[w->values]))
            return apsm_fail(w->ctx, APSM_ERR_ARG,
                             "--at '%s': give numbers with commas between, %d at most", w->s->at,
                             VALUES_MOST);
        w->values++;
        at += length;
        if (*at == ',') at++;
    }
    return APSM_OK;
}

static void mesh_name(const predicting *w, size_t k, size_t size, char *name)
{
    char number[APSM_NUMBER_LENGTH];
    apsm_format_number(w->at[k], number);
    snprintf(name, size, "%s_at_%s.ply", w->name, number);
}

static apsm_status claim_files(predicting *w)
{
    char mesh[VALUES_MOST][300];
    const char *names[VALUES_MOST + 1] = { w->csv };
    snprintf(w->name, sizeof w->name, "%.120s_prediction", w->s->of);
    results_plain_name(w->name);
    snprintf(w->csv, sizeof w->csv, "%s.csv", w->name);
    char json[240], *folder = results_folder(w->s->folder, w->s->out);
    snprintf(json, sizeof json, "%s.json", w->name);
    for (size_t k = 0; k < w->values; k++) {
        mesh_name(w, k, sizeof mesh[k], mesh[k]);
        names[k + 1] = mesh[k];
    }
    const apsm_status status =
        folder ? results_claim(w->ctx, folder, json, FORMAT_PREDICTION, w->values + 1, names)
               : APSM_ERR_MEMORY;
    free(folder);
    return status;
}

static apsm_status read_all(predicting *w)
{
    const apsm_predict_settings *s = w->s;
    if (!s->folder || !s->of || !*s->of)
        return apsm_fail(w->ctx, APSM_ERR_ARG, "predict: no column; say which by --of");
    APSM_TRY(take_values(w));
    APSM_TRY(claim_files(w));
    APSM_TRY(model_folder_read(w->ctx, s->folder, FOLDER_ALL, &w->m));
    APSM_TRY(
        apsm_table_gather(w->ctx, s->folder, s->subjects, &w->m.project, w->m.names, &w->table));
    APSM_TRY(find_column(w));
    return particle_files_read(w->ctx, s->n_files, s->files, &w->m, &w->files);
}

static apsm_status take_rows(predicting *w)
{
    const size_t I = w->m.I;
    w->V = 3 * w->m.J;
    w->row = malloc((I + 1) * sizeof *w->row);
    w->X = malloc((I * w->V + 1) * sizeof *w->X);
    w->y = malloc((2 * I + 1) * sizeof *w->y);
    w->pattern = calloc(w->V + 1, sizeof *w->pattern);
    if (!w->row || !w->X || !w->y || !w->pattern) return APSM_ERR_MEMORY;
    w->left_out = w->y + I;
    for (size_t i = 0; i < I; i++) {
        if (isnan(w->of->value[i])) continue;
        w->row[w->N] = i;
        w->y[w->N] = w->of->value[i];
        memcpy(w->X + w->N++ * w->V, w->m.P + i * w->V, w->V * sizeof *w->X);
    }
    if (w->N >= LEAST) return APSM_OK;
    return apsm_fail(w->ctx, APSM_ERR_ARG,
                     "--of '%s': is known of %zu shapes; %d are needed to learn from", w->s->of,
                     w->N, LEAST);
}

/* ---- figures ---- */

static double share_explained(size_t N, const double *y, const double *p, const size_t *draw)
{
    double mean = 0, left = 0, all = 0;
    for (size_t k = 0; k < N; k++) mean += y[draw ? draw[k] : k] / (double)N;
    for (size_t k = 0; k < N; k++) {
        const size_t i = draw ? draw[k] : k;
        left += (y[i] - p[i]) * (y[i] - p[i]);
        all += (y[i] - mean) * (y[i] - mean);
    }
    return all > 0 ? 1 - left / all : NAN;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* 95 % percentile interval of the share explained, subjects drawn again. */
static apsm_status bootstrap(predicting *w)
{
    double *r2 = malloc(DRAWS * sizeof *r2);
    size_t *draw = malloc(w->N * sizeof *draw), n = 0;
    for (size_t b = 0; r2 && draw && b < DRAWS; b++) {
        apsm_random rng =
            apsm_random_stream(apsm_context_seed(w->ctx), APSM_STREAM_BOOTSTRAP, b, 3);
        for (size_t k = 0; k < w->N; k++) draw[k] = (size_t)apsm_random_below(&rng, w->N);
        r2[n] = share_explained(w->N, w->y, w->left_out, draw);
        if (!isnan(r2[n])) n++;
    }
    if (n > 0) {
        qsort(r2, n, sizeof *r2, ascending);
        w->r2_low = r2[(size_t)(0.025 * (double)(n - 1))];
        w->r2_high = r2[(size_t)(0.975 * (double)(n - 1))];
    }
    const apsm_status status = r2 && draw ? APSM_OK : APSM_ERR_MEMORY;
    free(r2);
    free(draw);
    return status;
}

/* Area under the ROC curve of two groups, told from 0 and 1. */
static apsm_status area_under_curve(predicting *w)
{
    apsm_classification c = { 0 };
    size_t *group = malloc(w->N * sizeof *group);
    if (!group) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < w->N; i++) group[i] = w->y[i] > 0.5;
    apsm_judge_scores(w->N, group, w->left_out, 0.5, &c);
    free(group);
    w->auc = c.auc;
    return APSM_OK;
}

/* Half width of the interval that holds a new shape's value with 95 % probability, whatever the
 * errors' distribution (split conformal); INFINITY if there are too few shapes to tell. */
static double half_width(const predicting *w, double *error)
{
    const size_t rank = (size_t)ceil(0.95 * (double)(w->N + 1));
    for (size_t i = 0; i < w->N; i++) error[i] = fabs(w->y[i] - w->left_out[i]);
    qsort(error, w->N, sizeof *error, ascending);
    return rank <= w->N ? error[rank - 1] : INFINITY;
}

static apsm_status sum_up(predicting *w)
{
    double sy = 0, sp = 0, syy = 0, spp = 0, syp = 0;
    const double N = (double)w->N;
    double *error = malloc(w->N * sizeof *error);
    if (!error) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < w->N; i++) {
        const double y = w->y[i], p = w->left_out[i];
        sy += y, sp += p, syy += y * y, spp += p * p, syp += y * p;
        w->rmse += (y - p) * (y - p) / N;
        w->mae += fabs(y - p) / N;
    }
    const double covariance = syp - sy * sp / N, a = syy - sy * sy / N, b = spp - sp * sp / N;
    w->rmse = sqrt(w->rmse);
    w->correlation = a > 0 && b > 0 ? covariance / sqrt(a * b) : NAN;
    w->r2 = share_explained(w->N, w->y, w->left_out, NULL);
    w->auc = NAN;
    w->half = half_width(w, error);
    free(error);
    if (w->of->category) APSM_TRY(area_under_curve(w));
    return bootstrap(w);
}

/* Least squares of the shape on the column. */
static void make_pattern(predicting *w)
{
    double mean = 0, squares = 0;
    for (size_t i = 0; i < w->N; i++) mean += w->y[i] / (double)w->N;
    for (size_t i = 0; i < w->N; i++) squares += (w->y[i] - mean) * (w->y[i] - mean);
    for (size_t i = 0; i < w->N; i++)
        for (size_t v = 0; v < w->V; v++)
            w->pattern[v] += (w->y[i] - mean) * (w->X[i * w->V + v] - w->model.x_mean[v]) / squares;
}

static apsm_status learn(predicting *w)
{
    for (size_t i = 1; i < w->N; i++) {
        if (w->y[i] == w->y[0]) continue;
        APSM_TRY(ridge_cross_validate(w->ctx, w->N, w->V, w->X, w->y, FOLDS, w->left_out));
        APSM_TRY(ridge_fit(w->ctx, w->N, w->V, w->X, w->y, &w->model));
        make_pattern(w);
        return sum_up(w);
    }
    return apsm_fail(w->ctx, APSM_ERR_ARG, "--of '%s': is the same for all shapes", w->s->of);
}

/* ---- results ---- */

static json_t *json_value(const predicting *w, double y)
{
    return w->of->category ? json_string(w->of->level[y > 0.5]) : json_real(y);
}

static json_t *json_subjects(const predicting *w)
{
    json_t *rows = json_array();
    for (size_t i = 0; i < w->N; i++)
        json_array_append_new(rows,
                              json_pack("{s:s, s:o, s:f}", "name", w->m.names[w->row[i]], "value",
                                        json_value(w, w->y[i]), "predicted", w->left_out[i]));
    return rows;
}

static json_t *json_new(const predicting *w)
{
    json_t *rows = json_array();
    for (size_t k = 0; k < w->files.n; k++) {
        const double p = ridge_predict(&w->model, w->files.P + k * w->V);
        json_array_append_new(
            rows,
            json_pack("{s:s, s:f, s:o, s:[o, o], s:O?}", "name", w->files.name[k], "predicted", p,
                      "value", json_value(w, p), "interval", apsm_json_number_or_null(p - w->half),
                      apsm_json_number_or_null(p + w->half), "note", w->files.note[k]));
    }
    return rows;
}

static json_t *json_names(const predicting *w, bool known)
{
    json_t *names = json_array();
    for (size_t i = 0; i < w->m.I; i++) {
        const bool is_known = !isnan(w->of->value[i]);
        if (known ? is_known && !model_folder_is_certified(&w->m, i) : !is_known)
            json_array_append_new(names, json_string(w->m.names[i]));
    }
    return names;
}

static json_t *json_result(const predicting *w, const char *sha256)
{
    json_t *levels = json_array();
    for (size_t k = 0; k < w->of->levels && w->of->category; k++)
        json_array_append_new(levels, json_string(w->of->level[k]));
    json_t *root = json_pack(
        "{s:s, s:i, s:s, s:s, s:o, s:I, s:I, s:f, s:f, s:[f, f], s:f, s:f, s:o, s:o, s:o}",
        "format", FORMAT_PREDICTION, "version", PREDICT_VERSION, "model_sha256", sha256, "of",
        w->s->of, "levels", levels, "subjects", (json_int_t)w->N, "folds",
        (json_int_t)(w->N < FOLDS ? w->N : FOLDS), "mean", w->model.y_mean, "share_explained",
        w->r2, "share_interval", w->r2_low, w->r2_high, "root_mean_square_error", w->rmse,
        "mean_absolute_error", w->mae, "correlation", apsm_json_number_or_null(w->correlation),
        "auc", apsm_json_number_or_null(w->auc), "half_width", apsm_json_number_or_null(w->half));
    if (!root) return NULL;
    json_object_set_new(root, "penalty", json_real(w->model.lambda));
    json_object_set_new(root, "left_out", json_names(w, false));
    json_object_set_new(root, "not_certified", json_names(w, true));
    json_object_set_new(root, "per_subject", json_subjects(w));
    json_object_set_new(root, "new", json_new(w));
    json_object_set_new(root, "pattern", apsm_json_matrix(w->m.J, 3, w->pattern));
    return root;
}

/* note: of a new shape; else NULL. */
static void put_row(const predicting *w, apsm_writer *csv, const char *name, double value,
                    double predicted, const char *note)
{
    const bool is_new = note != NULL;
    apsm_writer_csv(csv, name);
    apsm_writer_printf(csv, ",%s,", is_new ? "new" : "left out");
    if (!is_new && w->of->category)
        apsm_writer_csv(csv, w->of->level[value > 0.5]);
    else if (!is_new)
        apsm_writer_number(csv, value);
    apsm_writer_printf(csv, ",");
    apsm_writer_number(csv, predicted);
    for (int side = -1; side <= 1; side += 2) {
        apsm_writer_printf(csv, ",");
        if (is_new && isfinite(w->half)) apsm_writer_number(csv, predicted + side * w->half);
    }
    apsm_writer_printf(csv, ",");
    if (is_new) apsm_writer_csv(csv, note);
    apsm_writer_printf(csv, "\n");
}

static apsm_status write_csv(const predicting *w, const char *path)
{
    apsm_writer *csv = NULL;
    APSM_TRY(apsm_writer_open(w->ctx, path, &csv));
    apsm_writer_printf(csv, "name,how,value,predicted,low,high,note\n");
    for (size_t i = 0; i < w->N; i++)
        put_row(w, csv, w->m.names[w->row[i]], w->y[i], w->left_out[i], NULL);
    for (size_t k = 0; k < w->files.n; k++)
        put_row(w, csv, w->files.name[k], 0, ridge_predict(&w->model, w->files.P + k * w->V),
                particle_files_note_text(&w->files, k));
    return apsm_writer_commit(csv);
}

/* The shape that is to be expected for each value of --at. */
static apsm_status write_meshes(const predicting *w, const char *folder)
{
    apsm_mesh mesh = { 0 };
    apsm_warp warp = { 0 };
    double *p = malloc(w->V * sizeof *p);
    const double *T = w->m.P + w->m.template_index * w->V;
    apsm_status status =
        p ? model_folder_mesh(w->ctx, &w->m, w->m.template_index, &mesh) : APSM_ERR_MEMORY;
    if (status == APSM_OK)
        status = apsm_warp_build(w->ctx, APSM_PHI_R, mesh.nv, mesh.V, w->m.J, T, &warp);
    for (size_t k = 0; k < w->values && status == APSM_OK; k++) {
        char name[300];
        mesh_name(w, k, sizeof name, name);
        for (size_t v = 0; v < w->V; v++)
            p[v] = w->model.x_mean[v] + (w->at[k] - w->model.y_mean) * w->pattern[v];
        apsm_warp_apply(&warp, p, mesh.V);
        char *path = apsm_path_join(folder, name);
        status = path ? apsm_write_mesh(w->ctx, path, &mesh) : APSM_ERR_MEMORY;
        free(path);
    }
    apsm_warp_free(&warp);
    apsm_mesh_free(&mesh);
    free(p);
    return status;
}

static apsm_status write_json(const predicting *w, const char *folder)
{
    char name[240], sha256[65];
    snprintf(name, sizeof name, "%s.json", w->name);
    char *path = apsm_path_join(folder, name), *model = model_folder_path(&w->m, FOLDER_MODEL);
    apsm_status status = path && model ? apsm_sha256_file(w->ctx, model, sha256) : APSM_ERR_MEMORY;
    json_t *root = status == APSM_OK ? json_result(w, sha256) : NULL;
    if (status == APSM_OK) status = apsm_json_write(w->ctx, path, root);
    if (status == APSM_OK) apsm_log(w->ctx, APSM_LOG_INFO, "written: %s", path);
    json_decref(root);
    free(path);
    free(model);
    return status;
}

static apsm_status write_results(const predicting *w)
{
    char *folder = results_folder(w->s->folder, w->s->out);
    char *csv = folder ? apsm_path_join(folder, w->csv) : NULL;
    apsm_status status = csv ? apsm_make_folder(w->ctx, folder) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = write_json(w, folder);
    if (status == APSM_OK) status = write_csv(w, csv);
    if (status == APSM_OK && w->values > 0) status = write_meshes(w, folder);
    free(csv);
    free(folder);
    return status;
}

static void tell_new(const predicting *w)
{
    for (size_t k = 0; k < w->files.n; k++) {
        const double p = ridge_predict(&w->model, w->files.P + k * w->V);
        if (w->of->category)
            apsm_log(w->ctx, APSM_LOG_INFO, "%s: looks like %s (%.2f; 0: %s, 1: %s)",
                     w->files.name[k], w->of->level[p > 0.5], p, w->of->level[0], w->of->level[1]);
        else if (isfinite(w->half))
            apsm_log(w->ctx, APSM_LOG_INFO, "%s: %s %.4g (95 %%: %.4g to %.4g)", w->files.name[k],
                     w->s->of, p, p - w->half, p + w->half);
        else
            apsm_log(w->ctx, APSM_LOG_INFO, "%s: %s %.4g (too few shapes for an interval)",
                     w->files.name[k], w->s->of, p);
    }
}

static void tell(const predicting *w)
{
    size_t uncertain = 0;
    for (size_t i = 0; i < w->N; i++) uncertain += !model_folder_is_certified(&w->m, w->row[i]);
    if (w->of->category)
        apsm_log(w->ctx, APSM_LOG_INFO,
                 "%s from shape, %zu subjects, cross-validated: area under the ROC curve %.2f",
                 w->s->of, w->N, w->auc);
    else
        apsm_log(w->ctx, APSM_LOG_INFO,
                 "%s from shape, %zu subjects, cross-validated: %.0f %% of its variance (95 %%: "
                 "%.0f to %.0f), mean error %.4g",
                 w->s->of, w->N, 100 * w->r2, 100 * w->r2_low, 100 * w->r2_high, w->mae);
    if (w->r2_low <= 0)
        apsm_log(w->ctx, APSM_LOG_WARNING,
                 "%s is not shown to be predictable from shape: the interval reaches zero",
                 w->s->of);
    tell_new(w);
    if (uncertain > 0)
        apsm_log(w->ctx, APSM_LOG_WARNING,
                 "%zu of the %zu shapes are not certified: look at them before you trust this",
                 uncertain, w->N);
}

static void predicting_free(predicting *w)
{
    free(w->row);
    free(w->X);
    free(w->y);
    free(w->pattern);
    ridge_free(&w->model);
    particle_files_free(&w->files);
    apsm_table_free(&w->table);
    model_folder_free(&w->m);
}

static apsm_status predict(apsm_context *ctx, const apsm_predict_settings *settings)
{
    if (!settings) return apsm_fail(ctx, APSM_ERR_ARG, "apsm_statistics_predict: no settings");
    predicting w = { .ctx = ctx, .s = settings };
    apsm_status status = read_all(&w);
    if (status == APSM_OK) status = take_rows(&w);
    if (status == APSM_OK) status = learn(&w);
    if (status == APSM_OK) status = write_results(&w);
    if (status == APSM_OK && settings->subjects && !settings->out)
        status = apsm_table_keep(ctx, settings->folder, settings->subjects, w.m.I, w.m.names);
    if (status == APSM_OK) tell(&w);
    predicting_free(&w);
    return status;
}

APSM_BY_SIZE(apsm_statistics_predict, apsm_predict_settings, predict)
