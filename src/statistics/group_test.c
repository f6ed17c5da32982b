/* `apsm test`: model folder, table and formula to results. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/statistics.h"
#include "files/files.h"
#include "folder/model_folder.h"
#include "folder/names.h"
#include "geometry/bvh.h"
#include "model/procrustes.h"
#include "optimize/correspondence_loss.h"
#include "statistics/classify.h"
#include "statistics/effect.h"
#include "statistics/formula.h"
#include "statistics/permutation_test.h"
#include "statistics/results.h"

#define FORMAT_TEST "apsm-test"
enum { TEST_VERSION = 1, PERMUTATIONS = 10000, BOOTSTRAPS = 1000, NEIGHBOURS = 6, FOLDS = 10 };
static const double alpha = 0.05, power = 0.8, modes_share = 0.95;

typedef enum test_on { ON_FORM, ON_SHAPE, ON_SIZE, ON_MODES, ON_COLUMN, ON_COUNT } test_on;
static const char *const on_words[] = { "form", "shape", "size", "modes", "column" };
static const char *const on_texts[] = {
    "form: particles as the model has them, size included",
    "shape: particles scaled to one centroid size and aligned by generalised Procrustes",
    "size: centroid size, the root of the sum of squared distances of the particles from their "
    "centroid",
    "modes: scores of the modes that hold 95 % of the variance",
    "column: a column of numbers of the table"
};

/* An effect that is told: a name and a contrast of the tested coefficients. */
typedef struct told_effect {
    char name[160];
    double *contrast;
    apsm_effect effect;
} told_effect;

typedef struct group_test {
    apsm_context *ctx;
    const apsm_test_settings *s;
    test_on on;
    model_folder m;
    apsm_table table;
    apsm_formula formula;
    const apsm_column *within, *response; /* of --on COLUMN; NULL else */
    size_t N, *row;                       /* subjects that are used */
    size_t *block, *stratum;
    apsm_design design;
    size_t V, w;
    double *size;      /* I */
    double *Y;         /* N x V x w */
    double *P;         /* N x J x 3: form or shape, for the classification */
    double *direction; /* J x 3 */
    uint32_t *near;
    apsm_permutation_result result;
    size_t effects;
    told_effect *effect;
    apsm_classification classification;
    bool classified;
} group_test;

/* ---- what is given ---- */

/* A word that is none of ours may be a column of numbers: find_response looks. */
static void take_on(group_test *t)
{
    const char *word = t->s->on ? t->s->on : on_words[ON_FORM];
    t->on = ON_COLUMN;
    for (int k = 0; k < ON_COLUMN; k++)
        if (strcmp(word, on_words[k]) == 0) t->on = (test_on)k;
}

static apsm_status find_response(group_test *t)
{
    if (t->on != ON_COLUMN) return APSM_OK;
    t->response = apsm_table_find(&t->table, t->s->on);
    if (t->response && !t->response->category) return APSM_OK;
    return apsm_fail(t->ctx, APSM_ERR_ARG,
                     "--on '%s': give form, shape, size or modes, or a column of numbers",
                     t->s->on);
}

/* Centroid sizes, which are a column too. */
static apsm_status add_sizes(group_test *t)
{
    const model_folder *m = &t->m;
    t->size = malloc((m->I + 1) * sizeof *t->size);
    if (!t->size) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < m->I; i++) {
        const double *p = m->P + i * m->J * 3;
        double c[3] = { 0 }, sum = 0;
        for (size_t k = 0; k < 3 * m->J; k++) c[k % 3] += p[k] / (double)m->J;
        for (size_t k = 0; k < 3 * m->J; k++) sum += (p[k] - c[k % 3]) * (p[k] - c[k % 3]);
        t->size[i] = sqrt(sum);
    }
    return apsm_table_add(&t->table, "centroid_size", t->size);
}

