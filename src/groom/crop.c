/* Cuts a closed surface with planes and closes it flat: what all shapes of a cohort hold remains.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/topology.h"
#include "geometry/vec3.h"
#include "groom/common_ends.h"
#include "groom/repair.h"

/* Vertices so near the plane, in edges, are on it: no slivers. */
static const double near = 0.05;

/* Faces of the clipped mesh as they come; crossing[k] is the new vertex on half-edge k,
 * strictly between its ends. */
typedef struct clip {
    const apsm_mesh *mesh;
    const double *height; /* of the vertices over the plane */
    const apsm_topology *topology;
    uint32_t *crossing; /* 3 nf, APSM_NONE: none yet */
    apsm_mesh out;
} clip;

/* Where half-edge k, one end of which is above the plane and one is not, crosses it.  Computed from
 * the end that stays, so that both faces get the same number. */
static uint32_t cross(clip *c, uint32_t k)
{
    const uint32_t twin = c->topology->twin[k];
    const uint32_t *F = c->mesh->F, next = k % 3 == 2 ? k - 2 : k + 1;
    const uint32_t in = c->height[F[k]] > 0.0 ? F[next] : F[k], out = in == F[k] ? F[next] : F[k];
    if (c->height[in] == 0.0) return in;
    if (c->crossing[k] != APSM_NONE) return c->crossing[k];
    const double *a = c->mesh->V + 3 * in, *b = c->mesh->V + 3 * out;
    const double t = c->height[in] / (c->height[in] - c->height[out]);
    double *x = c->out.V + 3 * c->out.nv;
    for (size_t e = 0; e < 3; e++) x[e] = a[e] + t * (b[e] - a[e]);
    c->crossing[k] = (uint32_t)c->out.nv++;
    if (twin != APSM_NONE) c->crossing[twin] = c->crossing[k];
    return c->crossing[k];
}

/* What of face f remains: nothing, a triangle, or a quadrangle in two triangles. */
static void clip_face(clip *c, uint32_t f)
{
    uint32_t corner[6];
    size_t n = 0;
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t a = c->mesh->F[3 * f + k], b = c->mesh->F[3 * f + (k + 1) % 3];
        const bool stays = c->height[a] <= 0.0;
        if (stays && (n == 0 || corner[n - 1] != a)) corner[n++] = a;
        if (stays == (c->height[b] <= 0.0)) continue;
        const uint32_t x = cross(c, 3 * f + k);
        if (n == 0 || corner[n - 1] != x) corner[n++] = x;
    }
    if (n > 0 && corner[n - 1] == corner[0]) n--;
    for (size_t k = 2; k < n; k++) {
        uint32_t *F = c->out.F + 3 * c->out.nf++;
        F[0] = corner[0];
        F[1] = corner[k - 1];
        F[2] = corner[k];
    }
}

static apsm_status clip_all(clip *c)
{
    const size_t nv = c->mesh->nv, nf = c->mesh->nf;
    APSM_TRY(apsm_mesh_alloc(&c->out, nv + 3 * nf, 2 * nf));
    memcpy(c->out.V, c->mesh->V, 3 * nv * sizeof *c->out.V);
    c->out.nv = nv;
    c->out.nf = 0;
    memset(c->crossing, 0xff, 3 * nf * sizeof *c->crossing);
    for (size_t f = 0; f < nf; f++) clip_face(c, (uint32_t)f);
    return repair_drop(&c->out, NULL);
}

apsm_status apsm_mesh_clip(const apsm_mesh *mesh, const double plane[4], apsm_mesh *clipped)
{
    apsm_topology topology = { 0 };
    double *height = malloc((mesh->nv + 1) * sizeof *height);
    clip c = { .mesh = mesh, .height = height, .topology = &topology };
    *clipped = (apsm_mesh){ 0 };
    c.crossing = malloc((3 * mesh->nf + 1) * sizeof *c.crossing);
    apsm_status status = height && c.crossing ? APSM_OK : APSM_ERR_MEMORY;
    if (status == APSM_OK) status = apsm_topology_build(mesh, &topology);
    const double on = near * apsm_mesh_mean_edge(mesh);
    for (size_t v = 0; v < mesh->nv && status == APSM_OK; v++) {
        height[v] = vec3_dot(plane, mesh->V + 3 * v) - plane[3];
        if (fabs(height[v]) < on) height[v] = 0.0;
    }
    if (status == APSM_OK) status = clip_all(&c);
    if (status == APSM_OK)
        *clipped = c.out;
    else
        apsm_mesh_free(&c.out);
    apsm_topology_free(&topology);
    free(c.crossing);
    free(height);
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
    opt.fill_holes = opt.keep_largest = true;
    opt.max_cap_share = 1.0;
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
