#include "judge/certify.h"

#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/deal.h"
#include "core/number.h"
#include "core/robust.h"
#include "optimize/correspondence_loss.h"

/* How far rows reach to tell how far neighbours beyond F = 2.0 are: that is looked up only where it
 * may change the verdict. */
static const double far_factor = 4.0;
/* The template is nobody's prediction: it differs from the others in details that they do not have.
 */
static const double of_template = 1.5;

typedef struct judging {
    const apsm_cohort *cohort;
    size_t J;
    const double *P; /* I x J x 3 */
    double h;
    apsm_neighbourhoods reference;
    size_t t;        /* the shape whose neighbours are the right ones */
    uint32_t *N6;    /* J x 6: its */
    const double *T; /* J x 3: its particles */
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

/* Rows to factor times the closest, or, for 0, as far as the certificate needs them. */
static apsm_status measure_rows(const judging *g, const apsm_shape *shape, const double *P,
                                double factor, looked_up *l)
{
    return apsm_certificate_measure(shape->geodesic, g->J, l->S, P, &g->reference, factor,
                                    &l->rows);
}

/* Where particles are on the surface, and how far from it. */
static apsm_status look_up(const apsm_shape *shape, size_t J, const double *P, looked_up *l)
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
    return APSM_OK;
}

/* ---- as records ---- */

enum { LISTS = 5 };

/* A list of a certificate, in words. */
typedef struct word_list {
    uint32_t **words;
    size_t n;
} word_list;

static void lists_of(apsm_certificate *c, word_list list[LISTS])
{
    list[0] = (word_list){ &c->mismatched_strict_list, c->mismatched_strict };
    list[1] = (word_list){ &c->mismatched_list, c->mismatched };
    list[2] = (word_list){ &c->lost_list, c->lost };
    list[3] = (word_list){ (uint32_t **)&c->swap, 2 * c->swaps };
    list[4] = (word_list){ (uint32_t **)&c->fold, 3 * c->folds };
}

static size_t words_of(apsm_certificate *c)
{
    word_list list[LISTS];
    size_t n = 0;
    lists_of(c, list);
    for (size_t k = 0; k < LISTS; k++) n += list[k].n;
    return n;
}

static void pack_lists(apsm_certificate *c, uint32_t *words)
{
    word_list list[LISTS];
    lists_of(c, list);
    for (size_t k = 0; k < LISTS; words += list[k++].n)
        if (list[k].n > 0) memcpy(words, *list[k].words, list[k].n * sizeof *words);
}

static apsm_status unpack_lists(const uint32_t *words, apsm_certificate *c)
{
    word_list list[LISTS];
    lists_of(c, list);
    for (size_t k = 0; k < LISTS; words += list[k++].n) {
        *list[k].words = malloc((list[k].n + 1) * sizeof *words);
        if (!*list[k].words) return APSM_ERR_MEMORY;
        memcpy(*list[k].words, words, list[k].n * sizeof *words);
    }
    return APSM_OK;
}

/* What is kept of a certificate: it, and its lists under a kind of their own. */
typedef struct certificate_kinds {
    char whole[40], lists[40];
} certificate_kinds;

static certificate_kinds kinds_of(size_t reference)
{
    certificate_kinds k;
    apsm_print(k.whole, sizeof k.whole, "certificate by %zu", reference);
    apsm_print(k.lists, sizeof k.lists, "lists by %zu", reference);
    return k;
}

/* Adopts a record of another process: its lists are not ours. */
static void drop_lists(apsm_certificate *c)
{
    word_list list[LISTS];
    lists_of(c, list);
    for (size_t k = 0; k < LISTS; k++) *list[k].words = NULL;
}

static apsm_status recall_certificate(const apsm_context *ctx, const certificate_kinds *kinds,
                                      size_t i, apsm_certificate *c, bool *found)
{
    apsm_certificate kept;
    *found = apsm_recall(ctx, kinds->whole, i, sizeof kept, &kept);
    if (!*found) return APSM_OK;
    drop_lists(&kept);
    const size_t n = words_of(&kept);
    uint32_t *words = malloc((n + 1) * sizeof *words);
    if (!words) return APSM_ERR_MEMORY;
    apsm_status status = APSM_OK;
    *found = apsm_recall(ctx, kinds->lists, i, n * sizeof *words, words);
    if (*found) {
        *c = kept;
        status = unpack_lists(words, c);
    }
    free(words);
    return status;
}

