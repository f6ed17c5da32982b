/* Least-squares planes, spheres and cylinders by the Gauss-Newton method with Marquardt's damping,
 * which is relative, so that no unit matters (D. W. Marquardt, J. SIAM 11, 1963):
 *   sphere    r_k = |p_k - c| - R                       over c, R
 *   cylinder  r_k = |q_k| - R,  q_k = p_k - a - ((p_k - a) . d) d     over a, d, R
 * and the area of a plane's cut by Green's theorem over its segments. */
#include "statistics/primitive.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "geometry/vec3.h"
#include "linalg/linalg.h"

enum { PARAMETERS_MOST = 5, ITERATIONS_MOST = 200 };

static void centroid(size_t n, const double *P, double centre[3])
{
    for (int c = 0; c < 3; c++) centre[c] = 0;
    for (size_t k = 0; k < 3 * n; k++) centre[k % 3] += P[k] / (double)n;
}

/* Eigenvectors (rows of Q) and values (descending) of the mean of x x^T, x = X - centre. */
static apsm_status axes(size_t n, const double *X, const double centre[3], double w[3], double Q[9])
{
    double C[9] = { 0 };
    for (size_t k = 0; k < n; k++)
        for (size_t a = 0; a < 3; a++)
            for (size_t b = 0; b < 3; b++)
                C[3 * a + b] += (X[3 * k + a] - centre[a]) * (X[3 * k + b] - centre[b]) / (double)n;
    return apsm_symmetric_eigen(3, C, w, Q);
}

apsm_status primitive_plane(size_t n, const double *P, double centre[3], double normal[3])
{
    double w[3], Q[9], turn[3] = { 0 }, a[3], b[3], x[3];
    if (n < 3) return APSM_ERR_ARG;
    centroid(n, P, centre);
    APSM_TRY(axes(n, P, centre, w, Q));
    if (!(w[1] > 1e-12 * w[0])) return APSM_ERR_GEOMETRY;
    for (size_t k = 0; k < n; k++) {
        vec3_sub(P + 3 * k, centre, a);
        vec3_sub(P + 3 * ((k + 1) % n), centre, b);
        vec3_cross(a, b, x);
        vec3_add_scaled(turn, 1, x);
    }
    const double sign = vec3_dot(turn, Q + 6) < 0 ? -1 : 1;
    for (int c = 0; c < 3; c++) normal[c] = sign * Q[6 + c];
    return APSM_OK;
}

/* ---- Gauss-Newton with damping ---- */

/* A sphere, or a cylinder without ends. */
typedef struct primitive {
    size_t m;       /* parameters: 4 or 5 */
    double at[3];   /* centre, or a point of the axis */
    double axis[3]; /* of a cylinder; {0} for a sphere */
    double u[3], v[3];
    double R;
} primitive;

/* u, v: unit vectors across the axis d. */
static void across(primitive *s)
{
    const double *d = s->axis;
    int least = fabs(d[1]) < fabs(d[0]) ? 1 : 0;
    if (fabs(d[2]) < fabs(d[least])) least = 2;
    double e[3] = { 0 };
    e[least] = 1;
    vec3_cross(d, e, s->u);
    const double length = vec3_norm(s->u);
    for (int c = 0; c < 3; c++) s->u[c] /= length;
    vec3_cross(d, s->u, s->v);
}

static double residual_at(const primitive *s, const double p[3], double g[PARAMETERS_MOST])
{
    double q[3];
    vec3_sub(p, s->at, q);
    const double along = vec3_dot(q, s->axis);
    vec3_add_scaled(q, -along, s->axis);
    const double length = vec3_norm(q);
    const double scale = length > 0 ? -1 / length : 0;
    if (s->m == 4) {
        for (int c = 0; c < 3; c++) g[c] = scale * q[c];
    } else {
        g[0] = scale * vec3_dot(q, s->u);
        g[1] = scale * vec3_dot(q, s->v);
        g[2] = along * g[0];
        g[3] = along * g[1];
    }
    g[s->m - 1] = -1;
    return length - s->R;
}

/* Sum of squares; A (m x m) = G^T G, b = G^T r if A is not NULL. */
static double squares(const primitive *s, size_t n, const double *X, double *A, double *b)
{
    double g[PARAMETERS_MOST], sum = 0;
    const size_t m = s->m;
    if (A) memset(A, 0, m * m * sizeof *A), memset(b, 0, m * sizeof *b);
    for (size_t k = 0; k < n; k++) {
        const double r = residual_at(s, X + 3 * k, g);
        sum += r * r;
        for (size_t i = 0; A && i < m; i++) {
            b[i] += g[i] * r;
            for (size_t j = 0; j < m; j++) A[i * m + j] += g[i] * g[j];
        }
    }
    return sum;
}