static apsm_status read_all(group_test *t)
{
    take_on(t);
    if (!t->s->formula || !*t->s->formula)
        return apsm_fail(t->ctx, APSM_ERR_ARG,
                         "no formula; say what to test, such as --formula \"~ group + age\"");
    APSM_TRY(model_folder_read(
        t->ctx, t->s->folder,
        FOLDER_PARTICLES | FOLDER_SCORES | FOLDER_EVALUATED | FOLDER_CERTIFIED, &t->m));
    APSM_TRY(apsm_table_gather(t->ctx, t->s->folder, t->s->subjects, &t->m.project, t->m.names,
                               &t->table));
    APSM_TRY(add_sizes(t));
    APSM_TRY(find_response(t));
    APSM_TRY(apsm_formula_parse(t->ctx, t->s->formula, t->s->of, &t->table, &t->formula));
    if (!t->s->within) return APSM_OK;
    t->within = apsm_table_find(&t->table, t->s->within);
    if (t->within && t->within->category) return APSM_OK;
    return apsm_fail(t->ctx, APSM_ERR_ARG, "--within '%s': is no column of categories",
                     t->s->within);
}

/* ---- which subjects, in which blocks ---- */

/* number (N, out) <- the column's levels among the rows, counted from 0 in the order they occur. */
static void number_rows(const apsm_column *c, size_t N, const size_t *row, size_t *number)
{
    size_t next = 0;
    for (size_t i = 0; i < N; i++) {
        size_t like = i;
        for (size_t k = 0; k < i && like == i; k++)
            if (c->value[row[k]] == c->value[row[i]]) like = k;
        number[i] = like < i ? number[like] : next++;
    }
}

static const apsm_column *tested_category(const group_test *t)
{
    const apsm_term *term = &t->formula.term[t->formula.of];
    return term->factors == 1 && term->factor[0]->category ? term->factor[0] : NULL;
}

static apsm_status choose_rows(group_test *t)
{
    size_t N = 0;
    APSM_TRY(apsm_formula_rows(&t->formula, t->within, &t->table, &t->row, &t->N));
    for (size_t i = 0; i < t->N; i++)
        if (!t->response || !isnan(t->response->value[t->row[i]])) t->row[N++] = t->row[i];
    t->N = N;
    if (t->N < t->m.I)
        apsm_log(t->ctx, APSM_LOG_WARNING,
                 "%zu of %zu shapes are left out: a value of the formula is unknown for them",
                 t->m.I - t->N, t->m.I);
    APSM_TRY(apsm_formula_design(t->ctx, &t->formula, t->within, t->N, t->row, &t->design));
    const apsm_column *category = tested_category(t);
    if (t->within) {
        t->block = malloc((t->N + 1) * sizeof *t->block);
        if (!t->block) return APSM_ERR_MEMORY;
        number_rows(t->within, t->N, t->row, t->block);
    }
    if (!category) return APSM_OK;
    t->stratum = malloc((t->N + 1) * sizeof *t->stratum);
    if (!t->stratum) return APSM_ERR_MEMORY;
    number_rows(category, t->N, t->row, t->stratum);
    return APSM_OK;
}

/* ---- what is tested ---- */

static apsm_status take_particles(group_test *t)
{
    const size_t n = 3 * t->m.J;
    t->P = malloc((t->N * n + 1) * sizeof *t->P);
    if (!t->P) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < t->N; i++)
        memcpy(t->P + i * n, t->m.P + t->row[i] * n, n * sizeof *t->P);
    if (t->on != ON_SHAPE) return APSM_OK;
    apsm_procrustes_options options = apsm_procrustes_defaults();
    options.scale = true;
    double *M = malloc((t->N * 16 + 1) * sizeof *M);
    if (!M) return APSM_ERR_MEMORY;
    const apsm_status status = apsm_procrustes(t->ctx, t->N, t->m.J, t->P, &options, M, t->P);
    free(M);
    return status;
}

static size_t modes_tested(const apsm_shape_model *m)
{
    double all = 0, so_far = 0;
    size_t k = 0;
    for (size_t j = 0; j < m->modes; j++) all += m->variance[j];
    while (k < m->modes && so_far < modes_share * all) so_far += m->variance[k++];
    return k;
}

