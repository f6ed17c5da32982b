/* The fidelity stage: rounds of prior and shapes in turn.  Equation (12); the objective of a shape
 * is in fidelity_shape.c, the prior in fidelity_prior.c.
 *
 * The weights of the quadratic terms are relative to the mean diagonal of the shape's Gauss-Newton
 * matrix when the round begins, and stay for the round.  A step counts if the objective falls, the
 * two-way distance does not grow (by more than a tenth, once the prior weighs) and no fold appears;
 * else it is halved, a few times.  The last round's result is certified.
 *
 * The prior, and the pull to where particles were when the stage began, wait for the second half of
 * the rounds: what the surfaces say alone tells how much these should say. */
#include "optimize/fidelity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/deal.h"
#include "geometry/vec3.h"
#include "initialize/anchors.h"
#include "initialize/features.h"
#include "linalg/linalg.h"
#include "optimize/correspondence_loss.h"
#include "optimize/fidelity_shape.h"

enum { HALVINGS = 4, WEAKER = 3 };
static const double growth = 1.1; /* of the distance in a round, at most, for the prior's sake */

apsm_fidelity_options apsm_fidelity_defaults(void)
{
    return (apsm_fidelity_options){ .left_out = NULL, APSM_OPTION_DEFAULTS(APSM_FIDELITY_OPTIONS) };
}

/* ---- what stays the same ---- */

static bool are_mutual(const uint32_t *N6, uint32_t j, uint32_t k)
{
    bool forth = false, back = false;
    for (size_t q = 0; q < APSM_NEIGHBOURS; q++) {
        forth |= N6[APSM_NEIGHBOURS * (size_t)j + q] == k;
        back |= N6[APSM_NEIGHBOURS * (size_t)k + q] == j;
    }
    return forth && back;
}

/* The triangles that the certificate looks at: three mutual neighbours, by rising index. */
static void list_triangles(apsm_fidelity *f)
{
    const apsm_certificate_options o = apsm_certificate_defaults();
    for (uint32_t a = 0; a < f->J; a++)
        for (size_t p = 0; p < APSM_NEIGHBOURS; p++)
            for (size_t q = 0; q < APSM_NEIGHBOURS; q++) {
                const uint32_t b = f->N6[APSM_NEIGHBOURS * (size_t)a + p];
                const uint32_t c = f->N6[APSM_NEIGHBOURS * (size_t)a + q];
                const uint32_t t[3] = { a, b, c };
                if (!(a < b && b < c) || !are_mutual(f->N6, a, b) || !are_mutual(f->N6, a, c) ||
                    !are_mutual(f->N6, b, c))
                    continue;
                const int side = apsm_triangle_orientation(f->T, f->TN, t, &o);
                if (side == 0) continue;
                memcpy(f->triangle[f->triangles], t, sizeof t);
                f->side[f->triangles++] = side;
            }
}

static apsm_status measure_reference(const apsm_shape *shape, const apsm_surface_point *S,
                                     apsm_fidelity *f)
{
    apsm_geodesic_work *w = NULL;
    APSM_TRY(apsm_neighbourhoods_resize(&f->reference, f->J));
    APSM_TRY(apsm_geodesic_work_new(shape->geodesic, &w));
    const apsm_status status = apsm_geodesic_neighbourhoods(shape->geodesic, w, f->J, S, f->T,
                                                            APSM_REFERENCE_FACTOR, &f->reference);
    apsm_geodesic_work_free(w);
    return status;
}

/* Those of the template's particles. */
static apsm_status take_features(apsm_fidelity *f)
{
    const apsm_cohort *c = f->cohort;
    const size_t F = c->features.F, t = c->template_index;
    if (F == 0) return APSM_OK;
    f->features = malloc(f->J * F * sizeof *f->features);
    if (!f->features) return APSM_ERR_MEMORY;
    for (size_t j = 0; j < f->J; j++) {
        apsm_surface_point on;
        apsm_shape_look_up(&c->shape[t], 1, f->T + 3 * j, &on, NULL, NULL);
        apsm_features_at(c, t, &on, f->features + j * F, NULL);
    }
    return APSM_OK;
}

