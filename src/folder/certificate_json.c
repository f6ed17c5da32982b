#include "folder/certificate_json.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>

#include "files/files.h"
#include "folder/names.h"

static json_t *json_indices(size_t n, size_t m, const uint32_t *index)
{
    json_t *rows = json_array();
    for (size_t k = 0; k < n; k++) {
        json_t *row = m == 1 ? json_integer(index[k]) : json_array();
        for (size_t l = 0; m > 1 && l < m; l++)
            json_array_append_new(row, json_integer(index[m * k + l]));
        json_array_append_new(rows, row);
    }
    return rows;
}

/* Of the correspondence, of the other shapes. */
static json_t *json_reasons(unsigned reasons, unsigned doubts)
{
    json_t *texts = json_array();
    for (unsigned r = 0; r < APSM_REVIEW_COUNT; r++)
        if (reasons & (1u << r))
            json_array_append_new(texts, json_string(apsm_review_text((apsm_review)r)));
    for (unsigned d = 0; d < APSM_DOUBT_COUNT; d++)
        if (doubts & (1u << d))
            json_array_append_new(texts, json_string(apsm_doubt_text((apsm_doubt)d)));
    return texts;
}

static json_t *json_grades(const cohort_certificate *c, size_t i)
{
    json_t *grades = json_object();
    for (unsigned a = 0; a < APSM_ASPECT_COUNT; a++)
        json_object_set_new(grades, apsm_aspect_name((apsm_aspect)a),
                            json_string(certify_grade(c, i, (apsm_aspect)a)));
    return grades;
}

/* Particles j with x[j] of at least `least`; none unless wanted. */
static json_t *json_where(size_t J, const double *x, double least, bool wanted)
{
    json_t *list = json_array();
    for (size_t j = 0; wanted && j < J; j++)
        if (x[j] >= least) json_array_append_new(list, json_integer((json_int_t)j));
    return list;
}

static json_t *json_opposed(const apsm_judgement *g, size_t i)
{
    json_t *list = json_array();
    for (size_t j = 0; j < g->J; j++)
        if (g->opposed[i * g->J + j]) json_array_append_new(list, json_integer((json_int_t)j));
    return list;
}

/* null: it is not known, or there is no other way to lay the shape. */
static json_t *json_known(double x)
{
    return isfinite(x) ? json_real(x) : json_null();
}

/* A correlation again; null: there is no other way to lay the shape. */
static json_t *json_agreement(double z)
{
    return isfinite(z) ? json_real(tanh(z)) : json_null();
}

/* The particles around a part that is unlike the others', the one in its middle first. */
static json_t *json_unlike(const apsm_judgement *g, size_t i, const apsm_departure *part,
                           bool wanted)
{
    if (!wanted) return json_array();
    uint32_t *queue = malloc(g->J * sizeof *queue);
    bool *in = malloc(g->J * sizeof *in);
    json_t *list = queue && in ? json_pack("[I]", (json_int_t)part->at) : NULL;
    if (list) apsm_judgement_around(g, i, part->at, in, queue);
    for (size_t j = 0; list && j < g->J; j++)
        if (j != part->at && in[j]) json_array_append_new(list, json_integer((json_int_t)j));
    free(queue);
    free(in);
    return list;
}

static json_t *json_judged(const cohort_certificate *c, size_t i)
{
    if (!c->judged) return json_null();
    const apsm_judgement *g = &c->judgement;
    const apsm_findings *f = &g->shape[i];
    const double *slip = g->slip + i * g->J, *uncovered = g->uncovered + i * g->J;
    const bool slipped = c->doubts[i] & (1u << APSM_DOUBT_SLIP);
    const double unknown = g->looks > 0 ? 0.0 : NAN;
    const bool missed = c->doubts[i] & (1u << APSM_DOUBT_ENDS);
    const bool unlike = c->doubts[i] & (1u << APSM_DOUBT_PART);
    const apsm_verdict_options options = apsm_verdict_defaults();
    const apsm_departure *part = apsm_verdict_part(f, &options);
    return json_pack(
        "{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:f, s:f, s:f, s:o, s:o, s:f, s:f, s:f, "
        "s:f, s:f, s:f, s:o}",
        "agreement", json_agreement(f->agreement), "agreement_turned",
        json_agreement(f->turn[0].agreement), "agreement_mirrored",
        json_agreement(f->turn[1].agreement), "evidence_pose", json_known(f->turn[0].evidence),
        "evidence_hand", json_known(f->turn[1].evidence), "slip_times",
        json_known(f->slip + unknown), "slip", json_known(f->slip_size + unknown), "slipped",
        json_where(g->J, slip, 0.5 * slip[f->slip_at], slipped), "reach_excess", f->reach_excess,
        "reach", f->reach, "farthest", f->farthest, "beyond",
        json_where(g->J, uncovered, 0.5 * f->reach, missed), "opposed", json_opposed(g, i), "size",
        f->size, "off", f->off, "off_excess", f->off_excess, "part_times", part->times,
        "part_excess", part->excess, "part", part->size, "unlike", json_unlike(g, i, part, unlike));
}

