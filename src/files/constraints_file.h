/* constraints_file.h -- ShapeWorks' constraints of a shape (.json): cutting planes, spheres and
 * free-form regions.  docs/formats.md, "Constraints". */
#ifndef APSM_CONSTRAINTS_FILE_H
#define APSM_CONSTRAINTS_FILE_H

#include "files/project.h"
#include "geometry/region.h"

#ifdef __cplusplus
extern "C" {
#endif

/* *region <- what the file says, in the frame of the shape.  Refused, with a line: what is not
 * known here, so that nothing is left out unseen; a plane of three points in a line; a free form
 * that no point of is inside.  An empty object is the whole surface. */
apsm_status apsm_constraints_read(apsm_context *ctx, const char *path,
                                  apsm_region *region) APSM_NODISCARD;

/* A project's column may hold the constraints themselves in the place of a path, as those of old
 * parameter files do.  parse: what is what is said of them in errors. */
bool apsm_constraints_are_here(const char *column);
apsm_status apsm_constraints_parse(apsm_context *ctx, const char *what, const char *text,
                                   apsm_region *region) APSM_NODISCARD;

/* Such columns of a subject become files of their own in the project's folder, under the name that
 * apsm_constraints_name gives: constraints/NAME_DOMAIN.json. */
enum { APSM_CONSTRAINTS_NAME = 1024 };
void apsm_constraints_name(const char *name, const char *key, char stored[APSM_CONSTRAINTS_NAME]);
apsm_status apsm_constraints_store(apsm_context *ctx, const apsm_project *project,
                                   const apsm_subject *subject) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
