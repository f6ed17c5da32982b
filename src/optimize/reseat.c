/* Adaptivity by warp error.  The template's mesh, warped to a shape by its particles, misses the
 * surface by e(x) on the mean over the shapes.  With particles of density rho an interpolant of
 * second order errs by about K(x) / rho(x), and the sum of errors for a given number of particles
 * is least if rho is proportional to sqrt(K) = sqrt(e rho).  Centroids of cells weighted by g
 * settle at a density of sqrt(g) in the plane (Du, Faber & Gunzburger, SIAM Review 41, 1999): so
 *
 *   g = (1 - c) + c e rho / mean(e rho)
 *
 * in Lloyd's iteration on the template.  What is carried to the other shapes by the warp keeps the
 * correspondence of the surfaces: only where it is sampled changes. */
#include "optimize/reseat.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"
#include "model/warp.h"
#include "optimize/fidelity_shape.h"

enum { MOST_SHAPES = 64, SWEEPS = 40 };
static const double most_contrast = 8; /* of g against its mean */

typedef struct seating {
    const apsm_cohort *cohort;
    const apsm_shape *t; /* the template */
    size_t J, J2, nv;
    const double *P; /* I x J x 3 */
    const bool *judged;
    size_t shapes, *shape; /* those that take part */
    double h;              /* spacing that J particles would have if evenly spread */
    double *area;          /* nv: a third of the faces around */
    double *weight;        /* nv: g */
    uint32_t *cell;        /* nv: particle closest to a vertex */
    double *T, *N;         /* J2 x 3: the template's particles, their normals */
    double *error;         /* shapes x J: area times distance, summed over a particle's cell */
    double *size, *need;   /* J: area of a cell; K there */
    double *gather;        /* J2 x 4 */
    double *Y;             /* threads x nv x 3 */
    apsm_warp warp;        /* of the template's vertices */
    apsm_warp carry;       /* of its new particles */
    double *Q;             /* I x J2 x 3 */
} seating;

static void seating_free(seating *s)
{
    free(s->shape);
    free(s->area);
    free(s->weight);
    free(s->cell);
    free(s->T);
    free(s->N);
    free(s->error);
    free(s->size);
    free(s->need);
    free(s->gather);
    free(s->Y);
    apsm_warp_free(&s->warp);
    apsm_warp_free(&s->carry);
}

static apsm_status seating_alloc(apsm_context *ctx, seating *s)
{
    const size_t nv = s->nv;
    s->area = calloc(nv, sizeof *s->area);
    s->weight = malloc(nv * sizeof *s->weight);
    s->cell = malloc(nv * sizeof *s->cell);
    s->T = malloc(3 * s->J2 * sizeof *s->T);
    s->N = malloc(3 * s->J2 * sizeof *s->N);
    s->error = calloc(s->shapes * s->J, sizeof *s->error);
    s->size = malloc(s->J * sizeof *s->size);
    s->need = malloc(s->J * sizeof *s->need);
    s->gather = malloc(4 * s->J2 * sizeof *s->gather);
    s->Y = malloc((size_t)apsm_context_threads(ctx) * 3 * nv * sizeof *s->Y);
    const bool ok = s->area && s->weight && s->cell && s->T && s->N && s->error && s->size &&
                    s->need && s->gather && s->Y;
    return ok ? APSM_OK : APSM_ERR_MEMORY;
}

/* ---- cells on the template ---- */

static void measure_areas(seating *s)
{
    const apsm_mesh *m = &s->t->mesh;
    for (size_t f = 0; f < m->nf; f++) {
        const uint32_t *v = m->F + 3 * f;
        double a[3], b[3], n[3];
        vec3_sub(m->V + 3 * (size_t)v[1], m->V + 3 * (size_t)v[0], a);
        vec3_sub(m->V + 3 * (size_t)v[2], m->V + 3 * (size_t)v[0], b);
        vec3_cross(a, b, n);
        for (size_t k = 0; k < 3; k++) s->area[v[k]] += vec3_norm(n) / 6;
    }
}

/* Of J particles P with normals N the one closest to x: on the side of a thin sheet that n says, or
 * at all if none is there. */
static uint32_t closest_particle(size_t J, const double *P, const double *N, const double x[3],
                                 const double n[3])
{
    double best[2] = { INFINITY, INFINITY };
    uint32_t which[2] = { 0, 0 };
    for (size_t j = 0; j < J; j++) {
        const double d2 = vec3_distance2(x, P + 3 * j);
        const int side = vec3_dot(n, N + 3 * j) > 0;
        if (d2 < best[side]) best[side] = d2, which[side] = (uint32_t)j;
    }
    return which[isfinite(best[1])];
}

