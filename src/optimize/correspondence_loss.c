/* Neighbourhood correspondence loss of one shape; docs/method.md, (8).
 *   N6(j)  6 nearest template particles of p_tj
 *   x_jn = p_n - p_j for n in N6(j)     m_j = mean_n |x_jn|     a_jn = x_jn / m_j
 *   b_jn = S_j a_tjn, the template's                            d_jn = R_j a_jn - b_jn
 *   L    = sum_j kappa_j sum_n rho(|d_jn|),     kappa_j = h_tj / 6                          (8)
 * With u_jn = kappa_j rho'(|d|) R_j^T d / |d| the gradient, R_j and kappa_j constant, is
 *   dL/dx_jn = (u_jn - (sum_k u_jk . a_jk) x_jn / (6 |x_jn|)) / m_j
 * which goes to p_n and, negative, to p_j. */
#include "optimize/correspondence_loss.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "geometry/vec3.h"

#include "geometry/affine.h"

enum { Q = APSM_NEIGHBOURS };

/* ---- neighbours ---- */

/* The Q particles nearest to j; found in order of index, so a tie keeps the smaller one. */
static void nearest_of(size_t J, const double *P, size_t j, uint32_t *nearest)
{
    double d2[Q];
    for (size_t i = 0; i < Q; i++) d2[i] = INFINITY;
    for (size_t k = 0; k < J; k++) {
        const double x = P[3 * k] - P[3 * j], y = P[3 * k + 1] - P[3 * j + 1],
                     z = P[3 * k + 2] - P[3 * j + 2], d = x * x + y * y + z * z;
        if (!(d < d2[Q - 1]) || k == j) continue;
        size_t i = Q - 1;
        for (; i > 0 && d < d2[i - 1]; i--) {
            d2[i] = d2[i - 1];
            nearest[i] = nearest[i - 1];
        }
        d2[i] = d;
        nearest[i] = (uint32_t)k;
    }
}

apsm_status apsm_neighbours6(size_t J, const double *P, uint32_t *N6)
{
    if (J <= Q || J > UINT32_MAX) return APSM_ERR_ARG;
    static const double largest = 1e150; /* beyond, squares of distances are infinite */
    for (size_t i = 0; i < 3 * J; i++)
        if (!(fabs(P[i]) < largest)) return APSM_ERR_NONFINITE;
    for (size_t j = 0; j < J; j++) nearest_of(J, P, j, N6 + Q * j);
    return APSM_OK;
}

/* ---- one neighbourhood ---- */

/* y = R x, or R^T x. */
static void turn(const double R[9], const double x[3], double y[3])
{
    for (size_t i = 0; i < 3; i++) y[i] = vec3_dot(R + 3 * i, x);
}

static void turn_back(const double R[9], const double x[3], double y[3])
{
    for (size_t i = 0; i < 3; i++) y[i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2];
}

typedef struct neighbourhood {
    double x[Q][3], r[Q], m, a[Q][3];
} neighbourhood;

static void look_around(const double *P, const uint32_t *N6, size_t j, neighbourhood *h)
{
    h->m = 0.0;
    for (size_t n = 0; n < Q; n++) {
        const double *p = P + 3 * (size_t)N6[Q * j + n];
        for (size_t c = 0; c < 3; c++) h->x[n][c] = p[c] - P[3 * j + c];
        h->r[n] = sqrt(vec3_dot(h->x[n], h->x[n]));
        h->m += h->r[n];
    }
    h->m /= Q;
    for (size_t n = 0; n < Q; n++)
        for (size_t c = 0; c < 3; c++) h->a[n][c] = h->x[n][c] / h->m;
}

double apsm_spacing(size_t J, const double *P, const uint32_t *N6, double *h_j)
{
    double sum = 0.0;
    for (size_t j = 0; j < J; j++) {
        neighbourhood h;
        look_around(P, N6, j, &h);
        if (h_j) h_j[j] = h.m;
        sum += h.m;
    }
    return sum / (double)J;
}

/* ---- rotations ---- */

static void identity(double R[9])
{
    for (size_t i = 0; i < 9; i++) R[i] = i % 4 == 0 ? 1.0 : 0.0;
}

/* Half a turn about an axis across n: what is left for opposite normals. */
static void half_turn(const double n[3], double R[9])
{
    size_t least = 0;
    for (size_t c = 1; c < 3; c++)
        if (fabs(n[c]) < fabs(n[least])) least = c;
    const size_t u = (least + 1) % 3, v = (least + 2) % 3;
    double e[3];
    const double size = sqrt(n[u] * n[u] + n[v] * n[v]);
    e[least] = 0.0;
    e[u] = -n[v] / size;
    e[v] = n[u] / size;
    for (size_t i = 0; i < 9; i++) R[i] = 2.0 * e[i / 3] * e[i % 3] - (i % 4 == 0 ? 1.0 : 0.0);
}

/* The smallest rotation of the unit vector n to m: I + [v] + [v]^2 / (1 + n.m), v = n x m. */
static void smallest_rotation(const double n[3], const double m[3], double R[9])
{
    const double v[3] = { n[1] * m[2] - n[2] * m[1], n[2] * m[0] - n[0] * m[2],
                          n[0] * m[1] - n[1] * m[0] };
    const double c = vec3_dot(n, m);
    if (1.0 + c < 1e-6) {
        half_turn(n, R);
        return;
    }
    const double f = 1.0 / (1.0 + c), v2 = vec3_dot(v, v);
    const double cross[9] = { 0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0 };
    for (size_t i = 0; i < 9; i++) {
        const double unit = i % 4 == 0 ? 1.0 : 0.0;
        R[i] = unit + cross[i] + f * (v[i / 3] * v[i % 3] - v2 * unit);
    }
}