static apsm_status keep_certificate(apsm_context *ctx, const certificate_kinds *kinds, size_t i,
                                    apsm_certificate *c)
{
    apsm_certificate bare = *c;
    const size_t n = words_of(c);
    uint32_t *words = malloc((n + 1) * sizeof *words);
    if (!words) return APSM_ERR_MEMORY;
    pack_lists(c, words);
    drop_lists(&bare);
    apsm_status status = apsm_keep(ctx, kinds->lists, i, n * sizeof *words, words);
    if (status == APSM_OK) status = apsm_keep(ctx, kinds->whole, i, sizeof bare, &bare);
    free(words);
    return status;
}

static apsm_status make_certificate(const judging *g, size_t i)
{
    looked_up l;
    const double *P = g->P + i * g->J * 3;
    const apsm_certificate_options options = apsm_certificate_defaults();
    const apsm_shape *shape = &g->cohort->shape[i];
    apsm_certificate *certificate = &g->out->shape[i];
    apsm_status status = look_up(shape, g->J, P, &l);
    if (status == APSM_OK) status = measure_rows(g, shape, P, 0, &l);
    const apsm_certificate_input input = { g->J,  g->h, &g->reference, &l.rows,   g->N6, g->T,
                                           g->TN, P,    l.N,           l.distance };
    if (status == APSM_OK) status = apsm_certify(&input, &options, certificate);
    if (status == APSM_OK && certificate->reasons & (1u << APSM_REVIEW_MISMATCHED)) {
        status = measure_rows(g, shape, P, far_factor, &l);
        if (status == APSM_OK) status = apsm_certify(&input, &options, certificate);
    }
    looked_up_free(&l);
    return status;
}

static apsm_status judge_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const judging *g = user;
    const certificate_kinds kinds = kinds_of(g->t);
    bool found;
    APSM_TRY(recall_certificate(ctx, &kinds, i, &g->out->shape[i], &found));
    if (found) return APSM_OK;
    APSM_TRY(make_certificate(g, i));
    return keep_certificate(ctx, &kinds, i, &g->out->shape[i]);
}

/* ---- from other processes ---- */

/* The certificates of all shapes, where each process has judged its own. */
static apsm_status gather_certificates(apsm_context *ctx, size_t I, apsm_certificate *shape)
{
    size_t most = 1;
    APSM_TRY(apsm_gather(ctx, I, NULL, sizeof *shape, shape));
    for (size_t i = 0; i < I; i++) {
        const size_t n = words_of(&shape[i]);
        most = n > most ? n : most;
        if (!apsm_is_own(ctx, i)) drop_lists(&shape[i]);
    }
    uint32_t *words = malloc(I * most * sizeof *words);
    apsm_status status = words ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t i = 0; i < I && status == APSM_OK; i++)
        if (apsm_is_own(ctx, i)) pack_lists(&shape[i], words + i * most);
    if (status == APSM_OK) status = apsm_gather(ctx, I, NULL, most * sizeof *words, words);
    for (size_t i = 0; i < I && status == APSM_OK; i++)
        if (!apsm_is_own(ctx, i)) status = unpack_lists(words + i * most, &shape[i]);
    free(words);
    return status;
}

