/* psm.h -- the comparison method `psm`: particle-based shape modeling by entropy (Cates, Fletcher,
 * Styner, Shenton, Whitaker 2007; Meyer, Whitaker, Kirby et al. 2007), as ShapeWorks runs it.
 * docs/method.md, "Comparison methods".  It minimises
 *     rel H(Z) - sum_i H(P_i)
 * : shapes that vary in few ways, on each of which the particles lie spread out. src/psm/psm.c
 * says how, and where it differs from ShapeWorks. */
#ifndef APSM_PSM_H
#define APSM_PSM_H

#include "optimize/optimizer.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The first particle of every shape: the point of the template's surface closest to the upper
 * corner of its box, which lies at an end of the shape and not in a hollow, and what is closest to
 * it on the others.  state (made by apsm_optimizer_state_alloc) gets it J times. */
void apsm_psm_first_particle(const apsm_cohort *cohort, apsm_optimizer_state *state);

/* Numbers in state->own once the method has begun. */
size_t apsm_psm_own_size(size_t I, size_t J);

/* Runs state to the end from wherever it is: stage 1 splits the particles from 1 to J
 * (psm_iterations_per_split iterations after each split), stage 2 optimises them
 * (psm_optimization_iterations).  An epoch of the state, and a record, is an iteration; on_epoch is
 * called after every few (never across a split), so records are taken at these only.
 *
 * The cohort needs no distance fields.  Results depend on cohort, options and state alone.
 * On APSM_ERR_INTERRUPTED state is that of the last call of on_epoch.  Lengths of the psm_ options
 * are in psm_unit: the result is not independent of the unit unless psm_unit follows it.
 * O(iterations * I * J * (J + neighbours)) time, the J pair distances being cheap; O(I J) memory.
 */
apsm_status apsm_psm_optimize(apsm_context *ctx, const apsm_cohort *cohort,
                              const apsm_optimize_options *options, apsm_optimizer_state *state,
                              apsm_epoch_fn on_epoch, void *user) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
