/* The verdict on a joint: certified if all its parts are, and no joint space closes.  Lists of
 * particles are those of the parts, counted as the joint counts its particles. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "assemble/job.h"
#include "core/number.h"
#include "folder/names.h"

typedef struct judging {
    const joint_job *job;
    const joint_cohort *c;
    const joint_figures *f;
} judging;

/* What part d's certificate says of subject i. */
static const json_t *judged_shape(const judging *g, size_t i, size_t d)
{
    const model_folder *m = &g->c->folder[d];
    return json_array_get(json_object_get(m->certificate, "per_shape"), g->c->row[i * g->c->n + d]);
}

static bool is_certified(const json_t *shape)
{
    const char *verdict = json_string_value(json_object_get(shape, "verdict"));
    return verdict && strcmp(verdict, "certified") == 0;
}

static double spacing_of(const judging *g, size_t d)
{
    return json_number_value(json_object_get(g->c->folder[d].certificate, "h"));
}

/* ---- joint spaces ---- */

/* The rebuilt surfaces go into each other deeper than a quarter of the particles' distance beyond
 * what the subject's own do. */
static bool closes(const judging *g, size_t i, size_t pair, double h)
{
    const joint_contact *k = &g->f->contact[i * g->f->pairs + pair];
    return k->rebuilt.depth > k->own.depth + 0.25 * h;
}

static json_t *closed_spaces(const judging *g, size_t i)
{
    json_t *closed = json_array();
    size_t pair = 0;
    for (size_t a = 0; a < g->c->n; a++)
        for (size_t b = a + 1; b < g->c->n; b++, pair++)
            if (closes(g, i, pair, fmin(spacing_of(g, a), spacing_of(g, b))))
                json_array_append_new(
                    closed, json_sprintf("%s and %s", g->job->part[a].name, g->job->part[b].name));
    return closed;
}

/* ---- lists of particles ---- */

static json_t *shifted(const json_t *value, json_int_t by)
{
    if (json_is_integer(value)) return json_integer(json_integer_value(value) + by);
    size_t k;
    const json_t *one;
    json_t *list = json_array();
    json_array_foreach(value, k, one)
    {
        json_array_append_new(list, shifted(one, by));
    }
    return list;
}

/* Adds the lists of a part to the joint's; figures of the surface are the worst of all parts. */
static void add_lists(const json_t *shape, size_t first, json_t *into)
{
    static const char *const lists[] = { "mismatched_1.5_1.5", "mismatched_1.5_2.0", "lost",
                                         "swaps", "folds" };
    for (size_t k = 0; k < sizeof lists / sizeof *lists; k++) {
        json_t *more = shifted(json_object_get(shape, lists[k]), (json_int_t)first);
        if (!json_object_get(into, lists[k])) json_object_set_new(into, lists[k], json_array());
        json_array_extend(json_object_get(into, lists[k]), more);
        json_decref(more);
    }
    const double off = json_number_value(json_object_get(shape, "off_surface_max")),
                 apart = json_number_value(json_object_get(shape, "min_separation"));
    const json_t *before = json_object_get(into, "min_separation");
    json_object_set_new(
        into, "off_surface_max",
        json_real(fmax(off, json_number_value(json_object_get(into, "off_surface_max")))));
    json_object_set_new(into, "min_separation",
                        json_real(before ? fmin(apart, json_number_value(before)) : apart));
}

/* ---- one subject ---- */

/* "talus: looks mirrored", or that it needs review for want of a reason. */
static void add_reasons(const char *part, const json_t *shape, json_t *reasons)
{
    size_t k;
    const json_t *reason;
    const json_t *list = json_object_get(shape, "reasons");
    json_array_foreach(list, k, reason)
    {
        json_array_append_new(reasons, json_sprintf("%s: %s", part, json_string_value(reason)));
    }
    if (json_array_size(list) == 0)
        json_array_append_new(reasons, json_sprintf("%s needs review", part));
}

