/* Eigenvectors of a rank-one downdate  S = diag(d) - rho t t^T  (Golub, SIAM Review 15, 1973;
 * Bunch, Nielsen & Sorensen, Numer. Math. 31, 1978).  Its eigenvalues lambda_a interlace with d and
 * are the roots of the secular equation
 *   f(lambda) = 1 - rho sum_k t_k^2 / (d_k - lambda) = 0                                 (D1)
 * and eigenvector a is t_k / (d_k - lambda_a) up to its norm, q_a . t = 1 / (rho n_a) with
 *   n_a^2 = sum_k t_k^2 / (d_k - lambda_a)^2                                             (D2)
 * so that the residual of t after m eigenvectors needs no product of vectors:
 *   e_k = t_k g_k,   g_k = 1 - sum_{a <= m} 1 / (rho n_a^2 (d_k - lambda_a))              (D3)
 * Equal d are one pole whose weight is the sum of their t^2 (the vectors that remain are orthogonal
 * to t: silent modes); poles without weight keep their d as eigenvalue (Cuppen's deflation).
 * Roots are sought as offsets from the nearer pole, which keeps the differences d_k - lambda_a
 * accurate, and the weights are then replaced by those whose roots these are exactly (Gu &
 * Eisenstat, SIAM J. Matrix Anal. Appl. 15, 1994), which keeps the eigenvectors orthogonal. */
#include "evaluate/downdate.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#include "core/kernel.h"

enum { LANES = 4, ITERATIONS = 200 };

typedef struct silent {
    double d;     /* eigenvalue */
    size_t pole;  /* first entry of the cluster, if this mode takes its t away */
    bool removes; /* the last mode of a cluster without weight */
} silent;

struct apsm_downdate {
    size_t r;
    size_t *cluster; /* r: cluster of entry k */
    size_t *count;   /* r: entries of a cluster */
    size_t *active;  /* r: number of a cluster among the poles, or SIZE_MAX */
    double *centre;  /* r: d of a cluster */
    double *weight;  /* r: sum of its t^2 */
    double *pole;    /* r: d of the poles, descending; A of them */
    double *tau2;    /* r: their weights */
    double *exact;   /* r: their weights after Gu & Eisenstat */
    double *root;    /* r: lambda */
    double *delta;   /* r x r: row a, entry k: pole_k - lambda_a */
    double *g;       /* r: g of (D3) by cluster */
    double *t;       /* r: t after Gu & Eisenstat */
    silent *silent;  /* r */
};

void apsm_downdate_free(apsm_downdate *w)
{
    if (!w) return;
    free(w->cluster);
    free(w->count);
    free(w->active);
    free(w->centre);
    free(w->weight);
    free(w->pole);
    free(w->tau2);
    free(w->exact);
    free(w->root);
    free(w->delta);
    free(w->g);
    free(w->t);
    free(w->silent);
    free(w);
}

apsm_status apsm_downdate_new(size_t r, apsm_downdate **out)
{
    apsm_downdate *w = *out = calloc(1, sizeof *w);
    if (!w) return APSM_ERR_MEMORY;
    const size_t n = r ? r : 1;
    w->r = r;
    w->cluster = malloc(n * sizeof *w->cluster);
    w->count = malloc(n * sizeof *w->count);
    w->active = malloc(n * sizeof *w->active);
    w->centre = malloc(n * sizeof *w->centre);
    w->weight = malloc(n * sizeof *w->weight);
    w->pole = malloc(n * sizeof *w->pole);
    w->tau2 = malloc(n * sizeof *w->tau2);
    w->exact = malloc(n * sizeof *w->exact);
    w->root = malloc(n * sizeof *w->root);
    w->delta = malloc(n * n * sizeof *w->delta);
    w->g = malloc(n * sizeof *w->g);
    w->t = malloc(n * sizeof *w->t);
    w->silent = malloc(n * sizeof *w->silent);
    if (w->cluster && w->count && w->active && w->centre && w->weight && w->pole && w->tau2 &&
        w->exact && w->root && w->delta && w->g && w->t && w->silent)
        return APSM_OK;
    apsm_downdate_free(w);
    *out = NULL;
    return APSM_ERR_MEMORY;
}

