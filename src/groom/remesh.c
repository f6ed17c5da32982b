/* Near-isotropic incremental remeshing.
 * [BK04] Botsch & Kobbelt, "A remeshing approach to multiresolution modeling", SGP 2004:
 *   split edges longer than 4/3 s, collapse edges shorter than 4/5 s, flip edges, move vertices
 *   within the surface to the middle of their neighbours, project them to the original; repeat.
 * s is the local edge length (edge_size.c).  Added to it, so that sheets, tips and creases live:
 *   - a collapse, flip or move is refused if a point of the old surface would then be farther
 *     than fidelity * s from the new faces, or if a face would turn over;
 *   - vertices only ever lie on the original surface, projected to a side that faces the same
 *     way, so that the two sides of a sheet cannot be taken for each other;
 *   - a mesh far too fine is coarsened in stages, each 1.4 times the last;
 *   - at the end, points of the original still too far from the result draw the nearest vertex
 *     to them.
 * A border's vertices lie on the original's border: edges there are split at places of it, collapse
 * only into each other and where the border hardly moves, are not flipped, and relax along it.
 * Loops run in the order of indices, so the result is reproducible. */
#include "groom/remesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/rim.h"
#include "geometry/vec3.h"
#include "groom/edge_size.h"
#include "groom/fan.h"
#include "groom/remesh_measure.h"
#include "groom/surgery.h"

static const double longest = 4.0 / 3.0, least = 4.0 / 5.0;
static const double stage_growth = 1.4;
static const double recovered_quality = 0.4;
static const double sliver = 0.35, no_area = 0.03; /* qualities, see fan.c */
static const double lenience = 3.0;                /* of fidelity for slivers */
static const double split_reach = 0.2; /* a split edge's middle is projected within this length */
static const double facing_cos = 0.2;  /* projection accepts normals within 78 degrees */
static const double corner_cos = 0.8;  /* a border that turns by more than 37 degrees: a corner */
enum { MOST_VALENCE = 10, RECOVERIES = 2 };
/* Splitting comes to two or three times the faces wanted at most, but for spikes and needles, of
 * which it could make faces without end. */
enum { MOST_BY_TARGET = 8, MOST_BY_INPUT = 2 };

apsm_remesh_options apsm_remesh_defaults(void)
{
    return (apsm_remesh_options){ APSM_OPTION_DEFAULTS(APSM_REMESH_OPTIONS) };
}

/* What the steps share. */
typedef struct job {
    surgery s;
    const apsm_bvh *original;
    const double *original_size; /* of the original's vertices */
    const apsm_rim *rim;         /* of the original */
    apsm_remesh_options opt;
    double scale;      /* of all sizes, to meet the number of faces */
    size_t most_faces; /* that splitting may come to */
} job;

static double edge_length2(const surgery *s, uint32_t h)
{
    return vec3_distance2(s->V + 3 * he_from(s, h), s->V + 3 * he_to(s, h));
}

static double edge_size_at(const job *j, uint32_t h)
{
    const double a = j->s.size[he_from(&j->s, h)], b = j->s.size[he_to(&j->s, h)];
    return j->scale * (a < b ? a : b);
}

/* Projects x, with normal n, to the original; false if nothing within reach faces the same way.
 * near: how far some point of the original is, which most often does. */
static bool project(const job *j, const double x[3], const double n[3], double near, double reach,
                    double on[3], double *size)
{
    apsm_closest hit = { .distance2 = INFINITY };
    const double within = fmin(reach, near * (1.0 + 1e-9));
    apsm_bvh_closest_facing(j->original, x, n, facing_cos, within * within, &hit);
    if (!(hit.distance2 < INFINITY) && within < reach)
        apsm_bvh_closest_facing(j->original, x, n, facing_cos, reach * reach, &hit);
    if (!(hit.distance2 < INFINITY)) return false;
    const uint32_t *c = apsm_bvh_mesh(j->original)->F + 3 * hit.on.face;
    *size = 0.0;
    for (int k = 0; k < 3; k++) *size += hit.on.weight[k] * j->original_size[c[k]];
    memcpy(on, hit.x, sizeof hit.x);
    return true;
}

