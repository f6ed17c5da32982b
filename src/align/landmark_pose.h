/* landmark_pose.h -- shapes brought together by their landmarks, alone or with their surfaces. */
#ifndef APSM_ALIGN_LANDMARK_POSE_H
#define APSM_ALIGN_LANDMARK_POSE_H

#include "apsm/mesh.h"
#include "landmarks/landmark_table.h"

/* Which way shapes are brought together. */
typedef struct landmark_pose_options {
    bool scale;            /* similarities instead of rigid maps */
    bool surfaces;         /* surfaces count as much as the landmarks */
    size_t template_index; /* the shape whose map stays */
} landmark_pose_options;

/* M (I x 16, row-major; in: where shapes are; out): generalised Procrustes analysis of the
 * landmarks, which are in the frames of the meshes (I, borrowed).  Shapes with fewer than three
 * landmarks, or with all in a line, keep their maps; *kept (out) counts them.  A map that mirrors
 * is refused (APSM_ERR_ARG).  Parallel over shapes where surfaces count. */
apsm_status landmark_pose(apsm_context *ctx, const landmark_table *t,
                          const apsm_mesh *const *meshes, const landmark_pose_options *o, double *M,
                          size_t *kept) APSM_NODISCARD;

#endif
