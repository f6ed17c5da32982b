/* stages.h -- the steps that fill a model folder, and the names of the files that each writes.
 * Paths are those from the model folder on. */
#ifndef APSM_FOLDER_STAGES_H
#define APSM_FOLDER_STAGES_H

#include <stdbool.h>
#include <stddef.h>

/* Whether a stage comes before another; false if there is none of that name. */
bool stage_is_before(const char *stage, const char *other);
/* Whether there is one of that name: files of others (joints) come from no stage. */
bool stage_is_known(const char *stage);
/* The k-th of those that are recorded as done; NULL beyond the last. */
const char *stage_name(size_t k);
/* The k-th of all, the report among them; NULL beyond the last. */
const char *stage_of_all(size_t k);

/* Whether the stage (NULL: any) writes files of this name; whether one from first to last does. */
bool stage_writes(const char *stage, const char *path);
bool stages_write_between(const char *first, const char *last, const char *path);

/* Whether a run may write a file of this name. */
bool folder_is_ours(const char *path);
/* NAME of "NAME.PID.tmp", a file that a killed run was writing: its length, or 0. */
size_t folder_left_over(const char *path);

#endif
