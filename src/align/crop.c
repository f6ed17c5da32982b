/* Cuts a closed surface with planes and closes it flat: what all shapes of a cohort hold remains.
 */
#include <math.h>
#include <stdlib.h>

#include "align/common_ends.h"
#include "geometry/clip.h"
#include "geometry/vec3.h"
#include "groom/repair.h"

/* Vertices so near the plane, in edges, are on it: no slivers. */
static const double near = 0.05;

apsm_status apsm_mesh_clip(const apsm_mesh *mesh, const double plane[4], apsm_mesh *clipped)
{
    double *depth = malloc((mesh->nv + 1) * sizeof *depth);
    *clipped = (apsm_mesh){ 0 };
    if (!depth) return APSM_ERR_MEMORY;
    const double on = near * apsm_mesh_mean_edge(mesh);
    for (size_t v = 0; v < mesh->nv; v++) {
        depth[v] = plane[3] - vec3_dot(plane, mesh->V + 3 * v);
        if (fabs(depth[v]) < on) depth[v] = 0.0;
    }
    const apsm_status status = apsm_mesh_clip_field(mesh, depth, clipped);
    free(depth);
    return status;
}

static apsm_status clip_by_all(const apsm_mesh *mesh, size_t n, const double (*plane)[4],
                               apsm_mesh *clipped)
{
    APSM_TRY(apsm_mesh_copy(mesh, clipped));
    for (size_t k = 0; k < n; k++) {
        apsm_mesh whole = *clipped;
        const apsm_status status = apsm_mesh_clip(&whole, plane[k], clipped);
        apsm_mesh_free(&whole);
        APSM_TRY(status);
    }
    return APSM_OK;
}

apsm_status apsm_crop_mesh(apsm_context *ctx, const char *name, const apsm_mesh *mesh, size_t n,
                           const double (*plane)[4], const apsm_groom_options *options,
                           apsm_mesh *cropped)
{
    apsm_groom_options opt = options ? *options : apsm_groom_defaults();
    apsm_mesh open = { 0 };
    *cropped = (apsm_mesh){ 0 };
    opt.fill_holes = opt.fill = opt.largest_component = true;
    apsm_status status = clip_by_all(mesh, n, plane, &open);
    if (status == APSM_OK) status = apsm_repair(ctx, name, &open, &opt, cropped, NULL);
    apsm_mesh_free(&open);
    if (status == APSM_OK && !opt.remesh)
        for (size_t x = 0; x < 3 * cropped->nv; x++) cropped->V[x] = (double)(float)cropped->V[x];
    if (status == APSM_OK && opt.remesh) {
        status = groom_remesh(ctx, name, cropped, &opt.remesh_options, NULL);
        if (status != APSM_OK) apsm_mesh_free(cropped);
    }
    return status;
}
