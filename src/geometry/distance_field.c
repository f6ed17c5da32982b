/* Sparse signed distance field.
 *
 * Frame: node (i,j,k) at origin + voxel (i,j,k); the origin is the lower corner of the mesh's box,
 * less a whole number of voxels.  Values are D / voxel.
 *
 * Build: an octree over the nodes, from one cell around everything down to single nodes.  Every
 * node within
 *   reach = band + 1.75 voxel
 * gets its exact distance.  The centre's distance d prunes (D changes by at most the way): a cell
 * is left out if d > reach + half its diagonal.  From bricks down a cell knows the leaves of the
 * tree that its nodes can be closest to: those within min(d + half its diagonal, reach) of it,
 * among the ones of the cell around it.  The last cells are 2^3 nodes, which try the triangles of
 * their few leaves together.
 * reach: D needs the corners of a point's cell, up to sqrt(3) voxels away; a cell with a corner out
 * of reach lies beyond the band.  N needs nodes up to sqrt(6) voxels away, and is exact where they
 * are not kept.  Nodes out of reach are NaN, which poisons whatever is computed from them.
 *
 * Draw: for each cube of 2^3 cells of the whole grid (more where it is very sparse) `least` bounds
 * |D| from below, in steps of a quarter voxel: most trials outside the band end at one look there.
 *
 * Sample: from the 4^3 nodes about x, t in [0,1)^3 the place in the middle cell,
 *   D   = sum over the 8 corners of w(t) v                                         trilinear
 *   N   = sum over the 8 corners of w(t) (v(+1) - v(-1)) / 2, to unit length       per axis
 * Both are products of one filter per axis. */
#include "geometry/distance_field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/random_inline.h"
#include "geometry/bvh_guess.h"
#include "geometry/stored.h"
#include "geometry/vec3.h"

enum {
    BRICK_BITS = 3,
    BRICK = 1 << BRICK_BITS,
    NODES = BRICK * BRICK * BRICK,
    STEPS = 4,         /* of `least`, a voxel */
    FAR = 255,         /* of `least`: at least so far, or unknown */
    MOST_CUBES = 4096, /* a brick */
    MOST_NODES = 1 << 20,
    PATIENCE = 4096
};

struct apsm_field {
    const apsm_bvh *bvh;
    double origin[3], voxel, band;
    double per_voxel;       /* 1 / voxel */
    int64_t n[3];           /* nodes from 0 to n - 1 cover all within reach */
    float (*bricks)[NODES]; /* bricks[0]: all NaN, stands for those left out */
    uint64_t *brick_key;    /* of each brick */
    uint8_t *least;         /* |D| in each cube of (2^cube)^3 cells is at least this */
    int64_t cubes[3];       /* along each axis */
    unsigned cube;
    size_t brick_count, brick_room;
    uint32_t *table; /* open-addressing hash of keys; 0: empty */
    unsigned table_bits;
    double lo[3], size[3]; /* box of the mesh */
    bool open;             /* it has a border, beyond which nothing is drawn */
};

/* ---- interpolation -------------------------------------------------------------------------- */

/* v[k][j][i]: nodes -1, 0, 1, 2 per axis about the cell of x. */
typedef double stencil[4][4][4];

/* D and unscaled gradient g (NULL: not wanted) at place t of the middle cell.  Reads the 8 nodes
 * of the cell and, for g, the 24 that continue its edges. */
static inline void interpolate(stencil v, const double t[3], double *D, double g[3])
{
    const double x[2] = { 1.0 - t[0], t[0] }, y[2] = { 1.0 - t[1], t[1] },
                 z[2] = { 1.0 - t[2], t[2] };
    double p[4][4]; /* p[k][j]: v interpolated along x */
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 4; j++) p[k][j] = x[0] * v[k][j][1] + x[1] * v[k][j][2];
    *D = z[0] * (y[0] * p[1][1] + y[1] * p[1][2]) + z[1] * (y[0] * p[2][1] + y[1] * p[2][2]);
    if (!g) return;
    for (int c = 0; c < 3; c++) g[c] = 0.0;
    for (int k = 0; k < 2; k++) {
        for (int j = 0; j < 2; j++) {
            const double *row = v[k + 1][j + 1];
            g[0] += z[k] * y[j] * (x[0] * (row[2] - row[0]) + x[1] * (row[3] - row[1]));
        }
        g[1] += z[k] * (y[0] * (p[k + 1][2] - p[k + 1][0]) + y[1] * (p[k + 1][3] - p[k + 1][1]));
        g[2] += y[k] * (z[0] * (p[2][k + 1] - p[0][k + 1]) + z[1] * (p[3][k + 1] - p[1][k + 1]));
    }
}

