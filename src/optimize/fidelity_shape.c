/* The objective of the fidelity stage for one shape, equation (12), lengths in h:
 *
 *   sum_v rho(|y_v - q_v|) + sum_u rho(|y_u - u|) + 1/2 mu d' Q d + 1/2 kappa e' S e
 *       + 1/2 nu sum_jk max(0, |x_jk| - b |x_jl|)^2 + landmarks (fidelity_landmarks.c)
 *       + joint spaces (fidelity_contacts.c)
 *
 *   y = W p     the template's vertices, warped;  q_v  the closest point of the shape
 *   u, y_u      vertex of the shape, and the closest point on the warped template
 *   e = p - mean  displacement from the mean of the other shapes
 *   d           displacement from a place between that mean and the template's particles
 *   Q           what of it is not smooth (fidelity_smooth.c)
 *   rho(d)      d between a floor and a ceiling; d^2 / (2 s) + s / 2 with s = floor below, ceiling
 *               above: tips that are not reached count for more than their few vertices
 *   S           precision of the prior; with it the term counts distances, not squares (below)
 *   x_jk        from particle j to its neighbour k of the template; l the particle next to j on the
 *               shape.  beyond b = 1.75 k is on its way to being mismatched (2.0)
 *
 * The gradient of a distance is the unit vector between the two points (the closest one may slide:
 * its move is orthogonal), carried to the particles by the row of W; so the gradient is exact, and
 * Gauss-Newton on reweighted squares, weight 1 / s, s = d within floor and ceiling, descends. */
#include "optimize/fidelity_shape.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/kernel.h"
#include "geometry/bvh_guess.h"
#include "geometry/nearest.h"
#include "geometry/vec3.h"
#include "geometry/walk.h"
#include "initialize/anchors.h"
#include "linalg/linalg.h"
#include "optimize/correspondence_loss.h"

/* ---- memory ---- */

static size_t stride_of(const apsm_fidelity *f, size_t nv)
{
    const size_t wanted = f->o.fidelity_points > 0 ? (size_t)f->o.fidelity_points : 1;
    return nv / wanted + (nv % wanted != 0);
}

static size_t most_vertices(const apsm_fidelity *f)
{
    size_t most = f->warp.nv;
    for (size_t i = 0; i < f->cohort->I; i++)
        if (f->cohort->shape[i].mesh.nv > most) most = f->cohort->shape[i].mesh.nv;
    return most;
}

static bool state_alloc(size_t J, size_t matches, fidelity_state *s)
{
    s->P = malloc(3 * J * sizeof *s->P);
    s->N = malloc(3 * J * sizeof *s->N);
    s->S = malloc(J * sizeof *s->S);
    s->match = malloc(matches * sizeof *s->match);
    return s->P && s->N && s->S && s->match;
}

static void state_free(fidelity_state *s)
{
    free(s->P);
    free(s->N);
    free(s->S);
    free(s->match);
}

/* Rows and entries at most: matches, neighbours, landmarks, features, contacts. */
static apsm_status system_alloc(const apsm_fidelity *f, fidelity_system *s)
{
    const apsm_cohort *c = f->cohort;
    const size_t J = f->J, all = most_vertices(f), wanted = (size_t)f->o.fidelity_points;
    const size_t near = fidelity_most_near(f->warp.nv, &f->near);
    const size_t matches = 2 * (all < wanted ? all : wanted), wide = 3 * near < J ? 3 * near : J;
    const size_t neighbours = f->reference.start[J], landmarks = 3 * f->anchors.nv;
    const size_t features = c->features.F * J, contacts = c->obstacles.I > 0 ? f->warp.nv : 0;
    return fidelity_system_alloc(
        J, matches + neighbours + landmarks + features + contacts,
        matches * wide + 3 * neighbours + landmarks * J + features + contacts * near, s);
}

/* H, or what it is made of. */
static bool matrix_alloc(const apsm_fidelity *f, fidelity_work *w)
{
    const size_t J = f->J;
    if (w->sparse) return system_alloc(f, &w->system) == APSM_OK;
    w->H32 = malloc(4 * J * J * sizeof *w->H32);
    w->H = malloc(4 * J * J * sizeof *w->H);
    return w->H32 && w->H;
}

