/* Distances between a shape and its reconstruction.  `two_way` is the paper's metric: the
 * vertex-to-surface distances of both directions in one list.  `pull`, `push` and `disagreement`
 * are those of ShapeWorks' correspondence report (2026): a vertex of the shape stands for a third
 * of the area of its triangles, and disagreement shows on the shape what a pull alone can only show
 * on the reconstruction. */
#include "evaluate/surface_distance.h"

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "core/deal.h"
#include "core/number.h"

/* ---- summaries ---- */

enum { DIGIT_BITS = 11, DIGITS = 6, DIGIT_VALUES = 1 << DIGIT_BITS };

static size_t digit_of(double distance, int digit)
{
    uint64_t bits; /* of numbers from +0 on, in the order of the numbers */
    memcpy(&bits, &distance, sizeof bits);
    return (size_t)(bits >> (DIGIT_BITS * digit)) & (DIGIT_VALUES - 1);
}

/* The first n of order (2 n, the rest is scratch) <- the places by distance, ties by place: stably
 * by each digit, the last first. */
static void sort_by_distance(size_t n, const double *distance, size_t *order)
{
    size_t *from = order, *to = order + n;
    for (size_t k = 0; k < n; k++) order[k] = k;
    for (int digit = 0; digit < DIGITS; digit++) {
        size_t start[DIGIT_VALUES + 1] = { 0 };
        for (size_t k = 0; k < n; k++) start[digit_of(distance[k], digit) + 1]++;
        for (size_t v = 0; v < DIGIT_VALUES; v++) start[v + 1] += start[v];
        for (size_t k = 0; k < n; k++) to[start[digit_of(distance[from[k]], digit)]++] = from[k];
        size_t *t = from;
        from = to;
        to = t;
    }
}

/* order: the places of the n distances, the smallest first. */
static apsm_distance_summary summarize_sorted(size_t n, const double *distance,
                                              const double *weight, size_t *order)
{
    const double q[3] = { 0.5, 0.95, 0.99 };
    double value[3], total = 0.0, sum = 0.0, below = 0.0;
    size_t k = 0;
    for (size_t v = 0; v < n; v++) {
        total += weight ? weight[v] : 1.0;
        sum += (weight ? weight[v] : 1.0) * distance[v];
    }
    for (size_t p = 0; p < 3; p++) {
        /* k stays at the first place where the weight so far reaches the share */
        while (k + 1 < n) {
            const double w = weight ? weight[order[k]] : 1.0;
            if (below + w >= q[p] * total * (1.0 - 1e-12)) break;
            below += w;
            k++;
        }
        value[p] = distance[order[k]];
    }
    return (apsm_distance_summary){ .mean = total > 0.0 ? sum / total : 0.0,
                                    .median = value[0],
                                    .p95 = value[1],
                                    .p99 = value[2],
                                    .max = distance[order[n - 1]] };
}

void apsm_distance_summarize(size_t n, const double *distance, const double *weight, size_t *order,
                             apsm_distance_summary *summary)
{
    sort_by_distance(n, distance, order);
    *summary = summarize_sorted(n, distance, weight, order);
}

/* ---- one pair ---- */

void apsm_point_distances(const apsm_bvh *bvh, size_t n, const double *X, double *distance,
                          uint32_t *face)
{
    for (size_t v = 0; v < n; v++) {
        apsm_closest c;
        apsm_bvh_closest(bvh, X + 3 * v, INFINITY, &c);
        distance[v] = sqrt(c.distance2);
        if (face) face[v] = c.on.face;
    }
}

