/* The step of (12), -H^-1 g.
 *
 * Of many particles each hangs on those around it: put in order along the longest axis of the
 * template, most of H lies in a band.  Conjugate gradients with the band's factor as preconditioner
 * reach H's own solution in a few rounds, and need of H its products alone.  What the band loses
 * goes in part to its diagonal, so that it stays definite.  The modes of the prior, H = B - prior
 * U'U, are no band; B's inverse gets their part by Woodbury's formula.  Where that fails, H as a
 * whole is formed and factored. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/affine.h"
#include "linalg/linalg.h"
#include "optimize/fidelity_shape.h"

/* ---- order ---- */

typedef struct place {
    double at;
    uint32_t particle;
} place;

static int by_place(const void *a, const void *b)
{
    const place *x = a, *y = b;
    if (x->at != y->at) return x->at < y->at ? -1 : 1;
    return (x->particle > y->particle) - (x->particle < y->particle);
}

/* A fixed number of rings of some sqrt(J) particles: a wider band takes longer to factor, a
 * narrower one more rounds. */
static double particles_in_band(size_t J)
{
    static const double rings = 5;
    return rings * sqrt((double)J);
}

apsm_status fidelity_find_band(size_t J, const double *T, uint32_t *order, size_t *band)
{
    double centre[3], V[9];
    *band = 0;
    apsm_principal_axes(J, T, centre, V);
    place *p = malloc(J * sizeof *p);
    if (!p) return APSM_ERR_MEMORY;
    for (size_t j = 0; j < J; j++) {
        const double *x = T + 3 * j;
        p[j] = (place){ x[0] * V[0] + x[1] * V[3] + x[2] * V[6], (uint32_t)j };
    }
    qsort(p, J, sizeof *p, by_place);
    for (size_t k = 0; k < J; k++) order[p[k].particle] = (uint32_t)k;
    free(p);
    if (2 * particles_in_band(J) <= (double)J) /* else nothing would be gained */
        *band = 2 * (size_t)particles_in_band(J) + 1;
    return APSM_OK;
}

/* ---- by the band ---- */

/* To the order of places, and back. */
static void to_places(const apsm_fidelity *f, double scale, const double *x, float *at)
{
    for (size_t k = 0; k < 2 * f->J; k++)
        at[2 * (size_t)f->place[k / 2] + k % 2] = (float)(scale * x[k]);
}

static void from_places(const apsm_fidelity *f, const float *at, double *x)
{
    for (size_t k = 0; k < 2 * f->J; k++) x[k] = (double)at[2 * (size_t)f->place[k / 2] + k % 2];
}

