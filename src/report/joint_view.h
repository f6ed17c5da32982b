/* joint_view.h -- how the parts of a joint move and change apart from each other, for the page: the
 * modes of pose and of shape (pose_shape.json) on the surface that stands for all subjects. */
#ifndef APSM_REPORT_JOINT_VIEW_H
#define APSM_REPORT_JOINT_VIEW_H

#include "report/template_surface.h"

/* Of n parts, J particles, nv vertices.  Owns everything; zero-initialise with {0},
 * joint_view_free leaves it so. */
typedef struct joint_view {
    size_t n;             /* parts; 0: one part, or nothing is known of poses */
    size_t poses, shapes; /* modes that are shown */
    struct json_t *pose_variances, *shape_variances; /* of all modes */
    double not_explained;                            /* share of the variance that neither tells */
    double *frame;          /* n x 16: from the parts' own frames to the world, at the mean pose */
    double *motion;         /* poses x n x 6: logarithms (se3.h) at one standard deviation */
    double *particles;      /* J x 3: mean shapes at mean poses, world */
    double *surface;        /* nv x 3: the same */
    double *mode;           /* shapes x nv x 3: displacements at one standard deviation */
    double *mode_particles; /* shapes x J x 3: the same */
} joint_view;

/* At most `modes` of either.  A folder without pose_shape.json leaves view {0}. */
apsm_status joint_view_make(apsm_context *ctx, const template_surface *t, size_t modes,
                            joint_view *view) APSM_NODISCARD;
void joint_view_free(joint_view *view);

#endif
