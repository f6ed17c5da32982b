/* ridge.h -- a number from a shape: ridge regression on all particles, in its dual form, so that it
 * costs what the number of shapes does and not that of the particles. */
#ifndef APSM_STATISTICS_RIDGE_H
#define APSM_STATISTICS_RIDGE_H

#include "apsm/context.h"

/* y ~ y_mean + sum_i alpha_i <x_i - x_mean, x - x_mean>.  Owns its arrays; zero-initialise with
 * {0}, ridge_free leaves it so. */
typedef struct ridge {
    size_t N, V;
    double y_mean, lambda; /* the penalty, in units of the mean eigenvalue of the Gram matrix */
    double *x_mean;        /* V */
    double *slope;         /* V: sum_i alpha_i (x_i - x_mean) */
} ridge;

/* Of shapes X (N x V) with values y (N), N >= 4.  The penalty is that of a grid over nine decades
 * with the least mean square error of shapes left out one by one, which the Gram matrix's
 * eigenvectors give without fitting again (Golub, Heath, Wahba 1979).  O(N^2 V + N^3). */
apsm_status ridge_fit(apsm_context *ctx, size_t N, size_t V, const double *X, const double *y,
                      ridge *model) APSM_NODISCARD;
double ridge_predict(const ridge *model, const double *x);
void ridge_free(ridge *model);

/* predicted (N, out): every shape by models without its fold, with a penalty chosen without it;
 * shape i is in fold order[i] % folds, order being a permutation from the context's seed.  Parallel
 * over folds, the same for any number of threads. */
apsm_status ridge_cross_validate(apsm_context *ctx, size_t N, size_t V, const double *X,
                                 const double *y, size_t folds, double *predicted) APSM_NODISCARD;

#endif
