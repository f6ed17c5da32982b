/* bvh_tree.h -- what the tree of boxes is made of: for bvh_build.c, which makes it, and bvh.c. */
#ifndef APSM_GEOMETRY_BVH_TREE_H
#define APSM_GEOMETRY_BVH_TREE_H

#include "apsm/bvh.h"

enum { WIDTH = 4, LEAF = 4, ROWS = 16 };

typedef struct node {
    _Alignas(64) float lo[3][WIDTH]; /* two cache lines in all */
    float hi[3][WIDTH];
    uint32_t ref[WIDTH]; /* of the children; 0: none */
    uint8_t children;    /* 1..4 of the above in use */
} node;

/* A reference to a leaf of `count` triangles, or to a node (count 0; never the root). */
static inline uint32_t make_ref(size_t number, uint32_t count)
{
    return (uint32_t)number << 3 | count;
}
static inline uint32_t ref_number(uint32_t ref)
{
    return ref >> 3;
}
static inline uint32_t ref_count(uint32_t ref)
{
    return ref & 7;
}

typedef struct triangle {
    double p[3][3];       /* corners */
    double n[3];          /* (p1 - p0) x (p2 - p0) */
    double inverse_n2;    /* 1 / |n|^2; 0: no area to speak of, its edges are all of it */
    double inverse_e2[3]; /* 1 / |p(k+1) - pk|^2; 0 for an edge without length */
} triangle;
_Static_assert(sizeof(triangle) == ROWS * sizeof(double), "a triangle is ROWS numbers");

/* The triangles of a leaf side by side: row[r][i] is number r of triangle i.  Unused lanes repeat
 * the last one. */
typedef struct leaf {
    _Alignas(64) double row[ROWS][LEAF];
} leaf;

struct apsm_bvh {
    const apsm_mesh *mesh;
    double centre[3], scale; /* q = (x - centre) * scale */
    node *nodes;             /* nodes[0]: the root */
    size_t node_count;
    leaf *leaves;
    uint32_t *face; /* LEAF a leaf: face numbers; a slot is a place in this list */
    size_t leaf_count;
    double *face_normal;   /* nf x 3 unit, by face number; zero for a degenerate face */
    double *vertex_normal; /* nv x 3; this and twin: NULL if the tree is to give no signs */
    uint32_t *twin;        /* 3 nf, as in apsm_topology */
};

#endif
