/* coverage.h -- how far the surface reaches beyond the particles: ends that they have missed. */
#ifndef APSM_JUDGE_COVERAGE_H
#define APSM_JUDGE_COVERAGE_H

#include "apsm/mesh.h"

/* reach (J, out): how far the farthest vertex is among those that are closest to the particle; P:
 * J x 3, in the mesh's frame.  work: 4J + nv; nearest: nv.  O(nv J). */
void apsm_coverage_reach(const apsm_mesh *mesh, size_t J, const double *P, double *work,
                         uint32_t *nearest, double *reach);

#endif
