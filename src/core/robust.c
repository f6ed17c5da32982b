#include "core/robust.h"

#include <math.h>
#include <stdlib.h>

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double middle(size_t n, const double *sorted)
{
    return n % 2 ? sorted[n / 2] : 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]);
}

double robust_median(size_t n, double *x)
{
    qsort(x, n, sizeof *x, ascending);
    return middle(n, x);
}

/* Median of the I - 1 numbers that are left of the sorted ones without one equal to x. */
static double middle_without(size_t I, const double *sorted, double x)
{
    const size_t k = I / 2;
    if (I % 2 == 0) return x < sorted[k] ? sorted[k] : sorted[k - 1];
    const double low = x <= sorted[k - 1] ? sorted[k] : sorted[k - 1];
    const double high = x >= sorted[k + 1] ? sorted[k] : sorted[k + 1];
    return 0.5 * (low + high);
}

void robust_left_out_medians(size_t I, size_t n, const double *X, double *out, double *column)
{
    for (size_t c = 0; c < n; c++) {
        for (size_t i = 0; i < I; i++) column[i] = X[i * n + c];
        qsort(column, I, sizeof *column, ascending);
        for (size_t i = 0; i < I; i++) out[i * n + c] = middle_without(I, column, X[i * n + c]);
    }
}

double robust_left_out_median(size_t I, const double *x, size_t i, double *scratch)
{
    size_t n = 0;
    for (size_t k = 0; k < I; k++)
        if (k != i) scratch[n++] = x[k];
    return robust_median(n, scratch);
}

double robust_excess(size_t I, const double *x, size_t i, double least, double *scratch)
{
    const size_t n = I - 1;
    const double median = robust_left_out_median(I, x, i, scratch);
    for (size_t k = 0; k < n; k++) scratch[k] = fabs(scratch[k] - median);
    return (x[i] - median) / fmax(1.4826 * robust_median(n, scratch), least);
}

double robust_correlation(size_t n, size_t stride, const double *x, const double *y,
                          const uint32_t *at)
{
    double mx = 0.0, my = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
    for (size_t k = 0; k < n; k++) {
        mx += x[stride * k] / (double)n;
        my += y[stride * (at ? at[k] : k)] / (double)n;
    }
    for (size_t k = 0; k < n; k++) {
        const double u = x[stride * k] - mx, v = y[stride * (at ? at[k] : k)] - my;
        xx += u * u;
        yy += v * v;
        xy += u * v;
    }
    return xx > 0.0 && yy > 0.0 ? xy / sqrt(xx * yy) : 0.0;
}
