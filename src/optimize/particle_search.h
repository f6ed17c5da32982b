/* particle_search.h -- the smallest number of particles that meets a surface error on shapes that
 * the model was not made from. */
#ifndef APSM_PARTICLE_SEARCH_H
#define APSM_PARTICLE_SEARCH_H

#include "initialize/cohort.h"
#include "optimize/options.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct apsm_particle_search {
    size_t J;
    double *P;       /* I x J x 3: to begin the fidelity stage from; owned, free() it */
    double error;    /* mean two-way distance on the shapes left out, in the input's unit */
    bool met;        /* error <= wanted */
    size_t left_out; /* shapes */
    size_t trials;   /* numbers of particles that were tried */
} apsm_particle_search;

/* From particles P (I x J x 3) at the end of stage 2.  Every fourth shape is left out: it takes no
 * part in the priors of (12) nor in the choice of the template's particles (apsm_reseat), and is
 * fitted with the prior that the others make.  Particles are added where the warp errs, up to
 * twice as many at a time, until options->error is met; then the number is halved in between
 * until it is within a sixteenth of one that does not do.  It ends unmet when twice as many
 * particles bring less than a tenth, or at a quarter of the template's vertices.
 * APSM_ERR_ARG: fewer than 6 shapes. */
apsm_status apsm_search_particles(apsm_context *ctx, const apsm_cohort *cohort,
                                  const apsm_optimize_options *options, size_t J, const double *P,
                                  apsm_particle_search *result) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
