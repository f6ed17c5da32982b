/* shapes.h -- the groomed shapes of a model folder in memory. */
#ifndef APSM_RUN_SHAPES_H
#define APSM_RUN_SHAPES_H

#include "session/session.h"

/* Loads groomed meshes and transforms unless they are there; refuses a project that has not been
 * groomed. */
apsm_status run_load_meshes(apsm_run *run);
/* Fails: the folder has no project. */
apsm_status run_no_project(const apsm_run *run);
/* Also builds the cohort, unless as much of it is there; distance fields are for J particles. */
apsm_status run_load_cohort(apsm_run *run, run_fields wanted);
/* RUN_OWN_FIELDS if the two stages have epochs, else `otherwise`; none for method psm. */
run_fields run_fields_wanted(const apsm_run *run, run_fields otherwise);
/* Forgets what was loaded: the groomed shapes have changed. */
void run_unload(apsm_run *run);

size_t run_template_index(const apsm_run *run);

#endif
