#include "judge/judge.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/deal.h"
#include "core/robust.h"
#include "geometry/affine.h"
#include "geometry/form.h"
#include "geometry/vec3.h"
#include "judge/coverage.h"
#include "judge/left_out.h"
#include "judge/slip.h"
#include "judge/twins.h"
#include "model/procrustes.h"
#include "optimize/correspondence_loss.h"

/* Cosine from which on a surface looks a given way, and below which another. */
static const double looks_the_same = 0.5, looks_away = -0.3;
/* The others agree on a normal if the median of theirs is longer. */
static const double agreed_on = 0.9;
/* A particle has only gone round an edge if what looks the usual way is no farther, in h. */
static const double round_edge = 0.6;

/* Arrays of all shapes, I x J x ... */
typedef struct judging {
    const apsm_cohort *cohort;
    size_t I, J;
    const double *P; /* x 3, world */
    double h;
    double *M;              /* I x 16: to the common pose and size */
    double *Q, *N;          /* x 3: particles and normals there */
    double *X, *XN;         /* x 3: what is usual in the others */
    double *height, *usual; /* x APSM_FORM_SCALES */
    double *spread;         /* x APSM_FORM_SCALES: median distance of the others from usual ones */
    double *distance;       /* x APSM_FORM_SCALES: scratch */
    apsm_patches patch[APSM_SLIP_LOOKS];
    double *slipped; /* x APSM_SLIP_LOOKS: (J3b), then (J3c) */
    double *usually; /* x APSM_SLIP_LOOKS */
    double *reach, *usual_reach;
    double *agreed; /* length of the median of the others' normals */
    apsm_departs departs;
    double *figure; /* FIGURES x I */
    apsm_judgement *out;
} judging;

enum { AREA, SIZE, LONG, FLAT, OFF, REACH, SLIP, FIGURES = SLIP + APSM_SLIP_LOOKS };
/* Of logarithms: nobody is called unusual for less than a few of these. */
static const double least_deviation[SLIP] = { 0.05, 0.025, 0.05, 0.05, 0.1, 0.1 };
/* Of how far the others have slipped, where they have slipped most. */
static const double worst_usual = 0.75;

/* ---- every shape for itself ---- */

static void take_normals(const judging *g, size_t i, apsm_surface_point *S, double *N)
{
    apsm_shape_look_up(&g->cohort->shape[i], g->J, g->P + 3 * g->J * i, S, NULL, N);
}

static void measure_size(const judging *g, size_t i)
{
    const double *q = g->P + 3 * g->J * i;
    double c[3] = { 0 }, C[9] = { 0 }, U[9], s[3], V[9];
    for (size_t k = 0; k < 3 * g->J; k++) c[k % 3] += q[k] / (double)g->J;
    for (size_t j = 0; j < g->J; j++)
        for (size_t a = 0; a < 9; a++)
            C[a] += (q[3 * j + a / 3] - c[a / 3]) * (q[3 * j + a % 3] - c[a % 3]);
    apsm_svd3(C, U, s, V);
    g->figure[AREA * g->I + i] = log(apsm_mesh_area(&g->cohort->shape[i].mesh));
    g->figure[SIZE * g->I + i] = 0.5 * log(s[0] + s[1] + s[2]);
    g->figure[LONG * g->I + i] = 0.5 * log(s[0] / s[1]);
    g->figure[FLAT * g->I + i] = 0.5 * log(s[1] / fmax(s[2], 1e-12 * s[1]));
}

static apsm_status look_at_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    judging *g = user;
    const apsm_mesh *mesh = &g->cohort->shape[i].mesh;
    const size_t J = g->J;
    const double *P = g->P + 3 * J * i, h = apsm_spacing(J, P, g->out->N6, NULL);
    double *N = g->N + 3 * J * i, *reach = g->reach + J * i;
    apsm_surface_point *S = malloc(J * sizeof *S);
    double *faces = malloc((apsm_form_size(mesh->nf) + 1) * sizeof *faces);
    double *work = malloc((4 * J + mesh->nv + 1) * sizeof *work);
    uint32_t *nearest = malloc((mesh->nv + 1) * sizeof *nearest);
    const bool ok = S && faces && work && nearest;
    if (ok) {
        take_normals(g, i, S, N);
        apsm_form_faces(mesh, faces);
        apsm_form_heights(mesh->nf, faces, J, P, N, h, g->height + APSM_FORM_SCALES * J * i);
        apsm_coverage_reach(mesh, J, P, work, nearest, reach);
        for (size_t j = 0; j < J; j++) reach[j] /= h;
        apsm_affine_apply_normals(g->M + 16 * i, J, N, N);
        measure_size(g, i);
    }
    free(S);
    free(faces);
    free(work);
    free(nearest);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