/* Groups entries whose d agree to rounding; returns the number of clusters. */
static size_t make_clusters(apsm_downdate *w, const double *d, const double *t)
{
    const double tol = 16 * DBL_EPSILON * d[0];
    size_t n = 0;
    for (size_t k = 0; k < w->r; k++) {
        if (n == 0 || w->centre[n - 1] - d[k] > tol) {
            w->centre[n] = d[k];
            w->count[n] = 0;
            w->weight[n] = 0.0;
            n++;
        }
        w->cluster[k] = n - 1;
        w->count[n - 1]++;
        w->weight[n - 1] += t[k] * t[k];
    }
    return n;
}

/* Divides the clusters into poles of (D1) and clusters without weight, and lists the silent modes
 * (descending).  Returns the number of poles; *n_silent (out). */
static size_t make_poles(apsm_downdate *w, size_t clusters, double rho, double t2, size_t *n_silent)
{
    const double least = DBL_EPSILON * w->centre[0] / rho; /* of tau |t| */
    size_t A = 0, s = 0;
    for (size_t c = 0; c < clusters; c++) {
        const bool pole = sqrt(w->weight[c] * t2) > least;
        w->active[c] = pole ? A : SIZE_MAX;
        if (pole) {
            w->pole[A] = w->centre[c];
            w->tau2[A] = w->weight[c];
            A++;
        }
        for (size_t k = pole ? 1 : 0; k < w->count[c]; k++)
            w->silent[s++] = (silent){ w->centre[c], c, !pole && k + 1 == w->count[c] };
    }
    *n_silent = s;
    return A;
}

/* Sums tau2 / delta and tau2 / delta^2 over n poles, delta_k = (pole_k - base) - mu. */
APSM_KERNEL static void sum_poles(size_t n, const double *pole, const double *tau2, double base,
                                  double mu, double *sum, double *sum2)
{
    double s[LANES] = { 0 }, q[LANES] = { 0 };
    size_t k = 0;
    for (; k + LANES <= n; k += LANES)
        for (size_t l = 0; l < LANES; l++) {
            const double inverse = 1.0 / ((pole[k + l] - base) - mu), term = tau2[k + l] * inverse;
            s[l] += term;
            q[l] += term * inverse;
        }
    for (; k < n; k++) {
        const double inverse = 1.0 / ((pole[k] - base) - mu), term = tau2[k] * inverse;
        s[0] += term;
        q[0] += term * inverse;
    }
    *sum = (s[0] + s[2]) + (s[1] + s[3]);
    *sum2 = (q[0] + q[2]) + (q[1] + q[3]);
}

/* f of (D1) at base + mu, the derivatives of its sums over the poles above and below, and a bound
 * of its rounding error. */
typedef struct secular {
    double f, above1, below1, noise;
} secular;

/* The interval of one root: between pole a, and pole a + 1 unless it is the last. */
typedef struct interval {
    const apsm_downdate *w;
    size_t A, a;
    double rho, base;
} interval;

static secular secular_at(const interval *v, double mu)
{
    const double *pole = v->w->pole, *tau2 = v->w->tau2;
    const size_t up = v->a + 1;
    double above, above2, below, below2;
    sum_poles(up, pole, tau2, v->base, mu, &above, &above2);
    sum_poles(v->A - up, pole + up, tau2 + up, v->base, mu, &below, &below2);
    const double terms = 1.0 + v->rho * (above - below), slope = v->rho * (above2 + below2);
    return (secular){ .f = 1.0 - v->rho * (above + below),
                      .above1 = -v->rho * above2,
                      .below1 = -v->rho * below2,
                      .noise = DBL_EPSILON * (16.0 * terms + fabs(mu) * slope) };
}

/* Step of the "middle way" (Li, LAPACK Working Note 89, 1994): to the root of
 * c + s1/(d_a - x) + s2/(d_{a+1} - x), whose two parts agree with the sums above and below in
 * derivative, and whose value with f.  At the last root the second part is missing. */
static double step_from(const interval *v, const secular *s, double mu)
{
    const double d1 = (v->w->pole[v->a] - v->base) - mu, f1 = s->above1 + s->below1;
    if (v->a + 1 == v->A) return d1 * s->f / (s->f - d1 * f1);
    const double d2 = (v->w->pole[v->a + 1] - v->base) - mu;
    const double c = s->f - d1 * s->above1 - d2 * s->below1;
    const double p = (d1 + d2) * s->f - d1 * d2 * f1, q = d1 * d2 * s->f;
    const double root = sqrt(fmax(p * p - 4.0 * q * c, 0.0));
    return p >= 0.0 ? (p + root) / (2.0 * c) : 2.0 * q / (p - root); /* the one in between */
}

