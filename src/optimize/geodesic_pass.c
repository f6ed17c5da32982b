#include "optimize/geodesic_pass.h"

#include <stdlib.h>

#include "core/deal.h"
#include "correspond/geodesic_correspondence.h"

typedef struct pass {
    const apsm_cohort *cohort;
    apsm_walk_options walk;
    size_t J;
    double *P;    /* I x J x 3 */
    bool *on_rim; /* J: of the template's rim */
    apsm_neighbourhoods reference;
    apsm_walk_report *report; /* I */
} pass;

static apsm_walk_options walk_options(const apsm_optimize_options *o, double h)
{
    apsm_walk_options w = o->walk;
    w.h = h;
    w.strict = false;
    return w;
}

/* Where the particles of shape i are on its mesh; P, unless it is fixed, moves there too. */
static apsm_status surface_points(const pass *p, size_t i, apsm_surface_point **S)
{
    *S = malloc(p->J * sizeof **S);
    if (!*S) return APSM_ERR_MEMORY;
    double *P = p->P + i * p->J * 3;
    apsm_shape_look_up(&p->cohort->shape[i], p->J, P, *S, cohort_moves(p->cohort, i) ? P : NULL,
                       NULL);
    return APSM_OK;
}

static apsm_status reference_neighbourhoods(pass *p)
{
    const size_t t = p->cohort->template_index;
    const apsm_shape *shape = &p->cohort->shape[t];
    apsm_surface_point *S = NULL;
    apsm_geodesic_work *w = NULL;
    apsm_status status = surface_points(p, t, &S);
    if (status == APSM_OK) status = apsm_geodesic_work_new(shape->geodesic, &w);
    if (status == APSM_OK)
        status = apsm_geodesic_neighbourhoods(shape->geodesic, w, p->J, S, p->P + t * p->J * 3,
                                              APSM_REFERENCE_FACTOR, &p->reference);
    apsm_geodesic_work_free(w);
    free(S);
    return status;
}

static apsm_status walk_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    pass *p = user;
    if (i == p->cohort->template_index || !cohort_moves(p->cohort, i)) return APSM_OK;
    const apsm_shape *shape = &p->cohort->shape[i];
    apsm_surface_point *S = NULL;
    apsm_geodesic_work *g = NULL;
    apsm_walk_work *w = NULL;
    apsm_status status = surface_points(p, i, &S);
    if (status == APSM_OK) status = apsm_geodesic_work_new(shape->geodesic, &g);
    if (status == APSM_OK) status = apsm_walk_work_new(p->J, &w);
    const apsm_walk_ground ground = { shape->geodesic, g, shape->bvh };
    if (status == APSM_OK)
        status = apsm_geodesic_correspondence(&ground, p->J, &p->reference, &p->walk, S,
                                              p->P + i * p->J * 3, w, &p->report[i]);
    if (status == APSM_OK)
        apsm_shape_keep_on_rim(shape, p->J, p->on_rim, p->P + i * p->J * 3, NULL);
    apsm_walk_work_free(w);
    apsm_geodesic_work_free(g);
    free(S);
    return status;
}

static geodesic_pass_result sum_up(const pass *p)
{
    geodesic_pass_result r = { 0 };
    const size_t movers = cohort_movers(p->cohort);
    for (size_t i = 0; i < p->cohort->I; i++) {
        if (i == p->cohort->template_index || !cohort_moves(p->cohort, i)) continue;
        const double share = (double)p->report[i].in_force / (double)p->J;
        r.mean += share / (double)movers;
        if (share > r.worst) r.worst = share;
        r.walked += (long)p->report[i].moved;
    }
    return r;
}

apsm_status geodesic_pass(apsm_context *ctx, const apsm_cohort *cohort,
                          const apsm_optimize_options *options, size_t J, double h, double *P,
                          geodesic_pass_result *result)
{
    pass p = { .cohort = cohort, .walk = walk_options(options, h), .J = J, .P = P };
    p.report = calloc(cohort->I, sizeof *p.report);
    p.on_rim = malloc(J * sizeof *p.on_rim);
    apsm_status status =
        p.report && p.on_rim ? apsm_neighbourhoods_resize(&p.reference, J) : APSM_ERR_MEMORY;
    if (status == APSM_OK)
        apsm_shape_find_on_rim(&cohort->shape[cohort->template_index], J,
                               P + cohort->template_index * J * 3, p.on_rim);
    if (status == APSM_OK) status = reference_neighbourhoods(&p);
    if (status == APSM_OK) status = apsm_own_for(ctx, cohort->I, NULL, walk_shape, &p, NULL);
    if (status == APSM_OK) status = apsm_gather(ctx, cohort->I, NULL, 3 * J * sizeof *P, P);
    if (status == APSM_OK) status = apsm_gather(ctx, cohort->I, NULL, sizeof *p.report, p.report);
    if (status == APSM_OK) *result = sum_up(&p);
    apsm_neighbourhoods_free(&p.reference);
    free(p.report);
    free(p.on_rim);
    return status;
}
