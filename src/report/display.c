#include "report/display.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "evaluate/surface_distance.h"
#include "report/rest.h"
#include "report/template_surface.h"

/* Faces that are shown: of all shapes together about this many, which a browser draws smoothly
 * and which fit into less than 10 MB; but never so few that a shape loses its look. */
enum { FACES_TOGETHER = 450000, FACES_LEAST = 2500, FACES_MOST = 11000, MODES_MOST = 10 };

typedef struct making {
    const model_folder *m;
    display *d;
    size_t faces;
    template_surface full; /* as groomed */
    template_surface shown;
} making;

static size_t faces_shown(size_t I)
{
    const size_t faces = FACES_TOGETHER / I;
    return faces < FACES_LEAST ? FACES_LEAST : faces > FACES_MOST ? FACES_MOST : faces;
}

static apsm_status make_modes(making *w)
{
    const model_folder *m = w->m;
    display *d = w->d;
    const size_t n = 3 * d->template_mesh.nv, J3 = 3 * m->J;
    d->modes = m->model.modes < MODES_MOST ? m->model.modes : MODES_MOST;
    d->first_vertex = malloc((m->parts + 1) * sizeof *d->first_vertex);
    d->mean = malloc(n * sizeof *d->mean);
    d->mode = malloc((d->modes * n + 1) * sizeof *d->mode);
    if (!d->first_vertex || !d->mean || !d->mode) return APSM_ERR_MEMORY;
    memcpy(d->first_vertex, w->shown.first_vertex, (m->parts + 1) * sizeof *d->first_vertex);
    template_surface_warp(&w->shown, m->model.mean, d->mean);
    for (size_t k = 0; k < d->modes; k++) {
        double *y = d->mode + k * n;
        template_surface_warp(&w->shown, m->model.mode + k * J3, y);
        for (size_t x = 0; x < n; x++) y[x] *= sqrt(m->model.variance[k]);
    }
    return APSM_OK;
}

/* A part of a shape: its surface at full resolution, and the template's warped to it. */
typedef struct part_pair {
    apsm_mesh own, warped;
    apsm_bvh *own_tree, *warped_tree;
} part_pair;

static void part_pair_free(part_pair *p)
{
    apsm_bvh_free(p->own_tree);
    apsm_bvh_free(p->warped_tree);
    apsm_mesh_free(&p->own);
    apsm_mesh_free(&p->warped);
}

static apsm_status make_pair(apsm_context *ctx, const making *w, size_t i, size_t d, part_pair *p)
{
    const model_folder *m = w->m;
    APSM_TRY(model_folder_part_mesh(ctx, m, i, d, &p->own));
    APSM_TRY(apsm_mesh_copy(&w->full.mesh[d], &p->warped));
    apsm_warp_apply(&w->full.warp[d], m->P + 3 * (i * m->J + m->part[d].first), p->warped.V);
    APSM_TRY(apsm_bvh_build_unsigned(&p->own, &p->own_tree));
    return apsm_bvh_build_unsigned(&p->warped, &p->warped_tree);
}

/* Adds what is shown of part d, with the distances of its vertices from the other surface at full
 * resolution. */
static apsm_status add_part(apsm_context *ctx, const making *w, size_t d, const part_pair *p,
                            display_shape *s)
{
    apsm_mesh shown = { 0 };
    const size_t first = s->mesh.nv, *of = w->shown.first_vertex;
    APSM_TRY(reduce_mesh(ctx, &p->own, p->own_tree, w->faces / w->m->parts, &shown));
    apsm_status status = apsm_mesh_append(&s->mesh, &shown);
    apsm_mesh_free(&shown);
    APSM_TRY(status);
    s->first_vertex[d + 1] = s->mesh.nv;
    double *distance = realloc(s->distance, (s->mesh.nv + 1) * sizeof *distance);
    if (!distance) return APSM_ERR_MEMORY;
    s->distance = distance;
    apsm_point_distances(p->warped_tree, s->mesh.nv - first, s->mesh.V + 3 * first,
                         distance + first, NULL);
    apsm_point_distances(p->own_tree, of[d + 1] - of[d], s->warped + 3 * of[d],
                         s->warped_distance + of[d], NULL);
    return APSM_OK;
}

/* What constraints took away comes behind, at no distance from anything. */
static apsm_status add_rest(apsm_context *ctx, const making *w, size_t i, const apsm_bvh *own,
                            display_shape *s)
{
    apsm_mesh rest;
    const size_t first = s->mesh.nv;
    APSM_TRY(read_rest(ctx, w->m, i, own, w->faces / 3, &rest));
    const apsm_status status = apsm_mesh_append(&s->mesh, &rest);
    s->rest = rest.nv;
    apsm_mesh_free(&rest);
    APSM_TRY(status);
    double *distance = realloc(s->distance, (s->mesh.nv + 1) * sizeof *distance);
    if (!distance) return APSM_ERR_MEMORY;
    s->distance = distance;
    for (size_t v = first; v < s->mesh.nv; v++) distance[v] = 0.0;
    return APSM_OK;
}

static apsm_status make_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const making *w = user;
    const size_t nv = w->d->template_mesh.nv;
    display_shape *s = &w->d->shape[i];
    s->first_vertex = calloc(w->m->parts + 1, sizeof *s->first_vertex);
    s->warped = malloc((3 * nv + 1) * sizeof *s->warped);
    s->warped_distance = malloc((nv + 1) * sizeof *s->warped_distance);
    if (!s->first_vertex || !s->warped || !s->warped_distance) return APSM_ERR_MEMORY;
    template_surface_warp(&w->shown, w->m->P + i * w->m->J * 3, s->warped);
    apsm_status status = APSM_OK;
    for (size_t d = 0; d < w->m->parts && status == APSM_OK; d++) {
        part_pair p = { 0 };
        status = make_pair(ctx, w, i, d, &p);
        if (status == APSM_OK) status = add_part(ctx, w, d, &p, s);
        if (status == APSM_OK) status = add_rest(ctx, w, i, p.own_tree, s);
        part_pair_free(&p);
    }
    return status;
}

apsm_status display_make(apsm_context *ctx, const model_folder *m, display *d)
{
    *d = (display){ .I = m->I, .shape = calloc(m->I, sizeof *d->shape) };
    making w = { .m = m, .d = d, .faces = faces_shown(m->I) };
    apsm_status status = d->shape ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = template_surface_make(ctx, m, 0, &w.full);
    if (status == APSM_OK) status = template_surface_make(ctx, m, w.faces, &w.shown);
    if (status == APSM_OK) status = template_surface_mesh(&w.shown, &d->template_mesh);
    if (status == APSM_OK) status = make_modes(&w);
    if (status == APSM_OK) status = joint_view_make(ctx, &w.shown, MODES_MOST, &d->joint);
    if (status == APSM_OK) status = apsm_parallel_for(ctx, m->I, make_shape, &w, "report");
    template_surface_free(&w.full);
    template_surface_free(&w.shown);
    return status;
}

void display_free(display *d)
{
    for (size_t i = 0; d->shape && i < d->I; i++) {
        display_shape *s = &d->shape[i];
        apsm_mesh_free(&s->mesh);
        free(s->first_vertex);
        free(s->distance);
        free(s->warped);
        free(s->warped_distance);
    }
    free(d->shape);
    free(d->mean);
    free(d->mode);
    free(d->first_vertex);
    joint_view_free(&d->joint);
    apsm_mesh_free(&d->template_mesh);
    *d = (display){ 0 };
}
