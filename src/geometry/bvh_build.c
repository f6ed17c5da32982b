/* Makes the tree of bvh.c.
 *
 * A binary tree from the top: by the surface-area heuristic in 16 bins (Wald, "On fast construction
 * of SAH-based bounding volume hierarchies", 2007) along the longest side, or along each if that
 * gains little; from FEW triangles on by halves along the longest side, down to leaves of LEAF
 * triangles, as many full ones as there can be.  Then every node takes in its largest children
 * until it has four.  The boxes of siblings lie side by side in
 * float32, so that one node is four box distances at once in SSE registers; so do the triangles of
 * a leaf.
 *
 * Boxes are kept in the frame q = (x - centre) * 2^-k, in which the mesh fills about [-1, 1]^3, and
 * are PAD larger than the triangles, which covers the rounding of boxes and of queries near the
 * mesh.  A power of two leaves every float as it is under scaling. */
#include <stdlib.h>
#include <string.h>

#include "core/kernel.h"
#include "geometry/bvh_tree.h"
#include "geometry/stored.h"
#include "geometry/topology.h"
#include "geometry/vec3.h"

enum { BINS = 16, FEW = 32, DEEP = 40 };
#define PAD 0x1p-21f
/* Halves that meet nowhere cost half of the whole, those of a sphere .63. */
#define GOOD_CUT 0.8f

/* ---- the binary tree ------------------------------------------------------------------------ */

/* Four lanes, the last of them 0, so that a side is one register. */
typedef struct box {
    float lo[4], hi[4];
} box;

static const box empty_box = { { INFINITY, INFINITY, INFINITY, INFINITY },
                               { -INFINITY, -INFINITY, -INFINITY, -INFINITY } };

static inline void box_grow(box *restrict a, const box *restrict b)
{
    for (int c = 0; c < 4; c++) {
        a->lo[c] = b->lo[c] < a->lo[c] ? b->lo[c] : a->lo[c];
        a->hi[c] = b->hi[c] > a->hi[c] ? b->hi[c] : a->hi[c];
    }
}

static float box_area(const box *b)
{
    const float x = b->hi[0] - b->lo[0], y = b->hi[1] - b->lo[1], z = b->hi[2] - b->lo[2];
    return x >= 0.0f ? x * y + y * z + z * x : 0.0f;
}

/* A node of the binary tree: leaf if count > 0.  Its left child is the next node. */
typedef struct binary {
    box bounds;
    uint32_t first, count, right;
    uint32_t side; /* of the two arrays that hold its faces */
} binary;

/* Faces in the order of the leaves, and their boxes with them, in one of two arrays each. */
typedef struct builder {
    box *boxes[2];      /* nf */
    uint32_t *order[2]; /* nf: face numbers */
    binary *tree;       /* 2 nf */
    uint32_t used;
} builder;

/* Cut across an axis: what is in bins 0..bin goes left. */
typedef struct split {
    int axis; /* -1: none */
    int bin;
    float from, per_bin, cost;
    box left, right; /* bounds */
} split;

/* In which bin the middle of b is, before rounding down; the last one has what is beyond. */
static inline float place_of(const split *s, const box *b)
{
    return (b->lo[s->axis] + b->hi[s->axis] - s->from) * s->per_bin;
}

/* What lies in the bins of an axis. */
typedef struct axis_bins {
    box bounds[BINS];
    uint32_t count[BINS];
} axis_bins;

static void fill_bins(const box *boxes, uint32_t count, const split *s, axis_bins *bins)
{
    for (int k = 0; k < BINS; k++) bins->bounds[k] = empty_box;
    memset(bins->count, 0, sizeof bins->count);
    for (uint32_t i = 0; i < count; i++) {
        const float place = place_of(s, &boxes[i]);
        const int bin = place < (float)(BINS - 1) ? (int)place : BINS - 1;
        bins->count[bin]++;
        box_grow(&bins->bounds[bin], &boxes[i]);
    }
}