/* ---- against the others ---- */

static size_t at_look(const judging *g, size_t i, size_t k)
{
    return (APSM_SLIP_LOOKS * i + k) * g->J;
}

/* Where the others say that the particles of shape i are: r is what they do not explain, and
 * becomes that. */
static apsm_status say_where(const judging *g, size_t i, double *r)
{
    double back[16];
    for (size_t k = 0; k < 3 * g->J; k++) r[k] = g->Q[3 * g->J * i + k] - r[k];
    APSM_TRY(apsm_affine_invert(g->M + 16 * i, back));
    apsm_affine_apply(back, g->J, r, r);
    return APSM_OK;
}

static apsm_status predict_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    judging *g = user;
    const size_t J = g->J;
    const size_t slip = apsm_slip_work_size(J), depart = apsm_depart_work_size(&g->departs);
    const size_t size = slip > depart ? slip : depart;
    double *work = malloc((3 * J + size) * sizeof *work), sum = 0.0;
    if (!work) return APSM_ERR_MEMORY;
    double *r = work + size;
    apsm_status status = apsm_left_out_residual(g->I, J, g->Q, i, r, work);
    for (size_t k = 0; k < 3 * J && status == APSM_OK; k++) sum += r[k] * r[k];
    g->figure[OFF * g->I + i] = 0.5 * log(sum / (double)J / (g->h * g->h) + 1e-12);
    const apsm_slip_cohort all = { g->I, J, g->Q, g->h, g->patch };
    apsm_slip_look(&all, i, g->N + 3 * J * i, g->slipped + at_look(g, i, 0), work);
    if (status == APSM_OK) status = say_where(g, i, r);
    if (status == APSM_OK)
        apsm_depart_look(&g->departs, i, &g->cohort->shape[i], g->P + 3 * J * i, r,
                         g->h / cbrt(apsm_affine_det(g->M + 16 * i)), work);
    free(work);
    return status;
}

/* How often the usual shape i has slipped in the worst place, by every look.  scratch: 2 J. */
static void find_slips(const judging *g, size_t i, double *scratch)
{
    for (size_t k = 0; k < APSM_SLIP_LOOKS; k++) {
        const size_t at = at_look(g, i, k);
        double *times = scratch + g->J, most = 1e-3;
        apsm_slip_times(&g->patch[k], g->slipped + at, g->usually + at, times, scratch);
        for (size_t j = 0; j < g->J; j++) most = fmax(most, times[j]);
        g->figure[(SLIP + k) * g->I + i] = log(most);
    }
}

/* Where and how far, by the look in which it stands out the most from the others.  more: by how
 * much, a row a look.  scratch: J. */
static void take_slip(const judging *g, size_t i, const double *more, double *scratch)
{
    apsm_findings *f = &g->out->shape[i];
    double *times = g->out->slip + g->J * i;
    size_t look = 0;
    if (g->out->looks == 0) return;
    for (size_t k = 1; k < g->out->looks; k++)
        if (more[k * g->I + i] > more[look * g->I + i]) look = k;
    const size_t at = at_look(g, i, look);
    apsm_slip_times(&g->patch[look], g->slipped + at, g->usually + at, times, scratch);
    for (size_t j = 0; j < g->J; j++)
        if (times[j] > times[f->slip_at]) f->slip_at = (uint32_t)j;
    f->slip = exp(more[look * g->I + i]);
    f->slip_size = g->slipped[at + f->slip_at] - g->usually[at + f->slip_at];
}

static void find_reach(judging *g, size_t i)
{
    const size_t J = g->J;
    apsm_findings *f = &g->out->shape[i];
    double most = -INFINITY;
    for (size_t j = 0; j < J; j++) {
        const double d = g->reach[J * i + j] - g->usual_reach[J * i + j];
        g->out->uncovered[J * i + j] = d;
        f->farthest = fmax(f->farthest, g->reach[J * i + j]);
        if (!(d > most)) continue;
        most = d;
        f->reach_at = (uint32_t)j;
    }
    f->reach = most;
    g->figure[REACH * g->I + i] = log(fmax(most, 0.05));
}

static void take_departures(judging *g)
{
    for (size_t k = 0; k < APSM_DEPART_LOOKS && g->departs.n > 0; k++) {
        apsm_depart_compare(&g->departs, k, g->out->departs);
        for (size_t i = 0; i < g->I; i++) g->out->shape[i].part[k] = g->departs.found[i];
    }
}

