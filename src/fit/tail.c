/* The tail of F by the incomplete beta function, P(F > f) = I_x(b/2, a/2) with x = b / (b + a f);
 * I_x by its continued fraction (Abramowitz and Stegun 26.5.8), evaluated by Lentz's method. */
#include "fit/tail.h"

#include <math.h>

/* log Gamma(x), x > 0: recurrence up to 10, then Stirling's series; good to 1e-13.  (That of the
 * library stores a sign in a global.) */
static double log_gamma(double x)
{
    double shift = 0;
    for (; x < 10; x++) shift -= log(x);
    const double r = 1 / (x * x);
    const double series =
        (1.0 / 12 - r * (1.0 / 360 - r * (1.0 / 1260 - r * (1.0 / 1680 - r / 1188)))) / x;
    return shift + (x - 0.5) * log(x) - x + 0.9189385332046727 + series;
}

static double away_from_zero(double x)
{
    return fabs(x) < 1e-300 ? 1e-300 : x;
}

static double beta_fraction(double a, double b, double x)
{
    enum { MOST = 2000 };
    double c = 1, d = 1 / away_from_zero(1 - (a + b) * x / (a + 1)), h = d;
    for (int k = 1; k < MOST; k++) {
        const double m = k;
        double t = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
        d = 1 / away_from_zero(1 + t * d);
        c = away_from_zero(1 + t / c);
        h *= d * c;
        t = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
        d = 1 / away_from_zero(1 + t * d);
        c = away_from_zero(1 + t / c);
        h *= d * c;
        if (fabs(d * c - 1) < 1e-15) break;
    }
    return h;
}

static double incomplete_beta(double a, double b, double x)
{
    if (!(x > 0)) return 0;
    if (x >= 1) return 1;
    const double front =
        exp(log_gamma(a + b) - log_gamma(a) - log_gamma(b) + a * log(x) + b * log1p(-x));
    return x < (a + 1) / (a + b + 2) ? front * beta_fraction(a, b, x) / a
                                     : 1 - front * beta_fraction(b, a, 1 - x) / b;
}

double fit_tail_f(double f, double a, double b)
{
    return f > 0 ? incomplete_beta(b / 2, a / 2, b / (b + a * f)) : 1;
}

double fit_tail_mahalanobis(double d2, double shapes, double m)
{
    if (!(m > 0) || !(shapes > m)) return NAN;
    return fit_tail_f(d2 * shapes * (shapes - m) / ((shapes + 1) * (shapes - 1) * m), m,
                      shapes - m);
}