/* A third of the area of each triangle to each of its corners. */
static void vertex_areas(const apsm_mesh *mesh, double *area)
{
    memset(area, 0, mesh->nv * sizeof *area);
    for (size_t f = 0; f < mesh->nf; f++) {
        const uint32_t *F = mesh->F + 3 * f;
        const double *a = mesh->V + 3 * F[0], *b = mesh->V + 3 * F[1], *c = mesh->V + 3 * F[2];
        const double u[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
        const double w[3] = { c[0] - a[0], c[1] - a[1], c[2] - a[2] };
        const double x = u[1] * w[2] - u[2] * w[1], y = u[2] * w[0] - u[0] * w[2],
                     z = u[0] * w[1] - u[1] * w[0];
        for (size_t k = 0; k < 3; k++) area[F[k]] += sqrt(x * x + y * y + z * z) / 6.0;
    }
}

/* Scratch of one comparison: nr vertices of the reconstruction, ns of the shape. */
typedef struct comparison {
    double *both;                /* nr + ns: pull, then push */
    double *disagreement, *area; /* ns */
    uint32_t *face;              /* nr: triangle of the shape where a pull lands */
    size_t *order;               /* 2 (nr + ns) */
    size_t *part;                /* nr + ns: the order of some of them */
} comparison;

static void comparison_free(comparison *c)
{
    free(c->both);
    free(c->disagreement);
    free(c->area);
    free(c->face);
    free(c->order);
    free(c->part);
}

static apsm_status comparison_alloc(comparison *c, size_t nr, size_t ns)
{
    c->both = malloc((nr + ns) * sizeof *c->both);
    c->disagreement = malloc(ns * sizeof *c->disagreement);
    c->area = malloc(ns * sizeof *c->area);
    c->face = malloc(nr * sizeof *c->face);
    c->order = malloc(2 * (nr + ns) * sizeof *c->order);
    c->part = malloc((nr + ns) * sizeof *c->part);
    return c->both && c->disagreement && c->area && c->face && c->order && c->part
               ? APSM_OK
               : APSM_ERR_MEMORY;
}

/* part <- the order of the distances from first to end - 1 alone, counted from first. */
static void pick_order(const comparison *c, size_t all, size_t first, size_t end)
{
    size_t n = 0;
    for (size_t k = 0; k < all; k++)
        if (c->order[k] >= first && c->order[k] < end) c->part[n++] = c->order[k] - first;
}

static void summarize_pair(const apsm_mesh *shape, size_t nr, comparison *c,
                           apsm_surface_distance *result)
{
    const size_t ns = shape->nv;
    const double *pull = c->both, *push = c->both + nr;
    double lo[3], hi[3];
    memcpy(c->disagreement, push, ns * sizeof *push);
    for (size_t v = 0; v < nr; v++)
        for (size_t k = 0; k < 3; k++) {
            double *d = &c->disagreement[shape->F[3 * c->face[v] + k]];
            *d = fmax(*d, pull[v]);
        }
    vertex_areas(shape, c->area);
    apsm_distance_summarize(nr + ns, c->both, NULL, c->order, &result->two_way);
    pick_order(c, nr + ns, 0, nr);
    result->pull = summarize_sorted(nr, pull, NULL, c->part);
    pick_order(c, nr + ns, nr, nr + ns);
    result->push = summarize_sorted(ns, push, c->area, c->part);
    apsm_distance_summarize(ns, c->disagreement, c->area, c->order, &result->disagreement);
    apsm_mesh_bounds(shape, lo, hi);
    result->diagonal = sqrt((hi[0] - lo[0]) * (hi[0] - lo[0]) + (hi[1] - lo[1]) * (hi[1] - lo[1]) +
                            (hi[2] - lo[2]) * (hi[2] - lo[2]));
}

static void copy_fields(const comparison *c, size_t nr, size_t ns,
                        const apsm_distance_fields *fields)
{
    if (fields->pull) memcpy(fields->pull, c->both, nr * sizeof *c->both);
    if (fields->push) memcpy(fields->push, c->both + nr, ns * sizeof *c->both);
    if (fields->disagreement)
        memcpy(fields->disagreement, c->disagreement, ns * sizeof *c->disagreement);
}

/* Trees that are NULL are made for the time. */
static apsm_status compare(const apsm_mesh *shape, const apsm_bvh *shape_bvh,
                           const apsm_mesh *reconstruction, const apsm_bvh *reconstruction_bvh,
                           comparison *c)
{
    apsm_bvh *own = NULL, *other = NULL;
    apsm_status status = APSM_OK;
    if (!shape_bvh) status = apsm_bvh_build_unsigned(shape, &own);
    if (status == APSM_OK && !reconstruction_bvh)
        status = apsm_bvh_build_unsigned(reconstruction, &other);
    if (status == APSM_OK) {
        apsm_point_distances(shape_bvh ? shape_bvh : own, reconstruction->nv, reconstruction->V,
                             c->both, c->face);
        apsm_point_distances(reconstruction_bvh ? reconstruction_bvh : other, shape->nv, shape->V,
                             c->both + reconstruction->nv, NULL);
    }
    apsm_bvh_free(own);
    apsm_bvh_free(other);
    return status;
}

static apsm_status check_finite(apsm_context *ctx, const apsm_mesh *mesh, const char *which)
{
    for (size_t k = 0; k < 3 * mesh->nv; k++)
        if (!isfinite(mesh->V[k]))
            return apsm_fail(ctx, APSM_ERR_NONFINITE, "vertex %zu of the %s is not finite", k / 3,
                             which);
    return APSM_OK;
}

static apsm_status distance_between(apsm_context *ctx, const apsm_mesh *shape,
                                    const apsm_bvh *shape_bvh, const apsm_mesh *reconstruction,
                                    const apsm_bvh *reconstruction_bvh,
                                    const apsm_distance_fields *fields,
                                    apsm_surface_distance *result)
{
    const size_t nr = reconstruction->nv, ns = shape->nv;
    if (nr == 0 || ns == 0 || shape->nf == 0 || reconstruction->nf == 0)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY, "a surface without triangles has no distance");
    APSM_TRY(check_finite(ctx, shape, "shape"));
    APSM_TRY(check_finite(ctx, reconstruction, "reconstruction"));
    comparison c = { 0 };
    apsm_status status = comparison_alloc(&c, nr, ns);
    if (status == APSM_OK)
        status = compare(shape, shape_bvh, reconstruction, reconstruction_bvh, &c);
    if (status == APSM_OK) {
        summarize_pair(shape, nr, &c, result);
        if (fields) copy_fields(&c, nr, ns, fields);
    } else {
        apsm_fail(ctx, status, "surface distance of %zu and %zu vertices: %s", ns, nr,
                  apsm_status_text(status));
    }
    comparison_free(&c);
    return status;
}

