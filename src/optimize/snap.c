/* Step and snap; docs/method.md, (11). */
#include "optimize/snap.h"

#include <math.h>

#include "geometry/bvh_guess.h"

static double length(const double x[3])
{
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

double apsm_step(size_t J, size_t terms, const double *weight, const double *const *grad,
                 double clip, double *step)
{
    double total = 0.0;
    for (size_t j = 0; j < J; j++) {
        double x[3] = { 0.0, 0.0, 0.0 };
        for (size_t m = 0; m < terms; m++)
            for (size_t a = 0; a < 3 && grad[m]; a++) x[a] -= weight[m] * grad[m][3 * j + a];
        const double size = length(x), shorten = size > clip ? clip / size : 1.0;
        for (size_t a = 0; a < 3; a++) step[3 * j + a] = shorten * x[a];
        total += shorten * size;
    }
    return J ? total / (double)J : 0.0;
}

void apsm_snap(size_t J, const double *D, const double *N, double *P)
{
    for (size_t j = 0; j < J; j++)
        for (size_t a = 0; a < 3; a++) P[3 * j + a] -= D[j] * N[3 * j + a];
}

double apsm_snap_closest(const apsm_bvh *bvh, size_t J, double *P, apsm_surface_point *on,
                         uint32_t *guess)
{
    double largest = 0.0;
    for (size_t j = 0; j < J; j++) {
        apsm_closest closest;
        uint32_t none = 0;
        bvh_closest_guess(bvh, P + 3 * j, INFINITY, guess ? guess + j : &none, &closest);
        for (size_t a = 0; a < 3; a++) P[3 * j + a] = closest.x[a];
        largest = fmax(largest, sqrt(closest.distance2));
        if (on) on[j] = closest.on;
    }
    return largest;
}
