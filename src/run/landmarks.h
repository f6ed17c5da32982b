/* landmarks.h -- the landmarks of a run: where they come from, and what they are used for. */
#ifndef APSM_RUN_LANDMARKS_H
#define APSM_RUN_LANDMARKS_H

#include "evaluate/landmark_error.h"
#include "run/groom_inputs.h"

/* Reads what option landmarks or the project's column names into the run's, in the frames of the
 * inputs; tells what is common and what is missing.  Refused: a use that needs landmarks
 * where there are none. */
apsm_status landmarks_read(apsm_run *run, const groom_inputs *in);
/* From the frames of the inputs to those of the groomed meshes. */
void landmarks_mirror(apsm_run *run, const groom_inputs *in);
/* Warns of those that can hardly belong to their groomed shapes. */
void landmarks_tell_far(const apsm_run *run, const groom_inputs *in);
/* M (list.n x 16) anew if shapes are aligned by them, else left. */
apsm_status landmarks_align(apsm_run *run, const groom_inputs *in, size_t template_index,
                            double *M);
/* landmarks.csv, or its removal. */
apsm_status landmarks_write(apsm_run *run);

/* Those of a run in a folder, from landmarks.csv, unless they are there. */
apsm_status landmarks_load(apsm_run *run);
/* APSM_LANDMARKS_JUDGE, ... : auto is settled. */
int landmarks_use(const apsm_run *run);
/* Gives the run's cohort its anchors, if they are used so. */
apsm_status landmarks_anchor(apsm_run *run);
/* *world <- those of all shapes in the world. */
apsm_status landmarks_in_world(const apsm_run *run, landmark_table *world);

/* How far particles P (I x J x 3) take the template's landmarks from the shapes' own; {0} if there
 * are none. */
apsm_status landmarks_judge(apsm_run *run, size_t J, const double *P, landmark_errors *errors);
/* What they are used for, in the words of evaluation.json. */
const char *landmarks_use_word(const apsm_run *run);
void landmarks_tell(const apsm_run *run, const landmark_errors *errors);

#endif
