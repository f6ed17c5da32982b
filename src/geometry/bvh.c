/* Closest points and rays on a triangle mesh, by a tree of boxes with four children a node.
 *
 * Build: binary tree by the surface-area heuristic in 16 bins (Wald, "On fast construction of
 * SAH-based bounding volume hierarchies", 2007) down to LEAF triangles, then every node takes in
 * its largest children until it has four.  The boxes of siblings lie side by side in float32, so
 * that one node is four box distances at once in SSE registers.
 *
 * Float boxes prune, doubles decide.  Boxes are kept in the frame q = (x - centre) * 2^-k, in
 * which the mesh fills about [-1, 1]^3, and are PAD larger than the triangles: PAD covers the
 * rounding of boxes and of queries near the mesh, SLACK (relative) that of the squared distance
 * and of queries far away.  So no box is farther than its triangles, and the result is that of
 * trying all triangles in double.  A power of two leaves every float as it is under scaling.
 *
 * A leaf's triangles lie side by side as well: one point against four triangles, or one triangle
 * against a packet of eight points, is one branchless expression in vector lanes.
 *
 * Signs: Baerentzen & Aanaes, "Signed distance computation using the angle weighted
 * pseudonormal", IEEE TVCG 11, 2005.  Rays: Woop, Benthin & Wald, "Watertight ray/triangle
 * intersection", JCGT 2, 2013: no ray slips through an edge. */
#include "apsm/bvh.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/topology.h"
#include "core/kernel.h"
#include "geometry/bvh_guess.h"
#include "geometry/stored.h"
#include "geometry/vec3.h"

enum { WIDTH = 4, LEAF = 4, ROWS = 16, BINS = 16, DEEP = 40, STACK = 256 };
#define PAD   0x1p-21f
#define SLACK (1.0 + 0x1p-19)

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
    double *face_normal; /* nf x 3 unit, by face number; zero for a degenerate face */
    double *vertex_normal;
    uint32_t *twin; /* 3 nf, as in apsm_topology */
};

/* ---- build ---------------------------------------------------------------------------------- */

typedef struct box {
    float lo[3], hi[3];
} box;

static const box empty_box = { { INFINITY, INFINITY, INFINITY },
                               { -INFINITY, -INFINITY, -INFINITY } };

static void box_grow(box *a, const box *b)
{
    for (int c = 0; c < 3; c++) {
        a->lo[c] = b->lo[c] < a->lo[c] ? b->lo[c] : a->lo[c];
        a->hi[c] = b->hi[c] > a->hi[c] ? b->hi[c] : a->hi[c];
    }
}

static float box_area(const box *b)
{
    const float x = b->hi[0] - b->lo[0], y = b->hi[1] - b->lo[1], z = b->hi[2] - b->lo[2];
    return x >= 0.0f ? x * y + y * z + z * x : 0.0f;
}

static float box_middle2(const box *b, int axis)
{
    return b->lo[axis] + b->hi[axis]; /* twice the middle */
}

/* A node of the binary tree: leaf if count > 0. */
typedef struct binary {
    box bounds;
    uint32_t first, count, left, right;
} binary;

typedef struct builder {
    const box *boxes; /* nf, by face */
    uint32_t *order;  /* nf: faces in the order of the leaves */
    uint32_t *spare;  /* nf */
    binary *tree;     /* 2 nf */
    uint32_t used;
} builder;

typedef struct split {
    int axis; /* -1: none */
    float from, per_bin, cost;
    int bin; /* bins 0..bin go left */
} split;

static int bin_of(const split *s, const box *b)
{
    const int k = (int)((box_middle2(b, s->axis) - s->from) * s->per_bin);
    return k < 0 ? 0 : k >= BINS ? BINS - 1 : k;
}

/* Best of the BINS - 1 cuts across one axis, if cheaper than *best. */
static void try_axis(const builder *t, uint32_t first, uint32_t count, int axis, float from,
                     float to, split *best)
{
    box bounds[BINS], left = empty_box, right = empty_box;
    uint32_t n[BINS] = { 0 }, seen = 0;
    float right_cost[BINS];
    split s = { .axis = axis, .from = from, .per_bin = (float)BINS / (to - from) };
    if (!(to > from) || !isfinite(s.per_bin)) return;
    for (int k = 0; k < BINS; k++) bounds[k] = empty_box;
    for (uint32_t i = first; i < first + count; i++) {
        const box *b = &t->boxes[t->order[i]];
        const int k = bin_of(&s, b);
        n[k]++;
        box_grow(&bounds[k], b);
    }
    for (int k = BINS - 1; k > 0; k--) {
        box_grow(&right, &bounds[k]);
        seen += n[k];
        right_cost[k - 1] = box_area(&right) * (float)seen;
    }
    seen = 0;
    for (s.bin = 0; s.bin < BINS - 1; s.bin++) {
        box_grow(&left, &bounds[s.bin]);
        seen += n[s.bin];
        s.cost = box_area(&left) * (float)seen + right_cost[s.bin];
        if (seen > 0 && seen < count && s.cost < best->cost) *best = s;
    }
}

