/* Closest points and rays on a triangle mesh, by a tree of boxes with four children a node.
 *
 * Floats prune, doubles decide.  Boxes are a little larger than their triangles; SLACK (relative)
 * covers the rounding of the squared distance and of queries far away.  So no box is farther than
 * its triangles.  One point against the eight triangles of a leaf is one branchless expression in
 * float32: each in its own frame (bvh_tree.h) has
 *   squared distance = z^2 + least of out^2 + past^2 over the edges with out >= 0, or z^2,
 * out: how far outward of the edge in the triangle's plane, past: how far beyond its ends.  It errs
 * by less than ERROR times 1 + the query's largest coordinate: a triangle waits to be looked at in
 * double if its distance, less that, is not above the bound, and the bound is the least distance
 * met so far and that.  So the result is that of trying all triangles in double.
 *
 * Signs: Baerentzen & Aanaes, "Signed distance computation using the angle weighted
 * pseudonormal", IEEE TVCG 11, 2005.  Rays: Woop, Benthin & Wald, "Watertight ray/triangle
 * intersection", JCGT 2, 2013: no ray slips through an edge. */
#include "geometry/bvh.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "core/kernel.h"
#include "geometry/bvh_guess.h"
#include "geometry/bvh_tree.h"
#include "geometry/topology.h"
#include "geometry/triangle.h"
#include "geometry/vec3.h"

enum { STACK = 256, WAIT = 24, MOST_LEAVES = 24 };
#define SLACK (1.0 + 0x1p-19)
#define ERROR 0x1p-19f

const apsm_mesh *apsm_bvh_mesh(const apsm_bvh *bvh)
{
    return bvh->mesh;
}

const double *bvh_face_normal(const apsm_bvh *bvh, uint32_t face)
{
    return bvh->face_normal + 3 * (size_t)face;
}

/* ---- distances in the lanes of the processor ------------------------------------------------ */

/* A loop becomes lanes only if all it calls is inlined, however large. */
#if defined(__GNUC__)
#define LANE_INLINE static inline __attribute__((always_inline))
#else
#define LANE_INLINE static inline
#endif

/* How far outside the interval [0, length]. */
LANE_INLINE float past_ends(float along, float length)
{
    const float before = -along, after = along - length, past = before > after ? before : after;
    return past > 0.0f ? past : 0.0f;
}

/* Squared distance of q, in the tree's frame, to triangle i of a leaf's rows.  Near 2^-22 of the
 * coordinates exact: see the head of the file. */
LANE_INLINE float lane_distance(const float (*restrict r)[LEAF], int i, float qx, float qy,
                                float qz)
{
    const float dx = qx - r[ORIGIN][i], dy = qy - r[ORIGIN + 1][i], dz = qz - r[ORIGIN + 2][i];
    const float x = dx * r[AXIS_X][i] + dy * r[AXIS_X + 1][i] + dz * r[AXIS_X + 2][i],
                y = dx * r[AXIS_Y][i] + dy * r[AXIS_Y + 1][i] + dz * r[AXIS_Y + 2][i],
                z = dx * r[AXIS_Z][i] + dy * r[AXIS_Z + 1][i] + dz * r[AXIS_Z + 2][i];
    const float back = x - r[LENGTH][i];
    const float past0 = past_ends(x, r[LENGTH][i]), out0 = -y;
    const float past1 = past_ends(back * r[RISE_X][i] + y * r[RISE_Y][i], r[RISE_LENGTH][i]);
    const float out1 = back * r[RISE_Y][i] - y * r[RISE_X][i];
    const float past2 = past_ends(x * r[CLIMB_X][i] + y * r[CLIMB_Y][i], r[CLIMB_LENGTH][i]);
    const float out2 = y * r[CLIMB_X][i] - x * r[CLIMB_Y][i];
    const float e0 = out0 >= 0.0f ? out0 * out0 + past0 * past0 : INFINITY,
                e1 = out1 >= 0.0f ? out1 * out1 + past1 * past1 : INFINITY,
                e2 = out2 >= 0.0f ? out2 * out2 + past2 * past2 : INFINITY;
    const float e01 = e0 < e1 ? e0 : e1, e = e01 < e2 ? e01 : e2;
    return z * z + (e < INFINITY ? e : 0.0f);
}