/* Steps of many particles: W in single precision, they need no more, and what H is made of. */
static apsm_status prepare_many(apsm_fidelity *f)
{
    const size_t n = f->warp.nv * f->J;
    f->W32 = malloc(n * sizeof *f->W32);
    if (!f->W32) return APSM_ERR_MEMORY;
    for (size_t k = 0; k < n; k++) f->W32[k] = (float)f->warp.W[k];
    APSM_TRY(fidelity_find_near(f->warp.nv, f->J, f->W32, &f->near));
    f->place = malloc(f->J * sizeof *f->place);
    f->Q32 = malloc(f->J * f->J * sizeof *f->Q32);
    if (!f->place || !f->Q32) return APSM_ERR_MEMORY;
    APSM_TRY(fidelity_find_band(f->J, f->T, f->place, &f->band));
    for (size_t j = 0; j < f->J; j++)
        for (size_t k = 0; k < f->J; k++)
            f->Q32[f->place[j] * f->J + f->place[k]] = (float)f->Q[j * f->J + k];
    return APSM_OK;
}

static apsm_status prepare(apsm_context *ctx, const double *T, apsm_fidelity *f)
{
    enum { PAIRS = APSM_NEIGHBOURS * (APSM_NEIGHBOURS - 1) / 2 };
    const apsm_shape *shape = &f->cohort->shape[f->cohort->template_index];
    const size_t J = f->J;
    f->T = malloc(3 * J * sizeof *f->T);
    f->TN = malloc(3 * J * sizeof *f->TN);
    f->N6 = malloc(J * APSM_NEIGHBOURS * sizeof *f->N6);
    f->triangle = malloc(J * PAIRS * sizeof *f->triangle);
    f->side = malloc(J * PAIRS * sizeof *f->side);
    f->Q = malloc(J * J * sizeof *f->Q);
    f->on_rim = malloc(J * sizeof *f->on_rim);
    apsm_surface_point *S = malloc(J * sizeof *S);
    apsm_status status = APSM_ERR_MEMORY;
    if (f->T && f->TN && f->N6 && f->triangle && f->side && f->Q && f->on_rim && S) {
        memcpy(f->T, T, 3 * J * sizeof *f->T);
        apsm_shape_look_up(shape, J, T, S, NULL, f->TN);
        apsm_shape_find_on_rim(shape, J, T, f->on_rim);
        status = measure_reference(shape, S, f);
        if (status == APSM_OK) status = apsm_neighbours6(J, T, f->N6);
    }
    free(S);
    APSM_TRY(status);
    f->h = apsm_spacing(J, T, f->N6, NULL);
    list_triangles(f);
    APSM_TRY(fidelity_smoothness(J, T, f->Q));
    APSM_TRY(take_features(f));
    if (f->cohort->anchors.L > 0 && !f->cohort->anchors.hold)
        APSM_TRY(apsm_warp_build(ctx, APSM_PHI_R, f->cohort->anchors.L,
                                 anchor_at(f->cohort, f->cohort->template_index, 0), J, T,
                                 &f->anchors));
    const bool shares = f->o.coarse > 0; /* that of some of the particles is nobody else's */
    APSM_TRY((shares ? apsm_warp_share : apsm_warp_build)(ctx, APSM_PHI_R, shape->mesh.nv,
                                                          shape->mesh.V, J, T, &f->warp));
    return 2 * J > (size_t)f->o.dense ? prepare_many(f) : APSM_OK;
}

apsm_status apsm_fidelity_new(apsm_context *ctx, const apsm_cohort *cohort, size_t J,
                              const double *T, const apsm_fidelity_options *options,
                              apsm_fidelity **fidelity)
{
    apsm_fidelity *f = *fidelity = calloc(1, sizeof *f);
    if (!f) return APSM_ERR_MEMORY;
    f->cohort = cohort;
    f->o = *options;
    f->J = J;
    const apsm_status status = prepare(ctx, T, f);
    if (status == APSM_OK) return APSM_OK;
    apsm_fidelity_free(f);
    *fidelity = NULL;
    return status;
}

