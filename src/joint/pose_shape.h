/* pose_shape.h -- how the parts of a joint lie to each other, and what they look like, told apart.
 * A model of all particles at once mixes both: a part that turns moves its particles on circles,
 * which a linear mode cannot follow, so that turning looks like growing. */
#ifndef APSM_JOINT_POSE_SHAPE_H
#define APSM_JOINT_POSE_SHAPE_H

#include "joint/parts.h"
#include "model/shape_model.h"

/* Of I subjects with n parts and J particles in all.  Owns everything; zero-initialise with {0},
 * apsm_pose_shape_free leaves it so.  Lengths in the unit of the particles. */
typedef struct apsm_pose_shape {
    size_t I, n, J;
    double *mean_pose;       /* n x 16: the mean place of every part in the common frame */
    double *pose;            /* I x n x 6: log(mean_pose^-1 pose_i): radians, lengths (se3.h) */
    double *shape;           /* I x J x 3: the particles of every part in the part's own frame */
    double *gyration;        /* n x 9: square roots of the mean parts' second moments */
    apsm_shape_model poses;  /* of z (I x 2n x 3), (1) */
    apsm_shape_model shapes; /* of `shape` */
    apsm_shape_model both;   /* of z and shape one after the other: 2n + J triples */
    double leak; /* share of the variance of the particles that neither explains: 1 - (pose + shape)
                    / all; what is left of circles that are taken for straight */
} apsm_pose_shape;

/* From particles Q (I x J x 3) in a common frame (apsm_joint_align, GLOBAL or BY).  For every part:
 * generalised Procrustes gives the mean part, about whose centroid the poses are logarithms, and
 * the shapes without pose;  z = (S omega, sqrt(J_d) v),  S^2 = sum_j (|x_j|^2 I - x_j x_j^T) (1)
 * over the mean part, is a pose in units of the particles' displacements: |z|^2 = sum_j |dx_j|^2 to
 * first order, so that the variances of poses and shapes can be compared and added. */
apsm_status apsm_pose_shape_separate(apsm_context *ctx, size_t I, const apsm_parts *parts,
                                     const double *Q, apsm_pose_shape *result) APSM_NODISCARD;
void apsm_pose_shape_free(apsm_pose_shape *result);

/* Particles x (J x 3, out) of a subject with poses xi (n x 6; NULL: the mean ones) and parts s
 * (J x 3, in the parts' own frames). */
void apsm_pose_shape_compose(const apsm_pose_shape *ps, const apsm_parts *parts, const double *xi,
                             const double *s, double *x);

/* The poses xi (n x 6, out) whose z of (1) is b times a row z (2n x 3) of the models.
 * APSM_ERR_SINGULAR: a part whose mean particles lie on a line. */
apsm_status apsm_pose_shape_pose(const apsm_pose_shape *ps, const apsm_parts *parts, double b,
                                 const double *z, double *xi) APSM_NODISCARD;

#endif
