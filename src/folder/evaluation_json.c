#include "folder/evaluation_json.h"

#include <math.h>

#include "files/files.h"
#include "folder/mode_trust_json.h"
#include "folder/names.h"

json_t *evaluation_json_distance(const apsm_distance_summary *d)
{
    return json_pack("{s:f, s:f, s:f, s:f, s:f}", "mean", d->mean, "median", d->median, "p95",
                     d->p95, "p99", d->p99, "max", d->max);
}

/* An array that misses entries, for want of memory or because one was not finite, is none: then its
 * file is refused. */
static json_t *all_or_none(json_t *array, size_t n)
{
    if (json_array_size(array) == n) return array;
    json_decref(array);
    return NULL;
}

/* ---- surface distance ---- */

static json_t *json_shape_distance(const evaluation_told *t, size_t i)
{
    const apsm_surface_distance *d = &t->figures->surface[i];
    return json_pack("{s:s, s:f, s:f, s:f, s:f, s:o, s:o, s:o}", "name", t->names[i], "mean",
                     d->two_way.mean, "p95", d->two_way.p95, "max", d->two_way.max, "diagonal",
                     d->diagonal, "pull", evaluation_json_distance(&d->pull), "push",
                     evaluation_json_distance(&d->push), "disagreement",
                     evaluation_json_distance(&d->disagreement));
}

static json_t *json_others(const apsm_evaluation *e)
{
    const apsm_surface_aggregate *a = &e->other_templates;
    if (e->others == 0) return json_null();
    return json_pack("{s:I, s:f, s:f, s:f}", "templates", (json_int_t)e->others, "mean", a->mean,
                     "max", a->max, "mean_max", a->mean_max);
}

static json_t *json_surface(const evaluation_told *t)
{
    const apsm_evaluation *e = t->figures;
    if (!e->surface) return json_null();
    const apsm_surface_aggregate *a = &e->surface_summary.two_way;
    json_t *shapes = json_array();
    for (size_t i = 0; i < e->shapes; i++) json_array_append_new(shapes, json_shape_distance(t, i));
    shapes = all_or_none(shapes, e->shapes);
    return json_pack("{s:f, s:f, s:f, s:o, s:o}", "mean", a->mean, "max", a->max, "mean_max",
                     a->mean_max, "other_templates", json_others(e), "per_shape", shapes);
}

/* ---- landmarks ---- */

static json_t *number_or_null(double x)
{
    return isfinite(x) ? json_real(x) : json_null();
}

static json_t *json_shape_landmarks(const evaluation_told *t, size_t i)
{
    const landmark_errors *e = t->landmarks;
    json_t *errors = json_array();
    for (size_t l = 0; l < e->L; l++)
        json_array_append_new(errors, number_or_null(e->error[i * e->L + l]));
    return json_pack("{s:s, s:o, s:o}", "name", t->names[i], "mean", number_or_null(e->of_shape[i]),
                     "errors", errors);
}

static json_t *json_landmarks(const evaluation_told *t)
{
    const landmark_errors *e = t->landmarks;
    if (e->L == 0) return json_null();
    json_t *names = json_array(), *means = json_array(), *shapes = json_array();
    for (size_t l = 0; l < e->L; l++) {
        json_array_append_new(names, json_string(t->landmark_names[l]));
        json_array_append_new(means, number_or_null(e->of_landmark[l]));
    }
    for (size_t i = 0; i < e->I; i++) json_array_append_new(shapes, json_shape_landmarks(t, i));
    return json_pack("{s:s, s:o, s:I, s:o, s:o, s:o}", "use", t->landmark_use, "mean",
                     number_or_null(e->mean), "judged", (json_int_t)e->judged, "names", names,
                     "means", means, "per_shape", shapes);
}

/* ---- the files ---- */

json_t *evaluation_json(const apsm_evaluation *e, const char *template_name, json_t *surface,
                        json_t *landmarks, json_t *joint_spaces)
{
    return json_pack(
        "{s:s, s:i, s:I, s:I, s:s, s:s, s:I, s:I, s:s, s:o, s:o, s:o*, s:o, s:o, s:o, s:o, s:o, "
        "s:o, s:o}",
        "format", FORMAT_EVALUATION, "version", EVALUATION_VERSION, "particles",
        (json_int_t)e->particles, "shapes", (json_int_t)e->shapes, "definition",
        apsm_definition_name(e->definition), "definition_text", apsm_definition_text(e->definition),
        "specificity_samples", (json_int_t)e->samples, "generalization_shapes",
        (json_int_t)e->left_out, "template", template_name, "surface_distance", surface,
        "landmarks", landmarks, "joint_spaces", joint_spaces, "variances",
        apsm_json_vector(e->modes, e->variance), "modes", mode_trust_json(e->modes, e->trust),
        "compactness", apsm_json_vector(e->n_compactness, e->compactness), "generalization",
        apsm_json_vector(e->n_generalization, e->generalization), "generalization_standard_error",
        apsm_json_vector(e->n_generalization, e->generalization_error), "specificity",
        apsm_json_vector(e->n_specificity, e->specificity), "specificity_standard_error",
        apsm_json_vector(e->n_specificity, e->specificity_error));
}

apsm_status evaluation_json_write(apsm_context *ctx, const char *path, const evaluation_told *told)
{
    json_t *root = evaluation_json(told->figures, told->names[told->template_index],
                                   json_surface(told), json_landmarks(told), NULL);
    const apsm_status status = apsm_json_write(ctx, path, root);
    json_decref(root);
    return status;
}

static void write_csv_numbers(apsm_writer *csv, size_t n, const double *x)
{
    for (size_t k = 0; k < n; k++) {
        apsm_writer_printf(csv, ",");
        if (isfinite(x[k])) apsm_writer_number(csv, x[k]);
    }
}

static void write_csv_row(apsm_writer *csv, const evaluation_told *t,
                          const cohort_certificate *certificate, size_t i)
{
    const apsm_certificate *c = &certificate->shape[i];
    const apsm_surface_distance *d = t->figures->surface ? &t->figures->surface[i] : NULL;
    const double cells[] = { d ? d->two_way.mean : NAN, d ? d->two_way.p95 : NAN,
                             d ? d->two_way.max : NAN,  (double)c->mismatched_strict,
                             (double)c->mismatched,     (double)c->swaps,
                             (double)c->folds,          c->off_surface_max };
    apsm_writer_csv(csv, t->names[i]);
    write_csv_numbers(csv, sizeof cells / sizeof cells[0], cells);
    apsm_writer_printf(csv, ",%s", certify_verdict_of(certificate, i));
    if (t->landmarks->L > 0) write_csv_numbers(csv, 1, &t->landmarks->of_shape[i]);
    apsm_writer_printf(csv, "\n");
}

apsm_status evaluation_csv_write(apsm_context *ctx, const char *path, const evaluation_told *t,
                                 const cohort_certificate *certificate)
{
    apsm_writer *csv = NULL;
    APSM_TRY(apsm_writer_open(ctx, path, &csv));
    apsm_writer_printf(csv,
                       "name,surface_mean,surface_p95,surface_max,mismatched_1.5_1.5,"
                       "mismatched_1.5_2.0,swaps,folds,off_surface_max,verdict%s\n",
                       t->landmarks->L > 0 ? ",landmark_mean" : "");
    for (size_t i = 0; i < certificate->I; i++) write_csv_row(csv, t, certificate, i);
    return apsm_writer_commit(csv);
}