/* Puts the best of the BINS - 1 cuts across an axis into *best, if cheaper; range: of twice the
 * boxes' middles. */
static void try_axis(const box *boxes, uint32_t count, const box *range, int axis, split *best)
{
    axis_bins bins;
    const float size = range->hi[axis] - range->lo[axis], per_bin = (float)BINS / size;
    split s = { .axis = axis, .from = range->lo[axis], .per_bin = per_bin, .left = empty_box };
    if (!(size > 0.0f) || !isfinite(per_bin)) return;
    fill_bins(boxes, count, &s, &bins);
    box right[BINS]; /* bounds of bins k.. */
    right[BINS - 1] = bins.bounds[BINS - 1];
    for (int k = BINS - 2; k > 0; k--) {
        right[k] = bins.bounds[k];
        box_grow(&right[k], &right[k + 1]);
    }
    uint32_t seen = 0;
    for (s.bin = 0; s.bin < BINS - 1; s.bin++) {
        box_grow(&s.left, &bins.bounds[s.bin]);
        seen += bins.count[s.bin];
        s.right = right[s.bin + 1];
        s.cost = box_area(&s.left) * (float)seen + box_area(&s.right) * (float)(count - seen);
        if (seen > 0 && seen < count && s.cost < best->cost) *best = s;
    }
}

static int longest_axis(const box *b)
{
    int axis = 0;
    for (int c = 1; c < 3; c++)
        if (b->hi[c] - b->lo[c] > b->hi[axis] - b->lo[axis]) axis = c;
    return axis;
}

/* Bounds, and those of twice the middles. */
static box bounds_of(const box *boxes, uint32_t count)
{
    box b = empty_box;
    for (uint32_t i = 0; i < count; i++) box_grow(&b, &boxes[i]);
    return b;
}
static box middles_of(const box *boxes, uint32_t count)
{
    box b = empty_box, middle;
    for (uint32_t i = 0; i < count; i++) {
        for (int c = 0; c < 4; c++) middle.lo[c] = middle.hi[c] = boxes[i].lo[c] + boxes[i].hi[c];
        box_grow(&b, &middle);
    }
    return b;
}

/* Most surfaces are best cut across the longest side of their box, where middles are all over.
 * Large triangles among small ones, or needles side by side, want another axis or a range of their
 * own. */
static split find_split(const box *boxes, uint32_t count, const box *bounds)
{
    split s = { .axis = -1, .cost = INFINITY };
    box range;
    for (int c = 0; c < 4; c++) {
        range.lo[c] = 2.0f * bounds->lo[c];
        range.hi[c] = 2.0f * bounds->hi[c];
    }
    try_axis(boxes, count, &range, longest_axis(bounds), &s);
    if (s.cost <= GOOD_CUT * box_area(bounds) * (float)count) return s;
    range = middles_of(boxes, count);
    for (int c = 0; c < 3; c++) try_axis(boxes, count, &range, c, &s);
    return s;
}

/* Into the other arrays: what goes left from the front, what goes right from behind.  Returns how
 * many went left. */
static uint32_t partition(const builder *t, uint32_t side, uint32_t first, uint32_t count,
                          const split *s)
{
    const box *boxes = t->boxes[side] + first;
    const uint32_t *order = t->order[side] + first;
    box *to_boxes = t->boxes[!side] + first;
    uint32_t *to_order = t->order[!side] + first;
    uint32_t left = 0, right = count;
    const split cut = *s;
    for (uint32_t i = 0; i < count; i++) {
        const bool goes_left = place_of(&cut, &boxes[i]) < (float)(cut.bin + 1);
        right -= !goes_left;
        const uint32_t to = goes_left ? left : right;
        to_boxes[to] = boxes[i];
        to_order[to] = order[i];
        left += goes_left;
    }
    return left;
}

