/* exp.h -- e^x by a polynomial: the same bits on every machine, and free of branches, so that
 * loops over it become vector code.
 *   x = n ln 2 + r, |r| <= ln 2 / 2,   e^x = 2^n (1 + r + r^2 / 2! + ... + r^13 / 13!)
 * The cut series is good to 5e-18; the result to 1 unit in the last place (measured against libm
 * in the tests).  Arguments below -700 count as -700 (1e-304), so 2^n is never subnormal. */
#ifndef APSM_CORE_EXP_H
#define APSM_CORE_EXP_H

#include <stdint.h>
#include <string.h>

/* For x <= 700. */
static inline double apsm_exp(double x)
{
    const double shift = 0x1.8p52; /* adding it rounds to an integer, left in the low bits */
    x = x > -700.0 ? x : -700.0;
    const double t = x * 0x1.71547652b82fep0 + shift, n = t - shift;
    const double r = (x - n * 0x1.62e42fefap-1) - n * 0x1.cf79abc9e3b3ap-40; /* ln 2 in two parts */
    const double r2 = r * r, r4 = r2 * r2, r8 = r4 * r4;
    const double a = (1.0 / 2 + r * (1.0 / 6)) + r2 * (1.0 / 24 + r * (1.0 / 120));
    const double b = (1.0 / 720 + r * (1.0 / 5040)) + r2 * (1.0 / 40320 + r * (1.0 / 362880));
    const double c =
        (1.0 / 3628800 + r * (1.0 / 39916800)) + r2 * (1.0 / 479001600 + r * (1.0 / 6227020800.0));
    const double p = 1.0 + (r + r2 * ((a + r4 * b) + r8 * c));
    uint64_t bits, power;
    memcpy(&bits, &p, sizeof bits);
    memcpy(&power, &t, sizeof power);
    bits += power << 52;
    double y;
    memcpy(&y, &bits, sizeof y);
    return y;
}

/* The same in single precision, for -87 <= x <= 87 (less counts as -87): the series ends with
 * r^7 / 7!, cut to 5e-9; the result is good to 2 units in the last place. */
static inline float apsm_expf(float x)
{
    const float shift = 0x1.8p23f;
    x = x > -87.0f ? x : -87.0f;
    const float t = x * 0x1.715476p0f + shift, n = t - shift;
    const float r = (x - n * 0x1.62e4p-1f) - n * 0x1.7f7d1cp-20f, r2 = r * r, r4 = r2 * r2;
    const float a = (1.0f / 2 + r * (1.0f / 6)) + r2 * (1.0f / 24 + r * (1.0f / 120));
    const float b = 1.0f / 720 + r * (1.0f / 5040);
    const float p = 1.0f + (r + r2 * (a + r4 * b));
    uint32_t bits, power;
    memcpy(&bits, &p, sizeof bits);
    memcpy(&power, &t, sizeof power);
    bits += power << 23;
    float y;
    memcpy(&y, &bits, sizeof y);
    return y;
}

/* 2^x in single precision, for -126 <= x <= 126 (less counts as -126): x = n + r, |r| <= 1/2, and
 * the polynomial of degree 5 with p(0) = 1 that errs least, by 9e-8 of 2^r; the result is good to 2
 * units in the last place.  Two thirds of the operations of apsm_expf. */
static inline float apsm_exp2f(float x)
{
    const float shift = 0x1.8p23f;
    x = x > -126.0f ? x : -126.0f;
    const float t = x + shift, n = t - shift, r = x - n, r2 = r * r;
    const float a = 0x1.ebf9bcp-3f + r * 0x1.c6b752p-5f, b = 0x1.3cea8ap-7f + r * 0x1.5bba16p-10f;
    const float p = 1.0f + (r * 0x1.62e42ap-1f + r2 * (a + r2 * b));
    uint32_t bits, power;
    memcpy(&bits, &p, sizeof bits);
    memcpy(&power, &t, sizeof power);
    bits += power << 23;
    float y;
    memcpy(&y, &bits, sizeof y);
    return y;
}

#endif