/* An edge of the border is split at a place of the original's. */
static apsm_status split_border(job *j, uint32_t h)
{
    surgery *s = &j->s;
    const double *a = s->V + 3 * he_from(s, h), *b = s->V + 3 * he_to(s, h);
    const double reach = split_reach * split_reach * vec3_distance2(a, b);
    double x[3];
    apsm_rim_point on;
    for (int c = 0; c < 3; c++) x[c] = 0.5 * (a[c] + b[c]);
    apsm_rim_closest(j->rim, x, &on);
    uint32_t made;
    return surgery_split(s, h, on.distance2 < reach ? on.x : x, &made);
}

/* Splits h at its middle, put on the original if that is near. */
static apsm_status split_edge(job *j, uint32_t h)
{
    surgery *s = &j->s;
    if (he_on_border(s, h)) return split_border(j, h);
    const double *a = s->V + 3 * he_from(s, h), *b = s->V + 3 * he_to(s, h);
    const double length2 = vec3_distance2(a, b);
    double x[3], n[3], m[3], size;
    for (int c = 0; c < 3; c++) x[c] = 0.5 * (a[c] + b[c]);
    fan_face_normal(s, h, n);
    fan_face_normal(s, s->twin[h], m);
    vec3_add_scaled(n, 1.0, m);
    const bool found = vec3_normalise(n) > 0.0 &&
                       project(j, x, n, INFINITY, split_reach * sqrt(length2), m, &size);
    uint32_t made;
    APSM_TRY(surgery_split(s, h, found ? m : x, &made));
    if (found) s->size[made] = size;
    return APSM_OK;
}

/* Step 1: split long edges, the longest first so that no needles are made: edges longer than
 * 2^k times the limit for k = ..., 1, 0. */
static apsm_status split_long(job *j)
{
    surgery *s = &j->s;
    double over = 1.0; /* largest ratio of an edge to its limit */
    for (uint32_t h = 0; h < 3 * s->nf; h++)
        if (he_real(s, h))
            over = fmax(over, sqrt(edge_length2(s, h)) / (longest * edge_size_at(j, h)));
    int k;
    frexp(over, &k);
    for (; k >= 0; k--) {
        const uint32_t end = (uint32_t)(3 * s->nf); /* new edges wait for the next round */
        const double times = ldexp(longest, k);
        for (uint32_t h = 0; h < end; h++) {
            if (!he_real(s, h) || h > s->twin[h]) continue;
            const double most = times * edge_size_at(j, h);
            if (edge_length2(s, h) <= most * most) continue;
            if (s->live_f > j->most_faces) return APSM_ERR_GEOMETRY;
            APSM_TRY(split_edge(j, h));
        }
    }
    return APSM_OK;
}

/* Whether the border stays within `away` when to(h) is pulled into from(h). */
static bool border_stays(const surgery *s, uint32_t h, double away)
{
    const uint32_t a = he_from(s, h), b = he_to(s, h);
    const uint32_t out = surgery_to_ghost(s, b);
    if (out == APSM_NONE) return true;
    /* b's two neighbours on the border are beside the ghost; one of them is a */
    const uint32_t p = he_apex(s, out), q = he_apex(s, s->twin[out]), other = p == a ? q : p;
    return vec3_segment_distance2(s->V + 3 * b, s->V + 3 * a, s->V + 3 * other) <= away * away;
}

/* Whether vertex b = to(h) may be pulled into a = from(h): faces keep facing their way and do
 * not get thin, edges do not get too long, b stays close to the new faces. */
static bool may_collapse(const job *j, uint32_t h, double limit)
{
    const surgery *s = &j->s;
    const uint32_t a = he_from(s, h), b = he_to(s, h);
    const uint32_t skip1 = h / 3, skip2 = s->twin[h] / 3;
    const double *x = s->V + 3 * a;
    const double away = j->opt.fidelity * j->scale * fmin(s->size[a], s->size[b]);
    if (!surgery_pulls(s, h) || !border_stays(s, h, away)) return false;
    uint32_t k = s->out[b];
    do {
        const uint32_t v = he_to(s, k);
        if (v != a && !is_ghost(s, v)) {
            const double most = longest * fmin(limit, j->scale * fmin(s->size[a], s->size[v]));
            if (vec3_distance2(x, s->V + 3 * v) > most * most) return false;
        }
        k = he_turn(s, k);
    } while (k != s->out[b]);
    return fan_keeps_facing(s, b, x, skip1, skip2) && fan_stays(s, b, x, away, skip1, skip2);
}

