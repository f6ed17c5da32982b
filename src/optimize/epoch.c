#include "optimize/epoch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/bvh_guess.h"
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
    double *N = op->N + i * op->J * 3;
    if (!op->fresh[i]) look_up_normals(op, i, particles(op, i), op->guess + i * op->J, N);
    op->fresh[i] = true;
    return N;
}

/* The unclipped step (11) of shape batch[k], of the terms that are on. */
apsm_status gradients_of_shape(apsm_context *ctx, size_t k, int worker_index, void *user)
{
    optimizer op = *(optimizer *)user; /* a copy with the task's own error line */
    op.ctx = ctx;
    worker *w = &op.worker[worker_index];
    shape_record *record = &op.record[op.batch[k]];
    const double *grad[APSM_TERMS_MOST];
    double weight[APSM_TERMS_MOST];
    *record = (shape_record){ .error2 = NAN };
    if (!cohort_moves(op.cohort, op.batch[k])) return APSM_OK;
    for (size_t t = 0; t < op.n_terms; t++) {
        double *g = w->grad + t * op.J * 3;
        const bool on = op.terms[t]->is_on(&op);
        record->loss[t] = NAN;
        grad[t] = on ? g : NULL;
        weight[t] = on ? op.terms[t]->weight(&op) : 0;
        if (on) APSM_TRY(op.terms[t]->gradient(&op, k, w, &record->loss[t], g));
    }
    apsm_step(op.J, op.n_terms, weight, grad, INFINITY, op.step + k * op.J * 3);
    return APSM_OK;
}

static void snap_to_surface(const optimizer *op, size_t i, double *P, worker *w)
{
    const apsm_shape *shape = &op->cohort->shape[i];
    if (op->o->step.snap == APSM_SNAP_CLOSEST)
        apsm_snap_closest(shape->bvh, op->J, P, NULL, op->guess + i * op->J);
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

/* Particles of the rim stay on it; of the template, too, no other comes there: which ones they are
 * is read from its positions. */
static void keep_rim(const optimizer *op, size_t i, double *P)
{
    const apsm_shape *shape = &op->cohort->shape[i];
    const size_t J = op->J;
    if (shape->rim.n == 0) return;
    apsm_shape_keep_on_rim(shape, J, op->on_rim, P, NULL);
    if (i != op->cohort->template_index) return;
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

apsm_status move_shape(apsm_context *ctx, size_t k, int worker_index, void *user)
{
    const optimizer *op = user;
    const size_t i = op->batch[k];
    double *P = particles(op, i), *step = op->step + k * op->J * 3;
    const double minus_one = -1, *const grad = step;
    const double clip = op->o->step.step_clip > 0 ? op->o->step.step_clip * op->state->h : INFINITY;
    if (!cohort_moves(op->cohort, i)) return APSM_OK;
    op->record[i].step = apsm_step(op->J, 1, &minus_one, &grad, clip, step) / op->state->h;
    for (size_t x = 0; x < op->J * 3; x++) {
        P[x] += step[x];
        if (!isfinite(P[x]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE,
                             "%s: particle %zu left the finite numbers; lower alpha, beta or gamma",
                             op->cohort->shape[i].name, x / 3);
    }
    if (is_thin(op, i))
        snap_to_side(&op->cohort->shape[i], op->J, op->N + i * op->J * 3, op->state->h, P);
    else
        snap_to_surface(op, i, P, &op->worker[worker_index]);
    keep_rim(op, i, P);
    apsm_anchors_hold(op->cohort, i, P);
    op->fresh[i] = false;
    optimizer_normals(op, i);
    return APSM_OK;
}