/* ---- dense grid ----------------------------------------------------------------------------- */

/* Nodes -1..2 along one axis as weights of three existing nodes each.  Beyond the rim the value
 * is continued as a parabola, 3 f0 - 3 f1 + f2: its central difference at the rim is the
 * one-sided second-order one, (-3 f0 + 4 f1 - f2) / 2. */
typedef struct tap {
    size_t at[3];
    double weight[3];
} tap;

static tap make_tap(long i, size_t n)
{
    const long last = (long)n - 1;
    tap p = { .weight = { 1.0, 0.0, 0.0 } };
    if (i >= 0 && i <= last) {
        for (int k = 0; k < 3; k++) p.at[k] = (size_t)i;
        return p;
    }
    const long step = i < 0 ? 1 : -1, rim = i < 0 ? 0 : last;
    for (long k = 0; k < 3; k++) p.at[k] = (size_t)(k <= last ? rim + step * k : rim);
    if (n >= 3) {
        memcpy(p.weight, (double[3]){ 3.0, -3.0, 1.0 }, sizeof p.weight);
    } else if (n == 2) {
        memcpy(p.weight, (double[3]){ 2.0, -1.0, 0.0 }, sizeof p.weight);
    }
    return p;
}

static double tapped(const size_t n[3], const double *values, const tap *x, const tap *y,
                     const tap *z)
{
    double sum = 0.0;
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < 3; j++)
            for (int i = 0; i < 3; i++) {
                const double w = x->weight[i] * y->weight[j] * z->weight[k];
                if (w != 0.0) sum += w * values[x->at[i] + n[0] * (y->at[j] + n[1] * z->at[k])];
            }
    return sum;
}

/* Cell and place in it of one coordinate, clamped to the grid. */
static long locate(double u, size_t n, double *t)
{
    const double last = (double)n - 1.0;
    u = u > 0.0 ? (u < last ? u : last) : 0.0;
    long i = (long)u;
    if (i > (long)n - 2) i = n >= 2 ? (long)n - 2 : 0;
    *t = u - (double)i;
    return i;
}

void apsm_grid_sample(const size_t n[3], const double origin[3], double spacing,
                      const double *values, size_t nx, const double *X, double *D, double *N)
{
    for (size_t r = 0; r < nx; r++) {
        tap taps[3][4];
        double t[3], d, g[3];
        stencil v;
        for (size_t c = 0; c < 3; c++) {
            const long i = locate((X[3 * r + c] - origin[c]) / spacing, n[c], &t[c]);
            for (long k = 0; k < 4; k++) taps[c][k] = make_tap(i + k - 1, n[c]);
        }
        for (int k = 0; k < 4; k++)
            for (int j = 0; j < 4; j++)
                for (int i = 0; i < 4; i++)
                    v[k][j][i] = tapped(n, values, &taps[0][i], &taps[1][j], &taps[2][k]);
        interpolate(v, t, &d, g);
        if (D) D[r] = d;
        if (!N) continue;
        if (!(vec3_normalise(g) > 0.0)) g[2] = 1.0; /* no direction at all: any */
        memcpy(N + 3 * r, g, sizeof g);
    }
}

/* ---- bricks --------------------------------------------------------------------------------- */

static uint64_t brick_key(int64_t bx, int64_t by, int64_t bz)
{
    return (uint64_t)bx | (uint64_t)by << 20 | (uint64_t)bz << 40;
}

static size_t hash(uint64_t key, unsigned bits)
{
    return (size_t)((key * 0x9e3779b97f4a7c15u) >> (64 - bits)); /* Fibonacci hashing */
}

/* The number of the brick of that key, or 0: the brick of NaNs.  Whether there is one cannot be
 * foreseen, that it stands where it should can: one branch asks for both. */
static uint32_t brick_number(const apsm_field *field, uint64_t key)
{
    const size_t mask = ((size_t)1 << field->table_bits) - 1;
    size_t i = hash(key, field->table_bits);
    uint32_t b = field->table[i];
    while ((b != 0) & (field->brick_key[b] != key)) b = field->table[i = (i + 1) & mask];
    return b;
}

static const float *find_brick(const apsm_field *field, uint64_t key)
{
    return field->bricks[brick_number(field, key)];
}