apsm_status fidelity_work_alloc(const apsm_fidelity *f, size_t modes, fidelity_work *w)
{
    const size_t J = f->J, matches = (f->cohort->obstacles.I > 0 ? 3 : 2) * most_vertices(f);
    *w = (fidelity_work){ 0 };
    const bool states = state_alloc(J, matches, &w->a) && state_alloc(J, matches, &w->b);
    w->Y = malloc(3 * f->warp.nv * sizeof *w->Y);
    w->at = calloc(3 * J, sizeof *w->at);
    w->YN = malloc(3 * f->warp.nv * sizeof *w->YN);
    w->tangent = malloc(6 * J * sizeof *w->tangent);
    w->part = malloc(J * sizeof *w->part);
    w->sparse = f->W32 != NULL;
    w->rows = malloc(2 * J * FIDELITY_ROWS * sizeof *w->rows);
    w->near = malloc(2 * J * sizeof *w->near);
    w->force = malloc(3 * f->warp.nv * sizeof *w->force);
    w->row = malloc(8 * J * sizeof *w->row);
    w->band = malloc(2 * J * (f->band + 1) * sizeof *w->band);
    w->g = malloc(2 * J * sizeof *w->g);
    w->e = malloc(3 * J * sizeof *w->e);
    w->Se = malloc(3 * J * sizeof *w->Se);
    w->v = malloc(J * sizeof *w->v);
    w->z = malloc((3 * J * modes + 1) * sizeof *w->z);
    w->K = malloc((modes * modes + 1) * sizeof *w->K);
    w->entry = malloc(3 * J * sizeof *w->entry);
    w->feature = malloc((4 * f->cohort->features.F + 1) * sizeof *w->feature);
    w->named = malloc(J * sizeof *w->named);
    w->tangent_mode = malloc((2 * J * modes + 1) * sizeof *w->tangent_mode);
    if (states && matrix_alloc(f, w) && w->v && w->z && w->K && w->feature && w->entry &&
        w->named && w->Y && w->at && w->YN && w->tangent && w->part && w->rows && w->near &&
        w->force && w->row && w->band && w->g && w->e && w->Se && w->tangent_mode) {
        const apsm_mesh *mesh = &f->cohort->shape[f->cohort->template_index].mesh;
        memcpy(w->Y, mesh->V, 3 * mesh->nv * sizeof *w->Y);
        w->warped = *mesh;
        w->warped.V = w->Y;
        return apsm_bvh_build_unsigned(&w->warped, &w->bvh);
    }
    return APSM_ERR_MEMORY;
}

void fidelity_work_free(fidelity_work *w)
{
    state_free(&w->a);
    state_free(&w->b);
    free(w->v);
    free(w->z);
    free(w->K);
    free(w->entry);
    free(w->named);
    free(w->feature);
    free(w->Y);
    free(w->at);
    free(w->YN);
    apsm_bvh_free(w->bvh);
    free(w->tangent);
    free(w->part);
    free(w->rows);
    free(w->near);
    free(w->force);
    fidelity_system_free(&w->system);
    free(w->row);
    free(w->H32);
    free(w->band);
    free(w->H);
    free(w->g);
    free(w->e);
    free(w->Se);
    free(w->tangent_mode);
}

/* ---- distances ---- */

/* Unit direction from q to y; the normal where the two coincide. */
static void direct(const double y[3], const double q[3], const double normal[3], double h,
                   fidelity_match *m)
{
    double d[3];
    vec3_sub(y, q, d);
    const double length = vec3_norm(d);
    m->distance = length / h;
    for (int c = 0; c < 3; c++) m->direction[c] = m->distance > 1e-9 ? d[c] / length : normal[c];
}

/* Closest point to x; on sheets of this half-thickness (INFINITY: none) one that looks the way of
 * n, unless that is farther than the other side can account for: at rims normals say little. */
static void closest(const apsm_bvh *bvh, const double x[3], const double n[3],
                    double half_thickness, apsm_closest *c)
{
    apsm_bvh_closest(bvh, x, INFINITY, c);
    if (!isfinite(half_thickness) || vec3_dot(bvh_face_normal(bvh, c->on.face), n) >= 0) return;
    apsm_closest facing;
    const double most = sqrt(c->distance2) + 4 * half_thickness;
    apsm_bvh_closest_facing(bvh, x, n, 0, most * most, &facing);
    if (isfinite(facing.distance2)) *c = facing;
}

