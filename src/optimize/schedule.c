#include "optimize/schedule.h"

#include "optimize/options.h"

schedule schedule_of_stage(const apsm_optimize_options *o, int stage)
{
    schedule s = { .epochs = stage == APSM_STAGE_1 ? o->schedule.stage1_epochs
                                                   : o->schedule.stage2_epochs };
    if (stage == APSM_STAGE_FIDELITY)
        s.epochs = o->fidelity.fidelity > 0 ? o->fidelity.fidelity_rounds : 0;
    s.decay1 = (long)(o->schedule.decay1_at * (double)s.epochs);
    s.decay2 = (long)(o->schedule.decay2_at * (double)s.epochs);
    if (stage == APSM_STAGE_1 && o->walk.geodesic_correspondence && o->schedule.gamma > 0) {
        const long half = s.epochs / 2 > 0 ? s.epochs / 2 : 1;
        s.pass_interval = o->walk.geodesic_interval < half ? o->walk.geodesic_interval : half;
        s.settle = o->schedule.settle_epochs;
    }
    return s;
}

/* Beta falls with alpha: the balance of the two decides where particles end, and a beta that stayed
 * would draw them away from the tips of the shapes at the end. */
static void decay(weights *w, const apsm_optimize_options *o, double gamma_decay)
{
    w->alpha *= o->schedule.alpha_decay;
    w->beta *= o->schedule.beta_decay;
    w->gamma *= gamma_decay;
}

/* Long steps, neighbourhoods that hold, and little of what takes variation for noise.  Where
 * neither stage has epochs these keep the spread that the template's particles were given. */
static void settle(weights *w, const apsm_optimize_options *o)
{
    w->alpha *= 2.0;
    w->beta *= 0.4;
    w->gamma *= 2.0;
    if (o->schedule.stage1_epochs == 0 && o->schedule.stage2_epochs == 0)
        w->c = o->schedule.adaptivity;
}

weights weights_of_epoch(const apsm_optimize_options *o, const schedule *s, int stage, long epoch,
                         long epochs_run)
{
    weights w = { .alpha = o->schedule.alpha,
                  .beta = o->schedule.beta,
                  .gamma = o->schedule.gamma };
    if (stage == APSM_STAGE_2) {
        w.alpha *= o->schedule.stage2_alpha_factor;
        w.c = o->schedule.adaptivity;
    }
    if (epoch < 0) settle(&w, o);
    if (epoch >= s->decay1) decay(&w, o, o->schedule.gamma_decay1);
    if (epoch >= s->decay2) decay(&w, o, o->schedule.gamma_decay2);
    if (epochs_run < o->schedule.burn_in) w.beta = w.gamma = 0;
    return w;
}

bool pass_is_due(const schedule *s, long epoch)
{
    enum { SETTLING = 10 };
    if (epoch < 0) return (epoch + s->settle) % SETTLING == 0;
    return s->pass_interval > 0 && (epoch % s->pass_interval == 0 || epoch == s->decay2);
}

size_t passes_of_stage(const schedule *s)
{
    size_t n = 0;
    for (long epoch = 0; epoch < s->epochs; epoch++) n += pass_is_due(s, epoch);
    return n;
}

size_t batch_begin(size_t I, size_t K, size_t b)
{
    const size_t batches = (I + K - 1) / K, least = I / batches, larger = I % batches;
    return b * least + (b < larger ? b : larger);
}

bool apsm_draws_points(const apsm_optimize_options *o, const apsm_optimizer_state *s)
{
    bool draws = s->epoch < 0;
    for (int stage = s->stage; stage <= APSM_STAGE_2; stage++)
        draws = draws || schedule_of_stage(o, stage).epochs > (stage == s->stage ? s->epoch : 0);
    return draws;
}
