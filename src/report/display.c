/* Reconstructions are warps of the template's mesh as in evaluate (METHOD section 9), and warps are
 * linear in the particles, so that mean and modes go the same way: y = W p. */
#include "report/display.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "apsm/surface_distance.h"
#include "groom/remesh.h"
#include "report/order.h"

/* Faces that are shown: of all shapes together about this many, which a browser draws smoothly
 * and which fit into less than 10 MB; but never so few that a shape loses its look. */
enum { FACES_TOGETHER = 450000, FACES_LEAST = 2500, FACES_MOST = 11000, MODES_MOST = 10 };

typedef struct making {
    const model_folder *m;
    display *d;
    size_t faces;
    apsm_mesh template_mesh; /* as groomed */
    apsm_warp warp;          /* of template_mesh */
    apsm_warp shown_warp;    /* of d->template_mesh */
} making;

static size_t faces_shown(size_t I)
{
    const size_t faces = FACES_TOGETHER / I;
    return faces < FACES_LEAST ? FACES_LEAST : faces > FACES_MOST ? FACES_MOST : faces;
}

/* shown <- mesh with about `faces` faces, or all of them if it has few or cannot be remeshed. */
static apsm_status reduce(apsm_context *ctx, const apsm_mesh *mesh, const apsm_bvh *bvh,
                          size_t faces, apsm_mesh *shown)
{
    apsm_remesh_options options = apsm_remesh_defaults();
    options.target_faces = faces;
    options.iterations = 3;
    options.turn = 0;
    apsm_status status = APSM_ERR_GEOMETRY;
    if (mesh->nf > faces) status = apsm_remesh(ctx, mesh, bvh, &options, shown, NULL);
    if (status == APSM_ERR_GEOMETRY) status = apsm_mesh_copy(mesh, shown);
    return status == APSM_OK ? order_mesh(shown) : status;
}

static apsm_status make_template(apsm_context *ctx, making *w)
{
    const size_t t = w->m->template_index, J = w->m->J;
    const double *P = w->m->P + t * J * 3;
    apsm_bvh *bvh = NULL;
    APSM_TRY(model_folder_mesh(ctx, w->m, t, &w->template_mesh));
    const apsm_mesh *full = &w->template_mesh;
    APSM_TRY(apsm_bvh_build_unsigned(full, &bvh));
    const apsm_status status = reduce(ctx, full, bvh, w->faces, &w->d->template_mesh);
    apsm_bvh_free(bvh);
    APSM_TRY(status);
    APSM_TRY(apsm_warp_build(ctx, APSM_PHI_R, full->nv, full->V, J, P, &w->warp));
    const apsm_mesh *shown = &w->d->template_mesh;
    return apsm_warp_build(ctx, APSM_PHI_R, shown->nv, shown->V, J, P, &w->shown_warp);
}

static apsm_status make_modes(making *w)
{
    const model_folder *m = w->m;
    display *d = w->d;
    const size_t n = 3 * d->template_mesh.nv, J3 = 3 * m->J;
    d->modes = m->model.modes < MODES_MOST ? m->model.modes : MODES_MOST;
    d->mean = malloc(n * sizeof *d->mean);
    d->mode = malloc((d->modes * n + 1) * sizeof *d->mode);
    if (!d->mean || !d->mode) return APSM_ERR_MEMORY;
    apsm_warp_apply(&w->shown_warp, m->model.mean, d->mean);
    for (size_t k = 0; k < d->modes; k++) {
        double *y = d->mode + k * n;
        apsm_warp_apply(&w->shown_warp, m->model.mode + k * J3, y);
        for (size_t x = 0; x < n; x++) y[x] *= sqrt(m->model.variance[k]);
    }
    return APSM_OK;
}

/* Distances of the shown vertices of both to the other surface at full resolution. */
static apsm_status measure(const making *w, const apsm_bvh *bvh, const apsm_mesh *warped,
                           display_shape *s)
{
    apsm_bvh *warped_bvh = NULL;
    APSM_TRY(apsm_bvh_build_unsigned(warped, &warped_bvh));
    apsm_point_distances(warped_bvh, s->mesh.nv, s->mesh.V, s->distance, NULL);
    apsm_point_distances(bvh, w->d->template_mesh.nv, s->warped, s->warped_distance, NULL);
    apsm_bvh_free(warped_bvh);
    return APSM_OK;
}

static apsm_status make_from(apsm_context *ctx, const making *w, const double *p,
                             const apsm_mesh *mesh, apsm_mesh *warped, display_shape *s)
{
    apsm_bvh *bvh = NULL;
    const size_t nv = w->d->template_mesh.nv;
    APSM_TRY(apsm_bvh_build_unsigned(mesh, &bvh));
    apsm_status status = reduce(ctx, mesh, bvh, w->faces, &s->mesh);
    if (status == APSM_OK) {
        s->distance = malloc((s->mesh.nv + 1) * sizeof *s->distance);
        s->warped = malloc((3 * nv + 1) * sizeof *s->warped);
        s->warped_distance = malloc((nv + 1) * sizeof *s->warped_distance);
        status = s->distance && s->warped && s->warped_distance ? APSM_OK : APSM_ERR_MEMORY;
    }
    if (status == APSM_OK) {
        apsm_warp_apply(&w->warp, p, warped->V);
        apsm_warp_apply(&w->shown_warp, p, s->warped);
        status = measure(w, bvh, warped, s);
    }
    apsm_bvh_free(bvh);
    return status;
}

static apsm_status make_shape(apsm_context *ctx, size_t i, int worker, void *user)
{
    (void)worker;
    const making *w = user;
    apsm_mesh mesh = { 0 }, warped = { 0 };
    apsm_status status = model_folder_mesh(ctx, w->m, i, &mesh);
    if (status == APSM_OK) status = apsm_mesh_copy(&w->template_mesh, &warped);
    if (status == APSM_OK)
        status = make_from(ctx, w, w->m->P + i * w->m->J * 3, &mesh, &warped, &w->d->shape[i]);
    apsm_mesh_free(&mesh);
    apsm_mesh_free(&warped);
    return status;
}

apsm_status display_make(apsm_context *ctx, const model_folder *m, display *d)
{
    *d = (display){ .I = m->I, .shape = calloc(m->I, sizeof *d->shape) };
    making w = { .m = m, .d = d, .faces = faces_shown(m->I) };
    apsm_status status = d->shape ? make_template(ctx, &w) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = make_modes(&w);
    if (status == APSM_OK) status = apsm_parallel_for(ctx, m->I, make_shape, &w, "report");
    apsm_mesh_free(&w.template_mesh);
    apsm_warp_free(&w.warp);
    apsm_warp_free(&w.shown_warp);
    return status;
}

void display_free(display *d)
{
    for (size_t i = 0; d->shape && i < d->I; i++) {
        display_shape *s = &d->shape[i];
        apsm_mesh_free(&s->mesh);
        free(s->distance);
        free(s->warped);
        free(s->warped_distance);
    }
    free(d->shape);
    free(d->mean);
    free(d->mode);
    apsm_mesh_free(&d->template_mesh);
    *d = (display){ 0 };
}