static void move(const primitive *s, const double *step, primitive *to)
{
    *to = *s;
    to->R -= step[s->m - 1];
    if (s->m == 4) {
        for (int c = 0; c < 3; c++) to->at[c] -= step[c];
        return;
    }
    vec3_add_scaled(to->at, -step[0], s->u);
    vec3_add_scaled(to->at, -step[1], s->v);
    vec3_add_scaled(to->axis, -step[2], s->u);
    vec3_add_scaled(to->axis, -step[3], s->v);
    const double length = vec3_norm(to->axis);
    for (int c = 0; c < 3; c++) to->axis[c] /= length;
    across(to);
}

/* Takes a step that lessens the sum of squares, or leaves *damping so large that there is none. */
static double descend(primitive *s, size_t n, const double *X, double before, double *damping)
{
    double A[PARAMETERS_MOST * PARAMETERS_MOST], L[PARAMETERS_MOST * PARAMETERS_MOST];
    double b[PARAMETERS_MOST], step[PARAMETERS_MOST];
    primitive next;
    squares(s, n, X, A, b);
    for (; *damping < 1e12; *damping *= 8) {
        memcpy(L, A, sizeof L);
        memcpy(step, b, sizeof step);
        for (size_t i = 0; i < s->m; i++) L[i * s->m + i] += *damping * A[i * s->m + i];
        if (apsm_cholesky(s->m, L) != APSM_OK) continue;
        apsm_cholesky_solve(s->m, L, 1, step);
        move(s, step, &next);
        const double after = squares(&next, n, X, NULL, NULL);
        if (!(after < before)) continue;
        *s = next;
        *damping = fmax(*damping / 16, 1e-12);
        return after;
    }
    return before;
}

static apsm_status minimise(primitive *s, size_t n, const double *P, double *residual)
{
    double damping = 1e-3, sum = squares(s, n, P, NULL, NULL);
    for (int k = 0; k < ITERATIONS_MOST && damping < 1e12; k++) {
        const double less = descend(s, n, P, sum, &damping);
        const bool done = sum - less <= 1e-15 * sum;
        sum = less;
        if (done) break;
    }
    *residual = sqrt(sum / (double)n);
    return isfinite(sum) && s->R > 0 ? APSM_OK : APSM_ERR_GEOMETRY;
}

/* First guess, linear: least squares of |y|^2 - 2 c . y - k over c and k, y = p - centroid. */
apsm_status primitive_sphere(size_t n, const double *P, double centre[3], double *radius,
                             double *residual)
{
    double w[3], Q[9], m[3] = { 0 }, k = 0, y[3];
    primitive s = { .m = 4 };
    if (n < 4) return APSM_ERR_ARG;
    centroid(n, P, s.at);
    APSM_TRY(axes(n, P, s.at, w, Q));
    if (!(w[2] > 1e-12 * w[0])) return APSM_ERR_GEOMETRY;
    for (size_t i = 0; i < n; i++) {
        vec3_sub(P + 3 * i, s.at, y);
        const double y2 = vec3_dot(y, y) / (double)n;
        vec3_add_scaled(m, y2, y);
        k += y2;
    }
    double c[3] = { 0 };
    for (int a = 0; a < 3; a++) vec3_add_scaled(c, vec3_dot(Q + 3 * a, m) / (2 * w[a]), Q + 3 * a);
    s.R = sqrt(k + vec3_dot(c, c));
    vec3_add_scaled(s.at, 1, c);
    APSM_TRY(minimise(&s, n, P, residual));
    memcpy(centre, s.at, sizeof s.at);
    *radius = s.R;
    return APSM_OK;
}

