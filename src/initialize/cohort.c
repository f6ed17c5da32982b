#include "initialize/cohort.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "files/stored.h"
#include "geometry/stored.h"

double apsm_expected_spacing(double area, size_t J)
{
    return sqrt(2.0 * area / (sqrt(3.0) * (double)J));
}

double apsm_dipole_length(const apsm_shape *shape, double wanted)
{
    return fmin(wanted, 0.5 * shape->half_thickness);
}

typedef struct build {
    apsm_store *store; /* NULL: shapes stay in memory */
    const apsm_cohort_input *in;
    const apsm_field_plan *fields;
    apsm_shape *shape;
} build;

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Half the way from the middle of face f straight through the shape; the first `skip` of it
 * does not count. */
static double half_thickness_at(const apsm_shape *s, uint32_t f, double skip)
{
    const apsm_surface_point p = { f, { 1.0 / 3, 1.0 / 3, 1.0 / 3 } };
    double x[3], n[3], d[3];
    uint32_t hit;
    apsm_surface_position(&s->mesh, &p, x);
    apsm_surface_normal(&s->mesh, s->VN, &p, n);
    for (int k = 0; k < 3; k++) d[k] = -n[k];
    return 0.5 * apsm_bvh_ray(s->bvh, x, d, skip, INFINITY, &hit);
}

/* 5th percentile of the half-thickness at up to 512 faces, evenly chosen. */
static double thin_half_thickness(const apsm_shape *s)
{
    enum { MOST = 512 };
    double t[MOST];
    const size_t n = s->mesh.nf < MOST ? s->mesh.nf : MOST;
    const double skip = 1e-3 * sqrt(apsm_mesh_area(&s->mesh) / (double)s->mesh.nf);
    for (size_t k = 0; k < n; k++)
        t[k] = half_thickness_at(s, (uint32_t)(k * s->mesh.nf / n), skip);
    qsort(t, n, sizeof *t, by_value);
    return t[n / 20];
}

static array_list list_arrays(apsm_shape *s)
{
    array_list arrays = { 0 };
    mesh_arrays(&s->mesh, &arrays);
    if (!s->bvh) return arrays; /* bare */
    arrays_add(&arrays, &s->VN, 3 * s->mesh.nv * sizeof *s->VN);
    topology_arrays(&s->topology, &arrays);
    bvh_arrays(s->bvh, &arrays);
    geodesic_arrays(s->geodesic, &arrays);
    if (s->field) field_arrays(s->field, &arrays);
    return arrays;
}

static apsm_status move_to_store(apsm_context *ctx, apsm_store *store, apsm_shape *s)
{
    const array_list arrays = list_arrays(s);
    const apsm_status status = store_put(ctx, store, &arrays);
    s->stored = status == APSM_OK;
    return status;
}

static bool is_of_share(const apsm_field_plan *p, size_t i)
{
    return p->shares == 0 || i % p->shares == p->share;
}

static bool wants_field(const build *b, size_t i)
{
    if (!(b->fields->voxel > 0)) return false;
    if (i == b->in->template_index) return true;
    return !b->fields->template_alone && is_of_share(b->fields, i);
}

static bool stays_bare(const build *b, size_t i)
{
    return b->fields->bare && i != b->in->template_index && !is_of_share(b->fields, i);
}