static double dot(size_t n, const float *a, const float *b)
{
    double sum[4] = { 0 };
    for (size_t k = 0; k < n; k++) sum[k % 4] += (double)a[k] * (double)b[k];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static void add_scaled(size_t n, double t, const float *a, float *b)
{
    for (size_t k = 0; k < n; k++) b[k] += (float)(t * (double)a[k]);
}

/* z = B^-1 r */
static void solve_band(const apsm_fidelity *f, const float *band, const float *r, float *z)
{
    memcpy(z, r, 2 * f->J * sizeof *z);
    apsm_band_solve_f32(2 * f->J, f->band, band, z);
}

/* What the modes are in rounded numbers: U, Z = B^-1 U, and the factor of 1 / prior - U Z'. */
typedef struct band_modes {
    size_t M;
    double prior;
    float *U, *Z;
    double *K, *s;
} band_modes;

static apsm_status make_modes(const apsm_fidelity *f, const fidelity_work *w, band_modes *m)
{
    const size_t n = 2 * f->J, M = m->M;
    for (size_t a = 0; a < M; a++) {
        to_places(f, 1, w->tangent_mode + a * n, m->U + a * n);
        solve_band(f, w->band, m->U + a * n, m->Z + a * n);
    }
    for (size_t a = 0; a < M; a++)
        for (size_t b = 0; b <= a; b++)
            m->K[a * M + b] = (a == b ? 1 / m->prior : 0) - dot(n, m->U + a * n, m->Z + b * n);
    return apsm_cholesky(M, m->K);
}

/* z = (B - prior U'U)^-1 r */
static void precondition(const apsm_fidelity *f, const fidelity_work *w, const band_modes *m,
                         const float *r, float *z)
{
    const size_t n = 2 * f->J;
    solve_band(f, w->band, r, z);
    for (size_t a = 0; a < m->M; a++) m->s[a] = dot(n, m->Z + a * n, r);
    apsm_cholesky_solve(m->M, m->K, 1, m->s);
    for (size_t a = 0; a < m->M; a++) add_scaled(n, m->s[a], m->Z + a * n, z);
}

/* y = H x */
static void multiply(const apsm_fidelity *f, const fidelity_work *w, const band_modes *m,
                     const float *x, float *y)
{
    const size_t n = 2 * f->J;
    fidelity_system_multiply(f, &w->system, x, y);
    for (size_t a = 0; a < m->M; a++)
        add_scaled(n, -m->prior * dot(n, m->U + a * n, x), m->U + a * n, y);
}

/* Conjugate gradients from 0; r: right side, x: solution; v: 3n.  False if they take too long. */
static bool iterate(const apsm_fidelity *f, const fidelity_work *w, const band_modes *m, float *r,
                    float *x, float *v)
{
    enum { MOST = 30 };
    static const double least = 1e-4;
    const size_t n = 2 * f->J;
    float *z = v, *p = v + n, *Hp = v + 2 * n;
    memset(x, 0, n * sizeof *x);
    precondition(f, w, m, r, z);
    memcpy(p, z, n * sizeof *p);
    const double first = dot(n, r, z);
    double now = first;
    for (int k = 0; k < MOST && now > least * least * first; k++) {
        multiply(f, w, m, p, Hp);
        const double bend = dot(n, p, Hp), before = now;
        if (!(bend > 0) || !(now > 0)) return false;
        add_scaled(n, now / bend, p, x);
        add_scaled(n, -now / bend, Hp, r);
        precondition(f, w, m, r, z);
        now = dot(n, r, z);
        for (size_t e = 0; e < n; e++) p[e] = (float)((double)z[e] + now / before * (double)p[e]);
    }
    return now <= least * least * first; /* also where it is no number */
}

static bool solve_by_band(const apsm_fidelity *f, const fidelity_weights *q, fidelity_work *w)
{
    const size_t n = 2 * f->J, M = q->prior > 0 ? q->modes : 0;
    float *r = w->rows, *x = r + n, *v = x + n, *U = v + 3 * n;
    band_modes m = { M, q->prior, U, U + M * n, w->K, w->row };
    if (f->band == 0 || 5 + 2 * M > FIDELITY_ROWS || M > 8 * f->J) return false;
    fidelity_system_band(f, &w->system, w->band);
    if (apsm_band_cholesky_f32(n, f->band, w->band) != APSM_OK) return false;
    if (M > 0 && make_modes(f, w, &m) != APSM_OK) return false;
    to_places(f, -1, w->g, r);
    if (!iterate(f, w, &m, r, x, v)) return false;
    from_places(f, x, w->g);
    return true;
}

/* ---- as a whole ---- */

static apsm_status solve_whole(size_t n, double *H, double *x)
{
    APSM_TRY(apsm_cholesky(n, H));
    apsm_cholesky_solve(n, H, 1, x);
    return APSM_OK;
}

/* Where no band will do: in the order of places, too. */
static apsm_status solve_formed(const apsm_fidelity *f, const fidelity_weights *q, fidelity_work *w)
{
    const size_t n = 2 * f->J, modes = q->prior > 0 ? q->modes : 0;
    float *u = w->rows;
    double *x = w->row;
    if (!w->H) w->H = malloc(n * n * sizeof *w->H);
    if (!w->H) return w->status = APSM_ERR_MEMORY;
    fidelity_system_form(f, &w->system, w->H);
    for (size_t m = 0; m < modes; m++) {
        to_places(f, 1, w->tangent_mode + m * n, u);
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b <= a; b++)
                w->H[a * n + b] -= q->prior * (double)u[a] * (double)u[b];
    }
    to_places(f, -1, w->g, u);
    for (size_t k = 0; k < n; k++) x[k] = (double)u[k];
    APSM_TRY(solve_whole(n, w->H, x));
    for (size_t k = 0; k < n; k++) u[k] = (float)x[k];
    from_places(f, u, w->g);
    return APSM_OK;
}

apsm_status fidelity_solve(const apsm_fidelity *f, const fidelity_weights *q, fidelity_work *w)
{
    const size_t n = 2 * f->J;
    if (w->sparse) return solve_by_band(f, q, w) ? APSM_OK : solve_formed(f, q, w);
    for (size_t x = 0; x < n; x++) w->g[x] = -w->g[x];
    return solve_whole(n, w->H, w->g);
}
