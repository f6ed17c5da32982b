#include "core/robust.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Hoare's FIND (Commun. ACM 4, 1961). */
double robust_select(size_t n, double *v, size_t k)
{
    ptrdiff_t lo = 0, hi = (ptrdiff_t)n - 1;
    while (lo < hi) {
        const double pivot = v[k];
        ptrdiff_t i = lo, j = hi;
        do {
            while (v[i] < pivot) i++;
            while (v[j] > pivot) j--;
            if (i <= j) {
                const double t = v[i];
                v[i++] = v[j];
                v[j--] = t;
            }
        } while (i <= j);
        if (j < (ptrdiff_t)k) lo = i;
        if ((ptrdiff_t)k < i) hi = j;
    }
    return v[k];
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

/* The k-th of the sorted numbers without one equal to x. */
static double kth_without(const double *sorted, size_t k, double x)
{
    return x <= sorted[k] ? sorted[k + 1] : sorted[k];
}

void robust_left_out_quantiles(size_t I, const double *x, double q, double *out, double *sorted)
{
    const double at = q * (double)(I - 2);
    const size_t low = (size_t)at, high = low + 2 < I ? low + 1 : low;
    for (size_t i = 0; i < I; i++) sorted[i] = x[i];
    qsort(sorted, I, sizeof *sorted, ascending);
    for (size_t i = 0; i < I; i++) {
        const double a = kth_without(sorted, low, x[i]), b = kth_without(sorted, high, x[i]);
        out[i] = a + (at - (double)low) * (b - a);
    }
}

/* The median of all but one is one of these, whichever that is; returns how many they are. */
static size_t possible_medians(size_t I, const double *sorted, double c[3])
{
    const size_t k = I / 2;
    c[0] = I % 2 ? 0.5 * (sorted[k - 1] + sorted[k]) : sorted[k - 1];
    c[1] = I % 2 ? 0.5 * (sorted[k - 1] + sorted[k + 1]) : sorted[k];
    c[2] = I % 2 ? 0.5 * (sorted[k] + sorted[k + 1]) : c[1];
    return I % 2 ? 3 : 2;
}

void robust_excesses(size_t I, const double *x, double least, double *excess, double *median,
                     double *scratch)
{
    double c[3], *sorted = scratch;
    for (size_t i = 0; i < I; i++) sorted[i] = x[i];
    qsort(sorted, I, sizeof *sorted, ascending);
    for (size_t i = 0; i < I; i++) median[i] = middle_without(I, sorted, x[i]);
    const size_t n = possible_medians(I, sorted, c);
    for (size_t k = 0; k < n; k++) {
        for (size_t i = 0; i < I; i++) sorted[i] = fabs(x[i] - c[k]);
        qsort(sorted, I, sizeof *sorted, ascending);
        for (size_t i = 0; i < I; i++) {
            if (median[i] != c[k]) continue;
            const double spread = middle_without(I, sorted, fabs(x[i] - c[k]));
            excess[i] = (x[i] - c[k]) / fmax(1.4826 * spread, least);
        }
    }
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
