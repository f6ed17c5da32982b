/* Particles are drawn to where features match in rounds of two halves: every particle looks for
 * points of the shape that are near and look like its place on the template,
 *   q_j = sum_k s_jk z_k / (e + sum_k s_jk),   s_jk = exp(-|p_j - z_k|^2 / 2 sigma^2 - |f_tj -
 * f_k|^2 / 2) and less what the same gives without features; then all follow what their
 * neighbourhood found, u(x) = sum_j k(x, p_j) (q_j - p_j) / sum_j k(x, p_j),   k Gaussian of reach
 * sigma, and return to the surface.  sigma falls from 3 h to h. */
#include "initialize/features.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/vec3.h"

enum { ROUNDS = 15, MOST_POINTS = 1500 };
static const double first_reach = 3, last_reach = 1, outlier = 1e-6;

/* ---- fields ---- */

static apsm_status standardise(const apsm_cohort *c, size_t s, const double *const *scalar,
                               double *mean, double *sd)
{
    double sum = 0, squares = 0, n = 0;
    for (size_t i = 0; i < c->I; i++) {
        const size_t nv = c->shape[i].mesh.nv;
        for (size_t v = 0; v < nv; v++) sum += scalar[i][s * nv + v];
        n += (double)nv;
    }
    *mean = sum / n;
    for (size_t i = 0; i < c->I; i++) {
        const size_t nv = c->shape[i].mesh.nv;
        for (size_t v = 0; v < nv; v++) {
            const double d = scalar[i][s * nv + v] - *mean;
            squares += d * d;
        }
    }
    *sd = sqrt(squares / n);
    return *sd > 1e-12 * fabs(*mean) && *sd > 0 ? APSM_OK : APSM_ERR_GEOMETRY;
}

static void take_normals(const apsm_shape *shape, double weight, double *value)
{
    const size_t nv = shape->mesh.nv;
    for (size_t c = 0; c < 3; c++)
        for (size_t v = 0; v < nv; v++) value[c * nv + v] = weight * shape->VN[3 * v + c];
}

static apsm_status make_room(apsm_cohort *c, size_t F)
{
    c->features = (apsm_features){ .I = c->I, .F = F };
    c->features.value = calloc(c->I, sizeof *c->features.value);
    if (!c->features.value) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < c->I; i++) {
        double **to = &c->features.value[i];
        *to = malloc((F * c->shape[i].mesh.nv + 1) * sizeof **to);
        if (!*to) return APSM_ERR_MEMORY;
    }
    return APSM_OK;
}

apsm_status apsm_cohort_features(apsm_cohort *c, size_t S, const double *const *scalar,
                                 const double *weight, double normals, size_t *flat)
{
    APSM_TRY(make_room(c, S + (normals > 0 ? 3 : 0)));
    for (size_t s = 0; s < S; s++) {
        double mean, sd;
        *flat = s;
        APSM_TRY(standardise(c, s, scalar, &mean, &sd));
        for (size_t i = 0; i < c->I; i++) {
            const size_t nv = c->shape[i].mesh.nv;
            for (size_t v = 0; v < nv; v++)
                c->features.value[i][s * nv + v] = weight[s] * (scalar[i][s * nv + v] - mean) / sd;
        }
    }
    for (size_t i = 0; i < c->I && normals > 0; i++)
        take_normals(&c->shape[i], normals, c->features.value[i] + S * c->shape[i].mesh.nv);
    return APSM_OK;
}

/* g[k] . is the slope of the barycentric weight of corner k of a face. */
static void weight_slopes(const apsm_mesh *m, const uint32_t *corner, double g[3][3])
{
    double e[3][3], n[3];
    for (size_t k = 0; k < 3; k++)
        vec3_sub(m->V + 3 * (size_t)corner[(k + 2) % 3], m->V + 3 * (size_t)corner[(k + 1) % 3],
                 e[k]);
    vec3_cross(e[1], e[2], n);
    const double n2 = vec3_dot(n, n);
    for (size_t k = 0; k < 3; k++) {
        vec3_cross(n, e[k], g[k]);
        for (size_t c = 0; c < 3; c++) g[k][c] = n2 > 0 ? g[k][c] / n2 : 0;
    }
}