/* Collapses h if it is short, preferably into the end that wants shorter edges. */
static void try_collapse(job *j, uint32_t h, double limit)
{
    surgery *s = &j->s;
    const double want = fmin(limit, edge_size_at(j, h));
    if (!(edge_length2(s, h) < least * least * want * want)) return;
    const uint32_t a = he_from(s, h), b = he_to(s, h);
    if (surgery_valence(s, a) + surgery_valence(s, b) - 4 > MOST_VALENCE) return;
    if (!surgery_collapsible(s, h)) return;
    if (s->size[b] < s->size[a]) h = s->twin[h];
    if (may_collapse(j, h, limit))
        surgery_collapse(s, h);
    else if (may_collapse(j, s->twin[h], limit))
        surgery_collapse(s, s->twin[h]);
}

/* Step 2; limit: no edge is wanted longer than this at the present stage. */
static void collapse_short(job *j, double limit)
{
    for (uint32_t h = 0; h < 3 * j->s.nf; h++)
        if (he_real(&j->s, h) && h < j->s.twin[h]) try_collapse(j, h, limit);
}

/* Whether the edge can be flipped and leave a surface. */
static bool may_turn(const surgery *s, uint32_t h)
{
    return !he_on_border(s, h) && surgery_valence(s, he_from(s, h)) > 3 &&
           surgery_valence(s, he_to(s, h)) > 3 &&
           !surgery_joined(s, he_apex(s, h), he_apex(s, s->twin[h]));
}

/* Whether the edge can be flipped without leaving the surface or folding it. */
static bool may_flip(const job *j, uint32_t h)
{
    const surgery *s = &j->s;
    const uint32_t a = he_from(s, h), b = he_to(s, h);
    const uint32_t c = he_apex(s, h), d = he_apex(s, s->twin[h]);
    if (!may_turn(s, h)) return false;
    const double away = j->opt.fidelity * j->scale *
                        fmin(fmin(s->size[a], s->size[b]), fmin(s->size[c], s->size[d]));
    return fan_flip_is_flat(s, h, away);
}

/* Difference of v's valence from what is regular: six, on a border four and its ghost. */
static int excess(const surgery *s, const uint32_t *valence, uint32_t v)
{
    return (int)valence[v] - (surgery_to_ghost(s, v) == APSM_NONE ? 6 : 5);
}

/* By how much the sum of squared excesses grows if h is flipped: its ends have a neighbour less,
 * the apexes one more. */
static int flip_growth(const surgery *s, const uint32_t *valence, uint32_t h)
{
    const int ends = excess(s, valence, he_from(s, h)) + excess(s, valence, he_to(s, h));
    const int apexes =
        excess(s, valence, he_apex(s, h)) + excess(s, valence, he_apex(s, s->twin[h]));
    return 2 * (apexes - ends) + 4;
}

static void flip_counted(surgery *s, uint32_t *valence, uint32_t h)
{
    valence[he_from(s, h)]--;
    valence[he_to(s, h)]--;
    valence[he_apex(s, h)]++;
    valence[he_apex(s, s->twin[h])]++;
    surgery_flip(s, h);
}

/* Step 3a: flips that bring valences nearer to 6 without spoiling the shapes. */
static apsm_status flip_to_valence(job *j)
{
    surgery *s = &j->s;
    uint32_t *valence = calloc(s->nv + 1, sizeof *valence);
    if (!valence) return APSM_ERR_MEMORY;
    for (uint32_t h = 0; h < 3 * s->nf; h++)
        if (he_live(s, h)) valence[he_from(s, h)]++;
    for (uint32_t h = 0; h < 3 * s->nf; h++) {
        if (!he_real(s, h) || h > s->twin[h] || he_on_border(s, h)) continue;
        if (flip_growth(s, valence, h) < 0 && fan_flip_gains(s, h, 0.6) && may_flip(j, h))
            flip_counted(s, valence, h);
    }
    free(valence);
    return APSM_OK;
}

