/* The landmark term: sum_l |a_l P_i - z_il|^2 / 2, a_l the row of the warp (docs/method.md,
 * "Metrics") at the template's landmark, z_il the landmark of shape i.  Its gradient is a length
 * already; a step with weight 1 takes about all of a lone landmark's distance away. */
#include <math.h>
#include <string.h>

#include "geometry/vec3.h"
#include "initialize/anchors.h"
#include "optimize/epoch.h"
#include "optimize/terms.h"

static bool is_on(const optimizer *op)
{
    return op->cohort->anchors.L > 0 && !op->cohort->anchors.hold &&
           op->cohort->anchors.weight > 0 && op->I > 1;
}

static double weight(const optimizer *op)
{
    const double step = op->o->step.step == APSM_STEP_SCALED ? 1 : op->o->step.learning_rate;
    return step * fmin(op->cohort->anchors.weight, 1);
}

/* The rows change with the template's particles. */
static apsm_status prepare(optimizer *op)
{
    const size_t t = op->cohort->template_index;
    if (!is_on(op)) return APSM_OK;
    apsm_warp_free(op->anchors);
    return apsm_warp_build(op->ctx, APSM_PHI_R, op->cohort->anchors.L, anchor_at(op->cohort, t, 0),
                           op->J, op->tP, op->anchors);
}

static apsm_status gradient(const optimizer *op, size_t k, worker *w, double *loss, double *g)
{
    const size_t i = op->batch[k], J = op->J;
    const double *P = particles(op, i);
    (void)w;
    *loss = 0;
    memset(g, 0, 3 * J * sizeof *g);
    if (i == op->cohort->template_index) return APSM_OK;
    for (size_t l = 0; l < op->anchors->nv; l++) {
        const double *a = op->anchors->W + l * J;
        double r[3] = { 0 };
        if (!anchor_is_there(op->cohort, i, l)) continue;
        for (size_t j = 0; j < J; j++) vec3_add_scaled(r, a[j], P + 3 * j);
        vec3_sub(r, anchor_at(op->cohort, i, l), r);
        for (size_t j = 0; j < J; j++) vec3_add_scaled(g + 3 * j, a[j], r);
        *loss += 0.5 * vec3_dot(r, r);
    }
    return APSM_OK;
}

const term term_landmarks = {
    .name = "landmarks", .is_on = is_on, .weight = weight, .prepare = prepare, .gradient = gradient
};
