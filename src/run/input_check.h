/* input_check.h -- whether the inputs are still those that were groomed: verify and --resume ask.
 */
#ifndef APSM_RUN_INPUT_CHECK_H
#define APSM_RUN_INPUT_CHECK_H

#include "input/input.h"
#include "session/session.h"

/* An input of the manifest, and what is there now.  Texts are borrowed from the manifest; those
 * that a damaged one lacks are "?". */
typedef struct input_check {
    const char *name, *path;
    const char *sha256; /* NULL: none recorded */
    enum { INPUT_SAME, INPUT_CHANGED, INPUT_MISSING, INPUT_UNKNOWN } state;
} input_check;

/* Looks at every input of the manifest: where the project says, seen from the model folder, or
 * where it was seen from when it was read; at the better of the two.  With list, at the case of its
 * name.  *checks is malloc'ed, also on failure. */
apsm_status input_check_all(apsm_run *run, const apsm_input_list *list, input_check **checks,
                            size_t *n);

/* With --resume: refuses inputs that have changed since they were groomed; list as above.  Missing
 * ones are a warning: the groomed shapes are all that is needed. */
apsm_status input_check_resume(apsm_run *run, const apsm_input_list *list);

#endif
