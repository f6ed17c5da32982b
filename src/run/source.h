/* source.h -- the project that is groomed (ShapeWorks', a user's, or the folder's own): nothing
 * that it says is lost.  Every key and column is used, kept in the project that is written, or
 * refused by name unless option ignore names it (docs/formats.md has the list). */
#ifndef APSM_RUN_SOURCE_H
#define APSM_RUN_SOURCE_H

#include "input/input.h"
#include "session/session.h"

/* *source <- the project that the run's inputs are, or {0} if they are files or folders.  Without
 * inputs it is the folder's own, which is left to the run. */
apsm_status source_read(apsm_run *run, apsm_project *source, bool *own);

/* Refuses what is asked for and cannot be done, all of it in one line; *ignored (malloc'ed, or
 * NULL)
 * <- what is not done because option ignore says so. */
apsm_status source_check(apsm_run *run, const apsm_project *source, char **ignored);

/* Whether the project asks that its landmarks guide the particles. */
bool source_wants_landmarks(const apsm_project *source);
/* Whether the list of option ignore has the word; and whether that of a run has. */
bool source_list_has(const char *list, const char *word);
bool source_ignores(const apsm_run *run, const char *word);

/* The weight of normals that the project asks for (optimize.use_normals, normals_strength); 0:
 * none.
 */
double source_normals(const apsm_project *source);
/* Field k that the project wants to correspond (optimize.field_attributes), of *length; NULL: there
 * are no more. */
const char *source_field(const apsm_project *source, size_t k, size_t *length);

/* Whether the particles of the row are to stay: column fixed, or if optimize.use_fixed_subjects
 * names a column, the one that has its choice there. */
bool source_is_fixed(const apsm_project *source, const apsm_subject *subject);

/* Lists the cases of the project under the names that it gives them. */
apsm_status source_list(apsm_run *run, const apsm_project *source, apsm_input_list *list);

/* The run's project <- groups, shapes that are set aside, and domain of the source, whose paths are
 * rewritten; no shapes yet. */
apsm_status source_begin(apsm_run *run, apsm_project *source);
/* subject, which has just been added to the run's project, <- whatever the source's row of that
 * name has beside what a run makes. */
apsm_status source_take_row(const apsm_project *source, apsm_subject *subject);

#endif
