#include "joint/shared_boundary.h"

#include <math.h>
#include <stdlib.h>

#include "geometry/clip.h"

static const double facing = 0.3; /* cosine of the other's normal with the opposite of one's own */
static const double most = 4.0;   /* tolerances: farther is all the same */

/* away (nv, out): distance of a surface's vertices from the other, facing them, less tolerance. */
static apsm_status measure_away(const apsm_mesh *mesh, const apsm_bvh *other, double tolerance,
                                double *away)
{
    double *N = malloc(3 * mesh->nv * sizeof *N + 1);
    const double reach = most * tolerance;
    if (!N) return APSM_ERR_MEMORY;
    apsm_mesh_vertex_normals(mesh, N);
    for (size_t v = 0; v < mesh->nv; v++) {
        const double n[3] = { -N[3 * v], -N[3 * v + 1], -N[3 * v + 2] };
        apsm_closest hit;
        apsm_bvh_closest_facing(other, mesh->V + 3 * v, n, facing, reach * reach, &hit);
        away[v] = fmin(sqrt(hit.distance2), reach) - tolerance;
    }
    free(N);
    return APSM_OK;
}

/* rest and shared (NULL: not wanted) of one surface. */
static apsm_status split_one(const apsm_mesh *mesh, const apsm_bvh *other, double tolerance,
                             apsm_mesh *rest, apsm_mesh *shared)
{
    double *away = malloc(mesh->nv * sizeof *away + 1);
    apsm_status status = away ? measure_away(mesh, other, tolerance, away) : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_mesh_clip_field(mesh, away, rest);
    for (size_t v = 0; v < mesh->nv && status == APSM_OK; v++) away[v] = -away[v];
    if (status == APSM_OK && shared) status = apsm_mesh_clip_field(mesh, away, shared);
    free(away);
    return status;
}

apsm_status apsm_split_shared(const apsm_bvh *a, const apsm_bvh *b, double tolerance,
                              apsm_shared_boundary *split)
{
    *split = (apsm_shared_boundary){ 0 };
    apsm_status status = split_one(apsm_bvh_mesh(a), b, tolerance, &split->rest[0], &split->shared);
    if (status == APSM_OK)
        status = split_one(apsm_bvh_mesh(b), a, tolerance, &split->rest[1], NULL);
    if (status == APSM_OK &&
        (split->shared.nf == 0 || split->rest[0].nf == 0 || split->rest[1].nf == 0))
        status = APSM_ERR_GEOMETRY;
    if (status != APSM_OK) apsm_shared_boundary_free(split);
    return status;
}

void apsm_shared_boundary_free(apsm_shared_boundary *split)
{
    apsm_mesh_free(&split->rest[0]);
    apsm_mesh_free(&split->rest[1]);
    apsm_mesh_free(&split->shared);
}
