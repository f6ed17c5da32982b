/* figures.h -- an evaluation as arrays with names. */
#ifndef APSM_EVALUATE_FIGURES_H
#define APSM_EVALUATE_FIGURES_H

#include "evaluate/metrics.h"

/* Owns everything.  Zero-initialise with {0}; figures_clear leaves it so. */
struct apsm_figures {
    apsm_evaluation evaluation;
    double *surface; /* 3 x shapes: mean, p95, max of the two-way distance; NULL: not measured */
};

/* Takes the evaluation over, also in an error; it is left {0}. */
apsm_status figures_take(apsm_evaluation *evaluation, apsm_figures *figures) APSM_NODISCARD;
void figures_clear(apsm_figures *figures);

#endif
