/* project_columns.h -- the columns of a project's data table that we know. */
#ifndef APSM_FILES_PROJECT_COLUMNS_H
#define APSM_FILES_PROJECT_COLUMNS_H

#include <jansson.h>

#include "files/files.h"
#include "files/project.h"

/* Room for prefix + domain. */
enum { APSM_KEY_LENGTH = 256 };
/* key <- prefix followed by the project's domain; returns key. */
const char *apsm_project_key(const apsm_project *project, const char *prefix,
                             char key[APSM_KEY_LENGTH]);
/* The input column of a row: shape_, segmentation_ or mesh_, whichever it has. */
const char *apsm_project_input_key(const apsm_project *project, const json_t *row,
                                   char key[APSM_KEY_LENGTH]);

/* The columns of a row in ShapeWorks' order, behind the name and the input. */
enum { APSM_COLUMNS = 5 };
extern const char *const apsm_project_columns[APSM_COLUMNS];

/* Whether a column's text is a path, by its name; constraints may stand there themselves. */
bool apsm_project_is_path(const char *key, const char *text);

/* M <- the 16 (row-major 4 x 4) or 12 (translation last) numbers of text.  Returns how many
 * numbers were read, 0 if it is no usable transform.  plain: false if the first nine of 12 are
 * no identity. */
int apsm_transform_parse(const char *text, double M[16], bool *plain);
/* The 16 numbers, separated by spaces, so that they are read back as they are. */
void apsm_transform_text(const double M[16], char text[16 * APSM_NUMBER_LENGTH]);

/* A copy of object with all plain values as strings and no nulls.  NULL: out of memory, or *bad
 * is the key whose value is an object or array. */
json_t *apsm_json_as_texts(const json_t *object, const char **bad);

#endif
