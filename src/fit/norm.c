/* `apsm norm`: shapes that were fitted, among those of the model. */
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/random.h"
#include "core/sized.h"
#include "files/files.h"
#include "fit/norm_job.h"
#include "geometry/vec3.h"
#include "statistics/permutation_test.h"
#include "statistics/results.h"

enum { HALVINGS = 50, LEAST_FREEDOM = 5 };
static const double modes_share = 0.95;

apsm_status norm_note(norm_job *w, const char *format, ...)
{
    va_list words;
    va_start(words, format);
    json_t *const text = apsm_json_vtext(format, words);
    va_end(words);
    if (text) apsm_log(w->ctx, APSM_LOG_WARNING, "%s", json_string_value(text));
    return json_array_append_new(w->notes, text) ? APSM_ERR_MEMORY : APSM_OK;
}

/* ---- what is given ---- */

static apsm_status list_names(norm_job *w)
{
    const size_t I = w->m.I;
    w->names = calloc(I + w->files.n + 1, sizeof *w->names);
    if (!w->names) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < I; i++) w->names[i] = w->m.names[i];
    for (size_t k = 0; k < w->files.n; k++) {
        w->names[I + k] = w->files.name[k];
        for (size_t i = 0; i < I; i++)
            if (strcmp(w->m.names[i], w->files.name[k]) == 0)
                return apsm_fail(w->ctx, APSM_ERR_ARG,
                                 "'%s' is a shape of the model itself; norms are for others (or "
                                 "rename the file)",
                                 w->files.name[k]);
    }
    return APSM_OK;
}

/* norm.csv, the page, or a file for each new shape. */
static apsm_status claim_files(const norm_job *w)
{
    char *folder = results_folder(w->s->folder, w->s->out);
    apsm_status status = folder ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t f = 0; f <= w->n && status == APSM_OK; f++) {
        char name[512] = "norm.csv";
        const char *const names[] = { name, "norm.html" };
        if (f > 0) snprintf(name, sizeof name, "%.400s_norm.csv", w->files.name[f - 1]);
        status = results_claim(w->ctx, folder, "norm.json", FORMAT_NORM, 2, names);
    }
    free(folder);
    return status;
}

static apsm_status read_all(norm_job *w)
{
    const apsm_norm_settings *s = w->s;
    if (!s->folder || s->n_files == 0)
        return apsm_fail(w->ctx, APSM_ERR_ARG, "norm: no model folder or no shapes");
    APSM_TRY(model_folder_read(w->ctx, s->folder, FOLDER_ALL, &w->m));
    APSM_TRY(particle_files_read(w->ctx, s->n_files, s->files, &w->m, &w->files));
    w->n = w->files.n;
    APSM_TRY(claim_files(w));
    APSM_TRY(list_names(w));
    APSM_TRY(apsm_table_from_project(w->ctx, &w->m.project, &w->table));
    APSM_TRY(apsm_table_widen(&w->table, w->m.I + w->files.n));
    if (s->subjects)
        APSM_TRY(apsm_table_read(w->ctx, s->subjects, w->table.I, w->names, &w->table));
    if (!s->formula) return APSM_OK;
    return apsm_formula_parse(w->ctx, s->formula, NULL, &w->table, &w->formula);
}

/* A level that no shape of the model has says nothing about the new shape. */
static apsm_status check_levels(const norm_job *w, const apsm_column *c)
{
    for (size_t k = w->N; c->category && k < w->N + w->n; k++) {
        bool known = false;
        for (size_t i = 0; i < w->N && !known; i++)
            known = c->value[w->row[i]] == c->value[w->row[k]];
        if (!known)
            return apsm_fail(w->ctx, APSM_ERR_ARG,
                             "%s: no shape of the model has %s = %s; leave it out of the formula",
                             w->names[w->row[k]], c->name, c->level[(size_t)c->value[w->row[k]]]);
    }
    return APSM_OK;
}

static apsm_status warn_beyond(norm_job *w, const apsm_column *c)
{
    double lo = INFINITY, hi = -INFINITY;
    for (size_t i = 0; i < w->N; i++) {
        lo = fmin(lo, c->value[w->row[i]]);
        hi = fmax(hi, c->value[w->row[i]]);
    }
    for (size_t k = 0; !c->category && k < w->n; k++) {
        const double x = c->value[w->row[w->N + k]];
        if (!(x < lo || x > hi)) continue;
        APSM_TRY(particle_files_note(w->ctx, &w->files, k,
                                     "%s = %g lies outside of what the model has seen (%g to %g)",
                                     c->name, x, lo, hi));
    }
    return APSM_OK;
}

