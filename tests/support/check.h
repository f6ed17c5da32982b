/* check.h -- comparisons and fixed random points for kernel tests. */
#ifndef APSM_TEST_CHECK_H
#define APSM_TEST_CHECK_H

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cmocka_all.h"
#include "core/random.h"

/* A test without memory is no test. */
static inline double *check_alloc(size_t n)
{
    double *x = calloc(n ? n : 1, sizeof *x);
    if (!x) abort();
    return x;
}

/* n unit vectors N (n x 3), the same on every machine, and P = center-free radius-scaled copies
 * (P may be NULL). */
static inline void check_sphere(uint64_t index, size_t n, double radius, double *N, double *P)
{
    apsm_random rng = apsm_random_stream(7, APSM_STREAM_TEST, index, n);
    for (size_t i = 0; i < n; i++) {
        double v[3], size2 = 0.0;
        for (size_t c = 0; c < 3; c++) {
            v[c] = apsm_random_normal(&rng);
            size2 += v[c] * v[c];
        }
        for (size_t c = 0; c < 3; c++) {
            N[3 * i + c] = v[c] / sqrt(size2);
            if (P) P[3 * i + c] = radius * N[3 * i + c];
        }
    }
}

static inline void check_uniform(uint64_t index, size_t n, double lo, double hi, double *x)
{
    apsm_random rng = apsm_random_stream(11, APSM_STREAM_TEST, index, n);
    for (size_t i = 0; i < n; i++) x[i] = lo + (hi - lo) * apsm_random_uniform(&rng);
}

/* Gradient against central differences in each of n variables of size `length`.  noise: relative
 * error of value(), DBL_EPSILON times the condition of what it solves.  The quotient errs by
 * O(h^2) + O(noise / h); h = noise^(1/3) length balances them at noise^(2/3), and the bound is 100
 * times that of the largest entry. */
typedef double (*check_function)(const double *x, void *user);
static inline void check_gradient(const char *what, size_t n, const double *x, double length,
                                  double noise, const double *grad, check_function value,
                                  void *user)
{
    const double h = cbrt(noise) * length, tol = 100.0 * cbrt(noise * noise);
    double *y = check_alloc(n), largest = fabs(value(x, user)) / length;
    for (size_t i = 0; i < n; i++) largest = fmax(largest, fabs(grad[i]));
    memcpy(y, x, n * sizeof *y);
    for (size_t i = 0; i < n; i++) {
        y[i] = x[i] + h;
        double fd = value(y, user);
        y[i] = x[i] - h;
        fd = (fd - value(y, user)) / (2.0 * h);
        y[i] = x[i];
        if (!(fabs(grad[i] - fd) <= tol * largest))
            fail_msg("%s: gradient[%zu] = %.17g, difference quotient %.17g", what, i, grad[i], fd);
    }
    free(y);
}

/* got == factor * want, bit for bit. */
static inline void check_scaled(const char *what, size_t n, const double *got, const double *want,
                                double factor)
{
    for (size_t i = 0; i < n; i++)
        if (got[i] != factor * want[i])
            fail_msg("%s[%zu] = %.17g, expected exactly %.17g", what, i, got[i], factor * want[i]);
}

#endif
