/* synthetic.h -- cohorts whose correspondence is known: every shape is the image of the unit
 * sphere under a map of its own, and the same sphere point u is the same anatomical place on
 * every shape.  Shape i of n has the parameter t = -1 .. 1 (i/(n-1)). */
#ifndef APSM_TEST_SYNTHETIC_H
#define APSM_TEST_SYNTHETIC_H

#include <math.h>
#include <stdlib.h>

#include "geometry/bvh.h"
#include "shapes.h"

typedef enum synthetic_kind {
    SYNTHETIC_ELLIPSOID, /* half-axes vary independently */
    SYNTHETIC_BUMP,      /* a bump slides by +-35 degrees around an ellipsoid */
    SYNTHETIC_PLATE,     /* a plate 8 to 12 thick, bent more or less */
    SYNTHETIC_BLADE      /* the same, 2 thick */
} synthetic_kind;

/* Weyl sequence: spread-out parameters in [-1, 1], without a generator's state. */
static inline double synthetic_weyl(size_t i, double irrational)
{
    const double x = ((double)i + 0.5) * irrational;
    return 2.0 * (x - floor(x)) - 1.0;
}

static inline void synthetic_ellipsoid(size_t i, const double u[3], double x[3])
{
    x[0] = (45 + 8 * synthetic_weyl(i, 0.6180339887498949)) * u[0];
    x[1] = (30 + 5 * synthetic_weyl(i, 0.4142135623730950)) * u[1];
    x[2] = (20 + 3 * synthetic_weyl(i, 0.7320508075688772)) * u[2];
}

/* The bump sits where the turned direction is closest to +y; the surface around it turns with
 * it, less and less away from the xy-plane's upper half. */
static inline void synthetic_bump(double t, const double u[3], double x[3])
{
    const double near = exp(-2.0 * (1.0 - u[1])), angle = t * 35 * M_PI / 180 * near;
    const double c = cos(angle), s = sin(angle);
    const double v[3] = { c * u[0] + s * u[1], -s * u[0] + c * u[1], u[2] };
    const double d2 = u[0] * u[0] + (u[1] - 1) * (u[1] - 1) + u[2] * u[2];
    const double r = 1.0 + 0.45 * exp(-d2 / 0.18);
    x[0] = 40 * r * v[0];
    x[1] = 30 * r * v[1];
    x[2] = 25 * r * v[2];
}

/* A rounded box by the 6-norm, then bent about the y axis. */
static inline void synthetic_plate(double half, double t, const double u[3], double x[3])
{
    const double p = pow(fabs(u[0]), 6) + pow(fabs(u[1]), 6) + pow(fabs(u[2]), 6);
    const double r = 1.0 / pow(p, 1.0 / 6);
    const double a = 50 * r * u[0], b = 30 * r * u[1], c = half * r * u[2];
    const double bend = 0.008 + 0.005 * t, theta = bend * a; /* curvature 1 / radius */
    x[0] = (1 / bend + c) * sin(theta);
    x[1] = b;
    x[2] = (1 / bend + c) * cos(theta) - 1 / bend;
}

static inline void synthetic_map(synthetic_kind kind, size_t i, size_t n, const double u[3],
                                 double x[3])
{
    const double t = n > 1 ? 2.0 * (double)i / (double)(n - 1) - 1.0 : 0.0;
    switch (kind) {
    case SYNTHETIC_ELLIPSOID:
        synthetic_ellipsoid(i, u, x);
        break;
    case SYNTHETIC_BUMP:
        synthetic_bump(t, u, x);
        break;
    case SYNTHETIC_PLATE:
        synthetic_plate(5 + synthetic_weyl(i, 0.6180339887498949), t, u, x);
        break;
    case SYNTHETIC_BLADE:
        synthetic_plate(1, t, u, x);
        break;
    }
}

/* Shape i of n on an icosphere of this level: vertex v of every shape is the same place. */
static inline apsm_mesh synthetic_shape(synthetic_kind kind, size_t i, size_t n, int level)
{
    apsm_mesh mesh = shape_icosphere(level);
    for (size_t v = 0; v < mesh.nv; v++) {
        const double *p = mesh.V + 3 * v, u[3] = { p[0], p[1], p[2] };
        synthetic_map(kind, i, n, u, mesh.V + 3 * v);
    }
    return mesh;
}

/* Where the place of x (near shape's surface) lies on another shape of the cohort: both meshes
 * share their triangles, so the barycentric weights carry over. */
static inline void synthetic_carry(const apsm_bvh *shape, const apsm_mesh *other, const double x[3],
                                   double y[3])
{
    apsm_closest c;
    apsm_bvh_closest(shape, x, INFINITY, &c);
    apsm_surface_position(other, &c.on, y);
}

/* Mean distance, on the template, between the true image of the particles P of a shape and the
 * template's particles T (both J x 3, in the shapes' own frames). */
static inline double synthetic_truth_error(const apsm_bvh *shape, const apsm_mesh *template_mesh,
                                           size_t J, const double *P, const double *T)
{
    double sum = 0;
    for (size_t j = 0; j < J; j++) {
        double y[3], d2 = 0;
        synthetic_carry(shape, template_mesh, P + 3 * j, y);
        for (size_t k = 0; k < 3; k++) d2 += (y[k] - T[3 * j + k]) * (y[k] - T[3 * j + k]);
        sum += sqrt(d2);
    }
    return sum / (double)J;
}

#endif
