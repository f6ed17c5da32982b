/* `apsm asymmetry`: left and right of the same subjects, the one mirrored on the other.
 *
 * With x_sdr what replicate r of side d of subject s shows (particles, or a size), and the means of
 * cells, subjects, sides and all written with dots (Leamy 1984, Palmer & Strobeck 1986, for shapes
 * Klingenberg & McIntyre, Evolution 52, 1998):
 *   individuals    SS = 2 n sum_s  |x_s.. - x_...|^2                        df = S - 1
 *   directional    SS = S n sum_d  |x_.d. - x_...|^2                        df = 1
 *   fluctuating    SS = n sum_sd   |x_sd. - x_s.. - x_.d. + x_...|^2        df = S - 1
 *   error          SS = sum_sdr    |x_sdr - x_sd.|^2                        df = N - 2 S
 * each over its df a mean square.  Directional asymmetry is tested against fluctuating, on the
 * means of cells, by changing the sides of a subject; fluctuating against error, by dealing out a
 * subject's replicates after subject and side were allowed for. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/sized.h"
#include "files/files.h"
#include "statistics/group_test.h"
#include "statistics/results.h"

#define FORMAT_ASYMMETRY "apsm-asymmetry"
/* A 3 x 3 matrix of errors needs as many. */
enum { ASYMMETRY_VERSION = 1, LEAST_SUBJECTS = 5, LEAST_REPLICATES = 3 };

enum { INDIVIDUALS, DIRECTIONAL, FLUCTUATING, ERROR, SOURCES };
static const char *const source_names[SOURCES] = { "individuals", "directional", "fluctuating",
                                                   "error" };

typedef struct asymmetry {
    apsm_context *ctx;
    const apsm_test_settings *s; /* of: the sides; within: the subjects */
    size_t N, S, *cell;          /* shapes, subjects; N: 2 s + d of a shape */
    size_t *count;               /* 2 S: rows of a cell */
    size_t *first;               /* 2 S: the shape that stands for a cell */
    double replicates;           /* n above: harmonic mean of the counts */
    bool replicated;
    double *mean;          /* 2 S x width: of cells */
    double ss[SOURCES];    /* sums of squares */
    double df[SOURCES];    /* degrees of freedom, those of one number */
    double p[SOURCES];     /* NAN: not tested */
    double *amount, *left; /* S: root mean square difference of the sides; after the mean of these
                              was taken off */
    char level[2][64];     /* the sides */
} asymmetry;

/* ---- pairs ---- */

static apsm_status find_sides(const asymmetry *a, const group_test *t, double side[2])
{
    const apsm_column *c = apsm_table_find(&t->table, a->s->of);
    size_t n = 0;
    for (size_t k = 0; c && c->category && k < c->levels; k++)
        for (size_t i = 0; i < t->N; i++) {
            if (c->value[t->row[i]] != (double)k) continue;
            if (n < 2) side[n] = (double)k;
            n++;
            break;
        }
    if (n == 2) return APSM_OK;
    return apsm_fail(a->ctx, APSM_ERR_ARG,
                     "--of '%s': is no column with two sides, such as left and right%s", a->s->of,
                     c && !c->category ? "; it holds numbers, write words" : "");
}

/* cell (N) and count (2 S) <- of the rows. */
static apsm_status count_cells(asymmetry *a, const group_test *t, double second_side)
{
    const apsm_column *c = apsm_table_find(&t->table, a->s->of);
    size_t *subject = malloc((t->N + 1) * sizeof *subject);
    if (!subject) return APSM_ERR_MEMORY;
    number_rows(t->within, t->N, t->row, subject);
    memset(a->count, 0, (2 * t->N + 2) * sizeof *a->count);
    a->S = 0;
    for (size_t i = 0; i < t->N; i++) {
        a->cell[i] = 2 * subject[i] + (c->value[t->row[i]] == second_side);
        a->count[a->cell[i]]++;
        if (subject[i] + 1 > a->S) a->S = subject[i] + 1;
    }
    free(subject);
    return APSM_OK;
}