/* argmin_R sum_n |R a_n - b_n|^2 */
static void best_rotation(const neighbourhood *shape, const neighbourhood *target, double R[9])
{
    double M[9] = { 0 };
    for (size_t n = 0; n < Q; n++)
        for (size_t i = 0; i < 9; i++) M[i] += target->a[n][i / 3] * shape->a[n][i % 3];
    apsm_nearest_rotation(M, R);
}

static void choose_rotation(const apsm_correspondence_target *target, const double *N, size_t j,
                            apsm_rotation rotation, const neighbourhood *shape,
                            const neighbourhood *at_target, double R[9], double S[9])
{
    static const double axis[3] = { 1.0, 0.0, 0.0 };
    identity(R);
    identity(S);
    if (rotation == APSM_ROTATION_TRANSPORT)
        smallest_rotation(N + 3 * j, target->N + 3 * j, R);
    else if (rotation == APSM_ROTATION_AXIS) {
        smallest_rotation(N + 3 * j, axis, R);
        smallest_rotation(target->N + 3 * j, axis, S);
    } else if (rotation == APSM_ROTATION_PROCRUSTES)
        best_rotation(shape, at_target, R);
}

void apsm_correspondence_rotation(const apsm_correspondence_target *target, const double *P,
                                  const double *N, size_t j, apsm_rotation rotation, double R[9],
                                  double S[9])
{
    neighbourhood shape, at_target;
    look_around(P, target->N6, j, &shape);
    look_around(target->P, target->N6, j, &at_target);
    choose_rotation(target, N, j, rotation, &shape, &at_target, R, S);
}

/* ---- the loss ---- */

apsm_correspondence_options apsm_correspondence_defaults(void)
{
    return (apsm_correspondence_options){ APSM_OPTION_DEFAULTS(APSM_CORRESPONDENCE_OPTIONS) };
}

/* rho(|d|); d becomes rho'(|d|) d / |d|.  A residual of rounding size counts as none: the norm's
 * gradient is a unit vector however small d is. */
static double residual(const apsm_correspondence_options *opt, double d[3])
{
    const double d2 = vec3_dot(d, d), size = sqrt(d2);
    double rho, slope; /* slope = rho' / |d| */
    if (opt->neighbour_norm == APSM_DISTANCE_SQUARED) {
        rho = 0.5 * d2;
        slope = 1.0;
    } else if (opt->neighbour_norm == APSM_DISTANCE_PSEUDO_HUBER) {
        const double root = sqrt(d2 + opt->delta * opt->delta);
        rho = d2 / (root + opt->delta); /* = root - delta without cancellation */
        slope = 1.0 / root;
    } else {
        rho = size;
        slope = size > 64.0 * DBL_EPSILON ? 1.0 / size : 0.0;
    }
    for (size_t c = 0; c < 3; c++) d[c] *= slope;
    return rho;
}

/* Carries sign kappa dL/da_n, given in u turned by R, on to the particles. */
static void hand_down(const neighbourhood *h, const double R[9], double weight, double u[Q][3],
                      const uint32_t *n6, size_t j, double *grad)
{
    double v[Q][3], along = 0.0;
    for (size_t n = 0; n < Q; n++) {
        turn_back(R, u[n], v[n]);
        along += vec3_dot(v[n], h->a[n]);
    }
    for (size_t n = 0; n < Q; n++) {
        const double f = h->r[n] > 0.0 ? along / (Q * h->r[n]) : 0.0;
        for (size_t c = 0; c < 3; c++) {
            const double g = weight * (v[n][c] - f * h->x[n][c]) / h->m;
            grad[3 * (size_t)n6[n] + c] += g;
            grad[3 * j + c] -= g;
        }
    }
}

/* Particle j's terms. */
static double do_particle(const apsm_correspondence_target *target, const double *P,
                          const double *N, const apsm_correspondence_options *opt, size_t j,
                          double *grad, double *target_grad)
{
    neighbourhood shape, at_target;
    double R[9], S[9], u[Q][3], sum = 0.0;
    look_around(P, target->N6, j, &shape);
    look_around(target->P, target->N6, j, &at_target);
    choose_rotation(target, N, j, opt->rotation, &shape, &at_target, R, S);
    for (size_t n = 0; n < Q; n++) {
        double a[3], b[3];
        turn(R, shape.a[n], a);
        turn(S, at_target.a[n], b);
        for (size_t c = 0; c < 3; c++) u[n][c] = a[c] - b[c];
        sum += residual(opt, u[n]);
    }
    const double kappa =
        opt->neighbour_scale == APSM_SCALE_TEMPLATE ? target->h_j[j] / (double)Q : 1.0;
    if (grad) hand_down(&shape, R, kappa, u, target->N6 + Q * j, j, grad);
    if (target_grad) hand_down(&at_target, S, -kappa, u, target->N6 + Q * j, j, target_grad);
    return kappa * sum;
}

apsm_status apsm_correspondence_loss(const apsm_correspondence_target *target, const double *P,
                                     const double *N, const apsm_correspondence_options *opt,
                                     double *loss, double *grad, double *target_grad)
{
    double sum = 0.0;
    if (grad) memset(grad, 0, 3 * target->J * sizeof *grad);
    if (target_grad) memset(target_grad, 0, 3 * target->J * sizeof *target_grad);
    for (size_t j = 0; j < target->J; j++)
        sum += do_particle(target, P, N, opt, j, grad, target_grad);
    *loss = sum;
    return isfinite(sum) ? APSM_OK : APSM_ERR_NONFINITE;
}
