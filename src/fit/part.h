/* part.h -- a part of a surface, or a cloud of points: pose, shape and what is missing. */
#ifndef APSM_FIT_PART_H
#define APSM_FIT_PART_H

#include "fit/parts.h"

/* Points that stand for what is given; owned. */
typedef struct part_points {
    size_t n;
    double *x;      /* n x 3: input frame, farthest points first */
    double *normal; /* n x 3; NULL: none are known */
    double area;    /* of the surface that they stand for */
} part_points;

apsm_status part_points_of_mesh(const apsm_mesh *mesh, part_points *p) APSM_NODISCARD;
apsm_status part_points_of_cloud(size_t n, const double *x, part_points *p) APSM_NODISCARD;
void part_points_free(part_points *p);

/* A pose and a shape that fit the points; b is the caller's, M of the posterior. */
typedef struct part_state {
    double M[16];   /* input to world */
    double *b;      /* scores of modes and smooth process */
    double cost;    /* less is better */
    double counted; /* share of the points that are believed */
} part_state;

/* Poses to begin with, best first: at most `most`; returns how many. */
apsm_status part_poses(const apsm_fit_model *m, const part_points *p,
                       const apsm_fit_options *options, size_t most, double (*M)[16],
                       size_t *n) APSM_NODISCARD;

/* Particles, pose and deviations of a part. */
apsm_status fit_part_particles(apsm_context *ctx, fit_job *job,
                               const part_points *p) APSM_NODISCARD;

/* Arrays for part_refine; one thread's. */
typedef struct part_work {
    double *P;        /* D */
    apsm_mesh warped; /* of the template */
    double *normal;   /* its vertices' */
    apsm_bvh *bvh;
    double *x;             /* n x 3: the points in the world */
    double *A, *G, *e, *w; /* n x D, n x K, n, n: K = modes + 6 */
    double *H, *g, *store; /* K x K, K, modes with the pose's */
} part_work;
apsm_status part_work_alloc(const apsm_fit_model *m, size_t n, part_work *w) APSM_NODISCARD;
void part_work_free(part_work *w);

/* Pose and scores that fit the points, from s: rounds of closest points, robust weights whose reach
 * falls from `reach` h to the last, and the linear step of (42). */
apsm_status part_refine(const apsm_fit_model *m, const part_points *p, size_t rounds, double reach,
                        part_state *s, part_work *w) APSM_NODISCARD;

#endif
