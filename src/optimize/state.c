#include "optimize/state.h"

#include <stdlib.h>

#define TEXT(name, text) text,
const char *apsm_stop_text(apsm_stop stop)
{
    static const char *const texts[] = { APSM_STOP_LIST(TEXT) };
    return (unsigned)stop < APSM_STOP_COUNT ? texts[stop] : "unknown";
}
#undef TEXT

apsm_status apsm_optimizer_state_alloc(size_t I, size_t J, apsm_optimizer_state *state)
{
    *state = (apsm_optimizer_state){ .I = I, .J = J, .stage = APSM_STAGE_1, .best_mismatched = 2 };
    state->P = calloc(I * J * 3, sizeof *state->P);
    state->mean = calloc(J * 3, sizeof *state->mean);
    if (state->P && state->mean) return APSM_OK;
    apsm_optimizer_state_free(state);
    return APSM_ERR_MEMORY;
}

void apsm_optimizer_state_free(apsm_optimizer_state *state)
{
    free(state->P);
    free(state->mean);
    free(state->own);
    free(state->part);
    state->P = state->mean = state->own = NULL;
    state->own_size = 0;
    state->part = NULL;
}
