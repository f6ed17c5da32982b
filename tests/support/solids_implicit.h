/* solids_implicit.h -- fields that are negative inside a solid and about the distance near its
 * surface, to be joined smoothly. */
#ifndef APSM_TEST_SOLIDS_IMPLICIT_H
#define APSM_TEST_SOLIDS_IMPLICIT_H

#include <math.h>

/* Union, filleted by a radius of about r. */
static inline double solid_join(double a, double b, double r)
{
    const double h = fmax(r - fabs(a - b), 0);
    return fmin(a, b) - h * h / (4 * r);
}

/* Intersection, its edge rounded by about r. */
static inline double solid_round_max(double a, double b, double r)
{
    return -solid_join(-a, -b, r);
}

/* a without b. */
static inline double solid_carve(double a, double b, double r)
{
    return solid_round_max(a, -b, r);
}

/* Ellipsoid of half-axes a, b, c about (x0, y0, z0). */
static inline double solid_ball(const double x[3], double x0, double y0, double z0, double a,
                                double b, double c)
{
    const double d[3] = { x[0] - x0, x[1] - y0, x[2] - z0 }, r[3] = { a, b, c };
    double k = 0, g = 0;
    for (int i = 0; i < 3; i++) {
        k += d[i] * d[i] / (r[i] * r[i]);
        g += d[i] * d[i] / (r[i] * r[i] * r[i] * r[i]);
    }
    return g > 0 ? (k - sqrt(k)) / sqrt(g) : -fmin(a, fmin(b, c));
}

/* From (x0, y0, z0) with radius ra to (x1, y1, z1) with rb, round ends. */
static inline double solid_rod(const double x[3], double x0, double y0, double z0, double x1,
                               double y1, double z1, double ra, double rb)
{
    const double d[3] = { x[0] - x0, x[1] - y0, x[2] - z0 }, u[3] = { x1 - x0, y1 - y0, z1 - z0 };
    const double uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    const double t = fmin(fmax((d[0] * u[0] + d[1] * u[1] + d[2] * u[2]) / uu, 0), 1);
    double e = 0;
    for (int i = 0; i < 3; i++) e += (d[i] - t * u[i]) * (d[i] - t * u[i]);
    return sqrt(e) - (ra + t * (rb - ra));
}

/* Signed distance to a triangle of the plane, or nearly so outside its corners. */
static inline double solid_triangle(const double p[2], const double a[2], const double b[2],
                                    const double c[2])
{
    const double *corner[4] = { a, b, c, a };
    double d = -INFINITY;
    for (int k = 0; k < 3; k++) { /* corners run clockwise */
        const double *q = corner[k], *r = corner[k + 1];
        const double e[2] = { r[0] - q[0], r[1] - q[1] };
        d = fmax(d, ((p[1] - q[1]) * e[0] - (p[0] - q[0]) * e[1]) / hypot(e[0], e[1]));
    }
    return d;
}

#endif