static apsm_status make_table(apsm_field *field)
{
    field->table_bits = 4;
    while ((size_t)1 << field->table_bits < 8 * field->brick_count) field->table_bits++;
    const size_t size = (size_t)1 << field->table_bits;
    field->table = calloc(size, sizeof *field->table);
    if (!field->table) return APSM_ERR_MEMORY;
    for (size_t b = 1; b < field->brick_count; b++) {
        size_t i = hash(field->brick_key[b], field->table_bits);
        while (field->table[i]) i = (i + 1) & (size - 1);
        field->table[i] = (uint32_t)b;
    }
    return APSM_OK;
}

/* Gives both arrays of bricks room for that many. */
static apsm_status resize_bricks(apsm_field *field, size_t room)
{
    void *bricks = realloc(field->bricks, room * sizeof *field->bricks);
    if (bricks) field->bricks = bricks;
    void *keys = realloc(field->brick_key, room * sizeof *field->brick_key);
    if (keys) field->brick_key = keys;
    if (!bricks || !keys) return APSM_ERR_MEMORY;
    field->brick_room = room;
    return APSM_OK;
}

static apsm_status add_brick(apsm_field *field, uint64_t key)
{
    if (field->brick_count >= UINT32_MAX) return APSM_ERR_MEMORY;
    if (field->brick_count == field->brick_room)
        APSM_TRY(resize_bricks(field, field->brick_room ? 2 * field->brick_room : 64));
    float *brick = field->bricks[field->brick_count];
    for (int i = 0; i < NODES; i++) brick[i] = NAN;
    field->brick_key[field->brick_count++] = key;
    return APSM_OK;
}

/* ---- build ---------------------------------------------------------------------------------- */

enum { LEVELS = BRICK_BITS }; /* of lists: for a brick, its parts, their parts */

typedef struct builder {
    apsm_context *ctx;
    apsm_field *field;
    double reach;
    bvh_near *near; /* LEVELS */
} builder;

static void node_position(const apsm_field *field, const int64_t node[3], double x[3])
{
    for (int c = 0; c < 3; c++) x[c] = field->origin[c] + field->voxel * (double)node[c];
}

/* How far from a cube what any place in it is closest to may be, as far as it matters: its
 * middle's distance is given. */
static double way_of_any(const builder *b, double distance, double half)
{
    return fmin(distance + sqrt(3.0) * half, b->reach);
}

/* The node of part k of the cell of size^3 nodes from lo on. */
static void part_of(const int64_t lo[3], int64_t size, int k, int64_t part[3])
{
    for (int c = 0; c < 3; c++) part[c] = lo[c] + size / 2 * (k >> c & 1);
}

/* Exact distances at the 2^3 nodes from lo on that are within reach. */
static void fill_nodes(const builder *b, const bvh_near *near, const int64_t lo[3], uint32_t *slot)
{
    const apsm_field *field = b->field;
    float *brick = field->bricks[field->brick_count - 1];
    double x[BVH_AT_ONCE][3];
    int64_t node[BVH_AT_ONCE][3];
    apsm_closest closest[BVH_AT_ONCE];
    for (int k = 0; k < BVH_AT_ONCE; k++) {
        part_of(lo, 2, k, node[k]);
        node_position(field, node[k], x[k]);
    }
    bvh_near_closest_of(field->bvh, near, (const double(*)[3])x, b->reach * b->reach, slot,
                        closest);
    for (int k = 0; k < BVH_AT_ONCE; k++) {
        if (closest[k].distance2 == INFINITY) continue;
        const double d = sqrt(closest[k].distance2) * bvh_sign(field->bvh, x[k], &closest[k]);
        brick[node[k][0] % BRICK + BRICK * (node[k][1] % BRICK + BRICK * (node[k][2] % BRICK))] =
            (float)(d / field->voxel);
    }
}

/* The size^3 nodes from lo on, near[level - 1] the leaves that any of them may need.  slot: the
 * triangle closest to what is around. */
