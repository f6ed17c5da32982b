/* constraints_file.h -- ShapeWorks' constraints of a shape (.json): cutting planes and free-form
 * regions.  docs/formats.md, "Constraints". */
#ifndef APSM_CONSTRAINTS_FILE_H
#define APSM_CONSTRAINTS_FILE_H

#include "geometry/region.h"

#ifdef __cplusplus
extern "C" {
#endif

/* *region <- what the file says, in the frame of the shape.  Refused, with a line: what is not
 * known here, so that nothing is left out unseen; a plane of three points in a line; a free form
 * that no point of is inside.  An empty object is the whole surface. */
apsm_status apsm_constraints_read(apsm_context *ctx, const char *path,
                                  apsm_region *region) APSM_NODISCARD;

#ifdef __cplusplus
}
#endif
#endif