/* Whether no place near along the surface looks the way `usual` (common frame), from
 * where particle j is: else it has only gone round an edge. */
static apsm_status is_beyond_edges(const judging *g, size_t i, size_t j, const double usual[3],
                                   apsm_geodesic_work *w, bool *beyond)
{
    const apsm_shape *shape = &g->cohort->shape[i];
    const double *p = g->P + 3 * (g->J * i + j);
    const double reach = round_edge * g->h / cbrt(apsm_affine_det(g->M + 16 * i));
    apsm_surface_point at;
    apsm_shape_look_up(shape, 1, p, &at, NULL, NULL);
    APSM_TRY(apsm_geodesic_from(shape->geodesic, &at, reach, w));
    *beyond = true;
    for (uint32_t v = 0; v < shape->mesh.nv && *beyond; v++) {
        double n[3];
        if (!(vec3_distance2(shape->mesh.V + 3 * v, p) < reach * reach)) continue;
        if (!(apsm_geodesic_vertex_distance(w, v) <= reach)) continue;
        apsm_affine_apply_normals(g->M + 16 * i, 1, shape->VN + 3 * v, n);
        *beyond = vec3_dot(n, usual) < looks_the_same;
    }
    return APSM_OK;
}

/* A particle that has gone through a sheet looks the other way: against the usual normal, where the
 * normals of the others agree. */
static apsm_status find_opposed(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    judging *g = user;
    apsm_findings *f = &g->out->shape[i];
    apsm_geodesic_work *w = NULL;
    apsm_status status = APSM_OK;
    for (size_t j = 0; j < g->J && status == APSM_OK; j++) {
        const size_t k = g->J * i + j;
        const double *usual = g->XN + 3 * k;
        if (!(g->agreed[k] > agreed_on && vec3_dot(g->N + 3 * k, usual) < looks_away)) continue;
        if (!w) status = apsm_geodesic_work_new(g->cohort->shape[i].geodesic, &w);
        if (status == APSM_OK) status = is_beyond_edges(g, i, j, usual, w, &g->out->opposed[k]);
        f->opposed += g->out->opposed[k];
    }
    apsm_geodesic_work_free(w);
    return status;
}

static apsm_status turn_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    judging *g = user;
    const size_t J = g->J, at3 = 3 * J * i, atS = APSM_FORM_SCALES * J * i;
    apsm_findings *f = &g->out->shape[i];
    double *work = malloc(apsm_turns_work_size(J) * sizeof *work);
    uint32_t *at = malloc(J * sizeof *at);
    if (work && at) {
        const apsm_turns_input in = { J,
                                      g->h,
                                      g->Q + at3,
                                      g->N + at3,
                                      g->X + at3,
                                      g->XN + at3,
                                      g->height + atS,
                                      g->usual + atS,
                                      g->spread + atS };
        f->agreement = apsm_form_agreement(J, in.own, in.usual, NULL);
        apsm_turns_search(&in, false, &f->turn[0], &f->fit, work, at);
        apsm_turns_search(&in, true, &f->turn[1], NULL, work, at);
    }
    const bool ok = work && at;
    free(work);
    free(at);
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status weigh_figures(judging *g)
{
    const size_t I = g->I;
    double *excess = malloc((2 * FIGURES + 1) * I * sizeof *excess);
    if (!excess) return APSM_ERR_MEMORY;
    double *middle = excess + FIGURES * I, *scratch = middle + FIGURES * I;
    for (size_t k = 0; k < SLIP; k++)
        robust_excesses(I, g->figure + k * I, least_deviation[k], excess + k * I, middle + k * I,
                        scratch);
    for (size_t i = 0; i < I; i++) {
        apsm_findings *f = &g->out->shape[i];
        f->area = exp(g->figure[AREA * I + i] - middle[AREA * I + i]);
        f->size = exp(g->figure[SIZE * I + i] - middle[SIZE * I + i]);
        f->off = exp(g->figure[OFF * I + i] - middle[OFF * I + i]);
        f->area_excess = excess[AREA * I + i];
        f->size_excess = excess[SIZE * I + i];
        f->long_excess = excess[LONG * I + i];
        f->flat_excess = excess[FLAT * I + i];
        f->off_excess = excess[OFF * I + i];
        f->reach_excess = excess[REACH * I + i];
    }
    double *more = middle + SLIP * I;
    for (size_t k = 0; k < APSM_SLIP_LOOKS; k++)
        robust_left_out_quantiles(I, g->figure + (SLIP + k) * I, worst_usual, more + k * I,
                                  scratch);
    for (size_t k = 0; k < APSM_SLIP_LOOKS * I; k++) more[k] = g->figure[SLIP * I + k] - more[k];
    for (size_t i = 0; i < I; i++) take_slip(g, i, more, g->distance);
    free(excess);
    return APSM_OK;
}