apsm_status apsm_surface_distance_between(apsm_context *ctx, const apsm_mesh *shape,
                                          const apsm_bvh *shape_bvh,
                                          const apsm_mesh *reconstruction,
                                          const apsm_distance_fields *fields,
                                          apsm_surface_distance *result)
{
    return distance_between(ctx, shape, shape_bvh, reconstruction, NULL, fields, result);
}

/* ---- a cohort ---- */

static apsm_status get_from_array(apsm_context *ctx, size_t i, const apsm_mesh **mesh,
                                  const apsm_bvh **bvh, void *user)
{
    (void)ctx;
    *mesh = (const apsm_mesh *)user + i;
    *bvh = NULL;
    return APSM_OK;
}

apsm_mesh_source apsm_mesh_source_array(const apsm_mesh *meshes)
{
    /* get_from_array only reads */
    return (apsm_mesh_source){ .get = get_from_array, .user = (void *)(uintptr_t)meshes };
}

/* The template as a thread warps it; its tree is fitted to every warp anew. */
typedef struct warped {
    apsm_mesh mesh; /* triangles borrowed */
    apsm_bvh *bvh;
} warped;

typedef struct cohort_task {
    const apsm_warp *warp; /* of particles P; NULL: */
    const double *P;
    const double *Y; /* I x nv x 3, the vertices as they are warped */
    const apsm_mesh *template_mesh;
    const apsm_mesh_source *shape;
    apsm_surface_distance *result;
    warped *scratch; /* threads */
} cohort_task;

static apsm_status one_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    const cohort_task *t = user;
    const apsm_mesh *mesh = NULL;
    const apsm_bvh *bvh = NULL;
    warped *w = &t->scratch[worker];
    apsm_status status = t->shape->get(ctx, i, &mesh, &bvh, t->shape->user);
    if (status == APSM_OK) {
        const size_t nv = w->mesh.nv;
        if (t->warp)
            apsm_warp_apply(t->warp, t->P + i * 3 * t->warp->J, w->mesh.V);
        else
            memcpy(w->mesh.V, t->Y + i * 3 * nv, 3 * nv * sizeof *t->Y);
        apsm_bvh_refit(w->bvh);
        status = distance_between(ctx, mesh, bvh, &w->mesh, w->bvh, NULL, &t->result[i]);
        if (t->shape->release) t->shape->release(i, mesh, bvh, t->shape->user);
    }
    if (status == APSM_OK) return APSM_OK;
    return apsm_fail(ctx, status, "shape %zu: %s", i, apsm_error_text(ctx));
}