static apsm_status check_columns(norm_job *w)
{
    for (size_t c = 0; c < w->table.n; c++) {
        if (!norm_allows_for(w, &w->table.column[c])) continue;
        APSM_TRY(check_levels(w, &w->table.column[c]));
        APSM_TRY(warn_beyond(w, &w->table.column[c]));
    }
    return APSM_OK;
}

static apsm_status choose_rows(norm_job *w)
{
    size_t all = 0;
    APSM_TRY(apsm_formula_rows(&w->formula, NULL, &w->table, &w->row, &all));
    w->N = 0;
    while (w->N < all && w->row[w->N] < w->m.I) w->N++;
    for (size_t k = 0; k < w->n; k++)
        if (w->N + k >= all || w->row[w->N + k] != w->m.I + k)
            return apsm_fail(w->ctx, APSM_ERR_ARG,
                             "%s: a value of the formula is unknown; give a line for it in "
                             "--subjects",
                             w->files.name[k]);
    if (w->N < w->m.I)
        APSM_TRY(norm_note(
            w, "%zu of %zu shapes are left out: a value of the formula is unknown for them",
            w->m.I - w->N, w->m.I));
    return check_columns(w);
}

/* Rows of ones without a formula. */
static apsm_status make_design(norm_job *w)
{
    const size_t all = w->N + w->n;
    apsm_design d = { .q = 1 };
    if (w->s->formula) APSM_TRY(apsm_formula_design(w->ctx, &w->formula, NULL, all, w->row, &d));
    w->q = d.q;
    w->X = malloc((all * w->q + 1) * sizeof *w->X);
    if (w->X && d.X) memcpy(w->X, d.X, all * w->q * sizeof *w->X);
    for (size_t i = 0; w->X && !d.X && i < all; i++) w->X[i] = 1;
    apsm_design_free(&d);
    if (!w->X) return APSM_ERR_MEMORY;
    if (w->N >= w->q + LEAST_FREEDOM + 1) return APSM_OK;
    return apsm_fail(w->ctx, APSM_ERR_STATE,
                     "%zu shapes are too few for a norm with %zu coefficients; it takes %zu", w->N,
                     w->q, w->q + LEAST_FREEDOM + 1);
}

/* ---- the norm ---- */

static size_t modes_told(const apsm_shape_model *m)
{
    double all = 0, so_far = 0;
    size_t k = 0;
    for (size_t j = 0; j < m->modes; j++) all += m->variance[j];
    while (k < m->modes && so_far < modes_share * all) so_far += m->variance[k++];
    return k;
}

static apsm_status model_scores(norm_job *w)
{
    const apsm_shape_model *model = &w->m.model;
    const size_t K = w->modes = modes_told(model), V = 3 * w->m.J;
    double *b = malloc(((w->N + w->n) * K + model->modes + 1) * sizeof *b);
    if (!b) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < w->N; i++)
        memcpy(b + i * K, model->score + w->row[i] * model->modes, K * sizeof *b);
    for (size_t i = 0; i < w->n; i++)
        for (size_t k = 0; k < K; k++) {
            double sum = 0;
            for (size_t v = 0; v < V; v++)
                sum += (w->files.P[i * V + v] - model->mean[v]) * model->mode[k * V + v];
            b[(w->N + i) * K + k] = sum;
        }
    const norm_data data = { w->N, w->n, w->q, 1, K, w->X, b, b + w->N * K };
    const apsm_status status = norm_model_make(w->ctx, &data, &w->score_model);
    free(b);
    return status;
}

static apsm_status own_particles(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    norm_job *w = user;
    double *p = malloc((w->m.J + 1) * sizeof *p);
    if (!p) return APSM_ERR_MEMORY;
    norm_particles_own(&w->judged, i, p);
    w->least[i] = 1;
    for (size_t j = 0; j < w->m.J; j++) w->least[i] = fmin(w->least[i], p[j]);
    free(p);
    return APSM_OK;
}

/* What is judged of a shape: its particles along the mean's normals, or as they are without. */
static void along_normals(const norm_job *w, const double *P, double *Z)
{
    if (!w->normal)
        memcpy(Z, P, 3 * w->m.J * sizeof *Z);
    else
        for (size_t j = 0; j < w->m.J; j++) Z[j] = vec3_dot(P + 3 * j, w->normal + 3 * j);
}

