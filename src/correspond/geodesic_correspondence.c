/* One pass of Algorithm 1 on one shape.  docs/method.md, "Geodesic correspondence (Algorithm 1)";
 * order and walks: alg1.json.
 *
 * The literal walk (all the way to the farthest missing neighbour, F = 1.5) is destructive from a
 * poor start: particles land on each other and mismatches triple.  Walking to the mean of the
 * targets, F = 2.0, and refusing moves that do not help keep it from that.
 *
 * Gauss-Seidel: each particle sees the others where they now are.  What its move changes --
 * closest[k] of the particles near the old and the new place -- is renewed at once; rows are
 * renewed at the end, and only those that a move can have touched.
 *
 * Most particles of a matched cohort need no search (surely_matched): the distance in space bounds
 * the closest's from below, and a section of the surface that of a neighbour from above. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "correspond/neighbourhood_row.h"
#include "geometry/face.h"

static const double report_factor[2] = { 1.5, 2.0 };

struct apsm_walk_work {
    size_t J;
    apsm_neighbourhoods now, next;
    neighbourhood_row row;
    uint32_t *count, *order, *missing; /* J each */
    bool *touched;                     /* J: row must be renewed */
};

apsm_walk_options apsm_walk_defaults(double h)
{
    return (apsm_walk_options){ .h = h, .strict = true, APSM_OPTION_DEFAULTS(APSM_WALK_OPTIONS) };
}

apsm_status apsm_walk_work_new(size_t J, apsm_walk_work **out)
{
    *out = NULL;
    apsm_walk_work *s = calloc(1, sizeof *s);
    if (!s) return APSM_ERR_MEMORY;
    s->J = J;
    s->row.index = malloc((J + 1) * sizeof *s->row.index);
    s->row.distance = malloc((J + 1) * sizeof *s->row.distance);
    s->count = malloc((J + 1) * sizeof *s->count);
    s->order = malloc((J + 1) * sizeof *s->order);
    s->missing = malloc((J + 1) * sizeof *s->missing);
    s->touched = malloc((J + 1) * sizeof *s->touched);
    if (!s->row.index || !s->row.distance || !s->count || !s->order || !s->missing || !s->touched) {
        apsm_walk_work_free(s);
        return APSM_ERR_MEMORY;
    }
    *out = s;
    return APSM_OK;
}

void apsm_walk_work_free(apsm_walk_work *s)
{
    if (!s) return;
    apsm_neighbourhoods_free(&s->now);
    apsm_neighbourhoods_free(&s->next);
    free(s->row.index);
    free(s->row.distance);
    free(s->count);
    free(s->order);
    free(s->missing);
    free(s->touched);
    free(s);
}

/* Everything a pass works on. */
typedef struct pass {
    const apsm_geodesic *g;
    apsm_geodesic_work *w;
    const apsm_bvh *bvh;
    size_t J;
    const apsm_neighbourhoods *reference;
    const apsm_walk_options *o;
    double factor; /* how far rows reach */
    apsm_surface_point *points;
    double *P;
    apsm_walk_work *s;
} pass;

static apsm_status search(pass *a, uint32_t j)
{
    return neighbourhood_search(a->g, a->w, a->J, a->points, a->P, j, a->factor, &a->s->row);
}

/* Whether j is seen to miss nothing without a search. */
static bool surely_matched(pass *a, uint32_t j)
{
    const double factor = fmin(a->o->geodesic_factor, report_factor[1]);
    return neighbourhood_by_sections(a->g, a->J, a->points, a->P, a->reference, j, factor,
                                     &a->s->row);
}

static apsm_status make_row(pass *a, uint32_t j)
{
    return !a->o->strict && surely_matched(a, j) ? APSM_OK : search(a, j);
}

static apsm_status make_rows(pass *a, apsm_neighbourhoods *rows)
{
    APSM_TRY(apsm_neighbourhoods_resize(rows, a->J));
    rows->factor = a->factor;
    for (uint32_t j = 0; j < a->J; j++) {
        APSM_TRY(make_row(a, j));
        APSM_TRY(neighbourhoods_append(rows, j, &a->s->row));
    }
    return APSM_OK;
}

static void copy_row(apsm_walk_work *s, uint32_t j)
{
    const size_t at = s->now.start[j];
    s->row.n = s->now.start[j + 1] - at;
    memcpy(s->row.index, s->now.index + at, s->row.n * sizeof *s->row.index);
    memcpy(s->row.distance, s->now.distance + at, s->row.n * sizeof *s->row.distance);
    s->row.closest = s->now.closest[j];
    s->row.nearest = s->now.nearest[j];
}

