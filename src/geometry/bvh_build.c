/* Makes the tree of bvh.c.
 *
 * A binary tree from the top: by the surface-area heuristic in 16 bins (Wald, "On fast construction
 * of SAH-based bounding volume hierarchies", 2007), from FEW triangles on by halves along the
 * longest side, down to leaves of LEAF triangles, as many full ones as there can be.  Then every
 * node takes in its largest children until it has four.  The boxes of siblings lie side by side in
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

/* A node of the binary tree: leaf if count > 0. */
typedef struct binary {
    box bounds;
    uint32_t first, count, left, right;
} binary;

/* Faces in the order of the leaves, and their boxes with them. */
typedef struct builder {
    box *boxes, *spare_boxes;      /* nf */
    uint32_t *order, *spare_order; /* nf: face numbers */
    binary *tree;                  /* 2 nf */
    uint32_t used;
} builder;

/* Cut across an axis: bins 0..bin go left. */
typedef struct split {
    int axis; /* -1: none */
    float from[4], per_bin[4], cost;
    int bin;
} split;

/* The bin of the middle of b along each axis. */
static inline void bins_of(const split *s, const box *b, int bin[4])
{
    for (int c = 0; c < 4; c++) {
        const float at = (b->lo[c] + b->hi[c] - s->from[c]) * s->per_bin[c];
        bin[c] = at < (float)(BINS - 1) ? (int)at : BINS - 1;
    }
}

/* What lies in the bins of an axis. */
typedef struct axis_bins {
    box bounds[BINS];
    uint32_t count[BINS];
} axis_bins;

/* Best of the BINS - 1 cuts across one axis, if cheaper than *best. */
static void try_axis(const axis_bins *a, uint32_t count, int axis, split *best)
{
    box left = empty_box, right = empty_box;
    float right_cost[BINS];
    uint32_t seen = 0;
    for (int k = BINS - 1; k > 0; k--) {
        box_grow(&right, &a->bounds[k]);
        seen += a->count[k];
        right_cost[k - 1] = box_area(&right) * (float)seen;
    }
    seen = 0;
    for (int k = 0; k < BINS - 1; k++) {
        box_grow(&left, &a->bounds[k]);
        seen += a->count[k];
        const float cost = box_area(&left) * (float)seen + right_cost[k];
        if (seen == 0 || seen == count || !(cost < best->cost)) continue;
        best->cost = cost;
        best->axis = axis;
        best->bin = k;
    }
}

/* middles: bounds of twice the boxes' middles. */
static split find_split(const builder *t, uint32_t first, uint32_t count, const box *middles)
{
    axis_bins bins[3];
    split s = { .axis = -1, .cost = INFINITY };
    for (int c = 0; c < 3; c++) {
        const float size = middles->hi[c] - middles->lo[c], per_bin = (float)BINS / size;
        s.from[c] = middles->lo[c];
        s.per_bin[c] = size > 0.0f && isfinite(per_bin) ? per_bin : 0.0f;
        for (int k = 0; k < BINS; k++) bins[c].bounds[k] = empty_box;
        memset(bins[c].count, 0, sizeof bins[c].count);
    }
    for (uint32_t i = first; i < first + count; i++) {
        int bin[4];
        bins_of(&s, &t->boxes[i], bin);
        for (int c = 0; c < 3; c++) {
            bins[c].count[bin[c]]++;
            box_grow(&bins[c].bounds[bin[c]], &t->boxes[i]);
        }
    }
    for (int c = 0; c < 3; c++) try_axis(&bins[c], count, c, &s);
    return s;
}

/* Stable; returns how many went left. */
static uint32_t partition(const builder *t, uint32_t first, uint32_t count, const split *s)
{
    uint32_t left = 0, right = 0;
    for (uint32_t i = first; i < first + count; i++) {
        const box b = t->boxes[i];
        const uint32_t face = t->order[i];
        int bin[4];
        bins_of(s, &b, bin);
        const bool goes_left = bin[s->axis] <= s->bin;
        box *boxes = goes_left ? &t->boxes[first + left] : &t->spare_boxes[right];
        uint32_t *order = goes_left ? &t->order[first + left] : &t->spare_order[right];
        *boxes = b;
        *order = face;
        left += goes_left;
        right += !goes_left;
    }
    memcpy(t->boxes + first + left, t->spare_boxes, right * sizeof *t->boxes);
    memcpy(t->order + first + left, t->spare_order, right * sizeof *t->order);
    return left;
}