/* Vertex v of the template, at y, is closest to c on the shape. */
static void set_pull(const apsm_fidelity *f, const apsm_shape *shape, uint32_t v, const double y[3],
                     const apsm_closest *c, fidelity_match *m)
{
    double n[3];
    apsm_surface_normal(&shape->mesh, shape->VN, &c->on, n);
    *m = (fidelity_match){ .vertex = v, .on = c->on };
    direct(y, c->x, n, f->h, m);
}

/* Vertex u of the shape is closest to c on the template. */
static void set_push(const apsm_fidelity *f, const apsm_shape *shape, uint32_t u,
                     const apsm_closest *c, fidelity_match *m)
{
    *m = (fidelity_match){ .vertex = u, .on = c->on };
    direct(c->x, shape->mesh.V + 3 * (size_t)u, shape->VN + 3 * (size_t)u, f->h, m);
}

static void pull(const apsm_fidelity *f, const apsm_shape *shape, uint32_t v,
                 const fidelity_work *w, double half_thickness, fidelity_match *m)
{
    apsm_closest c;
    const double *y = w->Y + 3 * (size_t)v;
    closest(shape->bvh, y, w->YN + 3 * (size_t)v, half_thickness, &c);
    set_pull(f, shape, v, y, &c, m);
}

static void push(const apsm_fidelity *f, const apsm_shape *shape, uint32_t u,
                 const apsm_bvh *warped, double half_thickness, fidelity_match *m)
{
    apsm_closest c;
    closest(warped, shape->mesh.V + 3 * (size_t)u, shape->VN + 3 * (size_t)u, half_thickness, &c);
    set_push(f, shape, u, &c, m);
}

/* The template as particles P have it; nothing to do where a round begins where one ended. */
static void warp_to(const apsm_fidelity *f, const double *P, fidelity_work *w)
{
    const size_t bytes = 3 * f->J * sizeof *P;
    if (memcmp(w->at, P, bytes) == 0) return;
    memcpy(w->at, P, bytes);
    if (w->sparse) {
        const double *V = f->cohort->shape[f->cohort->template_index].mesh.V;
        for (size_t x = 0; x < 3 * f->J; x++) w->e[x] = P[x] - f->T[x];
        apsm_warp_displace(f->warp.nv, f->J, f->W32, V, w->e, w->Y);
    } else {
        apsm_warp_apply(&f->warp, P, w->Y);
    }
    w->moved = true;
}

static void fit_tree(fidelity_work *w)
{
    if (w->moved) apsm_bvh_refit(w->bvh);
    w->moved = false;
}

static void add_up(const apsm_fidelity *f, size_t i, fidelity_state *s, const fidelity_work *w)
{
    double sum = 0;
    for (size_t k = 0; k < s->n; k++) sum += s->match[k].distance;
    s->distance = sum / (double)s->n;
    fidelity_find_contacts(f, i, s, w);
}

void fidelity_measure(const apsm_fidelity *f, size_t i, long round, fidelity_state *s,
                      fidelity_work *w)
{
    const apsm_shape *shape = &f->cohort->shape[i];
    warp_to(f, s->P, w);
    fit_tree(w);
    const double thin = shape->half_thickness < 0.5 * f->h ? shape->half_thickness : INFINITY;
    if (isfinite(thin)) apsm_mesh_vertex_normals(&w->warped, w->YN);
    const size_t step_v = stride_of(f, w->warped.nv), step_u = stride_of(f, shape->mesh.nv);
    size_t n = 0;
    for (size_t v = (size_t)round % step_v; v < w->warped.nv; v += step_v)
        pull(f, shape, (uint32_t)v, w, thin, &s->match[n++]);
    s->pulls = n;
    for (size_t u = (size_t)round % step_u; u < shape->mesh.nv; u += step_u)
        push(f, shape, (uint32_t)u, w->bvh, thin, &s->match[n++]);
    s->n = n;
    add_up(f, i, s, w);
}

