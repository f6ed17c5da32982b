/* names.h -- what cases are called: their files' stems or, where these are not all different, what
 * differs in their paths. */
#ifndef APSM_INPUT_NAMES_H
#define APSM_INPUT_NAMES_H

#include "input/input.h"

/* Gives every case of the list that has none its name (malloc'ed).  subject01/seg.nii.gz,
 * subject02/seg.nii.gz: subject01, subject02; left/p1.ply, right/p1.ply: left_p1, right_p1.  They
 * may still be equal, as those of a.ply and a.stl are.  O(n log n) for n cases. */
apsm_status input_names(apsm_context *ctx, apsm_input_list *list);

#endif