static apsm_status build_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const build *b = user;
    apsm_shape *s = &b->shape[i];
    s->name = b->in->names[i];
    APSM_TRY(apsm_mesh_copy(&b->in->meshes[i], &s->mesh));
    apsm_mesh_transform(&s->mesh, b->in->transforms + 16 * i);
    if (stays_bare(b, i)) return b->store ? move_to_store(ctx, b->store, s) : APSM_OK;
    s->VN = malloc(3 * s->mesh.nv * sizeof *s->VN);
    if (!s->VN) return APSM_ERR_MEMORY;
    apsm_mesh_vertex_normals(&s->mesh, s->VN);
    APSM_TRY(apsm_topology_build(&s->mesh, &s->topology));
    APSM_TRY(apsm_rim_build(&s->mesh, &s->topology, &s->rim));
    APSM_TRY(apsm_bvh_build(&s->mesh, &s->bvh));
    s->half_thickness = thin_half_thickness(s);
    APSM_TRY(apsm_geodesic_build(&s->mesh, &s->topology, &s->geodesic));
    const double band = apsm_dipole_length(s, b->fields->band);
    if (wants_field(b, i))
        APSM_TRY(apsm_field_build(ctx, s->bvh, b->fields->voxel, band, &s->field));
    return b->store ? move_to_store(ctx, b->store, s) : APSM_OK;
}

apsm_status apsm_cohort_build_in(apsm_context *ctx, apsm_store *store, const apsm_cohort_input *in,
                                 const apsm_field_plan *fields, apsm_cohort *cohort)
{
    *cohort = (apsm_cohort){ .I = in->I, .template_index = in->template_index };
    cohort->shape = calloc(in->I, sizeof *cohort->shape);
    if (!cohort->shape) return APSM_ERR_MEMORY;
    build b = { store, in, fields, cohort->shape };
    const apsm_status status = apsm_parallel_for(ctx, in->I, build_shape, &b, "distance fields");
    if (status != APSM_OK) apsm_cohort_free(cohort);
    return status;
}

apsm_status apsm_cohort_build(apsm_context *ctx, const apsm_cohort_input *in, double voxel,
                              double band, apsm_cohort *cohort)
{
    const apsm_field_plan fields = { .voxel = voxel, .band = band };
    return apsm_cohort_build_in(ctx, NULL, in, &fields, cohort);
}

static void free_shape(apsm_shape *s)
{
    if (s->stored) {
        const array_list arrays = list_arrays(s);
        arrays_forget(&arrays);
    }
    apsm_rim_free(&s->rim);
    apsm_field_free(s->field);
    apsm_geodesic_free(s->geodesic);
    apsm_bvh_free(s->bvh);
    apsm_topology_free(&s->topology);
    apsm_mesh_free(&s->mesh);
    free(s->VN);
}

size_t cohort_movers(const apsm_cohort *c)
{
    size_t n = 0;
    for (size_t i = 0; i < c->I; i++) n += i != c->template_index && cohort_moves(c, i);
    return n;
}

/* ---- several parts ---- */

enum { LEAST_PARTICLES = 7 }; /* one and its neighbours */

/* Whether the same subjects are in all parts, the same of them fixed, and the same the template. */
static bool fit_together(size_t n, const apsm_cohort *parts, const size_t *J)
{
    bool fit = n > 0;
    for (size_t d = 0; d < n; d++) {
        fit = fit && J[d] >= LEAST_PARTICLES && !parts[d].part && parts[d].I == parts[0].I &&
              parts[d].template_index == parts[0].template_index;
        for (size_t i = 0; fit && i < parts[0].I; i++)
            fit = cohort_moves(&parts[d], i) == cohort_moves(&parts[0], i);
    }
    return fit;
}

static apsm_status take_parts(apsm_context *ctx, size_t n, apsm_cohort *parts, const size_t *J,
                              apsm_cohort *c)
{
    if (!fit_together(n, parts, J))
        return apsm_fail(ctx, APSM_ERR_ARG,
                         "parts of a cohort need the same subjects, template and fixed subjects, "
                         "and at least %d particles each",
                         (int)LEAST_PARTICLES);
    c->I = parts[0].I;
    c->template_index = parts[0].template_index;
    c->first = calloc(n + 1, sizeof *c->first);
    c->part = calloc(n, sizeof *c->part);
    c->fixed = parts[0].fixed ? malloc((c->I + 1) * sizeof *c->fixed) : NULL;
    if (!c->first || !c->part || (parts[0].fixed && !c->fixed)) return APSM_ERR_MEMORY;
    if (c->fixed) memcpy(c->fixed, parts[0].fixed, c->I * sizeof *c->fixed);
    for (size_t d = 0; d < n; d++) {
        c->first[d + 1] = c->first[d] + J[d];
        c->part[d] = parts[d];
        parts[d] = (apsm_cohort){ 0 };
    }
    c->parts = n;
    return APSM_OK;
}