void fidelity_follow(const apsm_fidelity *f, size_t i, const fidelity_state *from,
                     fidelity_state *s, fidelity_work *w)
{
    const apsm_shape *shape = &f->cohort->shape[i];
    const apsm_topology *on_template = &f->cohort->shape[f->cohort->template_index].topology;
    apsm_closest c;
    warp_to(f, s->P, w);
    s->pulls = from->pulls;
    s->n = from->n;
    for (size_t k = 0; k < s->pulls; k++) {
        const fidelity_match *m = &from->match[k];
        const double *y = w->Y + 3 * (size_t)m->vertex;
        apsm_walk_closest(&shape->mesh, &shape->topology, y, m->on.face, &c);
        set_pull(f, shape, m->vertex, y, &c, &s->match[k]);
    }
    for (size_t k = s->pulls; k < s->n; k++) {
        const fidelity_match *m = &from->match[k];
        const double *x = shape->mesh.V + 3 * (size_t)m->vertex;
        apsm_walk_closest(&w->warped, on_template, x, m->on.face, &c);
        set_push(f, shape, m->vertex, &c, &s->match[k]);
    }
    add_up(f, i, s, w);
}

/* ---- the objective ---- */

/* e = p - (1 - s) mean - s t in h, t the template and s its share; Se = Q e.  From the mean alone,
 * what all shapes share would cost next to nothing, while all their distances speak for it. */
static void roughness(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                      fidelity_work *w)
{
    const size_t J = f->J;
    const double s = f->o.common;
    for (size_t x = 0; x < 3 * J; x++) w->e[x] = (P[x] - s * f->T[x]) / f->h - (1 - s) * q->mean[x];
    if (w->sparse) /* BLAS takes three times as long for three columns, which few do not feel */
        fidelity_roughness(J, f->Q, w->e, w->row, w->Se);
    else
        apsm_gemm(0, 0, J, 3, J, 1, f->Q, J, w->e, 3, 0, w->Se, 3);
}

/* e = p - from in h. */
static void departure(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                      fidelity_work *w)
{
    for (size_t x = 0; x < 3 * f->J; x++) w->e[x] = (P[x] - q->from[x]) / f->h;
}

static double dot(size_t n, const double *a, const double *b)
{
    double sum = 0;
    for (size_t k = 0; k < n; k++) sum += a[k] * b[k];
    return sum;
}

/* e = p - mean in h; Se = S e, S = V - Z'Z. */
static void deviation(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                      fidelity_work *w)
{
    const size_t D = 3 * f->J;
    for (size_t x = 0; x < D; x++) {
        w->e[x] = P[x] / f->h - q->mean[x];
        w->Se[x] = w->v[x / 3] * w->e[x];
    }
    for (size_t m = 0; m < q->modes; m++) {
        const double *z = w->z + m * D, s = dot(D, z, w->e);
        for (size_t x = 0; x < D; x++) w->Se[x] -= s * z[x];
    }
}

/* The least of |e - U' b|^2, particles weighted by V, plus |b|^2 weighted by c = 1 / weight - 1, is
 * e' S e with S = V - V U' (U V U' + c)^-1 U V = V - Z'Z.  (V = 1: S = 1 - U' weight U.) */
static void make_precision(const apsm_fidelity *f, const fidelity_weights *q, fidelity_work *w)
{
    static const double least = 1e-9; /* a mode of no weight is no mode */
    const size_t D = 3 * f->J, M = q->modes;
    for (size_t a = 0; a < M; a++)
        for (size_t b = 0; b <= a; b++) {
            double sum = a == b ? 1 / fmax(q->weight[a], least) - 1 : 0;
            for (size_t x = 0; x < D; x++)
                sum += q->mode[a * D + x] * w->v[x / 3] * q->mode[b * D + x];
            w->K[a * M + b] = sum;
        }
    if (M > 0 && apsm_cholesky(M, w->K) != APSM_OK) { /* only by rounding: a prior without modes */
        memset(w->z, 0, M * D * sizeof *w->z);
        return;
    }
    for (size_t a = 0; a < M; a++) { /* K z = U V */
        double *z = w->z + a * D;
        for (size_t x = 0; x < D; x++) z[x] = w->v[x / 3] * q->mode[a * D + x];
        for (size_t b = 0; b < a; b++)
            for (size_t x = 0; x < D; x++) z[x] -= w->K[a * M + b] * w->z[b * D + x];
        for (size_t x = 0; x < D; x++) z[x] /= w->K[a * M + a];
    }
}