/* Step 3b: flips that raise the smaller of the two faces' qualities. */
static void flip_to_shape(job *j)
{
    surgery *s = &j->s;
    for (uint32_t h = 0; h < 3 * s->nf; h++)
        if (he_real(s, h) && h < s->twin[h] && !he_on_border(s, h) &&
            fan_flip_gains(s, h, 1.0 + 1e-9) && may_flip(j, h))
            surgery_flip(s, h);
}

/* Moves v to x if no face turns over and the old place stays close. */
static bool try_move(job *j, uint32_t v, const double x[3], double away)
{
    surgery *s = &j->s;
    if (!fan_keeps_facing(s, v, x, APSM_NONE, APSM_NONE)) return false;
    if (!fan_stays(s, v, x, away, APSM_NONE, APSM_NONE)) return false;
    memcpy(s->V + 3 * v, x, 3 * sizeof *x);
    return true;
}

/* A border's vertex to the middle of its two neighbours there, on the original's border.  Corners
 * stay. */
static void relax_border(job *j, uint32_t v, uint32_t out)
{
    surgery *s = &j->s;
    const double *x = s->V + 3 * v, *p = s->V + 3 * he_apex(s, out),
                 *q = s->V + 3 * he_apex(s, s->twin[out]);
    double before[3], after[3], middle[3];
    vec3_sub(x, p, before);
    vec3_sub(q, x, after);
    const double turn = vec3_dot(before, after) / (vec3_norm(before) * vec3_norm(after));
    if (!(turn > corner_cos)) return;
    for (int c = 0; c < 3; c++) middle[c] = 0.5 * (p[c] + q[c]);
    const double away = j->opt.fidelity * j->scale * s->size[v];
    apsm_rim_point on;
    apsm_rim_closest(j->rim, middle, &on);
    if (vec3_segment_distance2(x, p, on.x) <= away * away ||
        vec3_segment_distance2(x, on.x, q) <= away * away)
        try_move(j, v, on.x, away);
}

/* Steps 4 and 5: every vertex to the middle of its fan, within the surface, and back on it. */
static void relax(job *j)
{
    surgery *s = &j->s;
    for (uint32_t v = 0; v < s->nv; v++) {
        if (!surgery_keeps(s, v)) continue;
        double g[3], n[3], step[3];
        const uint32_t border = surgery_to_ghost(s, v);
        if (border != APSM_NONE) {
            relax_border(j, v, border);
            continue;
        }
        if (!fan_middle(s, v, g, n)) continue;
        vec3_sub(g, s->V + 3 * v, step);
        vec3_add_scaled(step, -vec3_dot(step, n), n);
        const double local = j->scale * s->size[v];
        for (double part = 1.0; part > 0.2; part *= 0.5) { /* shorter steps where it is tight */
            double x[3], on[3], size;
            memcpy(x, s->V + 3 * v, sizeof x);
            vec3_add_scaled(x, part, step);
            if (project(j, x, n, sqrt(vec3_distance2(x, s->V + 3 * v)), local, on, &size) &&
                try_move(j, v, on, j->opt.fidelity * local)) {
                s->size[v] = size;
                break;
            }
        }
    }
}

static double mean_edge(const surgery *s)
{
    double sum = 0.0;
    size_t n = 0;
    for (uint32_t h = 0; h < 3 * s->nf; h++)
        if (he_real(s, h)) {
            sum += sqrt(edge_length2(s, h));
            n++;
        }
    return sum / (double)n;
}

/* A mesh far too fine, to about the edge length wanted. */
static void coarsen(job *j, double common)
{
    for (double limit = stage_growth * mean_edge(&j->s); limit < common; limit *= stage_growth) {
        collapse_short(j, limit);
        flip_to_shape(j);
    }
}

/* Mends the face of h if it is a sliver: collapses its shortest edge, or else flips its longest.
 * The normal of a face nearly without area says nothing, so it is not asked: a collapse then moves
 * the surface by no more than that edge, a flip by no more than the face's height. */
