/* What is judged of a joint: evaluation.json, features.csv, certificate.json. */
#include "assemble/writing.h"

#include <math.h>
#include <stdlib.h>

#include "files/files.h"
#include "folder/evaluation_json.h"
#include "folder/names.h"

/* Of a part, or of all: the template is left out, since it is its own reconstruction. */
typedef struct average {
    size_t n;
    double mean, worst, max;
} average;

static void add_distance(average *a, const apsm_distance_summary *d)
{
    a->n++;
    a->mean += d->mean;
    a->worst += d->max;
    a->max = fmax(a->max, d->max);
}

static json_t *json_average(const average *a)
{
    const double n = a->n > 0 ? (double)a->n : 1;
    return json_pack("{s:f, s:f, s:f}", "mean", a->mean / n, "max", a->max, "mean_max",
                     a->worst / n);
}

static json_t *json_surface_of_part(const writing *w, size_t d)
{
    average a = { 0 };
    json_t *shapes = json_array();
    for (size_t i = 0; i < w->c->I; i++) {
        const apsm_distance_summary *s = &w->f->surface[i * w->c->n + d].two_way;
        if (i != w->f->like[d]) add_distance(&a, s);
        json_array_append_new(shapes,
                              json_pack("{s:s, s:f, s:f, s:f}", "name", writing_subject(w, i),
                                        "mean", s->mean, "p95", s->p95, "max", s->max));
    }
    json_t *part = json_average(&a);
    json_object_set_new(part, "name", json_string(writing_part(w, d)));
    json_object_set_new(part, "template", json_string(writing_subject(w, w->f->like[d])));
    json_object_set_new(part, "per_shape", shapes);
    return part;
}

static void worse(apsm_distance_summary *sum, const apsm_distance_summary *d, double share)
{
    sum->mean += share * d->mean;
    sum->median += share * d->median;
    sum->p95 = fmax(sum->p95, d->p95);
    sum->p99 = fmax(sum->p99, d->p99);
    sum->max = fmax(sum->max, d->max);
}

/* Of a subject: means are those of its parts, quantiles and maxima those of the worst part. */
static apsm_surface_distance distance_of_subject(const writing *w, size_t i)
{
    const size_t n = w->c->n;
    apsm_surface_distance all = { 0 };
    for (size_t d = 0; d < n; d++) {
        const apsm_surface_distance *s = &w->f->surface[i * n + d];
        worse(&all.two_way, &s->two_way, 1 / (double)n);
        worse(&all.pull, &s->pull, 1 / (double)n);
        worse(&all.push, &s->push, 1 / (double)n);
        worse(&all.disagreement, &s->disagreement, 1 / (double)n);
        all.diagonal = fmax(all.diagonal, s->diagonal);
    }
    return all;
}

static json_t *json_surface(const writing *w)
{
    average a = { 0 };
    json_t *shapes = json_array(), *parts = json_array();
    for (size_t i = 0; i < w->c->I; i++) {
        const apsm_surface_distance s = distance_of_subject(w, i);
        for (size_t d = 0; d < w->c->n; d++)
            if (i != w->f->like[d]) add_distance(&a, &w->f->surface[i * w->c->n + d].two_way);
        json_array_append_new(shapes,
                              json_pack("{s:s, s:f, s:f, s:f, s:f, s:f, s:f, s:o, s:o, s:o}",
                                        "name", writing_subject(w, i), "mean", s.two_way.mean,
                                        "median", s.two_way.median, "p95", s.two_way.p95, "p99",
                                        s.two_way.p99, "max", s.two_way.max, "diagonal", s.diagonal,
                                        "pull", evaluation_json_distance(&s.pull), "push",
                                        evaluation_json_distance(&s.push), "disagreement",
                                        evaluation_json_distance(&s.disagreement)));
    }
    for (size_t d = 0; d < w->c->n; d++) json_array_append_new(parts, json_surface_of_part(w, d));
    json_t *surface = json_average(&a);
    json_object_set_new(surface, "parts", parts);
    json_object_set_new(surface, "per_shape", shapes);
    return surface;
}

/* How near the parts a and b of every subject come. */
static json_t *json_space(const writing *w, size_t a, size_t b, size_t pair)
{
    json_t *list = json_array();
    for (size_t i = 0; i < w->c->I; i++) {
        const joint_contact *k = &w->f->contact[i * w->f->pairs + pair];
        json_array_append_new(list,
                              json_pack("{s:s, s:f, s:f, s:f, s:f}", "name", writing_subject(w, i),
                                        "gap", k->own.gap, "depth", k->own.depth, "rebuilt_gap",
                                        k->rebuilt.gap, "rebuilt_depth", k->rebuilt.depth));
    }
    return json_pack("{s:[s, s], s:o}", "parts", writing_part(w, a), writing_part(w, b),
                     "per_shape", list);
}

static json_t *json_spaces(const writing *w)
{
    json_t *spaces = json_array();
    size_t pair = 0;
    for (size_t a = 0; a < w->c->n; a++)
        for (size_t b = a + 1; b < w->c->n; b++)
            json_array_append_new(spaces, json_space(w, a, b, pair++));
    if (json_array_size(spaces) == pair) return spaces;
    json_decref(spaces);
    return NULL;
}

static apsm_status write_evaluation(writing *w)
{
    json_t *spaces = json_spaces(w);
    if (!spaces) return APSM_ERR_MEMORY;
    return writing_json(w, FOLDER_EVALUATION,
                        evaluation_json(&w->f->evaluation, writing_subject(w, w->f->like[0]),
                                        json_surface(w), joint_landmarks(w->job, w->c), spaces));
}

static apsm_status write_fields(writing *w)
{
    bool wrote;
    char *path = apsm_path_join(w->job->settings->run.folder, FOLDER_FEATURES);
    apsm_status status = path ? joint_write_fields(w->job, w->c, path, &wrote) : APSM_ERR_MEMORY;
    free(path);
    if (status == APSM_OK && wrote && json_array_append_new(w->files, json_string(FOLDER_FEATURES)))
        status = APSM_ERR_MEMORY;
    return status;
}

static apsm_status write_certificate(writing *w)
{
    return writing_json(w, FOLDER_CERTIFICATE, joint_certificate(w->job, w->c, w->f));
}

apsm_status joint_write_judged(writing *w)
{
    APSM_TRY(write_evaluation(w));
    APSM_TRY(write_fields(w));
    return write_certificate(w);
}
