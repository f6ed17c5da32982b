#include "optimize/schedule.h"

#include "optimize/optimizer.h"

schedule schedule_of_stage(const apsm_options *o, int stage)
{
    schedule s = { .epochs = stage == APSM_STAGE_1 ? o->stage1_epochs : o->stage2_epochs };
    if (stage == APSM_STAGE_FIDELITY) s.epochs = o->fidelity > 0 ? o->fidelity_rounds : 0;
    s.decay1 = (long)(o->decay1_at * (double)s.epochs);
    s.decay2 = (long)(o->decay2_at * (double)s.epochs);
    if (stage == APSM_STAGE_1 && o->geodesic_correspondence && o->gamma > 0) {
        const long half = s.epochs / 2 > 0 ? s.epochs / 2 : 1;
        s.pass_interval = o->geodesic_interval < half ? o->geodesic_interval : half;
        s.settle = o->settle_epochs;
    }
    return s;
}

/* Beta falls with alpha: the balance of the two decides where particles end, and a beta that stayed
 * would draw them away from the tips of the shapes at the end. */
static void decay(weights *w, const apsm_options *o, double gamma_decay)
{
    w->alpha *= o->alpha_decay;
    w->beta *= o->beta_decay;
    w->gamma *= gamma_decay;
}

/* Long steps, neighbourhoods that hold, and little of what takes variation for noise. */
static void settle(weights *w)
{
    w->alpha *= 2.0;
    w->beta *= 0.4;
    w->gamma *= 2.0;
}

weights weights_of_epoch(const apsm_options *o, const schedule *s, int stage, long epoch,
                         long epochs_run)
{
    weights w = { .alpha = o->alpha, .beta = o->beta, .gamma = o->gamma };
    if (stage == APSM_STAGE_2) {
        w.alpha *= o->stage2_alpha_factor;
        w.c = o->adaptivity;
    }
    if (epoch < 0) settle(&w);
    if (epoch >= s->decay1) decay(&w, o, o->gamma_decay1);
    if (epoch >= s->decay2) decay(&w, o, o->gamma_decay2);
    if (epochs_run < o->burn_in) w.beta = w.gamma = 0;
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