static void fill_cell(const builder *b, const int64_t lo[3], int64_t size, uint32_t slot, int level)
{
    const apsm_field *field = b->field;
    const double half = 0.5 * (double)(size - 1) * field->voxel;
    const bvh_near *around = &b->near[level - 1];
    bvh_near *near = &b->near[level];
    double x[3];
    apsm_closest closest;
    node_position(field, lo, x);
    for (int c = 0; c < 3; c++) x[c] += half;
    bvh_near_closest(field->bvh, around, x, b->reach * b->reach, &slot, &closest);
    const double way = way_of_any(b, sqrt(closest.distance2), half);
    bvh_near_choose(field->bvh, around, x, half, way, near);
    if (near->n == 0) return;
    if (size == 2) {
        fill_nodes(b, near, lo, &slot);
        return;
    }
    for (int k = 0; k < 8; k++) {
        int64_t part[3];
        part_of(lo, size, k, part);
        fill_cell(b, part, size / 2, slot, level + 1);
    }
}

/* Cell of size^3 nodes from lo on. */
static apsm_status descend(const builder *b, const int64_t lo[3], int64_t size, uint32_t slot)
{
    const apsm_field *field = b->field;
    const int64_t half = size / 2, middle[3] = { lo[0] + half, lo[1] + half, lo[2] + half };
    const double way = (double)half * field->voxel, limit = b->reach + sqrt(3.0) * way;
    double x[3];
    apsm_closest closest;
    node_position(field, middle, x);
    bvh_closest_guess(field->bvh, x, limit * limit, &slot, &closest);
    if (!(closest.distance2 < limit * limit)) return APSM_OK;
    if (size == BRICK) {
        if (apsm_interrupted(b->ctx)) return APSM_ERR_INTERRUPTED;
        APSM_TRY(add_brick(b->field, brick_key(lo[0] / BRICK, lo[1] / BRICK, lo[2] / BRICK)));
        bvh_near_collect(field->bvh, x, way, way_of_any(b, sqrt(closest.distance2), way),
                         &b->near[0]);
    }
    for (int k = 0; k < 8; k++) {
        int64_t part[3];
        part_of(lo, size, k, part);
        if (size == BRICK)
            fill_cell(b, part, half, slot, 1);
        else
            APSM_TRY(descend(b, part, half, slot));
    }
    return APSM_OK;
}

/* Nodes that cover the mesh and all within reach of it. */
static apsm_status place_grid(apsm_context *ctx, apsm_field *field, double reach)
{
    double lo[3], hi[3];
    apsm_mesh_bounds(apsm_bvh_mesh(field->bvh), lo, hi);
    const double margin = ceil(reach / field->voxel);
    for (int c = 0; c < 3; c++) {
        const double n = ceil((hi[c] - lo[c]) / field->voxel) + 2.0 * margin + 1.0;
        if (!(n <= (double)MOST_NODES))
            return apsm_fail(ctx, APSM_ERR_ARG,
                             "distance field: voxel %g is too small for a shape %g long; at most "
                             "%d voxels fit along an axis",
                             field->voxel, hi[c] - lo[c], MOST_NODES);
        field->n[c] = (int64_t)n;
        field->origin[c] = lo[c] - margin * field->voxel;
        field->lo[c] = lo[c];
        field->size[c] = hi[c] - lo[c];
    }
    return APSM_OK;
}

/* A brick's nodes and the first ones of its neighbours: node i + SIDE (j + SIDE k). */
enum { SIDE = BRICK + 1 };

static void gather_nodes(const apsm_field *field, uint32_t b, float v[SIDE * SIDE * SIDE])
{
    const uint64_t key = field->brick_key[b];
    const float *brick[8];
    for (int k = 0; k < 8; k++)
        brick[k] = k == 0
                       ? field->bricks[b]
                       : find_brick(field, brick_key((int64_t)(key & 0xfffff) + (k & 1),
                                                     (int64_t)(key >> 20 & 0xfffff) + (k >> 1 & 1),
                                                     (int64_t)(key >> 40) + (k >> 2)));
    for (int k = 0; k < SIDE; k++)
        for (int j = 0; j < SIDE; j++) {
            const int of = 2 * (j / BRICK) + 4 * (k / BRICK);
            const int row = BRICK * (j % BRICK + BRICK * (k % BRICK));
            float *to = v + SIDE * (j + SIDE * k);
            memcpy(to, brick[of] + row, BRICK * sizeof *to);
            to[BRICK] = brick[of + 1][row];
        }
}

/* Least |D| of 2^3 cells from node v on: D is trilinear in a cell, so it is that of a node if all
 * have one sign, else 0.  NaN, beyond reach, counts as far. */
