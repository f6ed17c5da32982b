/* The optimisation loop.  docs/method.md, "Step, snapping, schedule"; numbers in brackets are
 * equations of docs/method.md.
 *
 *   I, J, K, R   shapes, particles, shapes in a batch, near-surface points of a shape
 *   P_i, N_i     particles and unit normals of shape i (J x 3)
 *   t            the template; its particles at the epoch's start are everybody's target
 *   h            length unit of the stage, A = alpha h / 40
 *   gs, gc, ge   gradients of the sampling (7), correspondence (8), eigenshape (10) losses
 *   step_ij = -[A gs + gamma (h/8) gc + beta (h/8)^2 ge], shortened to h/4, then back to the
 *             surface                                                                   (11)
 *
 * All gradients of a batch are taken at its entry positions.  Each shape is one task with its
 * own random stream, and sums over shapes run in the order of the shapes: neither the number of
 * threads nor an interruption changes a byte. */
#include "optimize/optimizer.h"
#include "optimize/terms.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/deal.h"
#include "initialize/anchors.h"
#include "optimize/correspondence_loss.h"
#include "optimize/eigenshape_loss.h"
#include "optimize/epoch.h"
#include "optimize/geodesic_pass.h"

/* ---- the pieces of an epoch, for the cohort ---- */

/* Of one part; h (out): its spacing. */
static apsm_status freeze_part(const optimizer *op, double *h)
{
    const size_t t = op->cohort->template_index;
    memcpy(op->tP, particles(op, t), op->J * 3 * sizeof *op->tP);
    apsm_shape_find_on_rim(&op->cohort->shape[t], op->J, op->tP, op->on_rim);
    memcpy(op->tN, optimizer_normals(op, t), op->J * 3 * sizeof *op->tN);
    APSM_TRY(apsm_neighbours6(op->J, op->tP, op->N6));
    *h = apsm_spacing(op->J, op->tP, op->N6, op->h_j);
    return APSM_OK;
}

static apsm_status freeze_template(optimizer *op)
{
    apsm_optimizer_state *s = op->state;
    const bool begins = !(s->h > 0); /* h is fixed once a stage */
    double all = 0;
    for (size_t d = 0; d < cohort_parts(op->cohort); d++) {
        part_view view;
        double h;
        APSM_TRY(freeze_part(part_of(op, d, &view), &h));
        if (begins && s->part) s->part[d].h = h;
        add_part(op, d, h, &all);
    }
    if (begins) s->h = all;
    return APSM_OK;
}

/* A seeded order of the shapes if there is more than one batch (Fisher-Yates). */
static void shuffle(optimizer *op)
{
    for (size_t i = 0; i < op->I; i++) op->order[i] = i;
    if (op->K == op->I) return;
    apsm_random rng = apsm_random_stream(apsm_context_seed(op->ctx), APSM_STREAM_BATCH, 0,
                                         (uint64_t)op->epoch_seed);
    for (size_t i = op->I - 1; i > 0; i--) {
        const size_t j = (size_t)apsm_random_below(&rng, i + 1), other = op->order[j];
        op->order[j] = op->order[i];
        op->order[i] = other;
    }
}

/* What other processes have made of the batch's shapes, whose normals are then old ones. */
static apsm_status gather_shapes(optimizer *op)
{
    APSM_TRY(apsm_gather(op->ctx, op->batch_size, op->batch, op->J * 3 * sizeof *op->state->P,
                         op->state->P));
    for (size_t d = 0; d < cohort_parts(op->cohort); d++) {
        for (size_t k = 0; k < op->batch_size; k++)
            if (!apsm_is_own(op->ctx, op->batch[k])) op->fresh[d * op->I + op->batch[k]] = false;
        APSM_TRY(apsm_gather(op->ctx, op->batch_size, op->batch, sizeof *op->record,
                             op->record + d * op->I));
    }
    return APSM_OK;
}