static split find_split(const builder *t, uint32_t first, uint32_t count)
{
    split best = { .axis = -1, .cost = INFINITY };
    for (int axis = 0; axis < 3; axis++) {
        float from = INFINITY, to = -INFINITY;
        for (uint32_t i = first; i < first + count; i++) {
            const float m = box_middle2(&t->boxes[t->order[i]], axis);
            from = m < from ? m : from;
            to = m > to ? m : to;
        }
        try_axis(t, first, count, axis, from, to, &best);
    }
    return best;
}

/* Stable; returns how many went left. */
static uint32_t partition(const builder *t, uint32_t first, uint32_t count, const split *s)
{
    uint32_t left = 0, right = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t f = t->order[first + i];
        if (bin_of(s, &t->boxes[f]) <= s->bin)
            t->order[first + left++] = f;
        else
            t->spare[right++] = f;
    }
    memcpy(t->order + first + left, t->spare, right * sizeof *t->spare);
    return left;
}

/* Below DEEP levels, or where all middles coincide, halves the list instead: the depth stays
 * under DEEP + 32. */
static uint32_t build_binary(builder *t, uint32_t first, uint32_t count, int depth)
{
    const uint32_t self = t->used++;
    binary *b = &t->tree[self];
    *b = (binary){ .bounds = empty_box, .first = first, .count = count };
    for (uint32_t i = first; i < first + count; i++) box_grow(&b->bounds, &t->boxes[t->order[i]]);
    if (count <= LEAF) return self;
    const split s = depth < DEEP ? find_split(t, first, count) : (split){ .axis = -1 };
    const uint32_t left = s.axis >= 0 ? partition(t, first, count, &s) : count / 2;
    b->count = 0;
    b->left = build_binary(t, first, left, depth + 1);
    b->right = build_binary(t, first + left, count - left, depth + 1);
    return self;
}

/* Up to WIDTH descendants of binary node b: the one with the largest box is opened first. */
static int gather_children(const binary *tree, uint32_t b, uint32_t child[WIDTH])
{
    int n = 1;
    child[0] = b;
    while (n < WIDTH) {
        int open = -1;
        float largest = -1.0f;
        for (int k = 0; k < n; k++) {
            const binary *c = &tree[child[k]];
            if (c->count > 0 || box_area(&c->bounds) <= largest) continue;
            largest = box_area(&c->bounds);
            open = k;
        }
        if (open < 0) break;
        const binary *c = &tree[child[open]];
        child[open] = c->left;
        child[n++] = c->right;
    }
    return n;
}

static void fill_triangle(const apsm_bvh *bvh, uint32_t f, triangle *t)
{
    double e[3][3], e2[3];
    for (size_t k = 0; k < 3; k++)
        memcpy(t->p[k], bvh->mesh->V + 3 * (size_t)bvh->mesh->F[3 * (size_t)f + k], sizeof t->p[k]);
    for (int k = 0; k < 3; k++) {
        vec3_sub(t->p[(k + 1) % 3], t->p[k], e[k]);
        e2[k] = vec3_dot(e[k], e[k]);
        t->inverse_e2[k] = e2[k] > 0.0 ? 1.0 / e2[k] : 0.0;
    }
    vec3_cross(e[2], e[0], t->n); /* (p0-p2) x (p1-p0) = (p1-p0) x (p2-p0) */
    const double n2 = vec3_dot(t->n, t->n);
    /* sin^2 of the corner's angle: below this n is rounding */
    t->inverse_n2 = n2 > 1e-24 * e2[0] * e2[2] ? 1.0 / n2 : 0.0;
    double *unit = bvh->face_normal + 3 * (size_t)f;
    memcpy(unit, t->n, sizeof t->n);
    vec3_normalise(unit);
}

static void fill_leaf(apsm_bvh *bvh, size_t number)
{
    leaf *out = &bvh->leaves[number];
    for (size_t i = 0; i < LEAF; i++) {
        triangle t;
        double rows[ROWS];
        fill_triangle(bvh, bvh->face[LEAF * number + i], &t);
        memcpy(rows, &t, sizeof t);
        for (int r = 0; r < ROWS; r++) out->row[r][i] = rows[r];
    }
}

static void add_leaf(apsm_bvh *bvh, const uint32_t *faces, uint32_t count)
{
    const size_t number = bvh->leaf_count++;
    for (uint32_t i = 0; i < LEAF; i++)
        bvh->face[LEAF * number + i] = faces[i < count ? i : count - 1];
    fill_leaf(bvh, number);
}

static void set_bounds(node *n, int child, const box *bounds)
{
    for (int c = 0; c < 3; c++) {
        n->lo[c][child] = bounds->lo[c];
        n->hi[c][child] = bounds->hi[c];
    }
}

static void build_wide(apsm_bvh *bvh, const builder *t, uint32_t b)
{
    const binary *tree = t->tree;
    uint32_t child[WIDTH];
    const size_t self = bvh->node_count++;
    node *out = &bvh->nodes[self];
    memset(out, 0, sizeof *out);
    out->children = (uint8_t)gather_children(tree, b, child);
    for (int k = 0; k < WIDTH; k++)
        set_bounds(out, k, k < out->children ? &tree[child[k]].bounds : &empty_box);
    for (int k = 0; k < out->children; k++) {
        const binary *c = &tree[child[k]];
        out->ref[k] = make_ref(c->count > 0 ? bvh->leaf_count : bvh->node_count, c->count);
        if (c->count > 0)
            add_leaf(bvh, t->order + c->first, c->count);
        else
            build_wide(bvh, t, child[k]);
    }
}

