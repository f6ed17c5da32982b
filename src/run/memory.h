/* memory.h -- shapes that a program has handed over as arrays, in the place of input files. */
#ifndef APSM_RUN_MEMORY_H
#define APSM_RUN_MEMORY_H

#include "run/groom_inputs.h"

/* Names as of files: results are written under them. */
apsm_status run_check_name(const apsm_run *run, const char *name);
/* As groom_inputs_list: the shapes as cases, in the order of their names. */
apsm_status memory_list(apsm_run *run, groom_inputs *in);
/* As apsm_input_read: a copy of shape i of that list. */
apsm_status memory_read(apsm_context *ctx, const apsm_run *run, size_t i, const apsm_labels *labels,
                        apsm_input_shape *shape);
void memory_free(apsm_run *run);

#endif