/* Cells of the first J particles of s->T. */
static void find_cells(seating *s, size_t J)
{
    for (size_t v = 0; v < s->nv; v++)
        s->cell[v] = closest_particle(J, s->T, s->N, s->t->mesh.V + 3 * v, s->t->VN + 3 * v);
}

static void look_up_normal(seating *s, size_t j)
{
    apsm_surface_point on;
    apsm_shape_look_up(s->t, 1, s->T + 3 * j, &on, NULL, s->N + 3 * j);
}

/* ---- the error of the warp ---- */

static apsm_status error_of_shape(apsm_context *ctx, size_t k, int worker, void *user)
{
    (void)ctx;
    seating *s = user;
    const size_t i = s->shape[k];
    double *Y = s->Y + (size_t)worker * 3 * s->nv;
    apsm_warp_apply(&s->warp, s->P + i * s->J * 3, Y);
    for (size_t v = 0; v < s->nv; v++) {
        apsm_closest c;
        apsm_bvh_closest(s->cohort->shape[i].bvh, Y + 3 * v, INFINITY, &c);
        s->error[k * s->J + s->cell[v]] += s->area[v] * sqrt(c.distance2);
    }
    return APSM_OK;
}

/* K of every cell: mean error times density. */
static void find_needs(seating *s)
{
    memset(s->size, 0, s->J * sizeof *s->size);
    for (size_t v = 0; v < s->nv; v++) s->size[s->cell[v]] += s->area[v];
    for (size_t j = 0; j < s->J; j++) {
        double sum = 0;
        for (size_t k = 0; k < s->shapes; k++) sum += s->error[k * s->J + j];
        s->need[j] = s->size[j] > 0 ? sum / s->size[j] / s->size[j] : 0;
    }
}

/* g at the vertices: the cells' K, smoothed over a spacing and mixed with an even density. */
static void find_weights(seating *s, double adaptivity)
{
    double mean = 0, area = 0;
    for (size_t v = 0; v < s->nv; v++) {
        const double *x = s->t->mesh.V + 3 * v;
        double sum = 0, norm = 0;
        for (size_t j = 0; j < s->J; j++) {
            const double g = exp(-vec3_distance2(x, s->T + 3 * j) / (s->h * s->h));
            sum += g * s->need[j];
            norm += g;
        }
        s->weight[v] = norm > 0 ? sum / norm : s->need[s->cell[v]];
        mean += s->area[v] * s->weight[v];
        area += s->area[v];
    }
    mean /= area;
    for (size_t v = 0; v < s->nv; v++) {
        const double g = mean > 0 ? s->weight[v] / mean : 1;
        const double bounded = fmin(fmax(g, 1 / most_contrast), most_contrast);
        s->weight[v] = 1 - adaptivity + adaptivity * bounded;
    }
}

/* ---- the template's new particles ---- */

/* Particles J .. J2 - 1, one after the other where g times the squared distance to all is largest.
 */
static void add_particles(seating *s)
{
    for (size_t j = s->J; j < s->J2; j++) {
        double most = -1;
        size_t where = 0;
        find_cells(s, j);
        for (size_t v = 0; v < s->nv; v++) {
            const double *x = s->t->mesh.V + 3 * v;
            const double want = s->weight[v] * vec3_distance2(x, s->T + 3 * (size_t)s->cell[v]);
            if (want > most) most = want, where = v;
        }
        memcpy(s->T + 3 * j, s->t->mesh.V + 3 * where, 3 * sizeof *s->T);
        memcpy(s->N + 3 * j, s->t->VN + 3 * where, 3 * sizeof *s->N);
    }
}

/* One step of Lloyd's iteration: every particle goes to the centroid of its cell. */
static void sweep(seating *s)
{
    const double *V = s->t->mesh.V;
    find_cells(s, s->J2);
    memset(s->gather, 0, 4 * s->J2 * sizeof *s->gather);
    for (size_t v = 0; v < s->nv; v++) {
        const double g = s->weight[v] * s->area[v];
        double *sum = s->gather + 4 * (size_t)s->cell[v];
        vec3_add_scaled(sum, g, V + 3 * v);
        sum[3] += g;
    }
    for (size_t j = 0; j < s->J2; j++) {
        const double *sum = s->gather + 4 * j;
        apsm_closest c;
        if (!(sum[3] > 0)) continue;
        const double x[3] = { sum[0] / sum[3], sum[1] / sum[3], sum[2] / sum[3] };
        apsm_bvh_closest_facing(s->t->bvh, x, s->N + 3 * j, 0, INFINITY, &c);
        if (!isfinite(c.distance2)) continue;
        memcpy(s->T + 3 * j, c.x, sizeof c.x);
        apsm_surface_normal(&s->t->mesh, s->t->VN, &c.on, s->N + 3 * j);
    }
}