/* One number a variable: the size, or scores. */
static apsm_status take_numbers(group_test *t)
{
    const apsm_shape_model *m = &t->m.model;
    t->w = 1;
    t->V = t->on == ON_MODES ? modes_tested(m) : 1;
    if (t->V == 0) return apsm_fail(t->ctx, APSM_ERR_STATE, "%s: has no modes", t->s->folder);
    t->Y = malloc((t->N * t->V + 1) * sizeof *t->Y);
    if (!t->Y) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < t->N; i++)
        for (size_t v = 0; v < t->V; v++)
            t->Y[i * t->V + v] = t->response        ? t->response->value[t->row[i]]
                                 : t->on == ON_SIZE ? t->size[t->row[i]]
                                                    : m->score[t->row[i] * m->modes + v];
    return APSM_OK;
}

static apsm_status take_variables(group_test *t)
{
    APSM_TRY(take_particles(t));
    if (t->on != ON_FORM && t->on != ON_SHAPE) return take_numbers(t);
    t->w = 3;
    t->V = t->m.J;
    t->Y = t->P;
    t->near = malloc((t->V * NEIGHBOURS + 1) * sizeof *t->near);
    if (!t->near) return APSM_ERR_MEMORY;
    return apsm_neighbours6(t->V, t->m.model.mean, t->near);
}

/* Outward normals at the template's particles, in the world frame, part by part. */
static apsm_status normals_of_part(group_test *t, size_t d)
{
    const model_part *part = &t->m.part[d];
    const double *P = t->m.P + 3 * (part->template_index * t->m.J + part->first);
    apsm_mesh mesh = { 0 };
    apsm_bvh *bvh = NULL;
    double *VN = NULL;
    apsm_status status = model_folder_part_mesh(t->ctx, &t->m, part->template_index, d, &mesh);
    if (status == APSM_OK) status = apsm_bvh_build_unsigned(&mesh, &bvh);
    if (status == APSM_OK && !(VN = malloc((3 * mesh.nv + 1) * sizeof *VN)))
        status = APSM_ERR_MEMORY;
    if (status == APSM_OK) apsm_mesh_vertex_normals(&mesh, VN);
    for (size_t j = 0; status == APSM_OK && j < part->J; j++) {
        apsm_closest at;
        apsm_bvh_closest(bvh, P + 3 * j, INFINITY, &at);
        apsm_surface_normal(&mesh, VN, &at.on, t->direction + 3 * (part->first + j));
    }
    free(VN);
    apsm_bvh_free(bvh);
    apsm_mesh_free(&mesh);
    return status;
}

static apsm_status take_normals(group_test *t)
{
    if (t->w == 1) return APSM_OK;
    t->direction = malloc((3 * t->m.J + 1) * sizeof *t->direction);
    if (!t->direction) return APSM_ERR_MEMORY;
    for (size_t d = 0; d < t->m.parts; d++) APSM_TRY(normals_of_part(t, d));
    return APSM_OK;
}

/* ---- tests and effects ---- */

static apsm_status test(group_test *t)
{
    const apsm_permutation_input in = { .design = &t->design,
                                        .Y = t->Y,
                                        .V = t->V,
                                        .w = t->w,
                                        .block = t->block,
                                        .permutations =
                                            t->s->permutations ? t->s->permutations : PERMUTATIONS,
                                        .neighbours = t->near ? NEIGHBOURS : 0,
                                        .near = t->near };
    return apsm_permutation_test(t->ctx, &in, &t->result);
}

/* Levels of the tested category that occur, as effects; a number's slope; or single coefficients.
 */
static size_t count_effects(const group_test *t)
{
    const size_t s = t->design.q - t->design.r;
    if (!tested_category(t) || s == 1) return s;
    return s + 1;
}

