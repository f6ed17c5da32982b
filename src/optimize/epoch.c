#include "optimize/epoch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/bvh_guess.h"
#include "geometry/vec3.h"
#include "initialize/anchors.h"
#include "optimize/snap.h"
#include "optimize/terms.h"

/* Of the template, particles that are not on its rim keep so far from it, in h. */
static const double rim_width = 1e-3;

/* ---- gradients ---- */

/* Unit normals N at P; guess as in apsm_snap_closest. */
void look_up_normals(const optimizer *op, size_t i, const double *P, uint32_t *guess, double *N)
{
    const apsm_shape *shape = &op->cohort->shape[i];
    if (op->o->step.snap == APSM_SNAP_FIELD) {
        apsm_field_sample(shape->field, op->J, P, NULL, N);
        return;
    }
    for (size_t j = 0; j < op->J; j++) {
        apsm_closest c;
        bvh_closest_guess(shape->bvh, P + 3 * j, INFINITY, guess + j, &c);
        apsm_surface_normal(&shape->mesh, shape->VN, &c.on, N + 3 * j);
    }
}

const double *optimizer_normals(const optimizer *op, size_t i)
{
    double *N = row_of(op, op->N, i);
    if (!op->fresh[i]) look_up_normals(op, i, particles(op, i), guess_of(op, i), N);
    op->fresh[i] = true;
    return N;
}

/* Gradients of the terms over all parts of shape batch[k], and their losses. */
static apsm_status gradients_over_parts(const optimizer *op, size_t k, worker *w, double *loss)
{
    for (size_t t = 0; t < op->n_terms; t++) {
        loss[t] = NAN;
        if (op->terms[t]->over_parts && op->terms[t]->is_on(op))
            APSM_TRY(op->terms[t]->gradient(op, k, w, &loss[t], w->grad + t * op->all * 3));
    }
    return APSM_OK;
}

/* The step of one part of it, of the terms that are on; loss: of those over all parts, `whole`. */
static apsm_status step_of_part(const optimizer *op, const optimizer *whole, size_t k, worker *w,
                                const double *loss)
{
    shape_record *record = &op->record[op->batch[k]];
    const double *grad[APSM_TERMS_MOST];
    double weight[APSM_TERMS_MOST];
    *record = (shape_record){ .error2 = NAN };
    for (size_t t = 0; t < op->n_terms; t++) {
        const term *of = op->terms[t];
        const optimizer *at = of->over_parts ? whole : op;
        double *g = w->grad + (t * op->all + op->first) * 3;
        const bool on = of->is_on(at);
        record->loss[t] = loss[t];
        grad[t] = on ? g : NULL;
        weight[t] = on ? of->weight(at) : 0;
        if (on && !of->over_parts) APSM_TRY(of->gradient(op, k, w, &record->loss[t], g));
    }
    apsm_step(op->J, op->n_terms, weight, grad, INFINITY, row_of(op, op->step, k));
    return APSM_OK;
}

/* The unclipped step (11) of shape batch[k]. */
apsm_status gradients_of_shape(apsm_context *ctx, size_t k, int worker_index, void *user)
{
    optimizer op = *(optimizer *)user; /* a copy with the task's own error line */
    op.ctx = ctx;
    worker *w = &op.worker[worker_index];
    double loss[APSM_TERMS_MOST];
    if (!cohort_moves(op.cohort, op.batch[k])) return APSM_OK;
    APSM_TRY(gradients_over_parts(&op, k, w, loss));
    for (size_t d = 0; d < cohort_parts(op.cohort); d++) {
        part_view view;
        APSM_TRY(step_of_part(part_of(&op, d, &view), &op, k, w, loss));
    }
    return APSM_OK;
}

static void snap_to_surface(const optimizer *op, size_t i, double *P, worker *w)
{
    const apsm_shape *shape = &op->cohort->shape[i];
    if (op->o->step.snap == APSM_SNAP_CLOSEST)
        apsm_snap_closest(shape->bvh, op->J, P, NULL, guess_of(op, i));
    if (op->o->step.snap != APSM_SNAP_FIELD) return;
    for (long n = 0; n < op->o->step.snaps; n++) { /* ge holds D, gc the normals */
        apsm_field_sample(shape->field, op->J, P, w->ge, w->gc);
        apsm_snap(op->J, w->ge, w->gc, P);
    }
}

/* A step of h/4 may reach through a thin shape: particles return to the side that they left (N:
 * their normals there), unless the way is longer by `detour`. */
