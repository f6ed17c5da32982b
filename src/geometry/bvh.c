/* Closest points and rays on a triangle mesh, by a tree of boxes with four children a node.
 *
 * Float boxes (bvh_build.c) prune, doubles decide.  Boxes are a little larger than their triangles;
 * SLACK (relative) covers the rounding of the squared distance and of queries far away.  So no box
 * is farther than its triangles, and the result is that of trying all triangles in double.
 *
 * One point against the four triangles of a leaf, or one triangle against a packet of eight points,
 * is one branchless expression in vector lanes.
 *
 * Signs: Baerentzen & Aanaes, "Signed distance computation using the angle weighted
 * pseudonormal", IEEE TVCG 11, 2005.  Rays: Woop, Benthin & Wald, "Watertight ray/triangle
 * intersection", JCGT 2, 2013: no ray slips through an edge. */
#include "apsm/bvh.h"

#include <float.h>
#include <string.h>

#include "apsm/topology.h"
#include "core/kernel.h"
#include "geometry/bvh_guess.h"
#include "geometry/bvh_tree.h"
#include "geometry/vec3.h"

enum { STACK = 256 };
#define SLACK (1.0 + 0x1p-19)

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
