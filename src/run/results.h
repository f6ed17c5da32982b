/* results.h -- what the steps came to, as arrays. */
#ifndef APSM_RUN_RESULTS_H
#define APSM_RUN_RESULTS_H

#include "session/session.h"

void run_forget_results(apsm_run *run);

#endif
