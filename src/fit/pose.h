/* pose.h -- where a new shape lies in the model's world: the search and registration of grooming
 * (align/align.h) against the model's template. */
#ifndef APSM_FIT_POSE_H
#define APSM_FIT_POSE_H

#include "fit/fit_model.h"

typedef struct fit_pose {
    double M[16]; /* det < 0: mirrored */
    bool mirrored;
    double residual;     /* over the template's radius, with size removed unless part */
    double runner_up;    /* of a clearly different pose over the best; INFINITY: none found */
    double mirror_ratio; /* of the other hand over the best's; INFINITY: not tried */
    double size;         /* of the shape over the template's */
    bool usual;          /* not mirrored, in the orientation in which the cohort came */
} fit_pose;

/* Whether a pose is searched for: not where the shape is in its place. */
bool fit_pose_searches(const apsm_fit_model *m, const apsm_fit_options *options);

/* The pose of a whole shape.  bvh is the mesh's, and needed only for a search.  O(50,000) closest
 * points. */
apsm_status fit_pose_find(const apsm_fit_model *m, const apsm_mesh *mesh, const apsm_bvh *bvh,
                          const apsm_fit_options *options, fit_pose *pose) APSM_NODISCARD;

/* S (out): the similarity near the pose M that makes the shape the template's size. */
apsm_status fit_pose_sized(const apsm_fit_model *m, const apsm_mesh *mesh, const apsm_bvh *bvh,
                           const double M[16], double S[16]) APSM_NODISCARD;

/* Residual of the template's mirror image in its best pose, over the radius. */
apsm_status fit_pose_mirror(const apsm_fit_model *m, double *residual) APSM_NODISCARD;

/* Residual of a mesh that is in its place, with size removed, over the radius. */
apsm_status fit_pose_residual(const apsm_fit_model *m, const apsm_mesh *mesh,
                              double *residual) APSM_NODISCARD;

/* Every second vertex of the mesh, by which a pose comes to rest. */
apsm_status fit_pose_vertices(const apsm_mesh *mesh, const apsm_cloud *sample,
                              apsm_cloud *half) APSM_NODISCARD;

#endif