/* Offset of root a from v->base, which is set to the nearer pole.  f falls from + to - between two
 * poles; steps that leave the bracket are replaced by bisection. */
static double find_root(interval *v, double t2)
{
    const double *pole = v->w->pole;
    const bool last = v->a + 1 == v->A;
    const double gap = last ? v->rho * t2 : pole[v->a] - pole[v->a + 1];
    double lo = -gap, hi = 0.0, mu = -0.5 * gap;
    v->base = pole[v->a];
    secular s = secular_at(v, mu);
    if (!last && s.f <= 0.0) {
        v->base = pole[v->a + 1];
        lo = 0.0;
        hi = mu = 0.5 * gap;
        s = secular_at(v, mu);
    }
    for (int it = 0; it < ITERATIONS && fabs(s.f) > s.noise; it++) {
        if (s.f > 0.0)
            lo = mu;
        else
            hi = mu;
        double next = mu + step_from(v, &s, mu);
        if (!(next > lo && next < hi)) next = lo + 0.5 * (hi - lo);
        if (next == mu || !(next > lo && next < hi)) break;
        mu = next;
        s = secular_at(v, mu);
    }
    return mu;
}

static void find_roots(apsm_downdate *w, size_t A, double rho, double t2)
{
    for (size_t a = 0; a < A; a++) {
        interval v = { .w = w, .A = A, .a = a, .rho = rho };
        const double mu = find_root(&v, t2);
        double *delta = w->delta + a * w->r;
        w->root[a] = v.base + mu;
        for (size_t k = 0; k < A; k++) delta[k] = (w->pole[k] - v.base) - mu;
    }
}

/* rho tau_k^2 = (d_k - lambda_k) prod_{a != k} (d_k - lambda_a) / (d_k - d_a) */
static void exact_weights(apsm_downdate *w, size_t A, double rho)
{
    for (size_t k = 0; k < A; k++) w->exact[k] = w->delta[k * w->r + k] / rho;
    for (size_t a = 0; a < A; a++) {
        const double *delta = w->delta + a * w->r;
        for (size_t k = 0; k < A; k++)
            if (k != a) w->exact[k] *= delta[k] / (w->pole[k] - w->pole[a]);
    }
}

/* g <- g minus mode a's term of (D3). */
static void subtract_mode(apsm_downdate *w, size_t A, size_t clusters, size_t a, double rho)
{
    const double *delta = w->delta + a * w->r;
    double n2 = 0.0;
    for (size_t k = 0; k < A; k++) n2 += w->exact[k] / (delta[k] * delta[k]);
    const double factor = 1.0 / (rho * n2);
    for (size_t c = 0; c < clusters; c++)
        if (w->active[c] != SIZE_MAX) w->g[c] -= factor / delta[w->active[c]];
}

size_t apsm_downdate_residuals(apsm_downdate *w, const double *d, const double *t, double rho,
                               double zero, size_t M, double *C)
{
    const size_t r = w->r;
    double t2 = 0.0;
    size_t n_silent, a = 0, s = 0, m = 0;
    if (r == 0) return 0;
    for (size_t k = 0; k < r; k++) t2 += t[k] * t[k];
    const size_t clusters = make_clusters(w, d, t);
    const size_t A = make_poles(w, clusters, rho, t2, &n_silent);
    find_roots(w, A, rho, t2);
    exact_weights(w, A, rho);
    for (size_t c = 0; c < clusters; c++) w->g[c] = 1.0;
    for (size_t k = 0; k < r; k++) {
        const size_t p = w->active[w->cluster[k]];
        w->t[k] = p == SIZE_MAX ? t[k] : t[k] * sqrt(fmax(w->exact[p], 0.0) / w->tau2[p]);
    }
    while (m < M && (a < A || s < n_silent)) {
        const bool is_silent = a == A || (s < n_silent && w->silent[s].d >= w->root[a]);
        if (!((is_silent ? w->silent[s].d : w->root[a]) > zero * d[0])) break;
        if (!is_silent)
            subtract_mode(w, A, clusters, a++, rho);
        else if (w->silent[s++].removes)
            w->g[w->silent[s - 1].pole] = 0.0;
        for (size_t k = 0; k < r; k++) C[m * r + k] = w->t[k] * w->g[w->cluster[k]];
        m++;
    }
    return m;
}
