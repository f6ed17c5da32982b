/* Sampling loss of one shape; METHOD 2.
 *   b_r   R points near the surface, with weights g_r          p_j   J particles
 *   k_rj  = |b_r - p_j|
 *   w_rj  = exp(-k_rj / tau) / sum_j' exp(-k_rj' / tau)                                    (3)
 *   E_r   = (f(b_r) - D(b_r))^2,  g_r = c E_r / mean(E) + 1 - c                            (4), (5)
 *   L     = factor / (R J) sum_rj w_rj k_rj g_r                                            (6)
 *   dL/dp_j = factor / (R J) sum_r g_r w_rj (1 - (k_rj - kbar_r) / tau) (p_j - b_r) / k_rj (7)
 *   kbar_r = sum_j w_rj k_rj
 *
 * Only particles within cut tau of a point's nearest have a weight worth adding.  Particles and
 * points are sorted along a Morton curve; 8 particles in a row make a block, 16 points a group,
 * each with a bounding sphere.  A group meets the blocks that may hold such particles; in double
 * each of its points skips the blocks that do not, in single precision the group skips the
 * particles that do not matter to it.  Sums run in an order that the input alone decides. */
#include "apsm/sampling_loss.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "core/exp.h"
#include "core/kernel.h"
#include "optimize/sampling_group.h"

enum { LANES = 8, GROUP = SAMPLING_GROUP, AXIS_BITS = 7, RADIX_BITS = 11, RADIX = 1 << RADIX_BITS };

apsm_sampling_options apsm_sampling_defaults(void)
{
    return (apsm_sampling_options){ .norm = APSM_SAMPLING_VORONOI, .cut = 25.0 };
}

double apsm_sampling_factor(apsm_sampling_norm norm, size_t J)
{
    const double j = (double)J;
    return norm == APSM_SAMPLING_MEAN ? 1.0 : norm == APSM_SAMPLING_SUM ? j : j * j;
}

double apsm_sampling_weights(size_t R, const double *f, const double *D, double c, bool relative,
                             double *E, double *g)
{
    double sum = 0.0;
    for (size_t r = 0; r < R; r++) {
        E[r] = (f[r] - D[r]) * (f[r] - D[r]);
        sum += E[r];
    }
    const bool known = !relative || sum > 0.0;
    const double factor = !relative ? c : sum > 0.0 ? c * (double)R / sum : 0.0;
    for (size_t r = 0; r < R; r++) g[r] = known ? factor * E[r] + (1.0 - c) : 1.0;
    return factor;
}

void apsm_sampling_dL_df(size_t J, size_t R, const double *f, const double *D, const double *kbar,
                         double e_factor, apsm_sampling_norm norm, double *dL_df)
{
    const double scale = apsm_sampling_factor(norm, J) / ((double)R * (double)J) * 2.0 * e_factor;
    for (size_t r = 0; r < R; r++) dL_df[r] = scale * (f[r] - D[r]) * kbar[r];
}

/* ---- work ---- */

static size_t padded(size_t n)
{
    return (n + LANES - 1) / LANES * LANES;
}

/* All that the loop needs.  Jp = J padded to whole blocks, nb = Jp / 8 blocks. */
typedef struct cells {
    size_t J, Jp, nb, R;
    double *p;            /* 3 x Jp particles by columns, in the order of the curve */
    double *grad;         /* 4 x Jp: sums of (7), and of the mass, in that order */
    double *centre;       /* 3 x nb of blocks */
    double *radius;       /* nb */
    double *d2, *k, *e;   /* Jp each: one point against the blocks of its group */
    uint32_t *p_order;    /* Jp: which particle */
    uint32_t *b_order;    /* R: which point */
    uint32_t *key, *key2; /* max(J, R): scratch of the sort */
    uint32_t *order2;     /* max(J, R) */
    uint32_t *block;      /* nb: blocks of the group */
    uint32_t *near;       /* nb: which of these a point needs */
    uint32_t *found;      /* Jp: particles of a group */
    uint32_t *count;      /* RADIX */
    double lo[3], cell;   /* the curve's box */
    sampling_group group; /* scratch in single precision */
} cells;