/* Centre of the bounds, and the power of two that brings the half extent to [1/2, 1). */
static void choose_frame(apsm_bvh *bvh)
{
    double lo[3], hi[3], half = 0.0;
    int e = 0;
    apsm_mesh_bounds(bvh->mesh, lo, hi);
    for (int c = 0; c < 3; c++) {
        bvh->centre[c] = 0.5 * lo[c] + 0.5 * hi[c];
        half = fmax(half, 0.5 * hi[c] - 0.5 * lo[c]);
    }
    if (half > 0.0) frexp(half, &e);
    bvh->scale = ldexp(1.0, -e);
}

static box face_box(const apsm_bvh *bvh, size_t f)
{
    box b = empty_box;
    for (size_t k = 0; k < 3; k++)
        for (int c = 0; c < 3; c++) {
            const double x = bvh->mesh->V[3 * (size_t)bvh->mesh->F[3 * f + k] + (size_t)c];
            const float q = (float)((x - bvh->centre[c]) * bvh->scale);
            b.lo[c] = q - PAD < b.lo[c] ? q - PAD : b.lo[c];
            b.hi[c] = q + PAD > b.hi[c] ? q + PAD : b.hi[c];
        }
    return b;
}

/* A binary tree of n leaves becomes at most n nodes. */
static apsm_status alloc_wide(apsm_bvh *bvh, size_t leaves)
{
    bvh->nodes = aligned_alloc(64, leaves * sizeof *bvh->nodes);
    bvh->leaves = aligned_alloc(64, leaves * sizeof *bvh->leaves);
    bvh->face = malloc(leaves * LEAF * sizeof *bvh->face);
    return bvh->nodes && bvh->leaves && bvh->face ? APSM_OK : APSM_ERR_MEMORY;
}

static apsm_status build_tree(apsm_bvh *bvh)
{
    const size_t nf = bvh->mesh->nf;
    box *boxes = malloc(nf * sizeof *boxes);
    builder t = { .boxes = boxes,
                  .order = malloc(nf * sizeof *t.order),
                  .spare = malloc(nf * sizeof *t.spare),
                  .tree = malloc(2 * nf * sizeof *t.tree) };
    apsm_status status = APSM_ERR_MEMORY;
    if (boxes && t.order && t.spare && t.tree) {
        for (size_t f = 0; f < nf; f++) {
            boxes[f] = face_box(bvh, f);
            t.order[f] = (uint32_t)f;
        }
        build_binary(&t, 0, (uint32_t)nf, 0);
        status = alloc_wide(bvh, (t.used + 1) / 2);
        if (status == APSM_OK) build_wide(bvh, &t, 0);
    }
    free(boxes);
    free(t.order);
    free(t.spare);
    free(t.tree);
    return status;
}

static apsm_status build_normals(apsm_bvh *bvh)
{
    apsm_topology topology;
    APSM_TRY(apsm_topology_build(bvh->mesh, &topology));
    bvh->twin = topology.twin; /* taken */
    topology.twin = NULL;
    apsm_topology_free(&topology);
    apsm_mesh_vertex_normals(bvh->mesh, bvh->vertex_normal);
    return APSM_OK;
}

apsm_status apsm_bvh_build(const apsm_mesh *mesh, apsm_bvh **out)
{
    *out = NULL;
    if (mesh->nf == 0 || mesh->nf > UINT32_MAX / 8) return APSM_ERR_GEOMETRY;
    for (size_t i = 0; i < 3 * mesh->nv; i++)
        if (!isfinite(mesh->V[i])) return APSM_ERR_NONFINITE;
    apsm_bvh *bvh = calloc(1, sizeof *bvh);
    if (!bvh) return APSM_ERR_MEMORY;
    bvh->mesh = mesh;
    bvh->face_normal = malloc(3 * mesh->nf * sizeof *bvh->face_normal);
    bvh->vertex_normal = malloc((3 * mesh->nv + 1) * sizeof *bvh->vertex_normal);
    apsm_status status = APSM_ERR_MEMORY;
    if (bvh->face_normal && bvh->vertex_normal) {
        status = build_normals(bvh); /* checks the indices too */
        choose_frame(bvh);
        if (status == APSM_OK) status = build_tree(bvh);
    }
    if (status == APSM_OK)
        *out = bvh;
    else
        apsm_bvh_free(bvh);
    return status;
}

void bvh_arrays(apsm_bvh *bvh, array_list *list)
{
    const size_t nv = bvh->mesh->nv, nf = bvh->mesh->nf;
    arrays_add(list, &bvh->nodes, bvh->node_count * sizeof *bvh->nodes);
    arrays_add(list, &bvh->leaves, bvh->leaf_count * sizeof *bvh->leaves);
    arrays_add(list, &bvh->face, bvh->leaf_count * LEAF * sizeof *bvh->face);
    arrays_add(list, &bvh->face_normal, 3 * nf * sizeof *bvh->face_normal);
    arrays_add(list, &bvh->vertex_normal, 3 * nv * sizeof *bvh->vertex_normal);
    arrays_add(list, &bvh->twin, 3 * nf * sizeof *bvh->twin);
}