static void mend_sliver(job *j, uint32_t h)
{
    surgery *s = &j->s;
    const double q = fan_face_quality(s, h);
    uint32_t side[3] = { h, he_next(h), he_prev(h) }; /* the longest, then the shortest */
    for (int k = 1; k < 3; k++)
        if (edge_length2(s, side[k]) > edge_length2(s, side[0])) {
            const uint32_t t = side[0];
            side[0] = side[k];
            side[k] = t;
        }
    if (edge_length2(s, side[2]) < edge_length2(s, side[1])) side[1] = side[2];
    const bool needle = edge_length2(s, side[1]) < 0.01 * edge_length2(s, side[0]);
    const uint32_t ways[2] = { side[1], s->twin[side[1]] };
    for (int k = 0; k < 2; k++)
        if (surgery_pulls(s, ways[k]) && surgery_collapsible(s, ways[k]) &&
            ((q < no_area && needle) || may_collapse(j, ways[k], INFINITY))) {
            surgery_collapse(s, ways[k]);
            return;
        }
    if (!he_on_border(s, side[0]) && fan_flip_gains(s, side[0], 1.0 + 1e-9) &&
        (q < no_area ? may_turn(s, side[0]) : may_flip(j, side[0])))
        surgery_flip(s, side[0]);
}

/* Where surfaces meet sharply the rules above can leave slivers: these get less strict ones. */
static void mend_slivers(job *j)
{
    const double strict = j->opt.fidelity;
    j->opt.fidelity *= lenience;
    for (int round = 0; round < 3; round++)
        for (uint32_t f = 0; f < j->s.nf; f++)
            if (he_live(&j->s, 3 * f) && !he_ghost_face(&j->s, 3 * f) &&
                fan_face_quality(&j->s, 3 * f) < sliver)
                mend_sliver(j, 3 * f);
    j->opt.fidelity = strict;
}

static apsm_status iterate(apsm_context *ctx, job *j, size_t faces)
{
    for (int i = 0; i < j->opt.iterations; i++) {
        if (ctx && apsm_interrupted(ctx)) return APSM_ERR_INTERRUPTED;
        APSM_TRY(split_long(j));
        collapse_short(j, INFINITY);
        if (2 * i < j->opt.iterations) APSM_TRY(flip_to_valence(j));
        flip_to_shape(j);
        relax(j);
        /* Meet the number of faces; sizes rest in the last iterations. */
        if (i + 2 < j->opt.iterations) {
            const double off = sqrt((double)j->s.live_f / (double)faces);
            j->scale *= fmin(fmax(off, 0.7), 1.4);
        }
    }
    flip_to_shape(j);
    mend_slivers(j);
    relax(j);
    return APSM_OK;
}

/* A point of the original that the result misses. */
typedef struct missed {
    double off; /* distance in local edges */
    uint32_t vertex, face;
} missed;

