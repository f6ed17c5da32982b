/* particles.h -- files of particles, in every frame that is wanted. */
#ifndef APSM_RUN_PARTICLES_H
#define APSM_RUN_PARTICLES_H

#include "session/session.h"

/* Particles of all shapes (I x J x 3, world) to particles/, with the paths in the project, and to
 * the results. */
apsm_status run_write_particles(apsm_run *run, size_t J, const double *P);
/* Those of one shape, world (J x 3), without the others: a shape that is added. */
apsm_status run_write_particles_of(apsm_run *run, size_t i, size_t J, const double *world);

#endif