double fidelity_left_out(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                         fidelity_work *w)
{
    const size_t D = 3 * f->J;
    double sum = 0;
    for (size_t x = 0; x < D; x++) w->e[x] = P[x] / f->h - q->mean[x];
    for (size_t m = 0; m < q->modes; m++) {
        const double *u = q->mode + m * D, b = dot(D, u, w->e);
        for (size_t x = 0; x < D; x++) w->e[x] -= b * u[x];
    }
    for (size_t j = 0; j < f->J; j++) sum += vec3_norm(w->e + 3 * j);
    return sum / (double)f->J;
}

/* Particles weigh 1 / r, r the distance by which the model misses them, over what is usual: squares
 * so weighted add up like distances, and a particle whose place is its own is not held by the
 * model.  Within a factor of 4, and found in turns with what the model makes of the others. */
void fidelity_set_prior(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                        fidelity_work *w)
{
    enum { TURNS = 2 };
    static const double most = 4;
    if (!(q->prior > 0)) return;
    const double usual = sqrt(8 / 3.14159265358979323846) * q->noise; /* mean norm of a Gaussian */
    for (size_t j = 0; j < f->J; j++) w->v[j] = 1;
    make_precision(f, q, w);
    for (int k = 0; k < TURNS; k++) {
        deviation(f, q, P, w);
        for (size_t j = 0; j < f->J; j++) {
            const double r = vec3_norm(w->Se + 3 * j) / w->v[j];
            w->v[j] = r * most > usual ? fmax(usual / r, 1 / most) : most;
        }
        make_precision(f, q, w);
    }
}

/* Gauss-Newton terms of d = (|x_jk| - b |x_jl|) / h for particles t = { j, k, l }. */
static void pull_together(const apsm_fidelity *f, double weight, double d, const double *P,
                          const uint32_t t[3], double limit, const double *tangent,
                          fidelity_work *w)
{
    const size_t n = 2 * f->J;
    const double root = sqrt(weight);
    double away[2][3], row[6], scaled[6];
    for (int c = 0; c < 2; c++) { /* unit vectors from j to k and to l */
        vec3_sub(P + 3 * t[c + 1], P + 3 * t[0], away[c]);
        vec3_normalise(away[c]);
    }
    for (size_t a = 0; a < 2; a++) {
        const double *u = tangent + 6 * t[0] + 3 * a;
        row[a] = limit * vec3_dot(away[1], u) - vec3_dot(away[0], u);
        row[2 + a] = vec3_dot(away[0], tangent + 6 * t[1] + 3 * a);
        row[4 + a] = -limit * vec3_dot(away[1], tangent + 6 * t[2] + 3 * a);
    }
    for (size_t a = 0; a < 6; a++) {
        const size_t x = 2 * t[a / 2] + a % 2;
        w->g[x] += weight * d * row[a];
        scaled[a] = root * row[a];
        for (size_t b = 0; b < 6 && !w->sparse; b++) {
            const size_t y = 2 * t[b / 2] + b % 2;
            if (y <= x) w->H[x * n + y] += weight * row[a] * row[b];
        }
    }
    if (w->sparse) fidelity_system_put(f, 3, t, scaled, &w->system);
}

/* Calls for every neighbour of the template that is drifting away: d = |x_jk| - b |x_jl| > 0 in h.
 */
static double disorder(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                       const double *tangent, fidelity_work *w)
{
    static const double limit = 1.75;
    const apsm_neighbourhoods *r = &f->reference;
    double sum = 0;
    double *distance = w->row + 4 * f->J;
    apsm_nearest_points(f->J, P, f->J, P, true, w->row, w->near, distance);
    for (size_t j = 0; j < f->J; j++) {
        const size_t l = w->near[j];
        const double nearest = distance[j];
        for (size_t i = r->start[j]; i < r->start[j + 1]; i++) {
            const size_t k = r->index[i];
            const double far = sqrt(vec3_distance2(P + 3 * j, P + 3 * k));
            const double d = (far - limit * nearest) / f->h;
            if (!(d > 0) || !(nearest > 0)) continue;
            sum += d * d;
            if (tangent)
                pull_together(f, q->order, d, P,
                              (uint32_t[3]){ (uint32_t)j, (uint32_t)k, (uint32_t)l }, limit,
                              tangent, w);
        }
    }
    return sum;
}

