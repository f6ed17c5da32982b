/* solids.h -- bodies given by their signed distance, and their masks on oriented voxel grids: what
 * a segmentation of a known shape would be. */
#ifndef APSM_TEST_SOLIDS_H
#define APSM_TEST_SOLIDS_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/volume.h"
#include "core/random.h"
#include "geometry/affine.h"

/* Signed distance at x, negative inside (exact near the surface). */
typedef double (*solid_fn)(const double x[3]);

static inline double solid_length(double x, double y, double z)
{
    return sqrt(x * x + y * y + z * z);
}
static inline double solid_ball12(const double x[3])
{
    return solid_length(x[0], x[1], x[2]) - 12.0;
}
static inline double solid_ball4(const double x[3])
{
    return solid_length(x[0], x[1], x[2]) - 4.0;
}
/* Half-axes 18, 10, 6; distance to first order. */
static inline double solid_ellipsoid(const double x[3])
{
    const double a = x[0] / 18, b = x[1] / 10, c = x[2] / 6;
    const double k = solid_length(a, b, c), g = solid_length(a / 18, b / 10, c / 6);
    return k * (k - 1.0) / fmax(g, 1e-9);
}
static inline double solid_torus(const double x[3])
{
    return solid_length(sqrt(x[0] * x[0] + x[1] * x[1]) - 13.0, x[2], 0.0) - 4.0;
}
/* Part of a spherical shell of radius 20 with a round rim, of thickness t. */
static inline double solid_plate(const double x[3], double t)
{
    const double z = x[2] + 18.0, rho = sqrt(x[0] * x[0] + x[1] * x[1]), half = 0.6;
    const double flat = fabs(solid_length(x[0], x[1], z) - 20.0);
    const double rim = solid_length(rho - 20.0 * sin(half), z - 20.0 * cos(half), 0.0);
    return (atan2(rho, z) < half ? flat : rim) - 0.5 * t;
}
static inline double solid_plate1(const double x[3])
{
    return solid_plate(x, 1.5);
}
static inline double solid_plate2(const double x[3])
{
    return solid_plate(x, 2.0);
}
static inline double solid_plate3(const double x[3])
{
    return solid_plate(x, 3.0);
}
static inline double solid_capsule(const double x[3], const double a[3], const double b[3],
                                   double r)
{
    double along = 0.0, l2 = 0.0, d[3];
    for (int c = 0; c < 3; c++) {
        along += (x[c] - a[c]) * (b[c] - a[c]);
        l2 += (b[c] - a[c]) * (b[c] - a[c]);
    }
    const double t = fmin(fmax(along / l2, 0.0), 1.0);
    for (int c = 0; c < 3; c++) d[c] = x[c] - a[c] - t * (b[c] - a[c]);
    return solid_length(d[0], d[1], d[2]) - r;
}
/* Shaft and two thick ends. */
static inline double solid_bone(const double x[3])
{
    static const double p[6][3] = { { -18, 0, 0 }, { 18, 0, 0 },  { -18, -2, 0 },
                                    { -18, 3, 0 }, { 18, -2, 2 }, { 18, 4, -2 } };
    return fmin(solid_capsule(x, p[0], p[1], 3.0),
                fmin(solid_capsule(x, p[2], p[3], 5.5), solid_capsule(x, p[4], p[5], 4.5)));
}
/* A tapering finger, radius 4.7 to 0.7. */
static inline double solid_tip(const double x[3])
{
    double d = INFINITY;
    for (int i = 0; i < 80; i++) {
        const double c = -12.0 + 24.0 * i / 79.0;
        const double to =
            solid_length(x[0] - c, x[1], x[2]) - (4.0 * (1.0 - (c + 12.0) / 26.0) + 0.7);
        if (to < d) d = to; /* on fmin gcc 12 for aarch64 breaks off */
    }
    return d;
}

/* A random rotation R (row-major). */
static inline void solid_rotation(apsm_random *rng, double R[9])
{
    double q[4], l = 0.0;
    for (int k = 0; k < 4; k++) {
        q[k] = apsm_random_normal(rng);
        l += q[k] * q[k];
    }
    for (int k = 0; k < 4; k++) q[k] /= sqrt(l);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double M[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
        2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
        2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)
    };
    memcpy(R, M, sizeof M);
}

/* The solid's mask on a grid that covers [-26, 26]^3 in a random pose: voxels of the given
 * spacing, axes turned (and mirrored if asked), origin shifted by part of a voxel. */
static inline apsm_volume solid_mask(solid_fn f, const double spacing[3], int mirrored,
                                     uint64_t seed)
{
    apsm_random rng = apsm_random_stream(seed, APSM_STREAM_TEST, 7, 0);
    apsm_volume v = { .label = NULL };
    double M[16], middle[3], lps[3];
    solid_rotation(&rng, v.direction);
    for (int c = 0; c < 3; c++) {
        v.spacing[c] = spacing[c];
        v.n[c] = (size_t)ceil(52.0 / spacing[c]) + 2;
        middle[c] = 0.5 * (double)(v.n[c] - 1) + apsm_random_uniform(&rng) - 0.5;
        if (mirrored) v.direction[3 * c] = -v.direction[3 * c];
    }
    apsm_volume_index_to_lps(&v, M);
    apsm_affine_apply(M, 1, middle, lps);
    for (int c = 0; c < 3; c++) v.origin[c] = -lps[c];
    apsm_volume_index_to_lps(&v, M);
    v.label = malloc(v.n[0] * v.n[1] * v.n[2] * sizeof *v.label);
    if (!v.label) abort();
    size_t i = 0;
    for (size_t z = 0; z < v.n[2]; z++)
        for (size_t y = 0; y < v.n[1]; y++)
            for (size_t x = 0; x < v.n[0]; x++) {
                const double index[3] = { (double)x, (double)y, (double)z };
                apsm_affine_apply(M, 1, index, lps);
                v.label[i++] = f(lps) < 0.0;
            }
    return v;
}

#endif
