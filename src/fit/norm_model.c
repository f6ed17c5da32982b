/* Y = X B + noise by least squares; for a row x of the design h = x (X'X)^-1 x'.  With residuals e,
 * nu = N - q, S = E'E / nu of a particle's d coordinates:
 *   new       T^2 = e' S^-1 e / (1 + h),    T^2 (nu - d + 1) / (d nu)    ~ F(d, nu - d + 1)
 *   own       u = e' S^-1 e / (1 - h),      T^2 = u (nu - 1) / (nu - u)  ~ as new with nu - 1
 * the second being the first of a fit without that shape (Sherman and Morrison). */
#include "fit/norm_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/tail.h"
#include "linalg/linalg.h"

void norm_model_free(norm_model *model)
{
    free(model->h);
    free(model->E);
    free(model->h0);
    free(model->E0);
    *model = (norm_model){ 0 };
}

/* Q'Y (q x V), and from it residuals of both. */
static void residuals(norm_model *m, const double *Q, const double *Z, const double *Y,
                      const double *Y0, double *B)
{
    const size_t V = m->V, q = m->q;
    memcpy(m->E, Y, m->N * V * sizeof *Y);
    memcpy(m->E0, Y0, m->n * V * sizeof *Y0);
    apsm_gemm(1, 0, q, V, m->N, 1, Q, q, Y, V, 0, B, V);
    apsm_gemm(0, 0, m->N, V, q, -1, Q, q, B, V, 1, m->E, V);
    apsm_gemm(0, 0, m->n, V, q, -1, Z, q, B, V, 1, m->E0, V);
    for (size_t i = 0; i < m->N; i++)
        for (size_t k = 0; k < q; k++) m->h[i] += Q[i * q + k] * Q[i * q + k];
    for (size_t i = 0; i < m->n; i++)
        for (size_t k = 0; k < q; k++) m->h0[i] += Z[i * q + k] * Z[i * q + k];
}

/* Z (n x q, out) = X0 R^-1, where X = Q R. */
static void new_rows(const apsm_design *d, size_t n, const double *X0, double *R, double *Z)
{
    const size_t q = d->q;
    apsm_gemm(1, 0, q, q, d->N, 1, d->Q, q, d->X, q, 0, R, q);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < q; k++) {
            double z = X0[i * q + k];
            for (size_t m = 0; m < k; m++) z -= Z[i * q + m] * R[m * q + k];
            Z[i * q + k] = z / R[k * q + k];
        }
}

apsm_status norm_model_make(apsm_context *ctx, const norm_data *data, norm_model *model)
{
    const size_t N = data->N, n = data->n, q = data->q, V = data->V;
    apsm_design d = { 0 };
    *model = (norm_model){ .N = N, .n = n, .q = q, .d = data->d, .V = V };
    APSM_TRY(apsm_design_make(ctx, N, q, data->X, 0, data->X, &d));
    model->h = calloc(N + 1, sizeof *model->h);
    model->h0 = calloc(n + 1, sizeof *model->h0);
    model->E = malloc((N * V + 1) * sizeof *model->E);
    model->E0 = malloc((n * V + 1) * sizeof *model->E0);
    double *R = malloc((q * q + n * q + q * V + 1) * sizeof *R);
    const bool there = model->h && model->h0 && model->E && model->E0 && R;
    if (there) {
        double *Z = R + q * q;
        new_rows(&d, n, data->X + N * q, R, Z);
        residuals(model, d.Q, Z, data->Y, data->Y0, Z + n * q);
    } else
        norm_model_free(model);
    free(R);
    apsm_design_free(&d);
    return there ? APSM_OK : APSM_ERR_MEMORY;
}

/* ---- the whole shape ---- */

static double root_mean_square(const norm_model *m, const double *e)
{
    double sum = 0;
    for (size_t v = 0; v < m->V; v++) sum += e[v] * e[v];
    return sqrt((double)m->d * sum / (double)m->V);
}

double norm_distance_new(const norm_model *m, size_t k)
{
    return root_mean_square(m, m->E0 + k * m->V) / sqrt(1 + m->h0[k]);
}

double norm_distance_own(const norm_model *m, size_t i)
{
    const double left = 1 - m->h[i];
    return left > 1e-9 ? root_mean_square(m, m->E + i * m->V) / sqrt(left) : NAN;
}

double norm_t(const norm_model *m, size_t k, size_t v)
{
    double sum = 0;
    for (size_t i = 0; i < m->N; i++) sum += m->E[i * m->V + v] * m->E[i * m->V + v];
    return m->E0[k * m->V + v] / sqrt(sum / (double)(m->N - m->q) * (1 + m->h0[k]));
}

/* ---- particles ---- */

/* e' S^-1 e of particle j, S the residuals' covariance; NAN if that is singular. */
static double length2(const norm_model *m, size_t j, const double *e)
{
    const size_t d = m->d;
    double S[9] = { 0 }, x[3], sum = 0;
    for (size_t i = 0; i < m->N; i++) {
        const double *r = m->E + i * m->V + d * j;
        for (size_t a = 0; a < d; a++)
            for (size_t b = 0; b < d; b++) S[d * a + b] += r[a] * r[b] / (double)(m->N - m->q);
    }
    if (apsm_cholesky(d, S) != APSM_OK) return NAN;
    memcpy(x, e + d * j, d * sizeof *x);
    apsm_cholesky_solve(d, S, 1, x);
    for (size_t a = 0; a < d; a++) sum += x[a] * e[d * j + a];
    return sum;
}

static double tail(const norm_model *m, double T2, double nu)
{
    const double d = (double)m->d, rest = nu - d + 1;
    return isnan(T2) ? 1 : fit_tail_f(T2 * rest / (d * nu), d, rest);
}

void norm_particles_new(const norm_model *m, size_t k, double *T2, double *p)
{
    for (size_t j = 0; j < m->V / m->d; j++) {
        const double t2 = length2(m, j, m->E0 + k * m->V) / (1 + m->h0[k]);
        if (T2) T2[j] = t2;
        p[j] = tail(m, t2, (double)(m->N - m->q));
    }
}

void norm_particles_own(const norm_model *m, size_t i, double *p)
{
    const double nu = (double)(m->N - m->q), left = 1 - m->h[i];
    for (size_t j = 0; j < m->V / m->d; j++) {
        const double u = left > 1e-9 ? length2(m, j, m->E + i * m->V) / left : NAN;
        p[j] = tail(m, u < nu ? u * (nu - 1) / (nu - u) : INFINITY, nu - 1);
        if (isnan(u)) p[j] = 1;
    }
}