static uint8_t least_of_cells(const float *v)
{
    float least = INFINITY, most = -INFINITY;
    for (int i = 0; i < 27; i++) {
        const float d = v[i % 3 + SIDE * (i / 3 % 3 + SIDE * (i / 9))];
        least = d < least ? d : least;
        most = d > most ? d : most;
    }
    const float nearest = least > 0.0f ? least : most < 0.0f ? -most : 0.0f;
    return nearest < (float)FAR / STEPS ? (uint8_t)(nearest * STEPS) : FAR;
}

static size_t cube_count(const apsm_field *field)
{
    return (size_t)(field->cubes[0] * field->cubes[1] * field->cubes[2]);
}

/* The finest cubes that are not too many. */
static void choose_cubes(apsm_field *field)
{
    double count = INFINITY;
    for (field->cube = 0; !(count <= (double)MOST_CUBES * (double)field->brick_count);) {
        field->cube++;
        count = 1.0;
        for (int c = 0; c < 3; c++) {
            field->cubes[c] = (field->n[c] >> field->cube) + 1;
            count *= (double)field->cubes[c];
        }
    }
}

/* Those of the cells of brick b. */
static void lower_least(apsm_field *field, uint32_t b)
{
    const uint64_t key = field->brick_key[b];
    float v[SIDE * SIDE * SIDE];
    gather_nodes(field, b, v);
    for (int k = 0; k < NODES / 8; k++) {
        const int lo[3] = { 2 * (k & 3), 2 * (k >> 2 & 3), 2 * (k >> 4) };
        const int64_t x = (BRICK * (int64_t)(key & 0xfffff) + lo[0]) >> field->cube,
                      y = (BRICK * (int64_t)(key >> 20 & 0xfffff) + lo[1]) >> field->cube,
                      z = (BRICK * (int64_t)(key >> 40) + lo[2]) >> field->cube;
        if (x >= field->cubes[0] || y >= field->cubes[1] || z >= field->cubes[2]) continue;
        uint8_t *least = field->least + x + field->cubes[0] * (y + field->cubes[1] * z);
        const uint8_t here = least_of_cells(v + lo[0] + SIDE * (lo[1] + SIDE * lo[2]));
        *least = here < *least ? here : *least;
    }
}

static apsm_status make_least(apsm_field *field)
{
    choose_cubes(field);
    field->least = malloc(cube_count(field));
    if (!field->least) return APSM_ERR_MEMORY;
    memset(field->least, FAR, cube_count(field));
    for (uint32_t b = 1; b < field->brick_count; b++) lower_least(field, b);
    return APSM_OK;
}

/* The bricks of all that is within reach. */
static apsm_status fill(apsm_context *ctx, apsm_field *field, double reach)
{
    bvh_near near[LEVELS] = { 0 };
    const builder b = { ctx, field, reach, near };
    apsm_status status = APSM_OK;
    int64_t size = BRICK;
    for (int c = 0; c < 3; c++)
        while (size < field->n[c]) size *= 2;
    for (int k = 0; k < LEVELS && status == APSM_OK; k++)
        status = bvh_near_alloc(field->bvh, &near[k]);
    if (status == APSM_OK) status = descend(&b, (const int64_t[3]){ 0, 0, 0 }, size, 0);
    for (int k = 0; k < LEVELS; k++) bvh_near_free(&near[k]);
    return status;
}

static apsm_status build(apsm_context *ctx, apsm_field *field)
{
    const double reach = field->band + 1.75 * field->voxel;
    APSM_TRY(place_grid(ctx, field, reach));
    APSM_TRY(add_brick(field, UINT64_MAX));
    APSM_TRY(fill(ctx, field, reach));
    APSM_TRY(resize_bricks(field, field->brick_count));
    APSM_TRY(make_table(field));
    return make_least(field);
}

apsm_status apsm_field_build(apsm_context *ctx, const apsm_bvh *bvh, double voxel, double band,
                             apsm_field **out)
{
    *out = NULL;
    if (!(voxel > 0.0) || !(band > 0.0) || !isfinite(voxel) || !isfinite(band))
        return apsm_fail(ctx, APSM_ERR_ARG, "distance field: voxel %g and band %g must be positive",
                         voxel, band);
    apsm_field *field = calloc(1, sizeof *field);
    if (!field) return apsm_fail(ctx, APSM_ERR_MEMORY, "distance field: out of memory");
    field->bvh = bvh;
    field->voxel = voxel;
    field->per_voxel = 1.0 / voxel;
    field->band = band;
    field->open = bvh_is_open(bvh);
    const apsm_status status = build(ctx, field);
    if (status == APSM_OK) {
        *out = field;
        return APSM_OK;
    }
    apsm_field_free(field);
    if (status == APSM_ERR_MEMORY)
        return apsm_fail(ctx, status, "distance field: out of memory at voxel %g; use a larger one",
                         voxel);
    return status;
}