void apsm_fidelity_free(apsm_fidelity *f)
{
    if (!f) return;
    fidelity_coarse_free(f->coarse);
    apsm_warp_free(&f->warp);
    free(f->W32);
    fidelity_near_free(&f->near);
    free(f->place);
    free(f->Q32);
    apsm_warp_free(&f->anchors);
    free(f->features);
    apsm_neighbourhoods_free(&f->reference);
    free(f->T);
    free(f->TN);
    free(f->N6);
    free(f->triangle);
    free(f->side);
    free(f->Q);
    free(f->on_rim);
    free(f);
}

double apsm_fidelity_doubt(const apsm_fidelity *f)
{
    return f->doubt;
}

void apsm_fidelity_set_doubt(apsm_fidelity *f, double doubt)
{
    f->doubt = doubt;
}

double apsm_fidelity_spacing(const apsm_fidelity *f)
{
    return f->h;
}

/* ---- the certificate's part ---- */

/* What speaks against a shape's particles. */
typedef struct faults {
    size_t count;     /* swaps and folds */
    unsigned reasons; /* of the certificate */
} faults;

static bool is_worse(const faults *a, const faults *b)
{
    return a->count > b->count || (a->reasons & ~b->reasons) != 0;
}

/* The particles that a certificate names. */
static void mark_named(const apsm_fidelity *f, const apsm_certificate *c, bool *named)
{
    memset(named, 0, f->J * sizeof *named);
    for (size_t k = 0; k < c->mismatched; k++) named[c->mismatched_list[k]] = true;
    for (size_t k = 0; k < 2 * c->swaps; k++) named[c->swap[k / 2][k % 2]] = true;
    for (size_t k = 0; k < 3 * c->folds; k++) named[c->fold[k / 3][k % 3]] = true;
}

/* Of particles P on shape i; s is scratch.  named (J, out) may be NULL. */
static apsm_status find_faults(const apsm_fidelity *f, size_t i, const double *P, fidelity_state *s,
                               faults *out, bool *named)
{
    const apsm_shape *shape = &f->cohort->shape[i];
    const apsm_certificate_options o = apsm_certificate_defaults();
    apsm_neighbourhoods rows = { 0 };
    apsm_certificate c = { 0 };
    apsm_geodesic_work *g = NULL;
    double *distance = calloc(f->J, sizeof *distance); /* they lie on the surface */
    apsm_shape_look_up(shape, f->J, P, s->S, NULL, s->N);
    apsm_status status = distance ? apsm_neighbourhoods_resize(&rows, f->J) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_geodesic_work_new(shape->geodesic, &g);
    if (status == APSM_OK)
        status = apsm_certificate_rows(shape->geodesic, g, f->J, s->S, P, &f->reference, &rows);
    if (status == APSM_OK) {
        const apsm_certificate_input in = { f->J,  f->h, &f->reference, &rows,   f->N6, f->T,
                                            f->TN, P,    s->N,          distance };
        status = apsm_certify(&in, &o, &c);
    }
    *out = (faults){ c.swaps + c.folds, c.reasons };
    if (status == APSM_OK && named) mark_named(f, &c, named);
    apsm_certificate_free(&c);
    apsm_geodesic_work_free(g);
    apsm_neighbourhoods_free(&rows);
    free(distance);
    return status;
}

/* ---- one shape ---- */

typedef struct shape_result {
    double before, after, step;
    bool moved, kept;
} shape_result;

typedef struct round_task {
    const apsm_fidelity *f;
    const apsm_fidelity_prior *prior;
    long round;
    const double *P0;
    double *P;
    fidelity_work *work; /* threads */
    shape_result *result;
} round_task;

static void swap_states(fidelity_work *w)
{
    const fidelity_state t = w->a;
    w->a = w->b;
    w->b = t;
}

/* Of what was known before, over the surfaces' weight: little where they leave little open, and
 * more than in proportion where they leave much. */
static double weight_of_known(const apsm_fidelity *f)
{
    const double F = f->o.fidelity;
    return f->doubt * sqrt(f->doubt) * (1 - F) / F;
}

