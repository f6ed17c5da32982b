/* Sampling loss of one shape; docs/method.md, "Sampling loss".
 *   b_r   R points near the surface, with weights g_r          p_j   J particles
 *   k_rj  = |b_r - p_j|
 *   w_rj  = exp(-k_rj / tau) / sum_j' exp(-k_rj' / tau)                                    (3)
 *   E_r   = (f(b_r) - D(b_r))^2,  g_r = c E_r / mean(E) + 1 - c                            (4), (5)
 *   L     = factor / (R J) sum_rj w_rj k_rj g_r                                            (6)
 *   dL/dp_j = factor / (R J) sum_r g_r w_rj (1 - (k_rj - kbar_r) / tau) (p_j - b_r) / k_rj (7)
 *   kbar_r = sum_j w_rj k_rj
 *
 * Only particles within cut tau of a point's nearest have a weight worth adding.  Particles and
 * points are sorted along Hilbert's curve; 8 particles in a row make a block, 16 points a group (64
 * in single precision), each with a bounding sphere.  A group meets the blocks that may hold such
 * particles; each of its points skips those that do not.  Sums run in an order that the input alone
 * decides.  In single precision: sampling_patch.c. */
#include "optimize/sampling_loss.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "core/exp.h"
#include "core/kernel.h"
#include "optimize/sampling_patch.h"

enum {
    LANES = 8,
    GROUP = 16,
    PATCH = SAMPLING_PATCH,
    MOST_BITS = 8,
    RADIX = 1 << (3 * MOST_BITS / 2)
};

apsm_sampling_options apsm_sampling_defaults(void)
{
    return (apsm_sampling_options){ .h = 0.0, APSM_OPTION_DEFAULTS(APSM_SAMPLING_OPTIONS) };
}

static double tau_of(const apsm_sampling_options *o)
{
    return o->tau_absolute > 0.0 ? o->tau_absolute : o->tau * o->h;
}

double apsm_sampling_factor(int norm, size_t J)
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
                         double e_factor, int norm, double *dL_df)
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
    double lo[3], extent; /* the curve's box */
    int bits;             /* of the curve's keys, an axis */
    sampling_patch patch; /* scratch in single precision */
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
        sampling_patch_lay_out(Jp, &c->patch, work + doubles + (ints + 1) / 2);
    }
    return doubles + (ints + 1) / 2 + sampling_patch_lay_out(Jp, NULL, NULL);
}

size_t apsm_sampling_work_size(size_t J, size_t R)
{
    return lay_out(J, R, NULL, NULL);
}

/* ---- the curve ---- */

APSM_KERNEL static bool all_finite(size_t n, const double *x)
{
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (size_t i = 0; i < n; i++) sum += x[i] - x[i]; /* 0, or NaN */
    return sum == 0.0;
}

/* Widens the box lo, hi to hold X (n x 3). */
APSM_KERNEL static void widen(size_t n, const double *restrict X, double lo[3], double hi[3])
{
    double a = lo[0], b = lo[1], c = lo[2], d = hi[0], e = hi[1], f = hi[2];
#pragma omp simd reduction(min : a, b, c) reduction(max : d, e, f)
    for (size_t i = 0; i < n; i++) {
        const double x = X[3 * i], y = X[3 * i + 1], z = X[3 * i + 2];
        a = x < a ? x : a;
        b = y < b ? y : b;
        c = z < c ? z : c;
        d = x > d ? x : d;
        e = y > e ? y : e;
        f = z > f ? z : f;
    }
    memcpy(lo, (double[3]){ a, b, c }, 3 * sizeof *lo);
    memcpy(hi, (double[3]){ d, e, f }, 3 * sizeof *hi);
}

/* The box of both sets, and keys so fine that a cell holds about two points. */
static void bound(cells *c, const double *P, const double *B)
{
    double hi[3];
    memcpy(c->lo, P, sizeof c->lo);
    memcpy(hi, P, sizeof hi);
    widen(c->J, P, c->lo, hi);
    widen(c->R, B, c->lo, hi);
    c->extent = fmax(hi[0] - c->lo[0], fmax(hi[1] - c->lo[1], hi[2] - c->lo[2]));
    c->bits = 3;
    while (c->bits < MOST_BITS && (size_t)2 << 2 * c->bits < c->R) c->bits++;
}

