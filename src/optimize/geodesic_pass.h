/* geodesic_pass.h -- Algorithm 1 over a whole cohort.  docs/method.md, "Geodesic correspondence
 * (Algorithm 1)". */
#ifndef APSM_OPTIMIZE_GEODESIC_PASS_H
#define APSM_OPTIMIZE_GEODESIC_PASS_H

#include "initialize/cohort.h"
#include "optimize/options.h"

typedef struct geodesic_pass_result {
    double mean, worst; /* share of mismatched particles (1.5 / F) after the pass, over the
                           shapes other than the template */
    long walked;        /* particles moved, all shapes */
} geodesic_pass_result;

/* Moves particles P (I x J x 3) of every shape but the template towards neighbours that they miss.
 * h is the length unit of the guard. */
apsm_status geodesic_pass(apsm_context *ctx, const apsm_cohort *cohort,
                          const apsm_optimize_options *options, size_t J, double h, double *P,
                          geodesic_pass_result *result);

#endif
