/* What does not go together. */
#include "options/options.h"

apsm_status apsm_options_check(apsm_context *ctx, const apsm_options *options)
{
    const apsm_optimize_options *o = &options->optimize;
    if (o->particles < 7 && o->method != APSM_METHOD_PSM)
        return apsm_fail(
            ctx, APSM_ERR_ARG,
            "particles = %ld: at least 7 are needed, a particle and its six neighbours",
            o->particles);
    if (o->search.particles_auto != (o->search.error > 0))
        return apsm_fail(
            ctx, APSM_ERR_ARG,
            o->search.particles_auto
                ? "particles = auto: give the error to meet as well, such as error = 0.5"
                : "error = %g: is met by particles = auto only; give that as well",
            o->search.error);
    if (o->search.particles_auto &&
        (o->method != APSM_METHOD_ADAPTIVE || !(o->fidelity.fidelity > 0)))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "particles = auto: needs method = adaptive and fidelity above 0");
    if (o->schedule.decay2_at < o->schedule.decay1_at)
        return apsm_fail(ctx, APSM_ERR_ARG, "decay2_at = %g comes before decay1_at = %g",
                         o->schedule.decay2_at, o->schedule.decay1_at);
    if (o->schedule.stage1_epochs + o->schedule.stage2_epochs == 0 &&
        (o->method != APSM_METHOD_ADAPTIVE || !(o->fidelity.fidelity > 0)) &&
        o->method != APSM_METHOD_PSM)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "stage1_epochs and stage2_epochs are both 0, and there is no fidelity "
                         "stage: nothing to optimize; give them 50 each, say");
    if (o->step.step == APSM_STEP_LITERAL && o->sampling.error_gradient == APSM_ERROR_THROUGH_W &&
        o->sampling.sampling_scale == APSM_SAMPLING_VORONOI && o->step.step_clip == 0)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "error_gradient = through-w with sampling_scale = voronoi diverges "
                         "without a step limit: set step_clip");
    return APSM_OK;
}
