/* Bootstrap of modes (Fisher et al., J. Am. Stat. Assoc. 111, 2016): a cohort drawn again lies in
 * the span of the modes, where shape i is its scores b_i.  With n_i times shape i drawn,
 *
 *   C* = sum_i n_i (b_i - b*) (b_i - b*)^T = Q diag Q^T,   mode*_k . mode_k = Q_kk             (M3)
 *
 * of the first 32 scores.  Chance: the k-th longest of r pieces of a stick broken at random has
 *
 *   1/r sum_{l = k..r} 1/l                                                                    (M4)
 *
 * of it on average (Frontier 1976; Jackson, Ecology 74, 1993). */
#include "model/mode_trust.h"

#include <math.h>
#include <stdlib.h>

#include "core/random.h"
#include "core/robust.h"
#include "linalg/linalg.h"
#include "model/mode_sign.h"

enum { DRAWS = 100, MOST = 32 };

typedef struct drawing {
    const apsm_shape_model *model;
    size_t modes;   /* looked at */
    double *change; /* modes x APSM_MODE_CHANGES */
    double *b;      /* I x modes: the scores drawn, then less their mean */
    double *C, *Q, *w;
    double *cosine; /* modes x DRAWS: signed */
    double *same;   /* modes: draws of the same sign */
} drawing;

/* b <- scores of I shapes drawn with replacement, less their mean. */
static void draw(const drawing *d, apsm_random *rng)
{
    const size_t I = d->model->I, m = d->modes;
    for (size_t i = 0; i < I; i++) {
        const double *from = d->model->score + d->model->modes * (size_t)apsm_random_below(rng, I);
        for (size_t k = 0; k < m; k++) d->b[i * m + k] = from[k];
    }
    for (size_t k = 0; k < m; k++) {
        double mean = 0.0;
        for (size_t i = 0; i < I; i++) mean += d->b[i * m + k] / (double)I;
        for (size_t i = 0; i < I; i++) d->b[i * m + k] -= mean;
    }
}

/* Whether the rule of signs gives the combination q of the modes the sign that its part q_k of mode
 * k has. */
static bool has_same_sign(const drawing *d, const double *q, size_t k)
{
    double change[APSM_MODE_CHANGES] = { 0 };
    for (size_t l = 0; l < d->modes; l++)
        for (size_t a = 0; a < APSM_MODE_CHANGES; a++)
            change[a] += q[l] * d->change[l * APSM_MODE_CHANGES + a];
    const double direction = apsm_mode_direction(change);
    return fabs(direction) >= APSM_MODE_TIE && (direction > 0.0) == (q[k] > 0.0);
}

static apsm_status compare_draw(const drawing *d, size_t number)
{
    const size_t I = d->model->I, m = d->modes;
    apsm_gemm(1, 0, m, m, I, 1.0, d->b, m, d->b, m, 0.0, d->C, m);
    APSM_TRY(apsm_symmetric_eigen(m, d->C, d->w, d->Q));
    for (size_t k = 0; k < m; k++) {
        const double *q = d->Q + k * m;
        d->cosine[k * DRAWS + number] = fabs(q[k]);
        d->same[k] += has_same_sign(d, q, k);
    }
    return APSM_OK;
}

static double chance_of(size_t k, size_t r)
{
    double sum = 0.0;
    for (size_t l = k; l < r; l++) sum += 1.0 / (double)(l + 1);
    return sum / (double)r;
}

static void conclude(drawing *d, apsm_mode_trust *trust)
{
    const apsm_shape_model *m = d->model;
    double total = 0.0;
    for (size_t k = 0; k < m->modes; k++) total += m->variance[k];
    for (size_t k = 0; k < m->modes; k++) {
        apsm_mode_trust *t = &trust[k];
        *t = (apsm_mode_trust){ .share = m->variance[k] / total, .chance = chance_of(k, m->modes) };
        if (k >= d->modes) continue;
        t->cosine = robust_median(DRAWS, d->cosine + k * DRAWS);
        t->same_sign = d->same[k] / DRAWS;
        t->direction = apsm_mode_direction(d->change + APSM_MODE_CHANGES * k);
        t->trusted = t->cosine >= APSM_MODE_COSINE && t->share > t->chance &&
                     fabs(t->direction) >= APSM_MODE_CLEAR;
    }
}

static apsm_status measure(apsm_context *ctx, drawing *d)
{
    const apsm_shape_model *m = d->model;
    for (size_t k = 0; k < d->modes; k++)
        apsm_mode_changes(m->J, m->mean, m->mode + 3 * m->J * k, 1e-6 * sqrt(m->variance[0]),
                          d->change + APSM_MODE_CHANGES * k);
    for (size_t number = 0; number < DRAWS; number++) {
        apsm_random rng =
            apsm_random_stream(apsm_context_seed(ctx), APSM_STREAM_BOOTSTRAP, number, 1);
        draw(d, &rng);
        APSM_TRY(compare_draw(d, number));
    }
    return APSM_OK;
}

apsm_status apsm_mode_trust_of(apsm_context *ctx, const apsm_shape_model *model,
                               apsm_mode_trust *trust)
{
    const size_t m = model->modes < MOST ? model->modes : MOST;
    if (m == 0) return APSM_OK;
    double *all = calloc(m * (APSM_MODE_CHANGES + model->I + 2 * m + 2 + DRAWS), sizeof *all);
    if (!all) return APSM_ERR_MEMORY;
    drawing d = { .model = model, .modes = m, .change = all };
    d.b = d.change + m * APSM_MODE_CHANGES;
    d.C = d.b + m * model->I;
    d.Q = d.C + m * m;
    d.w = d.Q + m * m;
    d.same = d.w + m;
    d.cosine = d.same + m;
    const apsm_status status = measure(ctx, &d);
    if (status == APSM_OK) conclude(&d, trust);
    free(all);
    return status;
}

const char *apsm_mode_trust_text(const apsm_mode_trust *trust)
{
    if (trust->trusted) return "can be trusted";
    if (!(trust->share > trust->chance)) return "not told apart from noise";
    if (trust->cosine < APSM_MODE_COSINE) return "other shapes would show another one";
    return "real, but which end is plus is a near tie";
}
