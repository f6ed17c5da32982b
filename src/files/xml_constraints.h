/* xml_constraints.h -- the constraints of ShapeWorks' old parameter files, as the text of the
 * constraints files of today (constraints_file.h). */
#ifndef APSM_FILES_XML_CONSTRAINTS_H
#define APSM_FILES_XML_CONSTRAINTS_H

#include "apsm/context.h"

struct json_t;

/* Adds `constraints_D` to the rows of data, which hold n inputs of `domains` domains each, from the
 * elements of the file at path (values: their texts by name).  The column is the constraints
 * themselves as JSON, which apsm_constraints_store makes a file of.  Refused by name: lists that
 * are not as long as they say, and `cutting_plane_files`. */
apsm_status xml_constraints(apsm_context *ctx, const char *path, const struct json_t *values,
                            size_t n, size_t domains, struct json_t *data) APSM_NODISCARD;

/* The elements that are read so. */
bool xml_is_constraint(const char *name);

#endif
