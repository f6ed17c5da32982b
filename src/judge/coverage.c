#include "judge/coverage.h"

#include <math.h>

#include "geometry/vec3.h"

void apsm_coverage_reach(const apsm_mesh *mesh, size_t J, const double *P, double *reach)
{
    for (size_t j = 0; j < J; j++) reach[j] = 0.0;
    for (size_t v = 0; v < mesh->nv; v++) {
        double least = INFINITY;
        size_t nearest = 0;
        for (size_t j = 0; j < J; j++) {
            const double d2 = vec3_distance2(mesh->V + 3 * v, P + 3 * j);
            if (!(d2 < least)) continue;
            least = d2;
            nearest = j;
        }
        if (J > 0) reach[nearest] = fmax(reach[nearest], sqrt(least));
    }
}
