/* Pose and shape from a part of a surface.  In every round each point u takes the closest point y
 * of the template warped to mean + U b, and a weight
 *
 *   w = (1 - d^2/r^2)^2 of its distance d (Tukey's), 0 beyond r and where normals disagree    (46)
 *
 * and what it says is n.(y(b) - u) ~ N(0, sigma^2 / w), n the normal there: with the pose as six
 * modes more the step is the posterior (42).  y is a row of the warp, so linear in b.  Points close
 * together say the same, so that all of them count as much as there would be particles on their
 * area.  The reach r falls round by round. */
#include "fit/part.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/rigid.h"
#include "geometry/affine.h"
#include "geometry/vec3.h"
#include "linalg/linalg.h"
#include "optimize/fidelity_shape.h"

enum { POINTS = 400 };
static const double last_reach = 0.35, sigma = 0.1; /* h */
static const double least_cosine = 0.3;

/* ---- points ---- */

apsm_status part_points_of_mesh(const apsm_mesh *mesh, part_points *p)
{
    apsm_cloud cloud;
    *p = (part_points){ .area = apsm_mesh_area(mesh) };
    APSM_TRY(apsm_cloud_sample(mesh, POINTS, 0, 0, &cloud));
    p->n = cloud.n;
    p->x = cloud.x; /* taken over */
    p->normal = cloud.normal;
    cloud.x = cloud.normal = NULL;
    apsm_cloud_free(&cloud);
    return APSM_OK;
}

/* At most POINTS, each the farthest from those before, from the one farthest from the centre on. */
apsm_status part_points_of_cloud(size_t n, const double *x, part_points *p)
{
    double c[3] = { 0 };
    const size_t wanted = n < POINTS ? n : POINTS;
    *p = (part_points){ .x = malloc(3 * wanted * sizeof *p->x) };
    double *far = malloc(n * sizeof *far);
    if (!p->x || !far) {
        free(far);
        part_points_free(p);
        return APSM_ERR_MEMORY;
    }
    for (size_t k = 0; k < n; k++) vec3_add_scaled(c, 1 / (double)n, x + 3 * k);
    for (size_t k = 0; k < n; k++) far[k] = vec3_distance2(x + 3 * k, c);
    for (; p->n < wanted; p->n++) {
        size_t best = 0;
        for (size_t k = 1; k < n; k++)
            if (far[k] > far[best]) best = k;
        if (p->n > 0 && !(far[best] > 0)) break; /* the others are there already */
        memcpy(p->x + 3 * p->n, x + 3 * best, 3 * sizeof *x);
        for (size_t k = 0; k < n; k++) {
            const double d2 = vec3_distance2(x + 3 * k, x + 3 * best);
            if (p->n == 0 || d2 < far[k]) far[k] = d2;
        }
    }
    free(far);
    return APSM_OK;
}

void part_points_free(part_points *p)
{
    free(p->x);
    free(p->normal);
    *p = (part_points){ 0 };
}

/* ---- scratch ---- */

static size_t modes_of(const apsm_fit_model *m)
{
    return m->posterior.M + FIT_RIGID;
}

apsm_status part_work_alloc(const apsm_fit_model *m, size_t n, part_work *w)
{
    const apsm_mesh *mesh = &m->cohort.shape[0].mesh;
    const size_t D = m->posterior.D, K = modes_of(m);
    const posterior_model most = { .D = D, .M = K };
    *w = (part_work){ 0 };
    w->P = malloc(D * sizeof *w->P);
    w->normal = malloc(3 * mesh->nv * sizeof *w->normal);
    w->x = malloc(3 * n * sizeof *w->x);
    w->A = malloc(n * D * sizeof *w->A);
    w->G = malloc(n * K * sizeof *w->G);
    w->e = malloc(n * sizeof *w->e);
    w->w = malloc(n * sizeof *w->w);
    w->H = malloc(K * K * sizeof *w->H);
    w->g = malloc(K * sizeof *w->g);
    w->store = malloc(fit_rigid_size(&most) * sizeof *w->store);
    if (!w->P || !w->normal || !w->x || !w->A || !w->G || !w->e || !w->w || !w->H || !w->g ||
        !w->store)
        return APSM_ERR_MEMORY;
    APSM_TRY(apsm_mesh_copy(mesh, &w->warped));
    return apsm_bvh_build_unsigned(&w->warped, &w->bvh);
}

void part_work_free(part_work *w)
{
    apsm_bvh_free(w->bvh);
    apsm_mesh_free(&w->warped);
    free(w->P);
    free(w->normal);
    free(w->x);
    free(w->A);
    free(w->G);
    free(w->e);
    free(w->w);
    free(w->H);
    free(w->g);
    free(w->store);
}

/* ---- a round ---- */

static void warp_to(const apsm_fit_model *m, const double *b, part_work *w)
{
    const posterior_model *q = &m->posterior;
    memcpy(w->P, q->mean, q->D * sizeof *w->P);
    for (size_t k = 0; k < q->M; k++)
        for (size_t d = 0; d < q->D; d++) w->P[d] += b[k] * q->mode[k * q->D + d];
    apsm_warp_apply(&m->fidelity->warp, w->P, w->warped.V);
    apsm_bvh_refit(w->bvh);
    apsm_mesh_vertex_normals(&w->warped, w->normal);
}