/* Bounds of a child whose own children are up to date. */
static box child_bounds(const apsm_bvh *bvh, const node *n, int child)
{
    box b = empty_box;
    const uint32_t count = ref_count(n->ref[child]), number = ref_number(n->ref[child]);
    if (count > 0) {
        for (uint32_t i = 0; i < count; i++) {
            const box face = face_box(bvh, bvh->face[LEAF * (size_t)number + i]);
            box_grow(&b, &face);
        }
        return b;
    }
    const node *inner = &bvh->nodes[number];
    for (int k = 0; k < inner->children; k++)
        for (int c = 0; c < 3; c++) {
            b.lo[c] = inner->lo[c][k] < b.lo[c] ? inner->lo[c][k] : b.lo[c];
            b.hi[c] = inner->hi[c][k] > b.hi[c] ? inner->hi[c][k] : b.hi[c];
        }
    return b;
}

void apsm_bvh_refit(apsm_bvh *bvh)
{
    choose_frame(bvh);
    for (size_t l = 0; l < bvh->leaf_count; l++) fill_leaf(bvh, l);
    for (size_t n = bvh->node_count; n-- > 0;) /* children have larger numbers */
        for (int k = 0; k < bvh->nodes[n].children; k++) {
            const box b = child_bounds(bvh, &bvh->nodes[n], k);
            set_bounds(&bvh->nodes[n], k, &b);
        }
    apsm_mesh_vertex_normals(bvh->mesh, bvh->vertex_normal);
}

void apsm_bvh_free(apsm_bvh *bvh)
{
    if (!bvh) return;
    free(bvh->nodes);
    free(bvh->leaves);
    free(bvh->face);
    free(bvh->face_normal);
    free(bvh->vertex_normal);
    free(bvh->twin);
    free(bvh);
}

const apsm_mesh *apsm_bvh_mesh(const apsm_bvh *bvh)
{
    return bvh->mesh;
}

/* ---- closest point -------------------------------------------------------------------------- */

/* Closest point p_k + t (p_k+1 - p_k) of edge k; its squared distance. */
static double closest_on_edge(const triangle *t, int k, const double x[3], double *along)
{
    const double *p = t->p[k], *q = t->p[(k + 1) % 3];
    double e[3], px[3];
    vec3_sub(q, p, e);
    vec3_sub(x, p, px);
    const double s = vec3_dot(px, e) * t->inverse_e2[k];
    if (!(s > 0.0)) {
        *along = 0.0;
        return vec3_dot(px, px);
    }
    if (s >= 1.0) {
        *along = 1.0;
        return vec3_distance2(x, q);
    }
    *along = s;
    vec3_add_scaled(px, -s, e);
    return vec3_dot(px, px);
}

/* Squared distance of x to t; the weights w of the closest point are exactly 0 for the corners
 * it does not depend on, which tells vertex, edge and interior apart.
 *
 * h_k = n . (e_k x (x - p_k)) is |n| |e_k| times the way from edge k inward.  If all are positive
 * the foot on the plane is inside; otherwise the closest point lies on an edge with h_k <= 0,
 * also at obtuse corners.  Cross products instead of the usual Gram matrix: the error is
 * eps / sin(angle), not eps / sin^2, so slivers keep their digits. */
static double closest_on_triangle(const triangle *t, const double x[3], double w[3])
{
    double h[3], px[3], along = 0.0, best = INFINITY;
    for (int k = 0; k < 3; k++) {
        double e[3], m[3];
        vec3_sub(t->p[(k + 1) % 3], t->p[k], e);
        vec3_sub(x, t->p[k], px);
        vec3_cross(e, px, m);
        h[k] = vec3_dot(t->n, m);
    }
    if (t->inverse_n2 > 0.0 && h[0] > 0.0 && h[1] > 0.0 && h[2] > 0.0) {
        const double height = vec3_dot(t->n, px), sum = h[0] + h[1] + h[2];
        for (int k = 0; k < 3; k++) w[k] = h[(k + 1) % 3] / sum;
        return height * height * t->inverse_n2;
    }
    for (int k = 0; k < 3; k++) {
        double s;
        if (h[k] > 0.0 && t->inverse_n2 > 0.0) continue;
        const double d2 = closest_on_edge(t, k, x, &s);
        if (!(d2 < best)) continue;
        best = d2;
        along = s;
        w[k] = 1.0 - along;
        w[(k + 1) % 3] = along;
        w[(k + 2) % 3] = 0.0;
    }
    return best;
}

/* ---- the same in the lanes of the processor ------------------------------------------------- */

/* A loop becomes lanes only if all it calls is inlined, however large. */
#if defined(__GNUC__)
#define LANE_INLINE static inline __attribute__((always_inline))
#else
#define LANE_INLINE static inline
#endif

typedef struct vec {
    double x, y, z;
} vec;

