/* The first rounds of many particles ("Many particles follow few at first" in docs/method.md):
 * some, spread out, take the rounds, then the others follow the interpolant (1) of their moves
 * since the stage began, back to the surface.  What is left between the surfaces is finer than the
 * few can see, and for the rounds of all. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/deal.h"
#include "geometry/vec3.h"
#include "initialize/anchors.h"
#include "optimize/fidelity_shape.h"

struct fidelity_coarse {
    size_t J;
    apsm_fidelity *f; /* of J of the particles, */
    uint32_t *which;  /* J: these */
    apsm_warp carry;  /* from them to all */
};

/* Not on sheets thinner than these are apart, whose sides they would not keep apart. */
long fidelity_coarse_rounds(const apsm_fidelity *f)
{
    const apsm_fidelity_options *o = &f->o;
    const apsm_shape *shape = &f->cohort->shape[f->cohort->template_index];
    if (!(o->coarse > 0) || (size_t)o->coarse > f->J / 2 || f->cohort->anchors.hold) return 0;
    const double apart = f->h * sqrt((double)f->J / (double)o->coarse);
    return shape->half_thickness < 0.5 * apart ? 0 : o->fidelity_rounds / 2;
}

void fidelity_coarse_free(fidelity_coarse *c)
{
    if (!c) return;
    apsm_fidelity_free(c->f);
    apsm_warp_free(&c->carry);
    free(c->which);
    free(c);
}

/* Farthest points, those that look another way counting as farther: both sides of a sheet get
 * theirs.  least (J): scratch. */
static void spread_out(const apsm_fidelity *f, size_t J, double *least, uint32_t *which)
{
    const double apart2 = f->h * f->h * (double)f->J / (double)J;
    for (size_t j = 0; j < f->J; j++) least[j] = INFINITY;
    for (size_t k = 0, next = 0; k < J; k++) {
        const double *x = f->T + 3 * next, *n = f->TN + 3 * next;
        which[k] = (uint32_t)next;
        for (size_t j = 0; j < f->J; j++) {
            const double d2 =
                vec3_distance2(x, f->T + 3 * j) + apart2 * vec3_distance2(n, f->TN + 3 * j);
            least[j] = fmin(least[j], d2);
        }
        least[next] = -1;
        for (size_t j = 0; j < f->J; j++)
            if (least[j] > least[next]) next = j;
    }
}

static void take(const fidelity_coarse *c, const double *all, double *some)
{
    for (size_t k = 0; k < c->J; k++) memcpy(some + 3 * k, all + 3 * c->which[k], 3 * sizeof *some);
}

static apsm_status make(apsm_context *ctx, const apsm_fidelity *f, fidelity_coarse *c)
{
    double *T = malloc(3 * c->J * sizeof *T), *least = malloc(f->J * sizeof *least);
    c->which = malloc(c->J * sizeof *c->which);
    apsm_status status = T && least && c->which ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        spread_out(f, c->J, least, c->which);
        take(c, f->T, T);
        status = apsm_warp_build(ctx, APSM_PHI_R, f->J, f->T, c->J, T, &c->carry);
    }
    if (status == APSM_OK) {
        apsm_fidelity_options o = f->o;
        o.coarse = 0;
        status = apsm_fidelity_new(ctx, f->cohort, c->J, T, &o, &c->f);
    }
    free(T);
    free(least);
    return status;
}

/* ---- a round ---- */

typedef struct carriage {
    const apsm_fidelity *f;
    const double *P0; /* I x J x 3 */
    double *P;
    double *moves; /* I x c->J x 3: of the few since the stage began */
} carriage;

static apsm_status carry_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    const carriage *t = user;
    const apsm_fidelity *f = t->f;
    const apsm_shape *shape = &f->cohort->shape[i];
    if (i == f->cohort->template_index || !cohort_moves(f->cohort, i)) return APSM_OK;
    double *move = malloc(3 * f->J * sizeof *move);
    if (!move) return APSM_ERR_MEMORY;
    apsm_warp_apply(&f->coarse->carry, t->moves + i * 3 * f->coarse->J, move);
    for (size_t j = 0; j < f->J; j++) {
        const double *x0 = t->P0 + 3 * (i * f->J + j);
        double *x = t->P + 3 * (i * f->J + j), normal[3];
        apsm_surface_point on;
        apsm_shape_look_up(shape, 1, x0, &on, NULL, normal);
        for (size_t a = 0; a < 3; a++) x[a] = x0[a] + move[3 * j + a];
        fidelity_land(shape, f->on_rim[j], normal, x, &on);
    }
    free(move);
    return APSM_OK;
}

static apsm_status carry(apsm_context *ctx, const apsm_fidelity *f, const double *P0, double *P,
                         const double *p0, double *p)
{
    const size_t I = f->cohort->I, n = I * 3 * f->coarse->J;
    for (size_t x = 0; x < n; x++) p[x] -= p0[x];
    carriage t = { f, P0, P, p };
    APSM_TRY(apsm_own_for(ctx, I, NULL, carry_shape, &t, NULL));
    return apsm_gather(ctx, I, NULL, 3 * f->J * sizeof *P, P);
}

static apsm_status take_round(apsm_context *ctx, apsm_fidelity *f, long round, const double *P0,
                              double *P, double *p0, double *p, apsm_fidelity_record *record)
{
    fidelity_coarse *c = f->coarse;
    const size_t I = f->cohort->I;
    for (size_t i = 0; i < I; i++) {
        take(c, P0 + i * 3 * f->J, p0 + i * 3 * c->J);
        take(c, P + i * 3 * f->J, p + i * 3 * c->J);
    }
    APSM_TRY(apsm_fidelity_round(ctx, c->f, round, p0, p, record)); /* no doubt yet */
    const double scale = c->f->h / f->h;
    record->before *= scale;
    record->after *= scale;
    record->step *= scale;
    record->noise *= scale;
    for (size_t i = 0; i < I; i++)
        for (size_t k = 0; k < c->J; k++)
            memcpy(P + 3 * (i * f->J + c->which[k]), p + 3 * (i * c->J + k), 3 * sizeof *P);
    if (round + 1 < fidelity_coarse_rounds(f)) return APSM_OK;
    APSM_TRY(carry(ctx, f, P0, P, p0, p));
    fidelity_coarse_free(c);
    f->coarse = NULL;
    return APSM_OK;
}

apsm_status fidelity_coarse_round(apsm_context *ctx, apsm_fidelity *f, long round, const double *P0,
                                  double *P, apsm_fidelity_record *record)
{
    if (!f->coarse) {
        f->coarse = calloc(1, sizeof *f->coarse);
        if (!f->coarse) return APSM_ERR_MEMORY;
        f->coarse->J = (size_t)f->o.coarse;
        APSM_TRY(make(ctx, f, f->coarse));
    }
    const size_t n = f->cohort->I * 3 * f->coarse->J;
    double *p0 = malloc(n * sizeof *p0), *p = malloc(n * sizeof *p);
    const apsm_status status =
        p0 && p ? take_round(ctx, f, round, P0, P, p0, p, record) : APSM_ERR_MEMORY;
    free(p0);
    free(p);
    return status;
}