static int by_size(const void *a, const void *b)
{
    const missed *p = a, *q = b;
    if (p->off != q->off) return p->off < q->off ? 1 : -1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

/* The result as it is, while vertices of it are drawn: its faces stay the same. */
typedef struct recovery {
    apsm_mesh now;
    apsm_bvh *tree;
    uint32_t *name;    /* of the result's vertices in the surgery */
    uint32_t *nearest; /* face to each vertex of the original; APSM_NONE: not known */
    bool *moved;       /* of the surgery's vertices: drawn in this round */
    missed *list;
} recovery;

/* Whether a vertex of the original, which the round before found not missed, may be so now: only if
 * the face that was nearest to it has changed. */
static bool is_open_again(const recovery *r, size_t v)
{
    if (r->nearest[v] == APSM_NONE) return true;
    const uint32_t *c = r->now.F + 3 * (size_t)r->nearest[v];
    return r->moved[r->name[c[0]]] || r->moved[r->name[c[1]]] || r->moved[r->name[c[2]]];
}

/* Fills the list (one entry for each vertex of the original at most) with what lies farther than
 * fidelity edges from the result; returns how many. */
static size_t find_missed(const job *j, recovery *r)
{
    const apsm_mesh *from = apsm_bvh_mesh(j->original);
    size_t n = 0;
    for (size_t v = 0; v < from->nv; v++) {
        apsm_closest hit;
        if (!is_open_again(r, v)) continue;
        apsm_bvh_closest(r->tree, from->V + 3 * v, INFINITY, &hit);
        const double off = sqrt(hit.distance2) / (j->scale * j->original_size[v]);
        const bool far = off > j->opt.fidelity;
        r->nearest[v] = far ? APSM_NONE : hit.on.face;
        if (far) r->list[n++] = (missed){ off, (uint32_t)v, hit.on.face };
    }
    qsort(r->list, n, sizeof *r->list, by_size);
    return n;
}

/* Draws the corner of `face` nearest to the original's vertex to it, if it has not moved already.
 * What is on the border stays there. */
static bool draw_corner(job *j, uint32_t vertex, const uint32_t corner[3], bool *moved)
{
    surgery *s = &j->s;
    const double *x = apsm_bvh_mesh(j->original)->V + 3 * (size_t)vertex;
    const bool on_border = j->rim->n && j->rim->on[vertex];
    uint32_t v = corner[0];
    for (int k = 1; k < 3; k++)
        if (vec3_distance2(x, s->V + 3 * corner[k]) < vec3_distance2(x, s->V + 3 * v))
            v = corner[k];
    if ((surgery_to_ghost(s, v) != APSM_NONE) != on_border) return false;
    if (moved[v] || fan_quality(s, v, x) < recovered_quality ||
        !try_move(j, v, x, j->opt.fidelity * j->scale * s->size[v]))
        return false;
    moved[v] = true;
    return true;
}

static void close_recovery(recovery *r)
{
    apsm_bvh_free(r->tree);
    apsm_mesh_free(&r->now);
    free(r->name);
    free(r->nearest);
    free(r->moved);
    free(r->list);
}

static apsm_status open_recovery(const job *j, recovery *r)
{
    const size_t from = apsm_bvh_mesh(j->original)->nv;
    *r = (recovery){ .name = malloc(j->s.nv * sizeof *r->name),
                     .nearest = malloc(from * sizeof *r->nearest),
                     .moved = calloc(j->s.nv, sizeof *r->moved),
                     .list = malloc(from * sizeof *r->list) };
    if (!r->name || !r->nearest || !r->moved || !r->list) return APSM_ERR_MEMORY;
    memset(r->nearest, 0xff, from * sizeof *r->nearest);
    size_t n = 0;
    for (uint32_t v = 0; v < j->s.nv; v++)
        if (surgery_keeps(&j->s, v)) r->name[n++] = v;
    APSM_TRY(surgery_result(&j->s, &r->now));
    return apsm_bvh_build_unsigned(&r->now, &r->tree);
}

/* Draws vertices to what the result misses; returns how many. */
static size_t draw_round(job *j, recovery *r)
{
    size_t drawn = 0;
    const size_t n = find_missed(j, r);
    memset(r->moved, 0, j->s.nv * sizeof *r->moved);
    for (size_t i = 0; i < n; i++) {
        const uint32_t *c = r->now.F + 3 * (size_t)r->list[i].face;
        const uint32_t corner[3] = { r->name[c[0]], r->name[c[1]], r->name[c[2]] };
        drawn += draw_corner(j, r->list[i].vertex, corner, r->moved);
    }
    return drawn;
}

static void follow(const job *j, recovery *r)
{
    for (size_t v = 0; v < r->now.nv; v++)
        memcpy(r->now.V + 3 * v, j->s.V + 3 * (size_t)r->name[v], 3 * sizeof *r->now.V);
    apsm_bvh_refit(r->tree);
}

/* Tips and creases cut off by collapses or slid from by relaxation: vertices go back to them.  No
 * relaxation may follow. */
static apsm_status recover(job *j)
{
    recovery r;
    apsm_status status = open_recovery(j, &r);
    for (int i = 0; status == APSM_OK && i < RECOVERIES; i++) {
        if (i > 0) follow(j, &r);
        if (draw_round(j, &r) == 0) break;
    }
    close_recovery(&r);
    return status;
}

/* float32 coordinates, where that turns no face over (it never does on sane coordinates). */
static void round_coordinates(job *j)
{
    surgery *s = &j->s;
    for (size_t i = 0; i < 3 * s->nv; i++) s->V[i] = (double)(float)s->V[i];
}

/* Edge lengths for the vertices of mesh, from those of the original. */
static void take_sizes(job *j, const apsm_mesh *mesh)
{
    const apsm_mesh *from = apsm_bvh_mesh(j->original);
    for (size_t v = 0; v < mesh->nv; v++) {
        if (mesh == from) {
            j->s.size[v] = j->original_size[v];
            continue;
        }
        apsm_closest hit;
        apsm_bvh_closest(j->original, mesh->V + 3 * v, INFINITY, &hit);
        j->s.size[v] = 0.0;
        for (int k = 0; k < 3; k++)
            j->s.size[v] +=
                hit.on.weight[k] * j->original_size[from->F[3 * hit.on.face + (uint32_t)k]];
    }
}

static apsm_status run(apsm_context *ctx, job *j, const apsm_mesh *mesh, size_t faces,
                       double common, apsm_mesh *out)
{
    take_sizes(j, mesh);
    j->scale = 1.0;
    coarsen(j, common);
    APSM_TRY(iterate(ctx, j, faces));
    APSM_TRY(recover(j));
    flip_to_shape(j);
    mend_slivers(j);
    round_coordinates(j);
    return surgery_result(&j->s, out);
}

/* open: whether the mesh has a border. */
static apsm_status check_mesh(apsm_context *ctx, const apsm_mesh *mesh, bool *open)
{
    apsm_mesh_defects d;
    APSM_TRY(apsm_mesh_inspect(mesh, &d));
    *open = d.border_edges > 0;
    if (d.components != 1 || d.nonmanifold_edges || d.nonmanifold_vertices || d.flipped_edges ||
        d.unused_vertices)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY,
                         "remesh: not one oriented surface; repair it first");
    return APSM_OK;
}

