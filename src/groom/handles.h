/* handles.h -- what the handles of a cohort's masks are: anatomy, debris or a sinus. */
#ifndef APSM_GROOM_HANDLES_H
#define APSM_GROOM_HANDLES_H

#include <stddef.h>

typedef enum handles_kind {
    HANDLES_DEBRIS,  /* few, here and there: mended one by one (tunnels.h), or none */
    HANDLES_ANATOMY, /* most shapes have the same number of them, as vertebrae have a foramen */
    HANDLES_SINUS    /* many, from shape to shape others, all of them narrow: a branched sinus */
} handles_kind;

/* By which share of their size shapes with a sinus are closed: docs/results.md, "Masks". */
extern const double handles_sinus_closing;

/* Of n shapes: handles before they were mended one by one, and after.  *common (out) is the number
 * that most shapes have, of anatomy.  scratch of 2 n. */
handles_kind handles_judge(size_t n, const long *before, const long *after, long *common,
                           long *scratch);

#endif