static const char *level_name(const group_test *t, size_t k)
{
    const apsm_column *c = tested_category(t);
    for (size_t level = 0; level < c->levels; level++)
        for (size_t i = 0; i < t->N; i++)
            if (c->value[t->row[i]] == (double)level) {
                if (k-- == 0) return c->level[level];
                break;
            }
    return "";
}

static void name_effect(const group_test *t, size_t k, told_effect *e)
{
    const size_t s = t->design.q - t->design.r;
    char term[100];
    apsm_term_name(&t->formula.term[t->formula.of], sizeof term, term);
    if (!tested_category(t)) {
        e->contrast[k] = 1;
        if (t->formula.term[t->formula.of].factors == 1)
            snprintf(e->name, sizeof e->name, "one more of %.80s", term);
        else
            snprintf(e->name, sizeof e->name, "%.80s, coefficient %zu", term, k + 1);
    } else if (s == 1) {
        e->contrast[0] = 2;
        snprintf(e->name, sizeof e->name, "%.60s minus %.60s", level_name(t, 0), level_name(t, 1));
    } else {
        for (size_t c = 0; c < s; c++) e->contrast[c] = k == s ? -1 : c == k;
        snprintf(e->name, sizeof e->name, "%.60s minus the mean of all", level_name(t, k));
    }
}

static apsm_status measure_effects(group_test *t)
{
    const size_t s = t->design.q - t->design.r;
    const size_t wanted = t->s->bootstraps == SIZE_MAX ? 0
                          : t->s->bootstraps           ? t->s->bootstraps
                                                       : BOOTSTRAPS;
    t->effect = calloc(s + 1, sizeof *t->effect);
    if (!t->effect) return APSM_ERR_MEMORY;
    if (t->within && wanted > 0)
        apsm_log(t->ctx, APSM_LOG_INFO,
                 "no bootstrap bands: subjects were measured repeatedly (--within)");
    for (t->effects = 0; t->effects < count_effects(t); t->effects++) {
        told_effect *e = &t->effect[t->effects];
        e->contrast = calloc(s + 1, sizeof *e->contrast);
        if (!e->contrast) return APSM_ERR_MEMORY;
        name_effect(t, t->effects, e);
        const apsm_effect_input in = {
            &t->design,  t->Y,         t->V,       t->w,
            e->contrast, t->direction, t->stratum, t->within ? 0 : wanted
        };
        APSM_TRY(apsm_effect_measure(t->ctx, &in, &e->effect));
    }
    return APSM_OK;
}

/* Only what has two levels, and is not measured within subjects. */
static apsm_status classify(group_test *t)
{
    const apsm_column *c = tested_category(t);
    if (!c || t->design.q - t->design.r != 1 || t->within) return APSM_OK;
    size_t *group = malloc((t->N + 1) * sizeof *group), n[2] = { 0, 0 };
    double *score = malloc((t->N + 1) * sizeof *score);
    apsm_status status = group && score ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; status == APSM_OK && i < t->N; i++) {
        group[i] = strcmp(c->level[(size_t)c->value[t->row[i]]], level_name(t, 0)) != 0;
        n[group[i]]++;
    }
    if (status == APSM_OK && n[0] >= 4 && n[1] >= 4) {
        status = apsm_classify(t->ctx, t->N, t->m.J, t->P, group, FOLDS, score, &t->classification);
        t->classified = status == APSM_OK;
    }
    free(group);
    free(score);
    return status;
}

/* ---- results ---- */

/* What was tested, in one word. */
static const char *on_word(const group_test *t)
{
    return t->response ? t->response->name : on_words[t->on];
}

static json_t *json_effects(const group_test *t)
{
    json_t *list = json_array();
    for (size_t k = 0; k < t->effects; k++) {
        const apsm_effect *e = &t->effect[k].effect;
        json_t *one = json_pack("{s:s, s:o, s:o, s:o}", "name", t->effect[k].name, "effect",
                                t->w == 3 ? apsm_json_matrix(t->V, 3, e->effect)
                                          : apsm_json_vector(t->V, e->effect),
                                "along_normal", apsm_json_vector(t->V, e->along), "standardised",
                                apsm_json_vector(t->V, e->standardised));
        if (e->low) {
            json_object_set_new(one, "low", apsm_json_vector(t->V, e->low));
            json_object_set_new(one, "high", apsm_json_vector(t->V, e->high));
        }
        json_array_append_new(list, one);
    }
    return list;
}