/* Doubles of work; binds the arrays if c is given. */
static size_t lay_out(size_t J, size_t R, cells *c, double *work)
{
    const size_t Jp = padded(J), nb = Jp / LANES, most = J > R ? J : R;
    const size_t doubles = 10 * Jp + 4 * nb, ints = 2 * Jp + R + 3 * most + 2 * nb + RADIX;
    if (c) {
        *c = (cells){ .J = J, .Jp = Jp, .nb = nb, .R = R };
        c->p = work;
        c->grad = c->p + 3 * Jp;
        c->centre = c->grad + 4 * Jp;
        c->radius = c->centre + 3 * nb;
        c->d2 = c->radius + nb;
        c->k = c->d2 + Jp;
        c->e = c->k + Jp;
        c->p_order = (uint32_t *)(work + doubles);
        c->b_order = c->p_order + Jp;
        c->key = c->b_order + R;
        c->key2 = c->key + most;
        c->order2 = c->key2 + most;
        c->block = c->order2 + most;
        c->near = c->block + nb;
        c->found = c->near + nb;
        c->count = c->found + Jp;
        sampling_group_lay_out(Jp, &c->group, work + doubles + (ints + 1) / 2);
    }
    return doubles + (ints + 1) / 2 + sampling_group_lay_out(Jp, NULL, NULL);
}

size_t apsm_sampling_work_size(size_t J, size_t R)
{
    return lay_out(J, R, NULL, NULL);
}

/* ---- the curve ---- */

static bool all_finite(size_t n, const double *x)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++) sum += x[i] - x[i]; /* 0, or NaN */
    return sum == 0.0;
}

/* The box of both sets. */
static void bound(cells *c, const double *P, const double *B)
{
    double hi[3], extent = 0.0;
    for (size_t a = 0; a < 3; a++) c->lo[a] = hi[a] = P[a];
    for (size_t i = 0; i < c->J + c->R; i++) {
        const double *x = i < c->J ? P + 3 * i : B + 3 * (i - c->J);
        for (size_t a = 0; a < 3; a++) {
            c->lo[a] = x[a] < c->lo[a] ? x[a] : c->lo[a];
            hi[a] = x[a] > hi[a] ? x[a] : hi[a];
        }
    }
    for (size_t a = 0; a < 3; a++) extent = fmax(extent, hi[a] - c->lo[a]);
    c->cell = extent / (1 << AXIS_BITS);
}

