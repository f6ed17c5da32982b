#include "optimize/terms.h"

#include <string.h>

#include "optimize/eigenshape_loss.h"

#define TERM_ROW(upper, lower) &term_##lower,
const term *const standard_terms[APSM_TERMS] = { APSM_TERM_LIST(TERM_ROW) };
#undef TERM_ROW

const char *apsm_loss_name(size_t t)
{
    return t < APSM_TERMS ? standard_terms[t]->name : NULL;
}

void gather_batch(optimizer *op)
{
    for (size_t k = 0; k < op->batch_size; k++)
        memcpy(op->Y + k * op->J * 3, particles(op, op->batch[k]), op->J * 3 * sizeof *op->Y);
    if (op->batch_size == op->I)
        apsm_cohort_mean(op->batch_size, op->J, op->Y, op->mean);
    else
        memcpy(op->mean, op->state->mean, op->J * 3 * sizeof *op->mean);
}
