/* optimizer.h -- moves the particles of a cohort: docs/method.md, "Step, snapping, schedule", the
 * two stages of the paper, then the fidelity stage of apsm/fidelity.h (12), an epoch of which is a
 * round.
 *
 * One epoch, per shape: near-surface points are drawn, the RBF-shape tells where the particles
 * describe the surface badly (c > 0), the gradients of the sampling, correspondence and
 * eigenshape losses are added up at the epoch's entry positions, one step is made, and the
 * particles return to the surface. */
#ifndef APSM_OPTIMIZER_H
#define APSM_OPTIMIZER_H

#include "initialize/cohort.h"
#include "optimize/options.h"
#include "optimize/state.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where stage 1 has no epochs: the pass of Algorithm 1 that its first one begins with, once, over
 * the first particles; then stage 1 is behind.  If many are mismatched, epochs to settle are to
 * come (apsm_draws_points), and the pass is left to the first of them.  On failure the state is as
 * it was. */
apsm_status apsm_first_pass(apsm_context *ctx, const apsm_cohort *cohort,
                            const apsm_optimize_options *options,
                            apsm_optimizer_state *state) APSM_NODISCARD;

/* Runs state to the end from wherever it is.  On APSM_ERR_INTERRUPTED state is that of the last
 * full epoch.  Results depend on cohort, options, state and the context's seed alone.
 * O(epochs * I * (R J + J^2 if c > 0) + I J^3 + I^2 J) time, O(I J^2 + threads * J^2) memory, or
 * O(I J + threads * J^2) and J^3 in every epoch where the factors of I shapes are more than 1 GB.
 */
apsm_status apsm_optimize(apsm_context *ctx, const apsm_cohort *cohort,
                          const apsm_optimize_options *options, apsm_optimizer_state *state,
                          apsm_epoch_fn on_epoch, void *user) APSM_NODISCARD;

/* Bytes of the factor that an adaptive stage keeps for each of I shapes with J particles; 0: new
 * ones are made in every epoch, as where all of them are more than anyone's memory.  No other limit
 * decides, for it decides the result. */
double apsm_kept_factor_bytes(const apsm_optimize_options *options, size_t I, size_t J);

/* Spreads the particles P (J x 3, in/out, on the surface) of shape i by the sampling loss alone
 * with falling steps: evenly if c = 0, else by the surface error, with c of (5). */
apsm_status apsm_spread(apsm_context *ctx, const apsm_cohort *cohort, size_t i,
                        const apsm_optimize_options *options, size_t J, long epochs, double c,
                        double *P) APSM_NODISCARD;

/* First particles P (I x J x 3, out, world frame): a farthest-point sample of the template, spread,
 * then carried to every shape as options->initialize says.  docs/method.md, "Initialisation".
 * Rows of fixed shapes are in, and stay; if the template is one, its particles are carried.
 * APSM_ERR_GEOMETRY names a shape with fewer vertices than particles. */
apsm_status apsm_first_particles(apsm_context *ctx, const apsm_cohort *cohort,
                                 const apsm_optimize_options *options, size_t J,
                                 double *P) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