LANE_INLINE vec minus(vec a, vec b)
{
    return (vec){ a.x - b.x, a.y - b.y, a.z - b.z };
}
LANE_INLINE double dot(vec a, vec b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
LANE_INLINE vec cross(vec a, vec b)
{
    return (vec){ a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x };
}

/* Squared distance to the edge p + [0,1] e, or INFINITY if the point is inward of it (h > flat).
 * px = x - p; qx2: squared distance to its end. */
LANE_INLINE double lane_edge(vec px, vec e, vec n, double inverse_e2, double qx2, double flat)
{
    const double s = dot(px, e) * inverse_e2, h = dot(n, cross(e, px));
    const vec foot = { px.x - s * e.x, px.y - s * e.y, px.z - s * e.z };
    const double before_end = s >= 1.0 ? qx2 : dot(foot, foot);
    const double d2 = s > 0.0 ? before_end : dot(px, px);
    return h > flat ? INFINITY : d2;
}

/* closest_on_triangle's distance, bit for bit, without branches.  v: the triangle's numbers, apart
 * by step. */
LANE_INLINE double lane_distance2(const double *v, size_t step, vec x)
{
    const vec p0 = { v[0], v[step], v[2 * step] }, p1 = { v[3 * step], v[4 * step], v[5 * step] },
              p2 = { v[6 * step], v[7 * step], v[8 * step] },
              n = { v[9 * step], v[10 * step], v[11 * step] };
    const vec a = minus(x, p0), b = minus(x, p1), c = minus(x, p2);
    const double flat = v[12 * step] > 0.0 ? 0.0 : INFINITY;
    const double d0 = lane_edge(a, minus(p1, p0), n, v[13 * step], dot(b, b), flat),
                 d1 = lane_edge(b, minus(p2, p1), n, v[14 * step], dot(c, c), flat),
                 d2 = lane_edge(c, minus(p0, p2), n, v[15 * step], dot(a, a), flat);
    const double d01 = d0 < d1 ? d0 : d1, edge = d01 < d2 ? d01 : d2, height = dot(n, c);
    return edge == INFINITY ? height * height * v[12 * step] : edge;
}

/* All triangles of a leaf against one point. */
LANE_INLINE void leaf_distances(const leaf *restrict l, const double x[restrict 3],
                                double d2[restrict LEAF])
{
    const vec at = { x[0], x[1], x[2] };
#pragma omp simd
    for (int i = 0; i < LEAF; i++) d2[i] = lane_distance2(&l->row[0][i], LEAF, at);
}

/* ---- search --------------------------------------------------------------------------------- */

static triangle get_triangle(const leaf *l, uint32_t i)
{
    triangle t;
    double number[ROWS];
    for (int r = 0; r < ROWS; r++) number[r] = l->row[r][i];
    memcpy(&t, number, sizeof t);
    return t;
}

/* Where a search looks and how far: a point or box in the tree's frame. */
typedef struct probe {
    float lo[3], hi[3];
    float bound;     /* squared distance, rounded up */
    double to_bound; /* distance2 * to_bound -> bound */
} probe;

LANE_INLINE void set_bound(probe *p, double distance2)
{
    const double b = distance2 * p->to_bound + (double)FLT_MIN;
    p->bound = b < (double)FLT_MAX ? (float)b : INFINITY;
}

/* How far two intervals are apart. */
LANE_INLINE float gap(float lo, float hi, float from, float to)
{
    const float below = lo - to, above = from - hi;
    const float outside = below > above ? below : above;
    return outside > 0.0f ? outside : 0.0f;
}

/* Squared distances of the probe to a node's four boxes. */
LANE_INLINE void box_distances(const node *restrict n, const probe *restrict p,
                               float d2[restrict WIDTH])
{
#pragma omp simd
    for (int k = 0; k < WIDTH; k++) {
        const float x = gap(n->lo[0][k], n->hi[0][k], p->lo[0], p->hi[0]),
                    y = gap(n->lo[1][k], n->hi[1][k], p->lo[1], p->hi[1]),
                    z = gap(n->lo[2][k], n->hi[2][k], p->lo[2], p->hi[2]);
        d2[k] = x * x + y * y + z * z;
    }
}

/* What is still to visit, as one number so that order needs no branches: above, the bits of the key
 * (squared distance, or a ray's way to the box; floats from 0 on are ordered as their bits), below,
 * the reference.  None is 0. */
typedef uint64_t entry;

LANE_INLINE entry make_entry(float key, uint32_t ref)
{
    uint32_t bits;
    memcpy(&bits, &key, sizeof bits);
    return (entry)bits << 32 | ref;
}

LANE_INLINE float entry_key(entry e)
{
    const uint32_t bits = (uint32_t)(e >> 32);
    float key;
    memcpy(&key, &bits, sizeof key);
    return key;
}

LANE_INLINE void larger_first(entry *a, entry *b)
{
    const entry most = *a > *b ? *a : *b, least = *a > *b ? *b : *a;
    *a = most;
    *b = least;
}

/* Pushes the node's children with key <= bound, the nearest on top; writes beyond the top. */
LANE_INLINE int push_children(const node *n, const float key[WIDTH], float bound, entry *stack,
                              int top)
{
    entry *e = stack + top;
    int count = 0;
    for (int k = 0; k < WIDTH; k++) {
        const bool near = (key[k] <= bound) & (n->ref[k] != 0);
        e[k] = near ? make_entry(key[k], n->ref[k]) : 0;
        count += near;
    }
    larger_first(&e[0], &e[1]);
    larger_first(&e[2], &e[3]);
    larger_first(&e[0], &e[2]);
    larger_first(&e[1], &e[3]);
    larger_first(&e[1], &e[2]);
    return top + count;
}

/* Smaller distance, or the same on a smaller face. */
LANE_INLINE bool wins(const apsm_bvh *bvh, double d2, uint32_t slot, double best, bool found,
                      uint32_t best_slot)
{
    return d2 < best || (d2 == best && found && bvh->face[slot] < bvh->face[best_slot]);
}

LANE_INLINE float to_frame(const apsm_bvh *bvh, double x, int c)
{
    return (float)((x - bvh->centre[c]) * bvh->scale);
}

typedef struct query {
    probe probe;
    double x[3];
    const double *n; /* NULL: faces of any direction */
    double min_cos;
    double best; /* squared distance, exact */
    uint32_t slot;
    bool found; /* the triangle of that slot */
} query;

static query make_query(const apsm_bvh *bvh, const double x[3], double max_distance2)
{
    query s = { .probe.to_bound = bvh->scale * bvh->scale * SLACK, .best = max_distance2 };
    for (int c = 0; c < 3; c++) {
        s.x[c] = x[c];
        s.probe.lo[c] = s.probe.hi[c] = to_frame(bvh, x[c], c);
    }
    set_bound(&s.probe, max_distance2);
    return s;
}

LANE_INLINE void visit_leaf(const apsm_bvh *bvh, query *s, uint32_t number)
{
    double d2[LEAF];
    leaf_distances(&bvh->leaves[number], s->x, d2);
    const double a = d2[0] < d2[1] ? d2[0] : d2[1], b = d2[2] < d2[3] ? d2[2] : d2[3];
    if ((a < b ? a : b) > s->best) return;
    for (uint32_t i = 0; i < LEAF; i++) { /* lanes not in use repeat one that is */
        const uint32_t slot = LEAF * number + i;
        if (!wins(bvh, d2[i], slot, s->best, s->found, s->slot)) continue;
        const double *m = bvh->face_normal + 3 * (size_t)bvh->face[slot];
        if (s->n && !(vec3_dot(m, s->n) >= s->min_cos)) continue;
        s->best = d2[i];
        s->slot = slot;
        s->found = true;
        set_bound(&s->probe, d2[i]);
    }
}

/* Looks at the leaves that may be within the bound, which falls on the way, near boxes first.
 * begin: a leaf to look at before all, or APSM_NONE. */
APSM_KERNEL static void search(const apsm_bvh *bvh, uint32_t begin, query *s)
{
    entry stack[STACK];
    float d2[WIDTH];
    if (begin != APSM_NONE) visit_leaf(bvh, s, begin);
    box_distances(&bvh->nodes[0], &s->probe, d2);
    int top = push_children(&bvh->nodes[0], d2, s->probe.bound, stack, 0);
    while (top > 0) {
        const entry e = stack[--top];
        const uint32_t ref = (uint32_t)e;
        if (entry_key(e) > s->probe.bound) continue;
        if (ref_count(ref) > 0) {
            visit_leaf(bvh, s, ref_number(ref));
            continue;
        }
        const node *n = &bvh->nodes[ref_number(ref)];
        box_distances(n, &s->probe, d2);
        top = push_children(n, d2, s->probe.bound, stack, top);
    }
}

static void finish(const apsm_bvh *bvh, const double x[3], uint32_t slot, bool found,
                   apsm_closest *out)
{
    *out = (apsm_closest){ .distance2 = INFINITY };
    if (!found) return;
    const triangle t = get_triangle(&bvh->leaves[slot / LEAF], slot % LEAF);
    out->on.face = bvh->face[slot];
    out->distance2 = closest_on_triangle(&t, x, out->on.weight);
    for (int c = 0; c < 3; c++) /* apsm_surface_position */
        out->x[c] = out->on.weight[0] * t.p[0][c] + out->on.weight[1] * t.p[1][c] +
                    out->on.weight[2] * t.p[2][c];
}

void apsm_bvh_closest(const apsm_bvh *bvh, const double x[3], double max_distance2,
                      apsm_closest *out)
{
    query s = make_query(bvh, x, max_distance2);
    search(bvh, APSM_NONE, &s);
    finish(bvh, x, s.slot, s.found, out);
}

void apsm_bvh_closest_facing(const apsm_bvh *bvh, const double x[3], const double n[3],
                             double min_cos, double max_distance2, apsm_closest *out)
{
    query s = make_query(bvh, x, max_distance2);
    s.n = n;
    s.min_cos = min_cos;
    search(bvh, APSM_NONE, &s);
    finish(bvh, x, s.slot, s.found, out);
}

void bvh_closest_guess(const apsm_bvh *bvh, const double x[3], double max_distance2, uint32_t *slot,
                       apsm_closest *out)
{
    query s = make_query(bvh, x, max_distance2);
    search(bvh, *slot / LEAF, &s);
    finish(bvh, x, s.slot, s.found, out);
    if (s.found) *slot = s.slot;
}

/* ---- eight points at once ------------------------------------------------------------------- */

/* Faces and slots as doubles, which hold them exactly: one kind of lane for all.  face -1: none. */
typedef struct packet {
    probe probe;
    double x[3][BVH_PACKET];
    double best[BVH_PACKET], face[BVH_PACKET], slot[BVH_PACKET];
} packet;

LANE_INLINE void visit_packet(const apsm_bvh *bvh, packet *restrict s, uint32_t ref)
{
    const uint32_t first = LEAF * ref_number(ref);
    const leaf *l = &bvh->leaves[ref_number(ref)];
    for (uint32_t k = 0; k < ref_count(ref); k++) {
        const double face = (double)bvh->face[first + k], slot = (double)(first + k);
        const double *v = &l->row[0][k];
#pragma omp simd
        for (int i = 0; i < BVH_PACKET; i++) {
            const double d2 = lane_distance2(v, LEAF, (vec){ s->x[0][i], s->x[1][i], s->x[2][i] });
            const double level = d2 == s->best[i] ? s->face[i] : -1.0; /* ties: the smaller face */
            const double rank = d2 < s->best[i] ? INFINITY : level;
            s->best[i] = face < rank ? d2 : s->best[i];
            s->slot[i] = face < rank ? slot : s->slot[i];
            s->face[i] = face < rank ? face : s->face[i];
        }
    }
    double worst = 0.0;
    for (int i = 0; i < BVH_PACKET; i++) worst = s->best[i] > worst ? s->best[i] : worst;
    set_bound(&s->probe, worst);
}

/* As search, for all points of the packet. */
APSM_KERNEL static void search_packet(const apsm_bvh *bvh, uint32_t begin, packet *s)
{
    entry stack[STACK];
    float d2[WIDTH];
    visit_packet(bvh, s, begin);
    box_distances(&bvh->nodes[0], &s->probe, d2);
    int top = push_children(&bvh->nodes[0], d2, s->probe.bound, stack, 0);
    while (top > 0) {
        const entry e = stack[--top];
        const uint32_t ref = (uint32_t)e;
        if (entry_key(e) > s->probe.bound) continue;
        if (ref_count(ref) > 0) {
            visit_packet(bvh, s, ref);
            continue;
        }
        const node *n = &bvh->nodes[ref_number(ref)];
        box_distances(n, &s->probe, d2);
        top = push_children(n, d2, s->probe.bound, stack, top);
    }
}

static packet make_packet(const apsm_bvh *bvh, const double x[3][BVH_PACKET], double max_distance2)
{
    packet s = { .probe.to_bound = bvh->scale * bvh->scale * SLACK };
    memcpy(s.x, x, sizeof s.x);
    for (int c = 0; c < 3; c++) {
        s.probe.lo[c] = INFINITY;
        s.probe.hi[c] = -INFINITY;
        for (int i = 0; i < BVH_PACKET; i++) {
            const float q = to_frame(bvh, x[c][i], c);
            s.probe.lo[c] = q < s.probe.lo[c] ? q : s.probe.lo[c];
            s.probe.hi[c] = q > s.probe.hi[c] ? q : s.probe.hi[c];
        }
    }
    for (int i = 0; i < BVH_PACKET; i++) {
        s.best[i] = max_distance2;
        s.face[i] = -1.0;
    }
    set_bound(&s.probe, max_distance2);
    return s;
}

void bvh_signed_packet(const apsm_bvh *bvh, const double x[3][BVH_PACKET], double max_distance2,
                       uint32_t *slot, double distance[BVH_PACKET])
{
    packet s = make_packet(bvh, x, max_distance2);
    search_packet(bvh, make_ref(*slot / LEAF, LEAF), &s);
    for (int i = 0; i < BVH_PACKET; i++) {
        const double p[3] = { x[0][i], x[1][i], x[2][i] };
        apsm_closest here;
        distance[i] = INFINITY;
        if (s.face[i] < 0.0) continue;
        *slot = (uint32_t)s.slot[i];
        finish(bvh, p, *slot, true, &here);
        distance[i] = sqrt(here.distance2) * bvh_sign(bvh, p, &here);
    }
}

/* ---- sign ----------------------------------------------------------------------------------- */

/* Pseudo-normal (any length) of the vertex, edge or face interior the point lies on. */
static void pseudo_normal(const apsm_bvh *bvh, const apsm_surface_point *p, double n[3])
{
    const size_t f = p->face;
    int positive = 0, last = 0, zero = 0;
    for (int k = 0; k < 3; k++) {
        positive += p->weight[k] > 0.0;
        if (p->weight[k] > 0.0)
            last = k;
        else
            zero = k;
    }
    if (positive == 1) {
        const size_t v = bvh->mesh->F[3 * f + (size_t)last];
        memcpy(n, bvh->vertex_normal + 3 * v, 3 * sizeof *n);
        return;
    }
    memcpy(n, bvh->face_normal + 3 * f, 3 * sizeof *n);
    if (positive == 3) return;
    const uint32_t twin = bvh->twin[3 * f + (size_t)((zero + 1) % 3)]; /* the edge facing `zero` */
    if (twin != APSM_NONE) vec3_add_scaled(n, 1.0, bvh->face_normal + 3 * (size_t)(twin / 3));
}

double bvh_sign(const apsm_bvh *bvh, const double x[3], const apsm_closest *closest)
{
    double n[3], d[3];
    pseudo_normal(bvh, &closest->on, n);
    vec3_sub(x, closest->x, d);
    return vec3_dot(d, n) < 0.0 ? -1.0 : 1.0;
}

double apsm_bvh_signed_distance(const apsm_bvh *bvh, const double x[3], apsm_closest *out)
{
    apsm_closest here;
    if (!out) out = &here;
    apsm_bvh_closest(bvh, x, INFINITY, out);
    const double distance = sqrt(out->distance2);
    return distance > 0.0 ? bvh_sign(bvh, x, out) * distance : 0.0;
}

/* ---- rays ----------------------------------------------------------------------------------- */

/* The ray in Woop's frame: axis z is d's largest component, x and y are sheared so that d
 * becomes (0, 0, 1). */
typedef struct ray {
    double x[3], q[3], dq[3], shear[3]; /* q, dq: x, d in the tree's frame */
    int axis[3];
    double t_min, best;
    uint32_t face;
} ray;

static ray make_ray(const apsm_bvh *bvh, const double x[3], const double d[3], double t_min,
                    double t_max)
{
    ray r = { .t_min = t_min, .best = t_max, .face = APSM_NONE };
    int z = 0;
    for (int c = 0; c < 3; c++) {
        r.x[c] = x[c];
        r.q[c] = (x[c] - bvh->centre[c]) * bvh->scale;
        r.dq[c] = d[c] * bvh->scale;
        if (fabs(d[c]) > fabs(d[z])) z = c;
    }
    const int swap = d[z] < 0.0; /* keeps the frame right-handed; any hit counts, so no matter */
    r.axis[0] = (z + 1 + swap) % 3;
    r.axis[1] = (z + 2 - swap) % 3;
    r.axis[2] = z;
    r.shear[0] = d[r.axis[0]] / d[z];
    r.shear[1] = d[r.axis[1]] / d[z];
    r.shear[2] = 1.0 / d[z];
    return r;
}

static void shear_corner(const ray *r, const double p[3], double out[3])
{
    double v[3];
    vec3_sub(p, r->x, v);
    out[0] = v[r->axis[0]] - r->shear[0] * v[r->axis[2]];
    out[1] = v[r->axis[1]] - r->shear[1] * v[r->axis[2]];
    out[2] = r->shear[2] * v[r->axis[2]];
}

/* Hit if the origin lies on one side of all three edges of the sheared triangle; faces that
 * share an edge compute the same number for it, with opposite sign. */
static void hit_triangle(ray *r, const triangle *t, uint32_t f)
{
    double a[3], b[3], c[3];
    shear_corner(r, t->p[0], a);
    shear_corner(r, t->p[1], b);
    shear_corner(r, t->p[2], c);
    const double u = c[0] * b[1] - c[1] * b[0], v = a[0] * c[1] - a[1] * c[0],
                 w = b[0] * a[1] - b[1] * a[0];
    if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) return;
    const double det = u + v + w;
    if (det == 0.0) return;
    const double way = (u * a[2] + v * b[2] + w * c[2]) / det;
    if (!(way > r->t_min)) return;
    if (!(way < r->best || (way == r->best && r->face != APSM_NONE && f < r->face))) return;
    r->best = way;
    r->face = f;
}

