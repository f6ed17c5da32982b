/* selection.h -- of a large cohort, the shapes that a page shows. */
#ifndef APSM_REPORT_SELECTION_H
#define APSM_REPORT_SELECTION_H

#include "folder/model_folder.h"

/* What more shapes would add to a page is its size. */
#define REPORT_MOST_SHAPES 400

/* Leaves in m (P, certificate and evaluation read) at most `most` shapes, if it has more: the
 * template, those that the certificate does not certify and those farthest from their
 * reconstruction, and the others evenly among all; in their order.  Of outliers that are more than
 * three quarters of `most` the first ones.  The model, the figures and the certificate stay those
 * of all.  *all (out): how many there were. */
apsm_status selection_make(size_t most, model_folder *m, size_t *all) APSM_NODISCARD;

#endif
