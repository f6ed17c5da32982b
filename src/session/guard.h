/* guard.h -- nothing that a run did not write is ever replaced.  A file in the model folder whose
 * name is one of a run's is a run's only if the manifest says so: it lists the file, or it says
 * that a stage which writes files of that name has begun ("begun": [STAGE, ...]). */
#ifndef APSM_GUARD_H
#define APSM_GUARD_H

#include "input/input.h"
#include "session/session.h"

/* The inputs of groom (list may be NULL), which no file to be written may be: compared by device
 * and inode, so that links deceive nobody.  And the files that the stages from `first` to run->last
 * (NULL: only that one) write: what is there must be a run's.  Refused by name before anything is
 * written. */
apsm_status guard_files(apsm_run *run, const char *first, const apsm_input_list *list);

/* groom replaces a model only if asked to.  A project that has not been groomed here (ShapeWorks',
 * say) is what to groom if there are no other inputs. */
apsm_status guard_model(apsm_run *run);

/* Whether the folder is a run's at all: it has a manifest or a journal of ours. */
apsm_status guard_is_model(apsm_run *run, bool *is);

#endif