/* Rows whose subject has both sides stay. */
static void drop_single_sides(group_test *t, const size_t *cell, const size_t *count)
{
    size_t n = 0, before = t->N;
    for (size_t i = 0; i < before; i++) {
        if (count[cell[i]] > 0 && count[cell[i] ^ 1] > 0)
            t->row[n++] = t->row[i];
        else
            t->used[t->row[i]] = false;
    }
    t->N = n;
    if (n < before)
        apsm_log(t->ctx, APSM_LOG_WARNING,
                 "%zu shapes are left out: their subject lacks the other side", before - n);
}

static apsm_status make_cells(asymmetry *a, const group_test *t)
{
    a->cell = calloc(t->N + 1, sizeof *a->cell);
    a->count = calloc(2 * t->N + 2, sizeof *a->count);
    a->first = calloc(2 * t->N + 2, sizeof *a->first);
    return a->cell && a->count && a->first ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status pair(asymmetry *a, group_test *t)
{
    double side[2];
    APSM_TRY(find_sides(a, t, side));
    APSM_TRY(make_cells(a, t));
    APSM_TRY(count_cells(a, t, side[1]));
    drop_single_sides(t, a->cell, a->count);
    APSM_TRY(count_cells(a, t, side[1]));
    for (size_t i = t->N; i-- > 0;) a->first[a->cell[i]] = t->row[i];
    const apsm_column *c = apsm_table_find(&t->table, a->s->of);
    for (int d = 0; d < 2; d++)
        snprintf(a->level[d], sizeof a->level[d], "%.60s", c->level[(size_t)side[d]]);
    if (a->S < LEAST_SUBJECTS)
        return apsm_fail(a->ctx, APSM_ERR_ARG,
                         "%zu subjects have both sides; %d at least are needed", a->S,
                         (int)LEAST_SUBJECTS);
    a->N = t->N;
    a->replicated = a->N >= 2 * a->S + LEAST_REPLICATES;
    return APSM_OK;
}

/* Sides that were not mirrored differ by far more than any asymmetry. */
static void check_mirrored(const asymmetry *a, const group_test *t)
{
    size_t mirrored[2] = { 0, 0 }, n[2] = { 0, 0 };
    for (size_t i = 0; i < t->N; i++) {
        n[a->cell[i] % 2]++;
        mirrored[a->cell[i] % 2] += t->m.project.subjects[t->row[i]].mirrored;
    }
    for (int d = 0; d < 2; d++)
        if (mirrored[d] == n[d] && mirrored[!d] == 0) return;
    apsm_log(a->ctx, APSM_LOG_WARNING,
             "not one side alone was mirrored by apsm (%zu of %zu %s, %zu of %zu %s): what follows "
             "is right only if the inputs were mirrored before; else run again with "
             "--reflect-match",
             mirrored[0], n[0], a->level[0], mirrored[1], n[1], a->level[1]);
}

/* ---- sums of squares ---- */

/* mean (2 S x width) <- of the rows of each cell. */
static apsm_status average(asymmetry *a, const group_test *t, size_t width)
{
    double inverse = 0;
    a->mean = calloc(2 * a->S * width + 1, sizeof *a->mean);
    if (!a->mean) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < t->N; i++)
        for (size_t k = 0; k < width; k++)
            a->mean[a->cell[i] * width + k] += t->Y[i * width + k] / (double)a->count[a->cell[i]];
    for (size_t c = 0; c < 2 * a->S; c++) inverse += 1 / (double)a->count[c];
    a->replicates = 2 * (double)a->S / inverse;
    return APSM_OK;
}

/* Column k of the cells' means, by subject, side and both. */
static void add_squares(asymmetry *a, size_t width, size_t k)
{
    const double S = (double)a->S, n = a->replicates;
    double all = 0, side[2] = { 0, 0 };
    for (size_t c = 0; c < 2 * a->S; c++) {
        all += a->mean[c * width + k] / (2 * S);
        side[c % 2] += a->mean[c * width + k] / S;
    }
    for (int d = 0; d < 2; d++) a->ss[DIRECTIONAL] += S * n * (side[d] - all) * (side[d] - all);
    for (size_t s = 0; s < a->S; s++) {
        const double *x = a->mean + 2 * s * width + k;
        const double mean = 0.5 * (x[0] + x[width]);
        const double both = 0.5 * (x[0] - x[width] - side[0] + side[1]);
        a->ss[INDIVIDUALS] += 2 * n * (mean - all) * (mean - all);
        a->ss[FLUCTUATING] += 2 * n * both * both;
    }
}

