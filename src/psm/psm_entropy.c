#include "psm/psm_entropy.h"

#include <math.h>
#include <string.h>

#include "linalg/linalg.h"
#include "optimize/eigenshape_loss.h"

size_t psm_entropy_work_size(size_t I, size_t n)
{
    return 2 * I * I + I + n;
}

static double degrees(size_t I)
{
    return I > 1 ? (double)(I - 1) : 1;
}

/* Q <- Y, C <- Y Y^T / (I - 1). */
static void covariance(size_t I, size_t n, double *Q, double *C, double *mean)
{
    apsm_cohort_mean(I, n / 3, Q, mean);
    apsm_cohort_centre(I, n / 3, Q, mean, Q);
    apsm_gram(I, n, 1 / degrees(I), Q, C);
}

static double mean_energy(size_t I, size_t n, double *Q, double *grad, double *blocks, double *mean)
{
    double sum = 0;
    apsm_cohort_mean(I, n / 3, Q, mean);
    apsm_cohort_centre(I, n / 3, Q, mean, Q);
    memcpy(grad, Q, I * n * sizeof *grad);
    for (size_t x = 0; x < I * n; x++) sum += Q[x] * Q[x];
    for (size_t j = 0; j < n / 3; j++)
        for (size_t a = 0; a < 9; a++) blocks[9 * j + a] = a % 4 == 0;
    return 0.5 * sum;
}

static void diagonal_blocks(size_t I, size_t n, const double *grad, double *blocks)
{
    memset(blocks, 0, 3 * n * sizeof *blocks);
    for (size_t i = 0; i < I; i++)
        for (size_t j = 0; j < n / 3; j++) {
            const double *g = grad + i * n + 3 * j;
            for (size_t a = 0; a < 9; a++) blocks[9 * j + a] += g[a / 3] * g[a % 3];
        }
}

apsm_status psm_entropy(size_t I, size_t n, double reg, double *Q, double *grad, double *blocks,
                        double *value, double *work)
{
    double *C = work, *M = C + I * I, *mean = M + I * I + I;
    if (isinf(reg)) {
        *value = mean_energy(I, n, Q, grad, blocks, mean);
        return APSM_OK;
    }
    covariance(I, n, Q, C, mean);
    memset(M, 0, I * I * sizeof *M);
    for (size_t i = 0; i < I; i++) {
        C[i * I + i] += reg;
        M[i * I + i] = 1;
    }
    APSM_TRY(apsm_cholesky(I, C));
    *value = 0.5 * degrees(I) * apsm_cholesky_logdet(I, C);
    apsm_cholesky_solve(I, C, I, M);
    apsm_gemm(0, 0, I, n, I, 1, M, I, Q, n, 0, grad, n);
    diagonal_blocks(I, n, grad, blocks);
    return isfinite(*value) ? APSM_OK : APSM_ERR_SINGULAR;
}

apsm_status psm_largest_variance(size_t I, size_t n, double *Q, double *largest, double *work)
{
    double *C = work, *vectors = C + I * I, *values = vectors + I * I, *mean = values + I;
    covariance(I, n, Q, C, mean);
    APSM_TRY(apsm_symmetric_eigen(I, C, values, vectors));
    *largest = values[0];
    return APSM_OK;
}
