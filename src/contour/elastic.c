/* Square-root velocities q = c' / sqrt|c'| (Srivastava, Klassen, Joshi and Jermyn, IEEE PAMI 33,
 * 2011): their L2 distance is an elastic energy of bending and stretching, and a map gamma acts on
 * them as q(gamma) sqrt(gamma').  The least over monotone maps is found on the grid of both curves'
 * points by steps (a, b) of up to MOST_STEP points each, within a band about equal arc length. */
#include "contour/elastic.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "geometry/vec3.h"

enum { MOST_STEP = 4, BAND = 3 }; /* a third of the curve to either side */

static size_t edges_of(size_t m, bool closed)
{
    return closed ? m : m - 1;
}

static double edge_length(size_t n, const double *P, size_t k)
{
    return sqrt(vec3_distance2(P + 3 * k, P + 3 * ((k + 1) % n)));
}

double curve_resample(size_t n, const double *P, bool closed, size_t m, double *Q)
{
    const size_t edges = edges_of(n, closed), steps = edges_of(m, closed);
    double length = 0, before = 0;
    for (size_t k = 0; k < edges; k++) length += edge_length(n, P, k);
    if (!(length > 0)) return 0;
    for (size_t i = 0, k = 0; i < m; i++) {
        const double s = length * (double)i / (double)steps;
        while (k + 1 < edges && before + edge_length(n, P, k) < s) before += edge_length(n, P, k++);
        const double e = edge_length(n, P, k), t = e > 0 ? fmin((s - before) / e, 1) : 0;
        for (size_t c = 0; c < 3; c++)
            Q[3 * i + c] = (1 - t) * P[3 * k + c] + t * P[3 * ((k + 1) % n) + c];
    }
    return length;
}

void curve_at(size_t m, const double *Q, bool closed, double t, double x[3])
{
    const double last = (double)(m - 1);
    if (!closed) t = fmin(fmax(t, 0), last);
    double whole = floor(t);
    if (!closed && whole >= last) whole = last - 1;
    const double u = t - whole, mod = fmod(whole, (double)m);
    const size_t a = (size_t)(mod < 0 ? mod + (double)m : mod), b = (a + 1) % m;
    for (size_t c = 0; c < 3; c++) x[c] = (1 - u) * Q[3 * a + c] + u * Q[3 * b + c];
}

/* q (m x 3): one a step; of an open curve the last is that before. */
static void velocities(size_t m, const double *Q, bool closed, double *q)
{
    double total = 0;
    for (size_t k = 0; k < m; k++) {
        const size_t a = closed || k + 1 < m ? k : k - 1;
        vec3_sub(Q + 3 * ((a + 1) % m), Q + 3 * a, q + 3 * k);
        total += vec3_norm(q + 3 * k);
    }
    for (size_t k = 0; k < m; k++) {
        const double v = vec3_norm(q + 3 * k) / total * (double)m; /* size does not matter */
        for (size_t c = 0; c < 3; c++) q[3 * k + c] *= v > 0 ? (double)m / total / sqrt(v) : 0;
    }
}

/* Energy of a straight piece of the map from (i, j) over a points of A and b of B. */
static double piece(size_t m, const double *p, const double *q, size_t i, size_t j, size_t a,
                    size_t b)
{
    const double slope = (double)b / (double)a, root = sqrt(slope);
    double sum = 0;
    for (size_t k = 0; k < a; k++) {
        const size_t at = (size_t)((double)j + slope * ((double)k + 0.5));
        for (size_t c = 0; c < 3; c++) {
            const double d = p[3 * ((i + k) % m) + c] - root * q[3 * (at % m) + c];
            sum += d * d;
        }
    }
    return sum;
}

size_t curve_match_size(size_t m)
{
    return 6 * m + 2 * (m + 1) * (m + 1);
}

/* The cheapest way to (i, j), of those whose beginning has been reached. */
static void reach(size_t m, const double *p, const double *q, size_t i, size_t j, double *cost,
                  double *from)
{
    const size_t n = m + 1;
    double best = INFINITY;
    for (size_t a = 1; a <= MOST_STEP && a <= i; a++)
        for (size_t b = 1; b <= MOST_STEP && b <= j; b++) {
            const double before = cost[(i - a) * n + j - b];
            if (!(before < best)) continue;
            const double c = before + piece(m, p, q, i - a, j - b, a, b);
            if (c < best) {
                best = c;
                from[i * n + j] = (double)(a * (MOST_STEP + 1) + b);
            }
        }
    cost[i * n + j] = best;
}