static apsm_status make_models(norm_job *w)
{
    const size_t V = 3 * w->m.J, D = w->normal ? w->m.J : V;
    w->Y = malloc((w->N * V + 1) * sizeof *w->Y);
    w->Z = malloc(((w->N + w->n) * D + 1) * sizeof *w->Z);
    w->least = malloc((w->N + 1) * sizeof *w->least);
    if (!w->Y || !w->Z || !w->least) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < w->N; i++)
        memcpy(w->Y + i * V, w->m.P + w->row[i] * V, V * sizeof *w->Y);
    for (size_t i = 0; i < w->N; i++) along_normals(w, w->Y + i * V, w->Z + i * D);
    for (size_t k = 0; k < w->n; k++) along_normals(w, w->files.P + k * V, w->Z + (w->N + k) * D);
    const size_t d = D / w->m.J;
    const norm_data all = { w->N, w->n, w->q, 3, V, w->X, w->Y, w->files.P };
    const norm_data judged = { w->N, w->n, w->q, d, D, w->X, w->Z, w->Z + w->N * D };
    APSM_TRY(norm_model_make(w->ctx, &all, &w->model));
    APSM_TRY(norm_model_make(w->ctx, &judged, &w->judged));
    APSM_TRY(model_scores(w));
    return apsm_parallel_for(w->ctx, w->N, own_particles, w, "norm");
}

/* ---- one shape ---- */

/* Shapes of the cohort, left out, that are not farther than new shape k; *N: how many count. */
static size_t nearer(const norm_model *m, size_t k, size_t *N)
{
    const double d0 = norm_distance_new(m, k);
    size_t n = 0;
    *N = 0;
    for (size_t i = 0; i < m->N; i++) {
        const double d = norm_distance_own(m, i);
        if (!isnan(d)) ++*N;
        n += d < d0;
    }
    return n;
}

/* Wilson's 95 % interval of a share. */
static void interval(double share, double n, double *low, double *high)
{
    const double z = 1.959963984540054, z2 = z * z / n;
    const double middle = (share + z2 / 2) / (1 + z2);
    const double half = z / (1 + z2) * sqrt(share * (1 - share) / n + z2 / (4 * n));
    *low = fmax(0, middle - half);
    *high = fmin(1, middle + half);
}

static void judge_whole(const norm_model *m, size_t k, norm_result *r)
{
    size_t N;
    const size_t n = nearer(m, k, &N);
    double sum = 0, squares = 0;
    for (size_t i = 0; i < m->N; i++) {
        const double d = norm_distance_own(m, i);
        if (d > 0) sum += log(d), squares += log(d) * log(d);
    }
    const double mean = sum / (double)N,
                 variance = (squares - sum * mean) / (N > 1 ? (double)N - 1 : 1);
    r->distance = norm_distance_new(m, k);
    r->percentile = (double)n / (double)N;
    r->p = (double)(N - n + 1) / (double)(N + 1);
    r->z = (log(r->distance) - mean) / sqrt(variance);
    interval(r->percentile, (double)N, &r->low, &r->high);
}

static apsm_status judge_particles(const norm_job *w, size_t k, norm_result *r)
{
    const size_t J = w->m.J;
    double least = 1;
    size_t as_unusual = 0;
    r->t = malloc((w->modes + 1) * sizeof *r->t);
    r->T2 = malloc((J + 1) * sizeof *r->T2);
    r->p_of = malloc((J + 1) * sizeof *r->p_of);
    r->q_of = malloc((J + 1) * sizeof *r->q_of);
    if (!r->t || !r->T2 || !r->p_of || !r->q_of) return APSM_ERR_MEMORY;
    for (size_t v = 0; v < w->modes; v++) r->t[v] = norm_t(&w->score_model, k, v);
    norm_particles_new(&w->judged, k, r->T2, r->p_of);
    if (w->normal) {
        r->along = malloc((J + 1) * sizeof *r->along);
        if (!r->along) return APSM_ERR_MEMORY;
        for (size_t j = 0; j < J; j++) {
            const double t = norm_t(&w->judged, k, j);
            r->along[j] = isfinite(t) ? t : 0; /* where no shape differs: p is 1 */
        }
    }
    for (size_t j = 0; j < J; j++) least = fmin(least, r->p_of[j]);
    for (size_t i = 0; i < w->N; i++) as_unusual += w->least[i] <= least;
    r->p_particles = (double)(as_unusual + 1) / (double)(w->N + 1);
    return apsm_false_discovery(J, r->p_of, r->q_of);
}

/* ---- halves of the cohort ---- */