/* What the batch has in common, of the terms over all parts and of those of each. */
static apsm_status prepare_terms(optimizer *op)
{
    for (size_t t = 0; t < op->n_terms; t++) {
        const term *of = op->terms[t];
        if (!of->prepare) continue;
        for (size_t d = 0; d < (of->over_parts ? 1 : cohort_parts(op->cohort)); d++) {
            part_view view;
            APSM_TRY(of->prepare(of->over_parts ? op : part_of(op, d, &view)));
        }
    }
    return APSM_OK;
}

static void finish_terms(optimizer *op)
{
    for (size_t t = 0; t < op->n_terms; t++) {
        const term *of = op->terms[t];
        for (size_t d = 0; of->finish && d < (of->over_parts ? 1 : cohort_parts(op->cohort)); d++) {
            part_view view;
            of->finish(of->over_parts ? op : part_of(op, d, &view));
        }
        if (of->figure) op->figure[t] += of->figure(op);
    }
}

static apsm_status run_batch(optimizer *op, const size_t *batch, size_t size)
{
    op->batch = batch;
    op->batch_size = size;
    const weights w = op->w;
    APSM_TRY(prepare_terms(op));
    APSM_TRY(apsm_own_for(op->ctx, size, batch, gradients_of_shape, op, NULL));
    finish_terms(op);
    APSM_TRY(apsm_own_for(op->ctx, size, batch, move_shape, op, NULL));
    op->w = w;
    return gather_shapes(op);
}

/* ---- Algorithm 1 and the stop rule of stage 1 ---- */

static void count_gain(apsm_optimizer_state *s, const apsm_epoch_record *r)
{
    const bool better = r->worst_mismatched < s->best_mismatched;
    s->passes_without_gain = better ? 0 : s->passes_without_gain + 1;
    if (better) s->best_mismatched = r->worst_mismatched;
}

/* The decay phase begins early if every shape has few mismatched particles, or if two passes
 * brought nothing; without one, the stage's last epoch. */
static void judge_pass(optimizer *op, const apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    const long last = op->schedule.epochs - 1, decay = op->schedule.decay1;
    if (s->epoch >= decay || op->o->walk.stop_rule == APSM_STOP_RULE_NEVER) return;
    count_gain(s, r);
    if (s->epoch == 0) return; /* the loss has not had its say yet */
    if (r->worst_mismatched <= op->o->walk.stop_mismatched)
        s->stage1_stop = APSM_STOP_MATCHED;
    else if (s->passes_without_gain >= 2 && op->o->walk.stop_rule == APSM_STOP_RULE_EITHER)
        s->stage1_stop = APSM_STOP_STALLED;
    if (s->stage1_stop != APSM_STOP_NOT_YET) s->epoch = decay < last ? decay : last;
}

/* First particles of which many are mismatched were not brought by registration, or it failed.
 * What follows presumes that they are about right: they get epochs of their own to settle. */
static void judge_first_pass(optimizer *op, const apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    if (op->schedule.settle == 0 || !(r->mismatched > op->o->schedule.settle_mismatched)) return;
    s->epoch = -op->schedule.settle;
    if (op->quiet) return;
    apsm_log(op->ctx, APSM_LOG_INFO,
             "%.0f %% of the first particles are mismatched: up to %ld epochs to settle come first",
             100.0 * r->mismatched, op->schedule.settle);
}

/* Settled if few are mismatched, or if a pass finds no fewer: what begins is the first epoch of
 * stage 1, or, where that has none, the last of these. */
static void judge_settling(optimizer *op, const apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    count_gain(s, r);
    if (s->epoch == -op->schedule.settle) return; /* it has not moved anything yet */
    if (r->worst_mismatched > op->o->walk.stop_mismatched && s->passes_without_gain < 2) return;
    s->passes_without_gain = 0;
    s->epoch = op->schedule.epochs > 0 ? 0 : -1;
}

/* Of one part, whose particles P (I x J x 3) are. */
static apsm_status pass_of_part(const optimizer *op, double *P, geodesic_pass_result *pass)
{
    APSM_TRY(geodesic_pass(op->ctx, op->cohort, op->o, op->J, op->state->h, P, pass));
    for (size_t i = 0; i < op->I; i++)
        if (cohort_moves(op->cohort, i)) apsm_anchors_hold(op->cohort, i, P + i * op->J * 3);
    return APSM_OK;
}