static json_t *json_verdict(const judging *g, size_t i, bool *certified)
{
    json_t *parts = json_object(), *reasons = json_array(), *closed = closed_spaces(g, i);
    json_t *verdict = json_object();
    *certified = json_array_size(closed) == 0;
    if (!*certified) json_array_append_new(reasons, json_string("a joint space is closed"));
    json_object_set_new(verdict, "name", json_string(g->job->subject[i].name));
    json_object_set_new(verdict, "verdict", json_null()); /* its place */
    for (size_t d = 0; d < g->c->n; d++) {
        const json_t *shape = judged_shape(g, i, d);
        if (!is_certified(shape)) {
            add_reasons(g->job->part[d].name, shape, reasons);
            *certified = false;
        }
        add_lists(shape, g->c->first[d], verdict);
        json_object_set_new(parts, g->job->part[d].name, json_deep_copy(shape));
    }
    json_object_set_new(verdict, "verdict", json_string(*certified ? "certified" : "needs review"));
    json_object_set_new(verdict, "reasons", reasons);
    json_object_set_new(verdict, "closed_joint_spaces", closed);
    json_object_set_new(verdict, "parts", parts);
    return verdict;
}

/* ---- the model's joints ---- */

/* "mode 1 -2sd closes the space between a and b". */
static json_t *json_closes(const judging *g, size_t made, size_t a, size_t b, double depth)
{
    char name[JOINT_MADE_LENGTH], deep[APSM_NUMBER_LENGTH];
    joint_made_name(g->f, made, name);
    apsm_print(deep, sizeof deep, "%.3g", depth);
    return json_pack("{s:s, s:s, s:o}", "shape", name, "aspect", "joint space", "text",
                     json_sprintf("closes the space between %s and %s: %s deep, more than twice "
                                  "what any subject has",
                                  g->job->part[a].name, g->job->part[b].name, deep));
}

/* A note for each: [{shape, aspect, text}]; poses and shapes alone are counted.  NULL without
 * memory. */
static json_t *json_notes(const judging *g)
{
    json_t *notes = json_array();
    for (size_t made = 0; made < g->f->made; made++)
        for (size_t a = 0, pair = 0; a < g->c->n; a++)
            for (size_t b = a + 1; b < g->c->n; b++, pair++) {
                if (!joint_made_closes(g->c, g->f, made, pair) || joint_made_is_apart(g->f, made))
                    continue;
                const double depth = g->f->spaces[made * g->f->pairs + pair].depth;
                if (json_array_append_new(notes, json_closes(g, made, a, b, depth))) {
                    json_decref(notes);
                    return NULL;
                }
            }
    return notes;
}

/* The subject that a part's model has under that name, as the joint has it; NULL: none. */
static const char *subject_of(const judging *g, size_t d, const char *name)
{
    for (size_t i = 0; name && i < g->c->I; i++) {
        const char *own = json_string_value(json_object_get(judged_shape(g, i, d), "name"));
        if (own && strcmp(own, name) == 0) return g->job->subject[i].name;
    }
    return NULL;
}

/* What the parts' certificates say of their shapes: the same, with the part and the subject. */
static int add_part_notes(const judging *g, json_t *notes)
{
    int failed = 0;
    for (size_t d = 0; d < g->c->n; d++) {
        size_t k;
        json_t *note;
        json_array_foreach(json_object_get(g->c->folder[d].certificate, "notes"), k, note)
        {
            json_t *own = json_copy(note);
            const char *subject =
                subject_of(g, d, json_string_value(json_object_get(own, "shape")));
            failed |= json_object_set_new(own, "part", json_string(g->job->part[d].name));
            if (subject) failed |= json_object_set_new(own, "shape", json_string(subject));
            failed |= json_array_append_new(notes, own);
        }
    }
    return failed;
}

/* Spaces of joints that are made, of poses or shapes alone or not, and how many of them close. */
static void count_made(const judging *g, bool apart, size_t *spaces, size_t *closed)
{
    *spaces = *closed = 0;
    for (size_t made = 0; made < g->f->made; made++)
        for (size_t pair = 0; pair < g->f->pairs; pair++) {
            if (joint_made_is_apart(g->f, made) != apart) continue;
            ++*spaces;
            *closed += joint_made_closes(g->c, g->f, made, pair);
        }
}

static void tell_notes(const judging *g, const json_t *notes)
{
    size_t k;
    const json_t *note;
    json_array_foreach(notes, k, note)
    {
        apsm_log(g->job->ctx, APSM_LOG_WARNING, "%s %s (contacts.csv)",
                 json_string_value(json_object_get(note, "shape")),
                 json_string_value(json_object_get(note, "text")));
    }
}

/* Spaces that were measured, and those that close: of subjects as they are rebuilt, of the mean and
 * modes, of poses and shapes alone. */
typedef struct spaces_judged {
    size_t rebuilt, rebuilt_closed, made, made_closed, apart, apart_closed;
} spaces_judged;