/* Reference neighbours of j that its present row lacks; leaves them in s->missing. */
static apsm_status missing_now(pass *a, uint32_t j, size_t *n)
{
    const apsm_neighbourhoods *reference = a->reference;
    if (a->s->touched[j] ||
        a->o->geodesic_target == APSM_TARGET_FARTHEST) /* keep_farthest goes on from this search */
        APSM_TRY(search(a, j));
    else
        copy_row(a->s, j);
    const neighbourhood_row *row = &a->s->row;
    const double most = a->o->geodesic_factor * row->closest;
    *n = 0;
    size_t r = 0;
    for (size_t i = reference->start[j]; i < reference->start[j + 1]; i++) {
        const uint32_t k = reference->index[i];
        while (r < row->n && row->index[r] < k) r++;
        const bool there = r < row->n && row->index[r] == k && row->distance[r] <= most;
        if (!there) a->s->missing[(*n)++] = k;
    }
    return APSM_OK;
}

/* Of the missing neighbours the farthest from j (ties: lowest index); the search from j is in w. */
static size_t keep_farthest(pass *a, size_t n)
{
    double farthest = -1.0;
    uint32_t best = 0;
    for (size_t i = 0; i < n; i++) {
        const double d = apsm_geodesic_reach(a->g, a->w, a->points + a->s->missing[i]);
        if (!(d < INFINITY) || !(d > farthest)) continue;
        farthest = d;
        best = a->s->missing[i];
    }
    a->s->missing[0] = best;
    return farthest >= 0.0;
}

/* Where j gets to on its way to k.  false: k cannot be reached. */
static apsm_status target(pass *a, uint32_t j, uint32_t k, apsm_surface_point *to, bool *reached)
{
    const double keep = a->s->now.closest[k];
    APSM_TRY(apsm_geodesic_from(a->g, a->points + k, keep, a->w));
    const double d = apsm_geodesic_reach(a->g, a->w, a->points + j);
    *reached = d < INFINITY;
    if (!*reached) return APSM_OK;
    return apsm_geodesic_walk(a->g, a->w, a->points + j,
                              d - a->o->geodesic_walk * fmax(d - keep, 0.0), to);
}

/* The mean of targets, x, goes to the surface's closest point on the side where they are (n: the
 * sum of their normals): over a thin sheet the closest point at all may be on the other. */
static void to_surface(const apsm_bvh *bvh, double n[3], double x[3], apsm_surface_point *to)
{
    apsm_closest c = { .distance2 = INFINITY };
    if (vec3_normalise(n) > 0.0) apsm_bvh_closest_facing(bvh, x, n, 0.0, INFINITY, &c);
    if (!(c.distance2 < INFINITY)) apsm_bvh_closest(bvh, x, INFINITY, &c);
    *to = c.on;
    memcpy(x, c.x, sizeof c.x);
}

/* The place that the n missing neighbours ask j to take. */
static apsm_status destination(pass *a, uint32_t j, size_t n, apsm_surface_point *to, double x[3],
                               size_t *asked)
{
    const apsm_mesh *mesh = apsm_geodesic_mesh(a->g);
    double sum[3] = { 0 }, normal[3] = { 0 }, m[3];
    *asked = 0;
    for (size_t i = 0; i < n; i++) {
        bool reached;
        APSM_TRY(target(a, j, a->s->missing[i], to, &reached));
        if (!reached) continue;
        apsm_surface_position(mesh, to, x);
        vec3_add_scaled(sum, 1.0, x);
        face_normal(mesh, to->face, m);
        vec3_add_scaled(normal, 1.0, m);
        ++*asked;
    }
    if (*asked < 2) return APSM_OK;
    for (int c = 0; c < 3; c++) x[c] = sum[c] / (double)*asked;
    to_surface(a->bvh, normal, x, to);
    return APSM_OK;
}

static double largest_reference_distance2(const pass *a, uint32_t j, const double x[3])
{
    const apsm_neighbourhoods *r = a->reference;
    double most = 0.0;
    for (size_t i = r->start[j]; i < r->start[j + 1]; i++)
        most = fmax(most, vec3_distance2(x, a->P + 3 * (size_t)r->index[i]));
    return most;
}

/* Among those that look as the face of x does: the sides of a sheet do not crowd each other. */
static double nearest_other2(const pass *a, uint32_t j, const apsm_surface_point *at,
                             const double x[3])
{
    const apsm_mesh *mesh = apsm_geodesic_mesh(a->g);
    double least = INFINITY, n[3], m[3];
    face_normal(mesh, at->face, n);
    for (size_t k = 0; k < a->J; k++) {
        const double d2 = vec3_distance2(x, a->P + 3 * k);
        if (k == j || !(d2 < least)) continue;
        face_normal(mesh, a->points[k].face, m);
        if (vec3_dot(n, m) >= 0.0) least = d2;
    }
    return least;
}

/* The guard: the reference neighbours are not left farther behind, and nobody is crowded, unless
 * j was in a worse crowd before. */
static bool acceptable(const pass *a, uint32_t j, const apsm_surface_point *to, const double x[3])
{
    const double *old = a->P + 3 * (size_t)j, limit = a->o->min_separation * a->o->h;
    if (largest_reference_distance2(a, j, x) > largest_reference_distance2(a, j, old)) return false;
    return nearest_other2(a, j, to, x) >=
           fmin(limit * limit, nearest_other2(a, j, a->points + j, old));
}

