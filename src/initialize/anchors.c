#include "initialize/anchors.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "linalg/linalg.h"

static const double give = 1e-3; /* of the kernel's size: two anchors at one place still solve */

static void take_place(apsm_cohort *c, size_t i, size_t l, const double x[3])
{
    double *to = c->anchors.x + 3 * (i * c->anchors.L + l);
    c->anchors.has[i * c->anchors.L + l] = true;
    memcpy(to, x, 3 * sizeof *to);
    apsm_closest at;
    if (!c->anchors.hold) return;
    apsm_bvh_closest(c->shape[i].bvh, x, INFINITY, &at);
    memcpy(to, at.x, 3 * sizeof *to);
}

apsm_status apsm_cohort_anchor(apsm_context *ctx, apsm_cohort *cohort, const landmark_table *t,
                               bool hold, double weight)
{
    const size_t m = cohort->template_index;
    size_t L = 0, k = 0;
    for (size_t l = 0; l < t->L; l++) L += landmark_is_there(t, m, l);
    if (L == 0)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "%s: the template has none of the landmarks that are to guide the "
                         "particles; name one that has them with --template",
                         cohort->shape[m].name);
    cohort->anchors = (apsm_anchors){ .L = L, .hold = hold, .weight = weight };
    cohort->anchors.has = calloc(cohort->I * L, sizeof *cohort->anchors.has);
    cohort->anchors.x = calloc(3 * cohort->I * L, sizeof *cohort->anchors.x);
    if (!cohort->anchors.has || !cohort->anchors.x) return APSM_ERR_MEMORY;
    for (size_t l = 0; l < t->L; l++) {
        if (!landmark_is_there(t, m, l)) continue;
        for (size_t i = 0; i < cohort->I; i++)
            if (landmark_is_there(t, i, l)) take_place(cohort, i, k, landmark_at(t, i, l));
        k++;
    }
    return APSM_OK;
}

void apsm_anchors_hold(const apsm_cohort *c, size_t i, double *P)
{
    for (size_t l = 0; l < c->anchors.L; l++)
        if (anchor_holds(c, i, l)) memcpy(P + 3 * l, anchor_at(c, i, l), 3 * sizeof *P);
}

static double kernel(const double a[3], const double b[3], double reach)
{
    return exp(-0.5 * vec3_distance2(a, b) / (reach * reach));
}

/* C (n x 3) <- (K + give)^-1 (anchors - X) for the anchors that are there. */
static apsm_status solve_pulls(const apsm_cohort *c, size_t i, const double *X, double reach,
                               size_t *n, double *from, double *C, double *K)
{
    *n = 0;
    for (size_t l = 0; l < c->anchors.L; l++) {
        if (!anchor_is_there(c, i, l)) continue;
        memcpy(from + 3 * *n, X + 3 * l, 3 * sizeof *from);
        vec3_sub(anchor_at(c, i, l), X + 3 * l, C + 3 * (*n)++);
    }
    for (size_t a = 0; a < *n; a++)
        for (size_t b = 0; b < *n; b++)
            K[a * *n + b] = kernel(from + 3 * a, from + 3 * b, reach) + (a == b ? give : 0);
    APSM_TRY(apsm_cholesky(*n, K));
    apsm_cholesky_solve(*n, K, 3, C);
    return APSM_OK;
}

static void follow(const apsm_shape *shape, size_t n, const double *from, const double *C,
                   double reach, const double N[3], double p[3])
{
    apsm_closest any, at;
    const double was[3] = { p[0], p[1], p[2] };
    for (size_t a = 0; a < n; a++) vec3_add_scaled(p, kernel(was, from + 3 * a, reach), C + 3 * a);
    apsm_bvh_closest(shape->bvh, p, INFINITY, &any);
    const double most = sqrt(any.distance2) + reach;
    apsm_bvh_closest_facing(shape->bvh, p, N, 0, most * most, &at);
    memcpy(p, isfinite(at.distance2) ? at.x : any.x, sizeof any.x);
}

apsm_status apsm_anchors_pull(const apsm_cohort *c, size_t i, size_t J, const double *X,
                              const double *N, double reach, double *P)
{
    const size_t L = c->anchors.L;
    size_t n;
    double *from = malloc((6 * L + L * L + 1) * sizeof *from);
    if (!from) return APSM_ERR_MEMORY;
    double *C = from + 3 * L;
    const apsm_status status = solve_pulls(c, i, X, reach, &n, from, C, C + 3 * L);
    for (size_t j = 0; j < J && status == APSM_OK && n > 0; j++)
        follow(&c->shape[i], n, from, C, reach, N + 3 * j, P + 3 * j);
    if (status == APSM_OK) apsm_anchors_hold(c, i, P);
    free(from);
    return status;
}
