#include "run/certify.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "folder/names.h"
#include "optimize/correspondence_loss.h"

/* Room for F = 2.0 in the rows of a shape, and to tell how far neighbours beyond it are: that is
 * looked up only where it may change the verdict. */
static const double shape_factor = 2.0, far_factor = 4.0;

typedef struct judging {
    const apsm_cohort *cohort;
    size_t J;
    const double *P; /* I x J x 3 */
    double h;
    apsm_neighbourhoods reference;
    uint32_t *N6;    /* J x 6 */
    const double *T; /* J x 3: the template's particles */
    double *TN;      /* J x 3 */
    cohort_certificate *out;
} judging;

/* What is looked up on one shape. */
typedef struct looked_up {
    apsm_surface_point *S;
    double *N, *distance; /* J x 3, J */
    apsm_neighbourhoods rows;
} looked_up;

static void looked_up_free(looked_up *l)
{
    free(l->S);
    free(l->N);
    free(l->distance);
    apsm_neighbourhoods_free(&l->rows);
}

static apsm_status measure_rows(const apsm_shape *shape, size_t J, const double *P, double factor,
                                looked_up *l)
{
    apsm_geodesic_work *w = NULL;
    APSM_TRY(apsm_neighbourhoods_resize(&l->rows, J));
    APSM_TRY(apsm_geodesic_work_new(shape->geodesic, &w));
    const apsm_status status =
        apsm_geodesic_neighbourhoods(shape->geodesic, w, J, l->S, P, factor, &l->rows);
    apsm_geodesic_work_free(w);
    return status;
}

static apsm_status look_up(const apsm_shape *shape, size_t J, const double *P, double factor,
                           looked_up *l)
{
    *l = (looked_up){ .S = malloc(J * sizeof *l->S),
                      .N = malloc(3 * J * sizeof *l->N),
                      .distance = malloc(J * sizeof *l->distance) };
    if (!l->S || !l->N || !l->distance) return APSM_ERR_MEMORY;
    apsm_shape_look_up(shape, J, P, l->S, NULL, l->N);
    for (size_t j = 0; j < J; j++) {
        double x[3], d2 = 0;
        apsm_surface_position(&shape->mesh, &l->S[j], x);
        for (size_t k = 0; k < 3; k++) d2 += (x[k] - P[3 * j + k]) * (x[k] - P[3 * j + k]);
        l->distance[j] = sqrt(d2);
    }
    return measure_rows(shape, J, P, factor, l);
}

static apsm_status judge_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    judging *g = user;
    looked_up l;
    const double *P = g->P + i * g->J * 3;
    const apsm_certificate_options options = apsm_certificate_defaults();
    const apsm_shape *shape = &g->cohort->shape[i];
    apsm_certificate *certificate = &g->out->shape[i];
    apsm_status status = look_up(shape, g->J, P, shape_factor, &l);
    const apsm_certificate_input input = { g->J,  g->h, &g->reference, &l.rows,   g->N6, g->T,
                                           g->TN, P,    l.N,           l.distance };
    if (status == APSM_OK) status = apsm_certify(&input, &options, certificate);
    if (status == APSM_OK && certificate->reasons & (1u << APSM_REVIEW_MISMATCHED)) {
        status = measure_rows(shape, g->J, P, far_factor, &l);
        if (status == APSM_OK) status = apsm_certify(&input, &options, certificate);
    }
    looked_up_free(&l);
    return status;
}

static apsm_status judge_template(judging *g)
{
    looked_up l;
    const apsm_shape *shape = &g->cohort->shape[g->cohort->template_index];
    apsm_status status = look_up(shape, g->J, g->T, APSM_REFERENCE_FACTOR, &l);
    if (status == APSM_OK) {
        g->reference = l.rows; /* taken over, with the normals */
        g->TN = l.N;
        l.rows = (apsm_neighbourhoods){ 0 };
        l.N = NULL;
        status = apsm_neighbours6(g->J, g->T, g->N6);
    }
    looked_up_free(&l);
    if (status == APSM_OK) g->h = apsm_spacing(g->J, g->T, g->N6, NULL);
    return status;
}

apsm_status certify_cohort(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                           cohort_certificate *certificate)
{
    *certificate = (cohort_certificate){ .I = cohort->I };
    certificate->shape = calloc(cohort->I, sizeof *certificate->shape);
    judging g = { .cohort = cohort,
                  .J = J,
                  .P = P,
                  .T = P + cohort->template_index * J * 3,
                  .N6 = malloc(J * APSM_NEIGHBOURS * sizeof *g.N6),
                  .out = certificate };
    apsm_status status = certificate->shape && g.N6 ? judge_template(&g) : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        certificate->h = g.h;
        status = apsm_parallel_for(ctx, cohort->I, judge_shape, &g, "certify");
    }
    apsm_neighbourhoods_free(&g.reference);
    free(g.TN);
    free(g.N6);
    if (status != APSM_OK) certify_free(certificate);
    return status;
}

void certify_free(cohort_certificate *certificate)
{
    for (size_t i = 0; certificate->shape && i < certificate->I; i++)
        apsm_certificate_free(&certificate->shape[i]);
    free(certificate->shape);
    *certificate = (cohort_certificate){ 0 };
}