void fidelity_value(const apsm_fidelity *f, const fidelity_weights *q, fidelity_state *s,
                    fidelity_work *w)
{
    const size_t D = 3 * f->J;
    const double floor_ = f->o.floor, ceiling = f->o.ceiling;
    double sum = 0;
    for (size_t k = 0; k < s->n; k++) {
        const double d = s->match[k].distance;
        const double scale = fmin(fmax(d, floor_), ceiling);
        sum += 0.5 * (d * d / scale + scale);
    }
    if (q->stay > 0) {
        departure(f, q, s->P, w);
        sum += 0.5 * q->stay * dot(D, w->e, w->e);
    }
    if (q->smooth > 0) {
        roughness(f, q, s->P, w);
        sum += 0.5 * q->smooth * dot(D, w->e, w->Se);
    }
    if (q->prior > 0) {
        deviation(f, q, s->P, w);
        sum += 0.5 * q->prior * dot(D, w->e, w->Se);
    }
    if (q->order > 0) sum += 0.5 * q->order * disorder(f, q, s->P, NULL, w);
    s->value = sum;
    fidelity_value_landmarks(f, q->shape, s);
    fidelity_value_features(f, q->shape, s, w);
    fidelity_value_contacts(q, s);
}

/* Particles of the rim have one tangent, along it. */
static void make_rim_tangents(const apsm_fidelity *f, size_t i, const double *P, double *tangent)
{
    const apsm_rim *rim = &f->cohort->shape[i].rim;
    for (size_t j = 0; j < f->J && rim->n > 0; j++) {
        apsm_rim_point p;
        if (!f->on_rim[j]) continue;
        memset(tangent + 6 * j, 0, 6 * sizeof *tangent);
        apsm_rim_closest(rim, P + 3 * j, &p);
        apsm_rim_direction(rim, p.edge, tangent + 6 * j);
    }
}

static void add_to_diagonal(const apsm_fidelity *f, size_t x, double weight, fidelity_work *w)
{
    if (w->sparse)
        fidelity_system_put_diagonal(f, x, weight, &w->system);
    else
        w->H[x * 2 * f->J + x] += weight;
}

/* An unknown that moves nothing gets a pivot. */
static void hold_still(const apsm_fidelity *f, double pivot, fidelity_work *w)
{
    const double *tangent = w->tangent;
    for (size_t x = 0; x < 2 * f->J; x++)
        if (!(vec3_dot(tangent + 3 * x, tangent + 3 * x) > 0)) add_to_diagonal(f, x, pivot, w);
}

/* Two unit tangents at each particle, from its normal alone. */
static void make_tangents(size_t J, const double *N, double *tangent)
{
    for (size_t j = 0; j < J; j++) {
        const double *n = N + 3 * j;
        double *a = tangent + 6 * j, *b = a + 3, axis[3] = { 0 };
        int least = 0;
        for (int c = 1; c < 3; c++)
            if (fabs(n[c]) < fabs(n[least])) least = c;
        axis[least] = 1;
        vec3_cross(n, axis, a);
        vec3_normalise(a);
        vec3_cross(n, a, b);
    }
}

/* part (2J): the row of W (J) at a vertex, each number twice. */
APSM_KERNEL static void part_of_vertex(size_t J, const double *W, double *part)
{
    for (size_t j = 0; j < J; j++) part[2 * j] = part[2 * j + 1] = W[j];
}

/* The same inside a face: the sum over its corners. */
APSM_KERNEL static void part_of_face(size_t J, const double *const W[3], const double weight[3],
                                     double *part)
{
    const double *A = W[0], *B = W[1], *C = W[2], a = weight[0], b = weight[1], c = weight[2];
    for (size_t j = 0; j < J; j++) part[2 * j] = part[2 * j + 1] = a * A[j] + b * B[j] + c * C[j];
}