static void squares(asymmetry *a, const group_test *t, size_t width)
{
    for (size_t k = 0; k < width; k++) add_squares(a, width, k);
    for (size_t i = 0; i < t->N; i++)
        for (size_t k = 0; k < width; k++) {
            const double x = t->Y[i * width + k] - a->mean[a->cell[i] * width + k];
            a->ss[ERROR] += x * x;
        }
    a->df[INDIVIDUALS] = a->df[FLUCTUATING] = (double)a->S - 1;
    a->df[DIRECTIONAL] = 1;
    a->df[ERROR] = (double)(t->N - 2 * a->S);
}

/* Of every subject, how far its sides are apart: root mean square over the variables. */
static apsm_status measure_subjects(asymmetry *a, size_t width, size_t V)
{
    a->amount = calloc(2 * a->S + 1, sizeof *a->amount);
    double *mean = calloc(width + 1, sizeof *mean);
    if (!a->amount || !mean) {
        free(mean);
        return APSM_ERR_MEMORY;
    }
    a->left = a->amount + a->S;
    for (size_t s = 0; s < a->S; s++)
        for (size_t k = 0; k < width; k++)
            mean[k] +=
                (a->mean[2 * s * width + k] - a->mean[(2 * s + 1) * width + k]) / (double)a->S;
    for (size_t s = 0; s < a->S; s++) {
        for (size_t k = 0; k < width; k++) {
            const double d = a->mean[2 * s * width + k] - a->mean[(2 * s + 1) * width + k];
            a->amount[s] += d * d / (double)V;
            a->left[s] += (d - mean[k]) * (d - mean[k]) / (double)V;
        }
        a->amount[s] = sqrt(a->amount[s]);
        a->left[s] = sqrt(a->left[s]);
    }
    free(mean);
    return APSM_OK;
}

/* The rows become the cells: Y their means, in the order of subject and side. */
static void take_cells(const asymmetry *a, group_test *t, size_t width)
{
    memcpy(t->Y, a->mean, 2 * a->S * width * sizeof *t->Y);
    memcpy(t->row, a->first, 2 * a->S * sizeof *t->row);
    t->N = 2 * a->S;
}

/* ---- results ---- */

static double mean_square(const asymmetry *a, int source)
{
    return a->ss[source] / a->df[source];
}

/* F of a source against the one that it is tested against; NAN: against nothing. */
static double f_of(const asymmetry *a, int source)
{
    if (source == ERROR || (source == FLUCTUATING && !a->replicated)) return NAN;
    return mean_square(a, source) /
           mean_square(a, source == FLUCTUATING ? (int)ERROR : (int)FLUCTUATING);
}

static json_t *json_sources(const asymmetry *a)
{
    json_t *list = json_array();
    for (int k = 0; k < SOURCES; k++) {
        if (k == ERROR && a->df[ERROR] == 0) continue;
        json_array_append_new(list,
                              json_pack("{s:s, s:f, s:f, s:f, s:o, s:o}", "source", source_names[k],
                                        "sum_of_squares", a->ss[k], "degrees_of_freedom", a->df[k],
                                        "mean_square", mean_square(a, k), "f",
                                        apsm_json_number_or_null(f_of(a, k)), "p",
                                        apsm_json_number_or_null(a->p[k])));
    }
    return list;
}

static json_t *json_result(const asymmetry *a, const group_test *t)
{
    return json_pack("{s:s, s:i, s:s, s:s, s:s, s:[s, s], s:I, s:I, s:f, s:o}", "format",
                     FORMAT_ASYMMETRY, "version", ASYMMETRY_VERSION, "on", group_test_on_word(t),
                     "side", a->s->of, "subject", a->s->within, "sides", a->level[0], a->level[1],
                     "subjects", (json_int_t)a->S, "shapes", (json_int_t)a->N, "replicates",
                     a->replicates, "sources", json_sources(a));
}

