/* bvh_guess.h -- closest points for many near queries: each starts from its neighbour's answer, or
 * looks only at the leaves near all of them. */
#ifndef APSM_GEOMETRY_BVH_GUESS_H
#define APSM_GEOMETRY_BVH_GUESS_H

#include "geometry/bvh.h"

/* As apsm_bvh_closest, and with the same result whatever the guess.  *slot: in, the triangle to
 * try first (0 if there is no idea); out, the one found, or as it was. */
void bvh_closest_guess(const apsm_bvh *bvh, const double x[3], double max_distance2, uint32_t *slot,
                       apsm_closest *out);

/* Leaves of a tree and their boxes, side by side. */
typedef struct bvh_near {
    size_t n, room;
    uint32_t *leaf; /* room */
    float *box;     /* 6 x room, in the tree's frame: least x, y, z, largest x, y, z */
} bvh_near;

/* Room for all leaves of the tree.  APSM_ERR_MEMORY. */
apsm_status bvh_near_alloc(const apsm_bvh *bvh, bvh_near *near) APSM_NODISCARD;
void bvh_near_free(bvh_near *near);
/* All leaves no farther than `way` from the cube x +- half; those of `from` alone. */
void bvh_near_collect(const apsm_bvh *bvh, const double x[3], double half, double way,
                      bvh_near *near);
void bvh_near_choose(const apsm_bvh *bvh, const bvh_near *from, const double x[3], double half,
                     double way, bvh_near *near);
/* As bvh_closest_guess, for x in the cube and a bound of at most way^2: the same result. */
void bvh_near_closest(const apsm_bvh *bvh, const bvh_near *near, const double x[3],
                      double max_distance2, uint32_t *slot, apsm_closest *out);

/* The same for eight points in the cube.  *slot is a guess that may stay as it was. */
enum { BVH_AT_ONCE = 8 };
void bvh_near_closest_of(const apsm_bvh *bvh, const bvh_near *near, const double x[BVH_AT_ONCE][3],
                         double max_distance2, uint32_t *slot, apsm_closest out[BVH_AT_ONCE]);

/* Unit normal of a face, zero if it has no extent. */
const double *bvh_face_normal(const apsm_bvh *bvh, uint32_t face);

/* -1 if x is behind the pseudo-normal at its closest point, else +1. */
double bvh_sign(const apsm_bvh *bvh, const double x[3], const apsm_closest *closest);

/* Whether the mesh has a border, and whether x, whose closest point on such a mesh is given, lies
 * beyond it: more to the side of the surface than above or below it. */
bool bvh_is_open(const apsm_bvh *bvh);
bool bvh_is_beyond(const apsm_bvh *bvh, const double x[3], const apsm_closest *closest);

#endif
