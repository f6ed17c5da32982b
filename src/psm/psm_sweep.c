/* The sampling term of `psm`; docs/method.md, "Comparison methods".
 *   p(x) = sum_j w_j exp(-|x - x_j|^2 / 2 sigma^2)   over the neighbours j of the particle
 *   d log p / dx = -(1 / p sigma^2) sum_j w_j exp(..) (x - x_j)
 * sigma is the particle's own, of greatest likelihood; weights w_j fall off for neighbours whose
 * normals point elsewhere, so that the far side of a thin sheet does not count.  Neighbours are
 * those within 3.9 sigma of the last pass (ShapeWorks: 1.3 times the truncation at 3 sigma).
 *
 * A move is -step * (sampling gradient + rel correspondence gradient, in the tangent plane), at
 * most sigma / 10 long, then the closest point of the surface.  It is judged by ShapeWorks' energy
 *     E = p / 2 sigma^2 + rel y' C y
 * (C: the particle's block of Y' C^-2 Y, as the pass began): if E falls the step grows by a tenth,
 * else it shrinks by a tenth and is tried again, down to the least step, which is made anyway.  E
 * is not the integral of the gradient: near rest it weighs the correspondence ten times as much
 * and thus lets through what brings shapes together.  With an exact energy (log p, and an upper
 * bound of H(Z)) the default regularisation left the tali's generalization at 1.35 mm where
 * this gives 0.72 and ShapeWorks itself 0.81. */
#include "psm/psm_sweep.h"

#include <math.h>

#include "core/exp.h"
#include "core/kernel.h"
#include "geometry/vec3.h"

static const double reach = 3.9;      /* of a neighbourhood, in sigma */
static const double move_limit = 0.1; /* longest move, in sigma */
static const double factor = 1.1;     /* by which steps grow and shrink */
static const double step_limit = 1e12;
static const double flat_cutoff = 0.3; /* cosine of normals up to which a neighbour counts fully */
static const double out_of_sight = 1e-5;

/* Scratch for one shape, J each. */
typedef struct sweep {
    const apsm_shape *shape;
    const psm_particles *at;
    const psm_pull *pull;
    psm_measure by;
    double *X, *Y, *Z; /* the particles, coordinate by coordinate */
    double *all;       /* squared distances of all */
    /* the neighbours of the current particle */
    size_t n;
    double *x, *y, *z, *w, *d2, *q;
} sweep;

size_t psm_sweep_work_size(size_t J)
{
    return 10 * J;
}

/* ---- kernel width ---- */

typedef struct moments {
    double A, B, C; /* sums of q, d^2 q, d^4 q with q = w exp(-d^2 / 2 s) */
} moments;

APSM_KERNEL
static void kernel_values(size_t n, const double *d2, const double *w, double s, double *q)
{
    const double c = -0.5 / s;
    for (size_t j = 0; j < n; j++) q[j] = w[j] * apsm_exp(c * d2[j]);
}

static moments moments_at(size_t n, const double *d2, const double *w, double s)
{
    enum { CHUNK = 64 };
    double q[CHUNK];
    moments m = { 0 };
    for (size_t first = 0; first < n; first += CHUNK) {
        const size_t size = n - first < CHUNK ? n - first : CHUNK;
        kernel_values(size, d2 + first, w + first, s, q);
        for (size_t j = 0; j < size; j++) {
            const double d = d2[first + j];
            m.A += q[j];
            m.B += d * q[j];
            m.C += d * d * q[j];
        }
    }
    return m;
}

/* With s = sigma^2 and <.> the mean under q: F(s) = s - <d^2> / 3, F' = 1 - var(d^2) / 6 s^2. */
double psm_kernel_width(size_t n, const double *d2, const double *w, double start)
{
    enum { MOST = 50 };
    const double precision = 1e-5, least_slope = 0.2;
    double s = start * start;
    for (int k = 0; k < MOST; k++) {
        const moments m = moments_at(n, d2, w, s);
        if (!(m.A > out_of_sight)) return 0;
        const double mean = m.B / m.A, variance = m.C / m.A - mean * mean;
        const double slope = 1 - variance / (6 * s * s);
        const double newton = slope > least_slope ? s - (s - mean / 3) / slope : mean / 3;
        const double next = fmin(fmax(newton, s / 4), 4 * s);
        const bool done = fabs(next - s) <= 2 * precision * s;
        s = next;
        if (done) break;
    }
    return sqrt(s);
}