static spaces_judged judge_spaces(const judging *g, size_t rebuilt_closed)
{
    spaces_judged n = { .rebuilt = g->c->I * g->f->pairs, .rebuilt_closed = rebuilt_closed };
    count_made(g, false, &n.made, &n.made_closed);
    count_made(g, true, &n.apart, &n.apart_closed);
    return n;
}

static json_t *json_spaces_judged(const spaces_judged *n)
{
    return json_pack("{s:I, s:I, s:I, s:I, s:I, s:I}", "rebuilt", (json_int_t)n->rebuilt,
                     "rebuilt_closed", (json_int_t)n->rebuilt_closed, "made", (json_int_t)n->made,
                     "made_closed", (json_int_t)n->made_closed, "apart", (json_int_t)n->apart,
                     "apart_closed", (json_int_t)n->apart_closed);
}

/* ---- all ---- */

static void tell_review(const judging *g, const char *name, const json_t *verdict)
{
    char text[512];
    size_t k, used;
    const json_t *reason;
    snprintf(text, sizeof text, "%s needs review", name);
    json_array_foreach(json_object_get(verdict, "reasons"), k, reason)
    {
        used = strlen(text);
        snprintf(text + used, sizeof text - used, "%s%s", k ? "; " : ": ",
                 json_string_value(reason));
    }
    apsm_log(g->job->ctx, APSM_LOG_WARNING, "%s", text);
}

static void tell(const judging *g, size_t certified, const spaces_judged *n)
{
    const apsm_pose_shape *ps = &g->f->poses;
    double pose = 0, shape = 0;
    for (size_t k = 0; k < ps->poses.modes; k++) pose += ps->poses.variance[k];
    for (size_t k = 0; k < ps->shapes.modes; k++) shape += ps->shapes.variance[k];
    apsm_log(g->job->ctx, APSM_LOG_INFO,
             "joint of %zu parts, %zu subjects: %.0f %% of the variance is pose", g->c->n, g->c->I,
             pose + shape > 0 ? 100 * pose / (pose + shape) : 0.0);
    apsm_log(
        g->job->ctx, APSM_LOG_INFO,
        "joint spaces that close: %zu of %zu rebuilt ones, %zu of %zu of the mean and modes at "
        "two standard deviations, %zu of %zu where poses or shapes vary alone",
        n->rebuilt_closed, n->rebuilt, n->made_closed, n->made, n->apart_closed, n->apart);
    apsm_log(g->job->ctx, APSM_LOG_INFO, "%zu of %zu joints certified", certified, g->c->I);
}

static double least_spacing(const judging *g)
{
    double least = INFINITY;
    for (size_t d = 0; d < g->c->n; d++) least = fmin(least, spacing_of(g, d));
    return least;
}

json_t *joint_certificate(const joint_job *job, const joint_cohort *cohort,
                          const joint_figures *figures)
{
    const judging g = { job, cohort, figures };
    json_t *shapes = json_array(), *notes = json_notes(&g);
    size_t certified = 0, closed = 0;
    for (size_t i = 0; i < cohort->I; i++) {
        bool good;
        json_t *verdict = json_verdict(&g, i, &good);
        certified += good;
        closed += json_array_size(json_object_get(verdict, "closed_joint_spaces"));
        if (!good) tell_review(&g, job->subject[i].name, verdict);
        json_array_append_new(shapes, verdict);
    }
    const spaces_judged spaces = judge_spaces(&g, closed);
    tell_notes(&g, notes);
    tell(&g, certified, &spaces);
    if (!notes || add_part_notes(&g, notes) || json_array_size(shapes) < cohort->I) {
        json_decref(shapes);
        json_decref(notes);
        return NULL;
    }
    return json_pack("{s:s, s:i, s:s, s:I, s:I, s:s, s:f, s:O*, s:o, s:o, s:o}", "format",
                     FORMAT_CERTIFICATE, "version", CERTIFICATE_VERSION, "verdict",
                     certified == cohort->I ? "certified" : "needs review", "certified",
                     (json_int_t)certified, "shapes", (json_int_t)cohort->I, "template",
                     job->subject[figures->like[0]].name, "h", least_spacing(&g), "thresholds",
                     json_object_get(cohort->folder[0].certificate, "thresholds"), "joint_spaces",
                     json_spaces_judged(&spaces), "notes", notes, "per_shape", shapes);
}