/* Spreads the bits to every third place. */
static uint32_t spread(uint32_t x)
{
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

static uint32_t curve_key(const cells *c, const double *x)
{
    uint32_t key = 0;
    for (size_t a = 0; a < 3; a++) {
        const double u = c->cell > 0.0 ? (x[a] - c->lo[a]) / c->cell : 0.0;
        const uint32_t i = u < (1 << AXIS_BITS) - 1 ? (uint32_t)u : (1 << AXIS_BITS) - 1;
        key |= spread(i) << a;
    }
    return key;
}

/* One stable pass over the digit at `shift`. */
static void radix_pass(size_t n, int shift, const uint32_t *key, const uint32_t *order,
                       uint32_t *key_out, uint32_t *order_out, uint32_t *count)
{
    memset(count, 0, RADIX * sizeof *count);
    for (size_t i = 0; i < n; i++) count[key[i] >> shift & (RADIX - 1)]++;
    for (uint32_t d = 0, sum = 0; d < RADIX; d++) {
        const uint32_t here = count[d];
        count[d] = sum;
        sum += here;
    }
    for (size_t i = 0; i < n; i++) {
        const uint32_t to = count[key[i] >> shift & (RADIX - 1)]++;
        key_out[to] = key[i];
        order_out[to] = order[i];
    }
}

/* order (n, out): X (n x 3) along the curve, ties by index. */
static void sort_along_curve(const cells *c, size_t n, const double *X, uint32_t *order)
{
    for (size_t i = 0; i < n; i++) {
        c->key[i] = curve_key(c, X + 3 * i);
        order[i] = (uint32_t)i;
    }
    radix_pass(n, 0, c->key, order, c->key2, c->order2, c->count);
    radix_pass(n, RADIX_BITS, c->key2, c->order2, c->key, order, c->count);
}

/* ---- blocks ---- */

/* Centre (of the box) and radius of count points given by columns with stride. */
static double bounding_sphere(size_t count, size_t stride, const double *x, double m[3])
{
    double radius2 = 0.0;
    for (size_t a = 0; a < 3; a++) {
        double lo = x[a * stride], hi = lo;
        for (size_t i = 1; i < count; i++) {
            const double at = x[a * stride + i];
            lo = at < lo ? at : lo;
            hi = at > hi ? at : hi;
        }
        m[a] = lo + 0.5 * (hi - lo);
    }
    for (size_t i = 0; i < count; i++) {
        const double dx = x[i] - m[0], dy = x[stride + i] - m[1], dz = x[2 * stride + i] - m[2];
        const double d2 = dx * dx + dy * dy + dz * dz;
        radius2 = d2 > radius2 ? d2 : radius2;
    }
    return sqrt(radius2);
}

/* Sorts the particles into blocks.  The last block is filled up with particles so far away that
 * they never count. */
static void make_blocks(cells *c, const double *P, double reach)
{
    const size_t Jp = c->Jp;
    const double far = c->lo[0] + 4.0 * (c->cell * (1 << AXIS_BITS) + reach);
    sort_along_curve(c, c->J, P, c->p_order);
    for (size_t i = 0; i < Jp; i++)
        for (size_t a = 0; a < 3; a++)
            c->p[a * Jp + i] = i < c->J ? P[3 * c->p_order[i] + a] : a == 0 ? far : c->lo[a];
    for (size_t b = 0; b < c->nb; b++) {
        const size_t first = b * LANES, count = c->J - first < LANES ? c->J - first : LANES;
        double m[3];
        c->radius[b] = bounding_sphere(count, Jp, c->p + first, m);
        for (size_t a = 0; a < 3; a++) c->centre[a * c->nb + b] = m[a];
    }
}

/* Squared distances of x from n points by columns. */
KERNEL_INLINE void squared_distances(size_t n, size_t stride, const double *restrict p,
                                     const double x[3], double *restrict d2)
{
    const double a = x[0], b = x[1], c = x[2];
#pragma omp simd
    for (size_t j = 0; j < n; j++) {
        const double dx = p[j] - a, dy = p[stride + j] - b, dz = p[2 * stride + j] - c;
        d2[j] = dx * dx + dy * dy + dz * dz;
    }
}

/* The blocks (ascending, their number returned) that may hold a particle within reach of the
 * nearest one, for any point of the sphere (m, rho); such particles are nearer to m than *within.
 */
APSM_KERNEL static size_t find_blocks(cells *c, const double m[3], double rho, double reach,
                                      double *within)
{
    double *d = c->d2, least = INFINITY;
    size_t nearest = 0, found = 0;
    squared_distances(c->nb, c->nb, c->centre, m, d);
    for (size_t b = 0; b < c->nb; b++)
        if (d[b] < d[nearest]) nearest = b;
    for (size_t i = 0; i < LANES; i++) {
        double d2;
        squared_distances(1, c->Jp, c->p + nearest * LANES + i, m, &d2);
        least = fmin(least, d2);
    }
    /* Every point's nearest is within sqrt(least) + rho; a trifle more for rounding. */
    *within = (sqrt(least) + 2.0 * rho + reach) * (1.0 + 1e-12);
    for (size_t b = 0; b < c->nb; b++) {
        const double r = *within + c->radius[b];
        c->block[found] = (uint32_t)b;
        found += d[b] <= r * r;
    }
    return found;
}

/* ---- one point ---- */

KERNEL_INLINE double lesser(double a, double b)
{
    return a < b ? a : b;
}

KERNEL_INLINE double sum_lanes(const double v[LANES])
{
    return ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
}

/* Squared distances of x to the blocks' particles into d2, block by block; returns the least. */
KERNEL_INLINE double distances(const cells *c, size_t found, const double x[3])
{
    double least[LANES];
    for (size_t l = 0; l < LANES; l++) least[l] = INFINITY;
    for (size_t i = 0; i < found; i++) {
        double *d2 = c->d2 + i * LANES;
        squared_distances(LANES, c->Jp, c->p + (size_t)c->block[i] * LANES, x, d2);
#pragma omp simd
        for (size_t l = 0; l < LANES; l++) least[l] = d2[l] < least[l] ? d2[l] : least[l];
    }
    for (size_t l = 1; l < LANES; l++) least[0] = least[l] < least[0] ? least[l] : least[0];
    return least[0];
}

/* near: which of the found blocks have a particle within sqrt(limit2); returns their number. */
KERNEL_INLINE size_t keep_near(const cells *c, size_t found, double limit2)
{
    size_t kept = 0;
    for (size_t i = 0; i < found; i++) {
        const double *d2 = c->d2 + i * LANES;
        const double a = lesser(d2[0], d2[4]), b = lesser(d2[1], d2[5]), e = lesser(d2[2], d2[6]),
                     f = lesser(d2[3], d2[7]);
        c->near[kept] = (uint32_t)i;
        kept += lesser(lesser(a, b), lesser(e, f)) <= limit2;
    }
    return kept;
}

/* k and unnormalised e of (3) for one block; adds to the lanes' sums of e and of e k. */
KERNEL_INLINE void soften(const double *restrict d2, double kmin, double reach, double sharpness,
                          double *restrict k, double *restrict e, double *restrict s0,
                          double *restrict s1)
{
#pragma omp simd
    for (size_t l = 0; l < LANES; l++) {
        const double r = sqrt(d2[l]), beyond = r - kmin, w = apsm_exp(-beyond * sharpness);
        const double v = beyond <= reach ? w : 0.0;
        k[l] = r;
        e[l] = v;
        s0[l] += v;
        s1[l] += v * r;
    }
}

/* Adds a point's share of (7) and of the mass to one block. */
KERNEL_INLINE void pull(size_t Jp, const double *restrict p, const double *restrict k,
                        const double *restrict e, const double x[3], double kbar, double sharpness,
                        double g_over_sum, double *restrict grad)
{
    const double a = x[0], b = x[1], c = x[2];
#pragma omp simd
    for (size_t l = 0; l < LANES; l++) {
        const double w = g_over_sum * e[l], r = k[l];
        const double t = w * (1.0 - (r - kbar) * sharpness);
        const double f = r > 0.0 ? t / r : 0.0;
        grad[l] += f * (p[l] - a);
        grad[Jp + l] += f * (p[Jp + l] - b);
        grad[2 * Jp + l] += f * (p[2 * Jp + l] - c);
        grad[3 * Jp + l] += w;
    }
}

/* One point x with weight g; returns its kbar. */
KERNEL_INLINE double do_point(const cells *c, size_t found, const double x[3], double g, double tau,
                              double reach)
{
    const double sharpness = 1.0 / tau;
    const double kmin = sqrt(distances(c, found, x)), limit = (kmin + reach) * (1.0 + 1e-12);
    const size_t kept = keep_near(c, found, limit * limit);
    double s0[LANES] = { 0 }, s1[LANES] = { 0 };
    for (size_t i = 0; i < kept; i++)
        soften(c->d2 + (size_t)c->near[i] * LANES, kmin, reach, sharpness, c->k + i * LANES,
               c->e + i * LANES, s0, s1);
    const double sum = sum_lanes(s0), kbar = sum_lanes(s1) / sum;
    for (size_t i = 0; i < kept; i++) {
        const size_t first = (size_t)c->block[c->near[i]] * LANES;
        pull(c->Jp, c->p + first, c->k + i * LANES, c->e + i * LANES, x, kbar, sharpness, g / sum,
             c->grad + first);
    }
    return kbar;
}

/* Points X (3 x GROUP by columns) with weights g; writes their kbar. */
APSM_KERNEL static void do_group(const cells *c, size_t found, size_t count,
                                 const double X[3 * GROUP], const double g[GROUP], double tau,
                                 double reach, double kbar[GROUP])
{
    for (size_t i = 0; i < count; i++) {
        const double x[3] = { X[i], X[GROUP + i], X[2 * GROUP + i] };
        kbar[i] = do_point(c, found, x, g[i], tau, reach);
    }
}

/* ---- a group in single precision ---- */

static float relative(double x, double centre)
{
    return (float)(x - centre);
}

/* The particles of the blocks that are nearer to m than within; returns their number. */
APSM_KERNEL static size_t find_particles(cells *c, size_t blocks, const double m[3], double within)
{
    size_t found = 0;
    for (size_t i = 0; i < blocks; i++) {
        const size_t first = (size_t)c->block[i] * LANES;
        double d2[LANES];
        squared_distances(LANES, c->Jp, c->p + first, m, d2);
        for (size_t l = 0; l < LANES; l++) {
            c->found[found] = (uint32_t)(first + l);
            found += d2[l] <= within * within;
        }
    }
    return found;
}

/* The group about the centre m. */
static void load_group(cells *c, size_t found, size_t count, const double X[3 * GROUP],
                       const double *g, const double m[3])
{
    sampling_group *s = &c->group;
    s->found = found;
    for (size_t q = 0; q < GROUP; q++) {
        const size_t from = q < count ? q : 0;
        s->g[q] = q < count ? (float)g[q] : 0.0f;
        for (size_t a = 0; a < 3; a++) s->x[a][q] = relative(X[a * GROUP + from], m[a]);
    }
    for (size_t i = 0; i < found; i++)
        for (size_t a = 0; a < 3; a++) s->p[i][a] = relative(c->p[a * c->Jp + c->found[i]], m[a]);
}

static void do_group_single(cells *c, size_t blocks, size_t count, const double X[3 * GROUP],
                            const double *g, const double m[3], double within,
                            const apsm_sampling_options *o, double *kbar)
{
    sampling_group *s = &c->group;
    const size_t found = find_particles(c, blocks, m, within);
    load_group(c, found, count, X, g, m);
    s->tau = (float)o->tau;
    s->reach = (float)(o->cut * o->tau);
    sampling_group_run(s);
    for (size_t i = 0; i < found; i++)
        for (size_t a = 0; a < 4; a++) c->grad[a * c->Jp + c->found[i]] += (double)s->grad[i][a];
    for (size_t q = 0; q < count; q++) kbar[q] = (double)s->kbar[q];
}

/* ---- the loss ---- */

/* All groups; returns sum_r g_r kbar_r. */
static double do_points(cells *c, const double *B, const double *g, const apsm_sampling_options *o,
                        double *kbar)
{
    const double reach = o->cut * o->tau;
    double total = 0.0, X[3 * GROUP], weight[GROUP], k[GROUP], m[3];
    for (size_t first = 0; first < c->R; first += GROUP) {
        const size_t count = c->R - first < GROUP ? c->R - first : GROUP;
        const uint32_t *r = c->b_order + first;
        for (size_t i = 0; i < count; i++) {
            for (size_t a = 0; a < 3; a++) X[a * GROUP + i] = B[3 * (size_t)r[i] + a];
            weight[i] = g ? g[r[i]] : 1.0;
        }
        const double rho = bounding_sphere(count, GROUP, X, m);
        double within;
        const size_t blocks = find_blocks(c, m, rho, reach, &within);
        if (o->single)
            do_group_single(c, blocks, count, X, weight, m, within, o, k);
        else
            do_group(c, blocks, count, X, weight, o->tau, reach, k);
        for (size_t i = 0; i < count; i++) {
            total += weight[i] * k[i];
            if (kbar) kbar[r[i]] = k[i];
        }
    }
    return total;
}

/* Back to the caller's order. */
static void hand_out(const cells *c, double scale, double *grad, double *mass)
{
    for (size_t i = 0; i < c->J; i++) {
        const size_t j = c->p_order[i];
        if (grad)
            for (size_t a = 0; a < 3; a++) grad[3 * j + a] = scale * c->grad[a * c->Jp + i];
        if (mass) mass[j] = c->grad[3 * c->Jp + i];
    }
}

apsm_status apsm_sampling_loss(size_t J, const double *P, size_t R, const double *B,
                               const double *g, const apsm_sampling_options *opt, double *loss,
                               double *grad, double *kbar, double *mass, double *work)
{
    if (J < 1 || R < 1 || J > UINT32_MAX / 2 || R > UINT32_MAX / 2) return APSM_ERR_ARG;
    if (!(opt->tau > 0.0) || !isfinite(opt->tau)) return APSM_ERR_ARG;
    if (!(opt->cut > 0.0 && opt->cut <= (opt->single ? 87.0 : 700.0))) return APSM_ERR_ARG;
    if (!all_finite(3 * J, P) || !all_finite(3 * R, B)) return APSM_ERR_NONFINITE;
    if (g && !all_finite(R, g)) return APSM_ERR_NONFINITE;
    const double reach = opt->cut * opt->tau;
    const double scale = apsm_sampling_factor(opt->norm, J) / ((double)R * (double)J);
    cells c;
    lay_out(J, R, &c, work);
    bound(&c, P, B);
    make_blocks(&c, P, reach);
    sort_along_curve(&c, R, B, c.b_order);
    memset(c.grad, 0, 4 * c.Jp * sizeof *c.grad);
    const double total = do_points(&c, B, g, opt, kbar);
    hand_out(&c, scale, grad, mass);
    if (loss) *loss = scale * total;
    return isfinite(total) ? APSM_OK : APSM_ERR_NONFINITE;
}