static void particles_in(const apsm_fidelity *f, const fidelity_match *m, bool is_pull,
                         double *part)
{
    const size_t J = f->J;
    const double *W[3];
    if (is_pull) {
        part_of_vertex(J, f->warp.W + m->vertex * J, part);
        return;
    }
    const apsm_mesh *mesh = &f->cohort->shape[f->cohort->template_index].mesh;
    for (size_t k = 0; k < 3; k++) W[k] = f->warp.W + mesh->F[3 * (size_t)m->on.face + k] * J;
    part_of_face(J, W, m->on.weight, part);
}

/* row (n) = root times the derivative of the match's distance by the tangential moves, u the
 * tangents (3 x n, by coordinate); adds its part of the gradient to g. */
APSM_KERNEL static void make_row(size_t n, const double *part, const double direction[3],
                                 double root, double distance, const double *u, double *g,
                                 float *row)
{
    const double *x = u, *y = u + n, *z = u + 2 * n;
    const double dx = root * direction[0], dy = root * direction[1], dz = root * direction[2];
    const double pull = root * distance;
    for (size_t k = 0; k < n; k++) {
        const double p = part[k] * (dx * x[k] + dy * y[k] + dz * z[k]);
        g[k] += pull * p;
        row[k] = (float)p;
    }
}

/* Row k of w->rows, and its part of the gradient; w->row: the tangents by coordinate, scratch. */
static void take_row(const apsm_fidelity *f, const fidelity_state *s, size_t first, size_t k,
                     fidelity_work *w)
{
    const size_t n = 2 * f->J;
    const fidelity_match *m = &s->match[first + k];
    const double scale = fmin(fmax(m->distance, f->o.floor), f->o.ceiling);
    double *part = w->row + 3 * n;
    particles_in(f, m, first + k < s->pulls, part);
    make_row(n, part, m->direction, 1 / sqrt(scale), m->distance, w->row, w->g, w->rows + k * n);
}

/* The surface terms' part of H, of few particles: in single precision, since it shapes the step,
 * whose worth the value decides. */
static void add_rows(const apsm_fidelity *f, const fidelity_state *s, fidelity_work *w)
{
    const size_t n = 2 * f->J;
    memset(w->H32, 0, n * n * sizeof *w->H32);
    for (size_t x = 0; x < 3 * n; x++) w->row[x % 3 * n + x / 3] = w->tangent[x];
    for (size_t first = 0; first < s->n; first += FIDELITY_ROWS) {
        const size_t rows = s->n - first < FIDELITY_ROWS ? s->n - first : FIDELITY_ROWS;
        for (size_t k = 0; k < rows; k++) take_row(f, s, first, k, w);
        apsm_syrk_f32(n, rows, w->rows, 1, w->H32);
    }
    for (size_t x = 0; x < n; x++)
        for (size_t y = 0; y <= x; y++) w->H[x * n + y] = (double)w->H32[x * n + y];
}

/* Of the surface terms' part of H. */
static double trace_of(const apsm_fidelity *f, const fidelity_work *w)
{
    const size_t n = 2 * f->J;
    const fidelity_system *s = &w->system;
    double trace = 0;
    if (w->sparse)
        for (size_t e = 0; e < 2 * s->start[s->n]; e++) trace += (double)(s->x[e] * s->x[e]);
    else
        for (size_t x = 0; x < n; x++) trace += w->H[x * n + x];
    return trace;
}

double fidelity_linearise(const apsm_fidelity *f, size_t i, const fidelity_state *s,
                          fidelity_work *w)
{
    const size_t n = 2 * f->J;
    make_tangents(f->J, s->N, w->tangent);
    make_rim_tangents(f, i, s->P, w->tangent);
    memset(w->g, 0, n * sizeof *w->g);
    if (w->sparse) {
        fidelity_system_begin(f, w->tangent, &w->system);
        fidelity_add_near(f, s, w);
    } else {
        add_rows(f, s, w);
    }
    const double mean = trace_of(f, w) / (double)n;
    hold_still(f, mean, w);
    return mean;
}

static void add_gradient(size_t J, double weight, const double *x, const double *tangent, double *g)
{
    for (size_t j = 0; j < 2 * J; j++) g[j] += weight * vec3_dot(x + 3 * (j / 2), tangent + 3 * j);
}

static void add_modes(const apsm_fidelity *f, const fidelity_weights *q, fidelity_work *w)
{
    const size_t n = 2 * f->J;
    for (size_t x = 0; x < n; x++)
        for (size_t m = 0; m < q->modes; m++) {
            const double *u = w->tangent_mode + m * n;
            for (size_t y = 0; y <= x; y++) w->H[x * n + y] -= q->prior * u[x] * u[y];
        }
}