static void trace(size_t m, size_t end, const double *from, double *gamma)
{
    size_t i = end, j = end;
    if (end < m) gamma[end] = (double)end;
    while (i > 0) {
        const size_t step = (size_t)from[i * (m + 1) + j];
        const size_t a = step / (MOST_STEP + 1), b = step % (MOST_STEP + 1);
        for (size_t k = 0; k < a; k++)
            gamma[i - a + k] = (double)(j - b) + (double)b * (double)k / (double)a;
        i -= a;
        j -= b;
    }
}

double curve_match(size_t m, const double *A, const double *B, bool closed, double *gamma,
                   double *work)
{
    const size_t n = m + 1, end = edges_of(m, closed), band = m / BAND;
    double *p = work, *q = p + 3 * m, *cost = q + 3 * m, *from = cost + n * n;
    velocities(m, A, closed, p);
    velocities(m, B, closed, q);
    for (size_t k = 0; k < n * n; k++) cost[k] = INFINITY;
    cost[0] = 0;
    for (size_t i = 1; i <= end; i++) {
        const size_t lo = i > band ? i - band : 1, hi = i + band < end ? i + band : end;
        for (size_t j = lo; j <= hi; j++) reach(m, p, q, i, j, cost, from);
    }
    trace(m, end, from, gamma);
    return cost[end * n + end];
}

/* How sharply the curve turns at its k-th point, in radians. */
static double bend(size_t m, const double *Q, bool closed, size_t k)
{
    double a[3], b[3];
    if (!closed && (k == 0 || k + 1 == m)) return 0;
    vec3_sub(Q + 3 * k, Q + 3 * ((k + m - 1) % m), a);
    vec3_sub(Q + 3 * ((k + 1) % m), Q + 3 * k, b);
    if (!(vec3_normalise(a) > 0) || !(vec3_normalise(b) > 0)) return 0;
    return acos(fmin(fmax(vec3_dot(a, b), -1), 1));
}

void curve_places(size_t m, const double *Q, bool closed, double adaptivity, size_t J, double *t)
{
    enum { REACH = 3 }; /* bends are felt so many points around */
    const size_t steps = edges_of(m, closed);
    double mean = 0, total = 0;
    for (size_t k = 0; k < m; k++) mean += bend(m, Q, closed, k) / (double)m;
    for (size_t pass = 0, j = 0; pass < 2; pass++) {
        double sum = 0;
        for (size_t k = 0; k < steps; k++) {
            double sharp = 0;
            for (size_t r = 0; r < 2 * REACH; r++) {
                const size_t at = closed                  ? (k + m + r - REACH + 1) % m
                                  : k + r + 1 < REACH     ? 0
                                  : k + r + 1 - REACH < m ? k + r + 1 - REACH
                                                          : m - 1;
                sharp += bend(m, Q, closed, at) / (2 * REACH);
            }
            const double density = 1 + (mean > 0 ? adaptivity * sharp / mean : 0);
            const double apart = total / (double)(closed ? J : J - 1);
            for (; pass == 1 && j < J && (double)j * apart < sum + density; j++)
                t[j] = (double)k + ((double)j * apart - sum) / density;
            sum += density;
        }
        total = sum;
        for (; pass == 1 && j < J; j++) t[j] = (double)steps; /* an open end, by rounding */
    }
}

static double to_segment(const double x[3], const double a[3], const double b[3])
{
    double d[3], y[3];
    vec3_sub(b, a, d);
    vec3_sub(x, a, y);
    const double n2 = vec3_dot(d, d), t = n2 > 0 ? fmin(fmax(vec3_dot(y, d) / n2, 0), 1) : 0;
    vec3_add_scaled(y, -t, d);
    return vec3_norm(y);
}

double curve_distance(size_t n, const double *X, size_t m, const double *Q, bool closed,
                      double *most)
{
    double sum = 0;
    *most = 0;
    for (size_t k = 0; k < n; k++) {
        double least = INFINITY;
        for (size_t e = 0; e < edges_of(m, closed); e++)
            least = fmin(least, to_segment(X + 3 * k, Q + 3 * e, Q + 3 * ((e + 1) % m)));
        sum += least / (double)n;
        *most = fmax(*most, least);
    }
    return sum;
}