/* Weights of a round from the mean diagonal of the surface terms. */
static fidelity_weights weights_at(const round_task *t, size_t i, double diagonal)
{
    const apsm_fidelity_options *o = &t->f->o;
    const apsm_fidelity_prior *p = t->prior;
    const size_t fold = i % p->folds, D = 3 * p->J;
    const double share = (double)(t->round + 1) / (double)o->fidelity_rounds; /* of the rounds */
    const double known = diagonal * weight_of_known(t->f);
    return (fidelity_weights){ .stay = diagonal * o->stay + known * o->recall,
                               .smooth = diagonal * o->smooth,
                               .prior = known * o->prior,
                               .order = diagonal * o->order,
                               .contact = o->contact * share / o->floor,
                               .shape = i,
                               .from = t->P0 + i * D,
                               .mean = p->mean + fold * D,
                               .modes = p->modes,
                               .mode = p->mode + fold * p->modes * D,
                               .weight = p->weight + fold * p->modes,
                               .noise = sqrt(p->noise[fold]) };
}

/* From w->a, where the system has been solved, to w->b; false if no length of the step will do. */
static bool try_steps(const round_task *t, size_t i, const fidelity_weights *q, double limit,
                      size_t folds, fidelity_work *w)
{
    const apsm_fidelity *f = t->f;
    double length = 1;
    for (int k = 0; k < HALVINGS; k++, length /= 2) {
        fidelity_move(f, i, length, &w->a, &w->b, w);
        if (fidelity_folds(f, &w->b) > folds) continue;
        fidelity_follow(f, i, &w->a, &w->b, w);
        fidelity_value(f, q, &w->b, w);
        if (w->b.value < w->a.value && w->b.distance <= limit) return true;
    }
    return false;
}

/* One step from w->a to w->b; false if there is none.  Where every length of it takes the surfaces
 * of a shape thinner than h apart, the prior asks for more than they allow, as on long thin shapes
 * whose bends the model does not foresee: it gets a quarter of its weight in q, and once more. */
static bool find_step(const round_task *t, size_t i, double limit, size_t folds,
                      fidelity_weights *q, fidelity_work *w)
{
    const bool thin = t->f->cohort->shape[i].half_thickness < 0.5 * t->f->h;
    for (int k = 0; k < (thin ? WEAKER : 1); k++) {
        if (k > 0) {
            if (!(q->prior > 0)) break;
            q->prior /= 4;
            fidelity_linearise(t->f, i, &w->a, w);
            fidelity_set_prior(t->f, q, w->a.P, w);
            fidelity_value(t->f, q, &w->a, w);
        }
        fidelity_add_quadratic(t->f, q, &w->a, w);
        if (fidelity_solve(t->f, q, w) != APSM_OK) break; /* no step is better than a wrong one */
        if (try_steps(t, i, q, limit, folds, w)) return true;
    }
    return false;
}

static bool descend(const round_task *t, size_t i, double limit, fidelity_work *w)
{
    const apsm_fidelity *f = t->f;
    const size_t folds = fidelity_folds(f, &w->a);
    fidelity_weights q = { 0 };
    bool moved = false;
    for (long k = 0; k < f->o.iterations; k++) {
        const double diagonal = fidelity_linearise(f, i, &w->a, w);
        if (k == 0) {
            q = weights_at(t, i, diagonal);
            fidelity_set_prior(f, &q, w->a.P, w);
            fidelity_value(f, &q, &w->a, w);
        }
        if (!find_step(t, i, limit, folds, &q, w)) break;
        swap_states(w);
        moved = true;
    }
    return moved;
}

/* Halves the way that particles with faults, and their neighbours on the template, have come since
 * the stage began; P = the particles there, back on the surface. */
static void return_half_way(const apsm_fidelity *f, size_t i, const double *P0, const bool *named,
                            double *P)
{
    const apsm_shape *shape = &f->cohort->shape[i];
    for (size_t j = 0; j < f->J; j++) {
        bool returns = named[j];
        for (size_t q = 0; q < APSM_NEIGHBOURS; q++)
            returns |= named[f->N6[APSM_NEIGHBOURS * j + q]];
        if (!returns) continue;
        double normal[3];
        apsm_surface_point on;
        apsm_shape_look_up(shape, 1, P + 3 * j, &on, NULL, normal);
        if (anchor_holds(f->cohort, i, j)) continue;
        for (size_t c = 3 * j; c < 3 * j + 3; c++) P[c] = 0.5 * P[c] + 0.5 * P0[c];
        fidelity_land(shape, f->on_rim[j], normal, P + 3 * j, &on);
    }
}

