/* outputs.h -- which files a run writes, and their SHA-256 in the manifest:
 *     "outputs": { PATH: [STAGE, BYTES, SHA-256], ... }, sorted by PATH. */
#ifndef APSM_OUTPUTS_H
#define APSM_OUTPUTS_H

#include "session/session.h"

/* A stage begins: what it and later ones have written is no longer known to be theirs.  groom,
 * which comes first, forgets everything. */
void outputs_forget(apsm_run *run, const char *stage);
/* A stage has ended: the files it has written and the project are recorded. */
apsm_status outputs_record(apsm_run *run, const char *stage);

/* One more file of a stage, path from the model folder on, as it is now. */
apsm_status outputs_add(apsm_run *run, const char *stage, const char *path);

/* Whether the manifest says that a file of this name is a run's (guard.h). */
bool outputs_are_a_runs(const apsm_run *run, const char *path);
/* Whether a file of the stage is listed. */
bool outputs_has_some_of(const apsm_run *run, const char *stage);
/* Whatever is in the folders that a run writes to, by paths from the model folder on. */
apsm_status outputs_list(apsm_run *run, apsm_file_list *all);

/* What became of a file since it was recorded. */
typedef enum output_state {
    OUTPUT_SAME,
    OUTPUT_CHANGED,
    OUTPUT_MISSING,
    OUTPUT_UNREADABLE
} output_state;

/* A record, and what is there now. */
typedef struct output {
    const char *path, *stage, *sha256; /* of the manifest, borrowed */
    long long bytes;
    output_state state;
} output;

/* Looks at all recorded files.  *list, in the order of the paths, is malloc'ed. */
apsm_status outputs_compare(apsm_run *run, output **list, size_t *n);
/* With --resume: refuses files of finished stages that are not what they were. */
apsm_status outputs_check(apsm_run *run);

/* Removes files that a killed run was writing; only while the folder is locked. */
apsm_status outputs_tidy(apsm_run *run);

#endif
