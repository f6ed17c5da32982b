/* Landmarks in the objective of the fidelity stage: lambda sum_l rho(|a_l P - z_l|), a_l the row of
 * the warp at the template's landmark, z_l the shape's own, lengths in h, rho as in (12).  A
 * landmark weighs as much as what the surfaces have to say at FEW particles, times the option's
 * weight. */
#include "optimize/fidelity_shape.h"

#include <math.h>

#include "geometry/vec3.h"
#include "initialize/anchors.h"

static const double particles_worth = 4;

static double weight_of(const apsm_fidelity *f, const fidelity_state *s)
{
    return f->cohort->anchors.weight * particles_worth * (double)s->n / (double)f->J;
}

static bool takes_part(const apsm_fidelity *f, size_t i, size_t l)
{
    return i != f->cohort->template_index && anchor_is_there(f->cohort, i, l);
}

/* r = (a_l P - z_l) / h; its length. */
static double residual(const apsm_fidelity *f, size_t i, size_t l, const double *P, double r[3])
{
    const double *a = f->anchors.W + l * f->J, *z = anchor_at(f->cohort, i, l);
    for (size_t c = 0; c < 3; c++) {
        r[c] = -z[c];
        for (size_t j = 0; j < f->J; j++) r[c] += a[j] * P[3 * j + c];
        r[c] /= f->h;
    }
    return vec3_norm(r);
}

void fidelity_value_landmarks(const apsm_fidelity *f, size_t i, fidelity_state *s)
{
    const double weight = f->anchors.nv > 0 ? weight_of(f, s) : 0;
    for (size_t l = 0; l < f->anchors.nv; l++) {
        double r[3];
        if (!takes_part(f, i, l)) continue;
        const double d = residual(f, i, l, s->P, r);
        const double scale = fmin(fmax(d, f->o.floor), f->o.ceiling);
        s->value += 0.5 * weight * (d * d / scale + scale);
    }
}

/* Its larger entries, times root, to w->system. */
static void put_row(const apsm_fidelity *f, const double *a, size_t c, double root,
                    fidelity_work *w)
{
    static const double least = 3e-3; /* of the largest */
    size_t n = 0;
    double most = 0;
    for (size_t j = 0; j < f->J; j++) most = fmax(most, fabs(a[j]));
    for (size_t j = 0; j < f->J; j++) {
        if (!(fabs(a[j]) > least * most)) continue;
        w->near[n] = (uint32_t)j;
        for (size_t e = 0; e < 2; e++)
            w->row[2 * n + e] = root * a[j] * w->tangent[6 * j + 3 * e + c];
        n++;
    }
    fidelity_system_put(f, n, w->near, w->row, &w->system);
}

/* One coordinate of one landmark: row_x = a_j t_x along the tangents t of particle j. */
static void add_row(const apsm_fidelity *f, const double *a, size_t c, double weight, double r,
                    fidelity_work *w)
{
    const size_t n = 2 * f->J;
    for (size_t x = 0; x < n; x++) {
        const double at_x = a[x / 2] * w->tangent[3 * x + c];
        w->g[x] += weight * r * at_x;
        for (size_t y = 0; y <= x && !w->sparse; y++)
            w->H[x * n + y] += weight * at_x * a[y / 2] * w->tangent[3 * y + c];
    }
    if (w->sparse) put_row(f, a, c, sqrt(weight), w);
}

void fidelity_add_landmarks(const apsm_fidelity *f, size_t i, const fidelity_state *s,
                            fidelity_work *w)
{
    const double weight = f->anchors.nv > 0 ? weight_of(f, s) : 0;
    for (size_t l = 0; l < f->anchors.nv; l++) {
        double r[3];
        if (!takes_part(f, i, l)) continue;
        const double d = residual(f, i, l, s->P, r);
        const double scale = fmin(fmax(d, f->o.floor), f->o.ceiling);
        for (size_t c = 0; c < 3; c++)
            add_row(f, f->anchors.W + l * f->J, c, weight / scale, r[c], w);
    }
}
