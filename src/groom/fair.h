/* fair.h -- takes ripples of about a voxel off a surface that came from a mask. */
#ifndef APSM_GROOM_FAIR_H
#define APSM_GROOM_FAIR_H

#include "apsm/mesh.h"

/* Low-pass filter: ripples shorter than about `wavelength` go, no vertex moves farther than
 * `bound`, and the enclosed volume ends within 0.5 % of what it was.  The mesh must be closed.
 * Unlike a filter of the mask, it leaves a thin sheet standing however thin it is: a flat sheet has
 * no ripples.  O(nv) an iteration. */
apsm_status fair_surface(apsm_mesh *mesh, double wavelength, double bound);

#endif
