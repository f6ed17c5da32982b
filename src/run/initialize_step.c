/* Groomed meshes to first particles: state/initial.ckpt and, to look at, particles/. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "psm/psm.h"
#include "run/fixed.h"
#include "run/particles.h"
#include "run/shapes.h"
#include "run/state.h"
#include "session/guard.h"
#include "session/kept.h"
#include "session/manifest.h"
#include "session/session.h"

/* Method psm begins with one particle a shape: it alone is shown, not its copies. */
static apsm_status write_first(apsm_run *run, const apsm_optimizer_state *state)
{
    double *P = malloc(state->I * 3 * sizeof *P);
    if (!P) return APSM_ERR_MEMORY;
    for (size_t i = 0; i < state->I; i++)
        memcpy(P + 3 * i, state->P + i * state->J * 3, 3 * sizeof *P);
    const apsm_status status = run_write_particles(run, 1, P);
    free(P);
    return status;
}

/* Each shape's are kept as soon as they are there. */
static apsm_status carry_particles(apsm_run *run, size_t J, double *P)
{
    char identity[65];
    APSM_TRY(fixed_load(run, J, P));
    APSM_TRY(kept_begin(run));
    APSM_TRY(run_identity(run, identity));
    kept_pieces_of_shapes(run, identity);
    kept_deal(run);
    return kept_end_share(
        run, apsm_first_particles(run->ctx, &run->cohort, &run->options.optimize, J, P));
}

static apsm_status seed_and_save(apsm_run *run, apsm_optimizer_state *state)
{
    const size_t J = (size_t)run->options.optimize.particles;
    APSM_TRY(apsm_optimizer_state_alloc(run->cohort.I, J, state));
    const bool psm = run->options.optimize.method == APSM_METHOD_PSM;
    if (psm)
        apsm_psm_first_particle(&run->cohort, state);
    else
        APSM_TRY(carry_particles(run, J, state->P));
    if (run->helps) return APSM_OK;
    /* An earlier run's checkpoint must not be taken for one of these particles. */
    APSM_TRY(run_remove(run, run_path(run, RUN_CHECKPOINT)));
    APSM_TRY(run_save_state(run, RUN_INITIAL, state, NULL, 0));
    return psm ? write_first(run, state) : run_write_particles(run, J, state->P);
}

apsm_status apsm_run_initialize(apsm_run *run)
{
    if (!run) return APSM_ERR_ARG;
    APSM_TRY(manifest_refuse_joint(run));
    const stage_clock clock = stage_begin();
    APSM_TRY(guard_files(run, "initialize", NULL));
    const run_fields fields = run_fields_wanted(run, RUN_TEMPLATE_FIELD);
    APSM_TRY(
        run_load_cohort(run, run->helps && fields == RUN_OWN_FIELDS ? RUN_TEMPLATE_FIELD : fields));
    APSM_TRY(manifest_set_options(run));
    if (!run->helps) APSM_TRY(stage_start(run, "initialize"));
    apsm_optimizer_state state = { 0 };
    apsm_status status = seed_and_save(run, &state);
    if (!run->helps) {
        if (status == APSM_OK) status = stage_end(run, "initialize", &clock);
        if (status == APSM_OK) status = kept_end(run);
    }
    apsm_optimizer_state_free(&state);
    return status;
}