/* Marks the rows that a particle at x may belong to. */
static void touch(pass *a, const double x[3])
{
    const double *closest = a->s->now.closest;
    for (size_t k = 0; k < a->J; k++) {
        const double reach = a->factor * closest[k];
        if (!(vec3_distance2(x, a->P + 3 * k) > reach * reach)) a->s->touched[k] = true;
    }
}

/* closest[k] after j has moved away from where it was k's nearest, or to where it is. */
static apsm_status renew_closest(pass *a, uint32_t j)
{
    apsm_neighbourhoods *now = &a->s->now;
    for (uint32_t k = 0; k < a->J; k++) {
        if (k != j && now->nearest[k] != j) continue;
        APSM_TRY(search(a, k));
        now->closest[k] = a->s->row.closest;
        now->nearest[k] = a->s->row.nearest;
    }
    double radius = 0.0;
    for (size_t k = 0; k < a->J; k++) {
        const double d2 = vec3_distance2(a->P + 3 * (size_t)j, a->P + 3 * k);
        if (d2 < now->closest[k] * now->closest[k]) radius = fmax(radius, now->closest[k]);
    }
    APSM_TRY(apsm_geodesic_from(a->g, a->points + j, radius, a->w));
    for (uint32_t k = 0; k < a->J; k++) {
        const double d2 = vec3_distance2(a->P + 3 * (size_t)j, a->P + 3 * (size_t)k);
        if (k == j || !(d2 < now->closest[k] * now->closest[k])) continue;
        const double d = apsm_geodesic_distance(a->g, a->w, a->points + k);
        if (!(d < now->closest[k])) continue;
        now->closest[k] = d;
        now->nearest[k] = j;
    }
    return APSM_OK;
}

static apsm_status move(pass *a, uint32_t j, const apsm_surface_point *to, const double x[3])
{
    touch(a, a->P + 3 * (size_t)j);
    touch(a, x);
    a->points[j] = *to;
    memcpy(a->P + 3 * (size_t)j, x, 3 * sizeof *x);
    APSM_TRY(renew_closest(a, j));
    a->s->touched[j] = true;
    touch(a, x);
    return APSM_OK;
}

static apsm_status treat(pass *a, uint32_t j, apsm_walk_report *report)
{
    apsm_surface_point to;
    double x[3];
    size_t n, asked;
    APSM_TRY(missing_now(a, j, &n));
    if (n > 0 && a->o->geodesic_target == APSM_TARGET_FARTHEST) n = keep_farthest(a, n);
    APSM_TRY(destination(a, j, n, &to, x, &asked));
    if (asked == 0) return APSM_OK;
    if (a->o->geodesic_guard && !acceptable(a, j, &to, x)) {
        report->refused++;
        return APSM_OK;
    }
    report->moved++;
    return move(a, j, &to, x);
}

/* The rows after the moves: searched anew where touched, copied where not. */
static apsm_status renew_rows(pass *a)
{
    apsm_walk_work *s = a->s;
    APSM_TRY(apsm_neighbourhoods_resize(&s->next, a->J));
    s->next.factor = a->factor;
    for (uint32_t j = 0; j < a->J; j++) {
        if (s->touched[j])
            APSM_TRY(make_row(a, j));
        else
            copy_row(s, j);
        APSM_TRY(neighbourhoods_append(&s->next, j, &s->row));
    }
    const apsm_neighbourhoods swap = s->now;
    s->now = s->next;
    s->next = swap;
    return APSM_OK;
}

static void count_both(pass *a, size_t particles[2])
{
    for (int f = a->o->strict ? 0 : 1; f < 2; f++)
        particles[f] = apsm_mismatches(a->reference, &a->s->now, report_factor[f], a->s->count);
}

apsm_status apsm_geodesic_correspondence(const apsm_walk_ground *ground, size_t J,
                                         const apsm_neighbourhoods *reference,
                                         const apsm_walk_options *options,
                                         apsm_surface_point *points, double *P, apsm_walk_work *s,
                                         apsm_walk_report *report)
{
    if (s->J < J || reference->J != J ||
        (!ground->bvh && !(options->geodesic_target == APSM_TARGET_FARTHEST)))
        return APSM_ERR_ARG;
    pass a = { ground->g,
               ground->w,
               ground->bvh,
               J,
               reference,
               options,
               fmax(options->geodesic_factor, report_factor[1]),
               points,
               P,
               s };
    *report = (apsm_walk_report){ 0 };
    APSM_TRY(make_rows(&a, &s->now));
    count_both(&a, report->before);
    apsm_mismatches(reference, &s->now, options->geodesic_factor, s->count);
    const size_t n = apsm_mismatch_order(J, s->count, s->order);
    memset(s->touched, 0, J * sizeof *s->touched);
    for (size_t i = 0; i < n; i++) APSM_TRY(treat(&a, s->order[i], report));
    if (report->moved > 0) APSM_TRY(renew_rows(&a));
    count_both(&a, report->after);
    report->in_force = apsm_mismatches(reference, &s->now, options->geodesic_factor, s->count);
    return APSM_OK;
}