/* The ray's way from t_min to where it enters box k of the node, a little short; INFINITY if it
 * misses.  Origin and direction are in the tree's frame, both scaled alike, so t is the same as
 * outside. */
static float box_entry(const node *n, int k, const ray *r)
{
    double enter = r->t_min, leave = r->best;
    for (int c = 0; c < 3; c++) {
        const double lo = (double)n->lo[c][k] - r->q[c], hi = (double)n->hi[c][k] - r->q[c];
        if (r->dq[c] == 0.0) {
            if (lo > 0.0 || hi < 0.0) return INFINITY;
            continue;
        }
        const double near = (r->dq[c] > 0.0 ? lo : hi) / r->dq[c],
                     far = (r->dq[c] > 0.0 ? hi : lo) / r->dq[c];
        enter = near > enter ? near : enter;
        leave = far < leave ? far : leave;
    }
    if (!(enter <= leave)) return INFINITY;
    const double way = (enter - fabs(enter) * 0x1p-20 - r->t_min) * (1.0 - 0x1p-20);
    return way > 0.0 ? (float)way : 0.0f;
}

double apsm_bvh_ray(const apsm_bvh *bvh, const double x[3], const double d[3], double t_min,
                    double t_max, uint32_t *face)
{
    ray r = make_ray(bvh, x, d, t_min, t_max);
    entry stack[STACK];
    int top = 1;
    stack[0] = make_entry(0.0f, make_ref(0, 0));
    while (top > 0) {
        const entry e = stack[--top];
        const uint32_t ref = (uint32_t)e;
        if ((double)entry_key(e) > r.best - t_min) continue;
        for (uint32_t i = 0; i < ref_count(ref); i++) {
            const triangle t = get_triangle(&bvh->leaves[ref_number(ref)], i);
            hit_triangle(&r, &t, bvh->face[LEAF * ref_number(ref) + i]);
        }
        if (ref_count(ref) > 0) continue;
        const node *n = &bvh->nodes[ref_number(ref)];
        float key[WIDTH] = { 0 };
        for (int k = 0; k < n->children; k++) key[k] = box_entry(n, k, &r);
        top = push_children(n, key, FLT_MAX, stack, top);
    }
    if (face) *face = r.face;
    return r.face == APSM_NONE ? INFINITY : r.best;
}