static json_t *json_shape(const cohort_certificate *all, size_t i, const char *name)
{
    const apsm_certificate *c = &all->shape[i];
    return json_pack("{s:s, s:s, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:f, s:f, s:f}",
                     "name", name, "verdict", certify_verdict_of(all, i), "reasons",
                     json_reasons(c->reasons, all->doubts[i]), "grades", json_grades(all, i),
                     "probability_lost", json_known(certify_probability(all, i)), "judged",
                     json_judged(all, i), "mismatched_1.5_1.5",
                     json_indices(c->mismatched_strict, 1, c->mismatched_strict_list),
                     "mismatched_1.5_2.0", json_indices(c->mismatched, 1, c->mismatched_list),
                     "lost", json_indices(c->lost, 1, c->lost_list), "swaps",
                     json_indices(c->swaps, 2, (const uint32_t *)c->swap), "folds",
                     json_indices(c->folds, 3, (const uint32_t *)c->fold), "off_surface_mean",
                     c->off_surface_mean, "off_surface_max", c->off_surface_max, "min_separation",
                     isfinite(c->min_separation) ? c->min_separation : 0.0);
}

static json_t *json_thresholds(void)
{
    const apsm_certificate_options o = apsm_certificate_defaults();
    const apsm_verdict_options v = apsm_verdict_defaults();
    return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, "
                     "s:f, s:f, s:f, s:f, "
                     "s:f, s:f, s:f, s:i}",
                     "mismatched_share", o.mismatched, "stretch", o.stretch, "off_surface",
                     o.off_surface, "coincident", o.coincident, "slip_times", v.slip, "slip_size",
                     v.slip_size, "reach_excess", v.reach_excess, "reach", v.reach_size, "farthest",
                     v.farthest, "off", v.off, "off_excess", v.off_excess, "size", v.size,
                     "size_excess", v.size_excess, "part_times", v.part, "part_excess",
                     v.part_excess, "part", v.part_size, "clear_slip_times", v.clear_slip,
                     "clear_slip_size", v.clear_size, "large_part_excess", v.large_excess,
                     "large_part", v.large_size, "evidence_against", v.against, "evidence_told",
                     v.told, "least_shapes", (int)APSM_LEAST_JUDGED);
}

static json_t *json_certificate(const apsm_cohort *cohort, const cohort_certificate *c)
{
    json_t *shapes = json_array();
    for (size_t i = 0; i < c->I; i++)
        if (json_array_append_new(shapes, json_shape(c, i, cohort->shape[i].name))) {
            json_decref(shapes);
            return NULL;
        }
    return json_pack(
        "{s:s, s:i, s:s, s:I, s:I, s:f, s:I, s:I, s:s, s:s, s:f, s:f, s:f, s:o, s:o, s:o}",
        "format", FORMAT_CERTIFICATE, "version", CERTIFICATE_VERSION, "verdict", certify_verdict(c),
        "certified", (json_int_t)certify_count(c, "certified"), "shapes", (json_int_t)c->I,
        "expected_lost", certify_expected_lost(c), "pose_untold",
        (json_int_t)certify_untold(c, APSM_ASPECT_POSE), "hand_untold",
        (json_int_t)certify_untold(c, APSM_ASPECT_HAND), "template",
        cohort->shape[cohort->template_index].name, "neighbours_of",
        cohort->shape[c->reference].name, "h", c->h, "mean_mismatched_1.5_1.5",
        certify_mean_mismatched(c, true), "mean_mismatched_1.5_2.0",
        certify_mean_mismatched(c, false), "thresholds", json_thresholds(), "notes",
        c->notes ? json_incref(c->notes) : json_array(), "per_shape", shapes);
}

apsm_status certificate_json_write(apsm_context *ctx, const char *path, const apsm_cohort *cohort,
                                   const cohort_certificate *certificate)
{
    json_t *root = json_certificate(cohort, certificate);
    const apsm_status status = apsm_json_write(ctx, path, root);
    json_decref(root);
    return status;
}
