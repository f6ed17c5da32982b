/* The surface terms of (12) where a vertex of the warped template is taken to hang on the particles
 * around it alone.
 *
 * The gradient is whole: each match pulls at the corners of its point, and the vertices' forces go
 * to the particles by one product with W.  The rows of H take only what is near: their other
 * entries, a hundred-thousandth of their sums of squares, shape the step but little, whose worth
 * the value decides. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/kernel.h"
#include "geometry/vec3.h"
#include "optimize/fidelity_shape.h"

static const double least = 3e-3; /* weight of a near particle, of the largest of its point */

/* ---- lists ---- */

enum { LANES = 8 };

APSM_KERNEL static float largest(size_t J, const float *x)
{
    float lane[LANES] = { 0 }, most = 0;
    const size_t whole = J - J % LANES;
    for (size_t j = 0; j < whole; j += LANES)
        for (size_t l = 0; l < LANES; l++) {
            const float size = fabsf(x[j + l]);
            lane[l] = size > lane[l] ? size : lane[l];
        }
    for (size_t j = whole; j < J; j++) most = fmaxf(most, fabsf(x[j]));
    for (size_t l = 0; l < LANES; l++) most = fmaxf(most, lane[l]);
    return most;
}

/* Entries of row v of W; the first n of them go to particle, if there is one. */
static size_t list_row(size_t J, const float *row, uint32_t *particle)
{
    const float limit = (float)least * largest(J, row);
    size_t n = 0;
    for (size_t j = 0; j < J; j++) {
        if (!(fabsf(row[j]) > limit)) continue;
        if (particle) particle[n] = (uint32_t)j;
        n++;
    }
    return n;
}

apsm_status fidelity_find_near(size_t nv, size_t J, const float *W, fidelity_near *near)
{
    near->start = malloc((nv + 1) * sizeof *near->start);
    if (!near->start) return APSM_ERR_MEMORY;
    near->start[0] = 0;
    for (size_t v = 0; v < nv; v++)
        near->start[v + 1] = near->start[v] + list_row(J, W + v * J, NULL);
    near->particle = malloc((near->start[nv] + 1) * sizeof *near->particle);
    if (!near->particle) return APSM_ERR_MEMORY;
    for (size_t v = 0; v < nv; v++) list_row(J, W + v * J, near->particle + near->start[v]);
    return APSM_OK;
}

size_t fidelity_most_near(size_t nv, const fidelity_near *near)
{
    size_t most = 0;
    for (size_t v = 0; v < nv; v++) {
        const size_t n = near->start[v + 1] - near->start[v];
        most = n > most ? n : most;
    }
    return most;
}

void fidelity_near_free(fidelity_near *near)
{
    free(near->start);
    free(near->particle);
    *near = (fidelity_near){ 0 };
}

/* ---- a match's point of the template ---- */

typedef struct corners {
    size_t n;
    uint32_t vertex[3];
    double weight[3];
} corners;

static corners corners_of(const apsm_fidelity *f, const fidelity_match *m, bool is_pull)
{
    if (is_pull) return (corners){ 1, { m->vertex }, { 1 } };
    const apsm_mesh *mesh = &f->cohort->shape[f->cohort->template_index].mesh;
    corners c = { .n = 3 };
    memcpy(c.vertex, mesh->F + 3 * (size_t)m->on.face, sizeof c.vertex);
    memcpy(c.weight, m->on.weight, sizeof c.weight);
    return c;
}

static double scale_of(const apsm_fidelity *f, const fidelity_match *m)
{
    return fmin(fmax(m->distance, f->o.floor), f->o.ceiling);
}

/* ---- gradient ---- */

/* x (3 x J) += c' W for four rows of W. */
KERNEL_INLINE void add_four(size_t J, const float *const W[4], const double c[4][3], double *x)
{
    double *y = x + J, *z = x + 2 * J;
    for (size_t j = 0; j < J; j++) {
        const double p = (double)W[0][j], q = (double)W[1][j], r = (double)W[2][j],
                     s = (double)W[3][j];
        x[j] += (c[0][0] * p + c[1][0] * q) + (c[2][0] * r + c[3][0] * s);
        y[j] += (c[0][1] * p + c[1][1] * q) + (c[2][1] * r + c[3][1] * s);
        z[j] += (c[0][2] * p + c[1][2] * q) + (c[2][2] * r + c[3][2] * s);
    }
}