static apsm_status run_pass(optimizer *op, apsm_epoch_record *r)
{
    double *own = op->state->P, *const part = part_rows(op);
    if (op->cohort->part && !part) return APSM_ERR_MEMORY;
    memset(op->fresh, 0, op->I * cohort_parts(op->cohort) * sizeof *op->fresh);
    apsm_status status = APSM_OK;
    r->worst_mismatched = 0;
    for (size_t d = 0; d < cohort_parts(op->cohort) && status == APSM_OK; d++) {
        part_view view;
        geodesic_pass_result pass = { 0 };
        if (part) cohort_take_part(op->cohort, d, op->all, own, part);
        status = pass_of_part(part_of(op, d, &view), part ? part : own, &pass);
        if (part) cohort_put_part(op->cohort, d, op->all, part, own);
        add_part(op, d, pass.mean, &r->mismatched);
        r->worst_mismatched = fmax(r->worst_mismatched, pass.worst);
        r->walked += pass.walked;
    }
    free(part);
    APSM_TRY(status);
    const bool first = op->state->epochs_run == 0 && op->state->epoch == 0;
    if (op->state->epoch < 0)
        judge_settling(op, r);
    else
        judge_pass(op, r);
    if (first) judge_first_pass(op, r);
    return APSM_OK;
}

/* ---- epoch, stage, run ---- */

/* Over those that move. */
static double mean_over_shapes(const optimizer *op, size_t field)
{
    double sum = 0;
    size_t n = 0;
    for (size_t i = 0; i < op->I; i++) {
        if (!cohort_moves(op->cohort, i)) continue;
        double own = 0;
        for (size_t d = 0; d < cohort_parts(op->cohort); d++)
            add_part(op, d, *(const double *)((const char *)&op->record[d * op->I + i] + field),
                     &own);
        sum += own;
        n++;
    }
    return sum / (double)n;
}

static void fill_record(const optimizer *op, apsm_epoch_record *r)
{
    r->stage = op->state->stage;
    r->alpha = op->w.alpha;
    r->beta = op->w.beta;
    r->gamma = op->w.gamma;
    r->c = op->w.c;
    for (size_t t = 0; t < APSM_TERMS_MOST; t++) r->loss[t] = NAN;
    for (size_t t = 0; t < op->n_terms; t++)
        r->loss[t] = op->terms[t]->figure
                         ? op->figure[t]
                         : mean_over_shapes(op, offsetof(shape_record, loss) + t * sizeof(double));
    r->surface_error = sqrt(mean_over_shapes(op, offsetof(shape_record, error2))) / op->state->h;
    r->step = mean_over_shapes(op, offsetof(shape_record, step));
}

static void tell_progress(const optimizer *op, const apsm_epoch_record *r)
{
    static const char *const names[] = { "settling", "stage 1", "stage 2", "fidelity" };
    const bool settling = r->epoch < 0;
    const long before = settling ? op->schedule.settle : 0;
    const apsm_progress p = { .stage = names[settling ? 0 : r->stage],
                              .done = (size_t)(r->epoch + 1 + before),
                              .total = (size_t)(settling ? before : op->schedule.epochs),
                              .loss = { r->loss[0], r->loss[1], r->loss[2] },
                              .mismatched = r->mismatched };
    apsm_report_progress(op->ctx, &p);
}

/* Factors are made anew every RENEWAL epochs of a stage, at the positions then, which the state
 * keeps: whoever resumes in between makes the same ones. */
static apsm_status renew_factors(optimizer *op)
{
    enum { RENEWAL = 25 };
    apsm_optimizer_state *s = op->state;
    const size_t n = op->I * op->J * 3, surfaces = op->I * cohort_parts(op->cohort);
    if (!keeps_factors(op)) return APSM_OK;
    if (!op->kept) op->kept = calloc(surfaces, sizeof *op->kept);
    if (!op->kept) return APSM_ERR_MEMORY;
    if (s->epoch % RENEWAL != 0 && s->own_size == n) return APSM_OK;
    if (s->own_size != n) {
        free(s->own);
        s->own = optimizer_doubles(n);
        s->own_size = s->own ? n : 0;
    }
    if (!s->own) return APSM_ERR_MEMORY;
    memcpy(s->own, s->P, n * sizeof *s->own);
    for (size_t i = 0; i < surfaces; i++) op->kept[i].ready = false;
    return APSM_OK;
}