/* Steps along the three axes of some points. */
enum { CHUNK = 128 };
typedef struct steps {
    uint32_t x[CHUNK], y[CHUNK], z[CHUNK];
} steps;

KERNEL_INLINE uint32_t step_of(double x, double lo, double per_length, int32_t last)
{
    const int32_t i = (int32_t)((x - lo) * per_length);
    return (uint32_t)(i < last ? i : last);
}

KERNEL_INLINE void find_steps(const cells *c, size_t n, const double *restrict X, steps *restrict s)
{
    const int32_t last = (1 << c->bits) - 1;
    const double per_length = c->extent > 0.0 ? (last + 1) / c->extent : 0.0;
    const double x = c->lo[0], y = c->lo[1], z = c->lo[2];
#pragma omp simd
    for (size_t i = 0; i < n; i++) {
        s->x[i] = step_of(X[3 * i], x, per_length, last);
        s->y[i] = step_of(X[3 * i + 1], y, per_length, last);
        s->z[i] = step_of(X[3 * i + 2], z, per_length, last);
    }
}

/* Where the bit is set in u, inverts the lower bits of x; elsewhere swaps those of u and x. */
KERNEL_INLINE void turn(uint32_t bit, uint32_t *x, uint32_t *u)
{
    const uint32_t lower = bit - 1, set = (*u & bit) ? lower : 0, swap = (*x ^ *u) & (lower & ~set);
    *x ^= swap | set;
    *u ^= swap;
}

