/* The step of (12), -H^-1 g.
 *
 * Of many particles each hangs on those around it: put in order along the longest axis of the
 * template, nearly all of H lies in a band.  Its factor costs a fourth of H's, and conjugate
 * gradients with it as preconditioner reach H's own solution, to single precision, in a few
 * rounds.  What the band loses goes in part to its diagonal, so that it stays definite.  The modes
 * of the prior, H = B - prior U'U, are no band; B's inverse gets their part by Woodbury's formula.
 * Where that fails, H as a whole is factored. */
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

/* A particle reaches, by a vertex of the template between, to others some 7 h away: a fixed number
 * of rings of some sqrt(J) particles. */
static double particles_in_band(size_t J)
{
    static const double rings = 11;
    return rings * sqrt((double)J);
}

apsm_status fidelity_find_band(size_t J, const double *T, uint32_t *order, size_t *band)
{
    double centre[3], V[9];
    *band = 0;
    if (2 * particles_in_band(J) > (double)J) return APSM_OK; /* nothing would be gained */
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
    *band = 2 * (size_t)particles_in_band(J) + 1;
    return APSM_OK;
}

/* ---- by the band ---- */

/* The 2 x 2 block of particles at places a and b, rows of it n apart, to the band. */
static void put_block(size_t width, size_t a, size_t b, const float *block, size_t n, float *band)
{
    const size_t low = a < b ? a : b, high = a < b ? b : a;
    for (size_t r = 0; r < 2; r++)
        for (size_t c = 0; c < 2; c++) {
            const size_t x = 2 * low + (a < b ? r : c), y = 2 * high + (a < b ? c : r);
            if (y >= x) band[x * (width + 1) + (y - x)] = block[r * n + c];
        }
}

/* Rows of particle j in single precision, the block of its own in full. */
static void round_rows(size_t n, size_t j, const double *H, float *H32)
{
    for (size_t x = 2 * j; x < 2 * j + 2; x++)
        for (size_t y = 0; y <= x; y++) H32[x * n + y] = (float)H[x * n + y];
    H32[2 * j * n + 2 * j + 1] = H32[(2 * j + 1) * n + 2 * j];
}

/* H32 = H, its band w->band, and what that loses of a row (n), as sums of sizes. */
static void round_to_band(const apsm_fidelity *f, double *lost, fidelity_work *w)
{
    const size_t n = 2 * f->J, reach = f->band / 2;
    memset(w->band, 0, n * (f->band + 1) * sizeof *w->band);
    memset(lost, 0, n * sizeof *lost);
    for (size_t j = 0; j < f->J; j++) {
        round_rows(n, j, w->H, w->H32);
        for (size_t k = 0; k <= j; k++) {
            const size_t a = f->place[j], b = f->place[k];
            const float *block = w->H32 + 2 * j * n + 2 * k;
            if ((a < b ? b - a : a - b) <= reach) {
                put_block(f->band, a, b, block, n, w->band);
                continue;
            }
            for (size_t e = 0; e < 4; e++) {
                const double size = fabs((double)block[e / 2 * n + e % 2]);
                lost[2 * j + e / 2] += size;
                lost[2 * k + e % 2] += size;
            }
        }
    }
}

static void make_up(const apsm_fidelity *f, const double *lost, float *band)
{
    static const double share = 0.15;
    for (size_t x = 0; x < 2 * f->J; x++) {
        const size_t a = 2 * (size_t)f->place[x / 2] + x % 2;
        band[a * (f->band + 1)] += (float)(share * lost[x]);
    }
}

