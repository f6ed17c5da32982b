/* Reconstructions are warps of the template's mesh as in evaluate (docs/method.md, "Metrics"), and
 * warps are linear in the particles, so that mean and modes go the same way: y = W p, part by part.
 */
#include "report/template_surface.h"

#include <stdlib.h>
#include <string.h>

#include "groom/remesh.h"
#include "report/order.h"

apsm_status reduce_mesh(apsm_context *ctx, const apsm_mesh *mesh, const apsm_bvh *bvh, size_t faces,
                        apsm_mesh *shown)
{
    apsm_remesh_options options = apsm_remesh_defaults();
    options.faces = (long)faces;
    options.iterations = 3;
    options.turn = 0;
    apsm_status status = APSM_ERR_GEOMETRY;
    if (mesh->nf > faces) status = apsm_remesh(ctx, mesh, bvh, &options, shown, NULL);
    if (status == APSM_ERR_GEOMETRY) status = apsm_mesh_copy(mesh, shown);
    APSM_TRY(status);
    status = order_mesh(shown, NULL);
    if (status != APSM_OK) apsm_mesh_free(shown);
    return status;
}

static apsm_status reduce_part(apsm_context *ctx, size_t faces, apsm_mesh *mesh)
{
    apsm_bvh *bvh = NULL;
    apsm_mesh shown = { 0 };
    APSM_TRY(apsm_bvh_build_unsigned(mesh, &bvh));
    const apsm_status status = reduce_mesh(ctx, mesh, bvh, faces, &shown);
    apsm_bvh_free(bvh);
    APSM_TRY(status);
    apsm_mesh_free(mesh);
    *mesh = shown;
    return APSM_OK;
}

/* Vertex v of the warp is its vertex old[v]. */
static apsm_status reorder(size_t nv, const uint32_t *old, apsm_warp *warp)
{
    const size_t J = warp->J;
    apsm_warp ordered = { .nv = nv, .J = J, .merged = warp->merged };
    ordered.W = malloc(nv * J * sizeof *ordered.W);
    if (!ordered.W) return APSM_ERR_MEMORY;
    for (size_t v = 0; v < nv; v++)
        memcpy(ordered.W + v * J, warp->W + old[v] * J, J * sizeof *ordered.W);
    apsm_warp_free(warp);
    *warp = ordered;
    return APSM_OK;
}

/* All vertices, in the order in which they pack well. */
static apsm_status order_part(apsm_mesh *mesh, apsm_warp *warp)
{
    uint32_t *old = malloc((mesh->nv + 1) * sizeof *old);
    apsm_status status = old ? order_mesh(mesh, old) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = reorder(mesh->nv, old, warp);
    free(old);
    return status;
}

static apsm_status make_part(apsm_context *ctx, size_t d, size_t faces, template_surface *t)
{
    const model_folder *m = t->m;
    const model_part *part = &m->part[d];
    apsm_mesh *mesh = &t->mesh[d];
    APSM_TRY(model_folder_part_mesh(ctx, m, part->template_index, d, mesh));
    const bool whole = mesh->nf <= faces, reduced = faces > 0 && !whole;
    if (reduced) APSM_TRY(reduce_part(ctx, faces, mesh));
    const double *P = m->P + 3 * (part->template_index * m->J + part->first);
    /* Nobody else asks for that of a reduced one. */
    APSM_TRY((reduced ? apsm_warp_build : apsm_warp_share)(ctx, APSM_PHI_R, mesh->nv, mesh->V,
                                                           part->J, P, &t->warp[d]));
    if (faces > 0 && whole) APSM_TRY(order_part(mesh, &t->warp[d]));
    t->first_vertex[d + 1] = t->first_vertex[d] + mesh->nv;
    return APSM_OK;
}

apsm_status template_surface_make(apsm_context *ctx, const model_folder *m, size_t faces,
                                  template_surface *t)
{
    *t = (template_surface){ .m = m };
    t->mesh = calloc(m->parts, sizeof *t->mesh);
    t->first_vertex = calloc(m->parts + 1, sizeof *t->first_vertex);
    t->warp = calloc(m->parts, sizeof *t->warp);
    if (!t->mesh || !t->first_vertex || !t->warp) return APSM_ERR_MEMORY;
    for (size_t d = 0; d < m->parts; d++) APSM_TRY(make_part(ctx, d, faces / m->parts, t));
    return APSM_OK;
}

apsm_status template_surface_mesh(const template_surface *t, apsm_mesh *mesh)
{
    *mesh = (apsm_mesh){ 0 };
    for (size_t d = 0; d < t->m->parts; d++) APSM_TRY(apsm_mesh_append(mesh, &t->mesh[d]));
    return APSM_OK;
}

void template_surface_free(template_surface *t)
{
    for (size_t d = 0; t->m && d < t->m->parts; d++) {
        if (t->warp) apsm_warp_free(&t->warp[d]);
        if (t->mesh) apsm_mesh_free(&t->mesh[d]);
    }
    free(t->mesh);
    free(t->warp);
    free(t->first_vertex);
    *t = (template_surface){ 0 };
}

void template_surface_warp(const template_surface *t, const double *p, double *y)
{
    for (size_t d = 0; d < t->m->parts; d++)
        apsm_warp_apply(&t->warp[d], p + 3 * t->m->part[d].first, y + 3 * t->first_vertex[d]);
}