/* Sorts a few boxes by their middles along the axis; stable. */
static void sort_along(const builder *t, uint32_t first, uint32_t count, int axis)
{
    for (uint32_t i = first + 1; i < first + count; i++) {
        const box b = t->boxes[i];
        const uint32_t face = t->order[i];
        const float key = b.lo[axis] + b.hi[axis];
        uint32_t k = i;
        for (; k > first && key < t->boxes[k - 1].lo[axis] + t->boxes[k - 1].hi[axis]; k--) {
            t->boxes[k] = t->boxes[k - 1];
            t->order[k] = t->order[k - 1];
        }
        t->boxes[k] = b;
        t->order[k] = face;
    }
}

static int longest_axis(const box *b)
{
    int axis = 0;
    for (int c = 1; c < 3; c++)
        if (b->hi[c] - b->lo[c] > b->hi[axis] - b->lo[axis]) axis = c;
    return axis;
}

/* Orders the faces so that those of the left child come first, and says how many they are.  Below
 * DEEP levels, or where all middles coincide, any half will do: the depth stays under DEEP + 32. */
static uint32_t divide(const builder *t, uint32_t first, uint32_t count, int depth,
                       const box *middles)
{
    if (count > FEW && depth < DEEP) {
        const split s = find_split(t, first, count, middles);
        if (s.axis >= 0) return partition(t, first, count, &s);
    }
    if (count <= FEW) sort_along(t, first, count, longest_axis(middles));
    const uint32_t leaves = (count + LEAF - 1) / LEAF;
    return LEAF * (leaves / 2);
}

static uint32_t build_binary(builder *t, uint32_t first, uint32_t count, int depth)
{
    const uint32_t self = t->used++;
    binary *b = &t->tree[self];
    box bounds = empty_box, middles = empty_box;
    for (uint32_t i = first; i < first + count; i++) {
        box middle;
        for (int c = 0; c < 4; c++)
            middle.lo[c] = middle.hi[c] = t->boxes[i].lo[c] + t->boxes[i].hi[c];
        box_grow(&bounds, &t->boxes[i]);
        box_grow(&middles, &middle);
    }
    *b = (binary){ .bounds = bounds, .first = first, .count = count };
    if (count <= LEAF) return self;
    const uint32_t left = divide(t, first, count, depth, &middles);
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

/* Turns the corners so that the edge from the first to the second is the longest. */
APSM_KERNEL static void turn_corners(corners *restrict t)
{
#pragma omp simd
    for (int i = 0; i < LEAF; i++) {
        double p[3][3], e[3];
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++) p[k][c] = t->x[k][c][i];
        for (int k = 0; k < 3; k++) {
            const double *a = p[k], *b = p[(k + 1) % 3];
            e[k] = (b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]) +
                   (b[2] - a[2]) * (b[2] - a[2]);
        }
        const int second = e[1] > e[0] && e[1] >= e[2], third = e[2] > e[0] && e[2] > e[1];
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++) {
                const double other = third ? p[(k + 2) % 3][c] : p[k][c];
                t->x[k][c][i] = second ? p[(k + 1) % 3][c] : other;
            }
    }
}

/* The rows of a leaf, from corners in the tree's frame.  A triangle flatter than 1e-9 is its edges:
 * any axis across will do. */
APSM_KERNEL static void lane_rows(const corners *restrict t, float row[restrict ROWS][LEAF])
{
#pragma omp simd
    for (int i = 0; i < LEAF; i++) {
        const double *x0 = &t->x[0][0][i], *x1 = &t->x[1][0][i], *x2 = &t->x[2][0][i];
        double u[3], w[3], v[3], m[3];
        for (int c = 0; c < 3; c++) {
            u[c] = x1[c * LEAF] - x0[c * LEAF];
            w[c] = x2[c * LEAF] - x0[c * LEAF];
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
            row[ORIGIN + c][i] = (float)x0[c * LEAF];
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
    turn_corners(&t);
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
    b.lo[3] = b.hi[3] = 0.0f;
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
    builder t = { .boxes = malloc(2 * nf * sizeof *t.boxes),
                  .order = malloc(2 * nf * sizeof *t.order),
                  .tree = malloc(2 * nf * sizeof *t.tree) };
    apsm_status status = APSM_ERR_MEMORY;
    if (t.boxes && t.order && t.tree) {
        t.spare_boxes = t.boxes + nf;
        t.spare_order = t.order + nf;
        for (size_t f = 0; f < nf; f++) {
            t.boxes[f] = face_box(bvh, f);
            t.order[f] = (uint32_t)f;
        }
        build_binary(&t, 0, (uint32_t)nf, 0);
        status = alloc_wide(bvh, (t.used + 1) / 2);
        if (status == APSM_OK) build_wide(bvh, &t, 0);
    }
    free(t.boxes);
    free(t.order);
    free(t.tree);
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
