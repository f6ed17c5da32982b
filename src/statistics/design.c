/* Gram-Schmidt with reorthogonalisation ("twice is enough", Kahan/Parlett): columns are few. */
#include "statistics/design.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/linalg.h"

void apsm_design_free(apsm_design *design)
{
    free(design->X);
    free(design->Q);
    *design = (apsm_design){ 0 };
}

static double dot(size_t N, size_t q, const double *a, const double *b)
{
    double sum = 0;
    for (size_t i = 0; i < N; i++) sum += a[i * q] * b[i * q];
    return sum;
}

/* Column k of Q: of X, without the columns before.  Returns what is left of its length. */
static double orthonormalise(apsm_design *d, size_t k)
{
    const size_t N = d->N, q = d->q;
    double *v = d->Q + k;
    for (size_t i = 0; i < N; i++) v[i * q] = d->X[i * q + k];
    const double length = sqrt(dot(N, q, v, v));
    for (int pass = 0; pass < 2; pass++)
        for (size_t m = 0; m < k; m++) {
            const double c = dot(N, q, d->Q + m, v);
            for (size_t i = 0; i < N; i++) v[i * q] -= c * d->Q[i * q + m];
        }
    const double left = sqrt(dot(N, q, v, v));
    if (left > 0)
        for (size_t i = 0; i < N; i++) v[i * q] /= left;
    return length > 0 ? left / length : 0;
}

apsm_status apsm_design_make(apsm_context *ctx, size_t N, size_t r, const double *Z, size_t s,
                             const double *T, apsm_design *design)
{
    const size_t q = r + s;
    *design = (apsm_design){ N, r, q, malloc((N * q + 1) * sizeof(double)),
                             malloc((N * q + 1) * sizeof(double)) };
    apsm_status status = design->X && design->Q ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK && N <= q)
        status = apsm_fail(ctx, APSM_ERR_ARG,
                           "%zu subjects are too few for a model with %zu coefficients", N, q);
    for (size_t i = 0; i < N && status == APSM_OK; i++) {
        memcpy(design->X + i * q, Z + i * r, r * sizeof *Z);
        memcpy(design->X + i * q + r, T + i * s, s * sizeof *T);
    }
    for (size_t k = 0; k < q && status == APSM_OK; k++)
        if (!(orthonormalise(design, k) > 1e-9))
            status = apsm_fail(ctx, APSM_ERR_ARG,
                               "the %s cannot be told apart from the other terms of the formula; "
                               "leave out one that says the same",
                               k < r ? "terms that are allowed for" : "term that is tested");
    if (status != APSM_OK) apsm_design_free(design);
    return status;
}

/* X = Q R: R B = Q^T Y. */
apsm_status apsm_design_fit(const apsm_design *d, size_t V, const double *Y, double *B)
{
    const size_t q = d->q;
    double *R = malloc(q * q * sizeof *R);
    if (!R) return APSM_ERR_MEMORY;
    apsm_gemm(1, 0, q, q, d->N, 1, d->Q, q, d->X, q, 0, R, q);
    apsm_gemm(1, 0, q, V, d->N, 1, d->Q, q, Y, V, 0, B, V);
    for (size_t k = q; k-- > 0;) {
        for (size_t m = k + 1; m < q; m++)
            for (size_t v = 0; v < V; v++) B[k * V + v] -= R[k * q + m] * B[m * V + v];
        for (size_t v = 0; v < V; v++) B[k * V + v] /= R[k * q + k];
    }
    free(R);
    return APSM_OK;
}

void apsm_design_residuals(const apsm_design *d, size_t k, size_t V, const double *Y, double *e)
{
    memcpy(e, Y, d->N * V * sizeof *e);
    for (size_t m = 0; m < k; m++)
        for (size_t v = 0; v < V; v++) {
            double c = 0;
            for (size_t i = 0; i < d->N; i++) c += d->Q[i * d->q + m] * e[i * V + v];
            for (size_t i = 0; i < d->N; i++) e[i * V + v] -= c * d->Q[i * d->q + m];
        }
}
