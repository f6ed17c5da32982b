/* frobenius_loss.h -- the correspondence loss of the comparison method `xu2023`: distance of a
 * shape's particles from the mean shape, the mean a constant.  docs/method.md, "Comparison
 * methods". */
#ifndef APSM_FROBENIUS_LOSS_H
#define APSM_FROBENIUS_LOSS_H

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* |P - mean|_F, or 1/2 |P - mean|_F^2 if squared, for P, mean (J x 3); grad (J x 3, out; NULL:
 * not wanted).  The norm's gradient is 0 at 0. */
double apsm_frobenius_loss(size_t J, const double *P, const double *mean, bool squared,
                           double *grad);

#ifdef __cplusplus
}
#endif
#endif