/* Of the keys of FEW boxes at most, INFINITY beyond: the place of each in their order; stable. */
APSM_KERNEL static void rank_keys(uint32_t count, const float key[restrict FEW],
                                  uint32_t rank[restrict FEW])
{
    for (uint32_t i = 0; i < FEW; i++) rank[i] = 0;
    for (uint32_t j = 0; j < count; j++)
#pragma omp simd
        for (uint32_t i = 0; i < FEW; i++)
            rank[i] += (key[j] < key[i]) | ((key[j] == key[i]) & (j < i));
}

/* Into the other arrays: a few boxes by their middles along the axis. */
static void sort_along(const builder *t, uint32_t side, uint32_t first, uint32_t count, int axis)
{
    const box *boxes = t->boxes[side] + first;
    const uint32_t *order = t->order[side] + first;
    float key[FEW];
    uint32_t rank[FEW];
    for (uint32_t i = 0; i < FEW; i++)
        key[i] = i < count ? boxes[i].lo[axis] + boxes[i].hi[axis] : INFINITY;
    rank_keys(count, key, rank);
    for (uint32_t i = 0; i < count; i++) {
        t->boxes[!side][first + rank[i]] = boxes[i];
        t->order[!side][first + rank[i]] = order[i];
    }
}

/* Orders the faces of *b so that those of the left child come first, returns how many they are, and
 * sets the children's bounds.  Below DEEP levels, or where all middles coincide, any half will do:
 * the depth stays under DEEP + 32. */
static uint32_t divide(const builder *t, binary *b, int depth, split *s)
{
    const uint32_t first = b->first, count = b->count;
    if (count > FEW && depth < DEEP) {
        *s = find_split(t->boxes[b->side] + first, count, &b->bounds);
        if (s->axis >= 0) {
            const uint32_t left = partition(t, b->side, first, count, s);
            b->side = !b->side;
            return left;
        }
    }
    if (count <= FEW) {
        sort_along(t, b->side, first, count, longest_axis(&b->bounds));
        b->side = !b->side;
    }
    const box *boxes = t->boxes[b->side] + first;
    const uint32_t left = LEAF * ((count + LEAF - 1) / LEAF / 2);
    s->left = bounds_of(boxes, left);
    s->right = bounds_of(boxes + left, count - left);
    return left;
}

/* The node whose bounds, faces and side are given, and all below it. */
static void build_binary(builder *t, binary given, int depth)
{
    binary *b = &t->tree[t->used++];
    *b = given;
    if (given.count <= LEAF) return;
    split s;
    const uint32_t left = divide(t, b, depth, &s);
    b->count = 0;
    build_binary(t, (binary){ s.left, given.first, left, 0, b->side }, depth + 1);
    b->right = t->used;
    build_binary(t, (binary){ s.right, given.first + left, given.count - left, 0, b->side },
                 depth + 1);
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
        child[open]++;
        child[n++] = c->right;
    }
    return n;
}

/* ---- leaves --------------------------------------------------------------------------------- */

/* A triangle's corners, lane by lane. */
typedef struct corners {
    double x[3][3][LEAF]; /* corner, axis */
} corners;

/* Unit normals, zero for a face without extent. */
APSM_KERNEL static void lane_normals(const corners *restrict t, double unit[restrict 3][LEAF])
{
#pragma omp simd
    for (int i = 0; i < LEAF; i++) {
        const double ax = t->x[1][0][i] - t->x[0][0][i], ay = t->x[1][1][i] - t->x[0][1][i],
                     az = t->x[1][2][i] - t->x[0][2][i], cx = t->x[0][0][i] - t->x[2][0][i],
                     cy = t->x[0][1][i] - t->x[2][1][i], cz = t->x[0][2][i] - t->x[2][2][i];
        const double x = cy * az - cz * ay, y = cz * ax - cx * az, z = cx * ay - cy * ax;
        const double length = sqrt(x * x + y * y + z * z), whole = length > 0.0 ? length : 1.0;
        unit[0][i] = x / whole;
        unit[1][i] = y / whole;
        unit[2][i] = z / whole;
    }
}