/* Those to all triangles of a leaf; returns the least. */
LANE_INLINE float leaf_distances(const leaf *restrict l, const float q[3], float d2[restrict LEAF])
{
    float least = INFINITY;
#pragma omp simd reduction(min : least)
    for (int i = 0; i < LEAF; i++) {
        const float d = lane_distance(l->row, i, q[0], q[1], q[2]);
        d2[i] = d;
        least = d < least ? d : least;
    }
    return least;
}

/* ---- search --------------------------------------------------------------------------------- */

/* Squared distances of q to a node's four boxes. */
LANE_INLINE void box_distances(const node *restrict n, const float q[3], float d2[restrict WIDTH])
{
#pragma omp simd
    for (int k = 0; k < WIDTH; k++) {
        float sum = 0.0f;
        for (int c = 0; c < 3; c++) {
            const float below = n->lo[c][k] - q[c], above = q[c] - n->hi[c][k];
            const float outside = below > above ? below : above;
            sum += outside > 0.0f ? outside * outside : 0.0f;
        }
        d2[k] = sum;
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

typedef struct query {
    float q[3];      /* the point, in the tree's frame */
    float error;     /* of distances in that frame */
    float bound;     /* squared distance in that frame, rounded up: nothing farther matters */
    float cut;       /* the same for distances that may be too large by the error */
    double to_bound; /* distance2 * to_bound -> bound */
    double x[3];
    const double *n; /* NULL: faces of any direction */
    double min_cos;
    apsm_closest best; /* found so far; distance2 at first what is asked for */
    bool found;
    uint32_t slot;           /* of the best */
    int waiting;             /* triangles to be looked at in double */
    uint32_t wait[WAIT + 1]; /* one too many is written */
    float distance2[WAIT + 1];
} query;

LANE_INLINE void set_bound(query *s, float bound)
{
    const float way = sqrtf(bound) + s->error;
    s->bound = bound;
    s->cut = way * way;
}

static float bound_of(const query *s, double distance2)
{
    const double b = distance2 * s->to_bound + (double)FLT_MIN;
    return b < (double)FLT_MAX ? (float)b : INFINITY;
}

/* Sets all but what waits, of which there is nothing. */
static void begin_query(const apsm_bvh *bvh, const double x[3], double max_distance2, query *s)
{
    float most = 1.0f;
    for (int c = 0; c < 3; c++) {
        s->x[c] = x[c];
        s->q[c] = (float)((x[c] - bvh->centre[c]) * bvh->scale);
        most = fabsf(s->q[c]) > most ? fabsf(s->q[c]) : most;
    }
    s->to_bound = bvh->scale * bvh->scale * SLACK;
    s->n = NULL;
    s->min_cos = 0.0;
    s->found = false;
    s->slot = 0;
    s->waiting = 0;
    s->error = 2.0f * ERROR * most;
    s->best = (apsm_closest){ .distance2 = max_distance2 };
    set_bound(s, bound_of(s, max_distance2));
}

/* Asks for memory that will be needed soon. */
LANE_INLINE void fetch(const void *p)
{
#if defined(__GNUC__)
    __builtin_prefetch(p);
#else
    (void)p;
#endif
}

/* Looks at the triangles that wait.  The least distance wins; of equal ones the smallest face. */
static void decide(const apsm_bvh *bvh, query *s)
{
    for (int k = 0; k < s->waiting; k++)
        if (s->distance2[k] <= s->cut) fetch(bvh->mesh->F + 3 * (size_t)bvh->face[s->wait[k]]);
    for (int k = 0; k < s->waiting; k++) {
        if (s->distance2[k] > s->cut) continue;
        const uint32_t face = bvh->face[s->wait[k]];
        const triangle t = get_triangle(bvh->mesh, face);
        double w[3] = { 0 };
        const double d2 = closest_on_triangle(&t, s->x, w);
        if (!(d2 < s->best.distance2 ||
              (d2 == s->best.distance2 && s->found && face < s->best.on.face)))
            continue;
        s->best.distance2 = d2;
        s->best.on.face = face;
        for (int c = 0; c < 3; c++) {
            s->best.on.weight[c] = w[c];
            s->best.x[c] = w[0] * t.p[0][c] + w[1] * t.p[1][c] + w[2] * t.p[2][c];
        }
        s->slot = s->wait[k];
        s->found = true;
        const float bound = bound_of(s, d2);
        if (bound < s->bound) set_bound(s, bound);
    }
    s->waiting = 0;
}

/* Of those that wait, from number `first` on, only faces that look the right way stay. */
static void drop_averse(const apsm_bvh *bvh, query *s, int first)
{
    const int end = s->waiting;
    s->waiting = first;
    for (int k = first; k < end; k++) {
        const uint32_t slot = s->wait[k];
        const double *m = bvh_face_normal(bvh, bvh->face[slot]);
        s->wait[s->waiting] = slot;
        s->distance2[s->waiting] = s->distance2[k];
        s->waiting += vec3_dot(m, s->n) >= s->min_cos;
    }
}

LANE_INLINE void visit_leaf(const apsm_bvh *bvh, query *s, uint32_t number)
{
    float d2[LEAF], least = INFINITY;
    fetch(bvh->face + LEAF * (size_t)number);
    if (leaf_distances(&bvh->leaves[number], s->q, d2) > s->cut) return;
    if (s->waiting > WAIT - LEAF) decide(bvh, s);
    const int before = s->waiting;
    for (uint32_t i = 0; i < LEAF; i++) { /* without branches: which ones are near is chance */
        s->wait[s->waiting] = LEAF * number + i;
        s->distance2[s->waiting] = d2[i];
        s->waiting += d2[i] <= s->cut;
    }
    if (s->n) drop_averse(bvh, s, before);
    for (int k = before; k < s->waiting; k++)
        least = s->distance2[k] < least ? s->distance2[k] : least;
    const float way = sqrtf(least) + s->error, bound = way * way * (float)SLACK;
    if (bound < s->bound) set_bound(s, bound);
}

LANE_INLINE void fetch_leaf(const apsm_bvh *bvh, uint32_t number)
{
    const char *l = (const char *)&bvh->leaves[number];
    for (size_t k = 0; k < sizeof(leaf); k += 64) fetch(l + k);
}

/* Looks at the leaves that may be within the bound, which falls on the way, near boxes first.
 * begin: a leaf to look at before all, or APSM_NONE. */
APSM_KERNEL static void search(const apsm_bvh *bvh, uint32_t begin, query *s)
{
    entry stack[STACK];
    float d2[WIDTH];
    if (begin != APSM_NONE) visit_leaf(bvh, s, begin);
    box_distances(&bvh->nodes[0], s->q, d2);
    int top = push_children(&bvh->nodes[0], d2, s->bound, stack, 0);
    while (top > 0) {
        const entry e = stack[--top];
        const uint32_t ref = (uint32_t)e;
        if (entry_key(e) > s->bound) continue;
        if (ref_count(ref) > 0) {
            visit_leaf(bvh, s, ref_number(ref));
            continue;
        }
        const node *n = &bvh->nodes[ref_number(ref)];
        box_distances(n, s->q, d2);
        top = push_children(n, d2, s->bound, stack, top);
        if (top > 0 && ref_count((uint32_t)stack[top - 1]) > 0)
            fetch_leaf(bvh, ref_number((uint32_t)stack[top - 1]));
    }
}

static void finish(const apsm_bvh *bvh, query *s, apsm_closest *out)
{
    decide(bvh, s);
    *out = s->found ? s->best : (apsm_closest){ .distance2 = INFINITY };
}

void apsm_bvh_closest(const apsm_bvh *bvh, const double x[3], double max_distance2,
                      apsm_closest *out)
{
    query s;
    begin_query(bvh, x, max_distance2, &s);
    search(bvh, APSM_NONE, &s);
    finish(bvh, &s, out);
}

void apsm_bvh_closest_facing(const apsm_bvh *bvh, const double x[3], const double n[3],
                             double min_cos, double max_distance2, apsm_closest *out)
{
    query s;
    begin_query(bvh, x, max_distance2, &s);
    s.n = n;
    s.min_cos = min_cos;
    search(bvh, APSM_NONE, &s);
    finish(bvh, &s, out);
}

void bvh_closest_guess(const apsm_bvh *bvh, const double x[3], double max_distance2, uint32_t *slot,
                       apsm_closest *out)
{
    query s;
    begin_query(bvh, x, max_distance2, &s);
    search(bvh, *slot / LEAF, &s);
    finish(bvh, &s, out);
    if (s.found) *slot = s.slot;
}

/* ---- leaves near many places ---------------------------------------------------------------- */

apsm_status bvh_near_alloc(const apsm_bvh *bvh, bvh_near *near)
{
    const size_t room = (bvh->leaf_count + LEAF - 1) / LEAF * LEAF;
    *near = (bvh_near){ .room = room };
    near->leaf = malloc(room * sizeof *near->leaf);
    near->box = calloc(6 * room, sizeof *near->box);
    return near->leaf && near->box ? APSM_OK : APSM_ERR_MEMORY;
}

void bvh_near_free(bvh_near *near)
{
    free(near->leaf);
    free(near->box);
    *near = (bvh_near){ 0 };
}

/* A cube and how near to it a leaf must be, in the tree's frame, widened for rounding. */
typedef struct surrounding {
    float q[3], half, way2;
} surrounding;

static surrounding make_surrounding(const apsm_bvh *bvh, const double x[3], double half, double way)
{
    query s;
    begin_query(bvh, x, INFINITY, &s);
    const double wide = (way * bvh->scale + (double)s.error) * SLACK;
    surrounding a = { .half = (float)(half * bvh->scale * SLACK) + s.error,
                      .way2 = (float)(wide * wide * SLACK) };
    memcpy(a.q, s.q, sizeof a.q);
    return a;
}

/* Squared distance of the cube to a box between lo and hi on one axis. */
LANE_INLINE float gap2(float lo, float hi, float q, float half)
{
    const float below = lo - q, above = q - hi, gap = (below > above ? below : above) - half;
    return gap > 0.0f ? gap * gap : 0.0f;
}

void bvh_near_collect(const apsm_bvh *bvh, const double x[3], double half, double way,
                      bvh_near *near)
{
    const surrounding a = make_surrounding(bvh, x, half, way);
    uint32_t stack[STACK];
    int top = 1;
    stack[0] = 0;
    near->n = 0;
    while (top > 0) {
        const node *n = &bvh->nodes[stack[--top]];
        for (int k = 0; k < n->children; k++) {
            float d2 = 0.0f;
            for (int c = 0; c < 3; c++) d2 += gap2(n->lo[c][k], n->hi[c][k], a.q[c], a.half);
            if (d2 > a.way2) continue;
            if (ref_count(n->ref[k]) == 0) {
                stack[top++] = ref_number(n->ref[k]);
                continue;
            }
            for (size_t c = 0; c < 3; c++) {
                near->box[c * near->room + near->n] = n->lo[c][k];
                near->box[(c + 3) * near->room + near->n] = n->hi[c][k];
            }
            near->leaf[near->n++] = ref_number(n->ref[k]);
        }
    }
}

/* Squared distances of the cube to the boxes of a list from number i on. */
LANE_INLINE void list_distances(const bvh_near *near, size_t i, const float q[3], float half,
                                float d2[restrict LEAF])
{
    const float *restrict box = near->box + i;
    const size_t room = near->room;
#pragma omp simd
    for (int k = 0; k < LEAF; k++)
        d2[k] = gap2(box[k], box[3 * room + (size_t)k], q[0], half) +
                gap2(box[room + (size_t)k], box[4 * room + (size_t)k], q[1], half) +
                gap2(box[2 * room + (size_t)k], box[5 * room + (size_t)k], q[2], half);
}

APSM_KERNEL void bvh_near_choose(const apsm_bvh *bvh, const bvh_near *from, const double x[3],
                                 double half, double way, bvh_near *near)
{
    const surrounding a = make_surrounding(bvh, x, half, way);
    size_t n = 0;
    for (size_t i = 0; i < from->n; i += LEAF) {
        float d2[LEAF];
        const size_t end = from->n - i < LEAF ? from->n - i : LEAF;
        list_distances(from, i, a.q, a.half, d2);
        for (size_t k = 0; k < end; k++) { /* without branches: n stays behind i + k */
            for (size_t c = 0; c < 6; c++)
                near->box[c * near->room + n] = from->box[c * from->room + i + k];
            near->leaf[n] = from->leaf[i + k];
            n += d2[k] <= a.way2;
        }
    }
    near->n = n;
}

APSM_KERNEL static void search_list(const apsm_bvh *bvh, const bvh_near *near, uint32_t begin,
                                    query *s)
{
    visit_leaf(bvh, s, begin);
    for (size_t i = 0; i < near->n; i += LEAF) {
        float d2[LEAF];
        const size_t end = near->n - i < LEAF ? near->n - i : LEAF;
        list_distances(near, i, s->q, 0.0f, d2);
        for (size_t k = 0; k < end; k++)
            if (d2[k] <= s->bound && near->leaf[i + k] != begin)
                visit_leaf(bvh, s, near->leaf[i + k]);
    }
}

void bvh_near_closest(const apsm_bvh *bvh, const bvh_near *near, const double x[3],
                      double max_distance2, uint32_t *slot, apsm_closest *out)
{
    query s;
    begin_query(bvh, x, max_distance2, &s);
    search_list(bvh, near, *slot / LEAF, &s);
    finish(bvh, &s, out);
    if (s.found) *slot = s.slot;
}

/* The points of a query a lane. */
typedef struct lanes {
    float q[3][LEAF], least[LEAF], cut[LEAF];
} lanes;

/* d2[t]: squared distances of the points to triangle t of the leaf; a->least falls. */
LANE_INLINE void lanes_to_leaf(const leaf *restrict l, lanes *restrict a,
                               float d2[restrict LEAF][LEAF])
{
    for (int t = 0; t < LEAF; t++)
#pragma omp simd
        for (int k = 0; k < LEAF; k++) {
            const float d = lane_distance(l->row, t, a->q[0][k], a->q[1][k], a->q[2][k]);
            d2[t][k] = d;
            a->least[k] = d < a->least[k] ? d : a->least[k];
        }
}

/* What is near enough to a point, of triangle `slot`, waits for it. */
static void let_wait(const apsm_bvh *bvh, uint32_t slot, const float d2[LEAF], query s[LEAF])
{
    for (int k = 0; k < LEAF; k++) {
        if (!(d2[k] <= s[k].cut)) continue;
        if (s[k].waiting == WAIT) decide(bvh, &s[k]);
        s[k].wait[s[k].waiting] = slot;
        s[k].distance2[s[k].waiting++] = d2[k];
    }
}

/* Every point against every triangle of `count` leaves. */
APSM_KERNEL static void try_all(const apsm_bvh *bvh, const uint32_t *list, size_t count,
                                query s[LEAF])
{
    float d2[LEAF * MOST_LEAVES][LEAF];
    lanes a;
    for (int k = 0; k < LEAF; k++) {
        for (int c = 0; c < 3; c++) a.q[c][k] = s[k].q[c];
        a.least[k] = INFINITY;
    }
    for (size_t i = 0; i < count; i++) lanes_to_leaf(&bvh->leaves[list[i]], &a, d2 + LEAF * i);
    for (int k = 0; k < LEAF; k++) {
        const float way = sqrtf(a.least[k]) + s[k].error, bound = way * way * (float)SLACK;
        if (bound < s[k].bound) set_bound(&s[k], bound);
        a.cut[k] = s[k].cut;
    }
    for (size_t t = 0; t < LEAF * count; t++) {
        int near = 0;
#pragma omp simd reduction(| : near)
        for (int k = 0; k < LEAF; k++) near |= d2[t][k] <= a.cut[k];
        if (near) let_wait(bvh, LEAF * list[t / LEAF] + (uint32_t)(t % LEAF), d2[t], s);
    }
}

void bvh_near_closest_of(const apsm_bvh *bvh, const bvh_near *near, const double x[BVH_AT_ONCE][3],
                         double max_distance2, uint32_t *slot, apsm_closest out[BVH_AT_ONCE])
{
    query s[BVH_AT_ONCE];
    for (int k = 0; k < BVH_AT_ONCE && near->n > MOST_LEAVES; k++)
        bvh_near_closest(bvh, near, x[k], max_distance2, slot, &out[k]);
    if (near->n > MOST_LEAVES) return;
    for (int k = 0; k < BVH_AT_ONCE; k++) begin_query(bvh, x[k], max_distance2, &s[k]);
    try_all(bvh, near->leaf, near->n, s);
    for (int k = 0; k < BVH_AT_ONCE; k++) finish(bvh, &s[k], &out[k]);
}

/* ---- sign ----------------------------------------------------------------------------------- */

/* Pseudo-normal (any length) of the vertex, edge or face interior the point lies on. */
static void pseudo_normal(const apsm_bvh *bvh, const apsm_surface_point *p, double n[3])
{
    const size_t f = p->face;
    int last, other;
    const int corners = count_corners(p->weight, &last, &other);
    if (corners == 1) {
        const size_t v = bvh->mesh->F[3 * f + (size_t)last];
        memcpy(n, bvh->vertex_normal + 3 * v, 3 * sizeof *n);
        return;
    }
    memcpy(n, bvh->face_normal + 3 * f, 3 * sizeof *n);
    if (corners == 3) return;
    const uint32_t twin = bvh->twin[3 * f + (size_t)((other + 1) % 3)]; /* the edge facing it */
    if (twin != APSM_NONE) vec3_add_scaled(n, 1.0, bvh->face_normal + 3 * (size_t)(twin / 3));
}

double bvh_sign(const apsm_bvh *bvh, const double x[3], const apsm_closest *closest)
{
    double n[3], d[3];
    pseudo_normal(bvh, &closest->on, n);
    vec3_sub(x, closest->x, d);
    return vec3_dot(d, n) < 0.0 ? -1.0 : 1.0;
}

bool bvh_is_open(const apsm_bvh *bvh)
{
    for (size_t h = 0; h < 3 * bvh->mesh->nf; h++)
        if (bvh->twin[h] == APSM_NONE) return true;
    return false;
}

bool bvh_is_beyond(const apsm_bvh *bvh, const double x[3], const apsm_closest *closest)
{
    double n[3], d[3];
    pseudo_normal(bvh, &closest->on, n);
    vec3_sub(x, closest->x, d);
    const double along = vec3_dot(d, n);
    return along * along < 0.5 * vec3_dot(d, d) * vec3_dot(n, n);
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
static void hit_triangle(ray *r, const double p[3][3], uint32_t f)
{
    double a[3], b[3], c[3];
    shear_corner(r, p[0], a);
    shear_corner(r, p[1], b);
    shear_corner(r, p[2], c);
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
            const uint32_t f = bvh->face[LEAF * ref_number(ref) + i];
            double p[3][3];
            get_corners(bvh->mesh, f, p);
            hit_triangle(&r, (const double(*)[3])p, f);
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
