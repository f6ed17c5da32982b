/* bvh_tree.h -- what the tree of boxes is made of: for bvh_build.c, which makes it, and bvh.c. */
#ifndef APSM_GEOMETRY_BVH_TREE_H
#define APSM_GEOMETRY_BVH_TREE_H

#include "geometry/bvh.h"

enum { WIDTH = 4, LEAF = 8 };

typedef struct node {
    _Alignas(64) float lo[3][WIDTH]; /* two cache lines in all */
    float hi[3][WIDTH];
    uint32_t ref[WIDTH]; /* of the children; 0: none */
    uint8_t children;    /* 1..4 of the above in use */
} node;

/* A reference to a leaf of `count` triangles, or to a node (count 0; never the root). */
static inline uint32_t make_ref(size_t number, uint32_t count)
{
    return (uint32_t)number << 4 | count;
}
static inline uint32_t ref_number(uint32_t ref)
{
    return ref >> 4;
}
static inline uint32_t ref_count(uint32_t ref)
{
    return ref & 15;
}

/* What a leaf knows of its triangles, in the tree's frame and to float32.  The longest edge leads
 * from the origin along x to (length, 0), the apex is at (a, b), 0 <= a <= length, b >= 0. */
enum {
    ORIGIN = 0, /* 3 */
    AXIS_X = 3, /* 3, unit */
    AXIS_Y = 6,
    AXIS_Z = 9,
    LENGTH = 12,       /* of the edge along x */
    RISE_X = 13,       /* unit, along the edge from (length, 0) to the apex: <= 0 */
    RISE_Y = 14,       /* >= 0 */
    RISE_LENGTH = 15,  /* of that edge */
    CLIMB_X = 16,      /* unit, along the edge from the origin to the apex: >= 0 */
    CLIMB_Y = 17,      /* >= 0 */
    CLIMB_LENGTH = 18, /* of that edge */
    ROWS = 19
};

/* The triangles of a leaf side by side: row[r][i] is number r of triangle i.  Lanes not in use have
 * no origin (NaN), so that no comparison with them holds. */
typedef struct leaf {
    _Alignas(64) float row[ROWS][LEAF];
} leaf;

struct apsm_bvh {
    const apsm_mesh *mesh;
    double centre[3], scale; /* q = (x - centre) * scale */
    node *nodes;             /* nodes[0]: the root */
    size_t node_count;
    leaf *leaves;
    uint32_t
        *face; /* LEAF a leaf: face numbers; a slot is a place in this list; the last repeats */
    size_t leaf_count;
    double *face_normal;   /* nf x 3 unit, by face number; zero for a degenerate face */
    double *vertex_normal; /* nv x 3; this and twin: NULL if the tree is to give no signs */
    uint32_t *twin;        /* 3 nf, as in apsm_topology */
};

#endif