/* ---- the other shapes follow ---- */

typedef struct carriage {
    const seating *s;
    const size_t *old; /* J2: the template's old particle that is closest to a new one */
} carriage;

static apsm_status carry_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)ctx, (void)worker;
    const carriage *c = user;
    const seating *s = c->s;
    const apsm_shape *shape = &s->cohort->shape[i];
    double *Q = s->Q + i * s->J2 * 3;
    if (i == s->cohort->template_index) {
        memcpy(Q, s->T, 3 * s->J2 * sizeof *Q);
        return APSM_OK;
    }
    apsm_warp_apply(&s->carry, s->P + i * s->J * 3, Q);
    for (size_t j = 0; j < s->J2; j++) {
        apsm_surface_point on;
        double n[3];
        apsm_shape_look_up(shape, 1, s->P + (i * s->J + c->old[j]) * 3, &on, NULL, n);
        fidelity_land(shape, false, n, Q + 3 * j, &on);
    }
    return APSM_OK;
}

static apsm_status carry_all(apsm_context *ctx, seating *s)
{
    const double *P = s->P + s->cohort->template_index * s->J * 3;
    size_t *old = malloc(s->J2 * sizeof *old);
    double *N = malloc(3 * s->J * sizeof *N);
    apsm_surface_point *S = malloc(s->J * sizeof *S);
    apsm_status status = old && N && S ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) {
        apsm_shape_look_up(s->t, s->J, P, S, NULL, N);
        for (size_t j = 0; j < s->J2; j++)
            old[j] = closest_particle(s->J, P, N, s->T + 3 * j, s->N + 3 * j);
        status = apsm_warp_build(ctx, APSM_PHI_R, s->J2, s->T, s->J, P, &s->carry);
    }
    carriage c = { s, old };
    if (status == APSM_OK) status = apsm_parallel_for(ctx, s->cohort->I, carry_shape, &c, NULL);
    free(old);
    free(N);
    free(S);
    return status;
}

/* ---- all of it ---- */

static apsm_status choose_shapes(seating *s)
{
    const size_t I = s->cohort->I, stride = (I + MOST_SHAPES - 1) / MOST_SHAPES;
    s->shape = malloc(I * sizeof *s->shape);
    if (!s->shape) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < I; i += stride)
        if (i != s->cohort->template_index && !(s->judged && s->judged[i]))
            s->shape[s->shapes++] = i;
    return APSM_OK;
}

static apsm_status reseat(apsm_context *ctx, double adaptivity, seating *s)
{
    APSM_TRY(choose_shapes(s));
    APSM_TRY(seating_alloc(ctx, s));
    const double *P = s->P + s->cohort->template_index * s->J * 3;
    memcpy(s->T, P, 3 * s->J * sizeof *s->T);
    for (size_t j = 0; j < s->J; j++) look_up_normal(s, j);
    s->h = apsm_expected_spacing(apsm_mesh_area(&s->t->mesh), s->J);
    measure_areas(s);
    find_cells(s, s->J);
    APSM_TRY(apsm_warp_build(ctx, APSM_PHI_R, s->nv, s->t->mesh.V, s->J, P, &s->warp));
    APSM_TRY(apsm_parallel_for(ctx, s->shapes, error_of_shape, s, NULL));
    find_needs(s);
    find_weights(s, adaptivity);
    add_particles(s);
    for (int k = 0; k < SWEEPS; k++) sweep(s);
    return carry_all(ctx, s);
}

apsm_status apsm_reseat(apsm_context *ctx, const apsm_cohort *cohort, size_t J, const double *P,
                        const bool *judged, double adaptivity, size_t J2, double *Q)
{
    const apsm_shape *t = &cohort->shape[cohort->template_index];
    seating s = { .cohort = cohort,
                  .t = t,
                  .J = J,
                  .J2 = J2,
                  .nv = t->mesh.nv,
                  .P = P,
                  .judged = judged,
                  .Q = Q };
    if (J2 < J || J2 > t->mesh.nv)
        return apsm_fail(
            ctx, APSM_ERR_ARG,
            "%zu particles from %zu: more than the template's mesh has vertices (%zu); "
            "use more faces",
            J2, J, t->mesh.nv);
    const apsm_status status = reseat(ctx, adaptivity, &s);
    seating_free(&s);
    return status;
}