void field_arrays(apsm_field *field, array_list *list)
{
    arrays_add(list, &field->bricks, field->brick_count * sizeof *field->bricks);
    arrays_add(list, &field->brick_key, field->brick_count * sizeof *field->brick_key);
    arrays_add(list, &field->least, cube_count(field));
    arrays_add(list, &field->table, ((size_t)1 << field->table_bits) * sizeof *field->table);
}

void apsm_field_free(apsm_field *field)
{
    if (!field) return;
    free(field->bricks);
    free(field->brick_key);
    free(field->least);
    free(field->table);
    free(field);
}

size_t apsm_field_bytes(const apsm_field *field)
{
    const size_t brick = sizeof *field->bricks + sizeof *field->brick_key;
    return sizeof *field + field->brick_room * brick + cube_count(field) +
           ((size_t)1 << field->table_bits) * sizeof *field->table;
}

double apsm_field_voxel(const apsm_field *field)
{
    return field->voxel;
}
double apsm_field_band(const apsm_field *field)
{
    return field->band;
}

/* ---- sample --------------------------------------------------------------------------------- */

/* Cell of x and the place in it; false if x is off the grid. */
static bool find_cell(const apsm_field *field, const double x[3], int64_t cell[3], double t[3])
{
    for (int c = 0; c < 3; c++) {
        const double u = (x[c] - field->origin[c]) * field->per_voxel;
        if (!(u >= 1.0 && u < (double)(field->n[c] - 2))) return false;
        cell[c] = (int64_t)u;
        t[c] = u - (double)cell[c];
    }
    return true;
}

/* The nodes from..3-from of the stencil about the cell (0: all four, 1: the cell's own two), from
 * at most eight bricks. */
static inline void gather(const apsm_field *field, const int64_t cell[3], int from, stencil v)
{
    int64_t first[3], last[3];
    const float *brick[2][2][2];
    for (int c = 0; c < 3; c++) {
        first[c] = (cell[c] - 1 + from) / BRICK;
        last[c] = (cell[c] + 2 - from) / BRICK;
    }
    for (int64_t z = first[2]; z <= last[2]; z++)
        for (int64_t y = first[1]; y <= last[1]; y++)
            for (int64_t x = first[0]; x <= last[0]; x++)
                brick[z - first[2]][y - first[1]][x - first[0]] =
                    find_brick(field, brick_key(x, y, z));
    for (int k = from; k < 4 - from; k++)
        for (int j = from; j < 4 - from; j++) {
            const int64_t y = cell[1] - 1 + j, z = cell[2] - 1 + k;
            const float *const *row = brick[z / BRICK - first[2]][y / BRICK - first[1]];
            const int64_t at = BRICK * (y % BRICK + BRICK * (z % BRICK));
            for (int i = from; i < 4 - from; i++) {
                const int64_t x = cell[0] - 1 + i;
                v[k][j][i] = (double)row[x / BRICK - first[0]][at + x % BRICK];
            }
        }
}

static void sample_exact(const apsm_field *field, const double x[3], double *D, double N[3])
{
    apsm_closest closest;
    const double d = apsm_bvh_signed_distance(field->bvh, x, &closest);
    *D = d;
    for (int c = 0; c < 3; c++) N[c] = (x[c] - closest.x[c]) * (d < 0.0 ? -1.0 : 1.0);
    if (!(vec3_normalise(N) > 0.0)) N[2] = 1.0;
}

static inline uint32_t brick_of(const apsm_field *field, const int64_t cell[3])
{
    return brick_number(
        field, brick_key(cell[0] >> BRICK_BITS, cell[1] >> BRICK_BITS, cell[2] >> BRICK_BITS));
}

static inline size_t place_in_brick(const int64_t cell[3])
{
    const uint64_t x = (uint64_t)cell[0], y = (uint64_t)cell[1], z = (uint64_t)cell[2];
    return x % BRICK + BRICK * (y % BRICK) + BRICK * BRICK * (z % BRICK);
}