void apsm_features_at(const apsm_cohort *c, size_t i, const apsm_surface_point *on, double *f,
                      double *slope)
{
    const apsm_mesh *m = &c->shape[i].mesh;
    const uint32_t *corner = m->F + 3 * (size_t)on->face;
    double g[3][3];
    if (slope) weight_slopes(m, corner, g);
    for (size_t s = 0; s < c->features.F; s++) {
        const double *value = c->features.value[i] + s * m->nv;
        f[s] = 0;
        for (size_t k = 0; k < 3; k++) f[s] += on->weight[k] * value[corner[k]];
        if (!slope) continue;
        memset(slope + 3 * s, 0, 3 * sizeof *slope);
        for (size_t k = 0; k < 3; k++) vec3_add_scaled(slope + 3 * s, value[corner[k]], g[k]);
    }
}

/* ---- drawing particles along ---- */

typedef struct pulling {
    const apsm_cohort *c;
    size_t i, J, F, K, stride; /* K points of the shape: every stride-th vertex */
    double *ft;                /* J x F: of the template's particles */
    double *d;                 /* J x 3: what each particle found */
    double *P;
} pulling;

static double feature_distance2(const pulling *p, const double *ft, size_t v)
{
    const size_t nv = p->c->shape[p->i].mesh.nv;
    const double *value = p->c->features.value[p->i];
    double sum = 0;
    for (size_t s = 0; s < p->F; s++) {
        const double d = value[s * nv + v] - ft[s];
        sum += d * d;
    }
    return sum;
}

/* d <- where the like of particle j is, less where its surroundings are. */
static void look_around(const pulling *p, size_t j, double sigma, double d[3])
{
    const apsm_mesh *m = &p->c->shape[p->i].mesh;
    double like[3] = { 0 }, any[3] = { 0 }, likes = outlier, all = outlier, away[3];
    for (size_t v = 0; v < m->nv; v += p->stride) {
        vec3_sub(m->V + 3 * v, p->P + 3 * j, away);
        const double d2 = vec3_dot(away, away) / (2 * sigma * sigma);
        if (d2 > 12) continue;
        const double s = exp(-d2), t = s * exp(-0.5 * feature_distance2(p, p->ft + j * p->F, v));
        vec3_add_scaled(any, s, away);
        vec3_add_scaled(like, t, away);
        all += s;
        likes += t;
    }
    for (size_t c = 0; c < 3; c++) d[c] = like[c] / likes - any[c] / all;
}

static void follow(const pulling *p, size_t j, const double *from, double sigma, double x[3])
{
    const apsm_shape *shape = &p->c->shape[p->i];
    double u[3] = { 0 }, sum = 0, n[3];
    apsm_surface_point on;
    apsm_closest at;
    for (size_t k = 0; k < p->J; k++) {
        const double w = exp(-vec3_distance2(from + 3 * j, from + 3 * k) / (2 * sigma * sigma));
        vec3_add_scaled(u, w, p->d + 3 * k);
        sum += w;
    }
    apsm_shape_look_up(shape, 1, x, &on, NULL, n);
    vec3_add_scaled(x, 1 / sum, u);
    apsm_bvh_closest_facing(shape->bvh, x, n, 0, INFINITY, &at);
    if (!isfinite(at.distance2)) apsm_bvh_closest(shape->bvh, x, INFINITY, &at);
    memcpy(x, at.x, sizeof at.x);
}

static void run_rounds(const pulling *p, double h, double *from)
{
    for (int r = 0; r < ROUNDS; r++) {
        const double t = (double)r / (ROUNDS - 1);
        const double sigma = h * (first_reach + t * (last_reach - first_reach));
        for (size_t j = 0; j < p->J; j++) look_around(p, j, sigma, p->d + 3 * j);
        memcpy(from, p->P, 3 * p->J * sizeof *from);
        for (size_t j = 0; j < p->J; j++) follow(p, j, from, sigma, p->P + 3 * j);
    }
}

apsm_status apsm_features_pull(const apsm_cohort *c, size_t i, size_t J, const double *T, double h,
                               double *P)
{
    const size_t F = c->features.F, nv = c->shape[i].mesh.nv, t = c->template_index;
    pulling p = { .c = c, .i = i, .J = J, .F = F, .P = P, .stride = nv / MOST_POINTS + 1 };
    p.ft = malloc((J * F + 6 * J) * sizeof *p.ft);
    if (!p.ft) return APSM_ERR_MEMORY;
    p.d = p.ft + J * F;
    for (size_t j = 0; j < J; j++) {
        apsm_surface_point on;
        apsm_shape_look_up(&c->shape[t], 1, T + 3 * j, &on, NULL, NULL);
        apsm_features_at(c, t, &on, p.ft + j * F, NULL);
    }
    run_rounds(&p, h, p.d + 3 * J);
    free(p.ft);
    return APSM_OK;
}
