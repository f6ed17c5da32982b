/* settings.h -- which options a run has: those stored in the project, then those asked for. */
#ifndef APSM_SETTINGS_H
#define APSM_SETTINGS_H

#include "session/session.h"

/* Takes the options that are set, to see whether they can be taken: before a folder is made. */
apsm_status settings_try(apsm_run *run, const apsm_run_settings *settings);

/* Settles the run's options and stores all of them in the project.  With resume, what was asked for
 * must be what the run began with; options that change no particle may change, and what depends on
 * them is made again. */
apsm_status settings_settle(apsm_run *run, const apsm_run_settings *settings);

/* Adds the options that decide the particles, the seed and the version. */
void settings_hash(const apsm_run *run, apsm_sha256 *sha);

#endif