/* The rows of a leaf, from corners in the tree's frame, turned so that the edge from the first to
 * the second is the longest.  A triangle flatter than 1e-9 is its edges: any axis across will do.
 */
APSM_KERNEL static void lane_rows(const corners *restrict t, float row[restrict ROWS][LEAF])
{
#pragma omp simd
    for (int i = 0; i < LEAF; i++) {
        double e[3], x0[3], u[3], w[3], v[3], m[3];
        for (int k = 0; k < 3; k++) {
            const double x = t->x[(k + 1) % 3][0][i] - t->x[k][0][i],
                         y = t->x[(k + 1) % 3][1][i] - t->x[k][1][i],
                         z = t->x[(k + 1) % 3][2][i] - t->x[k][2][i];
            e[k] = x * x + y * y + z * z;
        }
        const int second = e[1] > e[0] && e[1] >= e[2], third = e[2] > e[0] && e[2] > e[1];
        for (int c = 0; c < 3; c++) {
            const double p = t->x[0][c][i], q = t->x[1][c][i], r = t->x[2][c][i];
            x0[c] = second ? q : third ? r : p;
            u[c] = (second ? r : third ? p : q) - x0[c];
            w[c] = (second ? p : third ? q : r) - x0[c];
        }
        const double length = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
        const double whole = length > 0.0 ? length : 1.0;
        u[0] = length > 0.0 ? u[0] / whole : 1.0;
        u[1] /= whole;
        u[2] /= whole;
        const double along = w[0] * u[0] + w[1] * u[1] + w[2] * u[2];
        for (int c = 0; c < 3; c++) v[c] = w[c] - along * u[c];
        const double b = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        const int flat = !(b > 1e-9 * length), by_x = fabs(u[0]) < 0.6;
        const double part = by_x ? u[0] : u[1];
        for (int c = 0; c < 3; c++) {
            const double axis = c == (by_x ? 0 : 1) ? 1.0 : 0.0;
            v[c] = flat ? axis - part * u[c] : v[c];
        }
        const double across = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        for (int c = 0; c < 3; c++) v[c] /= across;
        m[0] = u[1] * v[2] - u[2] * v[1];
        m[1] = u[2] * v[0] - u[0] * v[2];
        m[2] = u[0] * v[1] - u[1] * v[0];
        const double from_0 = along > 0.0 ? along : 0.0, a = from_0 < length ? from_0 : length;
        const double rise = sqrt((length - a) * (length - a) + b * b), climb = sqrt(a * a + b * b);
        for (int c = 0; c < 3; c++) {
            row[ORIGIN + c][i] = (float)x0[c];
            row[AXIS_X + c][i] = (float)u[c];
            row[AXIS_Y + c][i] = (float)v[c];
            row[AXIS_Z + c][i] = (float)m[c];
        }
        row[LENGTH][i] = (float)length;
        row[RISE_X][i] = (float)(rise > 0.0 ? (a - length) / rise : -1.0);
        row[RISE_Y][i] = (float)(rise > 0.0 ? b / rise : 0.0);
        row[RISE_LENGTH][i] = (float)rise;
        row[CLIMB_X][i] = (float)(climb > 0.0 ? a / climb : 1.0);
        row[CLIMB_Y][i] = (float)(climb > 0.0 ? b / climb : 0.0);
        row[CLIMB_LENGTH][i] = (float)climb;
    }
}