/* Makes shape t the one that the others are compared with. */
static apsm_status take_reference(judging *g, size_t t)
{
    looked_up l;
    const apsm_shape *shape = &g->cohort->shape[t];
    apsm_neighbourhoods_free(&g->reference);
    free(g->TN);
    g->TN = NULL;
    g->t = t;
    g->T = g->P + t * g->J * 3;
    apsm_status status = look_up(shape, g->J, g->T, &l);
    if (status == APSM_OK) status = measure_rows(g, shape, g->T, APSM_REFERENCE_FACTOR, &l);
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

/* The certificates of all shapes against shape t. */
static apsm_status judge_against(apsm_context *ctx, judging *g, size_t t)
{
    cohort_certificate *c = g->out;
    for (size_t i = 0; i < c->I; i++) apsm_certificate_free(&c->shape[i]);
    memset(c->shape, 0, c->I * sizeof *c->shape);
    APSM_TRY(take_reference(g, t));
    const apsm_shared_loop loop = { .n = c->I, .fn = judge_shape, .user = g, .stage = "certify" };
    APSM_TRY(apsm_shared_for(ctx, &loop));
    return gather_certificates(ctx, c->I, c->shape);
}

/* Whether most shapes have other neighbours than the one that they are compared with. */
static bool stands_alone(const judging *g)
{
    const unsigned torn =
        1u << APSM_REVIEW_MISMATCHED | 1u << APSM_REVIEW_SWAPPED | 1u << APSM_REVIEW_FOLDED;
    size_t n = 0;
    for (size_t i = 0; i < g->out->I; i++) n += i != g->t && (g->out->shape[i].reasons & torn) != 0;
    return 2 * n >= g->out->I;
}

/* If most shapes disagree with the template it is the template that is wrong, not they: unless they
 * disagree with each other as well, the most usual of the others takes its place.  A share does not
 * know. */
static apsm_status doubt_template(apsm_context *ctx, judging *g)
{
    const cohort_certificate *c = g->out;
    const size_t template_index = g->t;
    size_t best = template_index;
    if (!c->judged || apsm_is_share(ctx) || !stands_alone(g)) return APSM_OK;
    for (size_t i = 0; i < c->I; i++) {
        if (i == template_index || c->doubts[i]) continue;
        if (best == template_index || c->judgement.shape[i].off < c->judgement.shape[best].off)
            best = i;
    }
    if (best == template_index) return APSM_OK;
    APSM_TRY(judge_against(ctx, g, best));
    return stands_alone(g) ? judge_against(ctx, g, template_index) : APSM_OK;
}

/* What the other shapes say, where there are enough of them. */
static apsm_status judge_by_others(apsm_context *ctx, const judging *g)
{
    cohort_certificate *c = g->out;
    const apsm_verdict_options options = apsm_verdict_defaults();
    for (size_t i = 0; i < c->I; i++)
        if (c->shape[i].reasons & (1u << APSM_REVIEW_NONFINITE)) return APSM_OK;
    if (c->I < APSM_LEAST_JUDGED) return APSM_OK;
    APSM_TRY(apsm_judge(ctx, g->cohort, g->J, g->P, &c->judgement));
    c->judged = true;
    for (size_t i = 0; i < c->I; i++) {
        apsm_verdict_options own = options;
        if (i == g->cohort->template_index) {
            own.slip *= of_template;
            own.clear_slip *= of_template;
            own.part *= of_template;
        }
        c->doubts[i] = apsm_verdict_doubts(&c->judgement.shape[i], &own);
    }
    return APSM_OK;
}

static bool has(json_t *note, const char *key, const char *text)
{
    const char *value = json_string_value(json_object_get(note, key));
    return value && strcmp(value, text) == 0;
}

static bool is_sought(json_t *note)
{
    return json_is_true(json_object_get(note, "sought"));
}

static apsm_pose_note pose_note(json_t *note)
{
    if (is_sought(note)) return APSM_POSE_SOUGHT;
    return json_is_true(json_object_get(note, "against")) ? APSM_POSE_AGAINST : APSM_POSE_AMBIGUOUS;
}

/* What a note comes to for its shape; usual: the evidence for pose and hand that shapes have. */
static unsigned weigh_note(json_t *note, const apsm_findings *f, const double usual[2])
{
    const apsm_verdict_options options = apsm_verdict_defaults();
    const bool undecided = json_is_true(json_object_get(note, "undecided"));
    if (has(note, "aspect", apsm_aspect_name(APSM_ASPECT_HAND)))
        return apsm_verdict_note_hand(f, usual[1], undecided, &options);
    if (!has(note, "aspect", apsm_aspect_name(APSM_ASPECT_POSE))) return 0;
    return apsm_verdict_note_pose(f, usual[0], pose_note(note), &options);
}

/* Whether grooming called most poses so. */
static bool are_ambiguous(size_t I, json_t *notes)
{
    size_t k, n = 0;
    json_t *note;
    json_array_foreach(notes, k, note)
    {
        const bool pose = has(note, "aspect", apsm_aspect_name(APSM_ASPECT_POSE));
        n += pose && pose_note(note) == APSM_POSE_AMBIGUOUS;
    }
    return 2 * n > I;
}

/* The medians. */
static apsm_status usual_evidence(const cohort_certificate *c, double usual[2])
{
    usual[0] = usual[1] = INFINITY;
    if (!c->judged) return APSM_OK;
    double *e = malloc(c->I * sizeof *e);
    if (!e) return APSM_ERR_MEMORY;
    for (int hand = 0; hand < 2; hand++) {
        for (size_t i = 0; i < c->I; i++) e[i] = c->judgement.shape[i].turn[hand].evidence;
        usual[hand] = robust_median(c->I, e);
    }
    free(e);
    return APSM_OK;
}

/* Grooming's doubts are ours, unless the form speaks clearly for the pose.  Where it called more
 * than half of the poses ambiguous, however few shapes there are, what they look like, each as it
 * may lie, tells no pose, that of the provisional template included. */
static apsm_status add_notes(const apsm_cohort *cohort, json_t *notes, cohort_certificate *c)
{
    size_t k;
    json_t *note;
    double usual[2];
    const bool ambiguous = are_ambiguous(c->I, notes);
    APSM_TRY(usual_evidence(c, usual));
    json_array_foreach(notes, k, note)
    {
        for (size_t i = 0; i < c->I; i++) {
            const apsm_findings *f = c->judged ? &c->judgement.shape[i] : NULL;
            if (has(note, "shape", cohort->shape[i].name))
                c->doubts[i] |= weigh_note(note, f, usual);
        }
    }
    for (size_t i = 0; i < c->I && ambiguous; i++) c->doubts[i] |= 1u << APSM_DOUBT_POSE;
    c->notes = json_incref(notes);
    return APSM_OK;
}

static bool is_same_file(json_t *notes, const char *shape)
{
    size_t k;
    json_t *note;
    json_array_foreach(notes, k, note)
    {
        const char *text = json_string_value(json_object_get(note, "text"));
        if (has(note, "shape", shape) && text && strncmp(text, "the same file", 13) == 0)
            return true;
    }
    return false;
}

/* Shapes that are nearly the same, where grooming has not seen that it is one file. */
static apsm_status note_twins(const apsm_cohort *cohort, cohort_certificate *c)
{
    json_t *all = c->notes ? json_copy(c->notes) : json_array();
    int failed = !all;
    for (size_t i = 0; i < c->I && c->judged && !failed; i++) {
        const char *name = cohort->shape[i].name;
        if (c->judgement.twin[i] == i || is_same_file(c->notes, name)) continue;
        json_t *text = json_sprintf("nearly the same shape as %s: a subject twice?",
                                    cohort->shape[c->judgement.twin[i]].name);
        failed = json_array_append_new(
            all, json_pack("{s:s, s:s, s:o}", "shape", name, "aspect", "input", "text", text));
    }
    json_decref(c->notes);
    c->notes = all;
    return failed ? APSM_ERR_MEMORY : APSM_OK;
}

apsm_status certify_cohort(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                           json_t *notes, cohort_certificate *certificate)
{
    *certificate = (cohort_certificate){ .I = cohort->I };
    certificate->shape = calloc(cohort->I, sizeof *certificate->shape);
    certificate->doubts = calloc(cohort->I, sizeof *certificate->doubts);
    judging g = { .cohort = cohort,
                  .J = J,
                  .P = P,
                  .N6 = malloc(J * APSM_NEIGHBOURS * sizeof *g.N6),
                  .out = certificate };
    const bool enough = certificate->shape && certificate->doubts && g.N6;
    apsm_status status = enough ? judge_against(ctx, &g, cohort->template_index) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = judge_by_others(ctx, &g);
    if (status == APSM_OK) status = doubt_template(ctx, &g);
    certificate->reference = g.t;
    certificate->h = g.h; /* of that shape */
    if (status == APSM_OK) status = add_notes(cohort, notes, certificate);
    if (status == APSM_OK) status = note_twins(cohort, certificate);
    apsm_neighbourhoods_free(&g.reference);
    free(g.TN);
    free(g.N6);
    if (status != APSM_OK) certify_free(certificate);
    return status;
}

apsm_status certify_parts(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                          cohort_certificate *certificate)
{
    double *part = malloc((cohort->I * J * 3 + 1) * sizeof *part);
    apsm_status status = part ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t d = 0; d < cohort_parts(cohort); d++) certificate[d] = (cohort_certificate){ 0 };
    for (size_t d = 0; d < cohort_parts(cohort) && status == APSM_OK; d++) {
        const size_t own = cohort_first(cohort, d + 1, J) - cohort_first(cohort, d, J);
        cohort_take_part(cohort, d, J, P, part);
        status = certify_cohort(ctx, cohort_part(cohort, d), own, part, NULL, &certificate[d]);
    }
    for (size_t d = 0; d < cohort_parts(cohort) && status != APSM_OK; d++)
        certify_free(&certificate[d]);
    free(part);
    return status;
}