static apsm_status run_epoch(optimizer *op, apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    *r = (apsm_epoch_record){ .mismatched = NAN, .worst_mismatched = NAN };
    op->epoch_seed = s->epochs_run;
    memset(op->figure, 0, sizeof op->figure);
    APSM_TRY(freeze_template(op));
    if (pass_is_due(&op->schedule, s->epoch)) {
        APSM_TRY(run_pass(op, r));
        APSM_TRY(freeze_template(op));
    }
    r->epoch = s->epoch;
    op->w = weights_of_epoch(op->o, &op->schedule, s->stage, s->epoch, s->epochs_run);
    APSM_TRY(renew_factors(op));
    shuffle(op);
    for (size_t b = 0, first = 0; first < op->I; b++) {
        const size_t next = batch_begin(op->I, op->K, b + 1);
        APSM_TRY(run_batch(op, op->order + first, next - first));
        first = next;
    }
    if (op->K < op->I) apsm_cohort_mean(op->I, op->J, s->P, s->mean);
    fill_record(op, r);
    s->epoch++;
    s->epochs_run++;
    return APSM_OK;
}

/* ---- the fidelity stage ---- */

static apsm_status begin_fidelity(optimizer *op)
{
    apsm_optimizer_state *s = op->state;
    optimizer_free_factors(op);
    if (s->epoch == 0) {
        const size_t n = op->I * op->J * 3;
        double *own = optimizer_doubles(n);
        if (!own) return APSM_ERR_MEMORY;
        memcpy(own, s->P, n * sizeof *own);
        free(s->own);
        s->own = own;
        s->own_size = n;
    }
    for (size_t d = 0; d < cohort_parts(op->cohort); d++) {
        part_view view;
        const optimizer *p = part_of(op, d, &view);
        APSM_TRY(apsm_fidelity_new(op->ctx, p->cohort, p->J,
                                   particles(p, p->cohort->template_index), &op->o->fidelity,
                                   &op->fidelity[d]));
        const double h = apsm_fidelity_spacing(op->fidelity[d]);
        apsm_fidelity_set_doubt(op->fidelity[d], p->state->doubt);
        if (s->part) s->part[d].h = h;
        add_part(op, d, h, &s->h);
    }
    return APSM_OK;
}

/* A round of part d, from particles P0 to P (I x its particles x 3). */
static apsm_status round_of_part(optimizer *op, size_t d, const double *P0, double *P,
                                 apsm_fidelity_record *f)
{
    apsm_optimizer_state *s = op->state;
    apsm_fidelity_record r;
    APSM_TRY(apsm_fidelity_round(op->ctx, op->fidelity[d], s->epoch, P0, P, &r));
    add_part(op, d, apsm_fidelity_doubt(op->fidelity[d]), &s->doubt);
    add_part(op, d, r.after, &f->after);
    add_part(op, d, r.step, &f->step);
    return APSM_OK;
}

/* Surfaces, and what the other shapes suggest, are taken part by part. */
static apsm_status round_of_parts(optimizer *op, apsm_fidelity_record *f)
{
    apsm_optimizer_state *s = op->state;
    double *P0 = part_rows(op), *P = part_rows(op);
    apsm_status status = P0 && P ? APSM_OK : APSM_ERR_MEMORY;
    for (size_t d = 0; d < cohort_parts(op->cohort) && status == APSM_OK; d++) {
        cohort_take_part(op->cohort, d, op->all, s->own, P0);
        cohort_take_part(op->cohort, d, op->all, s->P, P);
        status = round_of_part(op, d, P0, P, f);
        cohort_put_part(op->cohort, d, op->all, P, s->P);
    }
    free(P0);
    free(P);
    return status;
}