static json_t *json_names(const group_test *t, bool used, bool uncertified)
{
    json_t *names = json_array();
    size_t k = 0;
    for (size_t i = 0; i < t->m.I; i++) {
        const bool is_used = k < t->N && t->row[k] == i;
        k += is_used;
        if (is_used == used && (!uncertified || !model_folder_is_certified(&t->m, i)))
            json_array_append_new(names, json_string(t->m.names[i]));
    }
    return names;
}

static json_t *json_classification(const group_test *t)
{
    const apsm_classification *c = &t->classification;
    if (!t->classified) return json_null();
    return json_pack("{s:I, s:f, s:f, s:f, s:f}", "folds", (json_int_t)c->folds,
                     "balanced_accuracy", c->accuracy, "auc", c->auc, "auc_low", c->auc_low,
                     "auc_high", c->auc_high);
}

/* Of a mean shift of one number between the two levels, in standard deviations. */
static json_t *json_detectable(const group_test *t)
{
    const apsm_column *c = tested_category(t);
    if (!c || t->design.q - t->design.r != 1) return json_null();
    size_t n[2] = { 0, 0 };
    for (size_t i = 0; i < t->N; i++) n[t->stratum[i] > 0]++;
    return json_pack("{s:f, s:f, s:f, s:f}", "alpha", alpha, "power", power, "one_variable",
                     apsm_detectable_shift(n[0], n[1], alpha, power), "any_of_all",
                     apsm_detectable_shift(n[0], n[1], alpha / (double)t->V, power));
}

static json_t *json_result(const group_test *t, const char *model_sha256)
{
    const apsm_permutation_result *r = &t->result;
    char of[200];
    apsm_term_name(&t->formula.term[t->formula.of], sizeof of, of);
    json_t *root = json_pack("{s:s, s:i, s:s, s:s, s:s, s:s, s:I, s:I, s:I, s:b}", "format",
                             FORMAT_TEST, "version", TEST_VERSION, "formula", t->s->formula, "of",
                             of, "on", on_word(t), "on_text", on_texts[t->on], "subjects",
                             (json_int_t)t->N, "coefficients", (json_int_t)t->design.q,
                             "permutations", (json_int_t)r->permutations, "exact", r->exact);
    if (!root) return NULL;
    json_object_set_new(root, "model_sha256", json_string(model_sha256));
    json_object_set_new(root, "within", t->s->within ? json_string(t->s->within) : json_null());
    json_object_set_new(root, "left_out", json_names(t, false, false));
    json_object_set_new(root, "not_certified", json_names(t, true, true));
    json_object_set_new(root, "ratio", json_real(r->ratio));
    json_object_set_new(root, "share_of_variance", json_real(r->ratio / (1 + r->ratio)));
    json_object_set_new(root, "p", json_real(r->p_ratio));
    json_object_set_new(root, "p_standard_error", json_real(r->p_error));
    json_object_set_new(root, "statistic", apsm_json_vector(r->V, r->statistic));
    json_object_set_new(root, "p_uncorrected", apsm_json_vector(r->V, r->p));
    json_object_set_new(root, "p_familywise", apsm_json_vector(r->V, r->p_familywise));
    json_object_set_new(root, "q", apsm_json_vector(r->V, r->q));
    if (r->p_enhanced)
        json_object_set_new(root, "p_cluster", apsm_json_vector(r->V, r->p_enhanced));
    json_object_set_new(root, "share", apsm_json_vector(r->V, r->share));
    json_object_set_new(root, "effects", json_effects(t));
    json_object_set_new(root, "classification", json_classification(t));
    json_object_set_new(root, "detectable", json_detectable(t));
    return root;
}