/* The 8 nodes of a cell of brick b on its upper rim, some of them other bricks'. */
static void gather_rim(const apsm_field *field, uint32_t b, const int64_t cell[3], float v[8])
{
    int64_t at[3][2], brick[3][2];
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 2; k++) {
            at[c][k] = (cell[c] + k) & (BRICK - 1);
            brick[c][k] = (cell[c] + k) >> BRICK_BITS;
        }
    for (int k = 0; k < 8; k++) {
        const int x = k & 1, y = k >> 1 & 1, z = k >> 2;
        const int rim = (x & (at[0][1] == 0)) | (y & (at[1][1] == 0)) | (z & (at[2][1] == 0));
        const uint32_t there =
            rim ? brick_number(field, brick_key(brick[0][x], brick[1][y], brick[2][z])) : b;
        v[k] = field->bricks[there][at[0][x] + BRICK * (at[1][y] + BRICK * at[2][z])];
    }
}

/* D / voxel at place t of a cell of brick b, NaN where the field does not know it. */
static inline double cell_distance(const apsm_field *field, uint32_t b, const int64_t cell[3],
                                   const double t[3])
{
    const float *v = field->bricks[b] + place_in_brick(cell);
    int64_t row = BRICK, layer = BRICK * BRICK;
    float rim[8];
    if (((cell[0] + 1) & (BRICK - 1)) == 0 || ((cell[1] + 1) & (BRICK - 1)) == 0 ||
        ((cell[2] + 1) & (BRICK - 1)) == 0) {
        gather_rim(field, b, cell, rim);
        v = rim;
        row = 2;
        layer = 4;
    }
    double p[2];
    for (int k = 0; k < 2; k++) {
        const float *q = v + layer * k;
        const double near = (1.0 - t[0]) * (double)q[0] + t[0] * (double)q[1],
                     far = (1.0 - t[0]) * (double)q[row] + t[0] * (double)q[row + 1];
        p[k] = (1.0 - t[1]) * near + t[1] * far;
    }
    return (1.0 - t[2]) * p[0] + t[2] * p[1];
}

static double stored_distance(const apsm_field *field, const double x[3])
{
    int64_t cell[3];
    double t[3];
    if (!find_cell(field, x, cell, t)) return NAN;
    return cell_distance(field, brick_of(field, cell), cell, t) * field->voxel;
}

static void sample_point(const apsm_field *field, const double x[3], double *D, double *N)
{
    int64_t cell[3];
    double t[3], d = NAN, g[3] = { 0.0, 0.0, 0.0 };
    stencil v;
    if (find_cell(field, x, cell, t)) {
        gather(field, cell, 0, v);
        interpolate(v, t, &d, g);
        d *= field->voxel;
    }
    const bool directed = vec3_normalise(g) > 0.0; /* false for NaN */
    if (isnan(d) || !directed) {
        double exact, n[3];
        sample_exact(field, x, &exact, n);
        if (isnan(d)) d = exact;
        if (!directed) memcpy(g, n, sizeof g);
    }
    if (D) *D = d;
    memcpy(N, g, sizeof g);
}

void apsm_field_sample(const apsm_field *field, size_t n, const double *X, double *D, double *N)
{
    for (size_t i = 0; i < n; i++) {
        if (N) {
            sample_point(field, X + 3 * i, D ? &D[i] : NULL, N + 3 * i);
        } else if (D) {
            D[i] = stored_distance(field, X + 3 * i);
            if (isnan(D[i])) D[i] = apsm_bvh_signed_distance(field->bvh, X + 3 * i, NULL);
        }
    }
}

/* ---- draw ----------------------------------------------------------------------------------- */

/* What all trials of a draw share, in voxels. */
typedef struct trials {
    const apsm_field *field;
    uint64_t seed;
    double from[3], step[3]; /* the mesh's box, widened by the band, in 2^21 steps an axis */
    double band;             /* of points */
    int least;               /* cubes of more hold none */
    bool beyond;             /* the field's own band is narrower: what it does not know may do */
    bool exact;              /* the field does not serve */
} trials;

static trials make_trials(const apsm_field *field, uint64_t seed, double band)
{
    const double least = STEPS * (1.0 + 1e-6) * band / field->voxel;
    trials a = { field, .seed = seed, .band = band, .least = least < 255.0 ? (int)least : 255,
                 .beyond = band > field->band };
    for (int c = 0; c < 3; c++) {
        a.from[c] = (field->lo[c] - band - field->origin[c]) / field->voxel;
        a.step[c] = 0x1p-21 * (field->size[c] + 2.0 * band) / field->voxel;
    }
    return a;
}