static apsm_status open_scratch(const apsm_mesh *template_mesh, size_t threads, warped *scratch)
{
    for (size_t k = 0; k < threads; k++) {
        const size_t bytes = 3 * template_mesh->nv * sizeof *template_mesh->V;
        scratch[k].mesh = *template_mesh;
        scratch[k].mesh.V = malloc(bytes);
        if (!scratch[k].mesh.V) return APSM_ERR_MEMORY;
        memcpy(scratch[k].mesh.V, template_mesh->V, bytes);
        APSM_TRY(apsm_bvh_build_unsigned(&scratch[k].mesh, &scratch[k].bvh));
    }
    return APSM_OK;
}

static void close_scratch(size_t threads, warped *scratch)
{
    for (size_t k = 0; scratch && k < threads; k++) {
        apsm_bvh_free(scratch[k].bvh);
        free(scratch[k].mesh.V);
    }
    free(scratch);
}

/* kind: for what is kept of it. */
static apsm_status measure_all(apsm_context *ctx, const char *kind, size_t I, cohort_task *t)
{
    const size_t threads = (size_t)apsm_context_threads(ctx);
    if (t->template_mesh->nf == 0)
        return apsm_fail(ctx, APSM_ERR_GEOMETRY, "a surface without triangles has no distance");
    t->scratch = calloc(threads, sizeof *t->scratch);
    apsm_status status =
        t->scratch ? open_scratch(t->template_mesh, threads, t->scratch) : APSM_ERR_MEMORY;
    const apsm_shared_loop loop = { .kind = kind,
                                    .n = I,
                                    .fn = one_shape,
                                    .user = t,
                                    .stage = "surface distance",
                                    .made = { { t->result, sizeof *t->result } } };
    if (status == APSM_OK)
        status = apsm_shared_for(ctx, &loop);
    else
        apsm_fail(ctx, status, "surface distances: %s", apsm_status_text(status));
    close_scratch(threads, t->scratch);
    return status;
}

apsm_status apsm_surface_distances(apsm_context *ctx, const apsm_warp *warp,
                                   const apsm_mesh *template_mesh, size_t I, const double *P,
                                   const apsm_mesh_source *shape, apsm_surface_distance *result)
{
    if (warp->nv != template_mesh->nv)
        return apsm_fail(ctx, APSM_ERR_ARG, "the warp has %zu vertices, the template's mesh %zu",
                         warp->nv, template_mesh->nv);
    cohort_task t = {
        .warp = warp, .P = P, .template_mesh = template_mesh, .shape = shape, .result = result
    };
    return measure_all(ctx, "surface", I, &t);
}

/* Aggregate of the summary that lies `offset` bytes into apsm_surface_distance; shape `skip` is
 * left out. */
static apsm_surface_aggregate aggregate(size_t I, const apsm_surface_distance *distance,
                                        size_t offset, size_t skip)
{
    apsm_surface_aggregate a = { 0 };
    size_t n = 0;
    for (size_t i = 0; i < I; i++) {
        const apsm_distance_summary *s =
            (const apsm_distance_summary *)(const void *)((const char *)&distance[i] + offset);
        if (i == skip) continue;
        a.mean += s->mean;
        a.mean_max += s->max;
        a.max = fmax(a.max, s->max);
        n++;
    }
    if (n > 0) {
        a.mean /= (double)n;
        a.mean_max /= (double)n;
    }
    return a;
}

void apsm_surface_summarize(size_t I, const apsm_surface_distance *distance, size_t template_index,
                            apsm_surface_summary *summary)
{
    *summary = (apsm_surface_summary){
        .two_way = aggregate(I, distance, offsetof(apsm_surface_distance, two_way), template_index),
        .pull = aggregate(I, distance, offsetof(apsm_surface_distance, pull), template_index),
        .push = aggregate(I, distance, offsetof(apsm_surface_distance, push), template_index),
        .disagreement =
            aggregate(I, distance, offsetof(apsm_surface_distance, disagreement), template_index),
    };
}

/* ---- other templates ---- */

/* Every stride-th shape of a cohort, from one on. */
typedef struct selection {
    const apsm_mesh_source *all;
    size_t first, stride, n, J;
    double *P;                       /* n x J x 3 */
    apsm_surface_distance *distance; /* n */
} selection;

