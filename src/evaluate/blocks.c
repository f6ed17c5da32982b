/* See blocks.h. */
#include "evaluate/blocks.h"

#include <math.h>
#include <string.h>

#include "core/kernel.h"

enum { B = APSM_BLOCK, LANES = 8 };

size_t apsm_blocks_row(size_t J)
{
    return (J + B - 1) / B * 3 * B;
}

void apsm_blocks_pack(size_t J, const double *x, double *row)
{
    memset(row, 0, apsm_blocks_row(J) * sizeof *row);
    for (size_t j = 0; j < J; j++)
        for (size_t a = 0; a < 3; a++) row[(j / B * 3 + a) * B + j % B] = x[3 * j + a];
}

static double sum_lanes(const double s[LANES])
{
    return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

APSM_KERNEL double apsm_blocks_norm(size_t n, const double *a)
{
    double s[LANES] = { 0 };
    for (size_t b = 0; b < n; b++, a += 3 * B)
        for (size_t k = 0; k < B; k += LANES)
            for (size_t l = 0; l < LANES; l++) {
                const double x = a[k + l], y = a[B + k + l], z = a[2 * B + k + l];
                s[l] += sqrt(x * x + y * y + z * z);
            }
    return sum_lanes(s);
}

APSM_KERNEL double apsm_blocks_distance(size_t n, const double *a, const double *b)
{
    double s[LANES] = { 0 };
    for (size_t c = 0; c < n; c++, a += 3 * B, b += 3 * B)
        for (size_t k = 0; k < B; k += LANES)
            for (size_t l = 0; l < LANES; l++) {
                const double x = a[k + l] - b[k + l], y = a[B + k + l] - b[B + k + l],
                             z = a[2 * B + k + l] - b[2 * B + k + l];
                s[l] += sqrt(x * x + y * y + z * z);
            }
    return sum_lanes(s);
}

APSM_KERNEL void apsm_blocks_add(size_t n, double s, const double *b, double *a)
{
    for (size_t k = 0; k < 3 * B * n; k++) a[k] += s * b[k];
}