/* ---- neighbours ---- */

APSM_KERNEL
static void squared_distances(size_t J, const double *X, const double *Y, const double *Z,
                              const double p[3], double *d2)
{
    for (size_t j = 0; j < J; j++) {
        const double x = X[j] - p[0], y = Y[j] - p[1], z = Z[j] - p[2];
        d2[j] = x * x + y * y + z * z;
    }
}

/* 1 for normals that agree, falling to 0 for opposite ones. */
static double agreement(const double a[3], const double b[3])
{
    const double half_pi = 1.5707963267948966, cosine = fmax(vec3_dot(a, b), -1);
    if (cosine >= flat_cutoff) return 1;
    return cos((flat_cutoff - cosine) / (1 + flat_cutoff) * half_pi);
}

static void gather(sweep *s, size_t k, double radius)
{
    const double *N = s->at->N, r2 = radius * radius;
    s->n = 0;
    for (size_t j = 0; j < s->at->J; j++) {
        if (s->all[j] >= r2 || j == k) continue;
        const size_t n = s->n++;
        s->x[n] = s->X[j];
        s->y[n] = s->Y[j];
        s->z[n] = s->Z[j];
        s->d2[n] = s->all[j];
        s->w[n] = agreement(N + 3 * k, N + 3 * j);
    }
}

static double nearest(const sweep *s, size_t k)
{
    double best = INFINITY;
    for (size_t j = 0; j < s->at->J; j++)
        if (j != k && s->all[j] < best) best = s->all[j];
    return sqrt(best);
}

/* Gathers the neighbours of particle k and renews its width.  The mean with the last width keeps it
 * from changing too quickly. */
static double renew_width(sweep *s, size_t k)
{
    const double last = s->at->sigma[k], widest = s->by.longest / 3;
    double start = last > 0 ? last : fmax(nearest(s, k), 1e-9 * s->by.longest);
    double sigma = 0;
    while (!(sigma > 0) && start < widest) {
        gather(s, k, fmin(reach * start, s->by.longest));
        if (s->n) sigma = psm_kernel_width(s->n, s->d2, s->w, start);
        if (!(sigma > 0)) start *= 2;
    }
    if (!(sigma > 0) || sigma > s->by.longest) {
        sigma = widest;
        gather(s, k, s->by.longest);
    }
    if (last > 0) sigma = 0.5 * (last + sigma);
    return s->at->sigma[k] = sigma;
}

/* ---- energy and move ---- */

APSM_KERNEL
static void gaussians(size_t n, const double *d2, double s, double *q)
{
    const double c = -0.5 / s;
    for (size_t j = 0; j < n; j++) q[j] = apsm_exp(c * d2[j]);
}

/* p(x) = sum over j of exp(..), and that of w_j exp(..) (x - x_j) if gradient is wanted: a
 * neighbour that looks another way counts, but does not push. */
static double density(const sweep *s, const double x[3], double sigma, double *gradient)
{
    double p = 0, g[3] = { 0, 0, 0 };
    squared_distances(s->n, s->x, s->y, s->z, x, s->d2);
    gaussians(s->n, s->d2, sigma * sigma, s->q);
    for (size_t j = 0; j < s->n; j++) {
        const double q = s->w[j] * s->q[j];
        p += s->q[j];
        g[0] += q * (x[0] - s->x[j]);
        g[1] += q * (x[1] - s->y[j]);
        g[2] += q * (x[2] - s->z[j]);
    }
    for (int a = 0; a < 3 && gradient; a++) gradient[a] = g[a];
    return p;
}

/* The gradient of E in the tangent plane at particle k; returns p. */
static double tangent_gradient(const sweep *s, size_t k, double sigma, const double pull[3],
                               double gradient[3])
{
    const double *n = s->at->N + 3 * k;
    double sum[3];
    const double p = density(s, s->at->P + 3 * k, sigma, sum);
    const double c = p > 0 ? -s->by.sampling / (p * sigma * sigma) : 0;
    for (int a = 0; a < 3; a++) gradient[a] = c * sum[a] + pull[a];
    vec3_add_scaled(gradient, -vec3_dot(gradient, n), n);
    return p;
}