void certify_free(cohort_certificate *certificate)
{
    for (size_t i = 0; certificate->shape && i < certificate->I; i++)
        apsm_certificate_free(&certificate->shape[i]);
    free(certificate->shape);
    free(certificate->doubts);
    apsm_judgement_free(&certificate->judgement);
    json_decref(certificate->notes);
    *certificate = (cohort_certificate){ 0 };
}

/* ---- what it comes to ---- */

static bool needs_review(const cohort_certificate *c, size_t i)
{
    return !c->shape[i].certified || c->doubts[i];
}

/* Slips were looked for, too. */
static bool is_whole(const cohort_certificate *c)
{
    return c->judged && c->judgement.looks > 0;
}

const char *certify_verdict_of(const cohort_certificate *c, size_t i)
{
    return needs_review(c, i) ? "needs review" : is_whole(c) ? "certified" : "not judged";
}

const char *certify_verdict(const cohort_certificate *c)
{
    for (size_t i = 0; i < c->I; i++)
        if (needs_review(c, i)) return "needs review";
    return is_whole(c) ? "certified" : "not judged";
}

/* A surface that is nearly its own mirror image, or nearly the same when turned. */
static bool is_untold(const cohort_certificate *c, size_t i, apsm_aspect aspect)
{
    const apsm_verdict_options options = apsm_verdict_defaults();
    const bool either = aspect == APSM_ASPECT_POSE || aspect == APSM_ASPECT_HAND;
    return c->judged && either && !apsm_verdict_tells(&c->judgement.shape[i], aspect, &options);
}

