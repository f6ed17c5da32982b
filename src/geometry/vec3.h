/* vec3.h -- arithmetic on double[3], for this room and later ones. */
#ifndef APSM_GEOMETRY_VEC3_H
#define APSM_GEOMETRY_VEC3_H

#include <math.h>
#include <stddef.h>

static inline double vec3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double vec3_norm(const double a[3])
{
    return sqrt(vec3_dot(a, a));
}

static inline void vec3_sub(const double a[3], const double b[3], double out[3])
{
    for (int c = 0; c < 3; c++) out[c] = a[c] - b[c];
}

static inline double vec3_distance2(const double a[3], const double b[3])
{
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

/* out may not alias a or b. */
static inline void vec3_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* out += s a */
static inline void vec3_add_scaled(double out[3], double s, const double a[3])
{
    for (int c = 0; c < 3; c++) out[c] += s * a[c];
}

/* To unit length; returns the old length.  Zero stays zero. */
static inline double vec3_normalise(double a[3])
{
    const double r = vec3_norm(a);
    if (r > 0.0)
        for (int c = 0; c < 3; c++) a[c] /= r;
    return r;
}

/* n = (b - a) x (c - a): twice the triangle's area long, along its normal. */
static inline void vec3_triangle(const double a[3], const double b[3], const double c[3],
                                 double n[3])
{
    double u[3], v[3];
    vec3_sub(b, a, u);
    vec3_sub(c, a, v);
    vec3_cross(u, v, n);
}

/* Mean distance of n points (n x 3) from their nearest ones.  O(n^2). */
static inline double vec3_mean_spacing(size_t n, const double *x)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++) {
        double least = INFINITY;
        for (size_t k = 0; k < n; k++)
            if (k != i) least = fmin(least, vec3_distance2(x + 3 * i, x + 3 * k));
        sum += sqrt(least);
    }
    return sum / (double)n;
}

/* Squared distance of x to the segment from p to q. */
static inline double vec3_segment_distance2(const double x[3], const double p[3], const double q[3])
{
    double d[3], e[3];
    vec3_sub(q, p, d);
    vec3_sub(x, p, e);
    const double l2 = vec3_dot(d, d), along = vec3_dot(d, e);
    const double t = l2 > 0.0 ? fmin(fmax(along / l2, 0.0), 1.0) : 0.0;
    vec3_add_scaled(e, -t, d);
    return vec3_dot(e, e);
}

#endif