/* Row k of the figures, of which each shape has one. */
static apsm_made made_figure(const judging *g, size_t k)
{
    return (apsm_made){ g->figure + k * g->I, sizeof *g->figure };
}

static apsm_status look_at_all(apsm_context *ctx, judging *g)
{
    const size_t bytes = g->J * sizeof(double);
    apsm_shared_loop loop = { .kind = "look",
                              .n = g->I,
                              .fn = look_at_shape,
                              .user = g,
                              .decides = true,
                              .made = { { g->N, 3 * bytes },
                                        { g->height, APSM_FORM_SCALES * bytes },
                                        { g->reach, bytes } } };
    for (size_t k = AREA; k <= FLAT; k++) loop.made[3 + k] = made_figure(g, k);
    return apsm_shared_for(ctx, &loop);
}

static apsm_status predict_all(apsm_context *ctx, judging *g)
{
    apsm_shared_loop loop = { .kind = "predict",
                              .n = g->I,
                              .fn = predict_shape,
                              .user = g,
                              .decides = true,
                              .made = { { g->slipped, APSM_SLIP_LOOKS * g->J * sizeof *g->slipped },
                                        made_figure(g, OFF) } };
    for (size_t k = 0; k < APSM_DEPART_LOOKS && g->departs.n > 0; k++)
        loop.made[2 + k] =
            (apsm_made){ g->departs.distance[k], g->departs.n * sizeof *g->departs.distance[k] };
    return apsm_shared_for(ctx, &loop);
}

/* What every shape is seen to be beside the others. */
static apsm_status compare_all(apsm_context *ctx, judging *g)
{
    const apsm_made findings = { g->out->shape, sizeof *g->out->shape };
    const apsm_shared_loop opposed = {
        .kind = "opposed",
        .n = g->I,
        .fn = find_opposed,
        .user = g,
        .made = { { g->out->opposed, g->J * sizeof *g->out->opposed }, findings }
    };
    const apsm_shared_loop turns = { .kind = "turn",
                                     .n = g->I,
                                     .fn = turn_shape,
                                     .user = g,
                                     .stage = "judge",
                                     .made = { findings } };
    APSM_TRY(apsm_shared_for(ctx, &opposed));
    return apsm_shared_for(ctx, &turns);
}

/* spread <- 1.4826 times the median of the others' distance from what is usual. */
static void find_spread(judging *g, double *column)
{
    const size_t n = APSM_FORM_SCALES * g->J;
    double *distance = g->distance;
    for (size_t k = 0; k < g->I * n; k++) distance[k] = fabs(g->height[k] - g->usual[k]);
    robust_left_out_medians(g->I, n, distance, g->spread, column);
    for (size_t k = 0; k < g->I * n; k++) g->spread[k] *= 1.4826;
}

static apsm_status make_patches(judging *g)
{
    const size_t first = 3 * g->J * g->cohort->template_index;
    for (size_t k = 0; k < APSM_SLIP_LOOKS; k++)
        APSM_TRY(apsm_patches_make(k, g->J, g->Q + first, g->N + first, g->h, &g->patch[k]));
    return APSM_OK;
}

static apsm_status compare(apsm_context *ctx, judging *g, double *column)
{
    const size_t I = g->I, J = g->J;
    APSM_TRY(look_at_all(ctx, g));
    robust_left_out_medians(I, 3 * J, g->Q, g->X, column);
    robust_left_out_medians(I, 3 * J, g->N, g->XN, column);
    for (size_t k = 0; k < I * J; k++) g->agreed[k] = vec3_normalise(g->XN + 3 * k);
    robust_left_out_medians(I, APSM_FORM_SCALES * J, g->height, g->usual, column);
    find_spread(g, column);
    robust_left_out_medians(I, J, g->reach, g->usual_reach, column);
    APSM_TRY(make_patches(g));
    APSM_TRY(apsm_departs_make(ctx, g->cohort, J, g->P, &g->departs));
    APSM_TRY(predict_all(ctx, g));
    robust_left_out_medians(I, APSM_SLIP_LOOKS * J, g->slipped, g->usually, column);
    for (size_t i = 0; i < I; i++) {
        find_slips(g, i, g->distance);
        find_reach(g, i);
    }
    APSM_TRY(compare_all(ctx, g));
    take_departures(g);
    APSM_TRY(apsm_twins_find(ctx, I, J, g->Q, g->X, g->figure + AREA * I, g->out->twin, column));
    return weigh_figures(g);
}

