/* turned.h -- shapes of which it is known from elsewhere how they are turned: those of a joint, of
 * which the other parts tell. */
#ifndef APSM_RUN_TURNED_H
#define APSM_RUN_TURNED_H

#include "run/groomed.h"

/* in->turn (n x 9) <- rotations that give all shapes one orientation, the identity for those of
 * which nothing is known; NULL if nothing is known of any. */
apsm_status turned_find(apsm_run *run, groom_inputs *in) APSM_NODISCARD;

/* apsm_align_cohort of the shapes turned so, which then come in one orientation; alignment is that
 * of the shapes as they are. */
apsm_status turned_align(apsm_run *run, const groom_inputs *in, const groomed_cohort *cohort,
                         apsm_alignment *alignment) APSM_NODISCARD;

#endif
