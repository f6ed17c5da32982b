/* A low-pass filter with the uniform Laplacian  (L x)_v = mean of the neighbours - x_v:
 *
 *   x <- x + lambda L x,  x <- x - lambda L x
 *
 * multiplies the part of x with eigenvalue k of -L by 1 - (lambda k)^2 a round, never by more than
 * 1.  (Taubin's filter, SIGGRAPH 1995, has a second step somewhat longer than the first: it keeps
 * the volume by itself, but amplifies middle frequencies; here the volume is looked after at the
 * end.) On a mesh of edge e a ripple of wavelength l has the eigenvalue (pi e / l)^2; the number of
 * rounds takes the wanted wavelength down to about 1/sqrt(e). */
#include "groom/fair.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double lambda = 0.5, tolerance = 0.005;
enum { MOST_ROUNDS = 200 };

/* Y <- X + factor L X, by the half-edges: every edge of a closed mesh is seen once from each of
 * its ends. */
static void filter(const apsm_mesh *mesh, const double *degree, double factor, const double *X,
                   double *Y)
{
    memset(Y, 0, 3 * mesh->nv * sizeof *Y);
    for (size_t f = 0; f < mesh->nf; f++)
        for (size_t k = 0; k < 3; k++) {
            const size_t a = mesh->F[3 * f + k], b = mesh->F[3 * f + (k + 1) % 3];
            for (size_t c = 0; c < 3; c++) Y[3 * a + c] += X[3 * b + c];
        }
    for (size_t v = 0; v < mesh->nv; v++)
        for (size_t c = 0; c < 3; c++) {
            const double x = X[3 * v + c];
            Y[3 * v + c] = degree[v] > 0 ? x + factor * (Y[3 * v + c] / degree[v] - x) : x;
        }
}

/* No vertex farther than bound from where it was. */
static void hold_back(size_t nv, const double *from, double bound, double *X)
{
    for (size_t v = 0; v < nv; v++) {
        double d2 = 0;
        for (size_t c = 0; c < 3; c++) {
            const double d = X[3 * v + c] - from[3 * v + c];
            d2 += d * d;
        }
        if (d2 <= bound * bound) continue;
        const double share = bound / sqrt(d2);
        for (size_t c = 0; c < 3; c++)
            X[3 * v + c] = from[3 * v + c] + share * (X[3 * v + c] - from[3 * v + c]);
    }
}

/* Moves all vertices along their normals until the volume is within `tolerance` of what it was:
 * what edges and tips lost would otherwise inflate faces that were right. */
static void restore_volume(apsm_mesh *mesh, double volume, double *N)
{
    for (int round = 0; round < 2; round++) {
        const double off = volume - apsm_mesh_volume(mesh), excess = fabs(off) - tolerance * volume;
        if (!(excess > 0)) return;
        apsm_mesh_vertex_normals(mesh, N);
        const double d = copysign(excess, off) / apsm_mesh_area(mesh);
        for (size_t x = 0; x < 3 * mesh->nv; x++) mesh->V[x] += d * N[x];
    }
}

apsm_status fair_surface(apsm_mesh *mesh, double wavelength, double bound)
{
    const double ratio = 3.14159265358979323846 * apsm_mesh_mean_edge(mesh) / wavelength;
    const double decay = lambda * ratio * ratio; /* lambda k of the wavelength */
    const int rounds = (int)fmin(fmax(0.5 / (decay * decay), 1), MOST_ROUNDS);
    const double volume = apsm_mesh_volume(mesh);
    double *X = malloc(7 * mesh->nv * sizeof *X);
    if (!X) return APSM_ERR_MEMORY;
    double *from = X + 3 * mesh->nv, *degree = from + 3 * mesh->nv;
    memcpy(from, mesh->V, 3 * mesh->nv * sizeof *from);
    memset(degree, 0, mesh->nv * sizeof *degree);
    for (size_t k = 0; k < 3 * mesh->nf; k++) degree[mesh->F[k]] += 1;
    for (int n = 0; n < rounds; n++) {
        filter(mesh, degree, lambda, mesh->V, X);
        filter(mesh, degree, -lambda, X, mesh->V);
    }
    hold_back(mesh->nv, from, bound, mesh->V);
    restore_volume(mesh, volume, X);
    free(X);
    return APSM_OK;
}