/* ---- certificate.json ---- */

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

static json_t *json_reasons(unsigned reasons)
{
    json_t *texts = json_array();
    for (unsigned r = 0; r < APSM_REVIEW_COUNT; r++)
        if (reasons & (1u << r))
            json_array_append_new(texts, json_string(apsm_review_text((apsm_review)r)));
    return texts;
}

static const char *verdict(bool certified)
{
    return certified ? "certified" : "needs review";
}

static json_t *json_shape(const char *name, const apsm_certificate *c)
{
    return json_pack("{s:s, s:s, s:o, s:o, s:o, s:o, s:o, s:o, s:f, s:f, s:f}", "name", name,
                     "verdict", verdict(c->certified), "reasons", json_reasons(c->reasons),
                     "mismatched_1.5_1.5",
                     json_indices(c->mismatched_strict, 1, c->mismatched_strict_list),
                     "mismatched_1.5_2.0", json_indices(c->mismatched, 1, c->mismatched_list),
                     "lost", json_indices(c->lost, 1, c->lost_list), "swaps",
                     json_indices(c->swaps, 2, (const uint32_t *)c->swap), "folds",
                     json_indices(c->folds, 3, (const uint32_t *)c->fold), "off_surface_mean",
                     c->off_surface_mean, "off_surface_max", c->off_surface_max, "min_separation",
                     isfinite(c->min_separation) ? c->min_separation : 0.0);
}

static size_t count_certified(const cohort_certificate *certificate)
{
    size_t n = 0;
    for (size_t i = 0; i < certificate->I; i++) n += certificate->shape[i].certified;
    return n;
}

static double mean_mismatched(const cohort_certificate *certificate, bool strict)
{
    double sum = 0;
    for (size_t i = 0; i < certificate->I; i++) {
        const apsm_certificate *c = &certificate->shape[i];
        sum += (double)(strict ? c->mismatched_strict : c->mismatched) / (double)c->J;
    }
    return sum / (double)certificate->I;
}

json_t *certify_json(const apsm_cohort *cohort, const cohort_certificate *certificate)
{
    const apsm_certificate_options o = apsm_certificate_defaults();
    json_t *shapes = json_array();
    for (size_t i = 0; i < certificate->I; i++)
        json_array_append_new(shapes, json_shape(cohort->shape[i].name, &certificate->shape[i]));
    return json_pack("{s:s, s:i, s:s, s:I, s:I, s:s, s:f, s:f, s:f, s:{s:f, s:f, s:f, s:f}, s:o}",
                     "format", FORMAT_CERTIFICATE, "version", CERTIFICATE_VERSION, "verdict",
                     verdict(count_certified(certificate) == certificate->I), "certified",
                     (json_int_t)count_certified(certificate), "shapes", (json_int_t)certificate->I,
                     "template", cohort->shape[cohort->template_index].name, "h", certificate->h,
                     "mean_mismatched_1.5_1.5", mean_mismatched(certificate, true),
                     "mean_mismatched_1.5_2.0", mean_mismatched(certificate, false), "thresholds",
                     "mismatched_share", o.mismatched, "stretch", o.stretch, "off_surface",
                     o.off_surface, "coincident", o.coincident, "per_shape", shapes);
}

/* ---- the last lines of a run ---- */

static void describe(const apsm_certificate *c, char text[256])
{
    size_t used = 0;
    text[0] = 0;
    if (c->reasons & (1u << APSM_REVIEW_MISMATCHED))
        used += (size_t)snprintf(text + used, 256 - used,
                                 ", %zu of %zu particles have lost neighbours", c->lost, c->J);
    if (c->reasons & (1u << APSM_REVIEW_SWAPPED))
        used += (size_t)snprintf(text + used, 256 - used, ", %zu swapped pairs", c->swaps);
    if (c->reasons & (1u << APSM_REVIEW_FOLDED))
        used += (size_t)snprintf(text + used, 256 - used, ", %zu folds", c->folds);
    if (c->reasons & (1u << APSM_REVIEW_OFF_SURFACE))
        used += (size_t)snprintf(text + used, 256 - used, ", particles %.2g h off the surface",
                                 c->off_surface_max);
    if (c->reasons & (1u << APSM_REVIEW_COINCIDENT))
        used += (size_t)snprintf(text + used, 256 - used, ", particles coincide");
    if (c->reasons & (1u << APSM_REVIEW_NONFINITE))
        snprintf(text + used, 256 - used, ", particles are not finite numbers");
}

void certify_tell(apsm_context *ctx, const apsm_cohort *cohort,
                  const cohort_certificate *certificate)
{
    char text[256];
    const size_t certified = count_certified(certificate);
    for (size_t i = 0; i < certificate->I; i++) {
        if (certificate->shape[i].certified) continue;
        describe(&certificate->shape[i], text);
        apsm_log(ctx, APSM_LOG_WARNING, "%s needs review: %s", cohort->shape[i].name, text + 2);
    }
    apsm_log(ctx, APSM_LOG_INFO,
             "verdict: %s (%zu of %zu shapes certified, %.1f %% of particles "
             "mismatched at 1.5/2.0)",
             verdict(certified == certificate->I), certified, certificate->I,
             100 * mean_mismatched(certificate, false));
}
