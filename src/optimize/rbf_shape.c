/* The RBF-shape of the particles; docs/method.md, "RBF-shape" and "Sampling loss".
 *   q     3J centres P, P + s N, P - s N               M = [A Q; Q^T 0], M [w; c] = [v; 0]   (2)
 *   f(x)  = sum_k w_k phi(|x - q_k|) + c0 + c.x                                             (1)
 *
 * For L(f_1 .. f_R) with a_r = dL/df_r, and [l; m] = M^-1 sum_r a_r [phi(|x_r - q|); 1; x_r]:
 *   dL/dq_k = w_k sum_r a_r grad phi(q_k - x_r)
 *           - sum_l (l_k w_l + w_k l_l) grad phi(q_k - q_l) - l_k c - w_k m_xyz             (A)
 * because d[w; c] = -M^-1 dM [w; c] and M is symmetric. */
#include "optimize/rbf_shape.h"

#include <math.h>
#include <string.h>

#include "core/kernel.h"

enum { LANES = 16, LANES32 = 32, CHUNK = 16 };

/* ---- fit ---- */

size_t apsm_rbf_store_size(size_t J)
{
    return 12 * J; /* Q, w */
}

void apsm_rbf_bind(apsm_rbf_shape *shape, size_t J, double *store)
{
    *shape = (apsm_rbf_shape){ .J = J, .Q = store, .w = store + 9 * J };
}

void apsm_rbf_centres(size_t J, const apsm_dipoles *dipoles, double *Q, double *values)
{
    static const double side[3] = { 0.0, 1.0, -1.0 };
    for (size_t d = 0; d < 3; d++)
        for (size_t j = 0; j < J; j++) {
            for (size_t a = 0; a < 3; a++)
                Q[3 * (d * J + j) + a] =
                    dipoles->P[3 * j + a] + side[d] * dipoles->s * dipoles->N[3 * j + a];
            values[d * J + j] = side[d] * dipoles->s;
        }
}

size_t apsm_rbf_work_size(size_t J)
{
    const size_t n = 3 * J;
    const size_t fit = apsm_polyharmonic_factor_work_size(n) +
                       apsm_polyharmonic_solve_work_size(n, 1),
                 refit = apsm_polyharmonic_resolve_work_size(n);
    return (fit > refit ? fit : refit) + n; /* an adjoint needs less */
}

apsm_status apsm_rbf_fit(apsm_phi phi, const apsm_dipoles *d, bool single, double *factor_store,
                         apsm_polyharmonic *factor, apsm_rbf_shape *shape, double *work)
{
    const size_t n = 3 * shape->J;
    double *values = work, *rest = work + n;
    shape->phi = phi;
    shape->s = d->s;
    apsm_rbf_centres(shape->J, d, shape->Q, values);
    APSM_TRY(apsm_polyharmonic_factor_robust(phi, n, shape->Q, single, factor_store, rest, factor));
    apsm_polyharmonic_solve(factor, 1, values, NULL, shape->w, shape->c, rest);
    return APSM_OK;
}

apsm_status apsm_rbf_refit(const apsm_polyharmonic *stale, const apsm_dipoles *d,
                           const apsm_resolve_options *options, apsm_rbf_shape *shape,
                           size_t *iterations, double *work)
{
    const size_t n = 3 * shape->J;
    double *values = work;
    shape->phi = stale->phi;
    shape->s = d->s;
    apsm_rbf_centres(shape->J, d, shape->Q, values);
    return apsm_polyharmonic_resolve(stale, shape->Q, values, options, shape->w, shape->c,
                                     iterations, work + n);
}

/* ---- evaluate ---- */

/* phi'(r) / r for d2 = r^2: grad phi(x) is this times x.  0 at 0. */
static inline double slope(apsm_phi phi, double d2)
{
    const double r = sqrt(d2);
    return phi == APSM_PHI_R3 ? 3.0 * r : r > 0.0 ? 1.0 / r : 0.0;
}

/* out (n x 3, 3 columns) += sum_k weight_k grad phi(y_i - x_k) for LANES points y by columns. */
#define GRADIENT_BLOCK(NAME, PHI)                                                                  \
    APSM_KERNEL static void NAME(size_t n, const double *restrict X,                               \
                                 const double *restrict weight, const double *restrict y,          \
                                 double *restrict out)                                             \
    {                                                                                              \
        double gx[LANES] = { 0 }, gy[LANES] = { 0 }, gz[LANES] = { 0 };                            \
        for (size_t k = 0; k < n; k++) {                                                           \
            const double a = X[3 * k], b = X[3 * k + 1], c = X[3 * k + 2], w = weight[k];          \
            for (size_t l = 0; l < LANES; l++) {                                                   \
                const double dx = y[l] - a, dy = y[LANES + l] - b, dz = y[2 * LANES + l] - c;      \
                const double g = w * slope(PHI, dx * dx + dy * dy + dz * dz);                      \
                gx[l] += g * dx;                                                                   \
                gy[l] += g * dy;                                                                   \
                gz[l] += g * dz;                                                                   \
            }                                                                                      \
        }                                                                                          \
        memcpy(out, gx, sizeof gx);                                                                \
        memcpy(out + LANES, gy, sizeof gy);                                                        \
        memcpy(out + 2 * LANES, gz, sizeof gz);                                                    \
    }

GRADIENT_BLOCK(gradient_block_r, APSM_PHI_R)
GRADIENT_BLOCK(gradient_block_r3, APSM_PHI_R3)

