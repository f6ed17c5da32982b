/* make_cohort.h -- the half of make_synthetic that writes whole cohorts. */
#ifndef APSM_TEST_MAKE_COHORT_H
#define APSM_TEST_MAKE_COHORT_H

#include <stdbool.h>

#include "apsm/context.h"

bool is_cohort(const char *word); /* the name of a kind of anatomy.h */

/* argv as main's, at least three words; returns the exit code, 2 where options are wrong. */
int make_cohort(apsm_context *ctx, int argc, char **argv);

#endif