static apsm_status run_round(optimizer *op, apsm_epoch_record *r)
{
    apsm_optimizer_state *s = op->state;
    apsm_fidelity_record f = { 0 };
    if (!op->fidelity[0]) APSM_TRY(begin_fidelity(op));
    APSM_TRY(op->cohort->part ? round_of_parts(op, &f) : round_of_part(op, 0, s->own, s->P, &f));
    for (size_t d = 0; s->part && d < cohort_parts(op->cohort); d++)
        s->part[d].doubt = apsm_fidelity_doubt(op->fidelity[d]); /* none where a part failed */
    *r = (apsm_epoch_record){ .stage = s->stage,
                              .epoch = s->epoch,
                              .alpha = NAN,
                              .beta = NAN,
                              .gamma = NAN,
                              .c = NAN,
                              .loss = { NAN, NAN, NAN, NAN, NAN, NAN },
                              .surface_error = f.after,
                              .step = f.step,
                              .mismatched = NAN,
                              .worst_mismatched = NAN };
    s->epoch++;
    s->epochs_run++;
    return APSM_OK;
}

static void next_stage(apsm_optimizer_state *s)
{
    if (s->stage == APSM_STAGE_1 && s->stage1_stop == APSM_STOP_NOT_YET)
        s->stage1_stop = APSM_STOP_LIMIT;
    s->stage++;
    s->epoch = 0;
    s->h = 0;
}

/* An interrupted epoch, before which the state was `before` and particles were at `entry`. */
static void undo(optimizer *op, const apsm_optimizer_state *before, const double *entry)
{
    apsm_optimizer_state *s = op->state;
    const apsm_optimizer_state now = *s;
    *s = *before;
    s->own = now.own;
    s->own_size = now.own_size;
    memcpy(s->P, entry, op->I * op->J * 3 * sizeof *entry);
}

static apsm_status run_stages(optimizer *op, double *entry, apsm_epoch_fn on_epoch, void *user)
{
    apsm_optimizer_state *s = op->state;
    const size_t bytes = op->I * op->J * 3 * sizeof *entry;
    for (; s->stage < APSM_STAGE_DONE; next_stage(s)) {
        op->schedule = schedule_of_stage(op->o, s->stage);
        while (s->epoch < op->schedule.epochs) {
            apsm_epoch_record r;
            const apsm_optimizer_state before = *s;
            memcpy(entry, s->P, bytes);
            const bool last = s->stage == APSM_STAGE_FIDELITY;
            const apsm_status status = last ? run_round(op, &r) : run_epoch(op, &r);
            if (status != APSM_OK) {
                undo(op, &before, entry);
                return status;
            }
            if (!op->quiet) tell_progress(op, &r);
            if (on_epoch) APSM_TRY(on_epoch(user, s, &r));
            if (apsm_interrupted(op->ctx)) return APSM_ERR_INTERRUPTED;
        }
    }
    return APSM_OK;
}

/* Frees op. */
static apsm_status optimize(optimizer *op, apsm_epoch_fn on_epoch, void *user)
{
    apsm_optimizer_state *state = op->state;
    if (state->epochs_run == 0) apsm_cohort_mean(state->I, state->J, state->P, state->mean);
    double *entry = optimizer_doubles(state->I * state->J * 3);
    const apsm_status status = entry ? run_stages(op, entry, on_epoch, user) : APSM_ERR_MEMORY;
    free(entry);
    optimizer_free(op);
    return status;
}

/* Whether it is one of this cohort. */
static apsm_status check_state(apsm_context *ctx, const apsm_cohort *cohort,
                               const apsm_optimizer_state *state)
{
    if (cohort->part && cohort->first[cohort->parts] != state->J)
        return apsm_fail(ctx, APSM_ERR_ARG, "%zu particles in the state, %zu in the cohort's parts",
                         state->J, cohort->first[cohort->parts]);
    if (state->I != cohort->I || state->J < 7)
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "%zu shapes in the state, %zu in the cohort; at least 7 particles needed",
                         state->I, cohort->I);
    return APSM_OK;
}