/* A random half, as rows of X and Z; the new rows behind. */
static void draw_half(const norm_job *w, uint64_t h, size_t *order, double *X, double *Z)
{
    const size_t half = w->N / 2, V = w->judged.V;
    apsm_random rng = apsm_random_stream(apsm_context_seed(w->ctx), APSM_STREAM_BOOTSTRAP, h, 1);
    for (size_t i = 0; i < w->N; i++) order[i] = i;
    for (size_t i = 0; i < half; i++) {
        const size_t other = i + (size_t)apsm_random_below(&rng, w->N - i), swap = order[i];
        order[i] = order[other];
        order[other] = swap;
        memcpy(X + i * w->q, w->X + order[i] * w->q, w->q * sizeof *X);
        memcpy(Z + i * V, w->Z + order[i] * V, V * sizeof *Z);
    }
    memcpy(X + half * w->q, w->X + w->N * w->q, w->n * w->q * sizeof *X);
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* percentile (n x HALVINGS, out) of every shape by every half that has a norm; NAN without. */
static apsm_status percentiles_of_halves(const norm_job *w, double *percentile)
{
    const size_t half = w->N / 2, V = w->judged.V;
    size_t *order = malloc((w->N + 1) * sizeof *order);
    double *X = malloc(((half + w->n) * w->q + 1) * sizeof *X);
    double *Z = malloc((half * V + 1) * sizeof *Z);
    const norm_data data = { half, w->n, w->q, w->judged.d, V, X, Z, w->Z + w->N * V };
    apsm_status status = order && X && Z ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t h = 0; h < HALVINGS && status == APSM_OK; h++) {
        norm_model m = { 0 };
        size_t N;
        draw_half(w, h, order, X, Z);
        status = norm_model_make(w->ctx, &data, &m);
        for (size_t k = 0; k < w->n; k++)
            percentile[k * HALVINGS + h] =
                status == APSM_OK ? (double)nearer(&m, k, &N) / (double)half : NAN;
        norm_model_free(&m);
        if (status == APSM_ERR_ARG) status = APSM_OK; /* a level is missing in this half */
    }
    free(order);
    free(X);
    free(Z);
    return status;
}

static apsm_status judge_halves(norm_job *w)
{
    double *percentile = malloc((w->n * HALVINGS + 1) * sizeof *percentile);
    if (!percentile) return APSM_ERR_MEMORY;
    const apsm_status status = percentiles_of_halves(w, percentile);
    for (size_t k = 0; k < w->n && status == APSM_OK; k++) {
        size_t n = 0;
        double *p = percentile + k * HALVINGS;
        for (size_t h = 0; h < HALVINGS; h++)
            if (!isnan(p[h])) p[n++] = p[h];
        qsort(p, n, sizeof *p, ascending);
        w->result[k].halves_low = n ? p[n / 20] : NAN;
        w->result[k].halves_high = n ? p[n - 1 - n / 20] : NAN;
    }
    free(percentile);
    return status;
}

static apsm_status judge(norm_job *w)
{
    w->result = calloc(w->n + 1, sizeof *w->result);
    if (!w->result) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < w->n; k++) {
        judge_whole(&w->judged, k, &w->result[k]);
        APSM_TRY(judge_particles(w, k, &w->result[k]));
    }
    APSM_TRY(norm_judge_values(w));
    return judge_halves(w);
}

/* ---- all ---- */

static void norm_job_free(norm_job *w)
{
    for (size_t k = 0; w->result && k < w->n; k++) {
        free(w->result[k].t);
        free(w->result[k].T2);
        free(w->result[k].p_of);
        free(w->result[k].q_of);
        free(w->result[k].along);
    }
    free(w->result);
    free(w->names);
    free(w->row);
    free(w->X);
    free(w->Y);
    free(w->Z);
    free(w->least);
    free(w->normal);
    norm_values_free(w);
    json_decref(w->notes);
    norm_model_free(&w->model);
    norm_model_free(&w->judged);
    norm_model_free(&w->score_model);
    particle_files_free(&w->files);
    apsm_table_free(&w->table);
    model_folder_free(&w->m);
}

static apsm_status compare_with_norm(apsm_context *ctx, const apsm_norm_settings *settings)
{
    norm_job w = { .ctx = ctx, .s = settings, .notes = json_array() };
    apsm_status status = w.notes ? read_all(&w) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = choose_rows(&w);
    if (status == APSM_OK) status = make_design(&w);
    if (status == APSM_OK) status = norm_find_normals(&w);
    if (status == APSM_OK) status = make_models(&w);
    if (status == APSM_OK) status = judge(&w);
    if (status == APSM_OK) status = norm_write_results(&w);
    if (status == APSM_OK) norm_tell(&w);
    norm_job_free(&w);
    return status;
}

APSM_BY_SIZE(apsm_statistics_norm, apsm_norm_settings, compare_with_norm)