/* out (ny x 3) = sum_k weight_k grad phi(y - x_k). */
static void kernel_gradient(apsm_phi phi, size_t n, const double *X, const double *weight,
                            size_t ny, const double *Y, double *out)
{
    double y[3 * LANES], g[3 * LANES];
    for (size_t r = 0; r < ny; r += LANES) {
        const size_t count = ny - r < LANES ? ny - r : LANES;
        for (size_t l = 0; l < LANES; l++)
            for (size_t a = 0; a < 3; a++)
                y[a * LANES + l] = Y[3 * (r + (l < count ? l : count - 1)) + a];
        if (phi == APSM_PHI_R)
            gradient_block_r(n, X, weight, y, g);
        else
            gradient_block_r3(n, X, weight, y, g);
        for (size_t l = 0; l < count; l++)
            for (size_t a = 0; a < 3; a++) out[3 * (r + l) + a] = g[a * LANES + l];
    }
}

void apsm_rbf_eval(const apsm_rbf_shape *shape, size_t R, const double *X, double *f,
                   double *grad_f)
{
    const size_t n = 3 * shape->J;
    const apsm_interpolants all = { shape->phi, n, 1, shape->Q, shape->w, shape->c };
    apsm_polyharmonic_eval(&all, R, X, f);
    if (!grad_f) return;
    kernel_gradient(shape->phi, n, shape->Q, shape->w, R, X, grad_f);
    for (size_t r = 0; r < R; r++)
        for (size_t a = 0; a < 3; a++) grad_f[3 * r + a] += shape->c[1 + a];
}

/* Sums of CHUNK centres in single, these in double precision. */
APSM_KERNEL static void eval_block_f32(size_t n, const float *restrict x, const float *restrict y,
                                       double *restrict sum)
{
    double total[LANES32] = { 0 };
    for (size_t k0 = 0; k0 < n; k0 += CHUNK) {
        float acc[LANES32] = { 0 };
        const size_t end = n - k0 < CHUNK ? n : k0 + CHUNK;
        for (size_t k = k0; k < end; k++) {
            const float a = x[4 * k], b = x[4 * k + 1], c = x[4 * k + 2], w = x[4 * k + 3];
            for (size_t l = 0; l < LANES32; l++) {
                const float dx = y[l] - a, dy = y[LANES32 + l] - b, dz = y[2 * LANES32 + l] - c;
                acc[l] += w * sqrtf(dx * dx + dy * dy + dz * dz);
            }
        }
        for (size_t l = 0; l < LANES32; l++) total[l] += (double)acc[l];
    }
    memcpy(sum, total, sizeof total);
}

size_t apsm_rbf_eval_f32_work_size(size_t J)
{
    return 6 * J; /* 3J x 4 floats */
}

/* Coordinates are taken from the first centre, so that single precision is spent on the shape and
 * not on where it lies. */
void apsm_rbf_eval_f32(const apsm_rbf_shape *shape, size_t R, const double *X, double *f,
                       double *work)
{
    const size_t n = 3 * shape->J;
    const double *o = shape->Q;
    float *x = (float *)work, y[3 * LANES32];
    double sum[LANES32];
    for (size_t k = 0; k < n; k++) {
        for (size_t a = 0; a < 3; a++) x[4 * k + a] = (float)(shape->Q[3 * k + a] - o[a]);
        x[4 * k + 3] = (float)shape->w[k];
    }
    for (size_t r = 0; r < R; r += LANES32) {
        const size_t count = R - r < LANES32 ? R - r : LANES32;
        for (size_t l = 0; l < LANES32; l++)
            for (size_t a = 0; a < 3; a++)
                y[a * LANES32 + l] = (float)(X[3 * (r + (l < count ? l : count - 1)) + a] - o[a]);
        eval_block_f32(n, x, y, sum);
        for (size_t l = 0; l < count; l++) {
            const double *p = X + 3 * (r + l), *c = shape->c;
            f[r + l] = sum[l] + (c[0] + c[1] * p[0] + c[2] * p[1] + c[3] * p[2]);
        }
    }
}

/* ---- adjoint ---- */

/* grad_j += sign times the sum over j's three centres k of factor_k dq_k (3J x 3). */
static void gather(size_t J, const double *factor, double sign, const double *dq, double *grad)
{
    for (size_t k = 0; k < 3 * J; k++)
        for (size_t a = 0; a < 3; a++) grad[3 * (k % J) + a] += sign * factor[k] * dq[3 * k + a];
}

void apsm_rbf_adjoint(const apsm_rbf_shape *shape, const apsm_polyharmonic *factor, size_t R,
                      const double *X, const double *dL_df, double *grad, double *work)
{
    const size_t J = shape->J, n = 3 * J;
    static const double zero[4];
    double *l = work, *dq = l + n, *rest = dq + 3 * n, d[4] = { 0 }, m[4];
    for (size_t r = 0; r < R; r++) {
        d[0] += dL_df[r];
        for (size_t a = 0; a < 3; a++) d[1 + a] += dL_df[r] * X[3 * r + a];
    }
    const apsm_interpolants pulls = { shape->phi, R, 1, X, dL_df, zero };
    apsm_polyharmonic_eval(&pulls, n, shape->Q, l);
    apsm_polyharmonic_solve(factor, 1, l, d, l, m, rest);
    kernel_gradient(shape->phi, R, X, dL_df, n, shape->Q, dq);
    gather(J, shape->w, 1.0, dq, grad);
    kernel_gradient(shape->phi, n, shape->Q, shape->w, n, shape->Q, dq);
    gather(J, l, -1.0, dq, grad);
    kernel_gradient(shape->phi, n, shape->Q, l, n, shape->Q, dq);
    gather(J, shape->w, -1.0, dq, grad);
    for (size_t k = 0; k < n; k++)
        for (size_t a = 0; a < 3; a++)
            grad[3 * (k % J) + a] -= l[k] * shape->c[1 + a] + shape->w[k] * m[1 + a];
}
