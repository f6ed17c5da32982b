/* obstacles.h -- surfaces that a shape must not go into: the other parts of the same subject. */
#ifndef APSM_INITIALIZE_OBSTACLES_H
#define APSM_INITIALIZE_OBSTACLES_H

#include "geometry/bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A closed surface in the world frame.  Owns both. */
typedef struct apsm_obstacle {
    apsm_mesh mesh;
    apsm_bvh *bvh;
    double lo[3], hi[3]; /* outside of this box nothing is in it */
} apsm_obstacle;

/* Of I shapes; I = 0: none.  Owns everything; zero-initialise with {0}. */
typedef struct apsm_obstacles {
    size_t I;
    size_t *n;           /* I */
    apsm_obstacle ***of; /* I: n[i], each in its place: trees point to meshes */
} apsm_obstacles;

apsm_status apsm_obstacles_begin(size_t I, apsm_obstacles *obstacles) APSM_NODISCARD;
/* Adds a mesh (taken, also on failure) to those of shape i; an open one, in which nothing lies, is
 * no obstacle.  Different shapes may be filled at the same time. */
apsm_status apsm_obstacles_add(apsm_obstacles *obstacles, size_t i, apsm_mesh *mesh) APSM_NODISCARD;
void apsm_obstacles_free(apsm_obstacles *obstacles);

/* How deep x lies in one of the obstacles of shape i, the deepest, and the place of its surface
 * that is nearest; 0: in none. */
double apsm_obstacles_depth(const apsm_obstacles *obstacles, size_t i, const double x[3],
                            double nearest[3]);

#ifdef __cplusplus
}
#endif
#endif