/* Names of the files: asymmetry_ON.json and asymmetry_ON_subjects.csv. */
static void file_name(const group_test *t, const char *end, size_t size, char *name)
{
    char stem[120];
    snprintf(stem, sizeof stem, "asymmetry_%.60s", group_test_on_word(t));
    results_plain_name(stem);
    snprintf(name, size, "%s%s", stem, end);
}

/* A column of the subjects' table: a value for the shape that stands for a subject. */
static apsm_status add_column(const asymmetry *a, const double *value, const char *name,
                              apsm_table *table)
{
    double *x = malloc((table->I + 1) * sizeof *x);
    if (!x) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < table->I; i++) x[i] = NAN;
    for (size_t s = 0; s < a->S; s++) x[a->first[2 * s]] = value[s];
    const apsm_status status = apsm_table_add(table, name, x);
    free(x);
    return status;
}

static apsm_status write_table(const asymmetry *a, group_test *t, const char *path)
{
    APSM_TRY(add_column(a, a->amount, "asymmetry", &t->table));
    APSM_TRY(add_column(a, a->left, "fluctuating_asymmetry", &t->table));
    APSM_TRY(apsm_table_write(a->ctx, path, t->m.names, &t->table));
    apsm_log(a->ctx, APSM_LOG_INFO, "written: %s", path);
    return APSM_OK;
}

static apsm_status write_json(const asymmetry *a, const group_test *t, const char *path)
{
    char sha256[65];
    APSM_TRY(group_test_hash(t, sha256));
    json_t *root = json_result(a, t);
    if (root) json_object_set_new(root, "model_sha256", json_string(sha256));
    const apsm_status status = apsm_json_write(a->ctx, path, root);
    json_decref(root);
    if (status == APSM_OK) apsm_log(a->ctx, APSM_LOG_INFO, "written: %s", path);
    return status;
}

static apsm_status write_all(const asymmetry *a, group_test *t)
{
    char json[200], csv[200];
    file_name(t, ".json", sizeof json, json);
    file_name(t, "_subjects.csv", sizeof csv, csv);
    char *folder = results_folder(a->s->folder, a->s->out);
    char *one = folder ? apsm_path_join(folder, json) : NULL;
    char *two = folder ? apsm_path_join(folder, csv) : NULL;
    apsm_status status = one && two ? write_json(a, t, one) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = write_table(a, t, two);
    free(one);
    free(two);
    free(folder);
    return status;
}

static apsm_status claim(const asymmetry *a, const group_test *t)
{
    char json[200], csv[200];
    const char *const others[] = { csv };
    file_name(t, ".json", sizeof json, json);
    file_name(t, "_subjects.csv", sizeof csv, csv);
    char *folder = results_folder(a->s->folder, a->s->out);
    const apsm_status status =
        folder ? results_claim(a->ctx, folder, json, FORMAT_ASYMMETRY, 1, others) : APSM_ERR_MEMORY;
    free(folder);
    return status;
}

static void tell(const asymmetry *a)
{
    const double sides = a->ss[DIRECTIONAL] + a->ss[FLUCTUATING];
    apsm_log(a->ctx, APSM_LOG_INFO,
             "%zu subjects, %s against %s: directional p = %.4g (F = %.3g, %.1f %% of what sides "
             "differ by)",
             a->S, a->level[0], a->level[1], a->p[DIRECTIONAL], f_of(a, DIRECTIONAL),
             100 * a->ss[DIRECTIONAL] / sides);
    if (a->replicated)
        apsm_log(a->ctx, APSM_LOG_INFO, "fluctuating p = %.4g (F = %.3g against replicates)",
                 a->p[FLUCTUATING], f_of(a, FLUCTUATING));
    else
        apsm_log(
            a->ctx, APSM_LOG_WARNING,
            "%zu sides were measured more than once: fluctuating asymmetry cannot be told from "
            "the error of measurement, and is not tested",
            a->N - 2 * a->S);
    if (f_of(a, INDIVIDUALS) <= 1)
        apsm_log(
            a->ctx, APSM_LOG_WARNING,
            "left and right of one subject are no more alike than those of different ones: are "
            "the subjects named rightly?");
}