/* The last round leaves no shape with a fault that it had not when the stage began: particles that
 * make one return half-way, if need be again, and at last the shape as a whole. */
static apsm_status certify_end(const round_task *t, size_t i, fidelity_work *w, shape_result *r)
{
    enum { RETURNS = 6 };
    const size_t J = t->f->J;
    const double *P0 = t->P0 + i * 3 * J;
    double *P = t->P + i * 3 * J;
    faults now, first;
    APSM_TRY(find_faults(t->f, i, P, &w->a, &now, w->named));
    if (now.reasons == 0 && now.count == 0) return APSM_OK;
    APSM_TRY(find_faults(t->f, i, P0, &w->a, &first, NULL));
    for (int k = 0; k < RETURNS && is_worse(&now, &first); k++) {
        r->kept = true;
        return_half_way(t->f, i, P0, w->named, P);
        APSM_TRY(find_faults(t->f, i, P, &w->a, &now, w->named));
    }
    if (is_worse(&now, &first)) memcpy(P, P0, 3 * J * sizeof *P);
    return APSM_OK;
}

/* The first half of the rounds is without the prior. */
static long first_with_prior(const apsm_fidelity *f)
{
    return f->o.fidelity < 1 ? f->o.fidelity_rounds / 2 : f->o.fidelity_rounds;
}

static apsm_status take_round(const round_task *t, size_t i, fidelity_work *w, shape_result *r)
{
    const apsm_fidelity *f = t->f;
    const size_t D = 3 * f->J;
    double *P = t->P + i * D;
    memcpy(w->entry, P, D * sizeof *P);
    memcpy(w->a.P, P, D * sizeof *P);
    apsm_shape_look_up(&f->cohort->shape[i], f->J, P, w->a.S, NULL, w->a.N);
    fidelity_measure(f, i, t->round, &w->a, w);
    r->before = w->a.distance;
    const bool guided = f->anchors.nv > 0 || f->features || w->a.contacts > 0;
    const double limit = (f->doubt > 0 || guided ? growth : 1) * w->a.distance;
    r->moved = descend(t, i, guided ? limit + f->o.floor : limit, w);
    APSM_TRY(w->status);
    r->after = w->a.distance;
    if (r->moved) memcpy(P, w->a.P, D * sizeof *P);
    if (t->round + 1 == f->o.fidelity_rounds) APSM_TRY(certify_end(t, i, w, r));
    for (size_t j = 0; j < f->J; j++)
        r->step += sqrt(vec3_distance2(P + 3 * j, w->entry + 3 * j)) / (f->h * (double)f->J);
    return APSM_OK;
}

static apsm_status round_of_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx;
    const round_task *t = user;
    if (i == t->f->cohort->template_index || !cohort_moves(t->f->cohort, i)) return APSM_OK;
    return take_round(t, i, &t->work[worker], &t->result[i]);
}

apsm_status fidelity_round_of(const apsm_fidelity *f, const apsm_fidelity_prior *prior, size_t i,
                              long round, const double *P0, double *P, fidelity_work *w)
{
    shape_result result = { 0 };
    const round_task t = { .f = f, .prior = prior, .round = round, .P0 = P0, .P = P };
    return take_round(&t, i, w, &result);
}

/* ---- a round ---- */

static void sum_up(const round_task *t, size_t I, apsm_fidelity_record *record)
{
    const size_t movers = cohort_movers(t->f->cohort);
    const double others = movers > 0 ? (double)movers : 1;
    for (size_t i = 0; i < I; i++) {
        const shape_result *r = &t->result[i];
        record->before += r->before / others;
        record->after += r->after / others;
        record->step += r->step / others;
        record->moved += r->moved;
        record->kept += r->kept;
    }
    record->modes = t->prior->modes;
    for (size_t k = 0; k < t->prior->folds; k++)
        record->noise += sqrt(t->prior->noise[k]) / (double)t->prior->folds;
}

/* Whether the shape has a say in what the cohort is like. */
static bool counts(const apsm_fidelity *f, size_t i)
{
    return i != f->cohort->template_index && !(f->o.left_out && f->o.left_out[i]);
}