/* Takes particle k to the surface point `to`. */
static void settle(sweep *s, size_t k, const apsm_closest *to)
{
    double *P = s->at->P + 3 * k;
    for (int a = 0; a < 3; a++) P[a] = to->x[a];
    s->X[k] = P[0];
    s->Y[k] = P[1];
    s->Z[k] = P[2];
    apsm_surface_normal(&s->shape->mesh, s->shape->VN, &to->on, s->at->N + 3 * k);
}

/* E of particle k at x. */
static double energy(const sweep *s, size_t k, const double x[3], double sigma)
{
    const double *L = s->pull->L, *C = s->pull->C + 9 * k, *P = s->at->P + 3 * k;
    const double width = sigma / s->by.unit;
    double d[3], y[3], Cy[3];
    vec3_sub(x, P, d);
    for (int a = 0; a < 3; a++) y[a] = s->pull->Y[3 * k + (size_t)a] + vec3_dot(L + 3 * a, d);
    for (int a = 0; a < 3; a++) Cy[a] = vec3_dot(C + 3 * a, y);
    return density(s, x, sigma, NULL) / (2 * width * width) + s->pull->rel * vec3_dot(y, Cy);
}

/* The step after a refused move: so much smaller that the move is another one. */
static double back_off(double step, double longest_step, double least_step)
{
    do step /= factor;
    while (step > longest_step && step > least_step);
    return step;
}

/* Moves particle k along -gradient of this length; returns how far. */
static double descend(sweep *s, size_t k, double sigma, const double gradient[3], double slope)
{
    const double *P = s->at->P + 3 * k, before = energy(s, k, P, sigma);
    const double most = move_limit * sigma / slope,
                 least = s->by.least_step * s->by.unit * s->by.unit;
    double *step = &s->at->step[k];
    *step = fmin(fmax(*step, least), step_limit * s->by.unit * s->by.unit);
    for (;;) {
        const double used = fmin(*step, most), length = used * slope;
        double x[3];
        apsm_closest to;
        for (int a = 0; a < 3; a++) x[a] = P[a] - used * gradient[a];
        apsm_bvh_closest(s->shape->bvh, x, 4 * length * length, &to);
        if (!isfinite(to.distance2)) return 0; /* the move is lost in rounding */
        const bool better = energy(s, k, to.x, sigma) < before;
        if (better) *step *= factor;
        if (better || !(*step > least)) {
            const double moved = sqrt(vec3_distance2(to.x, P));
            settle(s, k, &to);
            return moved;
        }
        *step = back_off(*step, most, least);
    }
}

static double move(sweep *s, size_t k, psm_sweep_record *r)
{
    double gradient[3];
    squared_distances(s->at->J, s->X, s->Y, s->Z, s->at->P + 3 * k, s->all);
    const double sigma = renew_width(s, k);
    const double p = tangent_gradient(s, k, sigma, s->pull->g + 3 * k, gradient);
    const double slope = vec3_norm(gradient);
    if (p > 0) r->log_density += log(p) - 3 * log(sigma);
    return slope > 0 && isfinite(slope) ? descend(s, k, sigma, gradient, slope) : 0;
}

psm_sweep_record psm_sweep(const apsm_shape *shape, const psm_measure *measure,
                           const psm_pull *pull, const psm_particles *particles, double *work)
{
    const size_t J = particles->J;
    psm_sweep_record r = { 0, 0 };
    sweep s = { .shape = shape, .at = particles, .pull = pull, .by = *measure };
    double **const arrays[] = { &s.X, &s.Y, &s.Z, &s.all, &s.x, &s.y, &s.z, &s.w, &s.d2, &s.q };
    for (size_t a = 0; a < sizeof arrays / sizeof arrays[0]; a++) *arrays[a] = work + a * J;
    for (size_t k = 0; k < J; k++) {
        s.X[k] = particles->P[3 * k];
        s.Y[k] = particles->P[3 * k + 1];
        s.Z[k] = particles->P[3 * k + 2];
    }
    for (size_t k = 0; k < J; k++) r.move += move(&s, k, &r);
    r.log_density /= (double)J;
    r.move /= (double)J;
    return r;
}
