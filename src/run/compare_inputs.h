/* compare_inputs.h -- what only the cohort shows of a shape: that it is there twice, that it has
 * another unit, far coarser voxels, or other slices. */
#ifndef APSM_RUN_COMPARE_INPUTS_H
#define APSM_RUN_COMPARE_INPUTS_H

#include "run/groom_inputs.h"

/* Calls tell with one line for each; in has been read, without a bad shape or with some (those are
 * left out).  Sizes and voxels are compared with the median's. */
apsm_status compare_inputs(const groom_inputs *in, void (*tell)(void *user, const char *line),
                           void *user);

/* The same of sizes, voxels and slices alone. */
typedef void (*unlike_shape)(void *user, const char *shape, const char *text);
apsm_status compare_sizes(const groom_inputs *in, unlike_shape tell, void *user);

/* Calls tell for every shape whose file is, byte for byte, that of an earlier one, too. */
typedef void (*same_file)(void *user, const apsm_input_case *first, const apsm_input_case *again);
apsm_status compare_files(const groom_inputs *in, same_file tell, void *user);

#endif
