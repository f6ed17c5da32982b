/* With y_j the mean's particles about their centre and e_a its principal axes,
 *
 *   c_0 = sum_j v_j.y_j / |y|,   c_a = sum_j (v_j.e_a)(y_j.e_a) / (sum_j (y_j.e_a)^2)^(1/2)   (M1)
 *   direction = max_a c_a - max_a -c_a                                                  (M2)
 *
 * None depends on the sign of an axis, and all are integrals over the surface: another seed,
 * another number of particles, or one shape less change them little.  Any such rule is undecided
 * somewhere; there the skewness of the scores speaks, which has nothing to do with (M1). */
#include "model/mode_sign.h"

#include <math.h>

#include "geometry/affine.h"

void apsm_mode_changes(size_t J, const double *mean, const double *mode, double tiny,
                       double change[APSM_MODE_CHANGES])
{
    double c[3], V[9], size2[APSM_MODE_CHANGES] = { 0 };
    apsm_principal_axes(J, mean, c, V);
    for (size_t a = 0; a < APSM_MODE_CHANGES; a++) change[a] = 0.0;
    for (size_t j = 0; j < J; j++)
        for (size_t a = 0; a < 3; a++) {
            double v = 0.0, y = 0.0;
            for (size_t k = 0; k < 3; k++) {
                v += mode[3 * j + k] * V[3 * k + a];
                y += (mean[3 * j + k] - c[k]) * V[3 * k + a];
            }
            change[0] += v * y;
            change[a + 1] += v * y;
            size2[0] += y * y;
            size2[a + 1] += y * y;
        }
    for (size_t a = 0; a < APSM_MODE_CHANGES; a++)
        change[a] = size2[a] > tiny * tiny ? change[a] / sqrt(size2[a]) : 0.0;
}

double apsm_mode_direction(const double change[APSM_MODE_CHANGES])
{
    double more = 0.0, less = 0.0;
    for (size_t a = 0; a < APSM_MODE_CHANGES; a++) {
        more = fmax(more, change[a]);
        less = fmax(less, -change[a]);
    }
    return more - less;
}

static double skewness(size_t I, size_t stride, const double *score)
{
    double sum2 = 0.0, sum3 = 0.0;
    for (size_t i = 0; i < I; i++) {
        const double b = score[i * stride];
        sum2 += b * b;
        sum3 += b * b * b;
    }
    return sum2 > 0.0 ? sum3 / sum2 * sqrt((double)I / sum2) : 0.0;
}

double apsm_mode_sign(const double change[APSM_MODE_CHANGES], size_t I, size_t stride,
                      const double *score)
{
    static const double rounding = 1e-9;
    const double direction = apsm_mode_direction(change), skew = skewness(I, stride, score);
    if (fabs(direction) >= APSM_MODE_TIE) return direction < 0.0 ? -1.0 : 1.0;
    if (fabs(skew) > rounding) return skew < 0.0 ? -1.0 : 1.0;
    return 0.0;
}