apsm_status optimize_terms(apsm_context *ctx, const apsm_cohort *cohort,
                           const apsm_optimize_options *options, size_t n, const term *const *terms,
                           apsm_optimizer_state *state, apsm_epoch_fn on_epoch, void *user)
{
    optimizer op;
    APSM_TRY(check_state(ctx, cohort, state));
    APSM_TRY(optimizer_alloc(ctx, cohort, options, n, terms, state, &op));
    return optimize(&op, on_epoch, user);
}

apsm_status apsm_first_pass(apsm_context *ctx, const apsm_cohort *cohort,
                            const apsm_optimize_options *options, apsm_optimizer_state *state)
{
    optimizer op;
    apsm_epoch_record r = { 0 };
    const schedule s = schedule_of_stage(options, APSM_STAGE_1);
    if (state->stage != APSM_STAGE_1 || state->epochs_run > 0 || state->epoch != 0 ||
        s.epochs > 0 || s.pass_interval == 0)
        return APSM_OK;
    APSM_TRY(check_state(ctx, cohort, state));
    APSM_TRY(optimizer_alloc(ctx, cohort, options, APSM_TERMS, standard_terms, state, &op));
    op.schedule = s;
    const apsm_optimizer_state before = *state;
    double *entry = optimizer_doubles(op.I * op.J * 3);
    apsm_status status = entry ? APSM_OK : APSM_ERR_MEMORY;
    if (entry) memcpy(entry, state->P, op.I * op.J * 3 * sizeof *entry);
    if (status == APSM_OK) status = freeze_template(&op);
    if (status == APSM_OK) status = run_pass(&op, &r);
    const long epoch = status == APSM_OK ? state->epoch : 0;
    if (status == APSM_OK && epoch == 0)
        next_stage(state); /* interrupted from here on, it has had its pass */
    else if (entry)
        undo(&op, &before, entry);
    state->epoch = epoch;
    free(entry);
    optimizer_free(&op);
    return status;
}

apsm_status apsm_optimize(apsm_context *ctx, const apsm_cohort *cohort,
                          const apsm_optimize_options *options, apsm_optimizer_state *state,
                          apsm_epoch_fn on_epoch, void *user)
{
    return optimize_terms(ctx, cohort, options, APSM_TERMS, standard_terms, state, on_epoch, user);
}

/* ---- spreading the particles of one shape ---- */

enum { SPREAD_ALPHA = 10 }; /* steps up to h/4: a farthest-point sample is far from even */

/* Options of epochs with the sampling loss alone: `epochs` of stage 1, or, if c > 0, of stage 2. */
static apsm_optimize_options spreading(const apsm_optimize_options *options, long epochs, double c)
{
    apsm_optimize_options o = *options;
    o.schedule.stage1_epochs = c > 0 ? 0 : epochs;
    o.schedule.stage2_epochs = c > 0 ? epochs : 0;
    o.schedule.adaptivity = c;
    o.fidelity.fidelity = 0;
    if (!(c > 0) && o.step.step == APSM_STEP_SCALED) o.schedule.alpha = SPREAD_ALPHA;
    o.schedule.beta = o.schedule.gamma = 0;
    o.batch = 0;
    return o;
}

apsm_status apsm_spread(apsm_context *ctx, const apsm_cohort *cohort, size_t i,
                        const apsm_optimize_options *options, size_t J, long epochs, double c,
                        double *P)
{
    apsm_cohort one = { .I = 1, .shape = &cohort->shape[i], .anchors = cohort->anchors };
    if (one.anchors.L > 0) {
        one.anchors.has += one.anchors.L * i;
        one.anchors.x += 3 * one.anchors.L * i;
    }
    const apsm_optimize_options o = spreading(options, epochs, c);
    apsm_optimizer_state state = {
        .I = 1, .J = J, .stage = APSM_STAGE_1, .best_mismatched = 2, .P = P
    };
    state.mean = optimizer_doubles(3 * J);
    if (!state.mean) return APSM_ERR_MEMORY;
    optimizer op;
    apsm_status status = optimizer_alloc(ctx, &one, &o, APSM_TERMS, standard_terms, &state, &op);
    if (status == APSM_OK) {
        op.quiet = true;
        status = optimize(&op, NULL, NULL);
    }
    free(state.mean);
    free(state.own);
    return status;
}