/* Spreads the bits to every third place. */
KERNEL_INLINE uint32_t spread(uint32_t x)
{
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

/* Places on Hilbert's curve: Skilling, "Programming the Hilbert curve", AIP Conf. Proc. 707, 2004.
 */
KERNEL_INLINE void find_places(int bits, size_t n, steps *restrict s, uint32_t *restrict key)
{
    for (uint32_t bit = (uint32_t)1 << (bits - 1); bit > 1; bit >>= 1) {
#pragma omp simd
        for (size_t i = 0; i < n; i++) {
            uint32_t x = s->x[i], y = s->y[i], z = s->z[i];
            x ^= (x & bit) ? bit - 1 : 0;
            turn(bit, &x, &y);
            turn(bit, &x, &z);
            s->x[i] = x;
            s->y[i] = y;
            s->z[i] = z;
        }
    }
#pragma omp simd
    for (size_t i = 0; i < n; i++) {
        const uint32_t x = s->x[i], y = s->y[i] ^ x, z = s->z[i] ^ y; /* Gray code */
        uint32_t above = z; /* parity of z's higher bits */
        above ^= above >> 1;
        above ^= above >> 2;
        above ^= above >> 4;
        above >>= 1;
        key[i] = spread(x ^ above) << 2 | spread(y ^ above) << 1 | spread(z ^ above);
    }
}

/* Places of X (n x 3) on the curve. */
APSM_KERNEL static void find_keys(const cells *c, size_t n, const double *restrict X,
                                  uint32_t *restrict key)
{
    steps s;
    for (size_t first = 0; first < n; first += CHUNK) {
        const size_t count = n - first < CHUNK ? n - first : CHUNK;
        find_steps(c, count, X + 3 * first, &s);
        find_places(c->bits, count, &s, key + first);
    }
}

/* One stable pass over the digit of so many bits at `shift`. */
static void radix_pass(size_t n, int shift, int bits, const uint32_t *key, const uint32_t *order,
                       uint32_t *key_out, uint32_t *order_out, uint32_t *count)
{
    const uint32_t digits = (uint32_t)1 << bits;
    memset(count, 0, digits * sizeof *count);
    for (size_t i = 0; i < n; i++) count[key[i] >> shift & (digits - 1)]++;
    for (uint32_t d = 0, sum = 0; d < digits; d++) {
        const uint32_t here = count[d];
        count[d] = sum;
        sum += here;
    }
    for (size_t i = 0; i < n; i++) {
        const uint32_t to = count[key[i] >> shift & (digits - 1)]++;
        key_out[to] = key[i];
        order_out[to] = order[i];
    }
}

/* order (n, out): X (n x 3) along the curve, ties by index. */
static void sort_along_curve(const cells *c, size_t n, const double *X, uint32_t *order)
{
    const int half = (3 * c->bits + 1) / 2;
    find_keys(c, n, X, c->key);
    for (size_t i = 0; i < n; i++) order[i] = (uint32_t)i;
    radix_pass(n, 0, half, c->key, order, c->key2, c->order2, c->count);
    radix_pass(n, half, half, c->key2, c->order2, c->key, order, c->count);
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
    const double far = c->lo[0] + 4.0 * (c->extent + reach);
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

/* The blocks (ascending, their number returned) with a sphere of which some part is within that
 * distance of m; d2 (nb, scratch): squared distances of their centres. */
APSM_KERNEL static size_t find_blocks(cells *c, const double m[3], double within,
                                      double *restrict d2)
{
    size_t found = 0;
    squared_distances(c->nb, c->nb, c->centre, m, d2);
    for (size_t b = 0; b < c->nb; b++) {
        const double r = within + c->radius[b];
        c->block[found] = (uint32_t)b;
        found += d2[b] <= r * r;
    }
    return found;
}

/* The distance from m of one of the particles nearest to it. */
APSM_KERNEL static double near_distance(cells *c, const double m[3])
{
    double *d2 = c->d2, least = INFINITY;
    size_t nearest = 0;
    squared_distances(c->nb, c->nb, c->centre, m, d2);
    for (size_t b = 0; b < c->nb; b++)
        if (d2[b] < d2[nearest]) nearest = b;
    squared_distances(LANES, c->Jp, c->p + nearest * LANES, m, d2);
    for (size_t i = 0; i < LANES; i++) least = fmin(least, d2[i]);
    return sqrt(least);
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

/* A point x and what (7) says of it. */
typedef struct puller {
    const double *x;
    double kbar, sharpness, g_over_sum;
} puller;

/* Adds a point's share of (7) and of the mass to one block. */
KERNEL_INLINE void pull(const puller *by, size_t Jp, const double *restrict p,
                        const double *restrict k, const double *restrict e, double *restrict grad)
{
    const double a = by->x[0], b = by->x[1], c = by->x[2], kbar = by->kbar;
    const double sharpness = by->sharpness, g_over_sum = by->g_over_sum;
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
    const puller by = { x, kbar, sharpness, g / sum };
    for (size_t i = 0; i < kept; i++) {
        const size_t first = (size_t)c->block[c->near[i]] * LANES;
        pull(&by, c->Jp, c->p + first, c->k + i * LANES, c->e + i * LANES, c->grad + first);
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

/* Groups of points; returns sum_r g_r kbar_r. */
static double do_points(cells *c, const double *B, const double *g, const apsm_sampling_options *o,
                        double *kbar)
{
    const double tau = tau_of(o), reach = o->cut_double * tau;
    double total = 0.0, X[3 * GROUP], weight[GROUP], k[GROUP], m[3];
    for (size_t first = 0; first < c->R; first += GROUP) {
        const size_t count = c->R - first < GROUP ? c->R - first : GROUP;
        const uint32_t *r = c->b_order + first;
        for (size_t i = 0; i < count; i++) {
            for (size_t a = 0; a < 3; a++) X[a * GROUP + i] = B[3 * (size_t)r[i] + a];
            weight[i] = g ? g[r[i]] : 1.0;
        }
        const double rho = bounding_sphere(count, GROUP, X, m);
        /* Every point's nearest is within near_distance + rho of it; a trifle more for rounding. */
        const double within = (near_distance(c, m) + 2.0 * rho + reach) * (1.0 + 1e-12);
        do_group(c, find_blocks(c, m, within, c->d2), count, X, weight, tau, reach, k);
        for (size_t i = 0; i < count; i++) {
            total += weight[i] * k[i];
            if (kbar) kbar[r[i]] = k[i];
        }
    }
    return total;
}

/* ---- single precision ---- */

/* The particles of the blocks, no fillers, that are nearer to m than within; their number. */
APSM_KERNEL static size_t find_particles(cells *c, size_t blocks, const double m[3], double within)
{
    size_t found = 0;
    for (size_t i = 0; i < blocks; i++) {
        const size_t first = (size_t)c->block[i] * LANES;
        double d2[LANES];
        squared_distances(LANES, c->Jp, c->p + first, m, d2);
        for (size_t l = 0; l < LANES; l++) {
            c->found[found] = (uint32_t)(first + l);
            found += (d2[l] <= within * within) & (first + l < c->J);
        }
    }
    return found;
}

/* Coordinates x (n, of those numbered in `of` if given), from m on, in a patch's units. */
static void convert(size_t n, const double *x, const uint32_t *of, double m, double per_unit,
                    float *to)
{
    for (size_t i = 0; i < n; i++) to[i] = (float)((x[of ? of[i] : i] - m) * per_unit);
}

/* Meets the points of the patch, in the sphere (m, rho), with the particles around.  Neighbouring
 * patches have similar kmin: the last one's, and a little more, is thought to bound them.  Where it
 * does not, it is doubled. */
static void meet(cells *c, const double m[3], double rho, double unit)
{
    sampling_patch *s = &c->patch;
    for (;; s->bound *= 2.0f) {
        const double within = (rho + (double)(s->bound + s->reach) * unit) * (1.0 + 1e-5);
        s->found = find_particles(c, find_blocks(c, m, within, c->d2), m, within);
        for (size_t a = 0; a < 3; a++)
            convert(s->found, c->p + a * c->Jp, c->found, m[a], 1.0 / unit, s->p[a]);
        if (sampling_patch_run(s)) break;
    }
    s->bound = s->most > 1.0f ? 1.25f * s->most : 1.25f;
}

/* As do_points, in patches. */
static double do_patches(cells *c, const double *B, const double *g, const apsm_sampling_options *o,
                         double *kbar)
{
    const double ln2 = 0x1.62e42fefa39efp-1, unit = tau_of(o) * ln2;
    sampling_patch *s = &c->patch;
    double total = 0.0, X[3 * PATCH], m[3];
    s->reach = s->bound = (float)(o->cut_single / ln2);
    for (size_t first = 0; first < c->R; first += PATCH) {
        const uint32_t *r = c->b_order + first;
        s->count = c->R - first < PATCH ? c->R - first : PATCH;
        for (size_t i = 0; i < s->count; i++) {
            for (size_t a = 0; a < 3; a++) X[a * PATCH + i] = B[3 * (size_t)r[i] + a];
            s->g[i] = g ? (float)g[r[i]] : 1.0f;
        }
        const double rho = bounding_sphere(s->count, PATCH, X, m);
        for (size_t a = 0; a < 3; a++)
            convert(s->count, X + a * PATCH, NULL, m[a], 1.0 / unit, s->x[a]);
        meet(c, m, rho, unit);
        for (size_t i = 0; i < s->found; i++)
            for (size_t a = 0; a < 4; a++)
                c->grad[a * c->Jp + c->found[i]] += (double)s->grad[i][a];
        for (size_t i = 0; i < s->count; i++) {
            const double k = unit * (double)s->kbar[i];
            total += (g ? g[r[i]] : 1.0) * k;
            if (kbar) kbar[r[i]] = k;
        }
    }
    return total;
}

/* ---- the loss ---- */

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

apsm_status apsm_sampling_loss(const apsm_sampling_points *in, const apsm_sampling_options *opt,
                               const apsm_sampling_result *out, double *work)
{
    const size_t J = in->J, R = in->R;
    const double *P = in->P, *B = in->B, *g = in->g;
    if (J < 1 || R < 1 || J > UINT32_MAX / 2 || R > UINT32_MAX / 2) return APSM_ERR_ARG;
    const double tau = tau_of(opt);
    const bool single = opt->precision == APSM_PRECISION_SINGLE;
    const double cut = single ? opt->cut_single : opt->cut_double;
    if (!(tau > 0.0) || !isfinite(tau)) return APSM_ERR_ARG;
    if (!(cut > 0.0 && cut <= (single ? 87.0 : 700.0))) return APSM_ERR_ARG;
    if (!all_finite(3 * J, P) || !all_finite(3 * R, B)) return APSM_ERR_NONFINITE;
    if (g && !all_finite(R, g)) return APSM_ERR_NONFINITE;
    const double reach = cut * tau;
    const double scale = apsm_sampling_factor(opt->sampling_scale, J) / ((double)R * (double)J);
    cells c;
    lay_out(J, R, &c, work);
    bound(&c, P, B);
    make_blocks(&c, P, reach);
    sort_along_curve(&c, R, B, c.b_order);
    memset(c.grad, 0, 4 * c.Jp * sizeof *c.grad);
    const double total =
        single ? do_patches(&c, B, g, opt, out->kbar) : do_points(&c, B, g, opt, out->kbar);
    hand_out(&c, scale, out->grad, out->mass);
    if (out->loss) *out->loss = scale * total;
    return isfinite(total) ? APSM_OK : APSM_ERR_NONFINITE;
}