/* Into the tree's frame; returns their box. */
APSM_KERNEL static box place_corners(const apsm_bvh *bvh, corners *restrict t)
{
    box b = { { 0 }, { 0 } };
    for (int c = 0; c < 3; c++) {
        const double centre = bvh->centre[c], scale = bvh->scale;
        float lo = INFINITY, hi = -INFINITY;
        for (int k = 0; k < 3; k++)
#pragma omp simd reduction(min : lo) reduction(max : hi)
            for (int i = 0; i < LEAF; i++) {
                const double x = (t->x[k][c][i] - centre) * scale;
                const float q = (float)x;
                t->x[k][c][i] = x;
                lo = q < lo ? q : lo;
                hi = q > hi ? q : hi;
            }
        b.lo[c] = lo - PAD;
        b.hi[c] = hi + PAD;
    }
    return b;
}

/* Returns the leaf's box. */
static box fill_leaf(apsm_bvh *bvh, size_t number)
{
    leaf *out = &bvh->leaves[number];
    const uint32_t *face = bvh->face + LEAF * number;
    corners t;
    double unit[3][LEAF];
    for (size_t i = 0; i < LEAF; i++)
        for (size_t k = 0; k < 3; k++) {
            const double *p = bvh->mesh->V + 3 * (size_t)bvh->mesh->F[3 * (size_t)face[i] + k];
            for (size_t c = 0; c < 3; c++) t.x[k][c][i] = p[c];
        }
    lane_normals(&t, unit);
    for (size_t i = 0; i < LEAF; i++)
        for (size_t c = 0; c < 3; c++) bvh->face_normal[3 * (size_t)face[i] + c] = unit[c][i];
    const box bounds = place_corners(bvh, &t);
    lane_rows(&t, out->row);
    for (size_t i = 1; i < LEAF; i++)
        if (face[i] == face[i - 1]) out->row[ORIGIN][i] = NAN;
    return bounds;
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
            add_leaf(bvh, t->order[c->side] + c->first, c->count);
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

/* A vertex in the tree's frame; four lanes as a box. */
typedef struct place {
    float q[4];
} place;

static void place_vertices(const apsm_bvh *bvh, place *at)
{
    const double *V = bvh->mesh->V;
    for (size_t v = 0; v < bvh->mesh->nv; v++) {
        for (size_t c = 0; c < 3; c++)
            at[v].q[c] = (float)((V[3 * v + c] - bvh->centre[c]) * bvh->scale);
        at[v].q[3] = 0.0f;
    }
}

static box face_box(const uint32_t corner[3], const place *at)
{
    const float *p = at[corner[0]].q, *q = at[corner[1]].q, *r = at[corner[2]].q;
    box b;
    for (int c = 0; c < 4; c++) {
        const float lo = p[c] < q[c] ? p[c] : q[c], hi = p[c] > q[c] ? p[c] : q[c];
        b.lo[c] = (lo < r[c] ? lo : r[c]) - PAD;
        b.hi[c] = (hi > r[c] ? hi : r[c]) + PAD;
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
    box *boxes = malloc(2 * nf * sizeof *boxes);
    uint32_t *order = malloc(2 * nf * sizeof *order);
    binary *tree = malloc(2 * nf * sizeof *tree);
    place *at = malloc(bvh->mesh->nv * sizeof *at);
    apsm_status status = APSM_ERR_MEMORY;
    if (boxes && order && tree && at) {
        builder t = { { boxes, boxes + nf }, { order, order + nf }, tree, 0 };
        place_vertices(bvh, at);
        for (size_t f = 0; f < nf; f++) {
            boxes[f] = face_box(bvh->mesh->F + 3 * f, at);
            order[f] = (uint32_t)f;
        }
        const uint32_t n = (uint32_t)nf;
        build_binary(&t, (binary){ bounds_of(boxes, n), 0, n, 0, 0 }, 0);
        status = alloc_wide(bvh, (t.used + 1) / 2);
        if (status == APSM_OK) build_wide(bvh, &t, 0);
    }
    free(boxes);
    free(order);
    free(tree);
    free(at);
    return status;
}

/* For signs. */
static apsm_status build_normals(apsm_bvh *bvh)
{
    apsm_topology topology;
    bvh->vertex_normal = malloc((3 * bvh->mesh->nv + 1) * sizeof *bvh->vertex_normal);
    if (!bvh->vertex_normal) return APSM_ERR_MEMORY;
    APSM_TRY(apsm_topology_build(bvh->mesh, &topology));
    bvh->twin = topology.twin; /* taken */
    topology.twin = NULL;
    apsm_topology_free(&topology);
    apsm_mesh_vertex_normals(bvh->mesh, bvh->vertex_normal);
    return APSM_OK;
}

static apsm_status check(const apsm_mesh *mesh)
{
    if (mesh->nf == 0 || mesh->nf > UINT32_MAX / 16) return APSM_ERR_GEOMETRY;
    for (size_t i = 0; i < 3 * mesh->nf; i++)
        if (mesh->F[i] >= mesh->nv) return APSM_ERR_GEOMETRY;
    for (size_t i = 0; i < 3 * mesh->nv; i++)
        if (!isfinite(mesh->V[i])) return APSM_ERR_NONFINITE;
    return APSM_OK;
}

static apsm_status build(const apsm_mesh *mesh, bool with_signs, apsm_bvh **out)
{
    *out = NULL;
    APSM_TRY(check(mesh));
    apsm_bvh *bvh = calloc(1, sizeof *bvh);
    if (!bvh) return APSM_ERR_MEMORY;
    bvh->mesh = mesh;
    bvh->face_normal = malloc(3 * mesh->nf * sizeof *bvh->face_normal);
    apsm_status status = bvh->face_normal ? APSM_OK : APSM_ERR_MEMORY;
    choose_frame(bvh);
    if (status == APSM_OK && with_signs) status = build_normals(bvh);
    if (status == APSM_OK) status = build_tree(bvh);
    if (status == APSM_OK)
        *out = bvh;
    else
        apsm_bvh_free(bvh);
    return status;
}

apsm_status apsm_bvh_build(const apsm_mesh *mesh, apsm_bvh **bvh)
{
    return build(mesh, true, bvh);
}

apsm_status apsm_bvh_build_unsigned(const apsm_mesh *mesh, apsm_bvh **bvh)
{
    return build(mesh, false, bvh);
}

void bvh_arrays(apsm_bvh *bvh, array_list *list)
{
    const size_t nv = bvh->mesh->nv, nf = bvh->mesh->nf;
    arrays_add(list, &bvh->nodes, bvh->node_count * sizeof *bvh->nodes);
    arrays_add(list, &bvh->leaves, bvh->leaf_count * sizeof *bvh->leaves);
    arrays_add(list, &bvh->face, bvh->leaf_count * LEAF * sizeof *bvh->face);
    arrays_add(list, &bvh->face_normal, 3 * nf * sizeof *bvh->face_normal);
    if (!bvh->twin) return;
    arrays_add(list, &bvh->vertex_normal, 3 * nv * sizeof *bvh->vertex_normal);
    arrays_add(list, &bvh->twin, 3 * nf * sizeof *bvh->twin);
}

/* Bounds of a child: a leaf, which is filled, or a node that is up to date. */
static box child_bounds(apsm_bvh *bvh, const node *n, int child)
{
    box b = empty_box;
    const uint32_t number = ref_number(n->ref[child]);
    if (ref_count(n->ref[child]) > 0) return fill_leaf(bvh, number);
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
    for (size_t n = bvh->node_count; n-- > 0;) /* children have larger numbers */
        for (int k = 0; k < bvh->nodes[n].children; k++) {
            const box b = child_bounds(bvh, &bvh->nodes[n], k);
            set_bounds(&bvh->nodes[n], k, &b);
        }
    if (bvh->vertex_normal) apsm_mesh_vertex_normals(bvh->mesh, bvh->vertex_normal);
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
