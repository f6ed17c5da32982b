/* Results of a test: OF_ON.json, OF_ON.csv, and two or three lines of what they say. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files/files.h"
#include "folder/names.h"
#include "statistics/group_test.h"
#include "statistics/results.h"

#define FORMAT_TEST "apsm-test"
enum { TEST_VERSION = 1 };
static const double alpha = 0.05, power = 0.8, wide = 1.5;

static const char *const on_texts[] = {
    "form: particles as the model has them, size included",
    "shape: particles scaled to one centroid size and aligned by generalised Procrustes",
    ("size: centroid size, the root of the sum of squared distances of the particles from their "
     "centroid"),
    "modes: scores of the modes that hold 95 % of the variance",
    "column: a column of numbers of the table"
};

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
    for (size_t i = 0; i < t->m.I; i++)
        if (t->used[i] == used && (!uncertified || !model_folder_is_certified(&t->m, i)))
            json_array_append_new(names, json_string(t->m.names[i]));
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
    const apsm_column *c = group_test_category(t);
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
                             of, "on", group_test_on_word(t), "on_text", on_texts[t->on],
                             "subjects", (json_int_t)t->N, "coefficients", (json_int_t)t->design.q,
                             "permutations", (json_int_t)r->permutations, "exact", r->exact);
    if (!root) return NULL;
    json_object_set_new(root, "model_sha256", json_string(model_sha256));
    if (t->spread > 0) json_object_set_new(root, "variance_ratio", json_real(t->spread));
    if (t->s->unequal) json_object_set_new(root, "variances", json_string("unequal"));
    if (t->s->stop_risk > 0)
        json_object_set_new(root, "stopping",
                            json_pack("{s:f, s:b}", "risk", t->s->stop_risk, "early", r->stopped));
    if (t->title) json_object_set_new(root, "title", json_string(t->title));
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

apsm_status group_test_hash(const group_test *t, char hex[65])
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
    snprintf(name, size, "%s_%.60s", t->stem ? t->stem : of, group_test_on_word(t));
    results_plain_name(name);
}

apsm_status group_test_claim(const group_test *t)
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

static apsm_status write_files(const group_test *t)
{
    char stem[200], name[240], sha256[65] = "";
    char *folder = results_folder(t->s->folder, t->s->out);
    result_name(t, sizeof stem, stem);
    apsm_status status = folder ? apsm_make_folder(t->ctx, folder) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = group_test_hash(t, sha256);
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

apsm_status group_test_write(const group_test *t)
{
    APSM_TRY(write_files(t));
    if (!t->s->subjects || t->s->out) return APSM_OK;
    return apsm_table_keep(t->ctx, t->s->folder, t->s->subjects, t->m.I, t->m.names);
}

void group_test_tell(const group_test *t)
{
    const apsm_permutation_result *r = &t->result;
    size_t familywise = 0, q = 0, cluster = 0, uncertain = 0, used = 0;
    char of[200];
    apsm_term_name(&t->formula.term[t->formula.of], sizeof of, of);
    for (size_t v = 0; v < t->V; v++) {
        familywise += r->p_familywise[v] <= alpha;
        q += r->q[v] <= alpha;
        cluster += r->p_enhanced && r->p_enhanced[v] <= alpha;
    }
    for (size_t i = 0; i < t->m.I; i++) {
        used += t->used[i];
        uncertain += t->used[i] && !model_folder_is_certified(&t->m, i);
    }
    apsm_log(t->ctx, APSM_LOG_INFO,
             "%s on %s of %zu %s: p = %.4g (%s%zu %s%s), %.1f %% of the variance that the other "
             "terms leave",
             t->title ? t->title : of, group_test_on_word(t), used,
             t->title || t->within ? "shapes" : "subjects", r->p_ratio, r->exact ? "all " : "",
             r->permutations, t->s->unequal ? "draws of signs" : "permutations",
             r->stopped ? ", more would not change it" : "", 100 * r->ratio / (1 + r->ratio));
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
    if (t->spread > wide && !t->s->unequal)
        apsm_log(
            t->ctx, APSM_LOG_WARNING,
            "one group varies %.1f times as much as another (variance): where groups differ in "
            "size, too, single particles give false alarms; see what --variances unequal says",
            t->spread);
    if (uncertain > 0)
        apsm_log(t->ctx, APSM_LOG_WARNING,
                 "%zu of the %zu shapes are not certified: look at them before you trust this",
                 uncertain, used);
}