static apsm_status get_selected(apsm_context *ctx, size_t i, const apsm_mesh **mesh,
                                const apsm_bvh **bvh, void *user)
{
    const selection *s = user;
    return s->all->get(ctx, s->first + i * s->stride, mesh, bvh, s->all->user);
}

static void release_selected(size_t i, const apsm_mesh *mesh, const apsm_bvh *bvh, void *user)
{
    const selection *s = user;
    if (s->all->release) s->all->release(s->first + i * s->stride, mesh, bvh, s->all->user);
}

/* Those of a mesh with particles p in the template's place, warped to the selected shapes. */
static apsm_status measure_by(apsm_context *ctx, const char *kind, const apsm_mesh *mesh,
                              const double *p, const apsm_mesh_source *source, selection *s)
{
    double *Y = malloc(s->n * 3 * mesh->nv * sizeof *Y);
    if (!Y) return apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for surface distances");
    apsm_status status = apsm_warp_to_shapes(ctx, mesh->nv, mesh->V, s->J, p, s->n, s->P, Y);
    cohort_task t = { .Y = Y, .template_mesh = mesh, .shape = source, .result = s->distance };
    if (status == APSM_OK) status = measure_all(ctx, kind, s->n, &t);
    free(Y);
    return status;
}

/* Shape t with particles p in the template's place: distances of the selected shapes but itself. */
static apsm_status judge_by(apsm_context *ctx, size_t t, const double *p, selection *s,
                            apsm_surface_aggregate *result)
{
    const apsm_mesh *mesh = NULL;
    const apsm_bvh *bvh = NULL;
    const apsm_mesh_source source = { get_selected, release_selected, s };
    char kind[96];
    apsm_print(kind, sizeof kind, "surface by template %zu, shapes %zu + %zu k", t, s->first,
               s->stride);
    APSM_TRY(s->all->get(ctx, t, &mesh, &bvh, s->all->user));
    const apsm_status status = measure_by(ctx, kind, mesh, p, &source, s);
    if (status == APSM_OK)
        *result = aggregate(s->n, s->distance, offsetof(apsm_surface_distance, two_way),
                            t % s->stride == s->first ? t / s->stride : SIZE_MAX);
    if (s->all->release) s->all->release(t, mesh, bvh, s->all->user);
    return status;
}

/* Templates share the cohort: the k-th judges every stride-th shape from number k on. */
static void select_shapes(size_t k, size_t I, const double *P, selection *s)
{
    const size_t D = 3 * s->J;
    s->first = k % s->stride;
    s->n = (I - s->first + s->stride - 1) / s->stride;
    for (size_t i = 0; i < s->n; i++)
        memcpy(s->P + i * D, P + (s->first + i * s->stride) * D, D * sizeof *P);
}

apsm_status apsm_other_templates(apsm_context *ctx, size_t I, size_t J, const double *P,
                                 const apsm_mesh_source *shape, size_t template_index,
                                 size_t others, apsm_surface_aggregate *mean)
{
    enum { MOST = 12 }; /* shapes a template */
    selection s = { .all = shape, .stride = (I + MOST - 1) / MOST, .J = J };
    *mean = (apsm_surface_aggregate){ 0 };
    if (others + 1 > I) others = I > 0 ? I - 1 : 0;
    if (others == 0) return APSM_OK;
    s.P = malloc(MOST * 3 * J * sizeof *s.P);
    s.distance = calloc(MOST, sizeof *s.distance);
    apsm_status status =
        s.P && s.distance ? APSM_OK
                          : apsm_fail(ctx, APSM_ERR_MEMORY, "out of memory for surface distances");
    for (size_t k = 0; status == APSM_OK && k < others; k++) {
        const size_t t = (template_index + 1 + k * (I - 1) / others) % I;
        apsm_surface_aggregate a = { 0 };
        select_shapes(k, I, P, &s);
        status = judge_by(ctx, t, P + t * 3 * J, &s, &a);
        mean->mean += a.mean / (double)others;
        mean->mean_max += a.mean_max / (double)others;
        mean->max = fmax(mean->max, a.max);
    }
    free(s.P);
    free(s.distance);
    return status;
}