static void write_numbers(apsm_writer *csv, const group_test *t, size_t v)
{
    const apsm_permutation_result *r = &t->result;
    const double cells[] = { r->statistic[v],
                             r->p[v],
                             r->p_familywise[v],
                             r->q[v],
                             r->p_enhanced ? r->p_enhanced[v] : NAN,
                             r->share[v] };
    for (size_t k = 0; k < sizeof cells / sizeof *cells; k++) {
        apsm_writer_printf(csv, ",");
        if (isfinite(cells[k])) apsm_writer_number(csv, cells[k]);
    }
    for (size_t k = 0; k < t->effects; k++) {
        const apsm_effect *e = &t->effect[k].effect;
        const double more[] = { e->along[v], e->low ? e->low[v] : NAN, e->high ? e->high[v] : NAN,
                                e->standardised[v] };
        for (size_t a = 0; a < sizeof more / sizeof *more; a++) {
            apsm_writer_printf(csv, ",");
            if (isfinite(more[a])) apsm_writer_number(csv, more[a]);
        }
    }
    apsm_writer_printf(csv, "\n");
}

static apsm_status write_csv(const group_test *t, const char *path)
{
    static const char *const first[] = { "particle", "particle", "size", "mode", "column" };
    apsm_writer *csv = NULL;
    APSM_TRY(apsm_writer_open(t->ctx, path, &csv));
    apsm_writer_printf(csv, "%s%s,statistic,p,p_familywise,q,p_cluster,share", first[t->on],
                       t->w == 3 ? ",x,y,z" : "");
    for (size_t k = 0; k < t->effects; k++) {
        static const char *const columns[] = { "", ", low", ", high", ", standardised" };
        for (int a = 0; a < 4; a++) {
            char title[200];
            snprintf(title, sizeof title, "%s%s", t->effect[k].name, columns[a]);
            apsm_writer_printf(csv, ",");
            apsm_writer_csv(csv, title);
        }
    }
    apsm_writer_printf(csv, "\n");
    for (size_t v = 0; v < t->V; v++) {
        apsm_writer_printf(csv, "%zu", t->on == ON_MODES ? v + 1 : v);
        for (size_t a = 0; a < 3 && t->w == 3; a++) {
            apsm_writer_printf(csv, ",");
            apsm_writer_number(csv, t->m.model.mean[3 * v + a]);
        }
        write_numbers(csv, t, v);
    }
    return apsm_writer_commit(csv);
}

static apsm_status hash_model(const group_test *t, char hex[65])
{
    char *path = model_folder_path(&t->m, FOLDER_MODEL);
    const apsm_status status = path ? apsm_sha256_file(t->ctx, path, hex) : APSM_ERR_MEMORY;
    free(path);
    return status;
}

/* OF_ON, without extension. */
static void result_name(const group_test *t, size_t size, char *name)
{
    char of[120];
    apsm_term_name(&t->formula.term[t->formula.of], sizeof of, of);
    snprintf(name, size, "%s_%.60s", of, on_word(t));
    results_plain_name(name);
}

static apsm_status claim_files(const group_test *t)
{
    char stem[200], json[240], csv[240];
    const char *const names[] = { csv };
    char *folder = results_folder(t->s->folder, t->s->out);
    result_name(t, sizeof stem, stem);
    snprintf(json, sizeof json, "%s.json", stem);
    snprintf(csv, sizeof csv, "%s.csv", stem);
    const apsm_status status =
        folder ? results_claim(t->ctx, folder, json, FORMAT_TEST, 1, names) : APSM_ERR_MEMORY;
    free(folder);
    return status;
}

