/* Eigenshape loss, dual form; docs/method.md, (9), (10).  Sums over shapes run in their order, sums
 * over coordinates are BLAS's (one thread). */
#include "optimize/eigenshape_loss.h"

#include <math.h>
#include <string.h>

#include "core/kernel.h"
#include "linalg/linalg.h"

apsm_eigenshape_options apsm_eigenshape_defaults(void)
{
    return (apsm_eigenshape_options){ .least = 0.0, APSM_OPTION_DEFAULTS(APSM_EIGENSHAPE_OPTIONS) };
}

void apsm_cohort_mean(size_t K, size_t J, const double *P, double *mean)
{
    const size_t n = 3 * J;
    memset(mean, 0, n * sizeof *mean);
    for (size_t k = 0; k < K; k++)
        for (size_t i = 0; i < n; i++) mean[i] += P[k * n + i];
    for (size_t i = 0; i < n; i++) mean[i] /= (double)K;
}

void apsm_cohort_centre(size_t K, size_t J, const double *P, const double *mean, double *Y)
{
    const size_t n = 3 * J;
    for (size_t k = 0; k < K; k++)
        for (size_t i = 0; i < n; i++) Y[k * n + i] = P[k * n + i] - mean[i];
}

static double size_of(size_t K, size_t J)
{
    return 3.0 * (double)J * (double)K;
}

apsm_status apsm_eigenshape_loss(size_t K, size_t J, const double *Y,
                                 const apsm_eigenshape_options *opt, double *loss, double *L,
                                 double *reg_used)
{
    if (K < 1 || J < 1 || !(opt->eigen_reg_absolute > 0.0 || opt->eigen_reg > 0.0))
        return APSM_ERR_ARG;
    double trace = 0.0;
    apsm_gram(K, 3 * J, 1.0 / size_of(K, J), Y, L);
    for (size_t k = 0; k < K; k++) trace += L[k * K + k];
    const double wanted = opt->eigen_reg_absolute > 0.0 ? opt->eigen_reg_absolute
                                                        : opt->eigen_reg * trace / (double)K;
    const double reg = fmax(wanted, opt->least);
    for (size_t k = 0; k < K; k++) L[k * K + k] += reg;
    APSM_TRY(apsm_cholesky(K, L));
    *loss = 0.5 * apsm_cholesky_logdet(K, L) *
            (opt->eigen_scale == APSM_EIGEN_FULL ? size_of(K, J) : 1.0);
    if (reg_used) *reg_used = reg;
    return isfinite(*loss) ? APSM_OK : APSM_ERR_SINGULAR;
}

/* grad (n) = sum_l w_l Y_l over the K rows of Y, four at a time. */
APSM_KERNEL static void add_rows(size_t K, size_t n, const double *w, const double *restrict Y,
                                 double *restrict grad)
{
    memset(grad, 0, n * sizeof *grad);
    size_t l = 0;
    for (; l + 4 <= K; l += 4) {
        const double a = w[l], b = w[l + 1], c = w[l + 2], d = w[l + 3], *y = Y + l * n;
        for (size_t i = 0; i < n; i++)
            grad[i] += (a * y[i] + b * y[n + i]) + (c * y[2 * n + i] + d * y[3 * n + i]);
    }
    for (; l < K; l++)
        for (size_t i = 0; i < n; i++) grad[i] += w[l] * Y[l * n + i];
}

void apsm_eigenshape_gradient(size_t K, size_t J, const double *Y, const double *L,
                              const apsm_eigenshape_options *opt, size_t k, double *grad,
                              double *work)
{
    const size_t n = 3 * J;
    const double scale = opt->eigen_scale == APSM_EIGEN_FULL ? 1.0 : 1.0 / size_of(K, J);
    memset(work, 0, K * sizeof *work);
    work[k] = scale;
    apsm_cholesky_solve(K, L, 1, work); /* row k of the symmetric inverse */
    add_rows(K, n, work, Y, grad);
}
