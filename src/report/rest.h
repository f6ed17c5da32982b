/* rest.h -- what constraints took away from a shape: shown, and not counted. */
#ifndef APSM_REPORT_REST_H
#define APSM_REPORT_REST_H

#include "folder/model_folder.h"
#include "geometry/bvh.h"

/* rest (owned by the caller) <- of the whole surface of shape i, in the world frame with about
 * `faces` faces, what does not lie on the shape's own, whose tree is given; empty where nothing was
 * cut. */
apsm_status read_rest(apsm_context *ctx, const model_folder *m, size_t i, const apsm_bvh *own,
                      size_t faces, apsm_mesh *rest) APSM_NODISCARD;

#endif