static apsm_status write_results(const group_test *t)
{
    char stem[200], name[240], sha256[65] = "";
    char *folder = results_folder(t->s->folder, t->s->out);
    result_name(t, sizeof stem, stem);
    apsm_status status = folder ? apsm_make_folder(t->ctx, folder) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = hash_model(t, sha256);
    for (int k = 0; k < 2 && status == APSM_OK; k++) {
        snprintf(name, sizeof name, "%s.%s", stem, k ? "csv" : "json");
        char *path = apsm_path_join(folder, name);
        json_t *root = k == 0 ? json_result(t, sha256) : NULL;
        status = !path    ? APSM_ERR_MEMORY
                 : k == 0 ? apsm_json_write(t->ctx, path, root)
                          : write_csv(t, path);
        if (status == APSM_OK) apsm_log(t->ctx, APSM_LOG_INFO, "written: %s", path);
        json_decref(root);
        free(path);
    }
    free(folder);
    return status;
}

static void tell(const group_test *t)
{
    const apsm_permutation_result *r = &t->result;
    size_t familywise = 0, q = 0, cluster = 0, uncertain = 0;
    char of[200];
    apsm_term_name(&t->formula.term[t->formula.of], sizeof of, of);
    for (size_t v = 0; v < t->V; v++) {
        familywise += r->p_familywise[v] <= alpha;
        q += r->q[v] <= alpha;
        cluster += r->p_enhanced && r->p_enhanced[v] <= alpha;
    }
    for (size_t k = 0; k < t->N; k++) uncertain += !model_folder_is_certified(&t->m, t->row[k]);
    apsm_log(t->ctx, APSM_LOG_INFO,
             "%s on %s of %zu subjects: p = %.4g (%s%zu orders), %.1f %% of the variance that the "
             "other terms leave",
             of, on_word(t), t->N, r->p_ratio, r->exact ? "all " : "", r->permutations,
             100 * r->ratio / (1 + r->ratio));
    if (t->V > 1)
        apsm_log(t->ctx, APSM_LOG_INFO,
                 "of %zu %s at 5 %%: %zu family-wise, %zu by false discovery rate%s%zu%s", t->V,
                 t->w == 3 ? "particles" : "modes", familywise, q, r->p_enhanced ? ", " : " (",
                 r->p_enhanced ? cluster : t->V, r->p_enhanced ? " by clusters" : " tested)");
    if (t->classified)
        apsm_log(t->ctx, APSM_LOG_INFO,
                 "told apart by shape: area under the ROC curve %.2f (95 %%: %.2f to %.2f), "
                 "cross-validated",
                 t->classification.auc, t->classification.auc_low, t->classification.auc_high);
    if (uncertain > 0)
        apsm_log(t->ctx, APSM_LOG_WARNING,
                 "%zu of the %zu shapes are not certified: look at them before you trust this",
                 uncertain, t->N);
}

static void group_test_free(group_test *t)
{
    for (size_t k = 0; t->effect && k <= t->design.q - t->design.r; k++) {
        apsm_effect_free(&t->effect[k].effect);
        free(t->effect[k].contrast);
    }
    free(t->effect);
    if (t->Y != t->P) free(t->Y);
    free(t->P);
    free(t->size);
    free(t->row);
    free(t->block);
    free(t->stratum);
    free(t->direction);
    free(t->near);
    apsm_permutation_result_free(&t->result);
    apsm_design_free(&t->design);
    apsm_table_free(&t->table);
    model_folder_free(&t->m);
}

apsm_status apsm_statistics_test(apsm_context *ctx, const apsm_test_settings *settings)
{
    group_test t = { .ctx = ctx, .s = settings };
    apsm_status status = read_all(&t);
    if (status == APSM_OK) status = claim_files(&t);
    if (status == APSM_OK) status = choose_rows(&t);
    if (status == APSM_OK) status = take_variables(&t);
    if (status == APSM_OK) status = take_normals(&t);
    if (status == APSM_OK) status = test(&t);
    if (status == APSM_OK) status = measure_effects(&t);
    if (status == APSM_OK) status = classify(&t);
    if (status == APSM_OK) status = write_results(&t);
    if (status == APSM_OK && settings->subjects && !settings->out)
        status = apsm_table_keep(ctx, settings->folder, settings->subjects, t.m.I, t.m.names);
    if (status == APSM_OK) tell(&t);
    group_test_free(&t);
    return status;
}