const char *certify_grade(const cohort_certificate *c, size_t i, apsm_aspect aspect)
{
    const unsigned surface = 1u << APSM_REVIEW_OFF_SURFACE | 1u << APSM_REVIEW_NONFINITE;
    const unsigned reasons = c->shape[i].reasons;
    bool review = false;
    if (aspect == APSM_ASPECT_SURFACE) review = reasons & surface;
    if (aspect == APSM_ASPECT_NEIGHBOURS) review = reasons & ~surface;
    for (unsigned d = 0; d < APSM_DOUBT_COUNT; d++)
        review |= (c->doubts[i] & (1u << d)) && apsm_doubt_aspect((apsm_doubt)d) == aspect;
    const bool by_itself = aspect == APSM_ASPECT_SURFACE || aspect == APSM_ASPECT_NEIGHBOURS;
    if (review) return "review";
    if (is_untold(c, i, aspect)) return "cannot be told";
    if (aspect == APSM_ASPECT_SLIP && c->judged && !is_whole(c)) return "not looked for";
    return by_itself || c->judged ? "pass" : "not judged";
}

double certify_probability(const cohort_certificate *c, size_t i)
{
    const apsm_verdict_options options = apsm_verdict_defaults();
    const bool open = c->doubts[i] & (1u << APSM_DOUBT_POSE); /* form is not believed there */
    return c->judged && !open ? apsm_verdict_probability(&c->judgement.shape[i], &options) : NAN;
}

double certify_expected_lost(const cohort_certificate *c)
{
    double sum = 0.0;
    for (size_t i = 0; i < c->I; i++) {
        const double p = certify_probability(c, i);
        if (isfinite(p)) sum += p;
    }
    return sum;
}

size_t certify_untold(const cohort_certificate *c, apsm_aspect aspect)
{
    size_t n = 0;
    for (size_t i = 0; i < c->I; i++) n += is_untold(c, i, aspect);
    return n;
}