apsm_status apsm_cohort_join(apsm_context *ctx, size_t n, apsm_cohort *parts, const size_t *J,
                             apsm_cohort *cohort)
{
    *cohort = (apsm_cohort){ 0 };
    const apsm_status status = take_parts(ctx, n, parts, J, cohort);
    if (status != APSM_OK) apsm_cohort_free(cohort);
    for (size_t d = 0; d < n; d++) apsm_cohort_free(&parts[d]);
    return status;
}

void cohort_take_part(const apsm_cohort *c, size_t d, size_t J, const double *P, double *Q)
{
    const size_t from = cohort_first(c, d, J), n = cohort_first(c, d + 1, J) - from;
    for (size_t i = 0; i < c->I; i++)
        memcpy(Q + i * n * 3, P + (i * J + from) * 3, n * 3 * sizeof *P);
}

void cohort_put_part(const apsm_cohort *c, size_t d, size_t J, const double *Q, double *P)
{
    const size_t to = cohort_first(c, d, J), n = cohort_first(c, d + 1, J) - to;
    for (size_t i = 0; i < c->I; i++)
        memcpy(P + (i * J + to) * 3, Q + i * n * 3, n * 3 * sizeof *P);
}

void apsm_cohort_free(apsm_cohort *cohort)
{
    for (size_t d = 0; cohort->part && d < cohort->parts; d++) apsm_cohort_free(&cohort->part[d]);
    free(cohort->part);
    free(cohort->first);
    if (cohort->shape)
        for (size_t i = 0; i < cohort->I; i++) free_shape(&cohort->shape[i]);
    free(cohort->shape);
    free(cohort->fixed);
    free(cohort->anchors.has);
    free(cohort->anchors.x);
    for (size_t i = 0; cohort->features.value && i < cohort->features.I; i++)
        free(cohort->features.value[i]);
    free(cohort->features.value);
    apsm_obstacles_free(&cohort->obstacles);
    *cohort = (apsm_cohort){ 0 };
}

void apsm_shape_look_up(const apsm_shape *shape, size_t n, const double *P, apsm_surface_point *S,
                        double *X, double *N)
{
    for (size_t j = 0; j < n; j++) {
        apsm_closest c;
        apsm_bvh_closest(shape->bvh, P + 3 * j, INFINITY, &c);
        S[j] = c.on;
        if (X) memcpy(X + 3 * j, c.x, sizeof c.x);
        if (N) apsm_surface_normal(&shape->mesh, shape->VN, &c.on, N + 3 * j);
    }
}

void apsm_shape_find_on_rim(const apsm_shape *shape, size_t J, const double *P, bool *on)
{
    static const double near = 1e-5; /* spacings */
    memset(on, 0, J * sizeof *on);
    if (shape->rim.n == 0) return;
    const double h = near * apsm_expected_spacing(apsm_mesh_area(&shape->mesh), J);
    for (size_t j = 0; j < J; j++) {
        apsm_rim_point p;
        apsm_rim_closest(&shape->rim, P + 3 * j, &p);
        on[j] = p.distance2 < h * h;
    }
}

void apsm_shape_keep_on_rim(const apsm_shape *shape, size_t J, const bool *on, double *P,
                            apsm_surface_point *S)
{
    for (size_t j = 0; j < J && shape->rim.n > 0; j++) {
        apsm_rim_point p;
        if (!on[j]) continue;
        apsm_rim_closest(&shape->rim, P + 3 * j, &p);
        memcpy(P + 3 * j, p.x, sizeof p.x);
        if (S) S[j] = p.on;
    }
}
