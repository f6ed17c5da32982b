/* terms.h -- the terms of the objective, a table: the loop knows a term by this alone.  A new one
 * is a file term_NAME.c and a line in APSM_TERM_LIST (optimize/state.h). */
#ifndef APSM_OPTIMIZE_TERMS_H
#define APSM_OPTIMIZE_TERMS_H

#include "optimize/workspace.h"

struct term {
    const char *name; /* of its column in history.csv */
    /* Over all parts of a subject at once; else of a part's surface, and called for each part as if
     * it were all (part_of). */
    bool over_parts;
    /* Whether it takes part in this epoch, by the weights of the schedule. */
    bool (*is_on)(const optimizer *op);
    /* Its factor in the step (11). */
    double (*weight)(const optimizer *op);
    /* What op->batch has in common, before its shapes; it may switch the term off (op->w).  NULL:
     * nothing. */
    apsm_status (*prepare)(optimizer *op);
    /* Of shape batch[k] where its particles are: its gradient g (J x 3) and loss.  Shapes run in
     * parallel; w is scratch. */
    apsm_status (*gradient)(const optimizer *op, size_t k, worker *w, double *loss, double *g);
    /* After the batch's gradients, before its steps.  NULL: nothing. */
    void (*finish)(optimizer *op);
    /* The batch's share in the epoch's figure, where that is not the mean of the shapes' losses. */
    double (*figure)(const optimizer *op);
};

#define TERM_EXTERN(upper, lower) extern const term term_##lower;
APSM_TERM_LIST(TERM_EXTERN)
#undef TERM_EXTERN
extern const term *const standard_terms[APSM_TERMS];

/* Y <- particles of the batch, mean <- theirs if the batch is the cohort, else the lagged one. */
void gather_batch(optimizer *op);

/* apsm_optimize with other terms, n <= APSM_TERMS_MOST. */
apsm_status optimize_terms(apsm_context *ctx, const apsm_cohort *cohort,
                           const apsm_optimize_options *options, size_t n, const term *const *terms,
                           apsm_optimizer_state *state, apsm_epoch_fn on_epoch, void *user);

#endif