static void add_prior(const apsm_fidelity *f, const fidelity_weights *q, fidelity_work *w)
{
    const size_t J = f->J, n = 2 * J;
    for (size_t x = 0; x < n; x++) add_to_diagonal(f, x, q->prior * w->v[x / 2], w);
    for (size_t m = 0; m < q->modes; m++) {
        double *u = w->tangent_mode + m * n;
        for (size_t x = 0; x < n; x++)
            u[x] = vec3_dot(w->z + m * 3 * J + 3 * (x / 2), w->tangent + 3 * x);
    }
    if (!w->sparse) add_modes(f, q, w);
}

static void add_roughness(const apsm_fidelity *f, const fidelity_weights *q, const double *P,
                          fidelity_work *w)
{
    const size_t J = f->J;
    roughness(f, q, P, w);
    add_gradient(J, q->smooth, w->Se, w->tangent, w->g);
    if (w->sparse)
        w->system.smooth = q->smooth;
    else
        fidelity_add_roughness(J, q->smooth, f->Q, w->tangent, w->row, w->H);
}

void fidelity_add_quadratic(const apsm_fidelity *f, const fidelity_weights *q,
                            const fidelity_state *s, fidelity_work *w)
{
    if (q->stay > 0) {
        departure(f, q, s->P, w);
        add_gradient(f->J, q->stay, w->e, w->tangent, w->g);
        for (size_t x = 0; x < 2 * f->J; x++) add_to_diagonal(f, x, q->stay, w);
    }
    if (q->smooth > 0) add_roughness(f, q, s->P, w);
    if (q->order > 0) disorder(f, q, s->P, w->tangent, w);
    fidelity_add_landmarks(f, q->shape, s, w);
    fidelity_add_features(f, q->shape, s, w);
    fidelity_add_contacts(f, q, s, w);
    if (!(q->prior > 0)) return;
    deviation(f, q, s->P, w);
    add_gradient(f->J, q->prior, w->Se, w->tangent, w->g);
    add_prior(f, q, w);
}

/* ---- moves ---- */

void fidelity_land(const apsm_shape *shape, bool on_rim, const double normal[3], double x[3],
                   apsm_surface_point *on)
{
    apsm_closest c;
    if (on_rim && shape->rim.n > 0) {
        apsm_shape_keep_on_rim(shape, 1, &on_rim, x, on);
        return;
    }
    apsm_bvh_closest_facing(shape->bvh, x, normal, 0, INFINITY, &c);
    if (!isfinite(c.distance2)) apsm_bvh_closest(shape->bvh, x, INFINITY, &c);
    *on = c.on;
    memcpy(x, c.x, sizeof c.x);
}

void fidelity_move(const apsm_fidelity *f, size_t i, double t, const fidelity_state *from,
                   fidelity_state *to, fidelity_work *w)
{
    const apsm_shape *shape = &f->cohort->shape[i];
    for (size_t j = 0; j < f->J; j++) {
        double d[3] = { 0 }, *x = to->P + 3 * j;
        for (size_t a = 0; a < 2; a++)
            vec3_add_scaled(d, t * w->g[2 * j + a], w->tangent + 6 * j + 3 * a);
        const double length = vec3_norm(d), most = f->o.clip;
        const double scale = f->h * (length > most ? most / length : 1);
        memcpy(x, from->P + 3 * j, 3 * sizeof *x);
        if (!anchor_holds(f->cohort, i, j)) vec3_add_scaled(x, scale, d);
        fidelity_land(shape, f->on_rim[j], from->N + 3 * j, x, &to->S[j]);
        apsm_surface_normal(&shape->mesh, shape->VN, &to->S[j], to->N + 3 * j);
    }
}

size_t fidelity_folds(const apsm_fidelity *f, const fidelity_state *s)
{
    const apsm_certificate_options o = apsm_certificate_defaults();
    size_t folds = 0;
    for (size_t k = 0; k < f->triangles; k++)
        folds += apsm_triangle_orientation(s->P, s->N, f->triangle[k], &o) * f->side[k] < 0;
    return folds;
}