/* Distance of the surfaces at P, and of the particles at P0 from what the others predict there. */
static apsm_status measure_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx;
    const round_task *t = user;
    fidelity_work *w = &t->work[worker];
    const double *P0 = t->P0 + i * 3 * t->f->J;
    const fidelity_weights q = weights_at(t, i, 1);
    if (!counts(t->f, i)) return APSM_OK;
    memcpy(w->a.P, t->P + i * 3 * t->f->J, 3 * t->f->J * sizeof *P0);
    fidelity_measure(t->f, i, 0, &w->a, w);
    t->result[i].before = w->a.distance;
    t->result[i].after = fidelity_left_out(t->f, &q, P0, w);
    return APSM_OK;
}

/* How far the surfaces leave open where particles are: what is between them once they alone have
 * decided, over the distance of the particles, when the stage began, from what the other shapes
 * predict, squared.  Surfaces that fit to a small part of that know better than the model. */
static double doubt_of(const round_task *t)
{
    double misfit = 0, spread = 0;
    for (size_t i = 0; i < t->f->cohort->I; i++) {
        misfit += t->result[i].before;
        spread += t->result[i].after;
    }
    return spread > 0 ? misfit * misfit / (spread * spread) : 0;
}

/* One task for every shape; t->result is the caller's to free. */
static apsm_status run_tasks(apsm_context *ctx, round_task *t, apsm_task_fn task)
{
    const size_t I = t->f->cohort->I, threads = (size_t)apsm_context_threads(ctx);
    t->work = calloc(threads, sizeof *t->work);
    t->result = calloc(I, sizeof *t->result);
    apsm_status status = t->work && t->result ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t k = 0; status == APSM_OK && k < threads; k++)
        status = fidelity_work_alloc(t->f, t->prior->modes, &t->work[k]);
    if (status == APSM_OK) status = apsm_own_for(ctx, I, NULL, task, t, NULL);
    if (status == APSM_OK) status = apsm_gather(ctx, I, NULL, sizeof *t->result, t->result);
    for (size_t k = 0; t->work && k < threads; k++) fidelity_work_free(&t->work[k]);
    free(t->work);
    return status;
}

static apsm_status fit_prior(apsm_context *ctx, const apsm_fidelity *f, const double *P,
                             apsm_fidelity_prior *prior)
{
    return apsm_fidelity_prior_fit(ctx, f->cohort->I, f->J, P, f->h, f->o.fidelity_modes,
                                   f->o.left_out, prior);
}

static apsm_status measure_doubt(apsm_context *ctx, const double *P0, double *P, apsm_fidelity *f)
{
    apsm_fidelity_prior prior;
    APSM_TRY(fit_prior(ctx, f, P0, &prior));
    round_task t = { .f = f, .prior = &prior, .P0 = P0, .P = P };
    const apsm_status status = run_tasks(ctx, &t, measure_shape);
    if (status == APSM_OK) f->doubt = doubt_of(&t);
    free(t.result);
    apsm_fidelity_prior_free(&prior);
    return status;
}

apsm_status apsm_fidelity_round(apsm_context *ctx, apsm_fidelity *f, long round, const double *P0,
                                double *P, apsm_fidelity_record *record)
{
    apsm_fidelity_prior prior;
    const size_t I = f->cohort->I;
    *record = (apsm_fidelity_record){ 0 };
    if (I < 2) return APSM_OK;
    if (round < fidelity_coarse_rounds(f))
        return fidelity_coarse_round(ctx, f, round, P0, P, record);
    if (round == first_with_prior(f)) APSM_TRY(measure_doubt(ctx, P0, P, f));
    APSM_TRY(fit_prior(ctx, f, P, &prior));
    round_task t = { .f = f, .prior = &prior, .round = round, .P0 = P0, .P = P };
    apsm_status status = run_tasks(ctx, &t, round_of_shape);
    if (status == APSM_OK) status = apsm_gather(ctx, I, NULL, 3 * f->J * sizeof *P, P);
    if (status == APSM_OK) sum_up(&t, I, record);
    free(t.result);
    apsm_fidelity_prior_free(&prior);
    return status;
}
