/* manifest.h -- the record that a run keeps of itself (folder/manifest_json.h): what was run on
 * what, when, and what it took. */
#ifndef APSM_MANIFEST_H
#define APSM_MANIFEST_H

#include <jansson.h>

#include "folder/manifest_json.h"
#include "folder/stages.h"
#include "session/session.h"

/* Reads the folder's manifest, or begins one. */
apsm_status manifest_open(apsm_run *run);
/* Seals it, unless it was changed since it was sealed last. */
apsm_status manifest_write(apsm_run *run);
/* Refuses to build on one that was changed. */
apsm_status manifest_check_seal(apsm_run *run);
void manifest_close(apsm_run *run);

/* Options and inputs (path, bytes, SHA-256) as they are now. */
apsm_status manifest_set_options(apsm_run *run);
apsm_status manifest_set_inputs(apsm_run *run, size_t n, const char *const *names,
                                const char *const *paths, char (*sha256)[65]);
/* What groom cropped (takes the reference over), or NULL: nothing. */
apsm_status manifest_set_cropped(apsm_run *run, json_t *cropped);
/* What grooming did to every shape (takes the reference over; run/groomed.h). */
apsm_status manifest_set_groomed(apsm_run *run, json_t *groomed);
/* What groom has to say of its shapes (takes the reference over; session/notes.h). */
apsm_status manifest_set_notes(apsm_run *run, json_t *notes);
/* What a project asked for and was not done, or NULL: nothing. */
apsm_status manifest_set_ignored(apsm_run *run, const char *text);
/* The stored SHA-256 of a named input, or NULL. */
const char *manifest_input_sha256(const apsm_run *run, const char *name);

/* Whether the folder holds a joint of several parts (src/assemble), not a model of one. */
bool manifest_is_joint(const apsm_run *run);
/* Refuses a step in such a folder, whose parts are models, of which the joint is made, and in one
 * of contours; the other in one of contours alone. */
apsm_status manifest_refuse_joint(const apsm_run *run);
apsm_status manifest_refuse_contours(const apsm_run *run);

/* A clock for one stage. */
typedef struct stage_clock {
    struct timespec wall, cpu;
} stage_clock;
stage_clock stage_begin(void);
double stage_wall(const stage_clock *clock); /* seconds so far */
/* Records the stage as done (later stages become undone), with the files it has written, and writes
 * the manifest. */
apsm_status stage_end(apsm_run *run, const char *stage, const stage_clock *clock);
/* The same for the report, which is none to be timed. */
apsm_status stage_close(apsm_run *run, const char *stage);
bool stage_is_done(const apsm_run *run, const char *stage);
/* Before the first file of a stage is written: it and later ones become undone, and the manifest,
 * which is written, says that it has begun.  guard_files has looked at the folder before. */
apsm_status stage_start(apsm_run *run, const char *stage);
/* Forgets that this stage and the later ones were done, and the list of their files, but not that
 * there are some of theirs. */
apsm_status stage_undo(apsm_run *run, const char *stage);

#endif