/* z = B^-1 r; t (n): scratch. */
static void solve_band(const apsm_fidelity *f, const float *band, const float *r, float *t,
                       float *z)
{
    const size_t J = f->J;
    for (size_t j = 0; j < J; j++) memcpy(t + 2 * f->place[j], r + 2 * j, 2 * sizeof *t);
    apsm_band_solve_f32(2 * J, f->band, band, t);
    for (size_t j = 0; j < J; j++) memcpy(z + 2 * j, t + 2 * f->place[j], 2 * sizeof *z);
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

/* What the modes are in rounded numbers: U, Z = B^-1 U, and the factor of 1 / prior - U Z'. */
typedef struct band_modes {
    size_t M;
    double prior;
    float *U, *Z;
    double *K, *s;
} band_modes;

static apsm_status make_modes(const apsm_fidelity *f, fidelity_work *w, band_modes *m, float *t)
{
    const size_t n = 2 * f->J, M = m->M;
    for (size_t x = 0; x < M * n; x++) m->U[x] = (float)w->tangent_mode[x];
    for (size_t a = 0; a < M; a++) solve_band(f, w->band, m->U + a * n, t, m->Z + a * n);
    for (size_t a = 0; a < M; a++)
        for (size_t b = 0; b <= a; b++)
            m->K[a * M + b] = (a == b ? 1 / m->prior : 0) - dot(n, m->U + a * n, m->Z + b * n);
    return apsm_cholesky(M, m->K);
}

/* z = (B - prior U'U)^-1 r */
static void precondition(const apsm_fidelity *f, const fidelity_work *w, const band_modes *m,
                         const float *r, float *t, float *z)
{
    const size_t n = 2 * f->J;
    solve_band(f, w->band, r, t, z);
    for (size_t a = 0; a < m->M; a++) m->s[a] = dot(n, m->Z + a * n, r);
    apsm_cholesky_solve(m->M, m->K, 1, m->s);
    for (size_t a = 0; a < m->M; a++) add_scaled(n, m->s[a], m->Z + a * n, z);
}

/* y = H x */
static void multiply(size_t n, const fidelity_work *w, const band_modes *m, const float *x,
                     float *y)
{
    apsm_symv_f32(n, w->H32, x, y);
    for (size_t a = 0; a < m->M; a++)
        add_scaled(n, -m->prior * dot(n, m->U + a * n, x), m->U + a * n, y);
}

/* Conjugate gradients from 0; r: right side, x: solution; v: 4n.  False if they take too long. */
static bool iterate(const apsm_fidelity *f, const fidelity_work *w, const band_modes *m, float *r,
                    float *x, float *v)
{
    enum { MOST = 30 };
    static const double least = 1e-5;
    const size_t n = 2 * f->J;
    float *z = v, *p = v + n, *Hp = v + 2 * n, *t = v + 3 * n;
    memset(x, 0, n * sizeof *x);
    precondition(f, w, m, r, t, z);
    memcpy(p, z, n * sizeof *p);
    const double first = dot(n, r, z);
    double now = first;
    for (int k = 0; k < MOST && now > least * least * first; k++) {
        multiply(n, w, m, p, Hp);
        const double bend = dot(n, p, Hp), before = now;
        if (!(bend > 0) || !(now > 0)) return false;
        add_scaled(n, now / bend, p, x);
        add_scaled(n, -now / bend, Hp, r);
        precondition(f, w, m, r, t, z);
        now = dot(n, r, z);
        for (size_t e = 0; e < n; e++) p[e] = (float)((double)z[e] + now / before * (double)p[e]);
    }
    return now <= least * least * first; /* also where it is no number */
}

static bool solve_by_band(const apsm_fidelity *f, const fidelity_weights *q, fidelity_work *w)
{
    const size_t n = 2 * f->J, M = q->prior > 0 ? q->modes : 0;
    float *r = w->rows, *x = r + n, *v = x + n, *U = v + 4 * n;
    band_modes m = { M, q->prior, U, U + M * n, w->K, w->row + n };
    if (6 + 2 * M > FIDELITY_ROWS) return false;
    round_to_band(f, w->row, w);
    make_up(f, w->row, w->band);
    if (apsm_band_cholesky_f32(n, f->band, w->band) != APSM_OK) return false;
    if (M > 0 && make_modes(f, w, &m, v) != APSM_OK) return false;
    for (size_t k = 0; k < n; k++) r[k] = (float)-w->g[k];
    if (!iterate(f, w, &m, r, x, v)) return false;
    for (size_t k = 0; k < n; k++) w->g[k] = (double)x[k];
    return true;
}

/* ---- as a whole ---- */

/* In single precision, which is enough where H itself is not known better. */
static apsm_status solve_f32(size_t n, fidelity_work *w)
{
    for (size_t x = 0; x < n; x++) {
        for (size_t y = 0; y <= x; y++) w->H32[x * n + y] = (float)w->H[x * n + y];
        w->rows[x] = (float)-w->g[x];
    }
    APSM_TRY(apsm_cholesky_f32(n, w->H32));
    apsm_cholesky_solve_f32(n, w->H32, 1, w->rows);
    for (size_t x = 0; x < n; x++) w->g[x] = (double)w->rows[x];
    return APSM_OK;
}

apsm_status fidelity_solve(const apsm_fidelity *f, const fidelity_weights *q, fidelity_work *w)
{
    const size_t n = 2 * f->J;
    if (f->band > 0) {
        if (solve_by_band(f, q, w)) return APSM_OK;
        fidelity_add_modes(f, q, w);
    }
    if (w->sparse && solve_f32(n, w) == APSM_OK) return APSM_OK;
    APSM_TRY(apsm_cholesky(n, w->H)); /* also where single precision took H for indefinite */
    for (size_t x = 0; x < n; x++) w->g[x] = -w->g[x];
    apsm_cholesky_solve(n, w->H, 1, w->g);
    return APSM_OK;
}