/* ---- tests ---- */

static void asymmetry_free(asymmetry *a)
{
    free(a->cell);
    free(a->count);
    free(a->first);
    free(a->mean);
    free(a->amount);
}

/* Before the long part: all that is given, and whether the results may be written. */
static apsm_status begin(const asymmetry *a, group_test *t, bool directional)
{
    static const char *const stems[] = { "asymmetry_fluctuating", "asymmetry_directional" };
    APSM_TRY(group_test_read(t));
    if (directional) APSM_TRY(claim(a, t));
    for (int k = 0; k < (directional ? 2 : 1); k++) {
        t->stem = stems[k];
        APSM_TRY(group_test_claim(t));
    }
    return group_test_rows(t);
}

/* Sides change places within a subject: the means of cells. */
static apsm_status test_directional(asymmetry *a, group_test *t)
{
    APSM_TRY(begin(a, t, true));
    APSM_TRY(pair(a, t));
    check_mirrored(a, t);
    APSM_TRY(group_test_variables(t));
    const size_t width = t->V * t->w;
    APSM_TRY(average(a, t, width));
    squares(a, t, width);
    APSM_TRY(measure_subjects(a, width, t->V));
    take_cells(a, t, width);
    APSM_TRY(group_test_design(t));
    APSM_TRY(group_test_judge(t));
    a->p[DIRECTIONAL] = t->result.p_ratio;
    return group_test_write(t);
}

/* Replicates of a subject are dealt out over its sides. */
static apsm_status test_rows(asymmetry *a, group_test *t)
{
    asymmetry rows = { .ctx = a->ctx, .s = a->s };
    apsm_status status = begin(a, t, false);
    if (status == APSM_OK) status = pair(&rows, t);
    asymmetry_free(&rows);
    APSM_TRY(status);
    APSM_TRY(group_test_variables(t));
    APSM_TRY(group_test_design(t));
    APSM_TRY(group_test_judge(t));
    a->p[FLUCTUATING] = t->result.p_ratio;
    return group_test_write(t);
}

static apsm_status test_fluctuating(asymmetry *a)
{
    char formula[512], of[256];
    snprintf(of, sizeof of, "`%.100s`:`%.100s`", a->s->within, a->s->of);
    snprintf(formula, sizeof formula, "~ %s + `%.100s`", of, a->s->of);
    apsm_test_settings settings = *a->s;
    settings.formula = formula;
    settings.of = of;
    group_test t = {
        .ctx = a->ctx, .s = &settings, .title = "Fluctuating asymmetry", .is_magnitude = true
    };
    const apsm_status status = test_rows(a, &t);
    if (status == APSM_OK) group_test_tell(&t);
    group_test_free(&t);
    return status;
}

static apsm_status check_settings(apsm_context *ctx, const apsm_test_settings *s)
{
    if (s->of && *s->of && s->within && *s->within && !s->formula) return APSM_OK;
    return apsm_fail(ctx, APSM_ERR_ARG,
                     "asymmetry needs the columns of the sides and of the subjects: --of side "
                     "--within subject");
}

static apsm_status test_asymmetry(apsm_context *ctx, const apsm_test_settings *settings)
{
    char formula[256];
    asymmetry a = { .ctx = ctx, .s = settings, .p = { NAN, NAN, NAN, NAN } };
    APSM_TRY(check_settings(ctx, settings));
    snprintf(formula, sizeof formula, "~ `%.100s`", settings->of);
    apsm_test_settings sides = *settings;
    sides.formula = formula;
    sides.of = NULL;
    group_test t = { .ctx = ctx, .s = &sides, .title = "Directional asymmetry" };
    apsm_status status = test_directional(&a, &t);
    if (status == APSM_OK) group_test_tell(&t);
    if (status == APSM_OK && a.replicated) status = test_fluctuating(&a);
    if (status == APSM_OK) status = write_all(&a, &t);
    if (status == APSM_OK) tell(&a);
    group_test_free(&t);
    asymmetry_free(&a);
    return status;
}

APSM_BY_SIZE(apsm_statistics_asymmetry, apsm_test_settings, test_asymmetry)