static void snap_to_side(const apsm_shape *shape, size_t J, const double *N, double detour,
                         double *P)
{
    for (size_t j = 0; j < J; j++) {
        apsm_closest any, side;
        apsm_bvh_closest(shape->bvh, P + 3 * j, INFINITY, &any);
        const double reach = sqrt(any.distance2) + detour;
        apsm_bvh_closest_facing(shape->bvh, P + 3 * j, N + 3 * j, 0, reach * reach, &side);
        memcpy(P + 3 * j, side.distance2 < INFINITY ? side.x : any.x, sizeof any.x);
    }
}

/* Two of the template's rim particles that were to come closer than this stay where they were: in
 * h, of which seats on a rim are about .7 apart. */
static const double rim_apart = 0.4;

static bool come_together(size_t j, size_t k, double apart, const double *tP, const double *P)
{
    const double d2 = vec3_distance2(P + 3 * j, P + 3 * k);
    return d2 < apart * apart && d2 < vec3_distance2(tP + 3 * j, tP + 3 * k);
}

/* One pass; whether it put any back. */
static bool put_back(size_t J, const bool *on_rim, double apart, const double *tP, double *P)
{
    bool any = false;
    for (size_t j = 0; j < J; j++)
        for (size_t k = 0; k < j && on_rim[j]; k++) {
            if (!on_rim[k] || !come_together(j, k, apart, tP, P)) continue;
            memcpy(P + 3 * j, tP + 3 * j, 3 * sizeof *P);
            memcpy(P + 3 * k, tP + 3 * k, 3 * sizeof *P);
            any = true;
        }
    return any;
}

/* It ends: every pass but the last puts back one more for good, since two that are where they were
 * do not come together. */
void keep_rim_apart(size_t J, const bool *on_rim, double apart, const double *tP, double *P)
{
    while (put_back(J, on_rim, apart, tP, P)) continue;
}

/* Particles of the rim stay on it; of the template, too, no other comes there: which ones they are
 * is read from its positions. */
static void keep_rim(const optimizer *op, size_t i, double *P)
{
    const apsm_shape *shape = &op->cohort->shape[i];
    const size_t J = op->J;
    if (shape->rim.n == 0) return;
    apsm_shape_keep_on_rim(shape, J, op->on_rim, P, NULL);
    if (i != op->cohort->template_index) return;
    keep_rim_apart(J, op->on_rim, rim_apart * op->state->h, op->tP, P);
    for (size_t j = 0; j < J; j++) {
        apsm_rim_point p;
        if (op->on_rim[j]) continue;
        apsm_rim_closest(&shape->rim, P + 3 * j, &p);
        if (p.distance2 < rim_width * rim_width * op->state->h * op->state->h)
            memcpy(P + 3 * j, op->tP + 3 * j, 3 * sizeof *P);
    }
}

static bool is_thin(const optimizer *op, size_t i)
{
    const double thickness = 2 * op->cohort->shape[i].half_thickness;
    return op->o->step.snap == APSM_SNAP_CLOSEST && thickness < op->state->h;
}

static apsm_status move_part(apsm_context *ctx, const optimizer *op, size_t k, worker *w)
{
    const size_t i = op->batch[k];
    double *P = particles(op, i), *step = row_of(op, op->step, k);
    const double minus_one = -1, *const grad = step;
    const double clip = op->o->step.step_clip > 0 ? op->o->step.step_clip * op->state->h : INFINITY;
    op->record[i].step = apsm_step(op->J, 1, &minus_one, &grad, clip, step) / op->state->h;
    for (size_t x = 0; x < op->J * 3; x++) {
        P[x] += step[x];
        if (!isfinite(P[x]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE,
                             "%s: particle %zu left the finite numbers; lower alpha, beta or gamma",
                             op->cohort->shape[i].name, x / 3);
    }
    if (is_thin(op, i))
        snap_to_side(&op->cohort->shape[i], op->J, row_of(op, op->N, i), op->state->h, P);
    else
        snap_to_surface(op, i, P, w);
    keep_rim(op, i, P);
    apsm_anchors_hold(op->cohort, i, P);
    op->fresh[i] = false;
    optimizer_normals(op, i);
    return APSM_OK;
}

apsm_status move_shape(apsm_context *ctx, size_t k, int worker_index, void *user)
{
    optimizer *op = user;
    if (!cohort_moves(op->cohort, op->batch[k])) return APSM_OK;
    for (size_t d = 0; d < cohort_parts(op->cohort); d++) {
        part_view view;
        APSM_TRY(move_part(ctx, part_of(op, d, &view), k, &op->worker[worker_index]));
    }
    return APSM_OK;
}