/* Row k: n' times the warp's row at the closest point. */
static void make_row(const apsm_fit_model *m, const part_work *w, const apsm_surface_point *on,
                     const double n[3], double *row)
{
    const apsm_warp *warp = &m->fidelity->warp;
    const uint32_t *corner = w->warped.F + 3 * (size_t)on->face;
    const double *A = warp->W + corner[0] * warp->J, *B = warp->W + corner[1] * warp->J,
                 *C = warp->W + corner[2] * warp->J;
    for (size_t j = 0; j < warp->J; j++) {
        const double part = on->weight[0] * A[j] + on->weight[1] * B[j] + on->weight[2] * C[j];
        for (size_t c = 0; c < 3; c++) row[3 * j + c] = part * n[c];
    }
}

/* Rows, residuals and weights (46) of all points; distances in h, less than reach. */
static void match_points(const apsm_fit_model *m, const part_points *p, const part_state *s,
                         double reach, part_work *w)
{
    apsm_affine_apply(s->M, p->n, p->x, w->x);
    for (size_t k = 0; k < p->n; k++) {
        const double *u = w->x + 3 * k;
        apsm_closest c;
        double n[3], d[3];
        apsm_bvh_closest(w->bvh, u, INFINITY, &c);
        apsm_surface_normal(&w->warped, w->normal, &c.on, n);
        vec3_sub(u, c.x, d);
        const double t = c.distance2 / (m->h * m->h * reach * reach);
        w->w[k] = t < 1 ? (1 - t) * (1 - t) : 0;
        w->e[k] = vec3_dot(n, d);
        if (p->normal && w->w[k] > 0) {
            double o[3];
            apsm_affine_apply_normals(s->M, 1, p->normal + 3 * k, o);
            if (vec3_dot(o, n) < least_cosine) w->w[k] = 0;
        }
        make_row(m, w, &c.on, n, w->A + k * m->posterior.D);
    }
}

/* How many independent points n stand for. */
static double independent(const apsm_fit_model *m, const part_points *p)
{
    const double cell = 0.866 * m->h * m->h;
    return p->area > 0 ? fmin((double)p->n, fmax(p->area / cell, 3)) : (double)p->n;
}

/* (42) for the step's scores: precision to H, right-hand side to g. */
static void make_equations(const apsm_fit_model *m, const part_points *p, const posterior_model *q,
                           const double *b, part_work *w)
{
    const size_t K = q->M, n = p->n;
    const double per_point = independent(m, p) / (double)n;
    const double variance = sigma * sigma * m->h * m->h + q->noise;
    apsm_gemm(0, 1, n, K, q->D, 1, w->A, q->D, q->mode, q->D, 0, w->G, K);
    for (size_t k = 0; k < n; k++) {
        double *row = w->G + k * K, target = w->e[k];
        for (size_t l = FIT_RIGID; l < K; l++) target += row[l] * b[l - FIT_RIGID];
        const double root = sqrt(w->w[k] * per_point / variance);
        for (size_t l = 0; l < K; l++) row[l] *= root;
        w->e[k] = root * target;
    }
    apsm_syrk(K, n, w->G, 0, w->H);
    apsm_gemm(1, 0, K, 1, n, 1, w->G, K, w->e, 1, 0, w->g, 1);
    for (size_t l = 0; l < K; l++) w->H[l * K + l] += 1 / q->variance[l];
}

/* The model's rigid motion goes to the points, the other way. */
static apsm_status take_step(const apsm_fit_model *m, part_state *s, part_work *w)
{
    double R[16], back[16], centre[3];
    fit_centre(m->posterior.D, w->P, centre);
    fit_rigid_motion(centre, m->radius, w->g, R);
    APSM_TRY(apsm_affine_invert(R, back));
    apsm_affine_multiply(back, s->M, s->M);
    memcpy(s->b, w->g + FIT_RIGID, m->posterior.M * sizeof *s->b);
    return APSM_OK;
}

/* Squares of distances, those beyond the last reach alike, and of the scores. */
static void judge_state(const apsm_fit_model *m, const part_points *p, part_state *s, part_work *w)
{
    const posterior_model *q = &m->posterior;
    const double variance = sigma * sigma * m->h * m->h + q->noise;
    const double most = last_reach * last_reach * m->h * m->h;
    double sum = 0, counted = 0;
    warp_to(m, s->b, w);
    match_points(m, p, s, last_reach, w);
    for (size_t k = 0; k < p->n; k++) {
        sum += w->w[k] > 0 ? fmin(w->e[k] * w->e[k], most) : most;
        counted += w->w[k] > 0.25;
    }
    s->counted = counted / (double)p->n;
    s->cost = sum * independent(m, p) / ((double)p->n * variance);
    for (size_t k = 0; k < q->M; k++) s->cost += s->b[k] * s->b[k] / q->variance[k];
}

apsm_status part_refine(const apsm_fit_model *m, const part_points *p, size_t rounds, double reach,
                        part_state *s, part_work *w)
{
    for (size_t r = 0; r < rounds; r++) {
        const double t = rounds > 1 ? (double)r / (double)(rounds - 1) : 1;
        warp_to(m, s->b, w);
        match_points(m, p, s, reach * pow(last_reach / reach, t), w);
        const posterior_model q = fit_rigid_add(&m->posterior, w->P, m->radius, w->store);
        make_equations(m, p, &q, s->b, w);
        APSM_TRY(apsm_cholesky(q.M, w->H));
        apsm_cholesky_solve(q.M, w->H, 1, w->g);
        APSM_TRY(take_step(m, s, w));
    }
    judge_state(m, p, s, w);
    return APSM_OK;
}