size_t certify_count(const cohort_certificate *c, const char *verdict)
{
    size_t n = 0;
    for (size_t i = 0; i < c->I; i++) n += strcmp(certify_verdict_of(c, i), verdict) == 0;
    return n;
}

double certify_mean_mismatched(const cohort_certificate *certificate, bool strict)
{
    double sum = 0;
    for (size_t i = 0; i < certificate->I; i++) {
        const apsm_certificate *c = &certificate->shape[i];
        sum += (double)(strict ? c->mismatched_strict : c->mismatched) / (double)c->J;
    }
    return sum / (double)certificate->I;
}

/* ---- the last lines of a run ---- */

typedef struct sentence {
    char text[1024];
    size_t used;
} sentence;

static void say(sentence *s, const char *format, ...) APSM_PRINTF(2, 3);
static void say(sentence *s, const char *format, ...)
{
    va_list args;
    if (s->used > 0) s->used += (size_t)snprintf(s->text + s->used, sizeof s->text - s->used, "; ");
    if (s->used >= sizeof s->text) s->used = sizeof s->text - 1;
    va_start(args, format);
    s->used += (size_t)apsm_vprint(s->text + s->used, sizeof s->text - s->used, format, args);
    va_end(args);
    if (s->used >= sizeof s->text) s->used = sizeof s->text - 1;
}

static void describe(const apsm_certificate *c, unsigned doubts, sentence *s)
{
    if (c->reasons & (1u << APSM_REVIEW_MISMATCHED))
        say(s, "%zu of %zu particles have lost neighbours", c->lost, c->J);
    if (c->reasons & (1u << APSM_REVIEW_SWAPPED)) say(s, "%zu swapped pairs", c->swaps);
    if (c->reasons & (1u << APSM_REVIEW_FOLDED)) say(s, "%zu folds", c->folds);
    if (c->reasons & (1u << APSM_REVIEW_OFF_SURFACE))
        say(s, "particles %.2g h off the surface", c->off_surface_max);
    if (c->reasons & (1u << APSM_REVIEW_COINCIDENT)) say(s, "particles coincide");
    if (c->reasons & (1u << APSM_REVIEW_NONFINITE)) say(s, "particles are not finite numbers");
    for (unsigned d = 0; d < APSM_DOUBT_COUNT; d++)
        if (doubts & (1u << d)) say(s, "%s", apsm_doubt_text((apsm_doubt)d));
}

enum { MOST_TOLD = 5 };

/* Notes of one kind begin alike, up to a colon. */
static size_t kind_length(const char *text)
{
    return strcspn(text, ":");
}

static const char *note_text(const cohort_certificate *c, size_t k, const char *key)
{
    const char *text = json_string_value(json_object_get(json_array_get(c->notes, k), key));
    return text ? text : "";
}

/* Notes of the kind of note k among the first `end`, counted up to `most`. */
static size_t count_kind(const cohort_certificate *c, size_t k, size_t end, size_t most)
{
    const char *text = note_text(c, k, "text");
    size_t n = 0;
    for (size_t i = 0; i < end && n < most; i++) {
        const char *other = note_text(c, i, "text");
        n +=
            kind_length(other) == kind_length(text) && strncmp(other, text, kind_length(text)) == 0;
    }
    return n;
}

/* Notes of a kind that many shapes share are told once. */
static void tell_notes(apsm_context *ctx, const cohort_certificate *c)
{
    const size_t all = json_array_size(c->notes);
    for (size_t k = 0; k < all; k++) {
        const char *shape = note_text(c, k, "shape"), *text = note_text(c, k, "text");
        if (is_sought(json_array_get(c->notes, k))) continue; /* no fault by itself */
        if (count_kind(c, k, all, MOST_TOLD + 1) <= MOST_TOLD)
            apsm_log(ctx, APSM_LOG_WARNING, "%s: %s", shape, text);
        else if (count_kind(c, k, k, 1) == 0)
            apsm_log(ctx, APSM_LOG_WARNING,
                     "%zu shapes, %s the first: %.*s; certificate.json has each",
                     count_kind(c, k, all, all), shape, (int)kind_length(text), text);
    }
}