/* The cell of a trial and the place in it: three times 21 bits of one random number. */
static inline void find_place(const trials *a, uint64_t trial, int64_t cell[3], double t[3])
{
    uint64_t x = a->seed + trial * 0x9e3779b97f4a7c15u;
    const uint64_t bits = random_splitmix(&x), mask = ((uint64_t)1 << 21) - 1;
    for (int c = 0; c < 3; c++) {
        const double u = a->from[c] + a->step[c] * ((double)(int64_t)(bits >> 21 * c & mask) + 0.5);
        cell[c] = (int64_t)u;
        t[c] = u - (double)cell[c];
    }
}

enum { AT_ONCE = 64 };

/* Which of the trials from `first` on may lie in the band; returns their number.  *known: how many
 * lie where the field knows something. */
static size_t pick_trials(const trials *a, uint64_t first, uint64_t picked[AT_ONCE], size_t *known)
{
    const apsm_field *field = a->field;
    const int limit = a->exact && a->least < FAR ? FAR - 1 : a->least;
    const bool all = a->beyond;
    size_t n = 0, near_surface = 0;
    for (uint64_t trial = first; trial < first + AT_ONCE; trial++) {
        int64_t cell[3];
        double t[3];
        find_place(a, trial, cell, t);
        const int64_t x = cell[0] >> field->cube, y = cell[1] >> field->cube,
                      z = cell[2] >> field->cube;
        const int least = all ? 0 : field->least[x + field->cubes[0] * (y + field->cubes[1] * z)];
        picked[n] = trial;
        n += least <= limit;
        near_surface += least < FAR;
    }
    *known = near_surface;
    return n;
}

/* A place that may do. */
typedef struct candidate {
    double x[3], t[3];
    int64_t cell[3];
    uint32_t b; /* its brick, or 0 */
} candidate;

static inline void prepare(const trials *a, uint64_t trial, candidate *c)
{
    const apsm_field *field = a->field;
    int64_t cell[3];
    double t[3];
    find_place(a, trial, cell, t);
    for (int k = 0; k < 3; k++)
        c->x[k] = field->origin[k] + field->voxel * ((double)cell[k] + t[k]);
    const bool known = find_cell(field, c->x, c->cell, c->t);
    c->b = known ? brick_of(field, c->cell) : 0;
#ifdef __GNUC__
    const float *v = field->bricks[c->b];
    if (known) v += place_in_brick(c->cell);
    __builtin_prefetch(v);
    __builtin_prefetch(v + BRICK * BRICK);
#endif
}

/* Whether the place is in the band, by the field's D if that serves. */
static inline bool in_band(const trials *a, const candidate *c, double *d)
{
    *d = c->b && !a->exact ? cell_distance(a->field, c->b, c->cell, c->t) * a->field->voxel : NAN;
    if (a->exact || (a->beyond && isnan(*d)))
        *d = apsm_bvh_signed_distance(a->field->bvh, c->x, NULL);
    return fabs(*d) <= a->band;
}

static bool is_beyond(const apsm_field *field, const double x[3])
{
    apsm_closest closest;
    apsm_bvh_closest(field->bvh, x, INFINITY, &closest);
    return bvh_is_beyond(field->bvh, x, &closest);
}

/* Trials are places in space, one after the other, and those in the band are the points: a rounding
 * that lets one in or out changes that point and the last, and the order of the others.  Several
 * are under way at a time so that their memory arrives while others are looked at.  Where the
 * field's D does not come near 0 (a sheet thinner than a voxel), PATIENCE trials near the surface
 * without a point tell, and the exact D is taken. */
void apsm_field_draw(const apsm_field *field, apsm_random *rng, double band, size_t n, double *B,
                     double *D)
{
    trials a = make_trials(field, random_next(rng), band);
    uint64_t picked[AT_ONCE];
    candidate c[AT_ONCE];
    size_t found = 0, known, in_vain = 0;
    for (uint64_t first = 0; found < n; first += AT_ONCE) {
        const size_t before = found, may = pick_trials(&a, first, picked, &known);
        for (size_t k = 0; k < may; k++) prepare(&a, picked[k], &c[k]);
        for (size_t k = 0; k < may && found < n; k++) {
            double d;
            const bool in = in_band(&a, &c[k], &d) && !(field->open && is_beyond(field, c[k].x));
            memcpy(B + 3 * found, c[k].x, sizeof c[k].x);
            if (D) D[found] = d;
            found += in;
        }
        in_vain = found > before ? 0 : in_vain + known;
        a.exact = a.exact || (in_vain >= PATIENCE && !a.beyond);
    }
}