/* First guess: the axis is the direction that the normals have least of. */
apsm_status primitive_cylinder(size_t n, const double *P, const double *N, double on_axis[3],
                               double axis[3], double *radius, double *residual)
{
    const double zero[3] = { 0 };
    double w[3], Q[9], q[3], c[2] = { 0 }, A[4] = { 0 };
    primitive s = { .m = 5 };
    if (n < 6) return APSM_ERR_ARG;
    centroid(n, P, s.at);
    APSM_TRY(axes(n, N, zero, w, Q));
    if (!(w[1] > 1e-9 * w[0])) return APSM_ERR_GEOMETRY;
    memcpy(s.axis, Q + 6, sizeof s.axis);
    across(&s);
    /* The point nearest to all lines along normals, across the axis: (sum I - n n^T) c = sum ... */
    for (size_t k = 0; k < n; k++) {
        vec3_sub(P + 3 * k, s.at, q);
        const double nu = vec3_dot(N + 3 * k, s.u), nv = vec3_dot(N + 3 * k, s.v);
        const double x = vec3_dot(q, s.u), y = vec3_dot(q, s.v), length2 = nu * nu + nv * nv;
        if (!(length2 > 0)) continue;
        const double cross = (x * nv - y * nu) / length2;
        A[0] += nv * nv / length2, A[2] -= nu * nv / length2, A[3] += nu * nu / length2;
        c[0] += nv * cross, c[1] -= nu * cross;
    }
    APSM_TRY(apsm_cholesky(2, A) == APSM_OK ? APSM_OK : APSM_ERR_GEOMETRY);
    apsm_cholesky_solve(2, A, 1, c);
    vec3_add_scaled(s.at, c[0], s.u);
    vec3_add_scaled(s.at, c[1], s.v);
    double g[PARAMETERS_MOST], mean = 0;
    for (size_t k = 0; k < n; k++) mean += residual_at(&s, P + 3 * k, g) / (double)n; /* R is 0 */
    s.R = mean;
    APSM_TRY(minimise(&s, n, P, residual));
    memcpy(on_axis, s.at, sizeof s.at);
    memcpy(axis, s.axis, sizeof s.axis);
    *radius = s.R;
    return APSM_OK;
}

/* ---- what a plane cuts ---- */

/* Where the plane crosses an edge; computed from the lower vertex, so that both faces agree. */
static void crossing(const apsm_mesh *mesh, uint32_t i, uint32_t j, const double centre[3],
                     const double normal[3], double x[3])
{
    const uint32_t a = i < j ? i : j, b = i < j ? j : i;
    const double *p = mesh->V + 3 * (size_t)a, *q = mesh->V + 3 * (size_t)b;
    double from[3], to[3];
    vec3_sub(p, centre, from);
    vec3_sub(q, centre, to);
    const double s = vec3_dot(from, normal), t = vec3_dot(to, normal), at = s / (s - t);
    for (int c = 0; c < 3; c++) x[c] = p[c] + at * (q[c] - p[c]);
}

size_t primitive_cut(const apsm_mesh *mesh, size_t first_face, size_t end, const double centre[3],
                     const double normal[3], double *segment)
{
    size_t n = 0;
    for (size_t f = first_face; f < end; f++) {
        const uint32_t *v = mesh->F + 3 * f;
        bool above[3];
        double y[3];
        for (int c = 0; c < 3; c++) {
            vec3_sub(mesh->V + 3 * (size_t)v[c], centre, y);
            above[c] = vec3_dot(y, normal) >= 0;
        }
        if (above[0] == above[1] && above[1] == above[2]) continue;
        for (int c = 0; segment && c < 3; c++) {
            const int next = (c + 1) % 3;
            if (above[c] == above[next]) continue;
            /* Outward faces turn left: the edge that goes up ends the segment. */
            crossing(mesh, v[c], v[next], centre, normal, segment + 6 * n + (above[c] ? 0 : 3));
        }
        n++;
    }
    return n;
}

static size_t root_of(size_t *loop, size_t k)
{
    while (loop[k] != k) k = loop[k] = loop[loop[k]];
    return k;
}

void primitive_loops(size_t n, const double *segment, size_t *loop)
{
    for (size_t k = 0; k < n; k++) loop[k] = k;
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i < n; i++)
            if (memcmp(segment + 6 * k + 3, segment + 6 * i, 3 * sizeof *segment) == 0) {
                const size_t a = root_of(loop, k), b = root_of(loop, i);
                loop[a > b ? a : b] = a > b ? b : a;
            }
    for (size_t k = 0; k < n; k++) loop[k] = root_of(loop, k);
}

double primitive_enclosed(size_t n, const double *segment, const size_t *loop, size_t which,
                          const double normal[3])
{
    double area = 0, a[3], b[3], x[3];
    const double *origin = segment;
    for (size_t k = 0; k < n; k++) {
        if (which != SIZE_MAX && loop[k] != which) continue;
        vec3_sub(segment + 6 * k, origin, a);
        vec3_sub(segment + 6 * k + 3, origin, b);
        vec3_cross(a, b, x);
        area += vec3_dot(x, normal) / 2;
    }
    return area;
}
