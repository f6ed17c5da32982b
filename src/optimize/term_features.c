/* The feature term: sum_j |f_i(p_ij) - f_t(p_tj)|^2 / 2, f the weighted features of the surfaces.
 * Its step is a damped Gauss-Newton one, a length already: along the surface, at most about h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "initialize/features.h"
#include "optimize/epoch.h"
#include "optimize/terms.h"

static bool is_on(const optimizer *op)
{
    return op->cohort->features.F > 0 && op->I > 1;
}

static double weight(const optimizer *op)
{
    return op->o->step.step == APSM_STEP_SCALED ? 1 : op->o->step.learning_rate;
}

/* g = slope' r / (|slope|^2 + 1 / h^2), loss |r|^2 / 2. */
static double one_particle(size_t F, const double *f, const double *ft, const double *slope,
                           double h, double g[3])
{
    double loss = 0, steep = 1 / (h * h);
    memset(g, 0, 3 * sizeof *g);
    for (size_t s = 0; s < F; s++) {
        const double r = f[s] - ft[s];
        vec3_add_scaled(g, r, slope + 3 * s);
        steep += vec3_dot(slope + 3 * s, slope + 3 * s);
        loss += 0.5 * r * r;
    }
    for (size_t c = 0; c < 3; c++) g[c] /= steep;
    return loss;
}

static apsm_status gradient(const optimizer *op, size_t k, worker *w, double *loss, double *g)
{
    const size_t i = op->batch[k], t = op->cohort->template_index, F = op->cohort->features.F;
    const double *P = particles(op, i);
    double *f = malloc(5 * F * sizeof *f);
    (void)w;
    if (!f) return APSM_ERR_MEMORY;
    *loss = 0;
    memset(g, 0, 3 * op->J * sizeof *g);
    for (size_t j = 0; j < op->J && i != t; j++) {
        apsm_surface_point on;
        apsm_shape_look_up(&op->cohort->shape[t], 1, op->tP + 3 * j, &on, NULL, NULL);
        apsm_features_at(op->cohort, t, &on, f + F, NULL);
        apsm_shape_look_up(&op->cohort->shape[i], 1, P + 3 * j, &on, NULL, NULL);
        apsm_features_at(op->cohort, i, &on, f, f + 2 * F);
        *loss += one_particle(F, f, f + F, f + 2 * F, op->state->h, g + 3 * j);
    }
    free(f);
    return APSM_OK;
}

const term term_features = {
    .name = "features", .is_on = is_on, .weight = weight, .gradient = gradient
};
