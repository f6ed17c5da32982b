/* Distance from the mean shape; docs/method.md, "Comparison methods" (`xu2023`). */
#include "optimize/frobenius_loss.h"

#include <math.h>

double apsm_frobenius_loss(size_t J, const double *P, const double *mean, bool squared,
                           double *grad)
{
    double sum = 0.0;
    for (size_t i = 0; i < 3 * J; i++) sum += (P[i] - mean[i]) * (P[i] - mean[i]);
    const double norm = sqrt(sum), scale = squared ? 1.0 : norm > 0.0 ? 1.0 / norm : 0.0;
    if (grad)
        for (size_t i = 0; i < 3 * J; i++) grad[i] = scale * (P[i] - mean[i]);
    return squared ? 0.5 * sum : norm;
}