static apsm_status pose(apsm_context *ctx, judging *g)
{
    apsm_procrustes_options options = apsm_procrustes_defaults();
    const double *T = g->P + 3 * g->J * g->cohort->template_index;
    options.scale = true;
    options.reference = g->cohort->template_index;
    APSM_TRY(apsm_neighbours6(g->J, T, g->out->N6));
    APSM_TRY(apsm_procrustes(ctx, g->I, g->J, g->P, &options, g->M, g->Q));
    g->h = apsm_spacing(g->J, g->Q + 3 * g->J * g->cohort->template_index, g->out->N6, NULL);
    return APSM_OK;
}

apsm_status apsm_judge(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                       apsm_judgement *out)
{
    const size_t I = cohort->I, n = I * J;
    const size_t doubles =
        n * (3 * 4 + 4 * APSM_FORM_SCALES + 3 + 2 * APSM_SLIP_LOOKS) + I * (16 + FIGURES + 1);
    *out = (apsm_judgement){ .I = I, .J = J, .looks = apsm_slip_looks(I, J) };
    out->shape = calloc(I, sizeof *out->shape);
    out->slip = calloc(n, sizeof *out->slip);
    out->uncovered = malloc(n * sizeof *out->uncovered);
    out->departs = calloc(n, sizeof *out->departs);
    out->opposed = calloc(n, sizeof *out->opposed);
    out->twin = calloc(I, sizeof *out->twin);
    out->N6 = malloc(J * APSM_NEIGHBOURS * sizeof *out->N6);
    double *all = malloc(doubles * sizeof *all);
    judging g = { .cohort = cohort, .I = I, .J = J, .P = P, .out = out };
    apsm_status status = APSM_ERR_MEMORY;
    if (out->shape && out->slip && out->uncovered && out->departs && out->opposed && out->twin &&
        all && out->N6) {
        g.Q = all;
        g.N = g.Q + 3 * n;
        g.X = g.N + 3 * n;
        g.XN = g.X + 3 * n;
        g.height = g.XN + 3 * n;
        g.usual = g.height + APSM_FORM_SCALES * n;
        g.spread = g.usual + APSM_FORM_SCALES * n;
        g.distance = g.spread + APSM_FORM_SCALES * n;
        g.slipped = g.distance + APSM_FORM_SCALES * n;
        g.usually = g.slipped + APSM_SLIP_LOOKS * n;
        g.reach = g.usually + APSM_SLIP_LOOKS * n;
        g.usual_reach = g.reach + n;
        g.agreed = g.usual_reach + n;
        g.M = g.agreed + n;
        g.figure = g.M + 16 * I;
        status = pose(ctx, &g);
        if (status == APSM_OK) status = compare(ctx, &g, g.figure + FIGURES * I);
        out->h = g.h;
    }
    for (size_t k = 0; k < APSM_SLIP_LOOKS; k++) apsm_patches_free(&g.patch[k]);
    apsm_departs_free(&g.departs);
    free(all);
    if (status != APSM_OK) apsm_judgement_free(out);
    return status;
}

void apsm_judgement_around(const apsm_judgement *g, size_t i, uint32_t at, bool *in,
                           uint32_t *queue)
{
    const double *departs = g->departs + i * g->J;
    size_t n = 1;
    memset(in, 0, g->J * sizeof *in);
    in[at] = true;
    queue[0] = at;
    for (size_t k = 0; k < n; k++) {
        const uint32_t *near = g->N6 + APSM_NEIGHBOURS * (size_t)queue[k];
        for (size_t l = 0; l < APSM_NEIGHBOURS; l++) {
            if (in[near[l]] || departs[near[l]] < 0.5 * departs[at]) continue;
            in[near[l]] = true;
            queue[n++] = near[l];
        }
    }
}

void apsm_judgement_free(apsm_judgement *judgement)
{
    free(judgement->shape);
    free(judgement->slip);
    free(judgement->uncovered);
    free(judgement->departs);
    free(judgement->opposed);
    free(judgement->N6);
    free(judgement->twin);
    *judgement = (apsm_judgement){ 0 };
}
