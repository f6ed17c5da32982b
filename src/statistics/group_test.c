/* `apsm test`: model folder, table and formula to results. */
#include "statistics/group_test.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/sized.h"
#include "geometry/bvh.h"
#include "model/procrustes.h"
#include "optimize/correspondence_loss.h"

enum { PERMUTATIONS = 10000, BOOTSTRAPS = 1000, NEIGHBOURS = 6, FOLDS = 10 };
static const double modes_share = 0.95;

static const char *const on_words[] = { "form", "shape", "size", "modes", "column" };

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
    if (t->response) APSM_TRY(apsm_column_check(t->ctx, t->table.I, t->response));
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

apsm_status group_test_read(group_test *t)
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
    if (t->s->within) APSM_TRY(apsm_table_categorize(&t->table, t->s->within));
    APSM_TRY(apsm_formula_parse(t->ctx, t->s->formula, t->s->of, &t->table, &t->formula));
    if (!t->s->within) return APSM_OK;
    t->within = apsm_table_find(&t->table, t->s->within);
    if (t->within) return APSM_OK;
    return apsm_fail(t->ctx, APSM_ERR_ARG,
                     "--within '%s': the table of subjects has no such column; give --subjects, or "
                     "another name",
                     t->s->within);
}

/* ---- which subjects, in which blocks ---- */

void number_rows(const apsm_column *c, size_t N, const size_t *row, size_t *number)
{
    size_t next = 0;
    for (size_t i = 0; i < N; i++) {
        size_t like = i;
        for (size_t k = 0; k < i && like == i; k++)
            if (c->value[row[k]] == c->value[row[i]]) like = k;
        number[i] = like < i ? number[like] : next++;
    }
}

const apsm_column *group_test_category(const group_test *t)
{
    const apsm_term *term = &t->formula.term[t->formula.of];
    return term->factors == 1 && term->factor[0]->category ? term->factor[0] : NULL;
}

apsm_status group_test_rows(group_test *t)
{
    size_t N = 0;
    t->used = calloc(t->m.I + 1, sizeof *t->used);
    if (!t->used) return APSM_ERR_MEMORY;
    APSM_TRY(apsm_formula_rows(&t->formula, t->within, &t->table, &t->row, &t->N));
    for (size_t i = 0; i < t->N; i++)
        if (!t->response || !isnan(t->response->value[t->row[i]])) t->row[N++] = t->row[i];
    t->N = N;
    for (size_t i = 0; i < N; i++) t->used[t->row[i]] = true;
    if (t->N < t->m.I)
        apsm_log(t->ctx, APSM_LOG_WARNING,
                 "%zu of %zu shapes are left out: a value of the formula is unknown for them",
                 t->m.I - t->N, t->m.I);
    return APSM_OK;
}

apsm_status group_test_design(group_test *t)
{
    APSM_TRY(apsm_formula_design(t->ctx, &t->formula, t->within, t->N, t->row, &t->design));
    const apsm_column *category = group_test_category(t);
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

apsm_status group_test_variables(group_test *t)
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
                                        .near = t->near,
                                        .stop_risk = t->s->stop_risk,
                                        .level = 0.05,
                                        .unequal = t->s->unequal };
    return apsm_permutation_test(t->ctx, &in, &t->result);
}

/* Variances of the tested groups, of what the full model leaves. */
static apsm_status compare_spreads(group_test *t)
{
    const size_t width = t->V * t->w;
    if (!t->stratum || t->within) return APSM_OK;
    double *left = malloc((t->N * width + 2 * t->N + 1) * sizeof *left), least = INFINITY, most = 0;
    if (!left) return APSM_ERR_MEMORY;
    double *sum = left + t->N * width, *n = sum + t->N;
    memset(sum, 0, 2 * t->N * sizeof *sum);
    apsm_design_residuals(&t->design, t->design.q, width, t->Y, left);
    for (size_t i = 0; i < t->N; i++) {
        n[t->stratum[i]]++;
        for (size_t k = 0; k < width; k++)
            sum[t->stratum[i]] += left[i * width + k] * left[i * width + k];
    }
    for (size_t g = 0; g < t->N && n[g] > 0; g++) {
        if (n[g] < 2) continue;
        least = fmin(least, sum[g] / (n[g] - 1));
        most = fmax(most, sum[g] / (n[g] - 1));
    }
    t->spread = least > 0 && isfinite(least) ? most / least : 0;
    free(left);
    return APSM_OK;
}

/* Levels of the tested category that occur, as effects; a number's slope; or single coefficients.
 */
static size_t count_effects(const group_test *t)
{
    const size_t s = t->design.q - t->design.r;
    if (t->is_magnitude) return 0;
    if (!group_test_category(t) || s == 1) return s;
    return s + 1;
}

static const char *level_name(const group_test *t, size_t k)
{
    const apsm_column *c = group_test_category(t);
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
    if (!group_test_category(t)) {
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
    const apsm_column *c = group_test_category(t);
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

/* ---- all ---- */

apsm_status group_test_judge(group_test *t)
{
    APSM_TRY(take_normals(t));
    APSM_TRY(test(t));
    APSM_TRY(compare_spreads(t));
    APSM_TRY(measure_effects(t));
    return classify(t);
}

const char *group_test_on_word(const group_test *t)
{
    return t->response ? t->response->name : on_words[t->on];
}

void group_test_free(group_test *t)
{
    for (size_t k = 0; t->effect && k <= t->design.q - t->design.r; k++) {
        apsm_effect_free(&t->effect[k].effect);
        free(t->effect[k].contrast);
    }
    free(t->effect);
    if (t->Y != t->P) free(t->Y);
    free(t->P);
    free(t->size);
    free(t->used);
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

static apsm_status test_groups(apsm_context *ctx, const apsm_test_settings *settings)
{
    group_test t = { .ctx = ctx, .s = settings };
    apsm_status status = group_test_read(&t);
    if (status == APSM_OK) status = group_test_claim(&t);
    if (status == APSM_OK) status = group_test_rows(&t);
    if (status == APSM_OK) status = group_test_design(&t);
    if (status == APSM_OK) status = group_test_variables(&t);
    if (status == APSM_OK) status = group_test_judge(&t);
    if (status == APSM_OK) status = group_test_write(&t);
    if (status == APSM_OK) group_test_tell(&t);
    group_test_free(&t);
    return status;
}

APSM_BY_SIZE(apsm_statistics_test, apsm_test_settings, test_groups)