static apsm_status find_rim(const apsm_mesh *mesh, apsm_rim *rim)
{
    apsm_topology topology;
    APSM_TRY(apsm_topology_build(mesh, &topology));
    const apsm_status status = apsm_rim_build(mesh, &topology, rim);
    apsm_topology_free(&topology);
    return status;
}

apsm_status apsm_remesh(apsm_context *ctx, const apsm_mesh *mesh, const apsm_bvh *original,
                        const apsm_remesh_options *options, apsm_mesh *out,
                        apsm_remesh_report *report)
{
    job j = { .original = original, .opt = options ? *options : apsm_remesh_defaults() };
    const apsm_remesh_options *o = &j.opt;
    *out = (apsm_mesh){ 0 };
    if (o->faces < 4 || o->iterations < 1 || !(o->turn >= 0.0) || !(o->shortest > 0.0) ||
        !(o->shortest <= 1.0) || !(o->fidelity > 0.0))
        return apsm_fail(ctx, APSM_ERR_ARG, "remesh: an option is out of range");
    bool open;
    APSM_TRY(check_mesh(ctx, mesh, &open));
    const apsm_mesh *from = apsm_bvh_mesh(original);
    const size_t wanted = (size_t)o->faces;
    const size_t faces = !o->refine && mesh->nf < wanted ? mesh->nf : wanted;
    j.most_faces = MOST_BY_TARGET * faces + MOST_BY_INPUT * mesh->nf;
    double common, *size = malloc(from->nv * sizeof *size);
    if (!size) return APSM_ERR_MEMORY;
    j.original_size = size;
    apsm_rim rim = { 0 };
    j.rim = &rim;
    apsm_status status = open || from != mesh ? find_rim(from, &rim) : APSM_OK;
    if (status == APSM_OK) status = edge_size(from, o, faces, size, &common);
    if (status == APSM_OK) status = surgery_begin(&j.s, mesh);
    if (status == APSM_OK) {
        status = run(ctx, &j, mesh, faces, common, out);
        surgery_free(&j.s);
    }
    apsm_rim_free(&rim);
    free(size);
    if (status == APSM_OK && report) {
        report->edge = common * j.scale;
        status = remesh_measure(mesh, original, out, report);
        if (status != APSM_OK) apsm_mesh_free(out);
    }
    return status;
}