/* x (3 x J) = W' force for forces (nv x 3) on vertices, most of them none. */
APSM_KERNEL static void to_particles(size_t nv, size_t J, const float *W, const double *force,
                                     double *x)
{
    const float *row[4] = { W, W, W, W };
    double c[4][3] = { { 0 } };
    size_t n = 0;
    memset(x, 0, 3 * J * sizeof *x);
    for (size_t v = 0; v < nv; v++) {
        const double *t = force + 3 * v;
        if (t[0] == 0 && t[1] == 0 && t[2] == 0) continue;
        row[n] = W + v * J;
        memcpy(c[n++], t, sizeof c[0]);
        if (n < 4) continue;
        add_four(J, row, (const double(*)[3])c, x);
        memset(c, 0, sizeof c);
        n = 0;
    }
    if (n > 0) add_four(J, row, (const double(*)[3])c, x);
}

static void add_gradient(const apsm_fidelity *f, const fidelity_state *s, fidelity_work *w)
{
    const size_t J = f->J, nv = f->warp.nv;
    double *x = w->row;
    memset(w->force, 0, 3 * nv * sizeof *w->force);
    for (size_t k = 0; k < s->n; k++) {
        const fidelity_match *m = &s->match[k];
        const corners c = corners_of(f, m, k < s->pulls);
        const double pull = m->distance / scale_of(f, m);
        for (size_t a = 0; a < c.n; a++)
            vec3_add_scaled(w->force + 3 * (size_t)c.vertex[a], pull * c.weight[a], m->direction);
    }
    to_particles(nv, J, f->W32, w->force, x);
    for (size_t k = 0; k < 2 * J; k++) {
        const double *t = w->tangent + 3 * k;
        w->g[k] += t[0] * x[k / 2] + t[1] * x[J + k / 2] + t[2] * x[2 * J + k / 2];
    }
}

/* ---- matrix ---- */

/* Particles near the corners, in w->near, their parts in the point in w->part; returns how many. */
static size_t gather(const apsm_fidelity *f, const corners *c, fidelity_work *w)
{
    const fidelity_near *near = &f->near;
    size_t n = 0, kept = 0;
    double most = 0;
    for (size_t a = 0; a < c->n; a++) {
        const size_t v = c->vertex[a];
        const float *row = f->W32 + v * f->J;
        for (size_t k = near->start[v]; k < near->start[v + 1]; k++) {
            const uint32_t j = near->particle[k];
            if (!w->named[j]) w->near[n++] = j;
            if (!w->named[j]) w->part[j] = 0;
            w->named[j] = true;
            w->part[j] += c->weight[a] * (double)row[j];
        }
    }
    for (size_t k = 0; k < n; k++) most = fmax(most, fabs(w->part[w->near[k]]));
    for (size_t k = 0; k < n; k++) {
        const uint32_t j = w->near[k];
        w->named[j] = false;
        if (fabs(w->part[j]) > least * most) w->near[kept++] = j;
    }
    return kept;
}

/* The row of a point that is moved along a direction, times root. */
static void put_point(const apsm_fidelity *f, const corners *c, const double direction[3],
                      double root, fidelity_work *w)
{
    const size_t n = gather(f, c, w);
    double *x = w->row;
    for (size_t k = 0; k < 2 * n; k++) {
        const size_t j = w->near[k / 2];
        x[k] = root * w->part[j] * vec3_dot(direction, w->tangent + 6 * j + 3 * (k % 2));
    }
    fidelity_system_put(f, n, w->near, x, &w->system);
}

void fidelity_add_near(const apsm_fidelity *f, const fidelity_state *s, fidelity_work *w)
{
    add_gradient(f, s, w);
    memset(w->named, 0, f->J * sizeof *w->named);
    for (size_t k = 0; k < s->n; k++) {
        const fidelity_match *m = &s->match[k];
        const corners c = corners_of(f, m, k < s->pulls);
        put_point(f, &c, m->direction, 1 / sqrt(scale_of(f, m)), w);
    }
}

void fidelity_put_vertex(const apsm_fidelity *f, uint32_t vertex, const double direction[3],
                         double root, fidelity_work *w)
{
    const corners c = { 1, { vertex }, { 1 } };
    memset(w->named, 0, f->J * sizeof *w->named);
    put_point(f, &c, direction, root, w);
}
