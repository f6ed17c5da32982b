#include "judge/coverage.h"

#include <math.h>

#include "geometry/nearest.h"

void apsm_coverage_reach(const apsm_mesh *mesh, size_t J, const double *P, double *work,
                         uint32_t *nearest, double *reach)
{
    double *distance = work + 4 * J;
    for (size_t j = 0; j < J; j++) reach[j] = 0.0;
    if (J == 0) return;
    apsm_nearest_points(mesh->nv, mesh->V, J, P, false, work, nearest, distance);
    for (size_t v = 0; v < mesh->nv; v++) reach[nearest[v]] = fmax(reach[nearest[v]], distance[v]);
}
