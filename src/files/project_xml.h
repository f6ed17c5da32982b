/* project_xml.h -- the parameter files of ShapeWorks before version 6 (.xml) as projects. */
#ifndef APSM_FILES_PROJECT_XML_H
#define APSM_FILES_PROJECT_XML_H

#include <stdbool.h>

#include "apsm/context.h"

struct json_t;

bool apsm_is_parameter_file(const char *path); /* by its extension, in any case */

/* The root of a project file: a row of `data` for the inputs of each shape (domains_per_shape of
 * them), with fixed = yes for those of fixed_domains and constraints as xml_constraints.h has them,
 * and all other parameters as texts in `optimize`.  Refused with a line: no inputs, inputs that are
 * no whole shapes. */
apsm_status project_from_xml(apsm_context *ctx, const char *path,
                             struct json_t **root) APSM_NODISCARD;

#endif