/* Once for all, where a fault of pose or hand would hardly be seen; of shapes that need review
 * anyway there is nothing to add. */
static void tell_untold(apsm_context *ctx, const apsm_cohort *cohort, const cohort_certificate *c,
                        apsm_aspect aspect, const char *text)
{
    size_t n = 0, first = 0;
    for (size_t i = 0; i < c->I; i++)
        if (is_untold(c, i, aspect) && !needs_review(c, i) && n++ == 0) first = i;
    if (n > 0)
        apsm_log(ctx, APSM_LOG_WARNING, "of %zu of %zu shapes the surface does not tell %s (%s%s)",
                 n, c->I, text, cohort->shape[first].name, n > 1 ? ", ..." : "");
}

/* How many of the first `end` shapes are doubted for the same reasons as shape i, up to `most`. */
static size_t count_doubted_as(const cohort_certificate *c, size_t i, size_t end, size_t most)
{
    size_t n = 0;
    for (size_t k = 0; k < end && n < most; k++)
        n += c->doubts[k] == c->doubts[i] && c->shape[k].reasons == c->shape[i].reasons;
    return n;
}

static void tell_review(apsm_context *ctx, const char *name, const cohort_certificate *c, size_t i)
{
    sentence s = { .used = 0 };
    describe(&c->shape[i], c->doubts[i], &s);
    const double p = certify_probability(c, i);
    if (isfinite(p)) say(&s, "probability %.2g that over a tenth of its particles are lost", p);
    apsm_log(ctx, APSM_LOG_WARNING, "%s needs review: %s", name, s.text);
}

static void tell_reviews(apsm_context *ctx, const char *name, const cohort_certificate *c, size_t i)
{
    sentence s = { .used = 0 };
    for (unsigned r = 0; r < APSM_REVIEW_COUNT; r++)
        if (c->shape[i].reasons & (1u << r)) say(&s, "%s", apsm_review_text((apsm_review)r));
    for (unsigned d = 0; d < APSM_DOUBT_COUNT; d++)
        if (c->doubts[i] & (1u << d)) say(&s, "%s", apsm_doubt_text((apsm_doubt)d));
    apsm_log(ctx, APSM_LOG_WARNING,
             "%zu shapes need review, %s the first: %s; certificate.json has each",
             count_doubted_as(c, i, c->I, c->I), name, s.text);
}

/* Shapes that many share the reasons with are told once. */
static void tell_doubted(apsm_context *ctx, const apsm_cohort *cohort, const cohort_certificate *c)
{
    for (size_t i = 0; i < c->I; i++) {
        const char *name = cohort->shape[i].name;
        if (!needs_review(c, i)) continue;
        if (count_doubted_as(c, i, c->I, MOST_TOLD + 1) <= MOST_TOLD)
            tell_review(ctx, name, c, i);
        else if (count_doubted_as(c, i, i, 1) == 0)
            tell_reviews(ctx, name, c, i);
    }
}

void certify_tell(apsm_context *ctx, const apsm_cohort *cohort, const cohort_certificate *c)
{
    tell_notes(ctx, c);
    tell_doubted(ctx, cohort, c);
    tell_untold(ctx, cohort, c, APSM_ASPECT_POSE,
                "which way they lie: it is nearly the same turned; make sure that they come in one "
                "orientation");
    tell_untold(ctx, cohort, c, APSM_ASPECT_HAND,
                "left from right: it is nearly its own mirror image; make sure of the sides");
    if (!c->judged)
        apsm_log(ctx, APSM_LOG_WARNING,
                 "fewer than %d shapes: whether they belong, lie and correspond as the others do "
                 "cannot be judged",
                 (int)APSM_LEAST_JUDGED);
    else if (!is_whole(c))
        apsm_log(
            ctx, APSM_LOG_WARNING,
            "%zu particles are too few to look for slips of regions: nothing is certified; give "
            "12 or more (-J)",
            c->judgement.J);
    apsm_log(ctx, APSM_LOG_INFO,
             "verdict: %s (%zu of %zu shapes certified, %.1f %% of particles "
             "mismatched at 1.5/2.0)",
             certify_verdict(c), certify_count(c, "certified"), c->I,
             100 * certify_mean_mismatched(c, false));
}
